"""Limit equilibrium of plane failure and of the two-block (active–passive) wedge.

Angles rad, forces N per metre of thickness, lengths m.
"""

from __future__ import annotations

import math

import numpy as np


def plane_failure_factor(
    weight: float,
    dip: float,
    length: float,
    cohesion: float,
    friction_angle: float,
    uplift: float = 0.0,
    thrust: float = 0.0,
) -> float:
    """Factor of safety of a block of ``weight`` on a plane: [c A + (W cos α − U − V sin α) tan φ]/(W sin α + V cos α).

    ``uplift`` U is the water force normal to the plane, ``thrust`` V the horizontal one in a vertical tension crack
    behind the block. Hoek & Bray (1981), Rock slope engineering, 3rd ed., chapter 7.
    """
    sine, cosine = math.sin(dip), math.cos(dip)
    holding = cohesion * length + (weight * cosine - uplift - thrust * sine) * math.tan(friction_angle)
    return holding / (weight * sine + thrust * cosine)


def two_block_friction(
    active: tuple[float, float], passive: tuple[float, float], interface: float | None = None
) -> float:
    """The friction angle (rad) at which two blocks on two planes just slide: ``active`` = (weight, dip) on the steeper
    plane behind ``passive`` = (weight, dip), across a vertical interface of friction angle ``interface`` (None: that of
    the planes).

    Both slide down their planes, and the active block also down along the interface, with friction fully mobilised
    everywhere: two force equations per block for three unknown forces and tan φ (Jaeger 1971, "Friction of rocks and
    stability of rock slopes", Géotechnique 21, 97-134; the sliding-block method of the active and passive wedge).
    """

    def surplus(angle: float) -> float:
        """Thrust of the active block minus the resistance of the passive one."""
        slope = math.tan(angle)
        drag = slope if interface is None else math.tan(interface)
        thrusts = []
        for (weight, dip), sign in ((active, -1.0), (passive, 1.0)):
            # N (sin − μ cos) + sign E = 0 and N (cos + μ sin) − sign μᵢ E = W, x along the motion, y up.
            matrix = np.array(
                [
                    [math.sin(dip) - slope * math.cos(dip), sign],
                    [math.cos(dip) + slope * math.sin(dip), -sign * drag],
                ]
            )
            thrusts.append(float(np.linalg.solve(matrix, [0.0, weight])[1]))
        return thrusts[0] - thrusts[1]

    low, high = passive[1], active[1]
    while high - low > 1e-13:
        mid = 0.5 * (low + high)
        low, high = (mid, high) if surplus(mid) > 0 else (low, mid)
    return 0.5 * (low + high)
