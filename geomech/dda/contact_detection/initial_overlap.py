"""Initial overlap of blocks: detected and refused, because the contact springs would throw such blocks apart."""

from __future__ import annotations

import logging

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ...model import Blocks
from ..kinematics.tolerances import LITTLE, NOTHING
from ..step_control.continuous_collision import depth_inside
from .neighbour_search import boxes, near_pairs

log = logging.getLogger(__name__)

#: Overlap over the size √area of the smaller block, above which it is refused; above `NOTHING` it is reported, since the
#: springs release the energy of the overlap.
REFUSED = LITTLE


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _depth_crossing(vertices, next_vertex, e, f):
    """Least distance of the ends of two crossing edges from each other's line, m; 0 where they do not cross."""
    least = np.inf
    for turn in range(2):
        i, j = (e, f) if turn == 0 else (f, e)
        ax, ay = vertices[i, 0], vertices[i, 1]
        dx, dy = vertices[next_vertex[i], 0] - ax, vertices[next_vertex[i], 1] - ay
        length = np.sqrt(dx * dx + dy * dy)
        start = ((vertices[j, 0] - ax) * dy - (vertices[j, 1] - ay) * dx) / length
        end = ((vertices[next_vertex[j], 0] - ax) * dy - (vertices[next_vertex[j], 1] - ay) * dx) / length
        if start * end >= 0.0:
            return 0.0
        least = min(least, abs(start), abs(end))
    return least


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def depth_of_pair(vertices, next_vertex, start, box, centroid, a, b):
    """Depth of the overlap of blocks ``a`` and ``b``, m; 0 without overlap.

    ``start`` (n_blocks + 1,) first vertices; ``box`` (n_blocks, 4) min x, min y, max x, max y, m; ``centroid``
    (n_blocks, 2) m."""
    if box[a, 0] >= box[b, 2] or box[b, 0] >= box[a, 2] or box[a, 1] >= box[b, 3] or box[b, 1] >= box[a, 3]:
        return 0.0
    depth = 0.0
    for turn in range(2):
        i, j = (a, b) if turn == 0 else (b, a)
        # Coincident blocks have all corners on each other's outline.
        if depth_inside(centroid[i, 0], centroid[i, 1], vertices, next_vertex, start[i], start[i + 1])[0] > 0.0:
            depth = max(
                depth, depth_inside(centroid[i, 0], centroid[i, 1], vertices, next_vertex, start[j], start[j + 1])[0]
            )
        # Corners and midpoints of edges: of blocks shifted along a common side only midpoints lie inside.
        for v in range(start[i], start[i + 1]):
            for share in (0.0, 0.5):
                x = vertices[v, 0] + share * (vertices[next_vertex[v], 0] - vertices[v, 0])
                y = vertices[v, 1] + share * (vertices[next_vertex[v], 1] - vertices[v, 1])
                if box[j, 0] < x < box[j, 2] and box[j, 1] < y < box[j, 3]:
                    depth = max(depth, depth_inside(x, y, vertices, next_vertex, start[j], start[j + 1])[0])
    if depth == 0.0:
        for e in range(start[a], start[a + 1]):
            for f in range(start[b], start[b + 1]):
                depth = max(depth, _depth_crossing(vertices, next_vertex, e, f))
    return depth


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _worst_pair(vertices, next_vertex, start, box, pairs, centroid, size):
    """(block, other, depth m) of the pair of ``pairs`` (k, 2) with the largest overlap over the smaller block's size;
    (−1, −1, 0) for none."""
    worst_a, worst_b, worst, worst_share = -1, -1, 0.0, 0.0
    for k in range(len(pairs)):
        a, b = pairs[k]
        depth = depth_of_pair(vertices, next_vertex, start, box, centroid, a, b)
        smaller = min(size[a], size[b])
        if depth > worst_share * smaller:
            worst_a, worst_b, worst, worst_share = a, b, depth, depth / smaller
    return worst_a, worst_b, worst


def deepest_overlap(blocks: Blocks, vertices: np.ndarray, moments: np.ndarray) -> tuple[int, int, float, float]:
    """The pair of blocks with the largest relative overlap: (block, other, depth m, depth over √area of the smaller).

    ``vertices`` (n_vertices, 2) m; ``moments`` (n_blocks, ≥ 3) with area and centroid first. Blocks are −1 without
    overlap."""
    start = np.ascontiguousarray(blocks.vertex_start, np.int64)
    box = boxes(vertices, start[:-1])
    size = np.sqrt(moments[:, 0])
    a, b, depth = _worst_pair(
        np.ascontiguousarray(vertices), np.ascontiguousarray(blocks.next_vertex, np.int64), start, box,
        near_pairs(box, np.zeros(len(box), bool), 0.0), np.ascontiguousarray(moments[:, 1:3]), size,
    )  # fmt: skip
    return a, b, depth, depth / min(size[a], size[b]) if a >= 0 else 0.0


def refuse_overlap(blocks: Blocks, vertices: np.ndarray, moments: np.ndarray) -> None:
    """Check for overlapping blocks at ``vertices``; ``moments`` as in `deepest_overlap`.

    Raises ValueError that names the worst pair when it overlaps by more than `REFUSED` of the smaller block's size;
    logs a warning above `NOTHING`.
    """
    a, b, depth, share = deepest_overlap(blocks, vertices, moments)
    if share <= NOTHING:
        return
    start = blocks.vertex_start
    low, high = ([limit(vertices[start[k] : start[k + 1]], axis=0) for k in (a, b)] for limit in (np.min, np.max))
    x, y = 0.5 * (np.maximum(*low) + np.minimum(*high))
    what = f"{blocks.names[a]!r} and {blocks.names[b]!r} overlap by {depth:.3g} m near x = {x:.6g}, y = {y:.6g} m before they have moved"
    if share > REFUSED:
        raise ValueError(f"{what}: draw them apart, or subtract one from the other")
    log.warning("%s; their contact pushes them apart", what)
