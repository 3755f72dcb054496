"""Triangulation of blocks for drawing, because VTK fills concave polygons and holes wrongly."""

from __future__ import annotations

import numpy as np

from geomech.model import Blocks


class Triangles:
    """Triangles of a block system, kept while it does not change; those of non-convex blocks, while their outline does
    not."""

    def __init__(self) -> None:
        self._blocks: Blocks | None = None
        self._cells: tuple[np.ndarray, np.ndarray] = (np.empty((0, 3), int), np.empty(0, int))
        self._known: dict[bytes, np.ndarray] = {}

    def of(self, blocks: Blocks) -> tuple[np.ndarray, np.ndarray]:
        """(triangles (m, 3) of vertex indices, owner (m,) their blocks) of the reference outlines. Raises ValueError
        naming a block whose outline crosses itself."""
        if blocks is self._blocks:
            return self._cells
        if blocks.n_blocks == 0:
            return self._cells
        fan = _convex(blocks)
        known, others = {}, []
        for b in np.flatnonzero(~fan).tolist():
            loops = blocks.loops(b)
            key = b"".join(loop.tobytes() + b"|" for loop in loops)
            known[key] = self._known[key] if key in self._known else _delaunay(loops, blocks.names[b])
            others.append(known[key])
        start, corners = blocks.vertex_start[:-1], np.diff(blocks.vertex_start)
        count = corners - 2
        count[~fan] = [len(triangles) for triangles in others]
        first = np.concatenate([[0], np.cumsum(count)])
        owner = np.repeat(np.arange(blocks.n_blocks), count)
        # A fan around the first corner …
        k = np.arange(first[-1]) - first[owner]
        cells = start[owner, None] + np.stack([np.zeros_like(k), k + 1, k + 2], axis=1)
        # … and other triangulations in its place.
        for b, triangles in zip(np.flatnonzero(~fan).tolist(), others, strict=True):
            cells[first[b] : first[b + 1]] = triangles + start[b]
        self._blocks, self._known, self._cells = blocks, known, (cells, owner)
        return self._cells


def _convex(blocks: Blocks) -> np.ndarray:
    """(n_blocks,) strictly convex and without holes: a straight corner would make a triangle of the fan flat."""
    ring, of_loop = blocks.loop_start, np.repeat(np.arange(len(blocks.loop_start) - 1), np.diff(blocks.loop_start))
    after, before = np.arange(1, len(of_loop) + 1), np.arange(-1, len(of_loop) - 1)
    after[ring[1:] - 1], before[ring[:-1]] = ring[:-1], ring[1:] - 1
    edge = blocks.vertices[after] - blocks.vertices
    x, y = edge.T
    cross = x[before] * y - y[before] * x
    length = np.hypot(x, y)
    # One turn only: a pentagram turns left at every corner as well.
    turn = np.bincount(of_loop, np.arctan2(cross, x[before] * x + y[before] * y), len(ring) - 1)
    bent = np.bincount(of_loop, cross <= 1e-9 * length * length[before], len(ring) - 1)
    convex = (bent == 0) & (np.abs(turn - 2 * np.pi) < 1e-6)
    return convex[blocks.block_loop[:-1]] & (np.diff(blocks.block_loop) == 1)


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
