"""Radial cracks from the wall of a circular hole in an infinite plane."""

from __future__ import annotations

import numpy as np

from ..openings.holes import kirsch_stress
from .dislocations import Arm, stress_intensity

#: a, b, c of the fit a + b/(c + L/R) to Bowie's (1956) K_I/(σ√(πL)) of one radial crack of length L from a hole of
#: radius R, and of two, pulled across (Grandt 1975, Int. J. Fracture 11, 283–294; constants read from a public
#: implementation).
BOWIE_FIT = {1: (0.6762, 0.8733, 0.3245), 2: (0.9439, 0.6865, 0.2772)}

#: The same for one crack as a polynomial in L/(L + R), constant term first (NASGRO reference manual, appendix C, the
#: first factor of crack case TC23; read from a public implementation, which says that it is for two: with two it is up
#: to 26 % low).
NASGRO_FIT = (3.364500, -7.209304, 8.230965, -3.500286, -2.923363, 4.306705, -1.562110)


def bowie(ratio: float, cracks: int) -> float:
    """K_I/(σ√(πL)) at ``ratio`` = L/R by `BOWIE_FIT`. Owing to Bowie's short series the error is 1 to 2 % up to L/R = 2
    and 4 % at 10."""
    a, b, c = BOWIE_FIT[cracks]
    return a + b / (c + ratio)


def nasgro(ratio: float) -> float:
    """The same for one crack by `NASGRO_FIT`."""
    part = ratio / (1 + ratio)
    return sum(coefficient * part**k for k, coefficient in enumerate(NASGRO_FIT))


def factor(length: float, cracks: int, stress: np.ndarray, pressure: float = 0.0, n: int = 65) -> float:
    """K_I/√(πL) of ``cracks`` (1, or 2 opposite ones) of ``length`` L along x from a hole of radius 1 in a remote
    ``stress`` (xx, yy, xy = 0), with a fluid ``pressure`` on the wall and in the cracks (computed, `dislocations`)."""
    arms = [Arm(side, side * (1 + length), False, k, True) for k, side in enumerate((1.0, -1.0)[:cracks])]

    def field(points):
        return kirsch_stress(points, stress, 1.0, pressure) + np.array([pressure, pressure, 0.0])

    return float(stress_intensity(arms, field, "hole", n)[0, 0] / np.sqrt(np.pi * length))
