"""Limit of the relative motion of two neighbouring blocks in a step, and the search distance of their contacts.

The relative displacement of blocks a and b is the affine field u_a(x) − u_b(x). The *motion* of a pair is its largest
magnitude where both may be in the step, which is at a corner of the intersection of their boxes, widened by the motion
itself: common motion and motion elsewhere do not count. The velocity V at the start of a step gives

    motion ≤ V dt + g dt²,      window = 1.1 (V dt + g dt²) + margin,

the second being the search distance of contacts. Contacts keep the lines and edges of the step's start. After closing
the distance between them, a pair may therefore move by `SHARE` of the geometric mean of its blocks' sizes (`widths`),
and rotate by `TURN` relative to each other, whatever the size of other blocks and of the model. What the velocity does
not predict (impacts, sudden loads) is checked after the step (`continuous_collision`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ..contact_detection.neighbour_search import NearPairs, boxes

#: Two blocks may move relative to each other by this part of the geometric mean of their sizes in a step …
SHARE = 0.1
#: … and rotate by this, rad, because contacts keep their directions during a step.
TURN = 0.15
#: Search distance of contacts: this part of the smaller block's size in addition to the predicted motion …
_MARGIN = 0.02
#: … times this factor.
_WIDER = 1.1
#: Share of the allowed motion that a step limited by speed uses; round-off and impacts take the rest.
AIM = 0.99


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _relative(affine, centroid, a, b, x, y):
    """Magnitude of the relative displacement of blocks ``a`` and ``b`` at (x, y)."""
    ax, ay, bx, by = x - centroid[a, 0], y - centroid[a, 1], x - centroid[b, 0], y - centroid[b, 1]
    p, q = affine[a], affine[b]
    u = p[0] + p[2] * ax + p[3] * ay - q[0] - q[2] * bx - q[3] * by
    v = p[1] + p[4] * ax + p[5] * ay - q[1] - q[4] * bx - q[5] * by
    return np.sqrt(u * u + v * v)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _motion(affine, centroid, box, a, b, more):
    """Largest relative displacement where ``a`` and ``b`` may meet, plus ``more``; −1 where they cannot meet."""
    x0, x1 = min(box[a, 0], box[b, 0]), max(box[a, 2], box[b, 2])
    y0, y1 = min(box[a, 1], box[b, 1]), max(box[a, 3], box[b, 3])
    motion = np.inf
    for _ in range(3):
        here = 0.0
        for x in (x0, x1):
            for y in (y0, y1):
                here = max(here, _relative(affine, centroid, a, b, x, y))
        motion = min(motion, here)
        r = motion + more
        x0, x1 = max(box[a, 0], box[b, 0]) - r, min(box[a, 2], box[b, 2]) + r
        y0, y1 = max(box[a, 1], box[b, 1]) - r, min(box[a, 3], box[b, 3]) + r
        if x0 > x1 or y0 > y1:
            return -1.0
    return motion


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _apart(vertices, next_vertex, start, a, b):
    """Least distance, m, between the vertices of either block and the outline of the other."""
    least = np.inf
    for turn in range(2):
        i, j = (a, b) if turn == 0 else (b, a)
        for v in range(start[i], start[i + 1]):
            x, y = vertices[v, 0], vertices[v, 1]
            for e in range(start[j], start[j + 1]):
                f = next_vertex[e]
                px, py = x - vertices[e, 0], y - vertices[e, 1]
                dx, dy = vertices[f, 0] - vertices[e, 0], vertices[f, 1] - vertices[e, 1]
                t = min(1.0, max(0.0, (px * dx + py * dy) / (dx * dx + dy * dy)))
                px, py = px - t * dx, py - t * dy
                least = min(least, px * px + py * py)
    return np.sqrt(least)


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _longest(pairs, affine, turn, centroid, box, vertices, next_vertex, start, size, dt, g):
    """(time, pair): the longest step up to ``dt`` in which all ``pairs`` stay within their limits, and the limiting
    pair.

    The pair is −1 for none; ``affine`` and ``turn`` are the displacement and rotation that the velocity causes in
    ``dt``.
    """
    longest, which = dt, -1
    for k in range(pairs.shape[0]):
        a, b = pairs[k, 0], pairs[k, 1]
        may = SHARE * np.sqrt(size[a] * size[b])
        motion = _motion(affine, centroid, box, a, b, 0.5 * g * dt * dt + _MARGIN * min(size[a], size[b]))
        if motion < 0.0:
            continue
        speed, spin = motion / dt, abs(turn[a] - turn[b]) / dt
        if speed * longest + 0.5 * g * longest * longest > AIM * may and motion > 0.0:
            may = AIM * (may + _apart(vertices, next_vertex, start, a, b))
            # Root of speed t + g t²/2 = limit, in the form that is accurate for small g.
            time = 2.0 * may / (speed + np.sqrt(speed * speed + 2.0 * g * may))
            if time < longest:
                longest, which = time, k
        if spin * longest > AIM * TURN:
            longest, which = AIM * TURN / spin, k
    return longest, which


@kept(fastmath=False, error_model="numpy", nogil=True)
def _windows(pairs, affine, centroid, box, size, fall):
    """(k,) m: search distances of ``pairs`` that may meet; −1 for the others. ``fall`` is g dt², m."""
    out = np.empty(pairs.shape[0])
    for k in range(pairs.shape[0]):
        a, b = pairs[k, 0], pairs[k, 1]
        margin = _MARGIN * min(size[a], size[b])
        motion = _motion(affine, centroid, box, a, b, fall + margin)
        out[k] = _WIDER * (motion + fall) + margin if motion >= 0.0 else -1.0
    return out


@kept(fastmath=False, error_model="numpy", nogil=True)
def _shares(pairs, affine, turn, centroid, box, vertices, next_vertex, start, size):
    """(k, 2): motion of ``pairs``, m, and its ratio to the allowed motion and rotation."""
    out = np.zeros((pairs.shape[0], 2))
    for k in range(pairs.shape[0]):
        a, b = pairs[k, 0], pairs[k, 1]
        may = SHARE * np.sqrt(size[a] * size[b])
        motion = max(0.0, _motion(affine, centroid, box, a, b, 0.0))
        if motion > may:
            may += _apart(vertices, next_vertex, start, a, b)
        out[k, 0], out[k, 1] = motion, max(motion / may, abs(turn[a] - turn[b]) / TURN)
    return out


@dataclass(frozen=True, eq=False)
class Windows:
    """Search distances ``reach`` (k,) m of ``pairs`` (k, 2) of blocks, ascending."""

    pairs: np.ndarray
    reach: np.ndarray

    def widened(self, pairs: np.ndarray, reach: np.ndarray, n_blocks: int) -> Windows:
        """The windows with at least ``reach`` (m,) m for ``pairs`` (m, 2)."""
        if not len(pairs):
            return self
        both = np.concatenate([self.pairs, pairs])
        keys, at = np.unique(both[:, 0] * n_blocks + both[:, 1], return_inverse=True)
        out = np.zeros(len(keys))
        np.maximum.at(out, at, np.concatenate([self.reach, reach]))
        return Windows(np.stack([keys // n_blocks, keys % n_blocks], axis=1), out)

    def reaches_beyond(self, before: Windows) -> bool:
        """Whether any search distance exceeds that of the windows ``before``."""
        return len(self.pairs) > len(before.pairs) or bool((self.reach > before.reach).any())

    def of_contacts(self, block: np.ndarray, other: np.ndarray, n_blocks: int) -> np.ndarray:
        """(n,) number of the pair of each contact between ``block`` and ``other`` (n,); −1 where it is not in the
        list."""
        if not len(self.pairs):
            return np.full(len(block), -1)
        keys = self.pairs[:, 0] * n_blocks + self.pairs[:, 1]
        key = np.minimum(block, other) * n_blocks + np.maximum(block, other)
        at = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
        return np.where(keys[at] == key, at, -1)

    def reach_of(self, block: int, other: int, n_blocks: int) -> float:
        """Search distance of two blocks, m; 0 where they are not in the list."""
        at = int(self.of_contacts(np.array([block]), np.array([other]), n_blocks)[0])
        return float(self.reach[at]) if at >= 0 else 0.0


def widths(vertices: np.ndarray, next_vertex: np.ndarray, vertex_start: np.ndarray, area: np.ndarray) -> np.ndarray:
    """(n_blocks,) m: effective size of blocks: √area, or 4 area/perimeter where a block is thin or has teeth (the side
    of a square; about twice the thickness of a wall)."""
    edges = np.hypot(*(vertices[next_vertex] - vertices).T)
    return np.minimum(np.sqrt(area), 4.0 * area / np.add.reduceat(edges, vertex_start[:-1]))


class Approach:
    """Pairs of blocks that may approach each other in a step.

    next_vertex    (n_vertices,)
    vertex_start   (n_blocks + 1,)
    size           (n_blocks,) m, `widths`
    near           finds pairs
    """

    def __init__(self, next_vertex: np.ndarray, vertex_start: np.ndarray, size: np.ndarray, near: NearPairs) -> None:
        self._next, self._start, self._size, self._near = next_vertex, vertex_start, size, near

    def _of(self, box: np.ndarray, affine: np.ndarray, centroid: np.ndarray, fall: float, more: float) -> np.ndarray:
        """Pairs that the displacement ``affine`` (n_blocks, 6) may bring together, and some others."""
        own = np.abs(affine[:, :2]).max(axis=1)
        half = 0.5 * (box[:, 2:] - box[:, :2])
        off = np.abs(0.5 * (box[:, 2:] + box[:, :2]) - centroid) + half
        own += (np.abs(affine[:, 2:]).max(axis=1)) * off.sum(axis=1)
        reach = _WIDER * (1.5 * own + fall) + _MARGIN * self._size + more
        wide = box.copy()
        wide[:, :2] -= reach[:, None]
        wide[:, 2:] += reach[:, None]
        return self._near.of_boxes(wide, 0.1 * self._size + reach)

    def longest(
        self, vertices: np.ndarray, affine: np.ndarray, turn: np.ndarray, centroid: np.ndarray, dt: float, g: float
    ) -> tuple[float, tuple[int, int] | None]:
        """The longest step, up to ``dt`` s, that no pair shortens, and the limiting pair of blocks.

        ``affine`` (n_blocks, 6) and ``turn`` (n_blocks,) rad are the displacement and rotation that the velocity causes
        in ``dt``; ``g`` in m/s².
        """
        box = boxes(vertices, self._start[:-1])
        pairs = self._of(box, affine, centroid, 0.5 * g * dt * dt, 0.0)
        time, which = _longest(pairs, affine, turn, centroid, box, vertices, self._next, self._start, self._size, dt, g)
        return time, None if which < 0 else (int(pairs[which, 0]), int(pairs[which, 1]))

    def windows(self, vertices: np.ndarray, affine: np.ndarray, centroid: np.ndarray, fall: float, more: float):
        """`Windows` of a step in which the velocity causes the displacement ``affine``.

        ``fall`` (m) is g dt²; ``more`` (m) is added for contacts that press at a distance.
        """
        box = boxes(vertices, self._start[:-1])
        pairs = self._of(box, affine, centroid, fall, more)
        reach = _windows(pairs, affine, centroid, box, self._size, fall + more)
        near = reach >= 0.0
        return Windows(pairs[near], reach[near])

    def shares(
        self, pairs: np.ndarray, vertices: np.ndarray, affine: np.ndarray, turn: np.ndarray, centroid: np.ndarray
    ) -> np.ndarray:
        """(k, 2): relative motion of ``pairs`` (k, 2) where they may meet, m, and its ratio to the allowed motion and
        rotation."""
        box = boxes(vertices, self._start[:-1])
        return _shares(
            np.ascontiguousarray(pairs),
            affine,
            np.ascontiguousarray(turn),
            centroid,
            box,
            vertices,
            self._next,
            self._start,
            self._size,
        )
