"""One or two rigid blocks on an incline: rest, sliding, toppling or both, and the initial accelerations.

A column of width b and height h has the slenderness angle δ with tan δ = b/h. Ashby (1971), "Sliding and toppling modes
of failure in models and jointed rock slopes" (MSc thesis, Imperial College), drew the map over α, δ, φ from statics;
Bray & Goodman (1981) and Sagaseta (1986), "On the modes of instability of a rigid block on an inclined plane", Rock
Mechanics and Rock Engineering 19, 261-266, moved the boundary between toppling and toppling with sliding to where the
toe, in rotation, just holds; Yagoda-Biran & Hatzor (2013), "A new failure mode chart for toppling and sliding with
consideration of earthquake inertia force", International Journal of Rock Mechanics and Mining Sciences 64, 122-131,
give the map so completed. Angles rad, accelerations m/s² and rad/s²; the thickness and the density cancel.
"""

from __future__ import annotations

import math

MODES = ("stable", "sliding", "toppling", "sliding and toppling")


def toe_holds_above(slenderness: float, incline: float) -> float:
    """The friction angle (rad) below which the toe of a column that topples from rest also slides; δ < α.

    From rest the column rotates about the toe with θ̈ = ¾ (g/r) sin(α−δ), r the half diagonal, so that the toe must
    carry T = mg [sin α − ¾ sin(α−δ) cos δ] on N = mg [cos α + ¾ sin(α−δ) sin δ] (Bray & Goodman 1981; Sagaseta 1986).
    """
    turn = 0.75 * math.sin(incline - slenderness)
    along = math.sin(incline) - turn * math.cos(slenderness)
    return math.atan2(along, math.cos(incline) + turn * math.sin(slenderness))


def failure_mode(slenderness: float, friction_angle: float, incline: float) -> str:
    """Mode of a column released from rest, one of `MODES` (Yagoda-Biran & Hatzor 2013)."""
    if incline <= slenderness:
        if friction_angle >= incline:
            return "stable"
    elif friction_angle >= toe_holds_above(slenderness, incline):
        return "toppling"
    # Sliding friction tan φ at the base overturns a column whose resultant leaves the base: φ > δ.
    return "sliding" if friction_angle <= slenderness else "sliding and toppling"


def starting_accelerations(
    slenderness: float, friction_angle: float, incline: float, height: float, gravity: float = 9.81
) -> tuple[float, float]:
    """(acceleration of the toe down the incline, angular acceleration forwards) of a column at rest, m/s² and rad/s².

    Newton's equations in each mode: about the toe for toppling, I = (4/3) m r²; for sliding and toppling with T = N tan
    φ at the toe, about the centroid, I = m r²/3.
    """
    a, d, slope = incline, slenderness, math.tan(friction_angle)
    r = 0.5 * height / math.cos(d)
    mode = failure_mode(d, friction_angle, a)
    if mode == "stable":
        return 0.0, 0.0
    if mode == "sliding":
        return gravity * (math.sin(a) - math.cos(a) * slope), 0.0
    if mode == "toppling":
        return 0.0, 0.75 * gravity / r * math.sin(a - d)
    lever = slope * math.cos(d) - math.sin(d)
    normal = gravity * math.cos(a) / (1.0 - 3.0 * math.sin(d) * lever)  # per unit of mass
    spin = 3.0 * normal * lever / r
    return gravity * math.sin(a) - slope * normal - spin * r * math.cos(d), spin


def stacked_accelerations(
    incline: float, base_friction: float, between: float, masses: tuple[float, float], gravity: float = 9.81
) -> tuple[float, float]:
    """Accelerations (m/s²) down the ``incline`` of a lower and an upper block from rest, friction angle
    ``base_friction`` under the lower, ``between`` them; ``masses`` lower first. Neither topples.

    Coulomb (1785) in each joint. If the upper block slides on the lower one, its friction drags the lower one along.
    The lower one is never faster: friction would then accelerate the upper one beyond free sliding.
    """
    lower, upper = masses
    weight = gravity * math.sin(incline)
    press = gravity * math.cos(incline)
    together = max(0.0, weight - press * math.tan(base_friction))
    # Shear force in the joint if both move together.
    if abs(weight - together) <= press * math.tan(between):
        return together, together
    drag = press * math.tan(between)
    alone = weight + (upper * drag - (lower + upper) * press * math.tan(base_friction)) / lower
    return max(0.0, alone), weight - drag
