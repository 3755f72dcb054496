"""Stress intensity factors and related closed forms of linear elastic fracture mechanics.

Signs follow `geomech.conventions`. Lengths in m, stresses in Pa, stress intensity factors in Pa √m. Entries marked
"computed" were computed independently with elements of order 8 and are converged to the digits given.
"""

from __future__ import annotations

import math

import numpy as np

#: Edge crack of depth a in a long strip of width W in tension: a/W → K_I / (σ√(πa)) (Kaya & Erdogan 1987, Table 1).
EDGE_CRACK = {0.1: 1.1892, 0.2: 1.3673, 0.3: 1.6599, 0.4: 2.1114, 0.5: 2.8246, 0.6: 4.0332, 0.7: 6.3549, 0.8: 11.955}

#: Centre crack 2a = W in a plate 2W × 2H in tension, a/W = 0.5: H/W → K_I / (σ√(πa)) (computed).
CENTRE_CRACK_HALF = {3.0: 1.186671, 1.0: 1.33371}

#: Star of three equal arms of length 1 under uniform pressure 1: K_I/√π at every tip (computed).
THREE_ARMED_STAR = 0.941499


def griffith(stress: float, half_length: float) -> float:
    """K_I = σ√(πa) of a crack 2a across a tension σ (Griffith 1921; Irwin 1957)."""
    return stress * math.sqrt(math.pi * half_length)


def griffith_opening(stress: float, half_length: float, x: np.ndarray, plane_modulus: float) -> np.ndarray:
    """Opening 4σ√(a²−x²)/E' of the same crack."""
    return 4 * stress / plane_modulus * np.sqrt(np.maximum(half_length**2 - np.asarray(x) ** 2, 0.0))


def slanted(stress: np.ndarray, angle: float, half_length: float) -> tuple[float, float]:
    """K_I, K_II of an open crack 2a at ``angle`` from x in a uniform ``stress`` (xx, yy, xy): (σ_n, τ)√(πa)."""
    xx, yy, xy = stress
    c, s = math.cos(angle), math.sin(angle)
    normal = xx * s * s + yy * c * c - 2 * xy * s * c
    shear = (yy - xx) * s * c + xy * (c * c - s * s)
    root = math.sqrt(math.pi * half_length)
    return normal * root, shear * root


def closed(
    stress: np.ndarray, angle: float, half_length: float, friction: float = 0.0, cohesion: float = 0.0
) -> tuple[float, float]:
    """K_I, K_II of a crack that ``stress`` closes: 0 and sign(τ) max(0, |τ| − μ|σ_n| − c)√(πa). ValueError if open."""
    k_n, k_s = slanted(stress, angle, half_length)
    if k_n > 0:
        raise ValueError("the stress opens the crack")
    root = math.sqrt(math.pi * half_length)
    return 0.0, math.copysign(max(0.0, abs(k_s) + friction * k_n - cohesion * root), k_s)


def collinear_pair(stress: float, inner: float, outer: float) -> tuple[float, float]:
    """K_I at the inner and outer tips of two equal collinear cracks, inner < |x| < outer (Willmore 1949; Erdogan
    1962)."""
    from scipy.special import ellipe, ellipkm1

    b, c = inner, outer
    # Computed from 1 − k², which is accurate when the inner tips nearly meet.
    rest = (b / c) ** 2
    lam = float(ellipe(1 - rest) / ellipkm1(rest))
    root = stress * math.sqrt(math.pi)
    k_inner = root * (c**2 * lam - b**2) / math.sqrt(b * (c**2 - b**2))
    return k_inner, root * c**2 * (1 - lam) / math.sqrt(c * (c**2 - b**2))


def circular_arc(stress: float, radius: float, half_angle: float) -> tuple[float, float]:
    """|K_I|, |K_II| of an arc crack in equal biaxial tension (Sih, Paris & Erdogan 1962)."""
    sine = math.sin(half_angle / 2)
    f = stress * math.sqrt(math.pi * radius * math.sin(half_angle)) / (1 + sine * sine)
    return f * math.cos(half_angle / 2), f * sine


def dilute_compliance(half_length: float, area: float, plane_modulus: float) -> np.ndarray:
    """(3, 3) added compliance of one small open crack along x in a large ``area``: 2πa²/(E'A) for the normal stress
    across it and for the shear (Walsh 1965; from the opening of the Griffith crack)."""
    value = 2 * math.pi * half_length**2 / (plane_modulus * area)
    return np.diag([0.0, value, value])


def crack_in_bending(gradient: float, half_length: float) -> tuple[float, float]:
    """Closure point and K_I of a frictionless crack |x| < a under the normal stress σ = gradient · x, gradient > 0.

    The compressed side is closed up to x = −a/3, where K_I of the open part [−a/3, a] vanishes: with half-length l =
    2a/3 and midpoint m = a/3 the two tips have s(m ∓ l/2)√(πl), so K_I = s l √(πl) at x = a.
    """
    open_half = 2 * half_length / 3
    return -half_length / 3, gradient * open_half * math.sqrt(math.pi * open_half)


def spinning_disc_centre(density: float, rate: float, radius: float, poissons_ratio: float) -> float:
    """σ_rr = σ_θθ at the centre of a spinning cylinder in plane strain, ρω²R²(3−2ν)/(8(1−ν)) (Timoshenko & Goodier
    1951)."""
    return density * rate**2 * radius**2 * (3 - 2 * poissons_ratio) / (8 * (1 - poissons_ratio))
