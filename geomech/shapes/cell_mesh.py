"""Polygons that fill a block as a mesh of cells with common vertices; short faces are contracted, cells that turn inwards cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

#: Faces shorter than this part of the size (√area) of the cells beside them are contracted to a point (Quey, Dawson & Barbe
#: 2011, Comput. Methods Appl. Mech. Eng. 200, 1729-1745): the mean stress on them would be that of a point.
SHORT = 0.15
#: Two vertices are one, and a vertex is on a line, where their distance is below this part of the block's extent.
SAME = 1e-9
#: A cell is cut at a corner where it turns inwards by more than this angle, rad.
INWARDS = 0.25


@dataclass(frozen=True, eq=False)
class CellMesh:
    """Cells of a block.

    points  (n, 2)   m
    cells            indices of points, counter-clockwise
    sides            ((a, b), edge), a < b, of sides on the edges of the outline, numbered one loop after the other
    """

    points: np.ndarray
    cells: list[list[int]]
    sides: list[tuple[tuple[int, int], int]]


def joined(rings: Sequence[np.ndarray], loops: Sequence[np.ndarray], along: Sequence[np.ndarray]) -> CellMesh:
    """The cells with the outlines ``rings`` (each (n, 2), m) in the block with the outline ``loops``; sides of cells run
    along the lines ``along``. Raises ValueError if they do not fill the block."""
    import shapely

    extent = max(float(np.ptp(loop, axis=0).max()) for loop in loops)
    points, numbers = _common_vertices([*loops, *along, *rings], SAME * extent)
    corner = {v for ring in numbers[: len(loops) + len(along)] for v in ring}
    cells = _with_vertices_on_sides(points, numbers[len(loops) + len(along) :], SAME * extent)
    lines = [shapely.LineString(np.concatenate([loop, loop[:1]])) for loop in loops]
    bounds = shapely.union_all([*lines, *(shapely.LineString(line) for line in along)])
    on_line = shapely.distance(bounds, shapely.points(points)) <= SAME * extent
    mesh = _Contraction(points, cells, np.where(on_line, 1, 0), corner, bounds, SAME * extent)
    mesh.contract()
    cells = [part for cell in mesh.cells for part in _convex(mesh.points, cell)]
    block = shapely.Polygon(loops[0], loops[1:])
    filled = sum(shapely.Polygon(mesh.points[cell]).area for cell in cells)
    if abs(filled - block.area) > 1e-9 * block.area:
        raise ValueError(f"cells fill {filled / block.area:.6f} of it")
    return _numbered(mesh.points, cells, loops, SAME * extent)


def _common_vertices(rings: Sequence[np.ndarray], tolerance: float) -> tuple[np.ndarray, list[list[int]]]:
    """Vertices (n, 2) of ``rings`` of which those within ``tolerance`` are one, the first; and the rings in their numbers."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    every = np.concatenate(rings)
    pairs = cKDTree(every).query_pairs(tolerance, output_type="ndarray")
    near = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(every), len(every)))
    _, group = connected_components(near, directed=False)
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    out, start = [], 0
    for ring in rings:
        own = number[start : start + len(ring)].tolist()
        out.append([v for k, v in enumerate(own) if v != own[k - 1] or len(own) == 1])
        start += len(ring)
    return every[first], out


def _with_vertices_on_sides(points: np.ndarray, cells: list[list[int]], tolerance: float) -> list[list[int]]:
    """Counter-clockwise ``cells`` with the vertices of others that are on their sides."""
    import shapely

    tree, out = shapely.STRtree(shapely.points(points)), []
    for cell in cells:
        if len(cell) < 3:
            continue
        ends = points[np.array([cell, [*cell[1:], cell[0]]])]
        x, y = ends[0].T
        lines = shapely.linestrings(np.moveaxis(ends, 0, 1))
        side, vertex = tree.query(lines, predicate="dwithin", distance=tolerance)
        ring: list[int] = []
        for k, v in enumerate(cell):
            on = [w for w in vertex[side == k].tolist() if w not in (v, cell[(k + 1) % len(cell)])]
            on.sort(key=lambda w: float(np.hypot(*(points[w] - points[v]))))
            ring += [v, *on]
        if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) < 0:
            ring.reverse()
        out.append(ring)
    return out


class _Contraction:
    """Short sides of cells become points, the shortest first.

    points (n, 2) m; fixed (n,): 2 for corners of the outline, which do not move, 1 for
    vertices on an edge of the outline, which stay on it, 0 for others.
    """

    def __init__(self, points, cells, fixed, corner, bounds, tolerance) -> None:
        self.points, self.cells, self.fixed = points.copy(), [list(cell) for cell in cells], fixed
        self.fixed[list(corner)] = 2
        self.bounds, self.tolerance = bounds, tolerance
        self.cells_at: dict[int, set[int]] = {}
        for k, cell in enumerate(self.cells):
            for v in cell:
                self.cells_at.setdefault(v, set()).add(k)

    def contract(self) -> None:
        """Until no side is short that can be contracted."""
        while self._contract_shorter():
            pass

    def _contract_shorter(self) -> bool:
        """Contract sides; whether any has been, which may have made others short."""
        done = False
        size = [self._area(cell) ** 0.5 for cell in self.cells]
        sides = {
            (min(a, b), max(a, b)) for cell in self.cells for a, b in zip(cell, [*cell[1:], *cell[:1]], strict=True)
        }
        length = {side: float(np.hypot(*(self.points[side[1]] - self.points[side[0]]))) for side in sides}
        for a, b in sorted(sides, key=lambda side: (length[side], side)):
            both = self.cells_at[a] & self.cells_at[b]
            if both and length[a, b] < SHORT * min(size[k] for k in both):
                done |= self._contract(a, b)
        return done

    def _contract(self, a: int, b: int) -> bool:
        """Whether ``a`` and ``b`` are one vertex now: cells remain valid."""
        import shapely

        if self.fixed[b] > self.fixed[a]:
            a, b = b, a
        if self.fixed[b] == 2:
            return False
        if self.fixed[b] == 1:
            middle = shapely.Point(0.5 * (self.points[a] + self.points[b]))
            if self.bounds.distance(middle) > self.tolerance:
                return False
        at = self.points[a] if self.fixed[a] > self.fixed[b] else 0.5 * (self.points[a] + self.points[b])
        before = self.points[a].copy()
        changed = {k: [a if v == b else v for v in self.cells[k]] for k in self.cells_at[b]}
        changed |= {k: self.cells[k] for k in self.cells_at[a] - set(changed)}
        changed = {k: [v for i, v in enumerate(cell) if v != cell[i - 1]] for k, cell in changed.items()}
        self.points[a] = at
        if not all(self._well(cell) for cell in changed.values()):
            self.points[a] = before
            return False
        for k, cell in changed.items():
            self.cells[k] = cell
        self.cells_at[a] |= self.cells_at.pop(b)
        self.cells_at[b] = set()
        return True

    def _area(self, cell: list[int]) -> float:
        x, y = (self.points[cell] - self.points[cell[0]]).T
        return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))

    def _well(self, cell: list[int]) -> bool:
        import shapely

        if len(set(cell)) < max(3, len(cell)):
            return False
        return self._area(cell) > 0 and shapely.Polygon(self.points[cell]).is_valid


def _convex(points: np.ndarray, cell: list[int]) -> list[list[int]]:
    """``cell`` cut wherever it turns inwards by more than `INWARDS`, to that of its vertices in view which divides the corner
    most evenly, if there is one."""
    import shapely

    at = points[cell]
    ahead = np.roll(at, -1, axis=0) - at
    angle = np.arctan2(*ahead.T[::-1])
    turn = (angle - np.roll(angle, 1) + np.pi) % (2 * np.pi) - np.pi
    k = int(turn.argmin())
    if turn[k] > -INWARDS:
        return [cell]
    n, outline = len(cell), shapely.Polygon(at)
    # Direction into the cell that divides the corner in halves.
    inside = angle[k] + 0.5 * (np.pi - turn[k])
    best, least = None, 0.5 * (np.pi - turn[k])
    for j in range(n):
        if j in (k, (k + 1) % n, (k - 1) % n):
            continue
        way = at[j] - at[k]
        off = abs((np.arctan2(way[1], way[0]) - inside + np.pi) % (2 * np.pi) - np.pi)
        if off < least and outline.covers(shapely.LineString([at[k], at[j]])):
            best, least = j, off
    if best is None:
        return [cell]
    one, two = sorted((k, best))
    halves = cell[one : two + 1], cell[two:] + cell[: one + 1]
    return [part for half in halves for part in _convex(points, half)]


def _numbered(points: np.ndarray, cells: list[list[int]], loops: Sequence[np.ndarray], tolerance: float) -> CellMesh:
    """The mesh without unused points, and the sides on the edges of ``loops``."""
    used = np.unique(np.concatenate([np.array(cell) for cell in cells]))
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    points, cells = points[used], [number[cell].tolist() for cell in cells]
    sides, edge = [], 0
    for loop in loops:
        for start, end in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            way = (end - start) / np.hypot(*(end - start))
            far, off = (points - start) @ way, (points - start) @ [-way[1], way[0]]
            on = (np.abs(off) <= tolerance) & (far >= -tolerance) & (far <= np.hypot(*(end - start)) + tolerance)
            row = np.flatnonzero(on)[np.argsort(far[on])].tolist()
            sides += [((min(a, b), max(a, b)), edge) for a, b in pairwise(row)]
            edge += 1
    return CellMesh(points, cells, sides)
