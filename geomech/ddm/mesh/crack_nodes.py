"""Topology of a crack network: the segment ends at each node, nodes where a crack runs straight on, shared end
points, pieces of one digitised line."""

from __future__ import annotations

import math

import numpy as np

from ...compiled import kept
from ...model import Cracks
from ..kernels import shape_functions

#: Pieces of one loop or crack with no more between them than so many times the length that elements are wanted to have …
REACH = 2.0
#: … and headings within this are one behind the other, not beside each other, …
ONWARD = math.radians(60)
#: … and within this (a slight kink) in line, rad.
IN_LINE = math.radians(20)

_jit = kept(error_model="numpy", nogil=True)


def ends_at(cracks: Cracks) -> tuple[np.ndarray, np.ndarray]:
    """Segment ends at each node, in the order of the segments.

    Returns (n_nodes + 1,) ``first`` and (2 n_segments,) ``ends``: node k has ``ends[first[k]:first[k + 1]]``, where 2 s
    is the start and 2 s + 1 the end of segment s.
    """
    return _ends_at(np.ascontiguousarray(cracks.segments, dtype=np.int64), cracks.valence)


@_jit
def _ends_at(segments, valence):
    first = np.zeros(len(valence) + 1, np.int64)
    for k in range(len(valence)):
        first[k + 1] = first[k] + valence[k]
    at, ends = first[:-1].copy(), np.empty(2 * len(segments), np.int64)
    for s in range(len(segments)):
        for e in range(2):
            k = segments[s, e]
            ends[at[k]] = 2 * s + e
            at[k] += 1
    return first, ends


@_jit
def straight_on(nodes, segments, surface, size, shut, first, ends, kink, jump):
    """(n_nodes,) bool: nodes of exactly two segments that need no grading.

    The segments turn by less than ``kink`` (rad), the ratio of their element sizes ``size`` (n_segments,) is below
    ``jump``, and they are not both ``shut`` (n_segments,), i.e. drawn closed. ``first``, ``ends``: see `ends_at`.
    """
    out = np.zeros(len(nodes), np.bool_)
    for k in range(len(nodes)):
        if surface[k] or first[k + 1] - first[k] != 2:
            continue
        one, two = ends[first[k]], ends[first[k] + 1]
        s, r = one // 2, two // 2
        if (shut[s] and shut[r]) or max(size[s], size[r]) >= jump * min(size[s], size[r]):
            continue
        p, q = segments[s, 1 - one % 2], segments[r, 1 - two % 2]
        ux, uy = nodes[k, 0] - nodes[p, 0], nodes[k, 1] - nodes[p, 1]
        vx, vy = nodes[q, 0] - nodes[k, 0], nodes[q, 1] - nodes[k, 1]
        out[k] = abs(math.atan2(ux * vy - uy * vx, ux * vx + uy * vy)) < kink
    return out


@_jit
def cut(nodes, segments, tip, pieces, fractions):
    """Start and end (n, 2), kind and segment (n,) of the elements of all segments.

    ``pieces`` (n_segments,) is the number of elements of each segment; ``fractions`` are the interior division points
    of the segments, one segment after the other; ``tip`` (n_nodes,) marks the nodes that are crack tips.
    """
    n, k = pieces.sum(), 0
    start, end = np.empty((n, 2)), np.empty((n, 2))
    kind, source = np.full(n, shape_functions.ORDINARY), np.empty(n, np.int64)
    for s in range(len(segments)):
        i, j, first, last = segments[s, 0], segments[s, 1], k, k + pieces[s] - 1
        for c in range(2):
            start[first, c], end[last, c] = nodes[i, c], nodes[j, c]
            for m in range(first, last):
                f = fractions[m - s]
                end[m, c] = start[m + 1, c] = (1 - f) * nodes[i, c] + f * nodes[j, c]
        source[first : last + 1] = s
        if tip[i]:
            kind[first] = shape_functions.TIP_START
        if tip[j]:
            kind[last] = shape_functions.TIP_BOTH if tip[i] and first == last else shape_functions.TIP_END
        k = last + 1
    return start, end, kind, source


def share_ends(pieces: np.ndarray) -> np.ndarray:
    """(m, m) bool: which of ``pieces`` (m, 2, 2) follow each other on one ``line`` (m,), a loop or a crack, and turn so
    little between them that there is no rock between them; None if no piece is short compared with the elements
    ``wanted`` (m,), m. ``wanted`` is 0 of growth increments and curved walls, which were not digitised.

    Extends ``touching`` (m, m) by pieces of the line up to `ONWARD`, and by pieces that touch one in line with them.
    """
    flat = np.ascontiguousarray(pieces).reshape(-1, 2)
    return _share_ends(flat, np.argsort(flat[:, 0]))


@_jit
def _share_ends(points, order):
    out = np.zeros((len(points) // 2, len(points) // 2), np.bool_)
    for m in range(len(order)):
        i = order[m]
        out[i // 2, i // 2] = True
        for n in range(m + 1, len(order)):
            j = order[n]
            if points[j, 0] != points[i, 0]:
                break
            if points[j, 1] == points[i, 1]:
                out[i // 2, j // 2] = out[j // 2, i // 2] = True
    return out


def in_line(touching: np.ndarray, pieces: np.ndarray, wanted: np.ndarray, line: np.ndarray) -> np.ndarray | None:
    """(m, m) bool: which of ``pieces`` (m, 2, 2) that follow each other on one ``line`` (m,), a loop or a crack, go on so
    nearly straight that what is between them is no rock; None where elements, ``wanted`` (m,) m long, are shorter than
    all of it. 0 is wanted of increments of growth, and of curved walls, which are compared as before.

    Adds to ``touching`` (m, m) those that are one behind the other, and what meets a piece that another is in line with.
    """
    short = np.hypot(*(pieces[:, 1] - pieces[:, 0]).T) < REACH * wanted
    if not short.any():
        return None
    out, onward = _in_line(np.ascontiguousarray(pieces), wanted, line, _next(np.ascontiguousarray(pieces), line))
    touching |= onward
    lines = out.astype(np.float32)
    touching |= lines @ touching.astype(np.float32) @ lines > 0.5
    return out


@_jit
def _next(pieces, line):
    """(m,) the piece of the same ``line`` that begins where each ends; −1 where none does."""
    out = np.full(len(pieces), -1)
    for i in range(len(pieces)):
        # The next in the list; of a loop the last's is the first.
        for j in (i + 1, np.searchsorted(line[: i + 1], line[i])):
            here = 0 <= j < len(pieces) and j != i and line[j] == line[i]
            if here and pieces[j, 0, 0] == pieces[i, 1, 0] and pieces[j, 0, 1] == pieces[i, 1, 1]:
                out[i] = j
                break
    return out


@_jit
def _in_line(pieces, wanted, line, after):
    """Which pieces are in line, and which one behind the other, both (m, m)."""
    n = len(pieces)
    out, onward = np.zeros((n, n), np.bool_), np.zeros((n, n), np.bool_)
    for a in range(n):
        out[a, a] = True
        way, turned, least, most, last, b = 0.0, 0.0, 0.0, 0.0, a, after[a]
        while b >= 0 and b != a and wanted[b] > 0:
            px, py = pieces[last, 1, 0] - pieces[last, 0, 0], pieces[last, 1, 1] - pieces[last, 0, 1]
            qx, qy = pieces[b, 1, 0] - pieces[b, 0, 0], pieces[b, 1, 1] - pieces[b, 0, 1]
            if last != a:
                way += math.hypot(px, py)
            turned += math.atan2(px * qy - py * qx, px * qx + py * qy)
            least, most = min(least, turned), max(most, turned)
            if way > REACH * wanted[a] or most - least > ONWARD:
                break
            onward[a, b] = onward[b, a] = True
            if most - least < IN_LINE:
                out[a, b] = out[b, a] = True
            last, b = b, after[b]
    return out, onward
