"""A straight central crack in a plate or disc, by complex series and boundary collocation: an independent method.

With the crack on |x| < a, y = 0 free of traction, Muskhelishvili's Φ and Ω are (Isida 1971; Newman 1971)

    Φ = F/√(z²−a²) + G,   Ω = F/√(z²−a²) − G,

F and G analytic. For loads that are invariant under a rotation by 180°, F is odd and G even: z and 1 times polynomials
of z², orthogonal on the outline (Brubeck, Nakatsukasa & Trefethen 2021) and fitted to the tractions there by least
squares. The crack faces are free of traction for any coefficients. The error decreases exponentially with the number of
terms, the faster the farther the tips are from the outline. K_I − i K_II = 2√π F(a)/√a.
"""

from __future__ import annotations

import numpy as np


def centre_crack(
    half_length: float, half_width: float, half_height: float, angle: float = 0.0, terms: int = 50
) -> tuple[float, float]:
    """K_I, K_II of a crack 2·``half_length`` at ``angle`` (rad) from x in the centre of a plate with unit tractions
    along y on its two ends; ``terms``: number of terms of each series."""
    w, h = half_width, half_height
    n = 10 * terms
    # Points are concentrated at the corners, where the series converge worst; a rotation by 180° gives the other half
    # of the outline.
    s = np.cos((np.arange(n) + 0.5) * np.pi / n)
    turn = np.exp(-1j * angle)
    z = np.concatenate([s * w + 1j * h, w + 1j * h * s]) * turn
    along = np.repeat([turn, 1j * turn], n)
    weight = np.repeat(np.sqrt([w, h]), n) * np.tile((1 - s**2) ** 0.25, 2)
    return _fitted(half_length, z, along, weight, np.repeat([1.0, 0.0], n), terms)


def crack_in_disc(half_length: float, power: int, shear: bool = False, terms: int = 24) -> float:
    """K_I (K_II with ``shear``) of a crack 2·``half_length`` in the centre of a traction-free disc of radius 1, whose
    faces carry a traction x^``power``, even, that opens (shears) it.

    After subtraction of a field with that traction on the whole x-axis (Φ = 0, Ψ = z^power), the faces are free and the
    outline carries the traction of that field.
    """
    angle = (np.arange(10 * terms) + 0.5) * np.pi / (10 * terms)
    z = np.exp(1j * angle)
    right = (1j * z) ** 2 * (1j if shear else 1.0) * z**power
    return _fitted(half_length, z, 1j * z, np.ones(len(z)), right, terms)[int(shear)]


def _fitted(a: float, z, along, weight, right, terms: int) -> tuple[float, float]:
    """K_I, K_II from ``right`` (n,), normal plus i times minus shear traction, at points ``z`` of half the outline,
    which runs ``along``; each point has its ``weight``."""
    root = np.sqrt(z - a) * np.sqrt(z + a)
    columns, tip = [], []
    for p, dp, p_tip in _orthogonal(z, a, terms):
        # d/dz of p(z²) is 2 z p'.
        parts = (z * p / root, (p + 2 * z**2 * dp) / root - z**2 * p / root**3, 1), (p, 2 * z * dp, -1)
        for phi, d_phi, sign in parts:
            for c in (1.0, 1j):
                rest = (np.conj(z) - z) * c * d_phi + (sign * np.conj(c) - c) * phi
                columns.append(weight * (2 * (c * phi).real + along**2 * rest))
                tip.append(c * a * p_tip if sign > 0 else 0.0)
    # A constant imaginary G is a rotation of the plate without stress.
    del columns[3], tip[3]
    matrix, right = np.array(columns).T, weight * right
    both = np.concatenate([matrix.real, matrix.imag])
    coefficients = np.linalg.lstsq(both, np.concatenate([right.real, right.imag]), rcond=1e-14)[0]
    k = 2 * np.sqrt(np.pi / a) * (np.array(tip) @ coefficients)
    return float(k.real), float(-k.imag)


def _orthogonal(z: np.ndarray, a: float, terms: int):
    """Real polynomials p(z²), orthogonal on ``z`` and its mirror image: p and dp/d(z²) at ``z``, p at ``a``."""
    u, size = z**2, np.sqrt(len(z))
    known = [(np.ones(len(z), complex), np.zeros(len(z), complex), 1.0)]
    for _ in range(terms):
        p, dp, p_tip = known[-1]
        yield p, dp, p_tip
        new, d_new, new_tip = u * p, p + u * dp, a**2 * p_tip
        for q, dq, q_tip in [*known, *known]:
            h = np.vdot(q, new).real / size**2
            new, d_new, new_tip = new - h * q, d_new - h * dq, new_tip - h * q_tip
        h = np.linalg.norm(new) / size
        known.append((new / h, d_new / h, new_tip / h))
