"""Interior fields of a run at any cycle, and displacements of its crack faces from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.reading import Run, read_grid

if TYPE_CHECKING:
    import pyvista as pv

#: Name on the command line → (array, column, label).
COMPONENTS = {
    "xx": ("stress", 0, "σxx"),
    "yy": ("stress", 1, "σyy"),
    "zz": ("stress", 2, "σzz"),
    "xy": ("stress", 3, "σxy"),
    "principal_max": ("principal_stress", 0, "σ₁"),
    "principal_min": ("principal_stress", 2, "σ₃"),
    "von_mises": ("", -1, "von Mises"),
}

# Number of crack points compared with all edges at a time.
_BATCH = 512


def interior_grid(run: Run, cycle: int) -> pv.UnstructuredGrid | None:
    """The interior at ``cycle``: as written, or interpolated in time between two with the same cracks, or else the last
    one before. None if there is none."""
    files = run.grids("interior")
    before = [number for number in files if number <= cycle]
    if not before:
        return None
    grid = read_grid(files[max(before)])
    if max(before) != cycle and (pair := _around(run, files, cycle)) is not None:
        first, second = pair
        following = read_grid(files[second])
        times = [float(run.at(number)["time"]) for number in (first, cycle, second)]
        if grid.n_points == following.n_points and times[2] > times[0]:
            share = (times[1] - times[0]) / (times[2] - times[0])
            for name in grid.point_data:
                grid[name] = (1 - share) * np.asarray(grid[name]) + share * np.asarray(following[name])
    return grid if grid.n_cells else None


def agreeing(run: Run, cycles: Sequence[int]) -> list[int]:
    """Those of ``cycles`` whose interior belongs to their own cracks; all if no interior was written."""
    files = run.grids("interior")
    if not files:
        return list(cycles)
    return [c for c in cycles if c == 0 or c in files or _around(run, files, c) is not None]


def _around(run: Run, files: Mapping[int, object], cycle: int) -> tuple[int, int] | None:
    """The written interiors before and after ``cycle`` if no crack grew between them."""
    before, after = [n for n in files if n <= cycle], [n for n in files if n >= cycle]
    if not before or not after:
        return None
    first, second = max(before), min(after)
    length = [float(run.at(number)["crack_length"]) for number in (first, second)]
    return (first, second) if length[0] == length[1] > 0 else None


def face_displacements(interior: pv.UnstructuredGrid, cracks: pv.UnstructuredGrid) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) displacement of the upper and of the lower face at the points of the lines ``cracks``.

    It is taken from the mesh split along them; nan elsewhere. Both grids are in the reference configuration.
    """
    points, moved = np.asarray(interior.points)[:, :2], np.asarray(interior["displacement"])
    edges = _free_edges(interior.cells.reshape(-1, 4)[:, 1:])
    start, along = points[edges[:, 0]], points[edges[:, 1]] - points[edges[:, 0]]
    length = np.hypot(*along.T)
    unit = along / length[:, None]
    at, lines = np.asarray(cracks.points)[:, :2], cracks.cells.reshape(-1, 3)[:, 1:]
    tangent = np.zeros_like(at)
    for k in range(2):
        tangent[lines[:, k]] = at[lines[:, 1]] - at[lines[:, 0]]
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-300)[:, None]
    near = 1e-9 * float(np.ptp(points, axis=0).max())
    upper, lower = np.full((len(at), 3), np.nan), np.full((len(at), 3), np.nan)
    for first in range(0, len(at), _BATCH):
        rows = slice(first, first + _BATCH)
        arm = at[rows, None] - start
        position = np.einsum("pex,ex->pe", arm, unit)
        off = np.abs(arm[..., 0] * unit[:, 1] - arm[..., 1] * unit[:, 0])
        same = tangent[rows] @ unit.T
        on = (off < near) & (position > -near) & (position < length + near) & (np.abs(same) > 1 - 1e-9)
        # Rock is on the left of a free edge: on the upper face if the edge runs like the crack.
        for found, side in ((upper, on & (same > 0)), (lower, on & (same < 0))):
            edge = side.argmax(axis=1)
            hit = np.flatnonzero(side.any(axis=1))
            share = (position[hit, edge[hit]] / length[edge[hit]])[:, None]
            a, b = edges[edge[hit]].T
            found[first + hit] = (1 - share) * moved[a] + share * moved[b]
    return upper, lower


def _free_edges(triangles: np.ndarray) -> np.ndarray:
    """(k, 2) edges that belong to one triangle only, with the triangle on their left."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[first[count == 1]]
