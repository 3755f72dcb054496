"""Blocks of order 3 at extremes: contrasts of stiffness, stiffness of contacts and time step; right, reported or refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import rectangle

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State

WEIGHT = Loads(gravity=History.constant((0.0, -9.81)))
E, DENSITY = 2e10, 2500.0


def stack(upper: float = E, order: int = 3, **settings) -> dda.BlockSystem:
    """Two blocks of 2 m by 1 m on fixed rock, the upper one with the modulus ``upper``, Pa."""
    polygons = [rectangle(-3, -1, 3, 0), rectangle(-1, 0, 1, 1), rectangle(-1, 1, 1, 2)]
    blocks = replace(
        Blocks.from_polygons(polygons, fixed=[1, 0, 0], order=[1, order, order]), material=np.array([0, 0, 1])
    )
    given = {"dynamic_factor": 0.0, "time_step": 10.0, "max_displacement_ratio": 1.0} | settings
    rocks = [Material("rock", E, 0.0, DENSITY), Material("other", upper, 0.0, DENSITY)]
    return dda.BlockSystem(blocks, rocks, [JointLaw("joint", 0.6)], settings=DdaSettings(**given))


def errors(system: dda.BlockSystem, steps: int = 2) -> np.ndarray:
    """Errors of the force on the ground and of the mean stress of both blocks, over those of their weight."""
    state = State.at_rest(system.blocks)
    for _ in range(steps):
        state = system.step(state, WEIGHT).state
    rows = state.contacts
    force = rows["normal_force"][(rows["block"] == 0) | (rows["other"] == 0)].sum()
    found = np.array([force / 4, -state.stress[1, 1] / 1.5, -state.stress[2, 1] / 0.5])
    return found / (DENSITY * 9.81) - 1


@pytest.mark.parametrize("contrast", [1e-3, 1e3, 1e6])
def test_a_contrast_of_stiffness(contrast):
    assert np.abs(errors(stack(contrast * E))).max() < 1e-6


def test_a_block_too_soft_for_its_weight_is_refused():
    with pytest.raises(dda.NotConverged, match="too much for small-displacement theory"):
        errors(stack(1e-6 * E))


@pytest.mark.parametrize("penalty", [0.1, 1.0, 1e3, 1e5])
def test_a_stiffness_of_contacts(penalty):
    springs = penalty * E
    assert np.abs(errors(stack(normal_penalty=springs, shear_penalty=springs))).max() < 1e-4


@pytest.mark.parametrize("dynamic", [0.0, 1.0])
@pytest.mark.parametrize("dt", [1.0, 10.0, 1000.0])
def test_long_steps_find_equilibrium(dynamic, dt):
    assert np.abs(errors(stack(dynamic_factor=dynamic, time_step=dt))).max() < 1e-4


@pytest.mark.parametrize("dt", [1e-6, 1e-4])
def test_in_short_steps_blocks_fall_before_they_are_borne(dt):
    """Energy that is there is the work of the weight, and what the scheme has taken."""
    system = stack(dynamic_factor=1.0, time_step=dt)
    state = State.at_rest(system.blocks)
    for _ in range(20):
        result = system.step(state, WEIGHT)
        state = result.state
        assert abs(result.energy.residual) < 1e-9 * max(result.energy.kinetic + result.energy.elastic, 1e-30)
    fallen = 0.5 * 9.81 * state.time**2
    assert 0 < -(state.vertices - system.blocks.vertices)[-4:, 1].mean() < 1.001 * fallen
