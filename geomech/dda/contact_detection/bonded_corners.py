"""Corner contacts made redundant by bonds: opposite corners at a point where bonded blocks meet.

At a point where more than three blocks meet, opposite ones touch only with their corners. While both are bonded to the
blocks between them, such a pair can part or close only by the bonds' deformation. An unbonded contact of its own would
open, close and slide under forces of round-off, and for tan φ > 1 often has no consistent state.
"""

from __future__ import annotations

import numpy as np

from ..kinematics.tolerances import NOTABLE, NOTHING


def find_bonded_corners(
    vertex: np.ndarray, edge: np.ndarray, after: np.ndarray, position: np.ndarray, share: np.ndarray, bonded: np.ndarray
) -> np.ndarray | None:
    """(n,) bool: contacts of two lone corners that bonds around the point hold together; None without any.

    ``vertex``, ``edge`` (n,) as in CONTACT; ``after`` (n_vertices,) the next vertex of each; ``position`` (n,) along
    the edge; ``share`` (n,) tributary length over the edge's; ``bonded`` (n,) bool.
    """
    face = share > NOTHING
    glue = np.flatnonzero(bonded & face)
    lone = np.flatnonzero(~face)
    if not (len(glue) and len(lone)):
        return None
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(after)
    # Vertices at one point that bonds join; a vertex bonded to the interior of an edge is joined to the edge
    # itself.
    end = np.where(position < NOTABLE, edge, np.where(position > 1 - NOTABLE, after[edge], n + edge))
    links = coo_array((np.ones(len(glue)), (vertex[glue], end[glue])), shape=(2 * n, 2 * n))
    _, label = connected_components(links, directed=False)
    out = np.zeros(len(vertex), bool)
    out[lone] = label[vertex[lone]] == label[end[lone]]
    return out if out.any() else None
