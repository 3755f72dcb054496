"""Whether blocks drawn with magnified displacements overlap.

Small displacements that keep blocks apart do so when magnified; blocks that slide far or rotate would be drawn inside
their neighbours, where they never are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pyvista as pv


def overlap(grids: Sequence[pv.UnstructuredGrid], scale: float, depth: float) -> bool:
    """Whether two blocks overlap in a region more than ``depth`` (m) across, with displacements times ``scale``.

    Each block is taken from the last of ``grids`` that contains it: the interior bends.
    """
    import shapely

    drawn: dict[int, object] = {}
    for grid in grids:
        drawn |= _polygons(grid, scale)
    polygons = np.array(list(drawn.values()), dtype=object)
    a, b = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    a, b = a[a < b], b[a < b]
    shared = shapely.buffer(shapely.intersection(polygons[a], polygons[b]), -0.5 * depth)
    return bool((~shapely.is_empty(shared)).any())


def _polygons(grid: pv.UnstructuredGrid, scale: float) -> dict[int, object]:
    """block → the area that it covers in the drawing: the union of its triangles."""
    import shapely

    corners = grid.cells.reshape(-1, 4)[:, 1:]
    block = np.asarray(grid["block_id"])
    block = block if len(block) == len(corners) else block[corners[:, 0]]
    moved = np.asarray(grid.points)[:, :2] + scale * np.asarray(grid["displacement"])[:, :2]
    triangles = shapely.make_valid(shapely.polygons(moved[corners]))
    order = np.argsort(block, kind="stable")
    firsts = np.append(0, np.flatnonzero(np.diff(block[order])) + 1)
    parts = np.split(triangles[order], firsts[1:])
    return {int(block[order[first]]): shapely.union_all(part) for first, part in zip(firsts, parts)}
