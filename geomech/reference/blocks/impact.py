"""Impacts with a coefficient of restitution e and Coulomb friction μ: closed forms for rigid bodies.

Newton's law normal to the contact, v′ = −e v, and Coulomb's law for the impulses, |Pₜ| ≤ μ Pₙ (Routh 1905, Dynamics of
a System of Rigid Bodies, Elementary Part, chapter IV; Goldsmith 1960, Impact). SI units.
"""

from __future__ import annotations

import math


def rebound_height(height: float, restitution: float, bounces: int = 1) -> float:
    """Height (m) of the rebound of a body dropped from rest at ``height`` m after this number of ``bounces``: e²ⁿ h."""
    return restitution ** (2 * bounces) * height


def bounce_time(height: float, restitution: float, bounce: int, gravity: float = 9.81) -> float:
    """Time (s) from the release at rest at ``height`` m to the ``bounce``-th impact (from 1 on): √(2h/g) (1 + 2 (e + e²
    + … + eⁿ⁻¹)); for infinitely many: √(2h/g) (1 + e)/(1 − e)."""
    return math.sqrt(2.0 * height / gravity) * (1.0 + 2.0 * sum(restitution**k for k in range(1, bounce)))


def oblique(across: float, along: float, restitution: float, friction: float) -> tuple[float, float]:
    """Velocities normal to and along a face, m/s, after the impact of a non-rotating body with ``across`` < 0 and
    ``along``: Pₙ/m = −(1 + e) vₙ; the tangential impulse stops the sliding, but is at most μ Pₙ."""
    normal = -(1.0 + restitution) * across
    return across + normal, math.copysign(max(0.0, abs(along) - friction * normal), along)


def eccentric(speed: float, arm: float, mass: float, inertia: float, restitution: float) -> tuple[float, float]:
    """(m/s, rad/s) velocity of the centroid and angular velocity after a non-rotating body that falls at ``speed`` m/s
    strikes a smooth floor with a corner ``arm`` m to the right of its centroid: P (1/m + r²/I) = (1 + e) v."""
    impulse = (1.0 + restitution) * speed / (1.0 / mass + arm * arm / inertia)
    return impulse / mass - speed, impulse * arm / inertia


def central(first: tuple[float, float], second: tuple[float, float], restitution: float) -> tuple[float, float]:
    """Velocities (m/s) of two bodies, each (mass, velocity), after a central impact."""
    (m1, v1), (m2, v2) = first, second
    impulse = (1.0 + restitution) * (v1 - v2) / (1.0 / m1 + 1.0 / m2)
    return v1 - impulse / m1, v2 + impulse / m2


def down_an_incline(
    speed: float, slope: float, restitution: float, friction: float, bounces: int, gravity: float = 9.81
) -> tuple[float, float]:
    """(s, m/s): time from the first to the last of ``bounces`` impacts of a non-rotating body on a plane inclined by
    ``slope`` rad, and its velocity down the plane after the last one.

    The first impact is at ``speed`` m/s normal to the plane and at rest along it. Each flight takes 2 eⁿ v/(g cos α)
    and adds g sin α times its duration to the velocity along the plane; each impact reduces it by μ (1 + e) eⁿ v, or to
    zero.
    """
    time, along, across = 0.0, 0.0, speed
    for bounce in range(bounces):
        if bounce:
            flight = 2.0 * across / (gravity * math.cos(slope))
            time, along = time + flight, along + gravity * math.sin(slope) * flight
        across, along = oblique(-across, along, restitution, friction)
    return time, along
