"""Blocks cut into triangles for drawing, because VTK fills concave polygons and holes wrongly."""

from __future__ import annotations

import numpy as np

from geomech.model import Blocks


class Triangles:
    """The triangles of a block system, kept from call to call for every block whose outline has not changed."""

    def __init__(self) -> None:
        self._blocks: Blocks | None = None
        self._cells: tuple[np.ndarray, np.ndarray] = (np.empty((0, 3), int), np.empty(0, int))
        self._known: dict[bytes, np.ndarray] = {}

    def of(self, blocks: Blocks) -> tuple[np.ndarray, np.ndarray]:
        """(triangles (m, 3) of vertex indices, owner (m,) their blocks) of the reference outlines. Raises ValueError
        naming a block whose outline crosses itself."""
        if blocks is self._blocks:
            return self._cells
        known, cells, owner = {}, [], []
        for b in range(blocks.n_blocks):
            loops = blocks.loops(b)
            key = b"".join(loop.tobytes() + b"|" for loop in loops)
            triangles = self._known.get(key)
            if triangles is None:
                simple = len(loops) == 1 and _convex(loops[0])
                triangles = _fan(loops[0]) if simple else _delaunay(loops, blocks.names[b])
            known[key] = triangles
            cells.append(triangles + blocks.vertex_start[b])
            owner.append(np.full(len(triangles), b))
        self._blocks, self._known = blocks, known
        self._cells = (np.concatenate(cells), np.concatenate(owner)) if cells else self._cells
        return self._cells


def _convex(loop: np.ndarray) -> bool:
    """Strictly convex: a straight corner would make a fan's triangle flat."""
    edge = np.roll(loop, -1, axis=0) - loop
    before = np.roll(edge, 1, axis=0)
    cross = before[:, 0] * edge[:, 1] - before[:, 1] * edge[:, 0]
    length = np.hypot(edge[:, 0], edge[:, 1])
    # One turn only: a pentagram turns left at every corner as well.
    turn = np.arctan2(cross, np.einsum("ij,ij->i", before, edge)).sum()
    return bool((cross > 1e-9 * length * np.roll(length, 1)).all() and abs(turn - 2 * np.pi) < 1e-6)


def _fan(loop: np.ndarray) -> np.ndarray:
    k = np.arange(1, len(loop) - 1)
    return np.stack([np.zeros_like(k), k, k + 1], axis=1)


def _delaunay(loops: list[np.ndarray], name: str) -> np.ndarray:
    """Constrained Delaunay triangles on the loops' own vertices, counter-clockwise, no points added."""
    import shapely

    polygon = shapely.Polygon(loops[0], loops[1:])
    if not polygon.is_valid:
        raise ValueError(f"{name}: {shapely.is_valid_reason(polygon)}")
    corners = shapely.get_coordinates(shapely.constrained_delaunay_triangles(polygon)).reshape(-1, 4, 2)[:, :3]
    index = {tuple(point): k for k, point in enumerate(np.concatenate(loops).tolist())}
    triangles = np.array([[index[tuple(point)] for point in corner] for corner in corners.tolist()])
    a, b, c = corners.transpose(1, 0, 2)
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return triangles
