"""Limits of the block solver: maps over penalty, time step, contrasts, slivers, offsets, overlaps, speeds, debris, thin
walls; those of blocks of higher order are in `bending_scenes`, of cracks and cracked blocks in `crack_limits`.

Every cell is a small scene with an independent reference: right (within the stated bound), refused with a reason,
reported (beyond the bound, with a warning), or wrong. The bounds allow for true elasticity only.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from ...output.tables.summary import write_json
from ..figures import Measured
from . import bending_scenes, crack_limits, thin_scenes
from . import stability_scenes as scenes
from .stability_grid import OF_BLOCKS, OF_CRACKS, REFUSED, REPORTED, RIGHT, WRONG, Cell, Map, table


def measure(quick: bool = False) -> Measured:
    """The maps as text; cells as JSON, and pictures of blocks, of those of higher order and of cracks, in outputs/stability.

    In a row for each map: errors and verdicts, then penetration, energy drift and cut steps, or condition number and
    residual. ``quick`` takes every second value and fewer steps, and draws errors and verdicts only.
    """
    from ...render.benchmarks.stability_map import draw

    groups = {
        "stability": (list(_maps(quick)), OF_BLOCKS),
        "stability_orders": (list(bending_scenes.maps(quick)), OF_BLOCKS),
        "stability_cracks": (list(crack_limits.maps(quick)), OF_CRACKS),
    }
    lines, every, pictures = [], [], []
    for name, (maps, quantities) in groups.items():
        own: list[Cell] = []
        for grid in maps:
            cells = list(grid.cells())
            own += cells
            lines += [*table(grid, cells), ""]
        every += own
        pictures.append((maps, own, name, quantities))
    counts = Counter(cell.verdict for cell in every)
    lines.append("  ".join(f"{counts[verdict]} {verdict}" for verdict in (RIGHT, REPORTED, REFUSED, WRONG)))
    folder = Path("outputs/stability")
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "stability.json", [asdict(cell) for cell in every])
    # In a quick run the verdicts only: a picture takes as long as a map.
    for maps, own, name, quantities in pictures:
        draw(maps, own, folder / f"{name}.png", {} if quick else quantities)
    lines.append(f"{folder}/stability.json, " + ", ".join(f"{name}.png" for name in groups))
    # Not each cell's own error, many being round-off: a cell that is no longer right changes the share.
    return Measured.of("\n".join(lines), errors=not_right(every))


def not_right(every: Sequence[Cell]) -> dict[str, float]:
    """For each map the share of its cells that are not right."""
    verdicts: dict[str, list[str]] = {}
    for cell in every:
        verdicts.setdefault(cell.map, []).append(cell.verdict)
    return {f"{title}: share of cells not right": 1 - seen.count(RIGHT) / len(seen) for title, seen in verdicts.items()}


def quick_shares(titles: Sequence[str]) -> dict[str, float]:
    """The shares of the maps of blocks with one of these ``titles`` in a quick `measure`."""
    return not_right([cell for grid in _maps(True) if grid.title in titles for cell in grid.cells()])


def _maps(quick: bool) -> Iterator[Map]:
    def some(*values: float) -> tuple[float, ...]:
        return values[::2] if quick else values

    penalties, steps = some(1, 10, 40, 100, 1e3, 1e4), some(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10)
    ratios = some(1e-6, 1e-4, 1e-2, 1, 1e2, 1e4, 1e6)
    most = 100 if quick else 500
    off = "travel off the rigid block's, over the travel and three elastic shortenings"
    yield Map(
        "sliding, 15° on 30°", off, "penalty / E'", penalties, "dt, s", steps, 5e-2, partial(scenes.incline, 15.0, most)
    )
    yield Map(
        "sticking, 35° on 30°", off, "penalty / E'", penalties, "dt, s", steps, 1.0, partial(scenes.incline, 35.0, most)
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
        partial(scenes.small, most),
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
    starts = some(-1e-2, -1e-4, -1e-6, 0, 1e-6, 1e-4, 1e-2)
    yield Map(
        "overlap and gap at the start",
        "rest off the column's height, over the block",
        "gap / size",
        starts,
        "dt, s",
        (1e-3, 1e-2),
        1e-3,
        partial(scenes.start, most),
    )
    yield Map(
        "far from the origin",
        "travel off the one at the origin",
        "offset, m",
        some(0, 1e3, 1e5, 1e6, 1e7),
        "dt, s",
        (1e-3, 1e-2),
        1e-3,
        partial(scenes.far, most),
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
    yield from thin_maps(quick)


def thin_maps(quick: bool) -> Iterator[Map]:
    """Thin walls, spikes and teeth, at speeds up to 1000 m/s."""
    topology = "overlap over half a wall, part of the blocks out, overlaps' energy over a hundredth of all"
    thin = (1e-3, 1e-1) if quick else (1e-3, 1e-2, 1e-1)
    fast = (30.0, 1000.0) if quick else (1.0, 30.0, 1000.0)
    ratio = 0.05
    for kind, rigid in (("elastic", False), ("rigid", True)):
        yield Map(
            f"flying in a ring, {kind}",
            topology,
            "wall, m",
            thin,
            "speed, m/s",
            fast,
            1.0,
            partial(thin_scenes.ring, rigid, ratio),
        )
        yield Map(
            f"thrown on a spike, {kind}",
            topology,
            "foot, m",
            thin,
            "speed, m/s",
            fast,
            1.0,
            partial(thin_scenes.spike, rigid),
        )
    yield Map("rings in rings", topology, "wall, m", thin, "speed, m/s", fast, 1.0, partial(thin_scenes.nested, ratio))
    slow = (0.0, 100.0) if quick else (0.0, 10.0, 100.0)
    for title, scene, walls in (
        ("a chain of hooks", thin_scenes.chain, (0.003, 0.03)),
        ("a comb in a comb", thin_scenes.combs, (0.003, 0.03)),
        ("sticks on sticks", thin_scenes.sticks, (0.001, 0.05)),
        ("a box of debris", thin_scenes.box_of_debris, (0.003, 0.02)),
    ):
        yield Map(title, topology, "wall, m", walls, "speed, m/s", slow, 1.0, partial(scene, ratio))
    yield Map(
        "a cog on a cog", topology, "spin, rad/s", (1.0, 30.0), "teeth", (8, 20), 1.0, partial(thin_scenes.cogs, ratio)
    )
