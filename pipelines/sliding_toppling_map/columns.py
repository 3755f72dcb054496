"""Columns on an incline, from squat to slender, from smooth to rough: the motion of each when it is released."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from geomech.reference.blocks.block_on_incline import MODES

INCLINE = np.radians(30.0)
GRAVITY = 9.81
#: Stiff, so that elastic shortening is small compared with the first motion; ν = 0, so that the base does not widen.
ROCK = Material("rock", youngs_modulus=1e13, poissons_ratio=0.0, density=2600.0)
WEIGHT = Loads(gravity=History.constant([0.0, -GRAVITY]))
SETTINGS = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=1.0)
STEP = 0.005  # s: one step, in which columns tilt by 1e-4 at most
#: Threshold of motion; it shifts boundaries by a hundredth of a degree.
LEAST = 2e-4 * GRAVITY


def start(slenderness: float, friction: float) -> tuple[float, float]:
    """(acceleration of the toe down the incline m/s², angular acceleration rad/s²) of a column 1 m high at rest.

    ``slenderness`` δ and ``friction`` φ in rad; the width is tan δ.
    """
    turn = np.array([[np.cos(INCLINE), np.sin(INCLINE)], [-np.sin(INCLINE), np.cos(INCLINE)]])
    width = np.tan(slenderness)
    ground = np.array([[-2.0, -1.0], [3.0, -1.0], [3.0, 0.0], [-2.0, 0.0]]) @ turn
    column = np.array([[0.0, 0.0], [width, 0.0], [width, 1.0], [0.0, 1.0]]) @ turn
    blocks = Blocks.from_polygons([ground, column], fixed=[True, False], names=["ground", "column"])
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("base", friction_angle=friction)], settings=SETTINGS)
    state = system.step(State.at_rest(blocks), WEIGHT, STEP).state
    downhill = -np.array([np.cos(INCLINE), np.sin(INCLINE)])
    toe = (state.vertices - blocks.vertices)[4] @ downhill
    return 2 * toe / state.time**2, 2 * state.rotation[1] / state.time**2


def mode(slenderness: float, friction: float) -> str:
    slides, topples = (rate > LEAST for rate in start(slenderness, friction))
    return MODES[int(slides) + 2 * int(topples)]


def boundary(moves: Callable[[float], bool], low: float, high: float) -> float:
    """The angle where ``moves`` turns from True (``low``) to False, by bisection to 0.001°."""
    while high - low > np.radians(1e-3):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if moves(middle) else (low, middle)
    return 0.5 * (low + high)


def slides_below(slenderness: float) -> float:
    """The friction angle below which the toe slides."""
    return boundary(lambda friction: start(slenderness, friction)[0] > LEAST, np.radians(0.5), np.radians(60))


def topples_above(slenderness: float) -> float:
    """The friction angle above which a column that slides also topples; for δ < α."""
    return boundary(lambda friction: start(slenderness, friction)[1] <= LEAST, np.radians(0.2), np.radians(60))


def topples_below(friction: float) -> float:
    """The slenderness angle below which a column that does not slide topples; for φ > α."""
    return boundary(lambda slenderness: start(slenderness, friction)[1] > LEAST, np.radians(5), np.radians(60))
