"""What the tables of a scene are made of: kinds of values, and a table that has no other keys than its own."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
# TOML has arrays only; the numbers in them stay strict.
Pair = Annotated[tuple[Finite, Finite], Strict(False)]
Four = Annotated[tuple[Finite, Finite, Finite, Finite], Strict(False)]
Points = Annotated[tuple[Pair, ...], Strict(False)]
Names = Annotated[tuple[str, ...], Strict(False)]

#: Bytes: file systems take names of up to 255, and what is written beside a folder may add to its name.
LONGEST_FOLDER = 200


def _folder(name: str) -> str:
    """``name`` where a folder can be called so, below another and nowhere else."""
    if not name.strip() or name.startswith(".") or any(c in "/\\:" or not c.isprintable() for c in name):
        raise ValueError(
            f"{name!r} cannot be the name of a folder: it must not be empty, begin with a dot, or have a slash, a "
            "backslash, a colon or a control character"
        )
    if len(name.encode("utf-8", "surrogateescape")) > LONGEST_FOLDER:
        raise ValueError(f"{name[:20]!r}… is too long for the name of a folder: at most {LONGEST_FOLDER} bytes")
    return name


#: A name that becomes that of a folder.
FolderName = Annotated[str, AfterValidator(_folder)]


class Table(BaseModel):
    """A table of the scene: no unknown keys, no silent conversions."""

    # Validators are built with those of the whole scene, not for each table as it is defined.
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, populate_by_name=True, defer_build=True)
