"""Sliding that friction stops within a step leaves no speed behind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.dda import time_step
from geomech.dda.energy_balance import EnergyBudget
from geomech.dda.joint_laws import friction_arrest
from geomech.dda.joint_laws.friction_arrest import dissipating
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State

GRAVITY, FRICTION = 9.81, 0.5
WEIGHT = Loads(gravity=History.constant([0.0, -GRAVITY]))


def stacked(polygons, speeds, frictions=(FRICTION,), **settings) -> tuple[dda.BlockSystem, State]:
    """Blocks on a fixed base, at rest under their weight but for horizontal ``speeds`` (m/s)."""
    blocks = Blocks.from_polygons(
        [rectangle(-20, -1, 20, 0), *polygons], fixed=[True] + [False] * len(polygons),
        edge_names=[[["base"] * 4]] + [[["rock"] * 4]] * len(polygons),
    )  # fmt: skip
    joints = [JointLaw(f"joint {f:g}", friction_angle=np.arctan(f)) for f in frictions]
    system = dda.BlockSystem(
        blocks, [Material("rock", 20e9, 0.0, density=2600.0)], joints,
        lambda a, b: 0 if a == b or len(joints) == 1 else 1,
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.5, **settings),
    )  # fmt: skip
    state = dda.equilibrium(system, State.at_rest(blocks), WEIGHT).state
    velocity = np.zeros_like(state.velocity)
    velocity[1:, 0] = speeds
    return system, replace(state, velocity=velocity, acceleration=None)


@pytest.mark.parametrize("newmark", [(0.5, 1.0), (0.25, 0.5)])
@pytest.mark.parametrize("part", [0.1, 0.45, 0.55, 0.9])
def test_a_block_that_stops_within_a_step_stays_stopped(part, newmark):
    # It stops ``part`` of a step after some whole ones; before, it was left with a speed of up to μ g dt / 2 and kept
    # it.
    dt, steps = 0.01, 5
    start = FRICTION * GRAVITY * dt * (steps + part)
    system, state = stacked([rectangle(0, 0, 1, 0.5)], [start], newmark=newmark)
    budget, place = EnergyBudget(), system.blocks.mean_vertices(state.vertices)[1, 0]
    speeds = []
    for _ in range(steps + 4):
        result = system.step(state, WEIGHT, dt)
        budget, state = budget.after(result.energy, result.state.time), result.state
        speeds.append(abs(state.velocity[1, 0]) / (FRICTION * GRAVITY * dt))
    print(f"stops {part} of a step on: speeds over μ g dt {np.round(speeds[-5:], 5)}")
    # Rocking on its springs as friction lets go, the block moves by some thousandths of that.
    assert max(speeds[-4:]) < 0.02
    went = system.blocks.mean_vertices(state.vertices)[1, 0] - place
    way = start**2 / (2 * FRICTION * GRAVITY)
    # Within the step in which it stops the way is off by at most μ g dt² / 8.
    assert went == pytest.approx(way, abs=0.13 * FRICTION * GRAVITY * dt * dt)
    assert budget.friction == pytest.approx(0.5 * 1300 * start**2, rel=0.05)
    assert abs(budget.residual) < 1e-3 * 0.5 * 1300 * start**2


@pytest.mark.parametrize("dt", [0.02, 0.005])
def test_blocks_that_come_to_slide_together_keep_their_momentum(dt):
    # A block thrown on a plank that lies on a base without friction: both end with the speed of their common centroid.
    thrown = 1.0
    system, state = stacked(
        [rectangle(-4, 0, 4, 0.5), rectangle(-0.5, 0.5, 0.5, 1.0)], [0.0, thrown], frictions=(FRICTION, 0.0)
    )
    mass = 2600 * np.array([4.0, 0.5])
    budget = EnergyBudget()
    while state.time < 0.3:
        result = system.step(state, WEIGHT, dt)
        budget, state = budget.after(result.energy, result.state.time), result.state
    common = mass[1] * thrown / mass.sum()
    print(f"dt = {dt:g} s: {state.velocity[1:, 0]}, common {common:.5f} m/s, friction {budget.friction:.1f} J/m")
    assert mass @ state.velocity[1:, 0] == pytest.approx(mass[1] * thrown, rel=1e-9)
    # It stopped with up to μ g dt / 2 = 0.05 and 0.012 m/s between the two.
    assert state.velocity[1:, 0] == pytest.approx(common, abs=5e-4)
    assert budget.friction == pytest.approx(0.5 * mass[0] * mass[1] / mass.sum() * thrown**2, rel=0.01)


def test_what_would_gain_energy_is_cut():
    moments = np.array([[2.0, 0.0, 0.0, 0.3, 0.2, 0.05]])
    velocity = np.array([[1.0, 0, 0, 0, 0, 0]])
    none = np.array([False])
    for change, part in ((-1.0, 1.0), (-2.0, 1.0), (-4.0, 0.5), (0.5, 0.0)):
        kept, lost = dissipating(change * velocity, velocity, moments, np.array([3.0]), none)
        assert kept == pytest.approx(part * change * velocity)
        assert lost == pytest.approx(0.5 * 6.0 * (1.0 - (1.0 + part * change) ** 2)) and lost >= 0.0


def test_what_a_sliding_brick_shakes_is_not_stopped_by_itself(monkeypatch):
    # A brick slides on a wall and stops. What it shakes of the bricks' contacts at their strength, by 1e-11 m, was
    # stopped in nearly every step, for three more solutions of all equations and the same motion.
    blocks = block_scenes.with_loose_brick(block_scenes.wall(60))
    start, thrown, solved = block_scenes.at_rest(blocks), 0.4, []
    velocity = start.velocity.copy()
    velocity[-1, 0] = thrown
    monkeypatch.setattr(time_step, "stop", lambda *given: solved.append(1) or friction_arrest.stop(*given))
    told = []
    for worth in (friction_arrest.LITTLE, 0.0):
        monkeypatch.setattr(friction_arrest, "LITTLE", worth)
        system = dda.BlockSystem(
            blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=block_scenes.settings(0.01)
        )
        state, budget = replace(start, velocity=velocity), EnergyBudget()
        solved.clear()
        for _ in range(15):
            result = system.step(state, WEIGHT)
            budget, state = budget.after(result.energy, result.state.time), result.state
        told.append((len(solved), state, budget))
    (few, state, budget), (many, other, whole) = told
    apart = np.abs(state.vertices - other.vertices).max()
    speeds = [float(np.abs(one.velocity[:, :2]).max()) for one in (state, other)]
    lost = 0.5 * 1300 * thrown**2
    print(f"stopped in {few} steps, else in {many}: {apart:.2g} m apart, at last {speeds} m/s, {budget.friction} J/m")
    # In few of the steps: those in which something does come to a stop.
    assert 0 < few <= many and few <= 15 / 2
    way = thrown**2 / (2 * np.tan(block_scenes.FRICTION) * GRAVITY)
    assert apart < 1e-6 * way
    assert max(speeds) < 2e-3
    # What is shaken is left to the scheme to damp, not to friction.
    assert budget.friction == pytest.approx(whole.friction, abs=1e-5 * lost)
    assert budget.friction + budget.scheme == pytest.approx(whole.friction + whole.scheme, abs=1e-7 * lost)
    assert abs(budget.residual) < 1e-6 * lost
