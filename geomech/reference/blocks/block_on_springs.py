"""A deformable square block on an incline, on two frictional springs, by explicit time integration: an independent
method.

It shares nothing with the block solver: small displacements on fixed axes along and across the incline, forces at the
start of each step, steps that resolve the stiffest spring, and friction by the return mapping of a spring in series
with a slider. The physics is that of a first-order block, so the block solver must converge to this motion under
suddenly applied weight.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...model import Material


class SpringContact(NamedTuple):
    """Contact at a corner: ``friction_angle`` (rad), ``spring`` (Pa) normal and along, and ``damping`` as
    `geomech.model.DdaSettings` counts it."""

    friction_angle: float
    damping: float
    spring: float


def creep_of_a_sudden_weight(
    duration: float,
    dt: float,
    outputs: int,
    incline: float,
    contact: SpringContact,
    material: Material,
    gravity: float = 9.81,
) -> np.ndarray:
    """(outputs,) m: displacement of a 1 m square down an ``incline`` (rad) at equal times up to ``duration`` (s), if
    its weight acts suddenly on a block that just touches; plane strain.

    The ``contact`` is at its two lower corners. Damping is a viscous stress for the vibration of the block, ω² = 12
    C₁₁/(ρ h²), and a dashpot 2 ξ √(k m) normal to each contact. Semi-implicit Euler steps ``dt`` (s), of first order.
    """
    friction_angle, damping, spring = contact
    poissons_ratio, density = material.poissons_ratio, material.density
    bulk = material.youngs_modulus / ((1 + poissons_ratio) * (1 - 2 * poissons_ratio))
    modulus, lateral = bulk * (1 - poissons_ratio), bulk * poissons_ratio
    friction, drag = math.tan(friction_angle), 2 * damping * math.sqrt(spring * density)
    viscous = 2 * damping * math.sqrt(density / (12 * modulus))
    along, across = density * gravity * math.sin(incline), density * gravity * math.cos(incline)
    # Displacements and rates of the centre, the rotation and three strains; plain numbers are quicker than short
    # arrays.
    u = v = r = ex = ey = g = du = dv = dr = dex = dey = dg = 0.0
    corners = [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]]  # x, stretch of the shear spring, where the corner was
    y = -0.5
    steps = round(duration / dt)
    out = []
    for step in range(1, steps + 1):
        tx, ty, tg = ex + viscous * dex, ey + viscous * dey, g + viscous * dg
        fu, fv, fr = along, -across, 0.0
        fx, fy = -modulus * tx - lateral * ty, -lateral * tx - modulus * ty
        fg = -0.5 * (modulus - lateral) * tg
        for corner in corners:
            x, stretched, before = corner
            at = u - y * r + x * ex + 0.5 * y * g
            gap = v + x * r + y * ey + 0.5 * x * g
            push = 0.0
            if gap < 0.0:
                push = max(0.0, -spring * gap - drag * (dv + x * dr + y * dey + 0.5 * x * dg))
            shear = stretched - spring * (at - before)
            shear = min(friction * push, max(-friction * push, shear))
            corner[1], corner[2] = shear, at
            fu, fv, fr = fu + shear, fv + push, fr + x * push - y * shear
            fx, fy, fg = fx + x * shear, fy + y * push, fg + 0.5 * (y * shear + x * push)
        per = dt / density
        du, dv, dr = du + per * fu, dv + per * fv, dr + 6 * per * fr
        dex, dey, dg = dex + 12 * per * fx, dey + 12 * per * fy, dg + 24 * per * fg
        u, v, r, ex, ey, g = u + dt * du, v + dt * dv, r + dt * dr, ex + dt * dex, ey + dt * dey, g + dt * dg
        if step % (steps // outputs) == 0:
            out.append(u)
    return np.array(out)
