"""How a run is to be drawn: colours, span, frame and magnification, the same for all its pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.reading import Run

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.colors import Colormap

#: Name on the command line → (array, column, how it is written).
COMPONENTS = {
    "xx": ("stress", 0, "σxx"),
    "yy": ("stress", 1, "σyy"),
    "zz": ("stress", 2, "σzz"),
    "xy": ("stress", 3, "σxy"),
    "principal_max": ("principal_stress", 0, "σ₁"),
    "principal_min": ("principal_stress", 2, "σ₃"),
    "von_mises": ("", -1, "von Mises"),
}

#: What the colour of cracks means → the legend's title.
CRACK_COLOURS = {"birth": "grown in cycle", "opening": "opening, µm"}

#: The largest displacement relative to the block system, drawn as this fraction of its size.
DEFORMATION = 0.03
#: Stress at a crack tip is singular: the colours span these percentiles of the rock's area and end there.
ROBUST = (1.5, 98.5)


@dataclass(frozen=True)
class Look:
    """What stays the same from frame to frame. ``bounds`` (x0, x1, y0, y1) m as drawn; ``limits`` MPa; ``scale`` of
    the displacement; ``cracks`` the array that colours them and ``crack_limits`` its span (equal: all the same)."""

    component: str
    bounds: tuple[float, float, float, float]
    limits: tuple[float, float]
    scale: float
    cracks: str
    crack_limits: tuple[float, float]
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
    elif scale is None:
        scale = _magnification(blocks, max(x1 - x0, y1 - y0))
    # The frame holds what there was at the start as well: rock that runs out leaves its place.
    first = run.grid("blocks", min(run.grids("blocks")))
    drawn = np.concatenate([grid.points[:, :2] + scale * grid["displacement"][:, :2] for grid in (first, blocks)])
    (x0, y0), (x1, y1) = drawn.min(axis=0), drawn.max(axis=0)
    interior = interior_grid(run, cycle)
    source = interior if interior is not None else blocks
    return Look(
        component=component,
        bounds=(x0, x1, y0, y1),
        limits=_limits(source, component),
        scale=scale,
        cracks=crack_colour,
        crack_limits=_crack_limits(run, cycle, crack_colour),
        width=width,
    )


def _crack_limits(run: Run, cycle: int, colour: str) -> tuple[float, float]:
    cracks = run.grid("cracks", cycle)
    if colour == "birth":
        grown = cracks["birth_cycle"][cracks["birth_cycle"] > 0]
        return (float(grown.min()), float(grown.max())) if len(grown) else (0.0, 0.0)
    opening = np.abs(cracks["opening"][np.isfinite(cracks["opening"])]) * 1e6
    return (0.0, float(np.percentile(opening, 98))) if len(opening) else (0.0, 0.0)


def _magnification(blocks: pv.UnstructuredGrid, size: float) -> float:
    # A common translation shows nothing; what counts is how far points move against each other.
    spread = np.ptp(blocks["displacement"], axis=0).max()
    if spread <= 1e-12 * size:
        return 1.0
    scale = DEFORMATION * size / spread
    # Motion that is large enough to be seen is drawn true.
    return max(1.0, float(f"{scale:.1g}")) if scale > 1 else 1.0


def _limits(grid: pv.UnstructuredGrid, component: str) -> tuple[float, float]:
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
        return float(middle - half), float(middle + half)
    return float(low), float(high)


def values(grid: pv.UnstructuredGrid, component: str) -> np.ndarray:
    """MPa, at the points of an interior grid or the cells of a block grid."""
    array, column, _ = COMPONENTS[component]
    data = grid.cell_data if "stress" in grid.cell_data else grid.point_data
    if not array:
        s1, s2, s3 = np.asarray(data["principal_stress"], dtype=float).T
        return np.sqrt(0.5 * ((s1 - s2) ** 2 + (s2 - s3) ** 2 + (s3 - s1) ** 2)) / 1e6
    return np.asarray(data[array], dtype=float)[:, column] / 1e6


def interior_grid(run: Run, cycle: int) -> pv.UnstructuredGrid | None:
    try:
        grid = run.grid("interior", cycle)
    except KeyError:
        return None
    return grid if grid.n_cells else None
