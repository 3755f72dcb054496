"""Speed of Rayleigh waves, the limit speed of a mode I crack (Rayleigh 1885; Freund 1990, ch. 7)."""

from __future__ import annotations

import numpy as np


def rayleigh_ratio(poissons_ratio: float) -> float:
    """c_R/c_s by Rayleigh's (1885) equation for ξ = (c_R/c_s)², ξ³ − 8ξ² + (24 − 16η)ξ − 16(1 − η) = 0 with
    η = (c_s/c_p)² = (1 − 2ν)/(2 − 2ν): its one root from 0 to 1. Plane strain; in plane stress ν/(1 + ν) stands for
    ν."""
    eta = (1 - 2 * poissons_ratio) / (2 - 2 * poissons_ratio)
    roots = np.roots([1.0, -8.0, 24.0 - 16.0 * eta, -16.0 * (1.0 - eta)])
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(np.sqrt(real[(real > 0) & (real < 1)].min()))
