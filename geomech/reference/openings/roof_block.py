"""Limit equilibrium of a roof block: suspended from a rock bridge, or wedged between two joints that diverge downwards.

Forces N per metre of thickness, lengths m, angles rad. The block is symmetric; its side joints are inclined by
``half_angle`` to the vertical, and the rock on either side presses on them with the horizontal ``thrust``.
"""

from __future__ import annotations

import math


def ligament_factor(force: float, half_width: float) -> float:
    """K_I, Pa √m, of two collinear cracks separated by a ligament 2c that carries ``force``: P/√(πc).

    For half-planes, i.e. cracks much longer than the ligament (Tada, Paris & Irwin, The Stress Analysis of Cracks
    Handbook, two semi-infinite collinear cracks; from Muskhelishvili's punch).
    """
    return force / math.sqrt(math.pi * half_width)


def bridge_force(weight: float, thrust: float, half_angle: float, friction: float) -> float:
    """Force (N) in a bridge above the block when the block is about to slide: W − 2H tan(φ − α), at least 0.

    Statics of the wedge between two planes on which the reaction is inclined by φ against the motion (as for the roof
    block of Goodman & Shi 1985, Block Theory, and Brady & Brown, Rock Mechanics for Underground Mining, on roof
    prisms). Frictionless planes squeeze the block out: W + 2H tan α.
    """
    return max(0.0, weight - 2 * thrust * math.tan(friction - half_angle))


def least_thrust(weight: float, half_angle: float, friction: float) -> float:
    """Smallest thrust that supports the block without a bridge, W/(2 tan(φ − α)), N; infinite for φ ≤ α."""
    return weight / (2 * math.tan(friction - half_angle)) if friction > half_angle else math.inf


def acceleration(
    weight: float, thrust: float, half_angle: float, friction: float, wall_mass: float = 0.0, gravity: float = 9.81
) -> float:
    """Acceleration of the block without a bridge as it slides out between walls of ``wall_mass`` (kg/m) each, which the
    thrust keeps in contact with it and which therefore accelerate by tan α times as much. 0 if the thrust supports the
    block, g if the walls are too slow to follow."""
    grip, lean = 2 * math.tan(friction - half_angle), math.tan(half_angle)
    sliding = max(0.0, weight - thrust * grip) / (weight / gravity - grip * wall_mass * lean)
    return gravity if wall_mass * lean * sliding > thrust else sliding
