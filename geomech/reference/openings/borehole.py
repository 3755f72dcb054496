"""Borehole breakout and breakdown from Kirsch's wall stress and the strength of intact rock.

All stresses count as compressive when positive here: ``greater`` and ``lesser`` remote ones across the hole, Pa; mud
``pressure`` on the wall, none of it in the rock.
"""

from __future__ import annotations

import math


def breakout_ratio(greater: float, lesser: float, cohesion: float, friction_angle: float) -> float:
    """Factor on both remote stresses at which the wall of an empty hole fails in shear: uniaxial
    strength 2c cos φ/(1 − sin φ) over the greatest hoop stress 3σ_H − σ_h (Kirsch 1898; Jaeger, Cook & Zimmerman 2007,
    ch. 8). It is reached where the wall faces σ_h, so that breakouts point along the lesser stress (Bell & Gough
    1979)."""
    strength = 2 * cohesion * math.cos(friction_angle) / (1 - math.sin(friction_angle))
    return strength / (3 * greater - lesser)


def breakdown_pressure(greater: float, lesser: float, tensile_strength: float) -> float:
    """Mud pressure at which the wall fails in tension, 3σ_h − σ_H + T (Hubbert & Willis 1957); the fracture runs along
    σ_H."""
    return 3 * lesser - greater + tensile_strength
