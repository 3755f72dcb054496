"""Cracks on a picture, as wide as their opening (at least a line), coloured by the cycle of growth or by opening."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..pictures.field import face_displacements
from ..pictures.look import crack_colours, crack_limits, final_cycle
from ..pictures.walls import Walls
from .frame import Frames, drawn, reference

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.axes import Axes

#: Initial cracks have no cycle of growth: black.
OLD = "#15161a"
#: Line widths in points: white border, grown crack, initial crack.
_HALO, _GROWN, _OLD = 3.3, 1.7, 2.0


class CrackLines:
    """Cracks of ``frames.run`` and faces along which blocks were cut, with displacements times ``scale``.

    ``colour`` is "birth" (the cycle in which a piece grew), "opening", or None for one dark colour. Raises KeyError for
    another ``colour``.
    """

    def __init__(self, frames: Frames, scale: float, colour: str | None) -> None:
        self.frames, self.scale, self.colour = frames, scale, colour
        self.limits = (0.0, 0.0)
        self.walls: Walls | None = None
        if colour is not None:
            self.limits = crack_limits(frames.run, final_cycle(frames.run), colour)
        if colour == "birth":
            self.walls = Walls.of(frames.run)

    @property
    def legend(self) -> bool:
        """Whether there are several colours that need a legend."""
        return self.limits[1] > self.limits[0]

    def style(self) -> dict[str, Any]:
        """Colour map and range of the cracks, for Matplotlib's collections."""
        from matplotlib.colors import Normalize

        low, high = self.limits
        return {"cmap": crack_colours(), "norm": Normalize(low, high if high > low else low + 1.0)}

    def draw(self, axes: Axes, time: float, interior: pv.UnstructuredGrid | None) -> None:
        """The cracks at ``time`` (s), between the faces of the ``interior`` mesh, which is split along them."""
        from matplotlib.collections import LineCollection, PolyCollection

        cracks = self.frames.grid("cracks", time)
        if cracks is None or not cracks.n_cells:
            return
        at, ends = reference(cracks), cracks.cells.reshape(-1, 3)[:, 1:]
        upper = lower = np.asarray(cracks["displacement"])[:, :2]
        if interior is not None and self.scale:
            # The block's own motion if the mesh has no face there: a crack newer than the field.
            found = face_displacements(_as_drawn(interior), _as_drawn(cracks))
            known = np.isfinite(found[0]).all(axis=1) & np.isfinite(found[1]).all(axis=1)
            upper, lower = (np.where(known[:, None], face[:, :2], upper) for face in found)
        upper, lower = at + self.scale * upper, at + self.scale * lower
        gaps = np.concatenate([upper[ends], lower[ends][:, ::-1]], axis=1)
        lines = 0.5 * (upper + lower)[ends]
        halo = LineCollection([*upper[ends], *lower[ends]], colors="white", linewidths=_HALO, alpha=0.75, zorder=5.8,
                              capstyle="round")  # fmt: skip
        axes.add_collection(halo)
        values, old = self._values(cracks)
        for part, width, ink in self._parts(values, old):
            fill = axes.add_collection(PolyCollection(gaps[part], linewidths=0.4, zorder=6.0, **ink))
            fill.set_edgecolor("face")  # otherwise seams would be visible
            axes.add_collection(LineCollection(lines[part], linewidths=width, capstyle="round", zorder=6.1, **ink))

    def _parts(self, values: np.ndarray, old: np.ndarray) -> list[tuple[np.ndarray, float, dict[str, Any]]]:
        """(which lines, their width, their colour) of grown and of ``old`` cracks."""
        parts = ((~old, _GROWN, {"array": values[~old], **self.style()}), (old, _OLD, {"color": OLD}))
        return [each for each in parts if each[0].any()]

    def _values(self, cracks: pv.UnstructuredGrid) -> tuple[np.ndarray, np.ndarray]:
        """(n_cells,) values that colour the lines, and which of the lines are initial cracks."""
        if self.colour == "opening":
            opening = np.asarray(cracks.point_data["opening"], float)[cracks.cells.reshape(-1, 3)[:, 1:]]
            return 1e6 * opening.mean(axis=1), np.zeros(cracks.n_cells, bool)
        birth = np.asarray(cracks.cell_data["birth_cycle"], float)
        return birth, birth == 0 if self.colour == "birth" else np.ones(cracks.n_cells, bool)

    def draw_walls(self, axes: Axes, grid: pv.UnstructuredGrid, edges: np.ndarray, cycle: int) -> None:
        """Those of the ``edges`` (n, 2) of ``grid`` that were cracks, in the colour of the former crack."""
        from matplotlib.collections import LineCollection

        if self.walls is None or not len(self.walls.cut):
            return
        birth = self.walls.births(reference(grid)[edges], cycle)
        lines = drawn(grid, self.scale)[edges]
        left = birth >= 0
        for part, width, ink in self._parts(birth[left].astype(float), birth[left] == 0):
            axes.add_collection(
                LineCollection(lines[left][part], linewidths=width, capstyle="round", zorder=6.1, **ink)
            )


def _as_drawn(grid: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """``grid`` in its initial position."""
    if int(grid.field_data["REFERENCE"][0]):
        return grid
    before = grid.copy()
    before.points = np.column_stack([reference(grid), np.zeros(grid.n_points)])
    return before
