"""In-situ stress in blocks and cells of higher order: at rest from the first step on, linear in each block, and elastic
when it is released."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import after, body_of, rectangle, system_of
from scenes_of_cells import cells_of, columns_and_rows, moved_corners, stress_in

from geomech import dda
from geomech.dda.energy_balance import EnergyBudget
from geomech.model import EdgeTraction, History, InSituStress, JointLaw, LinearProfile, Loads, Material, State

ROCK = Material("rock", 1e10, 0.25, 2600.0)
GRAVITY = History.constant((0.0, -9.81))
WEIGHT = 2600 * 9.81
MOVING = {"dynamic_factor": 1.0, "time_step": 1e-3, "newmark": (0.25, 0.5)}


def pressed_bar(order: int, **settings) -> tuple[dda.BlockSystem, Loads]:
    """A free rectangle of 3 × 1 m under tension of 1 MPa on both ends."""
    system = system_of([rectangle(0, 0, 3, 1)], [False], [order], rock=ROCK, **settings)
    names = np.array(system.blocks.edge_name)
    names[[1, 3]] = 1, 2
    blocks = replace(system.blocks, edge_name=names, edge_names=("", "right", "left"))
    ends = tuple(EdgeTraction(name, History.constant((pull, 0.0))) for name, pull in (("right", 1e6), ("left", -1e6)))
    return dda.BlockSystem(blocks, system.materials, system.joints, settings=system.settings), Loads(
        edge_tractions=ends
    )


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("settings", [{}, MOVING])
def test_uniform_stress_in_balance_with_tractions_moves_nothing(order, settings):
    system, loads = pressed_bar(order, **settings)
    rest = dda.in_situ_state(system, InSituStress(np.array([1e6, 0.0, 0.0])), loads)
    # 1 MPa would stretch the bar by 3e-4 m.
    assert rest.deviation < 1e-12
    again = dda.BlockSystem(rest.blocks, system.materials, system.joints, settings=system.settings)
    state = after(again, loads, 5, rest.state).state
    assert np.abs(state.vertices - system.blocks.vertices).max() < 2e-15
    if order > 1:
        assert np.abs(state.deflection).max() < 1e-15


@pytest.mark.parametrize("order", [2, 3, 4])
def test_stress_that_varies_with_depth_is_exact_and_in_balance(order):
    """A column of 1 × 4 m that hangs on tractions: σ = γ (y − 2), half pulled and half pressed at its ends; its sides bear
    0.5 of that."""
    settings = {"newmark": (0.25, 0.5), "dynamic_factor": 1.0, "time_step": 1e-3}
    system = system_of([rectangle(0, 0, 1, 4)], [False], [order], rock=ROCK, **settings)
    names = np.arange(1, 5)
    blocks = replace(system.blocks, edge_name=names, edge_names=("", "bottom", "right", "top", "left"))
    system = dda.BlockSystem(blocks, system.materials, system.joints, settings=system.settings)
    field = InSituStress(np.zeros(3), np.array([[0.0, 0.5 * WEIGHT], [0.0, WEIGHT], [0.0, 0.0]]), (0.0, 2.0))
    depth = LinearProfile((0.0, 0.0), (0.0, 4.0), (-1.0, 1.0))
    side = WEIGHT * 0.5 * 2.0
    loads = Loads(
        gravity=GRAVITY,
        edge_tractions=(
            EdgeTraction("top", History.constant((0.0, 2.0 * WEIGHT))),
            EdgeTraction("bottom", History.constant((0.0, 2.0 * WEIGHT))),
            EdgeTraction("right", History.constant((side, 0.0)), profile=depth),
            EdgeTraction("left", History.constant((-side, 0.0)), profile=depth),
        ),
    )
    rest = dda.in_situ_state(system, field, loads)
    assert rest.deviation < 1e-12
    again = dda.BlockSystem(rest.blocks, system.materials, system.joints, settings=system.settings)
    state, budget = rest.state, EnergyBudget()
    points = np.array([[0.0, 0.0], [0.3, 1.1], [1.0, 4.0], [0.5, 2.0]])
    for _ in range(5):
        result = again.step(state, loads)
        state, budget = result.state, budget.after(result.energy, result.state.time)
    assert np.abs(state.vertices - blocks.vertices).max() < 1e-14
    assert np.abs(state.deflection[:, 0] - state.deflection_origin[:, 1]).max() < 1e-14
    stress, moved = body_of(again, state, 0).fields(points)
    assert stress == pytest.approx(field.at(points), rel=1e-9, abs=1e-9 * WEIGHT)
    assert np.abs(moved).max() < 1e-13
    assert abs(budget.residual) < 1e-12 * budget.start


@pytest.mark.parametrize("order", [2, 3])
def test_released_stress_stretches_a_block_as_elasticity_has_it(order):
    """What bears a stress of bending, −1 MPa · (y − ½)/½, goes: the bar gives it up and bends by the strain of that
    stress the other way, to a curvature of 2 MPa/m over E."""
    system = system_of([rectangle(0, 0, 4, 1)], [False], [order], rock=replace(ROCK, plane="stress"))
    field = InSituStress(np.zeros(3), np.array([[0.0, -2e6], [0.0, 0.0], [0.0, 0.0]]), (0.0, 0.5))
    loads = Loads()
    # The search for a rest without tractions finds one without stress.
    assert dda.in_situ_state(system, field, loads).deviation == pytest.approx(1.0, rel=1e-9)
    state = State.at_rest(system.blocks)
    origin = -system.deflected.under(field)
    state = replace(
        state, deflection=system.deflected.at_rest(), deflection_origin=np.stack([origin, 0.0 * origin], axis=1)
    )
    end = after(system, loads, 3, state).state
    bent = body_of(system, end, 0)
    assert np.abs(bent.fields(np.array([[0.0, 0.0], [4.0, 1.0]]))[0]).max() < 1e-3
    at = np.array([[0.0, 0.5], [2.0, 0.5], [4.0, 0.5]])
    y = bent.fields(at)[1][:, 1]
    # Sagitta κ l²/8.
    assert 0.5 * (y[0] + y[2]) - y[1] == pytest.approx(-2e6 / 1e10 * 16 / 8, rel=1e-8)


def confined(order: int, angle: float = 0.0, **settings) -> dda.BlockSystem:
    """Cells of 3 × 2 m between fixed, smooth walls."""
    cells = columns_and_rows(np.linspace(0, 3, 4), np.linspace(0, 2, 3))
    walls = [rectangle(-1, -1, 4, 0), rectangle(-1, 0, 0, 3), rectangle(3, 0, 4, 3)]
    return cells_of(cells, order, below=walls, joint=JointLaw("smooth"), rock=ROCK, angle=angle, **settings)


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("k0", [1 / 3, 1.2])
def test_cells_between_walls_are_at_rest_under_geostatic_stress(order, k0):
    system, loads, field = confined(order), Loads(gravity=GRAVITY), InSituStress.geostatic(2.0, WEIGHT, k0)
    rest = dda.in_situ_state(system, field, loads)
    assert rest.deviation < 1e-6
    moving = confined(order, **MOVING)
    dropped = np.abs(moved_corners(moving, after(moving, loads, 5).state)).max()
    again = dda.BlockSystem(rest.blocks, moving.materials, moving.joints, settings=moving.settings)
    at = moved_corners(again, rest.state)
    state = after(again, loads, 5, rest.state).state
    # Contacts and cells find each other again to 2e-5 of what gravity would move in as many steps.
    assert np.abs(moved_corners(again, state) - at).max() < 2e-5 * dropped
    cells = np.arange(3, 9)
    points = np.array([again.blocks.vertices[again.blocks.vertex_block == b].min(axis=0) + 0.1 for b in cells])
    found = stress_in(again, state, cells, points)
    assert found == pytest.approx(field.at(points), abs=1e-5 * 2 * WEIGHT)


def test_an_order_that_is_found_is_refused():
    system = system_of([rectangle(0, 0, 1, 1)], [False], [0], rock=ROCK)
    with pytest.raises(ValueError, match='order "auto"'):
        dda.in_situ_state(system, InSituStress(np.zeros(3)), Loads())
