"""A borehole in unequal stress: growth of cracks from its wall by the crack solver alone, without blocks.

Breakout: both remote stresses rise in proportion until the wall fails in shear and a chip comes off. Shear: under
stresses somewhat above that, in rock whose toughness is lower in shear than in tension, cracks with friction grow into
the rock and arrest where the stress concentration of the hole no longer drives them. Mud pressure: the remote stresses
are constant, and the pressure in the hole and in the cracks connected with it rises until the wall fails in tension,
and then only as far as the fracture allows.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from geomech import ddm
from geomech.model import Cracks, GrowthSettings, JointLaw, Material

RADIUS = 0.1
#: Remote compression: σ_H along x, σ_h along y, Pa.
GREATER, LESSER = 30e6, 20e6
ROCK = Material(
    "granite",
    youngs_modulus=40e9,
    poissons_ratio=0.25,
    k_ic=1.5e6,
    k_iic=3e6,
    tensile_strength=8e6,
    cohesion=20e6,
    friction_angle=math.radians(35),
)
#: Sides of the polygon for the hole; the middles of four of them lie on the axes.
SIDES = 72
VARIANTS = ("breakout", "shear", "mud_pressure")
#: In "shear": toughness in shear, Pa √m, friction of the new faces, remote stresses as multiples of the above.
WEAK_IN_SHEAR, FRICTION, ABOVE = 1e6, 0.7, 1.15


def wall(sides: int = SIDES) -> np.ndarray:
    """(sides, 2) a polygon with the mean radius of the hole."""
    angle = 2 * math.pi * (np.arange(sides) + 0.5) / sides
    return RADIUS / math.sqrt(math.cos(math.pi / sides)) * np.column_stack([np.cos(angle), np.sin(angle)])


def steps(variant: str, sides: int = SIDES, most: int | None = None, increment: float | None = None) -> list:
    """All steps of a ``variant``, or the first ``most``. Load factors are multiples of the remote stresses in
    "breakout", MPa in "mud_pressure", one in "shear"; ``sides`` of the polygon for the hole; ``increment`` m, by
    default that of each variant."""
    remote = -np.array([GREATER, LESSER, 0.0])
    rock, control, options = ROCK, "toughness", {}
    if variant == "breakout":
        increment, most = increment or 0.02 * RADIUS, most or 20
        # Chips come off by shear at first: tension and shear each have their own toughness.
        criterion, load = "f", ddm.BodyLoad(remote_stress=remote)
    elif variant == "shear":
        increment, most = increment or 0.04 * RADIUS, most or 60
        criterion, load, control = "f", ddm.BodyLoad(remote_stress=ABOVE * remote), "load"
        rock = replace(ROCK, k_iic=WEAK_IN_SHEAR)
        options["face_laws"] = (JointLaw("rough", friction_angle=math.atan(FRICTION)),)
    elif variant == "mud_pressure":
        increment, most = increment or 0.1 * RADIUS, most or 17
        criterion = "mts"

        def load(pressure, cracks):
            return ddm.BodyLoad(remote_stress=remote, hole_pressure=pressure * 1e6, crack_pressure=pressure * 1e6)
    else:
        raise ValueError(f"no variant {variant!r} of the borehole; there are {', '.join(VARIANTS)}")
    # The spacing leaves room for one crack on either side of the hole.
    growth = GrowthSettings(criterion=criterion, increment=increment, initiation="surface", initiation_spacing=RADIUS)
    none = Cracks.from_polylines([])
    run = ddm.propagate([], none, rock, load, growth, control=control, max_steps=most, holes=[wall(sides)], **options)
    return list(run)


def last_network(run: list) -> Cracks:
    """The cracks at the end, including the growth of the last step."""
    return run[-1].growth.cracks if run[-1].growth is not None else run[-1].cracks


def azimuths(run: list) -> np.ndarray:
    """Azimuths at which cracks initiated, degrees from σ_H, 0 to 90."""
    points = np.array([event.point for step in run for event in step.events if event.kind == "birth"])
    return np.degrees(np.arctan2(np.abs(points[:, 1]), np.abs(points[:, 0])))
