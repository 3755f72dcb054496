"""Voronoi cells of a block: polygons around points that are spread at random and then evened out.

A cell is the part of the block that is nearer to its point than to any other. Points are moved to the centroids of their
cells `EVENED` times (Lloyd 1982, IEEE Trans. Inf. Theory 28, 129-137), which leaves cells of similar size without a common
direction. At a corner where the block turns inwards, two points that do not move mirror each other about the bisector of
the corner: a face between two cells begins there, and no cell has the corner inside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .cell_mesh import CellMesh, joined

#: Times that points are moved to the centroids of their cells. Six halve the scatter of their areas, and leave faces of all
#: directions; many more would make hexagons, whose faces have three.
EVENED = 6
#: Distance of the two points beside a corner from its edges, and from the corner along them, over the sides of triangles there.
BESIDE = 0.5


def voronoi_mesh(
    loops: Sequence[np.ndarray], triangles: np.ndarray, along: Sequence[np.ndarray] = (), seed: int = 1
) -> CellMesh:
    """Voronoi cells of the block with the outline ``loops`` (each (n, 2), m), half as many as its ``triangles`` (n, 3, 2) and
    small where these are small; no cell crosses the lines ``along``. Raises ValueError if they do not fill the block."""
    import shapely

    whole = shapely.Polygon(loops[0], loops[1:])
    lines = shapely.union_all([whole.boundary, *(shapely.LineString(line) for line in along)])
    middles = shapely.points(triangles.mean(axis=1))
    rng = np.random.default_rng(seed)
    rings: list[np.ndarray] = []
    for region in shapely.get_parts(shapely.polygonize([lines])).tolist():
        own = triangles[shapely.intersects(region, middles)]
        if len(own):
            rings += [shapely.get_coordinates(part.exterior)[:-1] for part in _cells(region, own, rng)]
    return joined(rings, loops, along)


def _cells(region, triangles: np.ndarray, rng: np.random.Generator) -> list:
    """Shapely polygons: the cells of a ``region``, whose ``triangles`` say how many there are and how large."""
    import shapely

    sides = np.hypot(*np.moveaxis(triangles - np.roll(triangles, 1, axis=1), 2, 0))
    still, reach, corner = _beside_corners(region, float(np.median(sides)))
    chosen = triangles[rng.permutation(len(triangles))[: max(1, (len(triangles) + 1) // 2)]]
    points = np.einsum("ij,ijk->ik", rng.dirichlet(np.ones(3), len(chosen)), chosen)
    # Others must not be nearer to a corner than its own two points, √2 `reach` from it.
    apart = np.hypot(*np.moveaxis(points[:, None] - corner[None], 2, 0))
    points = points[(apart > 2.0 * reach).all(axis=1)]
    for _ in range(EVENED):
        parts = _clipped(np.concatenate([still, points]), region)
        # The part of a cell on the other side of a notch gets a point of its own.
        moving = [part for k, some in enumerate(parts) for part in some[k < len(still) :]]
        points = shapely.get_coordinates(shapely.centroid(moving)) if moving else points[:0]
        points = points[shapely.contains_xy(region, points[:, 0], points[:, 1])]
    return [part for some in _clipped(np.concatenate([still, points]), region) for part in some]


def _beside_corners(region, size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two points (n, 2) beside each corner of ``region`` that turns inwards, mirrored about its bisector; and the distances
    (m,) along the edges from the corners (m, 2). Edges are divided into parts of about ``size``."""
    import shapely

    found, reaches, corners = [], [], []
    rock_left = shapely.orient_polygons(region)
    for ring in (rock_left.exterior, *rock_left.interiors):
        at = shapely.get_coordinates(ring)[:-1]
        ahead = np.roll(at, -1, axis=0) - at
        length = np.hypot(*ahead.T)
        along = ahead / length[:, None]
        part = length / np.maximum(1, np.round(length / size))
        for k in range(len(at)):
            before = k - 1
            turn = along[before, 0] * along[k, 1] - along[before, 1] * along[k, 0]
            straight = float(along[before] @ along[k]) > 0
            if turn >= -1e-9 and (straight or turn > 1e-9):
                continue
            reach = BESIDE * float(min(part[before], part[k]))
            for _ in range(4):  # as near as an eighth of that in narrow places
                left_one, left_two = (np.array([-way[1], way[0]]) for way in (along[before], along[k]))
                two = at[k] + reach * np.array([left_one - along[before], left_two + along[k]])
                room = shapely.distance(region.boundary, shapely.points(two))
                if shapely.contains_xy(region, two[:, 0], two[:, 1]).all() and (room > 0.5 * reach).all():
                    found += two.tolist()
                    reaches.append(reach)
                    corners.append(at[k])
                    break
                reach *= 0.5
    still = _merged(np.array(found).reshape(-1, 2), np.repeat(reaches, 2))
    return still, np.array(reaches), np.array(corners).reshape(-1, 2)


def _merged(points: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """``points`` of which those of two corners at the ends of one edge that nearly coincide are one, halfway."""
    out: list[np.ndarray] = []
    left = np.ones(len(points), bool)
    for k in range(len(points)):
        if not left[k]:
            continue
        near = left & (np.hypot(*(points - points[k]).T) < 0.5 * np.minimum(reach, reach[k]))
        left[near] = False
        out.append(points[near].mean(axis=0))
    return np.array(out).reshape(-1, 2)


def _clipped(points: np.ndarray, region) -> list[list]:
    """Per point the parts of its Voronoi cell in ``region``, shapely polygons; the one with the point first."""
    import shapely
    from scipy.spatial import Voronoi

    low, high = np.array(region.bounds).reshape(2, 2)
    far = 10.0 * float(np.hypot(*(high - low)))
    turn = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    around = 0.5 * (low + high) + far * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    cut = Voronoi(np.concatenate([points, around]))
    out = []
    for k, point in enumerate(points):
        corners = cut.vertices[cut.regions[cut.point_region[k]]]
        order = np.argsort(np.arctan2(*(corners - corners.mean(axis=0)).T[::-1]))
        part = shapely.intersection(shapely.Polygon(corners[order]), region)
        parts = [p for p in shapely.get_parts(part).tolist() if p.geom_type == "Polygon" and p.area > 0]
        out.append(sorted(parts, key=lambda p: (p.distance(shapely.Point(point)), -p.area)))
    return out
