"""The sixteen blocks of Goodman & Bray (1976): motion by the block solver, equilibrium, and search for the limit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from geomech import dda
from geomech.model import (
    OPEN,
    TIP,
    Blocks,
    Cracks,
    Cycle,
    DdaSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    State,
)  # fmt: skip
from geomech.output import Group, Histories, RunFolder, SceneCopy, Series, Summary, ViewScript
from geomech.reference.slopes import toppling_slope as published

#: Stiff rock: the published calculation has rigid blocks, and the columns lean by elastic deformation.
ROCK = Material("rock", youngs_modulus=1e11, poissons_ratio=0.25, density=2500.0)
WEIGHT = Loads(gravity=History.constant([0.0, -10.0]))  # 25 kN/m³, as published
SETTINGS = DdaSettings(time_step=0.02, dynamic_factor=1.0, max_displacement_ratio=0.01)
#: Between 2 and 2.5 s a stable slope moves less than this, m; one with 0.1 % less friction ten times as much.
STANDS = 2e-4


def slope(friction: float, settings: DdaSettings = SETTINGS) -> dda.BlockSystem:
    """Base and blocks with ``friction`` = tan φ in all joints."""
    outlines = published.polygons()
    blocks = Blocks.from_polygons(
        outlines,
        fixed=[True] + [False] * (len(outlines) - 1),
        names=["base", *(f"block {n}" for n in range(1, len(outlines)))],
    )
    return dda.BlockSystem(blocks, [ROCK], [JointLaw("joints", friction_angle=np.arctan(friction))], settings=settings)


def at_rest() -> State:
    """Equilibrium under the weight with more friction than necessary: the start of every run."""
    system = slope(1.0)
    return dda.equilibrium(system, State.at_rest(system.blocks), WEIGHT).state


def run(system: dda.BlockSystem, state: State, end: float) -> Iterator[dda.StepResult]:
    """Steps until ``end`` s."""
    while state.time < end * (1 - 1e-12):
        result = system.step(state, WEIGHT, min(system.settings.time_step, end - state.time))
        state = result.state
        yield result


def written(
    system: dda.BlockSystem, rest: State, results: Iterator[dda.StepResult], folder: Path
) -> Iterator[dda.StepResult]:
    """``results`` from ``rest`` on, written as a run in ``folder``: series for ParaView and `geomech render`, history."""
    none = Cracks.from_polylines([])
    problem = Problem(
        "A slope of sixteen blocks topples", system.blocks, none, system.materials, system.joints, loads=WEIGHT
    )
    watch = Group([RunFolder(), SceneCopy({"title": problem.title}), Histories(), Series(every=5, interior_every=0),
                   ViewScript(), Summary()])  # fmt: skip
    watch.on_start(problem, folder)
    number, summary = 0, {"title": problem.title, "end": "end of the run"}

    def cycle(state: State) -> Cycle:
        return Cycle(number, number, 0, 0.0, np.nan, system.blocks, state, none, np.zeros(0, TIP))

    watch.on_cycle(cycle(rest))
    for result in results:
        number += 1
        watch.on_cycle(cycle(result.state))
        yield result
    watch.on_end(summary)


def creep(friction: float, rest: State) -> float:
    """Largest displacement of a corner between 2 and 2.5 s, m, when the friction drops to ``friction`` at rest."""
    system = slope(friction)
    early = last(run(system, rest, 2.0)).state
    return float(np.abs(last(run(system, early, 2.5)).state.vertices - early.vertices).max())


def limit_friction(rest: State, low: float = 0.75, high: float = 0.83) -> float:
    """tan φ at which the slope is just stable, by bisection to 2e-4."""
    while high - low > 2e-4:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if creep(middle, rest) < STANDS else (middle, high)
    return high


def factor_of_safety(friction: float) -> float:
    """By strength reduction from ``friction`` = tan φ."""
    system = slope(friction)
    return dda.factor_of_safety(system.blocks, system.materials, system.joints, WEIGHT).factor


def forces(result: dda.StepResult) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(R, S, P), each (16,) kN of blocks 1 … 16: base normal and shear (up the dip), and the push of the block
    above."""
    rows = result.contacts[result.contacts["state"] != OPEN]
    normal = rows["normal"]
    force = rows["normal_force"][:, None] * normal
    force += rows["shear_force"][:, None] * np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    dip = np.radians(published.BASE_DIP_DEG)
    uphill, up = np.array([np.cos(dip), np.sin(dip)]), np.array([-np.sin(dip), np.cos(dip)])
    base, push = np.zeros((17, 2)), np.zeros(18)
    for block, other, on_block in zip(rows["block"], rows["other"], force):
        low, high = sorted((block, other))
        on_high = on_block if block == high else -on_block
        if low == 0:
            base[high] += on_high @ up, on_high @ uphill
        else:
            push[high] += on_high @ uphill
    return base[1:, 0] / 1e3, base[1:, 1] / 1e3, push[2:] / 1e3


def modes(system: dda.BlockSystem, rest: State, state: State) -> list[str]:
    """Motion of each of blocks 1 … 16 since ``rest``: "slides", "topples" or "stands"."""
    moved = state.vertices - rest.vertices
    most = np.hypot(*moved.T).max()
    out = []
    for n in range(1, system.blocks.n_blocks):
        own = slice(system.blocks.vertex_start[n], system.blocks.vertex_start[n + 1])
        turn = abs(state.rotation[n] - rest.rotation[n]) * np.sqrt(np.ptp(rest.vertices[own], axis=0).prod())
        if np.hypot(*moved[own].T).max() < 0.02 * most:
            out.append("stands")
        else:
            out.append("topples" if turn > 0.1 * np.hypot(*moved[own].T).max() else "slides")
    return out


def last(results: Iterator[dda.StepResult]) -> dda.StepResult:
    for result in results:
        kept = result
    return kept
