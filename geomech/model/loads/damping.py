"""Rayleigh damping α M + β K from fractions of critical damping at two frequencies."""

from __future__ import annotations

import numpy as np


def rayleigh_coefficients(fractions: tuple[float, float], frequencies: tuple[float, float]) -> tuple[float, float]:
    """(α 1/s, β s) of the damping α M + β K that has ``fractions`` ξ of critical at two ``frequencies`` (Hz):
    ξ = ½ (α/ω + β ω) (Rayleigh 1877; Clough & Penzien 1975, eq. 13-13). Raises ValueError if no α, β ≥ 0 do."""
    (x, y), (p, q) = fractions, 2 * np.pi * np.asarray(frequencies, dtype=float)
    if not (p > 0 and q > 0 and p != q and x >= 0 and y >= 0):
        raise ValueError(f"Rayleigh damping needs two frequencies and fractions, got {frequencies!r} Hz, {fractions!r}")
    alpha, beta = 2 * p * q * (q * x - p * y) / (q * q - p * p), 2 * (q * y - p * x) / (q * q - p * p)
    if min(alpha, beta) < -1e-12 * max(alpha * q, beta / q, 1e-300):
        raise ValueError(
            f"fractions {x:g} and {y:g} of critical damping at {frequencies[0]:g} and {frequencies[1]:g} Hz need a "
            "negative coefficient, which would drive the blocks; bring the fractions closer together"
        )
    return max(float(alpha), 0.0), max(float(beta), 0.0)
