"""How a run is to be drawn: colours, span, frame and magnification, the same for all its pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.reading import Run

from .field import COMPONENTS, interior_grid, values
from .overlaps import overlap
from .walls import Walls

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.colors import Colormap

#: What the colour of cracks means → the legend's title.
CRACK_COLOURS = {"birth": "grown in cycle", "opening": "opening, µm"}

#: The largest displacement relative to the block system, drawn as this fraction of its size.
DEFORMATION = 0.03
#: Blocks may be drawn inside others by this fraction of the size: two pixels of a picture 800 wide.
OVERLAP = 0.0025
#: Stress at a crack tip is singular: the colours span these percentiles of the rock's area and end there.
ROBUST = (0.7, 99.3)


@dataclass(frozen=True)
class Look:
    """What stays the same from frame to frame. ``bounds`` (x0, x1, y0, y1) m as drawn; ``limits`` MPa, ``beyond``
    whether there is stress below and above them; ``scale`` of the displacement; ``cracks`` the array that colours them
    and ``crack_limits`` its span (equal: all the same); ``rock`` the materials that are filled with colour."""

    component: str
    bounds: tuple[float, float, float, float]
    limits: tuple[float, float]
    beyond: tuple[bool, bool]
    scale: float
    cracks: str
    crack_limits: tuple[float, float]
    rock: frozenset[int]
    width: int

    @property
    def upright(self) -> bool:
        """The legend stands beside a tall drawing and lies below a wide one."""
        x0, x1, y0, y1 = self.bounds
        return (x1 - x0) <= 1.25 * (y1 - y0)

    @property
    def colours(self) -> Colormap:
        """Where tension and compression both matter: red tension, blue compression, white none, equally deep for
        equal stress. Where one is everywhere, several hues, since the whole span lies on one side of zero."""
        import matplotlib
        from matplotlib.colors import ListedColormap

        low, high = self.limits
        if low < 0 < high and min(-low, high) > 0.1 * max(-low, high):
            # The outermost tenth of this map is nearly black on both sides.
            at = 0.5 + 0.45 * np.linspace(low, high, 256) / max(-low, high)
            return ListedColormap(matplotlib.colormaps["RdBu_r"](at))
        name = "YlGnBu" if low + high > 0 else "YlGnBu_r"
        return ListedColormap(matplotlib.colormaps[name](np.linspace(0.04, 0.96, 256)))


def final_cycle(run: Run) -> int:
    """The cycle that shows what a run came to: its last one; but where a run ends as its rock is cut, the last one with
    the cracks that cut it, since the pieces have one stress each and nobody waited for them to move."""
    last = int(run.history["cycle"][-1])
    written = list(run.grids("blocks"))
    cracked = run.history[run.history["crack_length"] > 0]
    if not len(cracked) or run.history["crack_length"][-1] > 0 or len(written) < 2:
        return last
    before = cracked[-1]
    return int(before["cycle"]) if before["time"] == run.history["time"][-1] else last


def look(
    run: Run,
    cycle: int,
    *,
    component: str = "yy",
    width: int = 800,
    scale: float | None = None,
    crack_colour: str = "birth",
) -> Look:
    """Colours, frame and magnification that suit ``cycle``, for it and every one before it.

    ``scale`` magnifies displacements (None: so that they are seen); ``crack_colour`` is "birth" (the cycle in which a
    piece grew) or "opening". Raises KeyError for an unknown component or crack colour."""
    if component not in COMPONENTS:
        raise KeyError(f"no stress component {component!r}; there are {', '.join(COMPONENTS)}")
    if crack_colour not in CRACK_COLOURS:
        raise KeyError(f"no crack colour {crack_colour!r}; there are {', '.join(CRACK_COLOURS)}")
    blocks = run.grid("blocks", cycle)
    x0, x1, y0, y1 = blocks.bounds[:4]
    if not int(blocks.field_data["REFERENCE"][0]):
        scale = 0.0  # drawn where they are
    interior = interior_grid(run, cycle)
    shown = [grid for grid in (blocks, interior) if grid is not None]
    if scale is None:
        scale = _magnification(shown, max(x1 - x0, y1 - y0))
    # The frame holds what there was at the start as well: rock that runs out leaves its place.
    first = run.grid("blocks", min(run.grids("blocks")))
    drawn = np.concatenate([grid.points[:, :2] + scale * grid["displacement"][:, :2] for grid in (first, *shown)])
    (x0, y0), (x1, y1) = drawn.min(axis=0), drawn.max(axis=0)
    rock = _rock(blocks, interior)
    limits, beyond = _limits(interior if interior is not None else _filled(blocks, rock), component)
    return Look(
        component=component,
        bounds=(x0, x1, y0, y1),
        limits=limits,
        beyond=beyond,
        scale=scale,
        cracks=crack_colour,
        crack_limits=_crack_limits(run, cycle, crack_colour),
        rock=rock,
        width=width,
    )


def spanning(fixed: Look, run: Run, cycles: Iterable[int]) -> Look:
    """``fixed`` with colours for all of ``cycles``: from rock at rest to the fullest span of any."""
    low, high = fixed.limits
    below, above = fixed.beyond
    for cycle in cycles:
        interior = interior_grid(run, cycle)
        grid = interior if interior is not None else _filled(run.grid("blocks", cycle), fixed.rock)
        (a, b), (under, over) = _limits(grid, fixed.component)
        low, high, below, above = min(low, a), max(high, b), below or under, above or over
    return replace(fixed, limits=(min(low, 0.0), max(high, 0.0)), beyond=(below, above))


def _rock(blocks: pv.UnstructuredGrid, interior: pv.UnstructuredGrid | None) -> frozenset[int]:
    """Beside a solved specimen, other materials (platens) only hold it: their stress would take attention off it.
    Where nothing is solved, blocks that never move are what others rest on."""
    if interior is not None:
        shown = np.isin(blocks["block_id"], np.unique(interior["block_id"]))
    else:
        shown = np.asarray(blocks["fixed"]) == 0
    return frozenset(np.unique(blocks["material"][shown if shown.any() else slice(None)]).tolist())


def _filled(blocks: pv.UnstructuredGrid, rock: frozenset[int]) -> pv.UnstructuredGrid:
    return blocks.extract_cells(filled_cells(blocks, rock))


def filled_cells(blocks: pv.UnstructuredGrid, rock: frozenset[int]) -> np.ndarray:
    """(n_cells,) True for what is filled with colour: blocks of ``rock`` that can move; all where there are none."""
    moving = np.isin(blocks["material"], list(rock)) & (np.asarray(blocks["fixed"]) == 0)
    return moving if moving.any() else np.ones(blocks.n_cells, bool)


def _crack_limits(run: Run, cycle: int, colour: str) -> tuple[float, float]:
    cracks = run.grid("cracks", cycle)
    if colour == "birth":
        walls = Walls.of(run)
        grown = np.concatenate([cracks["birth_cycle"], walls.birth[walls.cut < cycle]])
        grown = grown[grown > 0]
        return (float(grown.min()), float(grown.max())) if len(grown) else (0.0, 0.0)
    opening = np.abs(cracks["opening"][np.isfinite(cracks["opening"])]) * 1e6
    return (0.0, float(np.percentile(opening, 98))) if len(opening) else (0.0, 0.0)


def _magnification(shown: Sequence[pv.UnstructuredGrid], size: float) -> float:
    """A round factor by which displacements are seen, and blocks are not drawn inside others by
    more than the width of a line."""
    # A common translation shows nothing; what counts is how far points move against each other, and cracked blocks give
    # way further than the strain that they have as blocks.
    spread = max(np.ptp(grid["displacement"], axis=0).max() for grid in shown)
    if spread <= 1e-12 * size:
        return 1.0
    scale = DEFORMATION * size / spread
    # Motion that is large enough to be seen is drawn true.
    if scale <= 1:
        return 1.0
    scale = max(1.0, float(f"{scale:.1g}"))
    if overlap(shown, 1.0, OVERLAP * size):
        return scale  # no fault of the factor
    while scale > 1.0 and overlap(shown, scale, OVERLAP * size):
        scale = max(1.0, float(f"{0.5 * scale:.1g}"))
    return scale


def _limits(grid: pv.UnstructuredGrid, component: str) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """MPa between which colours span, and whether there are values below and above."""
    shown = values(grid, component)
    in_cells = len(shown) == grid.n_cells and "stress" in grid.cell_data
    area = grid.compute_cell_sizes(length=False, volume=False)["Area"]
    if in_cells:
        weights = area
    else:
        corners = grid.cells.reshape(-1, 4)[:, 1:]
        weights = np.bincount(corners.ravel(), weights=np.repeat(area / 3, 3), minlength=grid.n_points)
    order = np.argsort(shown)
    share = np.cumsum(weights[order]) / weights.sum() * 100
    low, high = np.interp(ROBUST, share, shown[order])
    if high - low < 1e-6 * max(abs(low), abs(high), 1e-9):
        # A uniform field: a band about its value, or colours would show round-off.
        middle, half = 0.5 * (low + high), max(0.05 * max(abs(low), abs(high)), 1e-9)
        low, high = middle - half, middle + half
    span = high - low
    beyond = bool(shown.min() < low - 0.02 * span), bool(shown.max() > high + 0.02 * span)
    return (float(low), float(high)), beyond
