"""`dda.run` watches over what it does: it begins at rest where asked to, and is wrong in nothing without saying so."""

from __future__ import annotations

import logging
import re
from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.model import (
    Blocks,
    DdaSettings,
    EdgeTraction,
    Excavation,
    History,
    JointLaw,
    Loads,
    Material,
    State,
    ViscousBoundary,
)

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
BASE = np.array([[-5.0, -1.0], [5.0, -1.0], [5.0, 0.0], [-5.0, 0.0]])
ROCK = Material("rock", 5e9, 0.25, density=2600.0)
JOINT = JointLaw("joint", np.radians(30.0))
WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))
MOVING = DdaSettings(time_step=1e-3, dynamic_factor=1.0)


def on_incline(degrees: float, height: float = 0.0) -> Blocks:
    a = np.radians(degrees)
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    polygons = [BASE @ turn.T, (SQUARE + [0.0, height]) @ turn.T]
    return Blocks.from_polygons(polygons, fixed=[True, False], names=["base", "block"])


def thrown(blocks: Blocks, *velocity: float) -> State:
    state = State.at_rest(blocks)
    state.velocity[1, : len(velocity)] = velocity
    return state


def test_a_run_that_begins_at_equilibrium_moves_nothing():
    blocks = on_incline(29.99)
    states = list(dda.run(blocks, [ROCK], [JOINT], WEIGHT, replace(MOVING, equilibrium="start"), 0.05))
    # Weight over the height at mid-height; then nothing but round-off, a hundredth of a degree above the incline.
    assert np.linalg.norm(states[0].stress[1]) > 0.3 * 2600.0 * 9.81 * 0.5
    assert states[0].time == 0.0 and np.abs(states[-1].vertices - states[0].vertices).max() < 1e-13


def test_a_run_that_has_no_equilibrium_to_begin_from_says_who_moves():
    with pytest.raises(dda.NotConverged, match=r"t = 0 s: no equilibrium: .*'block'"):
        list(dda.run(on_incline(35.0), [ROCK], [JOINT], WEIGHT, replace(MOVING, equilibrium="start"), 0.05))


def test_a_static_run_is_at_rest_at_every_load_whatever_its_steps():
    ramp = Loads(gravity=History.ramp([0.0, -9.81]))
    settings = DdaSettings(time_step=0.25, equilibrium="loads")
    for state in dda.run(on_incline(0.0), [ROCK], [JOINT], ramp, settings, 1.0):
        assert state.stress[1, 1] == pytest.approx(-2600.0 * 9.81 * 0.5 * state.time, rel=1e-6)
    assert state.time == 1.0


def test_steps_to_equilibrium_count_in_the_energy_balance():
    """A square is loaded by its weight in four parts: it does half of what the whole weight would do at once."""
    ramp = Loads(gravity=History.ramp([0.0, -9.81]))
    system = dda.BlockSystem(on_incline(0.0), [ROCK], [JOINT])
    state, budget = State.at_rest(system.blocks), dda.EnergyBudget()
    for time in (0.25, 0.5, 0.75, 1.0):
        found = dda.equilibrium(system, state, ramp, load_time=time)
        state, budget = replace(found.state, time=time), budget.at_rest(found.energies, time)
    sinks = 0.5 - state.vertices[system.vertex_start[1] :, 1].mean()
    assert budget.gravity_work == pytest.approx(0.5 * 2600.0 * 9.81 * sinks, rel=1e-3)
    assert budget.last.stored == pytest.approx(budget.gravity_work, rel=1e-3)
    assert abs(budget.scheme) < 1e-3 * budget.gravity_work and abs(budget.residual) < 1e-6 * budget.gravity_work


def test_energy_from_nowhere_is_told_by_blocks_alone(caplog):
    # Undamped and without its loss, the α-scheme keeps the push of an impact that is over within a step.
    settings = DdaSettings(time_step=1e-3, dynamic_factor=1.0, damping=0.0, spectral_radius=1.0)
    with caplog.at_level(logging.WARNING):
        for _ in dda.run(on_incline(0.0, 0.05), [ROCK], [JOINT], WEIGHT, settings, 0.3):
            pass
    told = [r.getMessage() for r in caplog.records]
    assert any("the blocks have gained" in message for message in told)
    caplog.clear()
    for _ in dda.run(on_incline(0.0, 0.05), [ROCK], [JOINT], WEIGHT, MOVING, 0.3):
        pass
    assert not caplog.records


@pytest.mark.parametrize(("settings", "told"), [(DdaSettings(time_step=1e-3), True), (MOVING, False)])
def test_dashpots_that_statics_do_not_know_are_reported(caplog, settings, told):
    blocks = Blocks.from_polygons([BASE, SQUARE], fixed=[True, False], edge_names=[[[""] * 4], [["", "", "top", ""]]])
    loads = replace(WEIGHT, viscous_boundaries=(ViscousBoundary("top"),))
    for _ in dda.run(blocks, [ROCK], [JOINT], loads, settings, 2e-3):
        pass
    assert ("viscous boundaries have no effect in a static run" in caplog.text) is told


def test_an_excavation_takes_its_energy_along(caplog):
    blocks = Blocks.from_polygons([BASE, SQUARE, SQUARE + [0.0, 1.0]], fixed=[True, False, False])
    loads = replace(WEIGHT, excavations=(Excavation(0.02, blocks=(2,)),))
    *_, state = dda.run(blocks, [ROCK], [JOINT], loads, MOVING, 0.1)
    assert state.removed.tolist() == [False, False, True] and not caplog.records


def test_what_is_crushed_is_told_and_ends_the_run(caplog):
    """At seven times the speed of sound a block went through its base, flat, and nothing was said."""
    blocks = on_incline(0.0, 0.1)
    with pytest.raises(dda.NotConverged, match=r"block is strained by .* beyond linear elasticity"):
        list(dda.run(blocks, [ROCK], [JOINT], Loads(), MOVING, 0.01, state=thrown(blocks, 0.0, -1e4)))
    # Told of beyond 1 %, before the step in which it is strained by a quarter.
    assert re.search(r"block is strained by \d\.\d+ %, beyond the elastic range", caplog.text)


def test_what_steps_crush_to_nothing_is_named():
    names = [[[""] * 4], [["", "", "top", ""]]]
    blocks = Blocks.from_polygons([BASE, SQUARE], fixed=[True, False], edge_names=names, names=["base", "block"])
    loads = Loads(edge_tractions=(EdgeTraction("top", History.constant([0.0, -1e9])),))
    system = dda.BlockSystem(
        blocks, [replace(ROCK, youngs_modulus=1e5)], [JOINT], settings=DdaSettings(max_displacement_ratio=1.0)
    )
    state = State.at_rest(blocks)
    with pytest.raises(dda.NotConverged, match="'block' is compressed to zero area at t = "):
        for _ in range(100):
            state = system.step(state, loads).state


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"velocity": np.zeros((2, 3))},
            r"velocity has the shape \(2, 3\), but 2 blocks with 8 vertices have \(2, 6\)",
        ),
        ({"stress": np.full((2, 3), np.nan)}, "stress is not finite"),
        ({"vertices": np.zeros((4, 2))}, "vertices has the shape"),
    ],
)
def test_a_state_of_other_blocks_is_refused(change, words):
    blocks = on_incline(0.0)
    with pytest.raises(ValueError, match=words):
        next(dda.run(blocks, [ROCK], [JOINT], WEIGHT, MOVING, 1.0, state=replace(State.at_rest(blocks), **change)))


@pytest.mark.parametrize(
    ("excavation", "words"),
    [
        (Excavation(5.0, blocks=("block",)), "at 5 s removes block 'block', but there are 2, numbered from 0"),
        (Excavation(5.0, blocks=(2,)), "at 5 s removes block 2"),
        (Excavation(5.0, polygon=SQUARE + 40.0), "no block's centre lies in the polygon of the excavation at 5 s"),
    ],
)
def test_an_excavation_of_what_is_not_there_is_refused_before_the_run(excavation, words):
    with pytest.raises(ValueError, match=words):
        list(dda.run(on_incline(0.0), [ROCK], [JOINT], replace(WEIGHT, excavations=(excavation,)), MOVING, 0.002))


def test_no_blocks_are_refused():
    with pytest.raises(ValueError, match="no blocks to move"):
        next(dda.run(Blocks.from_polygons([]), [ROCK], [JOINT], WEIGHT, MOVING, 1.0))


def test_states_cannot_be_written_to_and_are_no_copies():
    """What a reader did to a state would be done to the run; gone on with from one, it is the same to the bit."""
    blocks = on_incline(35.0)
    results: list[dda.StepResult] = []
    states = list(dda.run(blocks, [ROCK], [JOINT], WEIGHT, MOVING, 0.02, watch=results.append))
    for state in (states[0], states[-1], results[-1].state):
        for name in ("vertices", "velocity", "stress", "rotation", "crack_strain", "contacts"):
            array = getattr(state, name)
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0
            assert not array.flags.owndata  # a view
    assert states[-1].writable().velocity.flags.writeable and not states[-1].velocity.flags.writeable
    middle = states[10]
    again = list(dda.run(blocks, [ROCK], [JOINT], WEIGHT, MOVING, 0.02, state=middle))
    for name in ("vertices", "velocity"):
        assert np.array_equal(getattr(again[-1], name), getattr(states[-1], name))
    # A step may begin from one as well, which stays as it was.
    result = dda.BlockSystem(blocks, [ROCK], [JOINT], settings=MOVING).step(middle, WEIGHT)
    assert np.array_equal(result.state.vertices, states[11].vertices) and result.state.velocity.flags.writeable
