"""What steps of blocks at rest cost: nothing moves, so the equations of the last step serve the next."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.bench import block_scenes
from geomech.bench.block_scenes import JOINT, ROCK, WEIGHT
from geomech.dda import assembly
from geomech.model import SLIP, State


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
def test_rows_filled_again_where_contacts_have_changed_are_those_of_all_filled_anew(make, monkeypatch):
    def states():
        blocks, found = make(150), []
        system = dda.BlockSystem(blocks, [ROCK], [JOINT], settings=block_scenes.settings(0.01))
        state = State.at_rest(blocks)
        for _ in range(3):
            state = system.step(state, WEIGHT).state
            found.append(state)
        return found

    filled = []
    again = assembly._fill_again
    monkeypatch.setattr(assembly, "_fill_again", lambda *given: filled.append(again(*given)) or filled[-1])
    some = states()
    assert any(filled)
    monkeypatch.setattr(assembly, "FILLED_AGAIN", -1.0)
    filled.clear()
    for state, other in zip(some, states(), strict=True):
        assert np.array_equal(state.vertices, other.vertices)
        assert np.array_equal(state.contacts, other.contacts)
    assert not any(filled)


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
