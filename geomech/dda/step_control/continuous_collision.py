"""Continuous collision detection: vertices that crossed the outline of a block in a step, along their paths.

In the frame of an edge, which moves with its block, a vertex moves from (s, g) to (s′, g′), its coordinate along the
edge and its gap at the start and at the end of the step; the path is straight to within r²/8 of its distance from the
edge for a rotation r (Provot 1997; Li et al. 2020, Lan et al. 2022 for affine bodies). When two outlines cross, a
vertex of one passes through an edge of the other first, except for corners that meet tip to tip on a common line: there
two edges cross in the end. A vertex has gone

- *into* a block if at the end of the step it lies inside, deeper than before and than the penetration of contacts;
- *through* it if it leaves by an edge f, from deeper behind it than the penetration of contacts, after having entered by
  another edge e from which the way along the outline is longer than a corner that may be cut.

Crossings at closed contacts are the contact solver's; the ones found here happened where there was no contact, or none
was closed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ..kinematics.tolerances import NOTABLE

#: Depth to which vertices may lie in a block, relative to the smaller block's size √area (the radius of corners), …
_DEPTH = 1e-5
#: … and relative to the penetration of contacts at that vertex.
_PRESSED = 2.0
#: Where rounded corners pass each other, one may lie in the other by this part of their rounding length, if it is this
#: near in rounding lengths: an arc removes 1 − cos 45° of the corner that it rounds.
ROUNDED_OVERLAP, _NEAR = 0.3, 1.6
#: Part of the outline that a vertex may cut at a corner: `NOTABLE` of the smaller block's size, or so many rounding
#: lengths.
_CUT = 2.5
#: Edges of rounded corners that pass each other cross by at most this many rounding lengths.
_TIPS = 1.2
#: Kinds of crossings.
INTO, THROUGH = 0, 1


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def depth_inside(x, y, vertices, next_vertex, first, last):
    """Depth, m, of (x, y) inside the polygon of the edges from ``first`` to ``last``, 0 outside; and its nearest
    edge."""
    winding, least, nearest = 0, np.inf, -1
    for e in range(first, last):
        f = next_vertex[e]
        ax, ay = vertices[e, 0] - x, vertices[e, 1] - y
        bx, by = vertices[f, 0] - x, vertices[f, 1] - y
        dx, dy = bx - ax, by - ay
        cross = ax * by - ay * bx
        if ay <= 0.0:
            winding += by > 0.0 and cross > 0.0
        else:
            winding -= by <= 0.0 and cross < 0.0
        t = min(1.0, max(0.0, -(ax * dx + ay * dy) / (dx * dx + dy * dy)))
        px, py = ax + t * dx, ay + t * dy
        square = px * px + py * py
        if square < least:
            least, nearest = square, e
    return (np.sqrt(least) if winding != 0 else 0.0), nearest


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _seen(vertices, next_vertex, x, y, e):
    """(gap, coordinate along, length) of (x, y) relative to edge ``e``."""
    f = next_vertex[e]
    dx, dy = vertices[f, 0] - vertices[e, 0], vertices[f, 1] - vertices[e, 1]
    length = np.sqrt(dx * dx + dy * dy)
    px, py = x - vertices[e, 0], y - vertices[e, 1]
    return (px * dy - py * dx) / length, (px * dx + py * dy) / (length * length), length


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _way(vertices, next_vertex, e, at, f, to):
    """Length, m, of the outline between the position ``at`` (0 to 1) on edge ``e`` and ``to`` on edge ``f``, the
    shorter way round; inf on different outlines of one block."""
    if e == f:
        _, _, length = _seen(vertices, next_vertex, 0.0, 0.0, e)
        return abs(to - at) * length
    forth = whole = 0.0
    found = False
    k = e
    while True:
        _, _, length = _seen(vertices, next_vertex, 0.0, 0.0, k)
        whole += length
        if k == e:
            forth += (1.0 - at) * length
        elif k == f:
            forth += to * length
            found = True
        elif not found:
            forth += length
        k = next_vertex[k]
        if k == e:
            break
    return min(forth, whole - forth) if found else np.inf


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _rounded_off(v, vertices, rounding, first, last):
    """Common rounding length, m, of corner ``v`` and the nearest of those from ``first`` to ``last``; 0 where none is
    near."""
    longest = 0.0
    for w in range(first, last):
        length = min(rounding[v], rounding[w])
        dx, dy = vertices[v, 0] - vertices[w, 0], vertices[v, 1] - vertices[w, 1]
        if dx * dx + dy * dy < _NEAR * _NEAR * length * length:
            longest = max(longest, length)
    return longest


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _crossed(vertices, next_vertex, start, a, b, pressed, least, length):
    """A vertex and an edge of two blocks whose edges cross, and how far the nearest end of both is beyond the other's
    line.

    The depth is in m. Returns −1 where they cross by no more than the penetration of contacts there, ``least``, and the
    ``length`` of rounded tips.
    """
    for e in range(start[a], start[a + 1]):
        f = next_vertex[e]
        ex, ey = vertices[e, 0], vertices[e, 1]
        x_lo, x_hi = min(ex, vertices[f, 0]), max(ex, vertices[f, 0])
        y_lo, y_hi = min(ey, vertices[f, 1]), max(ey, vertices[f, 1])
        for g in range(start[b], start[b + 1]):
            h = next_vertex[g]
            if min(vertices[g, 0], vertices[h, 0]) > x_hi or max(vertices[g, 0], vertices[h, 0]) < x_lo:
                continue
            if min(vertices[g, 1], vertices[h, 1]) > y_hi or max(vertices[g, 1], vertices[h, 1]) < y_lo:
                continue
            one, _, _ = _seen(vertices, next_vertex, ex, ey, g)
            two, _, _ = _seen(vertices, next_vertex, vertices[f, 0], vertices[f, 1], g)
            if one * two >= 0.0:
                continue
            three, _, _ = _seen(vertices, next_vertex, vertices[g, 0], vertices[g, 1], e)
            four, _, _ = _seen(vertices, next_vertex, vertices[h, 0], vertices[h, 1], e)
            if three * four >= 0.0:
                continue
            depth_a, depth_b = min(abs(one), abs(two)), min(abs(three), abs(four))
            deep = max(max(pressed[e], pressed[f]), max(pressed[g], pressed[h]))
            if min(depth_a, depth_b) <= _PRESSED * deep + least + length:
                continue
            if depth_a <= depth_b:
                return (e if abs(one) <= abs(two) else f), g, depth_a
            return (g if abs(three) <= abs(four) else h), e, depth_b
    return -1, -1, 0.0


class Paths(NamedTuple):
    """Outlines at the start and end of a step.

    before, after   (n_vertices, 2) m
    next_vertex     (n_vertices,)
    vertex_start    (n_blocks + 1,) first vertex of each block
    """

    before: np.ndarray
    after: np.ndarray
    next_vertex: np.ndarray
    vertex_start: np.ndarray


class Allowed(NamedTuple):
    """Tolerances.

    pressed    (n_vertices,) m, deepest penetration of contacts at each vertex
    size       (n_blocks,) m, √area
    rounding   (n_vertices,) m, rounding lengths of corners
    """

    pressed: np.ndarray
    size: np.ndarray
    rounding: np.ndarray


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _entered_by(paths, v, f, left, first, last):
    """The edge by which vertex ``v`` last entered before it ``left`` by edge ``f`` (a fraction of the step), and where
    along it; −1 for none."""
    before, after, next_vertex = paths.before, paths.after, paths.next_vertex
    x0, y0, x1, y1 = before[v, 0], before[v, 1], after[v, 0], after[v, 1]
    entry, at, when = -1, 0.0, -1.0
    for e in range(first, last):
        h0, r0, _ = _seen(before, next_vertex, x0, y0, e)
        h1, r1, _ = _seen(after, next_vertex, x1, y1, e)
        if h0 < 0.0 or h1 >= 0.0 or e == f:
            continue
        t = h0 / (h0 - h1)
        r = r0 + t * (r1 - r0)
        if 0.0 <= r <= 1.0 and when < t <= left:
            entry, at, when = e, r, t
    return entry, at


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _gone_through(paths, v, first, last, allowed, longest):
    """The edge by which vertex ``v`` entered the block with vertices ``first`` to ``last`` and passed through, and the
    depth.

    The depth is in m. Returns −1 for none, for crossings within the tolerances ``allowed``, and for corners cut by at
    most ``longest`` m of outline.
    """
    before, after, next_vertex = paths.before, paths.after, paths.next_vertex
    x0, y0, x1, y1 = before[v, 0], before[v, 1], after[v, 0], after[v, 1]
    was, nearest = np.inf, -1
    for f in range(first, last):
        g0, s0, _ = _seen(before, next_vertex, x0, y0, f)
        if g0 >= -allowed:
            continue
        g1, s1, _ = _seen(after, next_vertex, x1, y1, f)
        if g1 <= 0.0:
            continue
        left = g0 / (g0 - g1)
        out = s0 + left * (s1 - s0)
        if out < 0.0 or out > 1.0:
            continue
        if was == np.inf:
            was, nearest = depth_inside(x0, y0, before, next_vertex, first, last)
        if was > 0.0 and was > allowed:
            continue  # it was deep in the block before: no way out is wrong
        # The edge by which it entered: the last one before it left, or the one on which it was.
        entry, at = _entered_by(paths, v, f, left, first, last)
        if entry < 0 and was > 0.0:
            _, at, _ = _seen(before, next_vertex, x0, y0, nearest)
            entry, at = nearest, min(1.0, max(0.0, at))
        if entry >= 0 and _way(before, next_vertex, entry, at, f, out) > longest:
            return entry, min(-g0, g1)
    return -1, 0.0


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _of_vertex(paths, box, allow, v, j, smaller):
    """Kind of crossing of vertex ``v`` with the outline of block ``j`` (−1: none), the edge, and the depth.

    ``smaller`` (m) is the size of the smaller block.
    """
    before, after = paths.before, paths.after
    first, last = paths.vertex_start[j], paths.vertex_start[j + 1]
    x0, y0, x1, y1 = before[v, 0], before[v, 1], after[v, 0], after[v, 1]
    if max(x0, x1) < box[j, 0] or min(x0, x1) > box[j, 2] or max(y0, y1) < box[j, 1] or min(y0, y1) > box[j, 3]:
        return -1, -1, 0.0
    least = _DEPTH * smaller
    allowed = _PRESSED * allow.pressed[v] + least
    now, near = depth_inside(x1, y1, after, paths.next_vertex, first, last)
    if now > allowed:
        allowed += ROUNDED_OVERLAP * _rounded_off(v, after, allow.rounding, first, last)
    if now > allowed:
        was, _ = depth_inside(x0, y0, before, paths.next_vertex, first, last)
        return (INTO, near, now) if now > was + least else (-1, -1, 0.0)
    longest = max(NOTABLE * smaller, _CUT * allow.rounding[v])
    edge, depth = _gone_through(paths, v, first, last, allowed, longest)
    return (THROUGH, edge, depth) if edge >= 0 else (-1, -1, 0.0)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _record(found, count, pair, vertex, edge, kind, depth):
    """Write a crossing to row ``count`` of ``found`` if there is room; returns the new count."""
    if count < found.shape[0]:
        found[count, 0], found[count, 1], found[count, 2] = pair, vertex, edge
        found[count, 3], found[count, 4] = kind, depth
    return count + 1


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _find(pairs, paths, box, allow, found):
    """Number of crossings of ``pairs``; ``found`` (m, 6) receives as many as it has room for."""
    count, start = 0, paths.vertex_start
    for k in range(pairs.shape[0]):
        a, b = pairs[k, 0], pairs[k, 1]
        if box[a, 0] > box[b, 2] or box[b, 0] > box[a, 2] or box[a, 1] > box[b, 3] or box[b, 1] > box[a, 3]:
            continue
        smaller = min(allow.size[a], allow.size[b])
        known = count
        for role in range(2):
            i, j = (a, b) if role == 0 else (b, a)
            for v in range(start[i], start[i + 1]):
                kind, edge, depth = _of_vertex(paths, box, allow, v, j, smaller)
                if kind >= 0:
                    count = _record(found, count, k, v, edge, kind, depth)
        if count > known:
            continue
        least, length = _DEPTH * smaller, _TIPS * min(allow.rounding[start[a]], allow.rounding[start[b]])
        pressed, following = allow.pressed, paths.next_vertex
        vertex, edge, depth = _crossed(paths.after, following, start, a, b, pressed, least, length)
        if vertex >= 0 and _crossed(paths.before, following, start, a, b, pressed, least, length)[0] < 0:
            count = _record(found, count, k, vertex, edge, INTO, depth)
    return count


def crossings(
    paths: Paths, pairs: np.ndarray, box: np.ndarray, allow: Allowed
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Crossings of ``pairs`` (k, 2) of blocks in a step along ``paths``.

    ``box`` (n_blocks, 4) encloses each block before and after. Returns pair, vertex, edge of entry, kind, and depth
    (m), (n,) each.
    """
    room = 64
    while True:
        found = np.empty((room, 6))
        count = _find(pairs, paths, box, allow, found)
        if count <= room:
            break
        room = count
    whole = found[:count, :4].astype(np.int64)
    return whole[:, 0], whole[:, 1], whole[:, 2], whole[:, 3], found[:count, 4]
