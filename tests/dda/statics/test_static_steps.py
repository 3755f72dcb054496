"""Static steps by themselves: what their pseudo-inertia takes, dilation to and fro, soft bolts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geomech import dda
from geomech.model import (
    GROUND,
    BlockMotion,
    Blocks,
    Bolt,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    State,
)

DILATION = math.radians(10)
JOINT = JointLaw("joint", math.radians(35), dilation_angle=DILATION)


def sheared(motion: History, dt: float, end: float, density: float = 2600.0, equilibrium: str = ""):
    """States and step results of a block of 1 × 0.5 m, pressed by 1 MPa, that moves along a joint with dilation."""
    blocks = Blocks.from_polygons(
        [np.array([[-1, -0.5], [2, -0.5], [2, 0], [-1, 0]]), np.array([[0, 0], [1, 0], [1, 0.5], [0, 0.5]])],
        fixed=[True, False], edge_names=[[[""] * 4], [["", "", "top", ""]]],
    )  # fmt: skip
    loads = Loads(
        edge_tractions=(EdgeTraction("top", History.constant([0.0, -1e6])),),
        block_motions=(BlockMotion(1, motion, ("u0", "r0")),),
    )
    settings = DdaSettings(max_displacement_ratio=0.5, dynamic_factor=0.0, time_step=dt, equilibrium=equilibrium)
    results: list[dda.StepResult] = []
    rock = Material("rock", 20e9, 0.25, density=density)
    states = list(dda.run(blocks, [rock], [JOINT], loads, settings, end, watch=results.append))
    return states, results


@pytest.mark.parametrize("dt", [0.05, 0.0125, 1e-3, 3e-4])
def test_what_dilation_lifts_is_not_pressed_by_inertia(dt):
    """2M d/dt² for the lift d = v dt tan ψ of a step would press by 9e2 to 1.5e5 N/m; what is left is round-off."""
    _, results = sheared(History.ramp([0.1, 0.0]), dt, 8 * dt)
    assert results[-1].contacts["normal_force"].sum() == pytest.approx(1e6, rel=3e-6)
    assert results[-1].statistics["unbalanced_ratio"] < 2e-6


def test_pseudo_inertia_stays_where_it_is_asked_for():
    blocks = Blocks.from_polygons(
        [np.array([[-1, -1], [2, -1], [2, 0], [-1, 0]]), np.array([[0, 0], [1, 0], [1, 1], [0, 1]])],
        fixed=[True, False],
    )
    system = dda.BlockSystem(
        blocks, [Material("rock", 20e9, 0.25, density=2600.0)], [JOINT], settings=DdaSettings(dynamic_factor=0.0)
    )
    state, loads, ratios = State.at_rest(blocks), Loads(gravity=History.constant([0.0, -9.81])), []
    for keep in (True, False):
        result = system.step(state, loads, 1e-3, pseudo_inertia=keep)
        ratios.append(result.statistics["unbalanced_ratio"])
    assert ratios[0] > 1e-4 and ratios[1] < 1e-6


def test_a_block_that_slides_keeps_its_step_beside_one_that_is_held():
    """On an incline of 40° at 20° of friction one block goes by a dt²/2; another, on the level, bears its weight to
    round-off."""
    slope = np.radians(40.0)
    turn = np.array([[math.cos(slope), math.sin(slope)], [-math.sin(slope), math.cos(slope)]])
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    outlines = [
        np.array([[-3, -1], [3, -1], [3, 0], [-3, 0]]) @ turn, square @ turn,
        np.array([[10, -1], [13, -1], [13, 0], [10, 0]]), square + [11.0, 0.0],
    ]  # fmt: skip
    blocks = Blocks.from_polygons(outlines, fixed=[True, False, True, False])
    law, dt = JointLaw("joint", math.radians(20)), 1e-2
    system = dda.BlockSystem(
        blocks, [Material("rock", 20e9, 0.25, density=2600.0)], [law], settings=DdaSettings(dynamic_factor=0.0)
    )
    result = system.step(State.at_rest(blocks), Loads(gravity=History.constant([0.0, -9.81])), dt)
    pull = 9.81 * (math.sin(slope) - math.tan(math.radians(20)) * math.cos(slope))
    assert np.hypot(*result.acceleration[1, :2]) == pytest.approx(pull, rel=1e-3)
    way = result.state.vertices[blocks.vertex_start[1]] - blocks.vertices[blocks.vertex_start[1]]
    assert np.hypot(*way) == pytest.approx(0.5 * pull * dt**2, rel=1e-3)
    assert 2600.0 * np.hypot(*result.acceleration[3, :2]) < 1e-6 * 2600.0 * 9.81


def test_the_lift_of_a_dilating_joint_comes_back():
    way = np.array([0.0, 10e-3, -10e-3, 0.0, 10e-3, -10e-3, 0.0])
    motion = History.table([0, 1, 3, 4, 5, 7, 8], np.stack([way, np.zeros(7)], axis=1))
    states, _ = sheared(motion, 0.1, 8.0, density=1.0)
    lifts = np.array([state.contacts["lift"].max(initial=0.0) for state in states])
    assert lifts.max() == pytest.approx(10e-3 * math.tan(DILATION), rel=5e-3)
    assert lifts[-1] < 5e-6


@pytest.mark.parametrize("dt", [1e-2, 1e-3, 1e-5])
def test_a_block_on_a_soft_bolt_goes_on_at_any_step_and_is_told_to_be_out_of_balance(dt):
    blocks = Blocks.from_polygons(
        [np.array([[-5, -5], [5, -5], [5, -4], [-5, -4]]), np.array([[0, -1], [1, -1], [1, 0], [0, 0]])],
        fixed=[True, False],
    )
    bolt = Bolt(1, (0.5, 0.0), GROUND, (0.5, 3.0), 1e3)
    system = dda.BlockSystem(blocks, [Material("rock", 20e9, 0.25, density=2600.0)], [JointLaw("joint", 0.5)])
    state, loads = State.at_rest(blocks), Loads(gravity=History.constant([0.0, -9.81]), bolts=(bolt,))
    for _ in range(3):
        result = system.step(state, loads, dt)
        state = result.state
    assert result.dt == dt and result.statistics["unbalanced_ratio"] > 0.9
    # Each step falls as far as inertia and bolt allow: d = m g/(2m/dt² + k).
    assert blocks.vertices[4, 1] - state.vertices[4, 1] == pytest.approx(3 * 9.81 * dt**2 / 2, rel=2e-2)


@pytest.mark.parametrize(("stiffness", "dt"), [(1e6, 1e-2), (1e7, 1e-2), (1e8, 1e-3)])
def test_a_static_run_takes_a_block_to_where_a_soft_bolt_holds_it(verified, stiffness, dt):
    """On a plane at 40° at 30° of friction the bolt along it comes to bear W (sin 40° − cos 40° tan 30°): in a few steps
    in which inertia alone would let it take a thousandth of that, and not more, which friction would keep."""
    slope = math.radians(40)
    turn = np.array([[math.cos(slope), math.sin(slope)], [-math.sin(slope), math.cos(slope)]])
    outlines = [np.array([[-6, -3], [8, -3], [8, 0], [-6, 0]]), np.array([[0, 0], [2, 0], [2, 1], [0, 1]])]
    blocks = Blocks.from_polygons([outline @ turn for outline in outlines], fixed=[True, False])
    bolt = Bolt(1, tuple([1.0, 0.5] @ turn), GROUND, tuple([6.0, 0.5] @ turn), stiffness)
    system = dda.BlockSystem(
        blocks, [Material("rock", 20e9, 0.25, density=2600.0)], [JointLaw("joint", math.radians(30))],
        settings=DdaSettings(dynamic_factor=0.0),
    )  # fmt: skip
    state, loads = State.at_rest(blocks), Loads(gravity=History.constant([0.0, -9.81]), bolts=(bolt,))
    for _ in range(20):
        result = system.step(state, loads, dt)
        state = result.state
    needed = 2600.0 * 9.81 * 2.0 * (math.sin(slope) - math.cos(slope) * math.tan(math.radians(30)))
    print(f"{stiffness:g} N/m, {dt:g} s: {state.bolts['force'][0] / needed - 1:.1e} off")
    verified(
        f"block that a bolt of {stiffness:g} N/m holds on an incline, static steps of {1e3 * dt:g} ms: force of the bolt", None,
        "W (sin β − cos β tan φ)", found=float(state.bolts["force"][0]), exact=needed, unit="N/m",
    )  # fmt: skip
    assert state.bolts["force"][0] == pytest.approx(needed, rel=2e-3)
    assert result.statistics["unbalanced_ratio"] < 1e-6
