"""What steps of blocks at rest cost: nothing moves, so the equations of the last step serve the next."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.bench.cost.block_scenes import JOINT, ROCK, WEIGHT
from geomech.dda.kinematics.roundoff import undecided_gaps
from geomech.model import SLIP, Blocks, DdaSettings, History, JointLaw, Loads, Material, State


@pytest.mark.parametrize("make", [block_scenes.wall, block_scenes.slope])
def test_blocks_at_rest_are_not_factored_again(make):
    # Joints that carry nothing slide by round-off, this way or that: the matrix knows of the way by their friction.
    blocks = make(150)
    state = block_scenes.at_rest(blocks)
    system = dda.BlockSystem(blocks, [ROCK], [JOINT], settings=block_scenes.settings(0.01))
    state = system.step(state, WEIGHT).state
    begun = system.work.factorisations
    assert begun >= 1 and (state.contacts["state"] == SLIP).any()
    before = state.vertices.copy()
    for _ in range(8):
        state = system.step(state, WEIGHT).state
    assert system.work.factorisations <= begun + 1
    assert np.abs(state.vertices - before).max() < 1e-12


@pytest.mark.parametrize("make", [block_scenes.wall, block_scenes.slope])
def test_rounding_of_coordinates_changes_no_contact_of_blocks_at_rest(make):
    blocks = make(500)
    state = block_scenes.at_rest(blocks)
    system = dda.BlockSystem(blocks, [ROCK], [JOINT], settings=block_scenes.settings(0.01))
    for _ in range(30):
        before = state
        result = system.step(state, WEIGHT)
        state = result.state
        assert result.statistics["open_close_iterations"] == 1
        # One substitution is as good as an answer from nothing.
        assert result.statistics["unbalanced"] <= 1e-12
    assert system.work.factorisations == 1
    fresh = dda.BlockSystem(blocks, [ROCK], [JOINT], settings=block_scenes.settings(0.01)).step(before, WEIGHT)
    assert np.abs(fresh.state.vertices - state.vertices).max() <= 4.0 * system.rounding
    force = np.abs(fresh.contacts["normal_force"]).max()
    assert np.abs(fresh.contacts["normal_force"] - result.contacts["normal_force"]).max() <= 1e-11 * force


def test_a_pebble_far_from_the_origin_slides_and_is_told_of_its_rounding(caplog):
    # Springs feel the last digits of coordinates: what they make of a millimetre of rock at 60 m is half its weight.
    slope, side = np.radians(30.0), 1e-3
    turn = np.array([[np.cos(slope), np.sin(slope)], [-np.sin(slope), np.cos(slope)]])
    base = np.array([[-60.0, -10.0], [60.0, -10.0], [60.0, 0.0], [-60.0, 0.0]])
    pebble = np.array([[4.0, 0.0], [4.0 + side, 0.0], [4.0 + side, side], [4.0, side]])
    blocks = Blocks.from_polygons([base @ turn, pebble @ turn], fixed=[True, False])
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)], [JointLaw("joint", friction_angle=np.radians(15.0))],
        settings=DdaSettings(dynamic_factor=1.0, time_step=1e-3),
    )  # fmt: skip
    state = State.at_rest(blocks)
    while state.time < 0.05:
        state = system.step(state, Loads(gravity=History.constant([0.0, -9.81]))).state
    slid = (state.vertices - blocks.vertices)[4:].mean(axis=0) @ -turn[0]
    exact = 0.5 * 9.81 * (np.sin(slope) - np.cos(slope) * np.tan(np.radians(15.0))) * state.time**2
    # A few of the block's own shortenings, ρ g h²/E = 2.6e-12 m, beside 3.3 mm.
    assert abs(slid - exact) < 1e-6 * exact
    assert [r.levelname for r in caplog.records if "put the origin near" in r.message] == ["WARNING"]


def test_round_off_that_weighs_more_than_a_sliver_does_not_let_its_contacts_pull():
    """A block of 20 t and a sliver of 9 kg on springs of 1.5e12 N/m²; round-off of 6e-15 m makes 0.009 N."""
    rounding, loads = 6e-15, np.zeros((2, 6))
    loads[:, 1] = -2e5, -90.0
    pair = np.array([0, 1]), np.array([2, 0])
    gaps = undecided_gaps(rounding, loads, np.array([0, 1, -1]), *pair, np.full(2, 1.5e12))
    assert gaps[0] == 4.0 * rounding
    assert gaps[1] * 1.5e12 == pytest.approx(1e-6 * 90.0)
