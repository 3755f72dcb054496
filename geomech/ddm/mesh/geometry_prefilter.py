"""Quick pre-check of a crack network: nothing crosses, touches or folds, by a wide margin.

Growth adds a few segments at a time, nearly always clear of all others; only where this pre-check fails do the full
checks run (`geometry_checks`).
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled import UNCOUNTED, kept, part

#: Full checks are needed where a new segment is nearer than this part of the extent to one with which it shares no
#: node.
CLEAR = 1e-6
#: The same where it shares a node and leaves within this angle of the other's direction.
SPREAD = math.cos(math.radians(11.0))
#: Coordinate resolution relative to a segment's length: half of what the full check allows.
DIGITS = 0.5e-5

_jit = kept(error_model="numpy", nogil=True, **UNCOUNTED)
_part = part(error_model="numpy", nogil=True, **UNCOUNTED)


@_jit
def clearly_valid(nodes, segments, surface, aperture, fresh, edges, n_rock, outlined):
    """Whether no rule of `geometry_checks.check_cracks` can be broken.

    ``nodes`` (n, 2), ``segments`` (m, 2), ``surface`` (n,), ``aperture`` and ``fresh`` (m,) describe the network and
    its new segments; ``edges`` (k, 2, 2) are those of all loops, of which the first ``n_rock`` bound the rock, with an
    outline among them if ``outlined``.
    """
    span, far = _extent(nodes, segments, aperture, edges)
    if not span >= 0.0:
        return False
    for s in range(len(segments)):
        i, j = segments[s, 0], segments[s, 1]
        ax, ay, bx, by = nodes[i, 0], nodes[i, 1], nodes[j, 0], nodes[j, 1]
        length = math.hypot(bx - ax, by - ay)
        if length <= 2e-12 * span or 2.3e-16 * far > DIGITS * length:
            return False
        if not fresh[s]:
            continue
        if surface[i] or surface[j]:
            return False
        if not (_in_rock(ax, ay, edges, n_rock, outlined) and _in_rock(bx, by, edges, n_rock, outlined)):
            return False
        if not _clear(nodes, segments, s, edges, CLEAR * span):
            return False
    return True


@_part
def _extent(nodes, segments, aperture, edges):
    """Larger side of the bounding box, and the largest coordinate; −1 where coordinates are not finite or an aperture
    is negative."""
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for s in range(len(segments)):
        if not aperture[s] >= 0:
            return -1.0, 0.0
        for e in range(2):
            x, y = nodes[segments[s, e], 0], nodes[segments[s, e], 1]
            if not (np.isfinite(x) and np.isfinite(y)):
                return -1.0, 0.0
            low_x, low_y, high_x, high_y = min(low_x, x), min(low_y, y), max(high_x, x), max(high_y, y)
    for k in range(len(edges)):
        for e in range(2):
            x, y = edges[k, e, 0], edges[k, e, 1]
            low_x, low_y, high_x, high_y = min(low_x, x), min(low_y, y), max(high_x, x), max(high_y, y)
    span = max(high_x - low_x, high_y - low_y)
    return span, max(max(abs(low_x), abs(low_y)), max(abs(high_x), abs(high_y)))


@_part
def _clear(nodes, segments, s, edges, near):
    """Whether segment ``s`` keeps a distance ``near`` (m) from all edges and other segments or, with a shared node, an
    angle."""
    i, j = segments[s, 0], segments[s, 1]
    ax, ay, bx, by = nodes[i, 0], nodes[i, 1], nodes[j, 0], nodes[j, 1]
    for k in range(len(edges)):
        if not _apart(ax, ay, bx, by, edges[k, 0, 0], edges[k, 0, 1], edges[k, 1, 0], edges[k, 1, 1], near):
            return False
    for r in range(len(segments)):
        if r == s:
            continue
        p, q = segments[r, 0], segments[r, 1]
        cx, cy, dx, dy = nodes[p, 0], nodes[p, 1], nodes[q, 0], nodes[q, 1]
        if i != p and i != q and j != p and j != q:
            if not _apart(ax, ay, bx, by, cx, cy, dx, dy, near):
                return False
            continue
        if (i == p and j == q) or (i == q and j == p):
            return False
        # Measured from the shared node.
        ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
        if j in (p, q):
            ux, uy = -ux, -uy
        if q in (i, j):
            vx, vy = -vx, -vy
        if ux * vx + uy * vy > SPREAD * math.hypot(ux, uy) * math.hypot(vx, vy):
            return False
    return True


@_part
def _in_rock(x, y, edges, n_rock, outlined):
    """Whether a point is in the rock, by the even–odd rule."""
    odd = False
    for k in range(n_rock):
        ax, ay, bx, by = edges[k, 0, 0], edges[k, 0, 1], edges[k, 1, 0], edges[k, 1, 1]
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            odd = not odd
    return odd == outlined


@_part
def _apart(ax, ay, bx, by, cx, cy, dx, dy, near):
    """Whether the segments ab and cd are farther apart than ``near``."""
    if (
        min(ax, bx) > max(cx, dx) + near
        or min(cx, dx) > max(ax, bx) + near
        or min(ay, by) > max(cy, dy) + near
        or min(cy, dy) > max(ay, by) + near
    ):
        return True
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    c, d = ux * (cy - ay) - uy * (cx - ax), ux * (dy - ay) - uy * (dx - ax)
    a, b = vx * (ay - cy) - vy * (ax - cx), vx * (by - cy) - vy * (bx - cx)
    if (c > 0) != (d > 0) and (a > 0) != (b > 0):
        return False
    return (
        _off(ax, ay, cx, cy, dx, dy) > near
        and _off(bx, by, cx, cy, dx, dy) > near
        and _off(cx, cy, ax, ay, bx, by) > near
        and _off(dx, dy, ax, ay, bx, by) > near
    )


@_part
def _off(px, py, ax, ay, bx, by):
    """Distance of a point from a segment."""
    dx, dy = bx - ax, by - ay
    s = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy)))
    return math.hypot(px - ax - s * dx, py - ay - s * dy)
