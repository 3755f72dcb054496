"""Building blocks of scene tables: types of values, and a table that refuses unknown keys."""

from __future__ import annotations

from typing import Annotated, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
# TOML has arrays only; their numbers are checked strictly.
Pair = Annotated[tuple[Finite, Finite], Strict(False)]
Four = Annotated[tuple[Finite, Finite, Finite, Finite], Strict(False)]
Points = Annotated[tuple[Pair, ...], Strict(False)]
Names = Annotated[tuple[str, ...], Strict(False)]

_Value = TypeVar("_Value")


def given(value: _Value | None) -> _Value:
    """``value`` of a key that may be unset in general, but not here, as the scene's checks ensure."""
    if value is None:
        raise TypeError("a key is unset that the checks of the scene ask for")
    return value


#: Bytes: file systems allow names up to 255, and files written next to a folder may extend its name.
LONGEST_FOLDER = 200


def _folder(name: str) -> str:
    """``name`` if it can be the name of a folder."""
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

    # Validators are built with those of the whole scene, not for each table.
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, populate_by_name=True, defer_build=True)
