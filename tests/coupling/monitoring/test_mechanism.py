"""Blocks of a static run that nothing holds are told of, once, by name; those that rest are not."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.coupling import cycles
from geomech.coupling.monitoring.mechanism import Mechanism, loads_are_steady
from geomech.model import (
    GROUND,
    Blocks,
    Bolt,
    Cracks,
    DdaSettings,
    Excavation,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
    State,
)
from geomech.output.tables.motion_state import condition

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def on_a_slope(angle_deg: float, friction_deg: float, gravity=None, **run) -> Problem:
    """A block on a base whose top is level, and a weight that is turned instead; a second block is walled in."""
    tilt = np.radians(angle_deg)
    weight = History.constant(9.81 * np.array([np.sin(tilt), -np.cos(tilt)])) if gravity is None else gravity
    base = np.array([[-1, -2], [6, -2], [6, 1], [5, 1], [5, 0], [-1, 0]], float)
    blocks = Blocks.from_polygons(
        [base, SQUARE, SQUARE + [4, 0]], fixed=[True, False, False], names=["base", "slider", "walled in"]
    )
    return Problem(
        title="slope",
        blocks=blocks,
        cracks=Cracks.from_polylines([], block=[]),
        materials=(Material("rock", 5e9, 0.25, density=2600.0),),
        joints=(JointLaw("joint", friction_angle=np.radians(friction_deg)),),
        loads=Loads(gravity=weight),
        dda=DdaSettings(time_step=0.01),
        run=RunSettings(end_time=0.2, **run),
    )


def test_a_sliding_block_is_named_once(caplog):
    with caplog.at_level(logging.WARNING, "geomech"):
        found = [event for cycle in cycles(on_a_slope(30.0, 20.0)) for event in cycle.events]
    assert [event.kind for event in found] == ["mechanism"]
    assert "nothing holds slider: " in found[0].detail
    # Of its weight and the base's push, what Coulomb leaves over: sin 30° − cos 30° tan 20°, over 1 + cos 30°/cos 20°.
    left_over = 0.5 - np.sqrt(0.75) * np.tan(np.radians(20))
    expected = 100 * left_over / (1 + np.sqrt(0.75) / np.cos(np.radians(20)))
    assert float(found[0].detail.split(": ")[1].split()[0]) == pytest.approx(expected, rel=0.03)
    (warning,) = [record.getMessage() for record in caplog.records]
    assert f"cycle {found[0].cycle}, t = {found[0].time:g} s" in warning and "dda.dynamic_factor" in warning


@pytest.mark.parametrize(("friction_deg", "warns"), [(20.0, True), (40.0, False)])
def test_a_run_that_ends_out_of_balance_says_so(caplog, friction_deg, warns):
    """Three steps are too few to call what slides a mechanism."""
    problem = on_a_slope(30.0, friction_deg)
    with caplog.at_level(logging.WARNING, "geomech"):
        assert not [e for c in cycles(replace(problem, run=RunSettings(end_time=0.03))) for e in c.events]
    assert ("ends out of balance: 9" in caplog.text) == warns


@pytest.mark.parametrize("time_step", [0.02, 0.005])
@pytest.mark.parametrize("short_of", [0.02, 1e-3, 0.0, -1e-3])
def test_a_little_too_little_strength_is_a_mechanism_at_any_step(caplog, short_of, time_step):
    """Sliding at a hundredth or a thousandth of g leaves less than 1 % of the forces out of balance; the block is not at rest."""
    problem = on_a_slope(30.0, math.degrees(math.atan((1.0 - short_of) * math.tan(math.radians(30.0)))))
    problem = replace(problem, dda=replace(problem.dda, time_step=time_step), run=RunSettings(end_time=24 * time_step))
    with caplog.at_level(logging.WARNING, "geomech"):
        seen = list(cycles(problem))
    told = [event.kind for cycle in seen for event in cycle.events]
    assert told == (["mechanism"] if short_of > 0 else [])
    assert condition(seen[-1]) == ("sliding" if short_of > 0 else "at rest")
    assert (seen[-1].statistics["remaining_motion"] > 1e6) == (short_of > 0)


def test_a_run_that_ends_before_its_blocks_rest_says_how_much_is_missing(caplog):
    """A tower of 100 m sinks into its joints in steps of 10 ms, for hundreds of them: no mechanism at any time."""
    polygons = [np.array([[-1, -5], [11, -5], [11, 0], [-1, 0]], float)]
    polygons += [10 * SQUARE + [0, 10 * k] for k in range(10)]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + 10 * [False])
    ends = {}
    for steps in (100, 400):
        caplog.clear()
        problem = replace(on_a_slope(0.0, 30.0), blocks=blocks, run=RunSettings(end_time=0.01 * steps))
        with caplog.at_level(logging.WARNING, "geomech"):
            seen = list(cycles(problem))
        assert not [event for cycle in seen for event in cycle.events]
        assert ("block 10 has about 8" in caplog.text) == ("ends out of balance" in caplog.text) == (steps == 100)
        ends[steps] = seen[-1].state.vertices[-1, 1] - blocks.vertices[-1, 1], seen[-1].statistics["remaining_motion"]
        assert condition(seen[-1]) == ("at rest" if steps == 400 else "sliding")
    assert ends[100][0] * (1 + ends[100][1]) == pytest.approx(ends[400][0], rel=1e-2)


def test_loads_that_change_are_told_from_steady_ones():
    loads = Loads(
        gravity=History.table([0.0, 1.0, 3.0], [[0.0, 0.0], [0.0, -9.81], [0.0, -9.81]]),
        excavations=(Excavation(5.0, (1,)),),
        bolts=(Bolt(1, (0.5, 0.5), GROUND, (0.5, 3.0), 1e6, installation=7.0),),
    )
    expected = {0.5: False, 1.5: True, 4.5: False, 5.5: True, 6.5: False, 7.5: True}
    assert {begin: loads_are_steady(loads, begin, begin + 0.6) for begin in expected} == expected


def test_a_run_may_end_at_a_mechanism():
    seen = list(cycles(on_a_slope(30.0, 20.0, stop_at=("mechanism",))))
    assert seen[-1].number < 10 and seen[-1].events[-1].kind == "mechanism"


def test_steps_to_events_end_at_a_mechanism(caplog):
    """Whatever they are to stop at: no load has an equilibrium behind it."""
    problem = on_a_slope(30.0, 20.0, stepping="events", stop_at=(), longest_step=0.01)
    with caplog.at_level(logging.WARNING, "geomech"):
        seen = list(cycles(problem))
    assert seen[-1].events[-1].kind == "mechanism" and seen[-1].state.time < 0.15
    assert "the run ends, as there is no equilibrium" in caplog.text
    # It slides under any load: balance is lost in the first step.
    assert seen[-1].events[-1].detail.endswith(f"since the step from t = 0 to {seen[1].state.time:.4g} s")


def test_a_mechanism_tells_between_which_loads_balance_was_lost():
    """A block on a base that is tilted by 2° a step slides from 20.5° on; five steps more show that it does not stop."""
    angles = np.radians(np.linspace(0.0, 40.0, 21))
    weight = History.table(0.01 * np.arange(21.0), 9.81 * np.stack([np.sin(angles), -np.cos(angles)], axis=1))
    problem = on_a_slope(0.0, 20.5, gravity=weight, stop_at=("mechanism",))
    last = list(cycles(problem))[-1]
    assert last.state.time > 0.13
    assert last.events[-1].detail.endswith("since the step from t = 0.1 to 0.11 s")


@pytest.mark.parametrize("friction_deg", [31.0, 40.0])
def test_what_friction_holds_is_no_mechanism(friction_deg):
    assert not [event for cycle in cycles(on_a_slope(30.0, friction_deg)) for event in cycle.events]


def test_a_mechanism_begins_with_the_load_that_makes_it():
    """The weight turns steadily from 0° to 60° in the run: friction of 30° gives way half-way."""
    times = np.linspace(0, 0.2, 41)
    turned = np.radians(60) * times / 0.2
    gravity = History(times, 9.81 * np.stack([np.sin(turned), -np.cos(turned)], axis=1))
    (told,) = [event for cycle in cycles(on_a_slope(0.0, 30.0, gravity)) for event in cycle.events]
    assert 0.1 < told.time < 0.17 and "slider" in told.detail


@pytest.mark.parametrize(("floor", "told"), [(-6e-3, 0), (-3.0, 1)])
def test_what_falls_may_still_land(floor, told):
    """A block over a gap of 6 mm, which takes a dozen static steps of 10 ms, and one over a gap of three times its
    size."""
    base = np.array([[-1, -5], [2, -5], [2, floor], [-1, floor]], float)
    problem = on_a_slope(0.0, 30.0)
    blocks = Blocks.from_polygons([base, SQUARE], fixed=[True, False], names=["base", "slider"])
    problem = replace(problem, blocks=blocks, run=RunSettings(end_time=1.5, stop_at=("mechanism",)))
    found = [event for cycle in cycles(problem) for event in cycle.events]
    assert [event.kind for event in found] == ["mechanism"] * told


@pytest.mark.parametrize("time_step", [1e-2, 1e-3])
@pytest.mark.parametrize(("stiffness", "yield_force", "holds"), [(1e6, math.inf, True), (1e3, math.inf, False)])
def test_a_bolt_that_is_being_stretched_holds_whatever_the_step(time_step, stiffness, yield_force, holds):
    """What a soft bolt has gained over some steps tells how far its block will go: short steps stretch it by little."""
    slope = math.radians(40)
    turn = np.array([[math.cos(slope), math.sin(slope)], [-math.sin(slope), math.cos(slope)]])
    polygons = [np.array([[-6, -3], [8, -3], [8, 0], [-6, 0]]), np.array([[0, 0], [2, 0], [2, 1], [0, 1]])]
    blocks = Blocks.from_polygons([p @ turn for p in polygons], fixed=[True, False])
    bolt = Bolt(1, (0.4447, 1.0258), GROUND, (3.967, 0.7177), stiffness, yield_force=yield_force)
    loads = Loads(gravity=History.constant([0.0, -9.81]), bolts=(bolt,))
    system = dda.BlockSystem(
        blocks, [Material("rock", 20e9, 0.25, density=2600.0)], [JointLaw("plane", math.radians(30))]
    )
    state, mechanism, told = State.at_rest(blocks), Mechanism(), None
    for _ in range(12):
        result = system.step(state, loads, time_step)
        state = result.state
        told = told or mechanism.check(result, blocks)
    assert (told is None) == holds
