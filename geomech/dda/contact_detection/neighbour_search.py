"""Pairs of blocks that may come into contact: found in strips, kept until something has moved far enough.

Pairs are sought within more than the window of the contacts, and serve until a vertex has moved by half of what that is
more (Verlet 1967). Which pairs are looked at so depends on the past; which contacts they give does not.
"""

from __future__ import annotations

import time

import numpy as np

from ...compiled import kept
from ..counters import Work

#: Pairs are sought within this many times the window of contacts: wide enough to last some steps of the largest motion
#: allowed and many of the usual ones, and narrow beside a block.
_REACH = 2.0


@kept(fastmath=False, error_model="numpy", nogil=True)
def _sweep_strips(box, fixed, reach, order, first, last, start, members, pairs):
    """Number of pairs whose boxes are nearer than ``reach``, written to ``pairs`` as far as it has room.

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
    """(k, 2) blocks, the lower number first, ascending, whose boxes (n, 4) (least x, y, greatest x, y; m) are nearer
    than ``reach`` m; none of two ``fixed`` ones."""
    n = len(box)
    height = 2.0 * float(np.median(box[:, 3] - box[:, 1])) + reach
    low = float(box[:, 1].min())
    # Strips as high as two blocks; no more of them than blocks, however far apart those lie.
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
    """Keeps the pairs of one system of blocks: ``vertex_start`` (n_blocks + 1,), ``fixed`` (n_blocks,). ``work`` counts
    how often they were sought, and were not."""

    def __init__(self, vertex_start: np.ndarray, fixed: np.ndarray, work: Work | None = None) -> None:
        self._first, self._fixed = vertex_start[:-1], fixed
        self._vertices: np.ndarray | None = None
        self._kept: np.ndarray | None = None
        self._pairs = self._in_boxes = np.empty((0, 2), np.int64)
        self._reach = 0.0
        self.work = work or Work()

    def of(self, vertices: np.ndarray, window: float) -> np.ndarray:
        """All pairs that may be nearer than ``window`` m on ``vertices`` (n_vertices, 2), and some that are not; of one
        block none is looked for."""
        if len(self._first) < 2:
            self.work.lone_searches += 1
            return np.zeros((0, 2), np.int64)
        if self._vertices is None or not window + 2.0 * np.abs(vertices - self._vertices).max() <= self._reach:
            began = time.perf_counter()
            self._reach = _REACH * window
            self._vertices = vertices.copy()
            self._pairs = near_pairs(boxes(vertices, self._first), self._fixed, self._reach)
            self.work.pair_search_s += (time.perf_counter() - began) if self.work.pair_searches else 0.0
            self.work.pair_searches += 1
        else:
            self.work.pair_searches_kept += 1
        return self._pairs

    def of_boxes(self, box: np.ndarray, more: np.ndarray) -> np.ndarray:
        """All pairs whose boxes ``box`` (n_blocks, 4) meet, and some others: those that did when pairs were last sought,
        with boxes wider by ``more`` (n_blocks,) m than they were then, as long as these hold the present ones."""
        if len(self._first) < 2:
            self.work.lone_searches += 1
            return np.zeros((0, 2), np.int64)
        if self._kept is None or not _hold(self._kept, box):
            began = time.perf_counter()
            more = (_REACH - 1.0) * more
            self._kept = box + np.stack([-more, -more, more, more], axis=1)
            self._in_boxes = near_pairs(self._kept, self._fixed, 0.0)
            self.work.pair_search_s += (time.perf_counter() - began) if self.work.pair_searches else 0.0
            self.work.pair_searches += 1
        else:
            self.work.pair_searches_kept += 1
        return self._in_boxes


def boxes(vertices: np.ndarray, first: np.ndarray) -> np.ndarray:
    """(n_blocks, 4) least x, y and greatest x, y of the blocks whose vertices begin at ``first``."""
    return _boxes(np.ascontiguousarray(vertices), np.ascontiguousarray(first, np.int64))


@kept(fastmath=False, error_model="numpy", nogil=True)
def _boxes(vertices, first):
    """`boxes`, a tenth of the time of ufuncs that reduce at ``first``."""
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


@kept(fastmath=False, error_model="numpy", nogil=True)
def _hold(wide, box):
    """Whether each of the boxes ``wide`` (n, 4) holds the one of ``box``."""
    for b in range(box.shape[0]):
        if box[b, 0] < wide[b, 0] or box[b, 1] < wide[b, 1] or box[b, 2] > wide[b, 2] or box[b, 3] > wide[b, 3]:
            return False
    return True
