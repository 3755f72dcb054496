"""Displacement matrix T of a first-order block: u(x) = T(x − x₀) (u0, v0, r0, εx, εy, γxy) (Shi 1988)."""

from __future__ import annotations

import numpy as np


def displacement_matrix(points: np.ndarray, centroid: np.ndarray) -> np.ndarray:
    """T (..., 2, 6) with u(x) = T (u0, v0, r0, εx, εy, γxy), for ``points`` (..., 2) about ``centroid`` (..., 2).

    Shi (1988), eq. 2.6: the six unknowns are the centroid's displacement, the rotation and the strains.
    """
    arm = np.asarray(points, dtype=float) - centroid
    x, y = arm[..., 0], arm[..., 1]
    t = np.zeros((*x.shape, 2, 6))
    t[..., 0, 0] = t[..., 1, 1] = 1.0
    t[..., 0, 2], t[..., 1, 2] = -y, x
    t[..., 0, 3], t[..., 1, 4] = x, y
    t[..., 0, 5], t[..., 1, 5] = y / 2, x / 2
    return t


def material_weights(loop_vertices: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(n,) weights w with Σ wᵢ = 1 and Σ wᵢ xᵢ = ``point``, for the vertices xᵢ (n, 2) of a block.

    The weighted vertices follow the block's affine motion exactly. The weights have least norm, so that round-off of
    single vertices is averaged, not amplified.
    """
    origin = loop_vertices.mean(axis=0)
    size = np.ptp(loop_vertices, axis=0).max()
    system = np.vstack([np.ones(len(loop_vertices)), ((loop_vertices - origin) / size).T])
    return np.linalg.lstsq(system, np.array([1.0, *((point - origin) / size)]), rcond=None)[0]
