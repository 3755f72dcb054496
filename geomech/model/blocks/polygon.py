"""Polygons with holes: area integrals by closed sums over edges, and tests for crossings, overlaps and points
inside."""

from __future__ import annotations

from itertools import pairwise

import numpy as np


def signed_area(loop: np.ndarray) -> float:
    """Area of ``loop`` (n, 2), m², positive counter-clockwise."""
    # Relative to its first vertex, to keep digits far from the origin.
    own = loop - loop[0]
    here, following = own[:-1], own[1:]
    return 0.5 * float(np.sum(here[:, 0] * following[:, 1] - here[:, 1] * following[:, 0]))


def polygon_moments(loops: list[np.ndarray], origin: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Area m², first moments (2,) m³ and second moments (2, 2) m⁴ about ``origin``; clockwise loops are holes."""
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
    # Relative to its first vertex, to keep digits far from the origin.
    origin = loops[0][0]
    area, first, second = polygon_moments(loops, origin)
    centroid = first / area
    return float(area), origin + centroid, second - area * np.outer(centroid, centroid)


def joined_loops(loops: list[np.ndarray]) -> list[np.ndarray]:
    """``loops`` (each (n, 2)) that bound one polygon; those that touch in a vertex are joined into one loop, which
    passes that point twice: there the polygon has two corners, without material between them.

    At such a point a loop continues along the first edge clockwise from the one by which it arrived, with the polygon
    on its left.
    """
    if len(loops) < 2:
        return loops
    corners = [[tuple(point) for point in loop.tolist()] for loop in loops]
    edges = [edge for loop in corners for edge in pairwise([*loop, loop[0]])]
    onward: dict[tuple, list[tuple]] = {}
    for start, end in edges:
        onward.setdefault(start, []).append(end)
    if len(onward) == len(edges):
        return loops

    def clockwise(corner: tuple, before: tuple, after: tuple) -> float:
        u, v = np.subtract(before, corner), np.subtract(after, corner)
        return float(np.arctan2(v[0] * u[1] - v[1] * u[0], u @ v) % (2 * np.pi))

    joined, left = [], dict.fromkeys(edges)
    while left:
        loop, (start, end) = [], next(iter(left))
        while (start, end) in left:
            del left[start, end]
            loop.append(start)
            start, end = end, min(onward[end], key=lambda after: clockwise(end, start, after))
        joined.append(np.array(loop))
    return joined


def winding_number(loops: list[np.ndarray], point: np.ndarray) -> float:
    """Winding number of ``loops`` about ``point``: 1 inside the polygon, 0 outside and in holes."""
    total = 0.0
    for loop in loops:
        a = loop - point
        b = np.roll(a, -1, axis=0)
        total += np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.sum(a * b, axis=1)).sum()
    return total / (2 * np.pi)


def distance_to_edges(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Distance from ``point`` (2,) to the nearest edge from ``start`` to ``end`` (both (n, 2)), m."""
    along, arm = end - start, point - start
    share = np.clip(np.sum(arm * along, axis=1) / np.sum(along * along, axis=1), 0.0, 1.0)
    return float(np.hypot(*(arm - share[:, None] * along).T).min())


def convex_and_simple(vertices: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quick pre-check of many loops: (n_loops,) bool, convex and simple; (n_loops,) bool, counter-clockwise.

    ``vertices`` (n, 2) of all loops, loop k from ``start[k]`` to ``start[k + 1]``. A loop passes if it is convex, winds
    once, and has finite and distinct vertices. One that does not pass may still be simple (`crossing_edges` decides).
    """
    first, count = start[:-1], np.diff(start)
    following = np.arange(1, len(vertices) + 1)
    following[start[1:] - 1] = first
    before = np.empty(len(vertices), int)
    before[following] = np.arange(len(vertices))
    own = vertices - np.repeat(vertices[first], count, axis=0)
    along = own[following] - own
    turn = along[before]
    cross = turn[:, 0] * along[:, 1] - turn[:, 1] * along[:, 0]
    angle = np.arctan2(cross, np.sum(turn * along, axis=1))
    total = np.add.reduceat(angle, first)
    size = np.maximum.reduceat(np.abs(own).max(axis=1), first)
    short = np.minimum.reduceat(np.hypot(along[:, 0], along[:, 1]), first) <= 1e-12 * size
    area = np.add.reduceat(own[:, 0] * own[following, 1] - own[:, 1] * own[following, 0], first)
    one_way = np.minimum.reduceat(angle * np.repeat(np.sign(total), count), first) >= 0
    # Comparisons with non-finite numbers are False.
    good = one_way & (np.abs(np.abs(total) - 2 * np.pi) < 1) & ~short & (np.abs(area) > 1e-12 * size**2)
    return good, area > 0


def roundoff_of(*loops: np.ndarray) -> float:
    """Distance below which ``loops`` (n, 2) touch, m: round-off of their coordinates, or 1e-12 of their size."""
    low, high = (
        np.min([loop.min(axis=0) for loop in loops], axis=0),
        np.max([loop.max(axis=0) for loop in loops], axis=0),
    )
    return max(1e-12 * float((high - low).max()), 4 * np.finfo(float).eps * float(np.abs([low, high]).max()))


def crossing_edges(loop: np.ndarray) -> tuple[int, int] | None:
    """The first pair of edges of ``loop`` (n, 2) that cross or touch away from a shared corner; None: simple polygon.

    Edges touch within `roundoff_of`. Edge k leaves vertex k.
    """
    n = len(loop)
    p = loop - loop[0]
    along = np.roll(p, -1, axis=0) - p
    span = np.hypot(along[:, 0], along[:, 1])
    near = roundoff_of(loop)
    # Of every vertex j from every edge i: the side of its line, and the distance from the edge itself. Collinear edges
    # with a gap between them do not meet, whatever the signs of their round-off.
    arm = p[None, :] - p[:, None]
    side = along[:, None, 0] * arm[..., 1] - along[:, None, 1] * arm[..., 0]
    side = _sides(side, along[:, None], near)
    share = np.clip(np.einsum("ix,ijx->ij", along, arm) / (span * span)[:, None], 0.0, 1.0)
    touch = np.hypot(*np.moveaxis(arm - share[..., None] * along[:, None], 2, 0)) <= near
    through = side * np.roll(side, -1, axis=1) < 0
    ends = touch | np.roll(touch, -1, axis=1)
    meet = (through & through.T) | ends | ends.T
    # Neighbours share a corner; they overlap if the far end of one lies on the other.
    here = np.arange(n)
    following = (here + 1) % n
    back = touch[here, (here + 2) % n] | touch[following, here]
    meet[here, following] = meet[following, here] = back
    found = np.argwhere(meet & np.triu(np.ones((n, n), bool), 1))
    return tuple(found[0].tolist()) if len(found) else None


def crossing_loops(one: np.ndarray, other: np.ndarray) -> np.ndarray | None:
    """The first point (2,) where edges of two loops (n, 2) and (m, 2) cross; None where they touch or are apart."""
    origin = one[0]
    p, q = one - origin, other - origin
    a, b = np.roll(p, -1, axis=0) - p, np.roll(q, -1, axis=0) - q
    near = roundoff_of(one, other)
    # Two edges cross where the ends of each lie on different sides of the other's line.
    arm = q[None, :] - p[:, None]
    of_other = _sides(a[:, None, 0] * arm[..., 1] - a[:, None, 1] * arm[..., 0], a[:, None], near)
    of_one = _sides(-(b[None, :, 0] * arm[..., 1] - b[None, :, 1] * arm[..., 0]), b[None, :], near)
    cross = (of_other * np.roll(of_other, -1, axis=1) < 0) & (of_one * np.roll(of_one, -1, axis=0) < 0)
    if not cross.any():
        return None
    i, j = np.argwhere(cross)[0]
    share = (arm[i, j, 0] * b[j, 1] - arm[i, j, 1] * b[j, 0]) / (a[i, 0] * b[j, 1] - a[i, 1] * b[j, 0])
    return origin + p[i] + share * a[i]


def _sides(area: np.ndarray, along: np.ndarray, near: float) -> np.ndarray:
    """Side of a line: −1, 1, or 0 within the distance ``near``, m."""
    return np.where(np.abs(area) <= near * np.hypot(along[..., 0], along[..., 1]), 0.0, np.sign(area))


def point_in_both(one: np.ndarray, other: np.ndarray) -> np.ndarray | None:
    """A point (2,) inside both of two loops that do not cross, near the midpoint of an edge; None: no overlap."""
    for loop, against in ((one, other), (other, one)):
        along = np.roll(loop, -1, axis=0) - loop
        inwards = np.stack([-along[:, 1], along[:, 0]], axis=1) * np.sign(signed_area(loop))
        for point in loop + 0.5 * along + 1e-6 * inwards:
            if abs(winding_number([against], point)) > 0.5:
                return point
    return None
