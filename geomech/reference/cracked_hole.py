"""Radial cracks from the wall of a circular hole in an infinite plane."""

from __future__ import annotations

import numpy as np

from .dislocations import Arm, stress_intensity
from .holes import kirsch_stress

#: Radial cracks of length L from a hole of radius R, plane pulled across them: L/R → K_I/(σ√(πL)), one crack and two
#: (Bowie 1956, as tabulated by Paris & Sih 1965; the table was not at hand and is not confirmed). Beside `factor` they are right to 3 % for two cracks, 5 % for one.
BOWIE_ONE = {0.2: 2.30, 0.5: 1.73, 1.0: 1.37, 2.0: 1.06}
BOWIE_TWO = {0.2: 2.41, 0.5: 1.83, 1.0: 1.45, 2.0: 1.21}


def factor(length: float, cracks: int, stress: np.ndarray, pressure: float = 0.0, n: int = 65) -> float:
    """K_I/√(πL) of ``cracks`` (1, or 2 opposite ones) along x of ``length`` L from a hole of radius 1 in a remote
    ``stress`` (xx, yy, xy = 0); a fluid's ``pressure`` acts on the wall and in the cracks (computed, `dislocations`)."""
    arms = [Arm(side, side * (1 + length), False, k, True) for k, side in enumerate((1.0, -1.0)[:cracks])]

    def field(points):
        return kirsch_stress(points, stress, 1.0, pressure) + np.array([pressure, pressure, 0.0])

    return float(stress_intensity(arms, field, "hole", n)[0, 0] / np.sqrt(np.pi * length))
