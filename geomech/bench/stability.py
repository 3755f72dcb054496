"""Where the block solver stays right: maps over penalty, time step, contrasts, slivers, offsets, overlaps, speeds, debris.

Every cell is a small scene with a reference that was not computed with it: right (within the bound said), refused with a
reason, reported (beyond the bound, and a warning says so), or wrong. The bounds leave room for true elasticity only.
"""

from __future__ import annotations

import json
import logging
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from .. import dda
from . import stability_scenes as scenes
from .figures import Measured
from .stability_scenes import Outcome

RIGHT, REPORTED, REFUSED, WRONG = "right", "reported", "refused", "wrong"


@dataclass(frozen=True)
class Cell:
    map: str
    row: str
    column: str
    verdict: str
    error: float
    penetration: float
    gain: float
    cuts: int
    reason: str = ""


@dataclass(frozen=True)
class Map:
    """A grid of scenes: ``scene(row, column)`` for every pair of values; right where its error is below ``bound``."""

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
        heard = _Warnings()
        log = logging.getLogger("geomech")
        log.addHandler(heard)
        try:
            found = self.scene(row, column)
        except (ValueError, dda.NotConverged) as refusal:
            return REFUSED, Outcome(math.nan, math.nan, math.nan), str(refusal)
        finally:
            log.removeHandler(heard)
        if found.error <= self.bound:
            return RIGHT, found, ""
        return (REPORTED, found, heard.first) if heard.first else (WRONG, found, "")


class _Warnings(logging.Handler):
    """Keeps the first warning it hears."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.first = ""

    def emit(self, record: logging.LogRecord) -> None:
        self.first = self.first or record.getMessage()


def measure(quick: bool = False) -> Measured:
    """The maps as text; JSON and a picture go to outputs/stability. ``quick`` takes every other value."""
    from ..render.stability_map import draw

    maps = list(_maps(quick))
    lines, every = [], []
    for grid in maps:
        cells = list(grid.cells())
        every += cells
        lines += [*_table(grid, cells), ""]
    counts = Counter(cell.verdict for cell in every)
    lines.append("  ".join(f"{counts[verdict]} {verdict}" for verdict in (RIGHT, REPORTED, REFUSED, WRONG)))
    folder = Path("outputs/stability")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "stability.json").write_text(json.dumps([asdict(cell) for cell in every], indent=1), encoding="utf-8")
    draw(maps, every, folder / "stability.png")
    lines.append(f"{folder}/stability.json, {folder}/stability.png")
    # Not each cell's own: many are round-off. A cell that was right and is not, shows in the share.
    wrong = {f"{grid.title}: share of cells not right": 0.0 for grid in maps}
    for grid in maps:
        verdicts = [cell.verdict for cell in every if cell.map == grid.title]
        wrong[f"{grid.title}: share of cells not right"] = 1 - verdicts.count(RIGHT) / len(verdicts)
    return Measured.of("\n".join(lines), errors=wrong)


def _table(grid: Map, cells: Sequence[Cell]) -> Iterator[str]:
    yield f"{grid.title}: {grid.measure} (right below {grid.bound:g}); {grid.row_name} down, {grid.column_name} across"
    yield " " * 10 + "".join(f"{value:>11g}" for value in grid.columns)
    for k, row in enumerate(grid.rows):
        mine = cells[k * len(grid.columns) : (k + 1) * len(grid.columns)]
        marks = (
            f"{c.error:.1e}" + ("!" if c.verdict == WRONG else "") if c.verdict != REFUSED else "refused" for c in mine
        )
        yield f"{row:>10g}" + "".join(f"{mark:>11}" for mark in marks)
    for verdict in (REFUSED, REPORTED):
        for reason in sorted({c.reason for c in cells if c.verdict == verdict})[:2]:
            yield f"    {verdict}: {reason}"
    worst = max((c.penetration for c in cells if c.verdict != REFUSED), default=0.0)
    gain = max((c.gain for c in cells if c.verdict != REFUSED), default=0.0)
    yield f"    worst penetration {worst:.1e} of a block, energy gain {gain:.1e}, {sum(c.cuts for c in cells)} steps cut"


def _maps(quick: bool) -> Iterator[Map]:
    def some(*values: float) -> tuple[float, ...]:
        return values[::2] if quick else values

    penalties, steps = some(1, 10, 40, 100, 1e3, 1e4), some(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10)
    ratios = some(1e-6, 1e-4, 1e-2, 1, 1e2, 1e4, 1e6)
    off = "travel off the rigid block's, over the travel and three elastic shortenings"
    yield Map(
        "sliding, 15° on 30°", off, "penalty / E'", penalties, "dt, s", steps, 5e-2, partial(scenes.incline, 15.0)
    )
    yield Map(
        "sticking, 35° on 30°", off, "penalty / E'", penalties, "dt, s", steps, 1.0, partial(scenes.incline, 35.0)
    )
    load = "contact forces of a column off its weight"
    yield Map("contrast in a column", load, "stiffness", ratios, "density", ratios, 1e-6, scenes.column)
    slivers = some(1, 10, 100, 1000, 1e4)
    yield Map("slivers in a column", load, "aspect", slivers, "0 plate, 1 wedge", (0, 1), 1e-4, scenes.sliver)
    yield Map(
        "size contrast, sliding",
        off,
        "small block, m",
        some(1e-3, 1e-2, 0.1, 1),
        "dt, s",
        (1e-3, 1e-2),
        1e-2,
        scenes.small,
    )
    yield Map(
        "grid of squares",
        load,
        "blocks a side",
        (2, 4, 6) if quick else (2, 4, 6, 10),
        "0 stacked, 1 in bond",
        (0, 1),
        1e-6,
        scenes.grid_of_squares,
    )
    starts = (-1e-2, -1e-4, -1e-6, 0, 1e-6, 1e-4, 1e-2)
    yield Map(
        "overlap and gap at the start",
        "rest off the column's height, over the block",
        "gap / size",
        starts,
        "dt, s",
        (1e-3, 1e-2),
        1e-3,
        scenes.start,
    )
    yield Map(
        "far from the origin",
        "travel off the one at the origin",
        "offset, m",
        some(0, 1e3, 1e5, 1e6, 1e7),
        "dt, s",
        (1e-3, 1e-2),
        1e-3,
        scenes.far,
    )
    yield Map(
        "head-on impact",
        "momentum off, energy gained",
        "speed, m/s",
        some(0.1, 1, 10, 100, 1000),
        "dt, s",
        (1e-5, 1e-3),
        1e-6,
        scenes.impact,
    )
    yield Map(
        "debris of spinning blocks",
        "energy gained, or left behind the floor",
        "seconds",
        (2,) if quick else (2, 20),
        "blocks",
        (12,) if quick else (12, 100),
        1e-3,
        scenes.debris,
    )
