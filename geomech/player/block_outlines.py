"""Outlines of blocks and of meshed rock, from the triangles that a run has written."""

from __future__ import annotations

import numpy as np


def free_edges(triangles: np.ndarray) -> np.ndarray:
    """(k, 2) point indices of the edges that belong to one of ``triangles`` (m, 3) only, the triangle on their left."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, first, count = np.unique(low << 32 | high, return_index=True, return_counts=True)
    return edges[np.sort(first[count == 1])]


def outlines(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(corners, starts): closed outlines of ``triangles`` as point indices, loop after loop, loop k being
    ``corners[starts[k]:starts[k + 1]]``; outer ones run counter-clockwise, holes clockwise."""
    following: dict[int, list[int]] = {}
    for a, b in free_edges(triangles).tolist():
        following.setdefault(a, []).append(b)
    corners: list[int] = []
    starts = [0]
    for first in list(following):
        while following[first]:
            at = first
            while following[at]:
                corners.append(at)
                at = following[at].pop()
            starts.append(len(corners))
    return np.array(corners, dtype=np.int64), np.array(starts, dtype=np.int64)


def joint_faces(points: np.ndarray, owner: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(k, 2) indices of the contacts between which the faces of joints are drawn.

    ``points`` (n, 2) m are the contacts of blocks ``owner`` with blocks ``other``. The contacts of each pair of blocks
    are joined in their order along the face. If one block has two corners or more on the face, only these are joined,
    so that a line stays on that block when the face opens.
    """
    if not len(points):
        return np.empty((0, 2), np.int64)
    low, high = np.minimum(owner, other).astype(np.int64), np.maximum(owner, other).astype(np.int64)
    _, pair = np.unique(low << 32 | high, return_inverse=True)
    n = int(pair.max()) + 1
    count = np.bincount(pair, minlength=n)
    arm = points - np.stack([np.bincount(pair, x, n) / count for x in points.T], axis=1)[pair]
    xx, xy, yy = (np.bincount(pair, arm[:, i] * arm[:, j], n) for i, j in ((0, 0), (0, 1), (1, 1)))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)[pair]
    along = arm[:, 0] * np.cos(angle) + arm[:, 1] * np.sin(angle)
    # The block of the pair whose own corners extend farther.
    side = 2 * pair + (owner != low)
    reach = np.full((2, 2 * n), -np.inf)
    np.maximum.at(reach[0], side, along)
    np.maximum.at(reach[1], side, -along)
    extent = (reach[0] + reach[1]).reshape(n, 2)
    size = np.sqrt(np.maximum(xx + yy, 0.0))
    lone = ~(np.nan_to_num(extent, neginf=0.0).max(axis=1) > 1e-9 * np.maximum(size, 1e-300))
    taken = np.flatnonzero(lone[pair] | ((side & 1) == np.argmax(extent, axis=1)[pair]))
    order = taken[np.lexsort((along[taken], pair[taken]))]
    a, b = order[:-1], order[1:]
    apart = along[b] - along[a] > 1e-9 * size[pair[a]]
    return np.stack([a, b], axis=1)[(pair[a] == pair[b]) & apart]
