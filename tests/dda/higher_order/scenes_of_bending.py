"""Small systems of blocks of higher order, and what is looked at in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from block_problems import turned

from geomech import dda
from geomech.dda.higher_order.bent_body import bent_bodies
from geomech.model import Blocks, DdaSettings, JointLaw, Loads, Material, Motion, State

ROCK = Material("rock", 2e10, 0.25, 2500.0)


def rectangle(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], float)


def system_of(polygons, fixed, order, *, joint=None, rock=ROCK, angle=0.0, loaded=None, **settings) -> dda.BlockSystem:
    """Rectangles and the like, turned by ``angle``; ``loaded`` (block, edge) is called "loaded". Static in steps of 10 s
    unless said otherwise."""
    names = [[[""] * len(polygon)] for polygon in polygons]
    if loaded is not None:
        names[loaded[0]][0][loaded[1]] = "loaded"
    blocks = Blocks.from_polygons(
        [turned(polygon, angle) for polygon in polygons], fixed=fixed, order=order, edge_names=names
    )
    given = {"dynamic_factor": 0.0, "time_step": 10.0, "max_displacement_ratio": 1.0} | settings
    return dda.BlockSystem(blocks, [rock], [joint or JointLaw("joint", 0.6)], settings=DdaSettings(**given))


def after(system: dda.BlockSystem, loads: Loads, steps: int, state: State | None = None, **changes) -> dda.StepResult:
    """The last of so many ``steps``."""
    state = replace(State.at_rest(system.blocks) if state is None else state, **changes)
    for _ in range(steps):
        result = system.step(state, loads)
        state = result.state
    return result


def body_of(system: dda.BlockSystem, state: State, block: int):
    motion = Motion.of(system.blocks, state.vertices)
    return bent_bodies(system.deflected, state, motion)[block]


def moved(system: dda.BlockSystem, state: State, block: int, point) -> np.ndarray:
    """(2,) m: displacement of the undeformed ``point`` of a bending block."""
    motion = Motion.of(system.blocks, state.vertices)
    return motion.current(block, point) - point + body_of(system, state, block).deflection(np.array([point]))[0]
