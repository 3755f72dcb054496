"""Slip and opening at crack nodes: which can close, and the mean strain that they cause; displacement between the nodes of
a boundary."""

from __future__ import annotations

import numpy as np

from ...model import Cracks
from ..kernels import shape_functions
from .influence_matrix import ElementSet


def closing(faces: ElementSet, cracks: Cracks, twice_modulus: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Three arrays (n_unknowns,): aperture (times ``twice_modulus``, 2μ; zero for slip), whether an unknown can close,
    and its value when closed."""
    aperture = np.zeros((faces.n, 2, faces.per))
    aperture[:, 1] = twice_modulus * cracks.aperture[faces.source, None]
    can_close = np.zeros(aperture.shape, bool)
    can_close[:, 1] = np.isfinite(aperture[:, 1])
    aperture[~can_close] = 0.0
    return aperture.ravel(), can_close.ravel(), -aperture.ravel()


def strain_weights(faces: ElementSet) -> np.ndarray:
    """(3, n_unknowns) weights of nodal slip and opening in the strain of the cracks, integrated over the body (xx, yy,
    xy; engineering shear)."""
    t, n = faces.tangent, faces.normal
    out = np.empty((3, faces.n, 2, faces.per))
    for component, axis in enumerate((t, n)):
        jump = np.stack([n[:, 0] * axis[:, 0], n[:, 1] * axis[:, 1], n[:, 0] * axis[:, 1] + n[:, 1] * axis[:, 0]])
        out[:, :, component] = jump[:, :, None] * faces.quadrature
    return out.reshape(3, -1)


def on_boundary(boundary: ElementSet, values: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 2, k) vectors, x and y, at ``points`` (n, 2) m on the elements of a ``boundary``, of nodal ``values``
    (n_unknowns, k) along and across the elements."""
    start, way = boundary.start, boundary.end - boundary.start
    arm = points[:, None] - start
    share = np.clip(np.einsum("nec,ec->ne", arm, way) / np.einsum("ec,ec->e", way, way), 0.0, 1.0)
    apart = arm - share[..., None] * way
    nearest = np.einsum("nec,nec->ne", apart, apart).argmin(axis=1)
    t = 2.0 * share[np.arange(len(points)), nearest] - 1.0
    to_monomials = shape_functions.to_monomials(boundary.family, boundary.order, shape_functions.ORDINARY)
    shapes = np.vander(t, boundary.per, increasing=True) @ to_monomials
    nodal = values.reshape(boundary.n, 2, boundary.per, -1)[nearest]
    along, across = np.einsum("nj,nwjk->wnk", shapes, nodal, optimize=True)
    tangent, normal = boundary.tangent[nearest], boundary.normal[nearest]
    return tangent[:, :, None] * along[:, None] + normal[:, :, None] * across[:, None]
