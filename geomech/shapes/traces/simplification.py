"""Simplification of traces: removes vertices that are due to digitising only.

A polyline keeps its ends and those vertices from which the line through the others would be farther away than a
tolerance (Douglas & Peucker 1973). An end that lay on another trace is moved onto that trace's new position, by no more
than the tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely


class Simplified(NamedTuple):
    """The ``lines`` (n, 2), their numbers of sides ``before`` and ``after``, and the largest distance ``off`` (m) of a
    removed vertex or a moved end."""

    lines: list[np.ndarray]
    before: int
    after: int
    off: float


def simplified(lines: Sequence[np.ndarray], tolerance: float, meets: float) -> Simplified:
    """The open ``lines`` (n, 2), simplified within ``tolerance`` (m); ends within ``meets`` (m) of another line stay on
    it."""
    drawn = [shapely.LineString(line) for line in lines]
    now = list(shapely.simplify(drawn, tolerance)) if drawn else []
    out = [shapely.get_coordinates(line) for line in now]
    tree = shapely.STRtree(drawn)
    moved = [0.0]
    for k, line in enumerate(lines):
        for end in (0, -1):
            point = shapely.Point(line[end])
            others = [j for j in tree.query(point, predicate="dwithin", distance=meets).tolist() if j != k]
            if not others:
                continue
            other = min(others, key=lambda j: (drawn[j].distance(point), j))
            away = now[other].distance(point)
            if drawn[other].distance(point) < away <= tolerance + meets:
                to = now[other].interpolate(now[other].project(point))
                out[k][end] = to.x, to.y
                moved.append(away)
    off = [shapely.hausdorff_distance(a, b) for a, b in zip(drawn, now)]
    return Simplified(out, sum(len(x) - 1 for x in lines), sum(len(x) - 1 for x in out), max([*off, *moved]))
