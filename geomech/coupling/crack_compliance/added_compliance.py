"""Crack compliance of a block: the strain that crack opening and slip add to it, as DDA uses it.

The crack strain is linearised in the mean stress, ε_c(σ) = offset + S σ. S comes from solutions under unit stresses
(`geomech.ddm.Body.compliance`), the offset from the solution under the actual load, so that the two agree there. DDA
treats S implicitly: handing ε_c back explicitly diverges as soon as the cracks are softer than the rock, which happens
in every block before it is divided.
"""

from __future__ import annotations

import math

import numpy as np

#: Negative eigenvalues smaller than this fraction of the largest count as zero.
_ROUND_OFF = 1e-12


def stress_rotation(angle: float, width: int = 3) -> np.ndarray:
    """Q (width, width): components of a stress carried along by a rotation of ``angle`` rad, σ' = Q σ. Those after the
    first three are of deflection, in the frame that rotates along, and stay."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c * c, s * s, -2 * s * c], [s * s, c * c, 2 * s * c], [s * c, -s * c, c * c - s * s]])
    return turn if width == 3 else _widened(turn[None], width)[0]


def _widened(turns: np.ndarray, width: int) -> np.ndarray:
    """(n, width, width) of the rotations ``turns`` (n, 3, 3)."""
    out = np.tile(np.eye(width), (len(turns), 1, 1))
    out[:, :3, :3] = turns
    return out


def stress_rotations(angle: np.ndarray, width: int = 3) -> np.ndarray:
    """(n, width, width) `stress_rotation` of every ``angle`` (n,)."""
    c, s = np.cos(angle), np.sin(angle)
    cc, ss, sc = c * c, s * s, s * c
    out = np.empty((len(c), 3, 3))
    out[:, 0, 0] = out[:, 1, 1] = cc
    out[:, 0, 1] = out[:, 1, 0] = ss
    out[:, 2, 0], out[:, 2, 1], out[:, 2, 2] = sc, -sc, cc - ss
    out[:, 0, 2], out[:, 1, 2] = -2 * sc, 2 * sc
    return out if width == 3 else _widened(out, width)


def strain_rotation(angle: float) -> np.ndarray:
    """The same for strain with engineering shear: Q⁻ᵀ, since σ·ε is invariant; Q⁻¹ rotates back."""
    return stress_rotation(-angle).T


def passive(compliance: np.ndarray, elastic: np.ndarray | None = None) -> np.ndarray:
    """The nearest positive semidefinite ``compliance`` (3, 3), independent of the axes; one of more components, which
    differ in kind, is measured by the ``elastic`` compliance of the rock, of the same shape.

    Faces that slide with Coulomb friction respond to normal stress with slip, but not to shear stress with opening. The
    symmetric part of that response has a negative eigenvalue, along which a block as soft as its rock, or softer, would
    have no stiffness. The part removed stays in the offset, and the iteration finds it.
    """
    if len(compliance) > 3 and elastic is not None:
        root = np.linalg.cholesky(elastic)
        back = np.linalg.inv(root)
        values, vectors = np.linalg.eigh(back @ compliance @ back.T)
        if values[0] >= -_ROUND_OFF * values[-1]:
            return compliance
        kept = root @ vectors
        return (kept * np.maximum(values, 0.0)) @ kept.T
    size = np.array([1.0, 1.0, np.sqrt(0.5)])  # Mandel components, whose length does not depend on the axes
    values, vectors = np.linalg.eigh(size[:, None] * compliance * size)
    if values[0] >= -_ROUND_OFF * values[-1]:
        return compliance
    kept = vectors / size[:, None]
    return (kept * np.maximum(values, 0.0)) @ kept.T


def crack_response(
    compliance: np.ndarray, crack_strain: np.ndarray, stress: np.ndarray, angle: float
) -> tuple[np.ndarray, np.ndarray]:
    """(S, offset) in current axes, from ``compliance`` and ``crack_strain`` in the block's reference axes and the mean
    ``stress`` (current axes) at which that strain was found."""
    parts = (np.asarray(part)[None] for part in (compliance, crack_strain, stress, angle))
    s, offset = crack_responses(*parts)
    return s[0], offset[0]


def crack_responses(
    compliance: np.ndarray, crack_strain: np.ndarray, stress: np.ndarray, angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`crack_response` of blocks, (n, w, w), (n, w), (n, w) and (n,), w ≥ 3."""
    back = stress_rotations(-angle, crack_strain.shape[1])
    turned = back.transpose(0, 2, 1)
    s = turned @ compliance @ back
    return s, times(turned, crack_strain) - times(s, stress)


def times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """(n, 3) product of every matrix (n, 3, 3) with its vector (n, 3)."""
    return (matrices @ vectors[..., None])[..., 0]
