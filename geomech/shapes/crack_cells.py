"""Cells of continuous rock around cracks: a crack and the rock within a margin of it are one cell.

A crack opens inside one cell, whose polynomial displacement the faces to other cells transmit; a crack across such a face
would be closed by it. The cell is a rectangle along the crack: where the outline of a cell turns inwards, or by little,
what the crack adds to its stress is singular (as r^−0.25 at 210°, r^0.34 at 157°, r^1.7 at 90°), and polynomials converge
slowly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model import Blocks, Cracks
from .cells import divided

if TYPE_CHECKING:
    import shapely

#: Two sides are one where the sine of the angle between them is below this.
_STRAIGHT = 1e-9
#: Widths, over the margin, that are tried until the outline of the cell is as far as `_APART` cell sizes from that
#: of the block, except where the two cross: cells between them would be thin.
_TRIED = 1.0, 1.15, 0.87, 1.3, 0.75
_APART = 1.0 / 3.0


@dataclass(frozen=True, eq=False)
class CrackCell:
    """The cell of the crack segments ``segments`` (k,) in ``block``: the rock in the ``region``."""

    block: int
    region: shapely.Polygon
    segments: np.ndarray


def divided_around(
    blocks: Blocks, cracks: Cracks, size: np.ndarray, shape: np.ndarray, between: Sequence[str], margin: np.ndarray
) -> tuple[Blocks, np.ndarray, Cracks]:
    """As `divided`, with one cell around each crack, or around several that are near; and ``cracks`` in these cells.

    ``margin`` (n_blocks,) m: width of the rock around a crack that belongs to its cell, nan: the length of the crack."""
    import shapely

    whole = [shapely.Polygon(loops[0], loops[1:]) for loops in (blocks.loops(b) for b in range(blocks.n_blocks))]
    found: list[CrackCell] = []
    for b in np.intersect1d(cracks.block, np.flatnonzero(np.isfinite(size))).tolist():
        found += _crack_cells(cracks, b, whole[b], float(margin[b]), float(size[b]))
    along: dict[int, list[np.ndarray]] = {}
    for cell in found:
        inner = shapely.intersection(cell.region.exterior, whole[cell.block])
        lines = shapely.get_parts(shapely.line_merge(inner)).tolist()
        along.setdefault(cell.block, []).extend(
            shapely.get_coordinates(line) for line in lines if isinstance(line, shapely.LineString) and line.length > 0
        )
    cells, of = divided(blocks, size, shape, between, along)
    holder = np.searchsorted(of, cracks.block)
    unions = []
    for one in found:
        own = np.flatnonzero(of == one.block)
        middles = shapely.points([cells.vertices[cells.vertex_block == c].mean(axis=0) for c in own.tolist()])
        inside = own[shapely.intersects(middles, one.region)]
        unions.append(set(inside.tolist()))
        holder[one.segments] = inside.min()
    return _with_unions(cells, of, unions, replace(cracks, block=holder))


def _crack_cells(cracks: Cracks, block: int, whole: shapely.Polygon, margin: float, size: float) -> list[CrackCell]:
    """The cells of the cracks in ``block``, whose rock is ``whole``."""
    import shapely

    some = np.flatnonzero(cracks.block == block)
    hulls, wide = [], []
    for crack in np.unique(cracks.crack[some]).tolist():
        ends = cracks.nodes[cracks.segments[some[cracks.crack[some] == crack]]]
        hulls.append(shapely.MultiPoint(ends.reshape(-1, 2)).convex_hull)
        wide.append(margin if np.isfinite(margin) else float(np.hypot(*(ends[:, 1] - ends[:, 0]).T).sum()))
    tried: list[tuple[float, list[Any]]] = []
    for factor in _TRIED:
        regions = _disjoint(
            [_beside_holes(whole, hull, _around(hull, factor * width)) for hull, width in zip(hulls, wide, strict=True)]
        )
        near = min(_distance(whole, region, size) for region in regions)
        tried.append((near, regions))
        if near >= _APART * size:
            break
    regions = max(tried, key=lambda of: of[0])[1]
    lines = shapely.linestrings(cracks.nodes[cracks.segments[some]])
    return [CrackCell(block, region, some[shapely.intersects(lines, region)]) for region in regions]


def _beside_holes(whole: shapely.Polygon, hull: Any, region: shapely.Polygon) -> Any:
    """``region`` without what is behind the holes of the ``whole`` block as seen from ``hull``: a cell that encloses a hole
    bends too little. It ends halfway between the centre of a hole and the crack."""
    import shapely
    import shapely.ops
    from shapely import affinity

    reach = 4.0 * whole.length
    for ring in whole.interiors:
        hole = shapely.Polygon(ring)
        if not region.intersects(hole):
            continue
        (x, y), (crack_x, crack_y) = (
            shapely.get_coordinates(p)[0] for p in shapely.ops.nearest_points(hole.centroid, hull)
        )
        angle = float(np.arctan2(crack_y - y, crack_x - x))
        half = shapely.box(0.5 * float(np.hypot(crack_x - x, crack_y - y)), -reach, reach, reach)
        half = affinity.translate(affinity.rotate(half, angle, origin=(0.0, 0.0), use_radians=True), x, y)
        region = region.intersection(half)
    return region


def _around(part: Any, width: float) -> Any:
    """The narrowest rectangle around ``part``, wider by ``width`` on all sides."""
    return part.minimum_rotated_rectangle.buffer(width, join_style="mitre", cap_style="square")


def _disjoint(regions: list[Any]) -> list[Any]:
    """``regions`` of which those that overlap are one rectangle."""
    import shapely

    while True:
        parts = shapely.get_parts(shapely.unary_union(regions)).tolist()
        joined = [part if any(part.equals(one) for one in regions) else _around(part, 0.0) for part in parts]
        if len(joined) == len(regions):
            return regions
        regions = joined


def _distance(whole: shapely.Polygon, region: shapely.Polygon, size: float) -> float:
    """Least distance, m, of the outline of a ``region`` from that of the ``whole`` block, farther than ``size`` from where
    they cross, of its corners from it, and of a crossing from a corner of the block."""
    import shapely

    boundary = whole.boundary
    crossings = shapely.intersection(region.exterior, boundary)
    inside = shapely.intersection(region.exterior, whole)
    if inside.is_empty:
        return float(np.inf)
    corners = shapely.points(shapely.get_coordinates(region.exterior)[:-1])
    near = float(shapely.distance(corners, boundary).min())
    away = inside if crossings.is_empty else inside.difference(crossings.buffer(size))
    near = near if away.is_empty else min(near, float(away.distance(boundary)))
    if crossings.is_empty:
        return near
    return min(near, float(crossings.distance(shapely.MultiPoint(shapely.get_coordinates(whole.exterior)))))


def _outline(cells: Blocks, union: set[int], across: dict[int, int]) -> list[int]:
    """Edges of the cells of a ``union`` that are not between two of them."""
    owner = cells.vertex_block
    every = [v for cell in sorted(union) for v in range(cells.vertex_start[cell], cells.vertex_start[cell + 1])]
    return [side for side in every if not (side in across and int(owner[across[side]]) in union)]


def _rings(cells: Blocks, sides: list[int]) -> list[list[int]]:
    """The closed rings of ``sides``, whose corners are all different; the outline first."""
    following = {cells.vertices[side].tobytes(): side for side in sides}
    left, out = set(sides), []
    while left:
        side, ring = min(left), []
        while side in left:
            left.remove(side)
            ring.append(side)
            side = following[cells.vertices[cells.next_vertex[side]].tobytes()]
        out.append(ring)

    def area(ring: list[int]) -> float:
        (x, y), (following_x, following_y) = cells.vertices[ring].T, cells.vertices[cells.next_vertex[ring]].T
        return float(x @ following_y - y @ following_x)

    return sorted(out, key=area, reverse=True)


def _with_unions(
    cells: Blocks, of: np.ndarray, unions: list[set[int]], cracks: Cracks
) -> tuple[Blocks, np.ndarray, Cracks]:
    """The cells with each of the ``unions`` as one, in the place of its first; ``cracks`` are in these first ones."""
    glued = np.zeros((0, 2), np.int64) if cells.glued is None else np.asarray(cells.glued)
    across = {a: b for pair in glued.tolist() for a, b in (pair, pair[::-1])}
    first = {min(union): union for union in unions}
    gone = set[int]().union(*unions) - set(first)
    polygons, names, edge_names, number, kept = [], [], [], {}, []
    n = 0
    for cell in range(cells.n_blocks):
        if cell in gone:
            continue
        if cell in first:
            rings = [
                _without_straight(cells, ring, across) for ring in _rings(cells, _outline(cells, first[cell], across))
            ]
        else:
            rings = [
                list(range(cells.loop_start[k], cells.loop_start[k + 1]))
                for k in range(cells.block_loop[cell], cells.block_loop[cell + 1])
            ]
        polygons.append([cells.vertices[ring] for ring in rings])
        edge_names.append([[cells.edge_names[cells.edge_name[side]] for side in ring] for ring in rings])
        names.append(cells.names[cell])
        kept.append(cell)
        for side in (side for ring in rings for side in ring):
            number[side] = n
            n += 1
    bonds = np.array([[number[a], number[b]] for a, b in glued.tolist() if a in number and b in number], np.int64)
    out, at = Blocks.from_polygons(polygons, edge_names=edge_names, names=names), np.array(kept)
    out = replace(
        out, material=cells.material[at], fixed=cells.fixed[at],
        constrained=None if cells.constrained is None else cells.constrained[at],
        order=None if cells.order is None else cells.order[at], glued=bonds if len(bonds) else None,
    )  # fmt: skip
    place = np.full(cells.n_blocks, -1)
    place[at] = np.arange(len(at))
    return out, of[at], replace(cracks, block=place[cracks.block])


def _without_straight(cells: Blocks, ring: list[int], across: dict[int, int]) -> list[int]:
    """``ring`` without the corners between two parts of one straight side that faces no other cell: a crack may end near
    one."""
    out = []
    for before, side in zip([ring[-1], *ring[:-1]], ring, strict=True):
        one, two = (cells.vertices[cells.next_vertex[s]] - cells.vertices[s] for s in (before, side))
        bend = abs(one[0] * two[1] - one[1] * two[0]) / (np.hypot(*one) * np.hypot(*two))
        same = cells.edge_name[before] == cells.edge_name[side]
        if not (same and bend < _STRAIGHT and side not in across and before not in across):
            out.append(side)
    return out
