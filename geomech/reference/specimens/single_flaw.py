"""Specimen with one flaw (Wong et al. 2002), and closed forms for wing cracks.

Wong, Tang, Chau & Tsang (2002), "Splitting failure in brittle rocks containing pre-existing flaws under uniaxial
compression", Engineering Fracture Mechanics 69, 1853-1871: a plate of 50 × 170 mm with a centre flaw of half-length
10 mm at 30° from the horizontal. Lengths m, stresses Pa (compression σ counted positive here), factors Pa √m.
"""

from __future__ import annotations

import math

import numpy as np

WIDTH, HEIGHT, HALF_LENGTH, ANGLE_DEG = 0.050, 0.170, 0.010, 30.0
YOUNGS_MODULUS, POISSONS_RATIO, UNIAXIAL_STRENGTH, K_IC = 50e9, 0.25, 200e6, 1.2e6

#: (|K_I|, |K_II|)/σ, √m, of the open slot before growth in this plate under uniform end stress, and the kink angle of
#: the maximum tangential stress that goes with them, degrees; computed with elements of order 8, converged to these
#: digits.
OPEN_SLOT = (0.149807, 0.079556)
KINK_DEG = 105.72

#: A wing from the flaw's right end, m (the left one is its image), and K/σ at its tip, √m, open faces, this plate: from
#: the energy released between lengths ± 0.5 mm (computed with finite elements, quadratic triangles of 0.04 mm at the
#: corners and tips; 0.3 % between that and 0.1 mm). K_II is below 3 % of K_I there, so this is K_I.
WING = ((7.2e-3, 6.3e-3), (4.4e-3, 9.1e-3), (1.9e-3, 14.5e-3), (0.9e-3, 20.5e-3), (0.5e-3, 26.5e-3))
WING_FACTOR = 0.03371


def open_slot_in_plane(half_length: float = HALF_LENGTH, angle_deg: float = ANGLE_DEG) -> tuple[float, float]:
    """(|K_I|, |K_II|)/σ of an open slot at ``angle_deg`` to the horizontal in an infinite plane under vertical
    compression: cos²β √(πa) and sin β cos β √(πa). K_I is negative, since the faces approach each other."""
    b = math.radians(angle_deg)
    root = math.sqrt(math.pi * half_length)
    return math.cos(b) ** 2 * root, math.sin(b) * math.cos(b) * root


def secant_correction(half_length: float = HALF_LENGTH, angle_deg: float = ANGLE_DEG, width: float = WIDTH) -> float:
    """√sec(πc/W) with c = a cos β the projection of the flaw's half-length normal to the load (Feddersen 1966; within 1
    % for a crack normal to the load with 2c < 0.8 W). For an inclined flaw an approximation only."""
    c = half_length * math.cos(math.radians(angle_deg))
    return math.sqrt(1 / math.cos(math.pi * c / width))


def wing_horii_nemat_nasser(
    wing: np.ndarray, half_length: float = HALF_LENGTH, angle_deg: float = ANGLE_DEG, friction: float = 0.0
) -> np.ndarray:
    """K_I/σ of straight wings of length ``wing`` m, parallel to the load, from a **closed** flaw in an infinite plane.

    Horii & Nemat-Nasser (1986), Phil. Trans. R. Soc. A 319, 337-374, for uniaxial compression without cohesion: K_I =
    2a τ* sin θ/√(π(l + l*)), τ* = σ cos β (sin β − μ cos β), l* = 0.27 a. The wing is at θ = 90° − β to the flaw, so
    that sin θ = cos β, and the load causes no pressure on its faces.
    """
    b = math.radians(angle_deg)
    driving = max(0.0, math.cos(b) * (math.sin(b) - friction * math.cos(b)))
    return 2 * half_length * driving * math.cos(b) / np.sqrt(math.pi * (np.asarray(wing) + 0.27 * half_length))


def wing_ashby_hallam(wing: np.ndarray, half_length: float = HALF_LENGTH, friction: float = 0.0) -> np.ndarray:
    """K_I/σ of the same from the most dangerous closed flaw (45° when there is no friction).

    Ashby & Hallam (1986), Acta Metallurgica 34, 497-510, for uniaxial compression, L = l/a:
    K_I = σ√(πa) (1 − μ)/(1 + L)^(3/2) · [0.23 L + 1/√(3(1 + L))].
    """
    ratio = np.asarray(wing) / half_length
    root = math.sqrt(math.pi * half_length)
    return root * (1 - friction) / (1 + ratio) ** 1.5 * (0.23 * ratio + 1 / np.sqrt(3 * (1 + ratio)))


def tangent_modulus() -> float:
    """Axial stress over axial strain before growth: plane strain modulus E' reduced by the open slot as for a small
    crack, E'/(1 + 2πa² cos²β/A) (Walsh 1965). The free sides reduce it slightly more."""
    plane = YOUNGS_MODULUS / (1 - POISSONS_RATIO**2)
    slot = 2 * math.pi * (HALF_LENGTH * math.cos(math.radians(ANGLE_DEG))) ** 2 / (WIDTH * HEIGHT)
    return plane / (1 + slot)
