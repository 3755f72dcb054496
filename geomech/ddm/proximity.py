"""How long elements are beside their distance to others: what decides where a mesh is halved."""

from __future__ import annotations

import numpy as np
from numba import njit

_jit = njit(cache=True, fastmath=False, error_model="numpy", nogil=True)


@_jit
def _distance(px, py, ax, ay, bx, by):
    """From a point to a segment."""
    dx, dy = bx - ax, by - ay
    s = ((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy)
    s = min(1.0, max(0.0, s))
    return np.hypot(px - ax - s * dx, py - ay - s * dy)


def crowding(start, end, tip, source, touching, n_edges, apart, across, chained):
    """(n,) the largest length / (allowed length) of each element over all others.

    Allowed is ``apart`` times the distance, ``across`` times it between two edges (sources below ``n_edges``), ``chained`` times it where the two lie on one source or on ``touching``
    ones, whose grading already ties sizes to distances. Elements that share an end are not compared, but for the tip at
    the other end (``tip`` 1 at the start, 2 at the end, 3 both) of the neighbour.
    """
    middle = 0.5 * (start[:, 0] + end[:, 0])
    length = np.hypot(end[:, 0] - start[:, 0], end[:, 1] - start[:, 1])
    # Farther apart than this along x, two elements cannot matter to one another.
    reach = (1.0 + 1.0 / min(apart, across)) * length.max() if len(start) else 0.0
    sweep = np.argsort(middle, kind="stable")
    return _crowding(
        start, end, length, tip, source, touching, n_edges, apart, across, chained, sweep, 1.000001 * reach
    )


@_jit
def _crowding(start, end, length, tip, source, touching, n_edges, apart, across, chained, sweep, reach):
    n = len(start)
    out = np.zeros(n)
    for m in range(n):
        i = sweep[m]
        mx, my = 0.5 * (start[i, 0] + end[i, 0]), 0.5 * (start[i, 1] + end[i, 1])
        for k in range(m - 1, -1, -1):
            j = sweep[k]
            qx, qy = 0.5 * (start[j, 0] + end[j, 0]), 0.5 * (start[j, 1] + end[j, 1])
            if mx - qx > reach:
                break
            between = np.hypot(mx - qx, my - qy) - 0.5 * (length[i] + length[j])
            if between * min(apart, across) > max(length[i], length[j]):
                continue
            same = source[i] == source[j] or touching[source[i], source[j]]
            allowed = apart
            if same:
                allowed = chained
            elif source[i] < n_edges and source[j] < n_edges:
                allowed = across
            shared = 0
            for p in range(2):
                for q in range(2):
                    u, v = (start[i], start[j]) if p == 0 and q == 0 else (start[i], end[j])
                    if p == 1:
                        u, v = (end[i], start[j]) if q == 0 else (end[i], end[j])
                    if u[0] == v[0] and u[1] == v[1]:
                        shared += 1
                        # The square root at the neighbour's far tip is the singularity to keep clear of.
                        if (tip[j] == 1 and q == 1) or (tip[j] == 2 and q == 0):
                            out[i] = max(out[i], length[i] / (apart * length[j]))
                        if (tip[i] == 1 and p == 1) or (tip[i] == 2 and p == 0):
                            out[j] = max(out[j], length[j] / (apart * length[i]))
            if shared:
                continue
            d = _distance(start[i, 0], start[i, 1], start[j, 0], start[j, 1], end[j, 0], end[j, 1])
            d = min(d, _distance(end[i, 0], end[i, 1], start[j, 0], start[j, 1], end[j, 0], end[j, 1]))
            d = min(d, _distance(start[j, 0], start[j, 1], start[i, 0], start[i, 1], end[i, 0], end[i, 1]))
            d = min(d, _distance(end[j, 0], end[j, 1], start[i, 0], start[i, 1], end[i, 0], end[i, 1]))
            d = max(d, 1e-300) * allowed
            out[i] = max(out[i], length[i] / d)
            out[j] = max(out[j], length[j] / d)
    return out
