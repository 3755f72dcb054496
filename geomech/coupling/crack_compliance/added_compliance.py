"""What a block's cracks add to its strain, handed back to the block solver.

The crack strain of a block is made linear in its mean stress, ε_c(σ) = offset + S σ: S from unit-stress solves of its
elastic body (`geomech.ddm.Body.compliance`), the offset from the solve under the actual boundary load, so that the two
agree where they were taken. The block solver then treats S implicitly (an explicit hand-back diverges as soon as the
cracks are softer than the rock, which every nearly split block reaches).
"""

from __future__ import annotations

import math

import numpy as np

#: Negative eigenvalues below this part of the largest are none.
_ROUND_OFF = 1e-12


def stress_rotation(angle: float) -> np.ndarray:
    """Q (3, 3): components of a stress carried along by a rotation of ``angle`` rad, σ' = Q σ."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c * c, s * s, -2 * s * c], [s * s, c * c, 2 * s * c], [s * c, -s * c, c * c - s * s]])


def stress_rotations(angle: np.ndarray) -> np.ndarray:
    """(n, 3, 3) `stress_rotation` of every ``angle`` (n,)."""
    c, s = np.cos(angle), np.sin(angle)
    cc, ss, sc = c * c, s * s, s * c
    out = np.empty((len(c), 3, 3))
    out[:, 0, 0] = out[:, 1, 1] = cc
    out[:, 0, 1] = out[:, 1, 0] = ss
    out[:, 2, 0], out[:, 2, 1], out[:, 2, 2] = sc, -sc, cc - ss
    out[:, 0, 2], out[:, 1, 2] = -2 * sc, 2 * sc
    return out


def strain_rotation(angle: float) -> np.ndarray:
    """The same for strain with engineering shear: Q⁻ᵀ, since σ·ε does not change; Q⁻¹ turns back."""
    return stress_rotation(-angle).T


def passive(compliance: np.ndarray) -> np.ndarray:
    """``compliance`` (3, 3) without what would give energy back: the nearest positive semidefinite one, whatever the
    axes.

    Faces that slide under Coulomb's friction answer a normal stress with slip, but no shear stress with opening; the
    symmetric part of such a response has a negative direction, in which a block, as soft as the rock or softer, would
    have no stiffness. What is left out stays in the offset, and passes find it.
    """
    size = np.array([1.0, 1.0, np.sqrt(0.5)])  # of Mandel's components, in which axes turn without change of length
    values, vectors = np.linalg.eigh(size[:, None] * compliance * size)
    if values[0] >= -_ROUND_OFF * values[-1]:
        return compliance
    kept = vectors / size[:, None]
    return (kept * np.maximum(values, 0.0)) @ kept.T


def crack_response(
    compliance: np.ndarray, crack_strain: np.ndarray, stress: np.ndarray, angle: float
) -> tuple[np.ndarray, np.ndarray]:
    """(S, offset) in current axes from ``compliance`` and ``crack_strain`` in the block's reference axes and the mean
    ``stress`` (current axes) at which the crack strain was found."""
    parts = (np.asarray(part)[None] for part in (compliance, crack_strain, stress, angle))
    s, offset = crack_responses(*parts)
    return s[0], offset[0]


def crack_responses(
    compliance: np.ndarray, crack_strain: np.ndarray, stress: np.ndarray, angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`crack_response` of blocks, (n, 3, 3), (n, 3), (n, 3) and (n,)."""
    back = stress_rotations(-angle)
    turned = back.transpose(0, 2, 1)
    s = turned @ compliance @ back
    return s, times(turned, crack_strain) - times(s, stress)


def times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """(n, 3) every matrix (n, 3, 3) times its vector (n, 3)."""
    return (matrices @ vectors[..., None])[..., 0]
