"""Semicircular masonry arches: their limit thickness, line of thrust, and collapse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geomech import dda
from geomech.model import OPEN, Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from geomech.reference.blocks import masonry

RADIUS = 10.0  # mean radius, m
#: Stiff stone, and joints too rough to slide: limit analysis excludes strain and sliding.
STONE = Material("stone", youngs_modulus=1e11, poissons_ratio=0.2, density=2500.0)
JOINTS = JointLaw("joints", friction_angle=np.radians(60))
WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))
SETTINGS = DdaSettings(time_step=0.01, dynamic_factor=1.0, max_displacement_ratio=0.02)


def arch(n: int, ratio: float) -> dda.BlockSystem:
    """``n`` voussoirs of thickness ``ratio`` times the mean radius, from the right springing to the left one."""
    inner, outer = RADIUS * (1 - 0.5 * ratio), RADIUS * (1 + 0.5 * ratio)
    right, left = ([[a, -2.0], [b, -2.0], [b, 0.0], [a, 0.0]] for a, b in ((inner, outer), (-outer, -inner)))
    outlines = [np.array(right), *masonry.voussoirs(n, ratio, RADIUS), np.array(left)]
    blocks = Blocks.from_polygons(
        outlines,
        fixed=[True] + [False] * n + [True],
        names=["right springing", *(f"voussoir {k}" for k in range(1, n + 1)), "left springing"],
    )
    return dda.BlockSystem(blocks, [STONE], [JOINTS], settings=SETTINGS)


def rest(system: dda.BlockSystem) -> dda.Equilibrium:
    # QuasiNewton, an arch that stands moves by its elastic shortening, 1e-4 m: one that has gone a centimetre falls.
    return dda.equilibrium(system, State.at_rest(system.blocks), WEIGHT, limits=dda.RelaxationLimits(reach=0.01))


def thinnest(n: int, low: float = 0.09, high: float = 0.12) -> float:
    """t/R below which an arch of ``n`` voussoirs falls, by bisection to 1e-5."""
    while high - low > 1e-5:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if rest(arch(n, middle)).converged else (middle, high)
    return high


@dataclass(frozen=True, eq=False)
class Seen:
    """Outlines of the springings and voussoirs, and for each joint from the right springing on: its inner and outer
    corner (n + 1, 2, 2), the point where the thrust crosses it (n + 1, 2), nan without a force, and its opening angle,
    rad (positive: open on the outside)."""

    outlines: list[np.ndarray]
    joints: np.ndarray
    thrust: np.ndarray
    opening: np.ndarray


def seen(system: dda.BlockSystem, result: dda.StepResult) -> Seen:
    blocks, state = system.blocks, result.state
    outlines = [blocks.loops(b, state.vertices)[0] for b in range(blocks.n_blocks)]
    joints = np.array([[o[0], o[1]] for o in outlines[1:-1]] + [[outlines[-2][3], outlines[-2][2]]])
    rows = result.contacts[result.contacts["state"] != OPEN]
    thrust = np.full((blocks.n_blocks - 1, 2), np.nan)
    for k in range(blocks.n_blocks - 1):
        here = rows[np.minimum(rows["block"], rows["other"]) == k]
        if here["normal_force"].sum() > 0:
            thrust[k] = np.average(here["point"], axis=0, weights=here["normal_force"])
    return Seen(outlines, joints, thrust, np.diff(state.rotation))


def fall(system: dda.BlockSystem, seconds: float) -> dda.StepResult:
    """The arch ``seconds`` after its centring is removed."""
    state = State.at_rest(system.blocks)
    while state.time < seconds * (1 - 1e-12):
        result = system.step(state, WEIGHT)
        state = result.state
    return result
