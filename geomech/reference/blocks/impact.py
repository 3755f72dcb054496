"""Impacts with a coefficient of restitution e and Coulomb's friction μ: closed forms for rigid bodies.

Newton's law across the contact, v′ = −e v, and Coulomb's between impulses along it, |Pₜ| ≤ μ Pₙ (Routh 1905, Dynamics
of a System of Rigid Bodies, Elementary Part, chapter IV; Goldsmith 1960, Impact). SI units.
"""

from __future__ import annotations

import math


def rebound_height(height: float, restitution: float, bounces: int = 1) -> float:
    """m to which a body dropped from rest at ``height`` m comes up after so many ``bounces``: e²ⁿ h."""
    return restitution ** (2 * bounces) * height


def bounce_time(height: float, restitution: float, bounce: int, gravity: float = 9.81) -> float:
    """s after its release from rest at ``height`` m at which a body strikes the floor for the ``bounce``-th time (from
    1
    on): √(2h/g) (1 + 2 (e + e² + … + eⁿ⁻¹)); for ever: √(2h/g) (1 + e)/(1 − e)."""
    return math.sqrt(2.0 * height / gravity) * (1.0 + 2.0 * sum(restitution**k for k in range(1, bounce)))


def oblique(across: float, along: float, restitution: float, friction: float) -> tuple[float, float]:
    """Velocities across and along a face, m/s, after a body without turning strikes it with ``across`` < 0 and
    ``along``:
    Pₙ/m = −(1 + e) vₙ, and along as much as stops it, at most μ Pₙ."""
    normal = -(1.0 + restitution) * across
    return across + normal, math.copysign(max(0.0, abs(along) - friction * normal), along)


def eccentric(speed: float, arm: float, mass: float, inertia: float, restitution: float) -> tuple[float, float]:
    """(m/s, rad/s) velocity of the centroid and rate of turning, after a body that falls at ``speed`` m/s without
    turning
    strikes a smooth floor with a corner ``arm`` m to the right of its centroid: P (1/m + r²/I) = (1 + e) v."""
    impulse = (1.0 + restitution) * speed / (1.0 / mass + arm * arm / inertia)
    return impulse / mass - speed, impulse * arm / inertia


def central(first: tuple[float, float], second: tuple[float, float], restitution: float) -> tuple[float, float]:
    """m/s after two bodies, each (mass, velocity), strike each other centrally."""
    (m1, v1), (m2, v2) = first, second
    impulse = (1.0 + restitution) * (v1 - v2) / (1.0 / m1 + 1.0 / m2)
    return v1 - impulse / m1, v2 + impulse / m2


def down_an_incline(
    speed: float, slope: float, restitution: float, friction: float, bounces: int, gravity: float = 9.81
) -> tuple[float, float]:
    """(s, m/s): how long after it has struck a plane inclined by ``slope`` rad for the first time at ``speed`` m/s
    across
    it, at rest along it, a body without turning strikes it for the last of ``bounces`` times, and its velocity down the
    plane after that: each flight takes 2 eⁿ v/(g cos α) and adds g sin α to it, each impact takes μ (1 + e) eⁿ v, or
    what
    there is."""
    time, along, across = 0.0, 0.0, speed
    for bounce in range(bounces):
        if bounce:
            flight = 2.0 * across / (gravity * math.cos(slope))
            time, along = time + flight, along + gravity * math.sin(slope) * flight
        across, along = oblique(-across, along, restitution, friction)
    return time, along
