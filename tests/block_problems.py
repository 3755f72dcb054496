"""Block systems that the validation of the block solver shares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State

GRAVITY = 9.81
WEIGHT = Loads(gravity=History.constant([0.0, -GRAVITY]))


def rectangle(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)


def turned(polygon: np.ndarray, angle: float) -> np.ndarray:
    """``polygon`` (n, 2) turned about the origin, counter-clockwise."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(polygon) @ np.array([[c, s], [-s, c]])


def system_of(
    polygons, joints: list[JointLaw] | float, *, rock: Material | None = None, fixed: int = 1, joint_index=None,
    names=None,
    **settings,
) -> dda.BlockSystem:  # fmt: skip
    """Blocks of one rock, the first ``fixed`` of them fixed; ``joints`` may be one friction angle (rad). Dynamic steps
    unless ``settings`` say otherwise."""
    blocks = Blocks.from_polygons(polygons, fixed=[True] * fixed + [False] * (len(polygons) - fixed), edge_names=names)
    laws = joints if isinstance(joints, list) else [JointLaw("joint", friction_angle=joints)]
    return dda.BlockSystem(
        blocks, [rock or Material("rock", 10e9, 0.25, density=2600.0)], laws, joint_index,
        DdaSettings(**{"dynamic_factor": 1.0, "max_displacement_ratio": 0.05, **settings}),
    )  # fmt: skip


def march(
    system: dda.BlockSystem, state: State, loads: Loads, end: float, dt: float, watch: Callable | None = None
) -> State:
    """``state`` at time ``end``; ``watch(result)`` sees every step."""
    while state.time < end * (1 - 1e-12):
        result = system.step(state, loads, min(dt, end - state.time))
        state = result.state
        if watch is not None:
            watch(result)
    return state


def settled(
    system: dda.BlockSystem, loads: Loads = WEIGHT, steps: int = 5, dt: float = 1.0, joint_index: Callable | None = None
) -> State:
    """Static equilibrium under ``loads``, at time zero and at rest."""
    still = dda.BlockSystem(
        system.blocks, system.materials, system.joints, joint_index, replace(system.settings, dynamic_factor=0.0)
    )
    state = State.at_rest(system.blocks)
    for _ in range(steps):
        state = still.step(state, loads, dt).state
    return replace(state, time=0.0, velocity=np.zeros_like(state.velocity))


def moved(system: dda.BlockSystem, state: State) -> np.ndarray:
    """(n_blocks, 2) m, displacement of the blocks' mean vertices from their reference positions."""
    blocks = system.blocks
    return blocks.mean_vertices(state.vertices) - blocks.mean_vertices(blocks.vertices)
