"""Rock bridges on the sliding plane of a slope: limit equilibrium with the resistance of bridges by fracture mechanics
or by strength.

Angles rad, forces N per metre of thickness, lengths m, stresses Pa, toughness Pa √m. Gravity is a multiple of that for
which ``weight`` is given, as in a centrifuge.
"""

from __future__ import annotations

import math

#: K_II of a tip at which tension starts a kink, over K_Ic: maximum tangential stress (Erdogan & Sih 1963), √3/2.
SHEAR_TO_KINK = math.sqrt(3) / 2

#: Turn of that kink from the crack, rad: arccos(1/3), 70.5 degrees (Erdogan & Sih 1963).
KINK = math.acos(1 / 3)

#: Tensile strength, MPa, of rocks over their K_Ic, MPa √m: the fit to tests on rocks from coal to granite of Zhang
#: (2002), "An empirical relation between mode I fracture toughness and the tensile strength of rock", Int. J. Rock
#: Mech. Min. Sci. 39.
STRENGTH_OVER_TOUGHNESS = 6.88


def driving_force(weight: float, dip: float, cohesive_length: float, cohesion: float, friction_angle: float) -> float:
    """Force of a block along a plane in excess of the strength of the joint: W (sin ψ − cos ψ tan φ) − c L (Hoek & Bray
    1981, chapter 7)."""
    return weight * (math.sin(dip) - math.cos(dip) * math.tan(friction_angle)) - cohesion * cohesive_length


def shear_factor(excess: float, bridge: float) -> float:
    """K_II = Q/√(πb) at both ends of a bridge 2b that transmits the shear Q between two half-planes (Tada, Paris &
    Irwin 2000, two semi-infinite collinear cracks).

    Q is the ``excess`` over the force that the joint would carry in place of the bridge: the uniform shear τ_f of
    sliding faces acts on faces and bridge alike and does not contribute to the factor.
    """
    return excess / math.sqrt(math.pi * bridge / 2)


def bridged_plane_multiplier(
    weight: float,
    dip: float,
    length: float,
    cohesion: float,
    friction_angle: float,
    bridge: float,
    toughness: float,
) -> float:
    """The multiple of gravity at which a short ``bridge`` in a plane of this ``length`` has K_II = ``toughness``: limit
    equilibrium of the whole plane as a joint, with the force K √(πb) of the bridge in addition,

        n W (sin ψ − cos ψ tan φ) = c L + K √(πb),

    from the two formulas above. K increases as the bridge becomes shorter, so that a bridge that breaks along the plane
    fails at once.
    """
    resistance = cohesion * length + toughness * math.sqrt(math.pi * bridge / 2)
    return resistance / driving_force(weight, dip, 0.0, 0.0, friction_angle)


def jennings_rock_cohesion(apparent: float, persistence: float, joint: float) -> float:
    """c_r of the rock in a plane that is a joint over the fraction k, its ``persistence``, and as a whole has the
    ``apparent`` cohesion k c_j + (1 − k) c_r.

    Jennings (1970), "A mathematical theory for the calculation of the stability of slopes in open cast mines",
    Johannesburg symposium on planning open pit mines, 87-102, who weights tan φ in the same way; here bridges have the
    friction of the joint.
    """
    return (apparent - persistence * joint) / (1 - persistence)


def high_angle_bridges_multiplier(
    weight: float, dip: float, friction_angle: float, steps: float, tensile_strength: float
) -> float:
    """The multiple of gravity at which joints of one ``dip`` slide while all bridges between them fail in tension
    across the dip: n W (sin ψ − cos ψ tan φ) = T Σ X, with ``steps`` Σ X the sum of the distances between neighbouring
    joints.

    Einstein, Veneziano, Baecher & O'Reilly (1983), "The effect of discontinuity persistence on rock slope stability",
    Int. J. Rock Mech. Min. Sci. 20, 227-236: bridges at a high angle to the joints fail in tension with the resistance
    T X.
    """
    return tensile_strength * steps / driving_force(weight, dip, 0.0, 0.0, friction_angle)


def direct_shear_strength(normal_force: float, friction_angle: float, bridge: float, toughness: float) -> float:
    """The shear force N tan φ + K √(πb) at which a short ``bridge`` 2b between two co-planar joints of a specimen has
    K_II = ``toughness`` while the joints slide: `shear_factor` with the shear in excess of friction on the whole plane.
    """
    return normal_force * math.tan(friction_angle) + toughness * math.sqrt(math.pi * bridge / 2)


def tearing_bridge(normal_stress: float, tensile_strength: float) -> float:
    """The mean shear stress √(T (T + σ)) at which a bridge under the pressure σ normal to the plane, and none along it,
    has the principal tension T: the tensile strength of Lajtai (1969), "Strength of discontinuous rocks in direct
    shear", Géotechnique 19, 218-233, who observed that bridges of plaster first failed obliquely in tension if the
    pressure was low."""
    return math.sqrt(tensile_strength * (tensile_strength + normal_stress))
