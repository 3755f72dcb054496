"""Mean stress of a part of a solved body: what a block that is cut off begins with."""

from __future__ import annotations

import numpy as np

from ...conventions import rotate_stress


def rotated_mean_stress(solution, loops: list[np.ndarray], angle: float) -> np.ndarray:
    """(3,) mean of ``solution``'s stress over a polygon, by area-weighted sampling of its triangles, turned by
    ``angle`` rad. The sampling is exact for stress that is linear in x; it keeps away from the corners, where the
    stress of the solution before the cut is singular."""
    import shapely

    polygon = shapely.Polygon(loops[0], loops[1:])
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    corners = np.array([shapely.get_coordinates(t)[:3] for t in triangles])
    for _ in range(4):  # quartered four times
        middle = (corners + np.roll(corners, -1, axis=1)) / 2
        corners = np.concatenate(
            [np.stack([corners[:, k], middle[:, k], middle[:, k - 1]], axis=1) for k in range(3)] + [middle]
        )
    d, e = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0])
    stress = solution.stress(corners.mean(axis=1))
    return rotate_stress(area @ stress / area.sum(), angle)
