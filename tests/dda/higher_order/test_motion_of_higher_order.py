"""Prescribed motion of blocks of higher order and of points in them: reactions of beams, and points that go where they
are sent."""

from __future__ import annotations

import numpy as np
import pytest
from scenes_of_bending import after, moved, rectangle, system_of
from scenes_of_cells import cells_of, columns_and_rows, moved_corners

from geomech.dda import EnergyBudget
from geomech.model import AUTO_ORDER, GROUND, BlockMotion, Bolt, History, JointLaw, Loads, Material, PointMotion, State

BEAM = Material("rock", 2e10, 0.0, 2500.0, plane="stress")
CLAMP = JointLaw("clamp", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e15, shear_stiffness=1e15)
LENGTH = 16.0
TIP = 1.0 / (4 * LENGTH**3 / 2e10 + 1.2 * LENGTH / 1e10)
END = (LENGTH, 0.0)


def cantilever(order: int, **settings):
    return system_of(
        [rectangle(-1, -0.5, 0, 0.5), rectangle(0, -0.5, LENGTH, 0.5)], [1, 0], [1, order], joint=CLAMP, rock=BEAM,
        **settings,
    )  # fmt: skip


def sent(*to: float) -> History:
    return History(np.array([0.0, 20.0]), np.array([[0.0] * len(to), list(to)]))


@pytest.mark.parametrize("order", [3, 5])
def test_a_tip_goes_where_it_is_sent(order):
    """Along y alone, by 1 mm: the reaction is that of a beam, and nothing is out of balance."""
    motion = PointMotion(1, END, sent(-1e-3), direction=(0.0, 1.0))
    system = cantilever(order)
    result = after(system, Loads(point_motions=(motion,)), 4)
    assert moved(system, result.state, 1, np.array(END))[1] == pytest.approx(-1e-3, rel=1e-9)
    assert result.statistics["reaction_y:point 1"] == pytest.approx(-1e-3 * TIP, rel=3e-3 if order == 3 else 1e-3)
    assert abs(result.statistics["reaction_x:point 1"]) < 1e-6
    assert result.statistics["unbalanced"] < 1e-9


def test_an_order_is_raised_for_a_point_that_is_moved():
    motion = PointMotion(1, END, sent(-1e-3), direction=(0.0, 1.0))
    system = cantilever(AUTO_ORDER, order_target=0.02)
    result = after(system, Loads(point_motions=(motion,)), 4)
    assert result.state.order[1] >= 3
    assert result.statistics["reaction_y:point 1"] == pytest.approx(-1e-3 * TIP, rel=0.05)


def test_a_tip_that_a_spring_moves_goes_half_the_way():
    motion = PointMotion(1, END, sent(0.0, -1e-3), stiffness=TIP)
    system = cantilever(5)
    result = after(system, Loads(point_motions=(motion,)), 4)
    tip = moved(system, result.state, 1, np.array(END))[1]
    assert tip == pytest.approx(-0.5e-3, rel=1e-3)
    assert result.statistics["reaction_y:point 1"] == pytest.approx(-(1e-3 + tip) * TIP, rel=1e-9)
    assert result.statistics["unbalanced"] < 1e-9


def test_a_beam_of_cells_bears_what_moves_a_point_of_it():
    cells = columns_and_rows(np.linspace(0, LENGTH, 9), np.linspace(-0.5, 0.5, 2))
    system = cells_of(cells, 4, below=[rectangle(-1, -0.5, 0, 0.5)], joint=CLAMP, rock=BEAM)
    motion = PointMotion(8, END, sent(0.0, -1e-3))
    result = after(system, Loads(point_motions=(motion,)), 4)
    # The middle of the end goes by a millimetre, its corners by nearly that.
    corners = np.abs(system.blocks.vertices[:, 0] - LENGTH) < 1e-9
    assert moved_corners(system, result.state)[corners, 1].mean() == pytest.approx(-1e-3, rel=2e-3)
    assert result.statistics["reaction_y:point 1"] == pytest.approx(-1e-3 * TIP, rel=2e-3)
    assert result.statistics["unbalanced"] < 1e-9


def test_what_moves_a_beam_on_two_bearings_is_their_force():
    """Three-point bending: the reaction of the point is borne by both bearings, by half each."""
    polygons = [rectangle(0, -1, 0.5, 0), rectangle(7.5, -1, 8, 0), rectangle(0, 0, 8, 1)]
    system = system_of(polygons, [True, True, False], [1, 1, 6], joint=JointLaw("joint", 0.5), rock=BEAM)
    motion = PointMotion(2, (4.0, 1.0), sent(0.0, -1e-4))
    result = after(system, Loads(point_motions=(motion,)), 4)
    on = [result.contacts[(result.contacts["block"] == b) | (result.contacts["other"] == b)] for b in (0, 1)]
    left, right = (float(rows["normal_force"].sum()) for rows in on)
    assert left == pytest.approx(right, rel=1e-6)
    assert left + right == pytest.approx(-result.statistics["reaction_y:point 1"], rel=1e-6)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_block_is_pressed_by_its_own_motion(order):
    """The mean displacement of a column is prescribed, the reaction is spread over it: F = 3 E b/h v for a linear stress, 4 E
    b/h v for a uniform one, the value at the middle."""
    system = system_of(
        [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 2)], [True, False], [1, order], rock=BEAM,
        joint=JointLaw("plate", 0.5, normal_stiffness=1e15, shear_stiffness=1e15),
    )  # fmt: skip
    loads = Loads(block_motions=(BlockMotion(1, sent(0.0, -1e-6, 0.0)),))
    result = after(system, loads, 4)
    force = (4.0 if order == 1 else 3.0) * 2e10 / 2 * 1e-6
    name = system.blocks.names[1]
    assert result.statistics[f"reaction_y:{name}"] == pytest.approx(-force, rel=1e-4)
    assert result.contacts["normal_force"].sum() == pytest.approx(force, rel=1e-4)
    assert result.statistics["unbalanced"] < 1e-9


def test_motion_with_a_bolt_and_in_time():
    """The tip of a beam on a bolt is moved at a given speed: it follows, and the energy balance closes."""
    system = cantilever(5, dynamic_factor=1.0, newmark=(0.25, 0.5), damping=0.1, time_step=2e-3)
    times = np.linspace(0, 0.4, 201)
    speed = History(times, 1e-2 * np.sin(2 * np.pi * 3 * times)[:, None])
    motion = PointMotion(1, END, speed, direction=(0.0, 1.0), kind="velocity")
    bolt = Bolt(1, (0.5 * LENGTH, 0.0), GROUND, (0.5 * LENGTH, 9.0), TIP, pretension=1e3, compression=True)
    state, budget = State.at_rest(system.blocks), EnergyBudget()
    for _ in range(150):
        result = system.step(state, Loads(point_motions=(motion,), bolts=(bolt,)))
        state, budget = result.state, budget.after(result.energy, result.state.time)
        reached = moved(system, state, 1, np.array(END))[1]
        assert reached == pytest.approx(speed.integral(state.time)[0], abs=1e-8)
    assert abs(budget.residual) < 1e-4 * budget.turnover


def test_motions_that_contradict_are_refused():
    twice = PointMotion(1, END, sent(0.0, 0.0)), PointMotion(1, END, sent(0.0, 1e-3))
    with pytest.raises(ValueError, match="contradict or repeat"):
        after(cantilever(3), Loads(point_motions=twice), 1)
