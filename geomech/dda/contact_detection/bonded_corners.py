"""Corners that a glued point holds: where blocks are bonded all around, opposite corners have nothing to press against.

At a point where more than three blocks meet, opposite ones touch with their corners alone. While both are glued to what
lies between them, such a pair cannot part or close but by what the bonds give; a contact of its own, without glue, only
opens, closes and slides under forces of round-off, and on rough joints (tan φ > 1) often has no consistent state at
all.
"""

from __future__ import annotations

import numpy as np

#: A vertex this part of an edge from its end is at the end: bonds give by some thousandths at most.
_AT_END = 0.01
#: Tributary lengths below this part of the edge are round-off: no face.
_LEAST_FACE = 1e-6


def held_by_glue(
    vertex: np.ndarray, edge: np.ndarray, after: np.ndarray, position: np.ndarray, share: np.ndarray, bonded: np.ndarray
) -> np.ndarray | None:
    """(n,) True for contacts of a lone corner with another that bonds hold to it around the point; None without any.

    ``vertex``, ``edge`` (n,) as in CONTACT; ``after`` (n_vertices,) the next vertex of each; ``position`` (n,) along
    the edge; ``share`` (n,) tributary length over the edge's; ``bonded`` (n,) bool.
    """
    face = share > _LEAST_FACE
    glue = np.flatnonzero(bonded & face)
    lone = np.flatnonzero(~face)
    if not (len(glue) and len(lone)):
        return None
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(after)
    # Vertices at one point that bonds join; a vertex that is glued to the middle of an edge is joined to the edge
    # itself.
    end = np.where(position < _AT_END, edge, np.where(position > 1 - _AT_END, after[edge], n + edge))
    links = coo_array((np.ones(len(glue)), (vertex[glue], end[glue])), shape=(2 * n, 2 * n))
    _, label = connected_components(links, directed=False)
    out = np.zeros(len(vertex), bool)
    out[lone] = label[vertex[lone]] == label[end[lone]]
    return out if out.any() else None
