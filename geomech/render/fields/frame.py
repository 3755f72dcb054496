"""Grids of a run at any time, interpolated between written cycles with the mean velocity of the blocks."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.reading import Run

if TYPE_CHECKING:
    import pyvista as pv


class Frames:
    """Reads the grids of ``run`` and interpolates in time between two with the same points and cells."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self._times: dict[str, tuple[np.ndarray, list[int]]] = {}
        self._read = lru_cache(maxsize=24)(run.grid)

    def grid(self, name: str, time: float) -> pv.UnstructuredGrid | None:
        """The series ``name`` at ``time`` (s) of its PVD; the first one before its start; None if it was not
        written."""
        if name not in self._times:
            series = self.run.series(name)
            self._times[name] = np.array([at for at, _ in series]), list(self.run.grids(name))
        times, cycles = self._times[name]
        if not len(times):
            return None
        k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 1))
        grid = self._read(name, cycles[k]).copy()
        if k + 1 < len(times) and time > times[k] and grid.n_points:
            after = self._read(name, cycles[k + 1])
            same = after.n_points == grid.n_points and np.array_equal(after.cells, grid.cells)
            if same and np.allclose(reference(after), reference(grid), rtol=0, atol=1e-9 * grid.length):
                share = (time - times[k]) / (times[k + 1] - times[k])
                grid.points = (1 - share) * np.asarray(grid.points) + share * np.asarray(after.points)
                for data, other in ((grid.point_data, after.point_data), (grid.cell_data, after.cell_data)):
                    for key in list(data):
                        if data[key].dtype.kind == "f":
                            data[key] = (1 - share) * np.asarray(data[key]) + share * np.asarray(other[key])
        return grid

    def span(self) -> tuple[float, float]:
        """First and last time of the blocks, s."""
        times = [at for at, _ in self.run.series("blocks")]
        return times[0], times[-1]

    def cycle_time(self, cycle: int) -> float:
        """Time, s, of ``cycle`` in the list of blocks, or of the last one written before it. Raises KeyError for a
        cycle before the first."""
        found = [at for (at, _), number in zip(self.run.series("blocks"), self.run.grids("blocks")) if number <= cycle]
        if not found:
            raise KeyError(f"{self.run.folder}: nothing was written up to cycle {cycle}")
        return found[-1]


def reference(grid: pv.DataSet) -> np.ndarray:
    """(n, 2) m, initial points."""
    points = np.asarray(grid.points)[:, :2]
    return points if int(grid.field_data["REFERENCE"][0]) else points - np.asarray(grid["displacement"])[:, :2]


def drawn(grid: pv.DataSet, scale: float) -> np.ndarray:
    """(n, 2) m, points with their displacement times ``scale``."""
    return reference(grid) + scale * np.asarray(grid["displacement"])[:, :2]
