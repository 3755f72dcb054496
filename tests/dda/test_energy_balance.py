"""The energy budget of steps and runs: closed within each step, small between steps, right against closed forms."""

from __future__ import annotations

import itertools
import logging
from dataclasses import replace

import numpy as np
import pytest
from block_problems import rectangle, turned

from geomech import dda
from geomech.model import (
    SLIP,
    Blocks,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    Roughness,
    State,
)

GRAVITY = 9.81
WEIGHT = Loads(gravity=History.constant([0.0, -GRAVITY]))
ROCK = Material("rock", 10e9, 0.25, density=2600.0)


def wall(rows: int, width: int) -> Blocks:
    polygons = [rectangle(-1, -0.5, width + 1, 0)]
    for row in range(rows):
        joints = [0, *np.arange(0.5, width), width] if row % 2 else range(width + 1)
        polygons += [rectangle(a, 0.5 * row, b, 0.5 * row + 0.5) for a, b in itertools.pairwise(joints)]
    return Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))


def marched(system: dda.BlockSystem, state: State, loads: Loads, dt: float, end: float):
    """The state and budget at ``end``; every step's own balance is held to round-off, no loss may be a gain."""
    budget = dda.EnergyBudget()
    while state.time < end * (1 - 1e-12):
        result = system.step(state, loads, min(dt, end - state.time))
        state, energy = result.state, result.energy
        budget = budget.after(energy, state.time)
        scale = max(map(abs, energy))
        # The step's equations are solved to 1e-11 of the largest force in them (`unbalanced`).
        assert abs(energy.residual) < 1e-10 * scale
        assert min(energy.friction, energy.damping) > -1e-9 * scale
    return state, budget


def test_sliding_turns_weight_into_heat_and_motion():
    slope, friction = np.radians(30), np.radians(15)
    blocks = Blocks.from_polygons(
        [turned(rectangle(-20, -1, 20, 0), slope), turned(rectangle(4, 0, 5, 1), slope)], fixed=[True, False]
    )
    settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.05)
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("joint", friction_angle=friction)], settings=settings)
    state, budget = marched(system, State.at_rest(blocks), WEIGHT, 4e-3, 0.5)
    travel = float((state.vertices - blocks.vertices)[4:].mean(axis=0) @ -np.array([np.cos(slope), np.sin(slope)]))
    weight = 2600.0 * GRAVITY
    # Half a metre at closed-form forces; the block's elastic shortening, 1 µm, is the difference.
    assert budget.gravity_work == pytest.approx(weight * np.sin(slope) * travel, rel=1e-5)
    assert budget.friction == pytest.approx(weight * np.cos(slope) * np.tan(friction) * travel, rel=1e-5)
    assert budget.last.kinetic == pytest.approx(0.5 * 2600.0 * float(np.sum(state.velocity[1, :2] ** 2)), rel=1e-9)
    # Translation: updating the geometry changes no energy.
    assert abs(budget.residual) < 1e-9 * budget.work
    total = budget.last.stored + budget.losses - budget.work
    assert total == pytest.approx(budget.start + budget.residual, abs=1e-9 * budget.work)


def test_a_free_block_keeps_its_energy():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 2)])
    settings = DdaSettings(dynamic_factor=1.0, damping=0.0, max_displacement_ratio=10.0)
    system = dda.BlockSystem(blocks, [ROCK], settings=settings)
    state = State.at_rest(blocks)
    state.velocity[0, :3] = [3.0, 7.0, 5.0]
    start = 0.5 * 5200.0 * 58.0 + 0.5 * 5200.0 * 5.0 / 12.0 * 25.0
    _, budget = marched(system, state, WEIGHT, 0.01, 1.0)
    assert budget.start == pytest.approx(start, rel=1e-12)
    assert budget.last.kinetic - start == pytest.approx(budget.gravity_work, rel=1e-5)
    # The spin takes from the rotation what it stretches the block by (ρω²h²/12 over E is 2e-6): that is in the balance.
    assert abs(budget.residual) < 1e-10 * start


def test_time_integration_loses_what_shis_scheme_says():
    # A free vibration of a block: |λ|² = 1/(1 + Ω²/2) a step (Shi's scheme is Newmark's with β = ½, γ = 1), on average
    # over a cycle; all of it is the scheme's loss, ½ A Δσ·C⁻¹Δσ a step.
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    rock = Material("rock", 10e9, 0.0, density=2600.0)
    settings = DdaSettings(dynamic_factor=1.0, damping=0.0, max_displacement_ratio=1.0)
    system = dda.BlockSystem(blocks, [rock], settings=settings)
    omega = np.sqrt(12 * 10e9 / 2600.0)
    state = State.at_rest(blocks)
    state.velocity[0, 3] = 1e-8 * omega
    step, n = 0.2, 500
    _, budget = marched(system, state, Loads(), step / omega, n * step / omega)
    kept = budget.last.stored / budget.start
    # Over n steps the energy falls as |λ|²ⁿ up to the swing of the discrete mode between its two forms, O(Ω).
    assert np.log(kept) / n == pytest.approx(-np.log(1 + 0.5 * step**2), rel=0.02)
    assert budget.scheme == pytest.approx(budget.start - budget.last.stored, rel=1e-9)


def test_impact_gains_nothing_and_its_loss_is_named():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1), rectangle(1.01, 0.1, 3.01, 0.9)])
    settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=1.0)
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("rough", friction_angle=0.5)], settings=settings)
    state = State.at_rest(blocks)
    state.velocity[0, :2], state.velocity[1, :2] = [4.0, 0.5], [-1.0, 0.0]
    end, budget = marched(system, state, Loads(), 1e-4, 8e-3)
    assert (end.contacts["state"] == 0).all()
    assert budget.damping > 0 and budget.scheme > 0 and budget.friction > 0
    assert budget.last.stored + budget.losses == pytest.approx(budget.start, rel=2e-3)


def loaded_column(**settings) -> dda.BlockSystem:
    blocks = Blocks.from_polygons(
        [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 2)], fixed=[True, False],
        edge_names=[[[""] * 4], [["", "", "top", ""]]],
    )  # fmt: skip
    rock = Material("rock", 10e9, 0.0, density=2600.0)
    settings = DdaSettings(normal_penalty=4e11, max_displacement_ratio=1.0, **settings)
    return dda.BlockSystem(blocks, [rock], settings=settings)


STORED = 0.5 * 3e6**2 * (2.0 / 10e9 + 1 / 8e11)  # under 3 MPa on top: in the column, and in its contacts


@pytest.mark.parametrize("n", [1, 2, 4, 16])
def test_work_of_a_growing_load_is_stored_in_any_number_of_steps(n):
    system = loaded_column()
    loads = Loads(edge_tractions=(EdgeTraction("top", History.ramp([0.0, -3e6])),))
    _, budget = marched(system, State.at_rest(system.blocks), loads, 1.0 / n, 1.0)
    assert budget.last.elastic + budget.last.contact == pytest.approx(STORED, rel=1e-3)
    assert budget.load_work == pytest.approx(budget.last.stored + budget.losses - budget.residual, rel=1e-9)
    # Second order of the strain of 3e-4; n steps that took the load at their ends lost 1/n of what is stored.
    assert budget.load_work == pytest.approx(STORED, rel=1e-3)
    assert abs(budget.scheme + budget.carried) < 1e-3 * STORED


def test_half_of_the_work_of_a_sudden_load_is_lost():
    system = loaded_column()
    loads = Loads(edge_tractions=(EdgeTraction("top", History.constant([0.0, -3e6])),))
    _, budget = marched(system, State.at_rest(system.blocks), loads, 0.25, 1.0)
    assert budget.load_work == pytest.approx(2.0 * STORED, rel=1e-3)
    assert budget.scheme + budget.carried == pytest.approx(STORED, rel=1e-3)


@pytest.mark.parametrize("newmark", [(0.5, 1.0), (0.35, 0.7), (0.25, 0.5)])
def test_slow_loads_lose_nothing_in_motion(newmark):
    """The weight and a load on top grow during a thousand periods of the column, in steps that do not resolve them."""
    system = loaded_column(dynamic_factor=1.0, damping=0.0, newmark=newmark)
    loads = Loads(
        gravity=History.ramp([0.0, -GRAVITY]), edge_tractions=(EdgeTraction("top", History.ramp([0.0, -3e6])),)
    )
    _, budget = marched(system, State.at_rest(system.blocks), loads, 0.05, 1.0)
    # Of the column's own weight the work of a column of half its height is stored.
    assert budget.load_work == pytest.approx(STORED, rel=0.01)
    assert abs(budget.scheme + budget.carried + budget.damping) < 0.01 * STORED


@pytest.mark.parametrize("order", [1, 3])
def test_the_work_of_weight_and_loads_does_not_depend_on_the_number_of_static_steps(order):
    """A beam on its two ends, under a weight that grows and a load that falls."""
    polygons = [rectangle(0, 0, 6, 0.5), rectangle(-0.5, -0.5, 0.5, 0), rectangle(5.5, -0.5, 6.5, 0)]
    blocks = Blocks.from_polygons(
        polygons, fixed=[False, True, True], order=[order, 1, 1],
        edge_names=[[["", "", "top", ""]], [[""] * 4], [[""] * 4]],
    )  # fmt: skip
    load = History(np.array([0.0, 2.0]), np.array([[0.0, -2e5], [0.0, -1e5]]))
    loads = Loads(gravity=History.ramp([0.0, -5 * GRAVITY]), edge_tractions=(EdgeTraction("top", load),))
    works = []
    for n in (1, 2, 5):
        system = dda.BlockSystem(
            blocks, [ROCK], [JointLaw("joint", friction_angle=0.5)],
            settings=DdaSettings(max_displacement_ratio=1.0),
        )  # fmt: skip
        # At rest under the load before it falls.
        begun = dda.equilibrium(system, State.at_rest(blocks), loads, load_time=0.0).state
        _, budget = marched(system, replace(begun, time=0.0), loads, 1.0 / n, 1.0)
        works.append([budget.gravity_work, budget.load_work, budget.last.stored])
        assert abs(budget.scheme + budget.carried) < 1e-3 * np.abs(works[-1]).max()
    assert np.array(works[1:]) == pytest.approx(np.array([works[0]] * 2), rel=1e-3)


@pytest.mark.parametrize("cohesion", [0.0, 1.0])
def test_friction_under_a_growing_load_does_not_depend_on_the_number_of_static_steps(cohesion):
    """A wedge in a notch grows heavier and slides down both flanks as it is compressed: force and slip grow together (once
    a cohesion of 1 Pa is overcome), and half of their product is lost."""
    polygons = [
        np.array([[-2.0, 2.0], [0.0, 0.0], [2.0, 2.0]]),
        np.array([[-3.0, -1.0], [0.0, -1.0], [0.0, 0.0], [-2.0, 2.0], [-3.0, 2.0]]),
        np.array([[0.0, -1.0], [3.0, -1.0], [3.0, 2.0], [2.0, 2.0], [0.0, 0.0]]),
    ]
    blocks = Blocks.from_polygons(polygons, fixed=[False, True, True])
    law = JointLaw("joint", friction_angle=0.2, cohesion=cohesion, tensile_strength=cohesion)
    losses = []
    for n in (1, 2, 8):
        system = dda.BlockSystem(blocks, [ROCK], [law], settings=DdaSettings(max_displacement_ratio=1.0))
        loads = Loads(gravity=History.ramp([0.0, -GRAVITY]))
        state, budget = marched(system, State.at_rest(blocks), loads, 1.0 / n, 1.0)
        slid = np.abs(state.contacts["shear_force"] * state.contacts["slip"])[state.contacts["state"] == SLIP].sum()
        assert budget.friction == pytest.approx(0.5 * float(slid), rel=1e-3)
        assert abs(budget.scheme) + abs(budget.bond) < 1e-3 * budget.friction
        losses.append(budget.friction)
    assert losses[1:] == pytest.approx([losses[0]] * 2, rel=1e-3)


def test_broken_bonds_release_what_they_held():
    blocks = Blocks.from_polygons([rectangle(0, 1, 1, 2), rectangle(0, 0, 1, 1)], fixed=[True, False])
    glue = JointLaw("glue", cohesion=1e6, tensile_strength=0.99 * 2600 * GRAVITY)
    settings = DdaSettings(max_displacement_ratio=0.5)
    system = dda.BlockSystem(blocks, [ROCK], [glue], settings=settings)
    half = Loads(gravity=History.constant([0.0, -0.9 * GRAVITY]))
    first = system.step(State.at_rest(blocks), half, 1.0)
    assert first.energy.bond == 0.0 and first.energy.contact > 0.0
    second = system.step(first.state, WEIGHT, 1.0)
    assert second.energy.contact == 0.0
    assert second.energy.bond == pytest.approx(first.energy.contact, rel=1e-3)


def test_the_geometry_update_is_all_that_is_left_of_the_budget_of_a_wall_that_falls():
    # Pushed over by a tilted gravity: joints slide, open and close for a hundred steps, and every step's balance is
    # closed.
    blocks = wall(6, 3)
    settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.02)
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("joint", friction_angle=0.6)], settings=settings)
    state, budget = marched(system, State.at_rest(blocks), Loads(gravity=History.constant([9.0, -GRAVITY])), 4e-3, 0.4)
    assert np.abs(state.vertices - blocks.vertices).max() > 0.1
    assert budget.friction > 0.1 * budget.gravity_work
    # 4e-5 here, and no less with shorter steps: more corners are then seen to meet.
    assert abs(budget.residual) < 1e-4 * budget.gravity_work


@pytest.mark.parametrize(
    ("law", "settings"),
    [
        (JointLaw("joint", 0.6), {"newmark": (0.25, 0.5)}),
        (JointLaw("joint", 0.6), {"newmark": (0.35, 0.6), "damping": 0.0}),
        (JointLaw("joint", 0.6), {"rayleigh_mass": 2.0, "rayleigh_stiffness": 1e-5}),
        (JointLaw("joint", 0.6), {"contact": "augmented", "normal_penalty": 1e10}),
        (JointLaw("dilates", 0.6, dilation_angle=0.1), {}),
        (JointLaw("closes", 0.6, normal_stiffness=1e10, max_closure=1e-4), {}),
        (JointLaw("rough", 0.5, roughness=Roughness(10.0, 50e6)), {}),
        (JointLaw("bonded", 0.5, cohesion=1e4, tensile_strength=5e3), {}),
    ],
    ids=["trapezoidal", "newmark", "rayleigh", "augmented", "dilation", "closure", "rough", "bonded"],
)
def test_every_scheme_and_law_closes_its_balance(law, settings):
    blocks = wall(3, 2)
    settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.02, **settings)
    system = dda.BlockSystem(blocks, [ROCK], [law], settings=settings)
    _, budget = marched(system, State.at_rest(blocks), Loads(gravity=History.constant([7.0, -GRAVITY])), 2e-3, 0.06)
    assert budget.friction > 0.0 and abs(budget.residual) < 1e-2 * budget.gravity_work
    assert budget.start == 0.0
    total = budget.last.stored + budget.losses - budget.work - budget.overlap
    assert total == pytest.approx(budget.residual, abs=1e-11 * budget.turnover)


def stones() -> Blocks:
    """Stones on a stepped, cut base, whose joints meet in crosses and tees, as a slope's do."""
    base = [rectangle(-4, -1, 0, 0), rectangle(0, -1, 2, 0), rectangle(2, -1, 3, 0), rectangle(3, -1, 8, -0.5)]
    piled = [
        rectangle(-1, 0, 0, 1),
        rectangle(0, 0, 2, 1),
        rectangle(2, 0, 3, 2),
        rectangle(0, 1, 1, 2),
        rectangle(1, 1, 2, 2),
    ]
    polygons = [turned(polygon, -np.radians(20)) for polygon in base + piled]
    return Blocks.from_polygons(polygons, fixed=[True] * len(base) + [False] * len(piled))


@pytest.mark.parametrize("stiffness", [1e9, 1e10])
def test_soft_joints_give_no_energy_to_corners_that_leave_their_faces(stiffness):
    blocks = stones()
    law = JointLaw("soft", np.radians(12), normal_stiffness=stiffness, shear_stiffness=0.3 * stiffness)
    settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.02)
    system = dda.BlockSystem(blocks, [ROCK], [law], settings=settings)
    state, budget = marched(system, State.at_rest(blocks), WEIGHT, 4e-3, 0.5)
    travel = np.abs(state.vertices - blocks.vertices).max()
    assert travel > 0.1 and budget.friction > 0.1 * budget.gravity_work
    # 5e-5 and 4e-6 of what falls; corners as stiff as the solver's own springs, beside soft faces, made 0.4 of it from
    # nowhere.
    assert abs(budget.residual) + budget.overlap < 1e-3 * budget.gravity_work


def test_a_corner_on_a_soft_joint_is_a_spring():
    # On its corner, which lies below its middle: ω² = k/m, and released as it touches it dives to twice its settlement.
    side, stiffness, density = 2.0, 1e9, 2600.0
    diamond = turned(rectangle(0, 0, side, side), np.radians(45))
    blocks = Blocks.from_polygons([rectangle(-3, -1, 3, 0), diamond], fixed=[True, False])
    law = JointLaw("soft", 0.5, normal_stiffness=stiffness, shear_stiffness=stiffness)
    settings = DdaSettings(dynamic_factor=1.0, damping=0.0, max_displacement_ratio=1.0, newmark=(0.25, 0.5))
    system = dda.BlockSystem(blocks, [Material("stiff", 1e14, 0.0, density=density)], [law], settings=settings)
    spring = 0.05 * side * stiffness  # on a twentieth of the block's size
    mass = density * side**2
    omega, settlement = np.sqrt(spring / mass), mass * GRAVITY / spring
    steps = 400
    state, budget = marched(system, State.at_rest(blocks), WEIGHT, np.pi / omega / steps, np.pi / omega)
    corner = state.vertices[4:, 1].min()
    # The trapezoidal rule's period is (ω dt)²/12 too long, 5e-6 here, which at the lowest point is felt squared; the
    # first step (from where the corner touches, without a spring yet) is a step of free fall: of order dt.
    assert corner == pytest.approx(-2 * settlement, rel=1e-3)
    assert budget.last.contact == pytest.approx(0.5 * spring * (2 * settlement) ** 2, rel=2e-3)
    assert abs(budget.residual) < 1e-6 * budget.gravity_work


def test_energy_from_nowhere_is_reported(caplog):
    nothing = dda.StepEnergy(*[0.0] * 14)
    budget = dda.EnergyBudget().after(nothing._replace(kinetic=1.0, before=1.0))
    with caplog.at_level(logging.WARNING):
        budget = budget.after(nothing._replace(kinetic=1.005, before=1.005), 0.3)
        assert not caplog.records
        budget = budget.after(nothing._replace(kinetic=1.1, before=1.1), 0.4)
        budget = budget.after(nothing._replace(kinetic=1.12, before=1.12), 0.5)
    # Said once, and again only when it has doubled.
    assert [r.getMessage()[:9] for r in caplog.records] == ["t = 0.4 s"]
    cut = budget.cut().after(nothing._replace(kinetic=5.0, before=5.0), 0.6)
    assert cut.residual == budget.residual and cut.split == pytest.approx(3.88)


def test_unbalanced_ratio_tells_rest_from_flight():
    blocks = Blocks.from_polygons(
        [rectangle(-5, -1, 5, 0), rectangle(0, 0, 1, 1), rectangle(2, 1, 3, 2)], fixed=[True, False, False]
    )
    settings = DdaSettings(dynamic_factor=0.0, max_displacement_ratio=0.5)
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("j", friction_angle=0.6)], settings=settings)
    assert system.step(State.at_rest(blocks), WEIGHT, 0.05).statistics["unbalanced_ratio"] == pytest.approx(1.0)
    grounded = Blocks.from_polygons([rectangle(-5, -1, 5, 0), rectangle(0, 0, 1, 1)], fixed=[True, False])
    system = dda.BlockSystem(grounded, [ROCK], [JointLaw("j", friction_angle=0.6)], settings=settings)
    state = State.at_rest(grounded)
    for _ in range(3):
        result = system.step(state, WEIGHT, 0.05)
        state = result.state
    assert result.statistics["unbalanced_ratio"] < 1e-6
