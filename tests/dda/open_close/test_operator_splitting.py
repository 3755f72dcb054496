"""Contact states by operator splitting: what it proposes, and that the motion is the same without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.dda import time_step
from geomech.dda.open_close import iteration
from geomech.dda.open_close.operator_splitting import can_split, split
from geomech.model import Blocks, ContactSolver, State

#: s
STEP = 5e-3


@pytest.fixture(scope="module")
def struck() -> tuple[Blocks, State]:
    """A wall at rest, and a brick on it that comes down with 10 m/s."""
    blocks = block_scenes.with_loose_brick(block_scenes.wall(120))
    state = block_scenes.at_rest(blocks)
    velocity = state.velocity.copy()
    velocity[-1, 1] = -10.0
    return blocks, replace(state, velocity=velocity)


def system_of(blocks: Blocks, **solver) -> dda.BlockSystem:
    settings = replace(block_scenes.settings(STEP), contact_solver=ContactSolver(**solver))
    return dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)


def moved(blocks: Blocks, state: State, steps: int, **solver) -> list[State]:
    system, states = system_of(blocks, **solver), []
    for _ in range(steps):
        state = system.step(state, block_scenes.WEIGHT).state
        states.append(state)
    return states


def searched(blocks: Blocks, state: State, steps: int, monkeypatch) -> list[tuple]:
    """The equations and bonds for which states were sought by splitting, and with what they settled."""
    found, settle, begun = [], time_step.settle, []
    propose = iteration.split

    def proposing(equations, bonded, solver):
        begun.append((equations, bonded))
        return propose(equations, bonded, solver)

    def settling(equations, *rest):
        begun.clear()
        settled = settle(equations, *rest)
        found.extend((*each, settled) for each in begun if each[0] is equations)
        return settled

    monkeypatch.setattr(iteration, "split", proposing)
    monkeypatch.setattr(time_step, "settle", settling)
    moved(blocks, state, steps)
    return found


def test_it_leads_to_the_states_that_fit(struck, monkeypatch):
    # Up to two thirds of all contacts change in a step. Two hundred turns find all but a quarter of these changes
    # (measured: all but 5 to 21 in a hundred), and all but an eighth of all states.
    found = searched(*struck, 5, monkeypatch)
    assert found
    for equations, bonded, settled in found:
        proposal = split(equations, bonded, ContactSolver(splitting_settled=-1.0, splitting_iterations=200))
        changes = settled.state != equations.found.state
        wrong = settled.state != proposal.states.state
        assert wrong.sum() < 0.25 * changes.sum() and wrong.mean() < 0.125
        # (Four factorisations; a turn takes a tenth of an iteration.)
        assert proposal.spent == pytest.approx(24.0)


def test_the_motion_is_the_same_without_it(struck):
    with_it, without = moved(*struck, 5), moved(*struck, 5, splitting=False)
    for one, two in zip(with_it, without, strict=True):
        assert np.abs(one.vertices - two.vertices).max() < 1e-10
        assert np.abs(one.velocity - two.velocity).max() < 1e-6


def test_it_is_for_steps_that_move(struck, monkeypatch):
    equations, *_ = searched(*struck, 3, monkeypatch)[0]
    assert can_split(equations)
    assert not can_split(replace(equations, statics=True))
    # Nor is there anything to begin with where no contact bore anything before.
    found = equations.found
    assert not can_split(replace(equations, found=replace(found, normal=np.zeros(len(found)))))
