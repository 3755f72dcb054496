"""Constraints: unknowns fixed at zero, of guided platens, and of the rigid motion of a lone block in equilibrium."""

from __future__ import annotations

import numpy as np

from ...compiled import UNCOUNTED, kept
from .tolerances import NOTABLE


def balanced(load: np.ndarray, points: np.ndarray, edges: np.ndarray, weight: np.ndarray, moments: np.ndarray) -> bool:
    """True if the loads of a lone block are in equilibrium.

    ``load`` (6,) generalised, N and N m; ``points``, ``edges`` POINT_FORCE and EDGE_FORCE rows; ``weight`` (2,) N;
    ``moments`` a row of `block_moments`. Such a block has no support, and under compression by forces of fixed
    direction it is unstable. In statics its rigid motion, which carries no force, is therefore constrained.
    """
    size = sum(float(np.abs(rows["force"]).sum()) for rows in (points, edges))
    # Loads that balance on the undeformed block are out of balance by about its strain on the deformed one, which is less.
    total = np.abs(load[:3] / [1.0, 1.0, np.sqrt(moments[0])])
    return float(np.abs(weight).sum()) <= NOTABLE * size and bool((total <= NOTABLE * size).all())


def with_rigid_motion(constrained: np.ndarray | None) -> np.ndarray:
    """(1, 6) bool: the constrained unknowns ``constrained`` of a lone block, and its rigid motion."""
    out = np.zeros((1, 6), bool) if constrained is None else constrained.copy()
    out[0, :3] = True
    return out


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def hold(constrained, matrix, right, vectors, block, other, order):
    """Constrain the unknowns ``constrained`` (n_blocks, 6) bool to zero, in place: their rows and columns
    become diagonal.

    ``matrix`` (n, 6, 6) and ``right`` (n, 6) as in `assembly`; ``vectors`` (n_contacts, 2, 12) of the contacts between
    ``block`` and ``other``; ``order`` (n_blocks,) the row of each block, −1 if fixed.
    """
    size = 0.0
    for i in range(matrix.shape[0]):
        for k in range(6):
            size = max(size, abs(matrix[i, k, k]))
    for b in range(constrained.shape[0]):
        i = order[b]
        if i < 0:
            continue
        for k in range(6):
            if constrained[b, k]:
                for m in range(6):
                    matrix[i, k, m] = matrix[i, m, k] = 0.0
                matrix[i, k, k] = size
                right[i, k] = 0.0
    for c in range(block.shape[0]):
        for k in range(6):
            if constrained[block[c], k]:
                vectors[c, 0, k] = vectors[c, 1, k] = 0.0
            if constrained[other[c], k]:
                vectors[c, 0, 6 + k] = vectors[c, 1, 6 + k] = 0.0
