"""Mean stress of a part of a solved body, the initial stress of a block that is cut off."""

from __future__ import annotations

import numpy as np

from ...conventions import rotate_stress


def rotated_mean_stress(solution, loops: list[np.ndarray], angle: float) -> np.ndarray:
    """(3,) mean of the stress of ``solution`` over a polygon, rotated by ``angle`` rad (`sampled_stress`)."""
    _, area, stress = sampled_stress(solution, loops)
    return rotate_stress(area @ stress / area.sum(), angle)


def sampled_stress(solution, loops: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 2) in a polygon, the area (n,) of the triangle around each, and the stress (n, 3) of ``solution`` there.
    The sum is exact for stress linear in x, and no sample is close to a corner, where the stress before the cut is
    singular."""
    import shapely

    polygon = shapely.Polygon(loops[0], loops[1:])
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    corners = np.array([shapely.get_coordinates(t)[:3] for t in triangles])
    for _ in range(4):  # four subdivisions into four triangles each
        midpoints = (corners + np.roll(corners, -1, axis=1)) / 2
        corners = np.concatenate(
            [np.stack([corners[:, k], midpoints[:, k], midpoints[:, k - 1]], axis=1) for k in range(3)] + [midpoints]
        )
    d, e = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0])
    points = corners.mean(axis=1)
    return points, 0.5 * area, solution.stress(points)
