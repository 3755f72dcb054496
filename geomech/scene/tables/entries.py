"""What the tables of a scene are made of: kinds of values, and a table that has no other keys than its own."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, Strict

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
# TOML has arrays only; the numbers in them stay strict.
Pair = Annotated[tuple[Finite, Finite], Strict(False)]
Four = Annotated[tuple[Finite, Finite, Finite, Finite], Strict(False)]
Points = Annotated[tuple[Pair, ...], Strict(False)]
Names = Annotated[tuple[str, ...], Strict(False)]


class Table(BaseModel):
    """A table of the scene: no unknown keys, no silent conversions."""

    # Validators are built with those of the whole scene, not for each table as it is defined.
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, populate_by_name=True, defer_build=True)
