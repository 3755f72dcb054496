"""Flexural toppling of rock columns under their own weight: stress at the base, and K of a flaw and of joint ends
there.

A column of length ℓ and thickness t stands on rock; gravity is inclined by δ (rad) to its axis. Per metre of width; SI
units.
"""

from __future__ import annotations

import math

from ..cracks.fracture import EDGE_CRACK
from ..cracks.plates import EDGE_CRACK_BENDING


def base_stresses(unit_weight: float, length: float, thickness: float, tilt: float) -> tuple[float, float]:
    """(bending, mean) stress at the base of a cantilever, Pa, tension positive: 3γℓ² sin δ/t and −γℓ cos δ.

    Their sum reaches the tensile strength where a column without flaws breaks (Aydan & Kawamoto 1992, Rock Mech. Rock
    Eng. 25, 143-165; Adhikary, Dyskin, Jewell & Stewart 1997, Rock Mech. Rock Eng. 30, 75-93, for single columns).
    """
    return 3 * unit_weight * length**2 * math.sin(tilt) / thickness, -unit_weight * length * math.cos(tilt)


def flaw_factor(unit_weight: float, length: float, thickness: float, tilt: float, ratio: float) -> float:
    """K_I, Pa √m, of a flaw of depth ``ratio``·t in the tension side at the base, ``length`` below the column's end:
    bending and mean stress with the factors of Kaya & Erdogan (1987), for the ratios in their tables."""
    bending, mean = base_stresses(unit_weight, length, thickness, tilt)
    factor = bending * EDGE_CRACK_BENDING[round(ratio, 6)] + mean * EDGE_CRACK[round(ratio, 6)]
    return factor * math.sqrt(math.pi * ratio * thickness)


def joint_end_factor(unit_weight: float, length: float, thickness: float, tilt: float) -> float:
    """Magnitude of K_II, Pa √m, at the ends of smooth joints between many equal columns on solid rock: σ_b √(t/6).

    The end of each joint releases the bending energy of one column, G = M²/2E'I = 6M²/E't³, for beams much longer than
    thick (as in the end-notched beam: Russell & Street 1982); below the ends the rock is solid and its bending energy
    is negligible.
    """
    bending, _ = base_stresses(unit_weight, length, thickness, tilt)
    return bending * math.sqrt(thickness / 6)


def turning(
    moment_arm: tuple[float, float], inertia_per_mass: float, gravity: tuple[float, float], spin: float, times
) -> list[float]:
    """Angles (rad, counter-clockwise from that at the first of ``times``) of a rigid body that rotates about a fixed
    point.

    ``moment_arm`` m, from the point to the centroid at the first time; ``inertia_per_mass`` m², about the point;
    ``spin`` rad/s at the first time: θ̈ = (r × g)/i².
    """
    from scipy.integrate import solve_ivp

    x, y = moment_arm

    def rates(_, state):
        c, s = math.cos(state[0]), math.sin(state[0])
        arm = c * x - s * y, s * x + c * y
        return state[1], (arm[0] * gravity[1] - arm[1] * gravity[0]) / inertia_per_mass

    found = solve_ivp(rates, (times[0], times[-1]), (0.0, spin), t_eval=times, rtol=1e-10, atol=1e-12)
    return found.y[0].tolist()
