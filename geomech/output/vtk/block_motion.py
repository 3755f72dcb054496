"""Motion of points fixed to blocks: displacement, rotated directions, velocity."""

from __future__ import annotations

import numpy as np

from geomech.model import Blocks, State
from geomech.model.blocks.block_motion import Motion


def displacement(motion: Motion, block: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 2) m: displacement of reference ``points`` (n, 2), point i moving with ``block[i]``."""
    # F − 1 is formed before it is multiplied by coordinates, so that displacements of a millionth of the block keep
    # their digits.
    stretch = motion.gradient - np.eye(2)
    x, y = (points - motion.reference_centre[block]).T
    out = (motion.centre - motion.reference_centre)[block]
    for k in (0, 1):
        out[:, k] += stretch[:, k, 0][block] * x + stretch[:, k, 1][block] * y
    return out


def carried(motion: Motion, block: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n, 2): unit ``directions`` drawn on the reference blocks, deformed with them and normalised."""
    turned = np.einsum("nij,nj->ni", motion.gradient[block], directions)
    return turned / np.maximum(np.hypot(turned[:, 0], turned[:, 1]), np.finfo(float).tiny)[:, None]


def rotation(gradient: np.ndarray) -> np.ndarray:
    """(...,) rad: the angle of R in the polar decomposition F = R U of ``gradient`` (..., 2, 2)."""
    return np.arctan2(
        gradient[..., 1, 0] - gradient[..., 0, 1],
        gradient[..., 0, 0] + gradient[..., 1, 1],
    )


def vertex_velocity(blocks: Blocks, state: State) -> np.ndarray:
    """(n_vertices, 2) m/s: Shi's (1988) first-order displacement function of each block's six rates about its current
    centroid."""
    x, y = (state.vertices - centroids(blocks, state.vertices)[blocks.vertex_block]).T
    u0, v0, r0, ex, ey, gxy = state.velocity[blocks.vertex_block].T
    return np.stack([u0 - y * r0 + x * ex + 0.5 * y * gxy, v0 + x * r0 + y * ey + 0.5 * x * gxy], axis=-1)


def centroids(blocks: Blocks, vertices: np.ndarray) -> np.ndarray:
    """(n_blocks, 2) m: centroids of the polygons without their holes."""
    # Relative to each block's first vertex: the closed sums would lose digits far from the origin.
    origin = vertices[blocks.vertex_start[:-1]]
    own = vertices - origin[blocks.vertex_block]
    ahead = own[blocks.next_vertex]
    cross = own[:, 0] * ahead[:, 1] - own[:, 1] * ahead[:, 0]

    def total(weights: np.ndarray) -> np.ndarray:
        return np.bincount(blocks.vertex_block, weights=weights, minlength=blocks.n_blocks)

    first = np.stack([total(cross * (own[:, k] + ahead[:, k])) for k in range(2)], axis=-1)
    return origin + first / (3 * total(cross))[:, None]
