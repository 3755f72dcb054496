"""Point location: which points lie in the rock, inside the outline (if any) and outside the holes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...compiled import UNCOUNTED, kept
from ...model.blocks.polygon import signed_area

_jit = kept(error_model="numpy", nogil=True, **UNCOUNTED)


def outlined(loops: Sequence[np.ndarray]) -> bool:
    """Whether the first loop is an outline; otherwise all loops are holes in the infinite plane."""
    return bool(loops) and signed_area(loops[0]) > 0


def inside(loops: Sequence[np.ndarray], points: np.ndarray) -> np.ndarray:
    """(n,) whether ``points`` (n, 2) lie inside the outline, if there is one, and outside the holes (even–odd rule); on
    the boundary, either."""
    points = np.ascontiguousarray(points, dtype=float).reshape(-1, 2)
    odd = np.zeros(len(points), bool)
    for loop in loops:
        _cross(points, np.ascontiguousarray(loop), odd)
    return odd if outlined(loops) else ~odd


def onto_rock(loops: Sequence[np.ndarray], points: np.ndarray, near: float, on: float) -> tuple[np.ndarray, np.ndarray]:
    """Project ``points`` (n, 2) that lie outside the rock by more than ``on`` (m) but no more than ``near`` (m) onto
    its boundary.

    Returns the points and the indices (k,) of those farther outside than ``near``.
    """
    out = np.flatnonzero(~inside(loops, points))
    if not len(out):
        return points, out
    foot, distance = np.empty((len(out), 2)), np.full(len(out), np.inf)
    for loop in loops:
        _nearest(points[out], np.ascontiguousarray(loop), foot, distance)
    put = (distance > on) & (distance <= near)
    if put.any():
        points = points.copy()
        points[out[put]] = foot[put]
    return points, out[distance > near]


@_jit
def _cross(points, loop, odd):
    """Toggle ``odd`` (n,) at every edge that the ray from a point in the +x direction crosses."""
    m = len(loop)
    for k in range(m):
        ax, ay = loop[k, 0], loop[k, 1]
        bx, by = loop[(k + 1) % m, 0], loop[(k + 1) % m, 1]
        if ay == by:
            continue
        slope = (bx - ax) / (by - ay)
        for i in range(len(points)):
            y = points[i, 1]
            odd[i] ^= ((ay > y) != (by > y)) & (points[i, 0] < ax + (y - ay) * slope)


@_jit
def _nearest(points, loop, foot, distance):
    """Update ``foot`` and ``distance`` (n,) with the closest point of ``loop`` where it is nearer."""
    m = len(loop)
    for k in range(m):
        ax, ay = loop[k, 0], loop[k, 1]
        dx, dy = loop[(k + 1) % m, 0] - ax, loop[(k + 1) % m, 1] - ay
        inverse = 1.0 / (dx * dx + dy * dy)
        for i in range(len(points)):
            s = min(1.0, max(0.0, ((points[i, 0] - ax) * dx + (points[i, 1] - ay) * dy) * inverse))
            x, y = ax + s * dx, ay + s * dy
            d = np.hypot(points[i, 0] - x, points[i, 1] - y)
            if d < distance[i]:
                distance[i] = d
                foot[i, 0], foot[i, 1] = x, y
