"""Neighbour search: pairs of blocks that may come into contact, from strips of bounding boxes, reused while valid.

Pairs are searched for within the contact window plus a margin, and remain valid until a vertex has moved by half the margin
(Verlet 1967). Which pairs are examined thus depends on the past; the contacts found do not.
"""

from __future__ import annotations

import time

import numpy as np

from ...compiled import UNCOUNTED, kept
from ..counters import Work

#: Reach of the search over the contact window: enough for some steps of the largest allowed motion and many usual ones,
#: and small relative to a block.
_REACH = 2.0


@kept(fastmath=False, error_model="numpy", nogil=True)
def _sweep_strips(box, fixed, reach, order, first, last, start, members, pairs):
    """Number of pairs whose boxes are nearer than ``reach`` m; written to ``pairs`` as far as it has room.

    ``first`` and ``last`` are the strips of each block, ``members[start[s]:start[s + 1]]`` the blocks of strip s,
    filled here in the ``order`` of their least x. A pair counts in the lowest strip that both share.
    """
    n = box.shape[0]
    fill = start.copy()
    for k in range(n):
        b = order[k]
        for s in range(first[b], last[b] + 1):
            members[fill[s]] = b
            fill[s] += 1
    count = 0
    for s in range(start.shape[0] - 1):
        for p in range(start[s], start[s + 1]):
            i = members[p]
            for q in range(p + 1, start[s + 1]):
                j = members[q]
                if box[j, 0] > box[i, 2] + reach:
                    break
                if max(first[i], first[j]) != s or (fixed[i] and fixed[j]):
                    continue
                if box[i, 1] > box[j, 3] + reach or box[j, 1] > box[i, 3] + reach:
                    continue
                if count < pairs.shape[0]:
                    pairs[count, 0], pairs[count, 1] = min(i, j), max(i, j)
                count += 1
    return count


def near_pairs(box: np.ndarray, fixed: np.ndarray, reach: float) -> np.ndarray:
    """(k, 2) pairs of blocks, lower number first, ascending, whose boxes are nearer than ``reach`` m.

    ``box`` (n, 4) min x, min y, max x, max y, m. Pairs of two ``fixed`` (n,) blocks are left out."""
    n = len(box)
    height = 2.0 * float(np.median(box[:, 3] - box[:, 1])) + reach
    low = float(box[:, 1].min())
    # Strips twice as high as a block, and at most as many as blocks, however far apart these lie.
    height = max(height, (float(box[:, 3].max()) - low) / n)
    first = np.floor((box[:, 1] - reach - low) / height).astype(np.int64)
    last = np.floor((box[:, 3] + reach - low) / height).astype(np.int64)
    last -= first.min()
    first -= first.min()
    ends = np.bincount(first, minlength=int(last.max()) + 2) - np.bincount(last + 1, minlength=int(last.max()) + 2)
    start = np.concatenate([[0], np.cumsum(np.cumsum(ends)[:-1])])
    order = np.argsort(box[:, 0], kind="stable")
    members = np.empty(start[-1], np.int64)
    room = 8 * n + 16
    while True:
        pairs = np.empty((room, 2), np.int64)
        count = _sweep_strips(box, fixed, reach, order, first, last, start, members, pairs)
        if count <= room:
            break
        room = count
    pairs = pairs[:count]
    return pairs[np.argsort(pairs[:, 0] * n + pairs[:, 1])]


class NearPairs:
    """The neighbour list of one block system: ``vertex_start`` (n_blocks + 1,), ``fixed`` (n_blocks,).

    ``work`` counts searches and reuses."""

    def __init__(self, vertex_start: np.ndarray, fixed: np.ndarray, work: Work | None = None) -> None:
        self._first, self._fixed = vertex_start[:-1], fixed
        self._vertices: np.ndarray | None = None
        self._kept: np.ndarray | None = None
        self._pairs = self._in_boxes = np.empty((0, 2), np.int64)
        self._reach = 0.0
        self.work = work or Work()

    def of(self, vertices: np.ndarray, window: float) -> np.ndarray:
        """(k, 2) all pairs nearer than ``window`` m at ``vertices`` (n_vertices, 2), and some others; none for a single
        block."""
        if len(self._first) < 2:
            self.work.lone_searches += 1
            return np.zeros((0, 2), np.int64)
        if self._vertices is None or not window + 2.0 * np.abs(vertices - self._vertices).max() <= self._reach:
            self._reach = _REACH * window
            self._vertices = vertices.copy()
            self._pairs = self._searched(boxes(vertices, self._first), self._reach)
        else:
            self.work.pair_searches_kept += 1
        return self._pairs

    def of_boxes(self, box: np.ndarray, more: np.ndarray) -> np.ndarray:
        """(k, 2) all pairs whose boxes ``box`` (n_blocks, 4) meet, and some others.

        Boxes are widened by ``more`` (n_blocks,) m when pairs are searched for, and the pairs remain valid while the widened
        boxes contain the current ones."""
        if len(self._first) < 2:
            self.work.lone_searches += 1
            return np.zeros((0, 2), np.int64)
        if self._kept is None or not _hold(self._kept, box):
            more = (_REACH - 1.0) * more
            self._kept = box + np.stack([-more, -more, more, more], axis=1)
            self._in_boxes = self._searched(self._kept, 0.0)
        else:
            self.work.pair_searches_kept += 1
        return self._in_boxes

    def _searched(self, box: np.ndarray, reach: float) -> np.ndarray:
        """The result of `near_pairs`, counted and, after the first time, timed."""
        began = time.perf_counter()
        pairs = near_pairs(box, self._fixed, reach)
        self.work.pair_search_s += (time.perf_counter() - began) if self.work.pair_searches else 0.0
        self.work.pair_searches += 1
        return pairs


def boxes(vertices: np.ndarray, first: np.ndarray) -> np.ndarray:
    """(n_blocks, 4) min x, min y, max x, max y of the blocks whose vertices begin at ``first``, m."""
    return _boxes(np.ascontiguousarray(vertices), np.ascontiguousarray(first, np.int64))


@kept(fastmath=False, error_model="numpy", nogil=True)
def _boxes(vertices, first):
    """Compiled `boxes`: takes a tenth of the time of NumPy's reduceat."""
    n = first.shape[0]
    out = np.empty((n, 4))
    for b in range(n):
        last = first[b + 1] if b + 1 < n else vertices.shape[0]
        x0 = x1 = vertices[first[b], 0]
        y0 = y1 = vertices[first[b], 1]
        for i in range(first[b] + 1, last):
            x, y = vertices[i, 0], vertices[i, 1]
            x0, x1 = min(x0, x), max(x1, x)
            y0, y1 = min(y0, y), max(y1, y)
        out[b, 0], out[b, 1], out[b, 2], out[b, 3] = x0, y0, x1, y1
    return out


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _hold(wide, box):
    """True if each of the boxes ``wide`` (n, 4) contains that of ``box`` (n, 4)."""
    for b in range(box.shape[0]):
        if box[b, 0] < wide[b, 0] or box[b, 1] < wide[b, 1] or box[b, 2] > wide[b, 2] or box[b, 3] > wide[b, 3]:
            return False
    return True
