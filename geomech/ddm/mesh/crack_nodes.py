"""Topology of a crack network: the segment ends at each node, nodes where a crack runs straight on, shared end
points."""

from __future__ import annotations

import math

import numpy as np

from ...compiled import kept
from ...model import Cracks
from ..kernels import shape_functions

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
    """(m, m) bool: which of ``pieces`` (m, 2, 2) have an end point in common, bit for bit; the diagonal is True."""
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
