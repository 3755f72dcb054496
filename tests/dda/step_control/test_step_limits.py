"""What steps may move belongs to pairs of near blocks: not to slivers elsewhere, nor to how the model lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from block_problems import rectangle, turned

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State

ROCK = Material("rock", 10e9, 0.25, density=2600.0)
WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))


def steps(polygons, fixed, end, velocity, loads=WEIGHT, dt=0.05, friction=0.0, **settings):
    """(steps until ``end``, the last state, the system) of blocks of which the second is thrown with ``velocity``."""
    blocks = Blocks.from_polygons(polygons, fixed=fixed)
    system = dda.BlockSystem(
        blocks, [ROCK], [JointLaw("joint", friction)],
        settings=DdaSettings(time_step=dt, dynamic_factor=1.0, **settings),
    )  # fmt: skip
    state, count = State.at_rest(blocks), 0
    state.velocity[1, :2] = velocity
    while state.time < end * (1 - 1e-12):
        state, count = system.step(state, loads, min(dt, end - state.time)).state, count + 1
    return count, state, system


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2])
def test_a_fast_slide_takes_as_many_steps_however_the_model_lies(angle):
    """A block of 1 m slides 6.5 m at 6.5 m/s on a base 200 m long: a tenth of its size a step is 65 steps, or fewer
    beside a base that is larger. Without friction it keeps its speed: to 1e-6, what its landing on springs leaves."""
    g = 9.81 * np.array([np.sin(angle), -np.cos(angle)])
    polygons = [turned(p, angle) for p in (rectangle(-20, -1, 180, 0), rectangle(0, 0, 1, 1))]
    along = np.array([np.cos(angle), np.sin(angle)])
    count, state, _ = steps(polygons, [True, False], 1.0, 6.5 * along, Loads(gravity=History.constant(g)))
    assert count <= 66
    went = (state.vertices - np.concatenate(polygons))[4:].mean(axis=0) @ along
    assert went == pytest.approx(6.5, rel=1e-6)


def test_two_sticks_in_free_flight_move_by_what_the_setting_allows():
    """Far from each other nothing but max_displacement_ratio limits them, in units of half the diagonal, 10 m here: a
    flight of 4.9 m takes as many steps of 0.1 m as the way from rest is long, and ends where Galilei's does (exact in
    this scheme, to round-off)."""
    polygons = [rectangle(0, 0, 2, 0.01), rectangle(18, 0, 20, 0.01)]
    count, state, _ = steps(polygons, [False, False], 1.0, (0.0, 0.0), dt=1e-2)
    assert count <= 105
    assert (state.vertices[:, 1] - np.concatenate(polygons)[:, 1]).mean() == pytest.approx(-0.5 * 9.81, rel=1e-9)


def test_a_sliver_elsewhere_shortens_no_step():
    """A millimetre's sliver on the ground, far from a block that slides past nothing."""
    polygons = [rectangle(-20, -1, 180, 0), rectangle(0, 0, 1, 1)]
    sliver = rectangle(100, 0, 100.05, 0.001)
    alone = steps(polygons, [True, False], 0.5, (6.5, 0.0))[0]
    beside = steps([*polygons, sliver], [True, False, False], 0.5, (6.5, 0.0))[0]
    assert beside == alone


def test_what_shortens_steps_is_counted_by_its_blocks():
    polygons = [rectangle(-20, -1, 180, 0), rectangle(0, 0, 1, 1)]
    count, _, system = steps(polygons, [True, False], 0.5, (6.5, 0.0), max_displacement_ratio=1.0)
    (why, *blocks), often = system.work.shortened.most_common(1)[0]
    assert (why, sorted(blocks)) == ("relative motion", ["block 0", "block 1"])
    assert often == pytest.approx(count, abs=2)


def test_blocks_that_already_overlap_are_not_pushed_apart_in_ever_shorter_steps():
    """A block a centimetre deep in another, where no contact was before (another block has one): a contact searched within
    millimetres finds it, and no shorter step would find it earlier. The step is accepted, its energy counted as brought in
    by an overlap."""
    polygons = [rectangle(-5, -1, 5, 0), rectangle(0, 0, 1, 1), rectangle(3, 0, 4, 1)]
    blocks = Blocks.from_polygons(polygons, fixed=[True, False, False])
    settings = DdaSettings(time_step=0.005, dynamic_factor=1.0)
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("joint")], settings=settings)
    state = system.step(State.at_rest(blocks), WEIGHT, 0.005).state
    vertices, contacts = state.vertices.copy(), state.contacts
    vertices[4:8, 1] -= 0.01
    state = replace(state, vertices=vertices, contacts=contacts[(contacts["block"] == 2) | (contacts["other"] == 2)])
    result = system.step(state, WEIGHT, 0.005)
    assert result.state.time - state.time == pytest.approx(0.005)
    assert result.energy.overlap > 1e3
