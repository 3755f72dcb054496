"""A grid of small scenes with a reference each, and their outcomes.

Every cell is right (within the stated bound), refused with a reason, reported (beyond the bound, with a warning), or
wrong.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass

from ... import dda
from .stability_scenes import Outcome

RIGHT, REPORTED, REFUSED, WRONG = "right", "reported", "refused", "wrong"

#: Quantities of cells of blocks, and of cracks, in addition to the error.
OF_BLOCKS = {
    "penetration": "worst penetration, over the block's size",
    "drift": "energy drift, relative to all energy converted",
    "cuts": "steps cut",
}
OF_CRACKS = {"condition": "condition number", "residual": "residual"}
QUANTITIES = {**OF_CRACKS, **OF_BLOCKS}


@dataclass(frozen=True)
class Cell:
    """One cell of a map: parameters, outcome, and time."""

    map: str
    row: str
    column: str
    verdict: str
    error: float
    penetration: float
    gain: float
    drift: float
    cuts: float
    condition: float
    residual: float
    reason: str = ""


@dataclass(frozen=True)
class Map:
    """A grid of scenes: ``scene(row, column)`` for every pair of values; right if the error is below ``bound``."""

    title: str
    measure: str
    row_name: str
    rows: Sequence[float]
    column_name: str
    columns: Sequence[float]
    bound: float
    scene: Callable[[float, float], Outcome]

    def cells(self) -> Iterator[Cell]:
        for row in self.rows:
            for column in self.columns:
                verdict, found, reason = self._judged(row, column)
                yield Cell(self.title, f"{row:g}", f"{column:g}", verdict, **asdict(found), reason=reason)

    def _judged(self, row: float, column: float) -> tuple[str, Outcome, str]:
        collected = _Warnings()
        log = logging.getLogger("geomech")
        log.addHandler(collected)
        try:
            found = self.scene(row, column)
        except (ValueError, dda.NotConverged) as refusal:
            return REFUSED, Outcome(math.nan), str(refusal)
        finally:
            log.removeHandler(collected)
        if found.error <= self.bound:
            return RIGHT, found, ""
        return (REPORTED, found, collected.first) if collected.first else (WRONG, found, "")


class _Warnings(logging.Handler):
    """Keeps the first warning."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.first = ""

    def emit(self, record: logging.LogRecord) -> None:
        self.first = self.first or record.getMessage()


def table(grid: Map, cells: Sequence[Cell]) -> Iterator[str]:
    """The lines of a map as text."""
    yield f"{grid.title}: {grid.measure} (right below {grid.bound:g}); {grid.row_name} down, {grid.column_name} across"
    yield " " * 10 + "".join(f"{value:>11g}" for value in grid.columns)
    for k, row in enumerate(grid.rows):
        row_cells = cells[k * len(grid.columns) : (k + 1) * len(grid.columns)]
        marks = (
            f"{c.error:.1e}" + ("!" if c.verdict == WRONG else "") if c.verdict != REFUSED else "refused"
            for c in row_cells
        )
        yield f"{row:>10g}" + "".join(f"{mark:>11}" for mark in marks)
    for verdict in (REFUSED, REPORTED):
        for reason in sorted({c.reason for c in cells if c.verdict == verdict})[:2]:
            yield f"    {verdict}: {reason}"
    solved = [c for c in cells if c.verdict != REFUSED]
    parts = []
    for quantity, name in QUANTITIES.items():
        known = [value for value in (getattr(c, quantity) for c in solved) if not math.isnan(value)]
        if known and quantity == "cuts":
            parts.append(f"{sum(known):g} steps cut")
        elif known:
            parts.append(f"{name.split(',')[0]} {max(known):.1e}")
    yield "    largest " + ", ".join(parts)
