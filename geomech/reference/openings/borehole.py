"""Borehole breakout and breakdown from Kirsch's wall stress and the strength of intact rock.

Stresses are positive in compression here: remote stresses ``greater`` and ``lesser`` normal to the hole, Pa; mud
``pressure`` on the wall, which does not enter the rock.
"""

from __future__ import annotations

import math


def breakout_ratio(greater: float, lesser: float, cohesion: float, friction_angle: float) -> float:
    """Factor on both remote stresses at which the wall of an empty hole fails in shear.

    Uniaxial strength 2c cos φ/(1 − sin φ) over the largest hoop stress 3σ_H − σ_h (Kirsch 1898; Jaeger, Cook &
    Zimmerman 2007, ch. 8). This stress acts at the points of the wall in the direction of σ_h, so that breakouts point
    along the lesser stress (Bell & Gough 1979).
    """
    strength = 2 * cohesion * math.cos(friction_angle) / (1 - math.sin(friction_angle))
    return strength / (3 * greater - lesser)


def breakdown_pressure(greater: float, lesser: float, tensile_strength: float) -> float:
    """Mud pressure at which the wall fails in tension, 3σ_h − σ_H + T (Hubbert & Willis 1957); the fracture runs along
    σ_H."""
    return 3 * lesser - greater + tensile_strength
