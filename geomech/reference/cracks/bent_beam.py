"""Three-point bending of a beam with an edge crack, by complex series and boundary collocation: an independent method.

The three point loads are Flamant's (1892) solutions, each in its own half-plane, whose surface is the side on which the
load acts and is free of traction. Their tractions on the other sides, and on the crack, are cancelled by

    Φ = P/√z + Q + q/2,   Ω = P/√z − Q + q/2

with the tip at z = 0, the crack along z < 0 and q(x) the polynomial that is minus the traction of the loads there (its
Taylor series about the lower side): the crack faces are free for any P and Q. P and Q, polynomials with real
coefficients that are orthogonal on the outline (Brubeck, Nakatsukasa & Trefethen 2021), are fitted to the remaining
tractions by least squares. K_I = 2√(2π) P(0).
"""

from __future__ import annotations

import numpy as np

#: Number of terms of q.
_ACROSS = 16


def three_point_bending(ratio: float, terms: int = 60, half_span: float = 2.0, half_length: float = 2.2) -> float:
    """K_I √W/P of a beam of depth W = 1 and half-length ``half_length`` on supports at ±``half_span``, under a force P
    at midspan above a crack of length ``ratio``; ``terms``: number of terms of each series."""
    a = ratio
    # Half of the outline, x upwards from the tip and y across; points are concentrated at the ends of the sides.
    s = 0.5 * (1 - np.cos((np.arange(8 * terms) + 0.5) * np.pi / (8 * terms)))
    z = np.concatenate([-a + 1j * half_length * s, -a + s + 1j * half_length, 1 - a + 1j * half_length * s])
    along = np.repeat([1j, 1.0, 1j], len(s))
    weight = np.tile((s * (1 - s)) ** 0.25, 3) * np.repeat(np.sqrt([half_length, 1.0, half_length]), len(s))
    loads = [(1 - a, -1.0), (-a + 1j * half_span, 0.5), (-a - 1j * half_span, 0.5)]

    def of_loads(z: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Normal plus i times shear traction on lines ``along`` through ``z``; forces act along x."""
        total = np.zeros(len(z), complex)
        for at, force in loads:
            rel = z - at
            distance = np.abs(rel)
            radial = -2 * force * rel.real / (np.pi * distance**2)
            seen = rel / distance / along
            total += radial * seen.imag * (seen.imag + 1j * seen.real)
        return total

    # The supports' normal traction across the middle, at height y, is minus 2 h² y/(h² + y²)²/π.
    k = np.arange(_ACROSS)
    series = np.zeros(2 * _ACROSS)
    series[1::2] = (k + 1) * (-1.0) ** k * 2 / (np.pi * half_span ** (2 * k + 2))
    across = np.polynomial.Polynomial(series)
    slope = across.deriv()

    def of_pair(phi: np.ndarray, d_phi: np.ndarray, sign: float) -> np.ndarray:
        """The same for Φ = ``phi``, Ω = ``sign`` Φ."""
        return 2 * phi.real + along**2 * ((np.conj(z) - z) * d_phi + (sign - 1) * phi)

    right = -of_loads(z, along) - of_pair(0.5 * across(z + a), 0.5 * slope(z + a), 1)
    root = np.sqrt(z)
    columns, tip = [], []
    for p, d_p, at_tip in _orthogonal(z, terms):
        columns += [of_pair(p / root, d_p / root - 0.5 * p / root**3, 1), of_pair(p, d_p, -1)]
        tip += [at_tip, 0.0]
    matrix = weight[:, None] * np.array(columns).T
    both = np.concatenate([matrix.real, matrix.imag])
    right = weight * right
    coefficients = np.linalg.lstsq(both, np.concatenate([right.real, right.imag]), rcond=1e-14)[0]
    return float(2 * np.sqrt(2 * np.pi) * (np.array(tip) @ coefficients))


def _orthogonal(z: np.ndarray, terms: int):
    """Real polynomials, orthogonal on ``z`` and its mirror image: p and dp/dz at ``z``, and p(0)."""
    size = np.sqrt(len(z))
    known = [(np.ones(len(z), complex), np.zeros(len(z), complex), 1.0)]
    for _ in range(terms):
        p, d_p, at_tip = known[-1]
        yield p, d_p, at_tip
        new, d_new, new_tip = z * p, p + z * d_p, 0.0
        for q, d_q, q_tip in [*known, *known]:
            h = np.vdot(q, new).real / size**2
            new, d_new, new_tip = new - h * q, d_new - h * d_q, new_tip - h * q_tip
        h = np.linalg.norm(new) / size
        known.append((new / h, d_new / h, new_tip / h))
