"""Star-shaped and kinked cracks: straight arms that meet at a point, by `dislocations` graded there, and limiting
cases."""

from __future__ import annotations

import cmath
import math

import numpy as np

from .dislocations import Arm, stress_intensity

#: Stars of equal arms of length 1 under uniform pressure 1: arms → K_I/√π at every tip (computed, `star`, converged to
#: the digits given; two arms are the Griffith crack).
STARS = {2: 1.0, 3: 0.94149892, 4: 0.86354210}


def star(arms: int, n: int = 65) -> float:
    """K_I/√π of a star of ``arms`` arms of length 1 under uniform pressure 1."""
    way = [cmath.exp(2j * math.pi * k / arms) for k in range(arms)]
    k = stress_intensity([Arm(0, w, False) for w in way], lambda p: np.tile([1.0, 1.0, 0.0], (len(p), 1)), n=n)
    return float(k[0, 0] / math.sqrt(math.pi))


def kinked(main: float, kink: float, angle: float, stress: np.ndarray, n: int = 97) -> np.ndarray:
    """(2, 2) K_I, K_II at the far tip of a ``main`` crack that lies on x < 0 up to the origin, and at the tip of a
    ``kink`` from there at ``angle`` (rad), both lengths in m, in a remote ``stress`` (3,)."""
    arms = [Arm(0, -main, False), Arm(0, kink * cmath.exp(1j * angle), False)]
    return stress_intensity(arms, lambda p: np.broadcast_to(np.asarray(stress, dtype=float), (len(p), 3)), n=n)
