"""Area integrals of polygons with holes, exact, by closed sums over their edges."""

from __future__ import annotations

import numpy as np


def signed_area(loop: np.ndarray) -> float:
    """Area of ``loop`` (n, 2), m², positive counter-clockwise."""
    # About its own first vertex: digits far from the origin.
    own = loop - loop[0]
    following = np.roll(own, -1, axis=0)
    return 0.5 * float(np.sum(own[:, 0] * following[:, 1] - own[:, 1] * following[:, 0]))


def polygon_moments(loops: list[np.ndarray], origin: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Area, first moments (2,) and second moments (2, 2) about ``origin``, holes (clockwise) taken out."""
    area, first, second = 0.0, np.zeros(2), np.zeros((2, 2))
    for loop in loops:
        p = loop - origin
        q = np.roll(p, -1, axis=0)
        cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        area += 0.5 * cross.sum()
        first += ((p + q) * cross[:, None]).sum(axis=0) / 6
        s = p + q
        second += (
            np.einsum("i,ij,ik->jk", cross, p, p)
            + np.einsum("i,ij,ik->jk", cross, q, q)
            + np.einsum("i,ij,ik->jk", cross, s, s)
        ) / 24
    return area, first, second


def area_moments(loops: list[np.ndarray]) -> tuple[float, np.ndarray, np.ndarray]:
    """(area, centroid (2,), second moments about the centroid (2, 2): [[∫x², ∫xy], [∫xy, ∫y²]])."""
    # About a vertex of its own first: digits far from the origin.
    origin = loops[0][0]
    area, first, second = polygon_moments(loops, origin)
    centroid = first / area
    return float(area), origin + centroid, second - area * np.outer(centroid, centroid)


def winding_number(loops: list[np.ndarray], point: np.ndarray) -> float:
    """How often ``loops`` together wind about ``point``: 1 inside a polygon, 0 outside or in its holes."""
    total = 0.0
    for loop in loops:
        a = loop - point
        b = np.roll(a, -1, axis=0)
        total += np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.sum(a * b, axis=1)).sum()
    return total / (2 * np.pi)
