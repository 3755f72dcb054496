"""Blocks of order p that move: vibrations, energy, rotation, friction, and going on from a state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import ROCK, after, moved, rectangle, system_of, turned
from scenes_of_cells import cells_of

from geomech import dda
from geomech.dda import EnergyBudget
from geomech.model import Blocks, DdaSettings, EdgeTraction, History, JointLaw, Loads, Material, State

WEIGHT = Loads(gravity=History.constant((0.0, -9.81)))
#: The trapezoidal rule, which does not dissipate, without damping.
MOVING = {"dynamic_factor": 1.0, "newmark": (0.25, 0.5), "damping": 0.0, "max_displacement_ratio": 0.1}


def run(system, loads: Loads, steps: int, state: State | None = None):
    """(state, budget) after so many steps."""
    state, budget = State.at_rest(system.blocks) if state is None else state, EnergyBudget()
    for _ in range(steps):
        result = system.step(state, loads)
        state, budget = result.state, budget.after(result.energy, result.state.time)
    return state, budget


def test_a_cantilever_vibrates_at_the_frequency_of_a_beam():
    """ω₁ = 3.5160 √(E I / ρ A) / L² (Timoshenko 1955) of a beam of slenderness 16, less 1 % by shear and rotatory inertia;
    the trapezoidal rule lowers it by (ω dt)²/12. A load that sets in lets it swing about its deflection and back."""
    length, rock = 16.0, Material("rock", 2e10, 0.0, 2500.0, plane="stress")
    glue = JointLaw("glue", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e14, shear_stiffness=1e14)
    frequency = 3.5160 / length**2 * np.sqrt(rock.youngs_modulus / rock.density / 12)
    period = 2 * np.pi / frequency
    system = system_of(
        [rectangle(-1, -0.5, 0, 0.5), rectangle(0, -0.5, length, 0.5)], [1, 0], [1, 5], joint=glue, rock=rock,
        loaded=(1, 1), time_step=period / 60, **MOVING,
    )  # fmt: skip
    loads = Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, -100.0))),))
    state, times, tip = State.at_rest(system.blocks), [0.0], [0.0]
    for _ in range(66):
        state = system.step(state, loads).state
        times.append(state.time)
        tip.append(moved(system, state, 1, [length, 0.0])[1])
    tip = np.array(tip)
    static = -100.0 * length**3 / (3 * 2e10 / 12)
    assert tip.min() == pytest.approx(2 * static, rel=0.03)
    # It comes back to where it began after a period: the vertex of a parabola through the highest three.
    k = 30 + int(np.argmax(tip[30:]))
    bend = np.polyfit(times[k - 1 : k + 2], tip[k - 1 : k + 2], 2)
    assert -bend[1] / (2 * bend[0]) == pytest.approx(period, rel=0.02)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("order", [2, 5])
def test_a_block_that_is_dropped_keeps_its_books(order):
    """All that falling has brought is lost to the time scheme, to dampers or is stored: no energy from nowhere."""
    system = system_of(
        [rectangle(-5, -1, 9, 0), rectangle(0, 0.02, 4, 0.52)], [1, 0], [1, order], **MOVING | {"damping": 0.2},
        time_step=1e-3,
    )  # fmt: skip
    state, budget = run(system, WEIGHT, 90)
    assert abs(budget.residual) < 1e-5 * budget.turnover
    assert budget.friction >= 0
    assert budget.damping > 0
    # It bounces, lower than it fell from, and lies on the floor rather than in it.
    assert 0.2499 < state.vertices[4:, 1].mean() < 0.265


def test_a_block_that_spins_is_stretched_and_keeps_spinning():
    """50 rad/s: the mean stress is ρ ω² b²/12 of first order, deflection swings about what centrifugal forces make of it,
    and neither energy nor spin grows."""
    system = system_of([rectangle(0, 0, 2, 1)], [0], [3], **MOVING, time_step=2e-4)
    state = State.at_rest(system.blocks)
    velocity = np.zeros((1, 6))
    velocity[0, 2] = 50.0
    state, budget = run(system, Loads(), 80, replace(state, velocity=velocity))
    assert state.velocity[0, 2] == pytest.approx(50.0, rel=5e-4)
    assert state.rotation[0] == pytest.approx(50.0 * state.time, rel=5e-4)
    assert abs(budget.residual) + abs(budget.scheme) < 2e-4 * budget.turnover
    assert 0 < np.abs(state.deflection[:, 0]).max() < 1e-4


@pytest.mark.parametrize(
    ("order", "turns"), [(2, 2), (3, 2), pytest.param(3, 25, marks=pytest.mark.slow), pytest.param(8, 10, marks=pytest.mark.slow)]
)  # fmt: skip
def test_a_block_that_spins_for_many_turns(verified, order, turns):
    """50 rad/s in steps of 0.1 rad, without Poisson's ratio: σx = ρω² (a² − x²)/2 and the ends move by ρω² a³/(3E), of a
    polynomial of order 3; order 2 finds the mean of that strain. The stretched block is slower by 2 ∫ x·u dA/∫ r² dA, of
    which the deflection, a sixth, is neglected."""
    half, spin = np.array([2.0, 0.5]), 50.0
    settings = DdaSettings(
        dynamic_factor=1.0, time_step=2e-3, newmark=(0.25, 0.5), damping=0.3, max_displacement_ratio=0.5
    )
    blocks = Blocks.from_polygons([rectangle(-2, -0.5, 2, 0.5)], order=[order])
    rock = Material("rock", 1e10, 0.0, 2500.0, plane="stress")
    system = dda.BlockSystem(blocks, [rock], [JointLaw("joint")], settings=settings)
    velocity = np.zeros((1, 6))
    velocity[0, 2] = spin
    state, budget = run(
        system, Loads(), round(turns * 2 * np.pi / spin / 2e-3), replace(State.at_rest(blocks), velocity=velocity)
    )
    strain = 2500.0 * spin**2 * half**2 / (3 * 1e10)
    slower = 1 + 2 * 0.8 * (strain * half**2).sum() / (half**2).sum()
    assert state.velocity[0, 2] == pytest.approx(spin / slower, rel=4e-4)
    assert state.rotation[0] == pytest.approx(spin / slower * state.time, rel=4e-4)
    assert abs(budget.residual) < 1e-5 * budget.turnover and budget.scheme > -4e-4 * budget.turnover
    assert np.abs(state.velocity[0, :2]).max() < 1e-9
    assert system.deflected is not None and state.deflection is not None
    corner = system.deflected.corners(state.vertices, state.rotation, state.deflection[:, 0])[2]
    c, s = np.cos(state.rotation[0]), np.sin(state.rotation[0])
    stretch = np.array([[c, s], [-s, c]]) @ corner - half
    # Order 2 stretches evenly, and both by the square of the slower spin.
    exact = strain * half * (state.velocity[0, 2] / spin) ** 2
    print(
        f"order {order}, {turns} turns: stretch off by {stretch / exact - 1}, spin by {state.velocity[0, 2] / spin * slower - 1:.1e}"
    )
    verified(
        f"block of order {order} that spins for {turns} turns: stretch", abs(stretch / exact - 1).max(), "ρω²a³/(3E)"
    )
    assert stretch == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize("friction", [20.0, 35.0])
def test_a_block_slides_on_an_incline_as_a_rigid_one(friction):
    slope = np.radians(30.0)
    system = system_of(
        [rectangle(-20, -1, 20, 0), rectangle(0, 0, 2, 1)], [1, 0], [1, 4], angle=slope,
        joint=JointLaw("joint", np.radians(friction)), **MOVING | {"newmark": (0.5, 1.0), "damping": 0.4},
        time_step=5e-3,
    )  # fmt: skip
    state, budget = run(system, WEIGHT, 40)
    went = (state.vertices[4:].mean(axis=0) - system.blocks.vertices[4:].mean(axis=0)) @ -turned(
        np.array([[1.0, 0.0]]), slope
    )[0]
    pull = max(0.0, np.sin(slope) - np.cos(slope) * np.tan(np.radians(friction)))
    assert went == pytest.approx(0.5 * 9.81 * pull * state.time**2, rel=1e-4, abs=2e-6)
    assert abs(budget.residual) < 1e-6 * budget.turnover


def test_a_state_goes_on_where_it_was():
    """Deflection, its rates and what points of faces remember are all that a step knows beside the vertices."""
    polygons = [rectangle(-3, -1, 3, 0), rectangle(-1, 0, 0.2, 0.6), rectangle(-1, 0.6, 1.2, 1.0)]
    one = system_of(polygons, [1, 0, 0], [1, 3, 4], **MOVING, time_step=1e-3)
    middle, _ = run(one, WEIGHT, 5)
    whole, _ = run(one, WEIGHT, 5, middle)
    again, _ = run(system_of(polygons, [1, 0, 0], [1, 3, 4], **MOVING, time_step=1e-3), WEIGHT, 5, middle)
    for name in ("vertices", "velocity", "deflection"):
        assert np.array_equal(getattr(whole, name), getattr(again, name))
    assert np.array_equal(whole.face_points, again.face_points)


def test_what_is_not_supported_is_refused_by_name():
    polygons = [rectangle(-1, -1, 3, 0), rectangle(0, 0, 2, 1)]
    with pytest.raises(ValueError, match="order 3: it supports Newmark"):
        system_of(polygons, [1, 0], [1, 3], dynamic_factor=1.0, spectral_radius=0.8)
    with pytest.raises(ValueError, match="restitution"):
        system_of(polygons, [1, 0], [1, 3], joint=JointLaw("bouncy", 0.5, restitution=0.5))
    with pytest.raises(ValueError, match="rigid block"):
        system_of(polygons, [1, 0], [1, 3], rock=replace(ROCK, rigid=True))
    with pytest.raises(ValueError, match="1 to 8"):
        system_of(polygons, [1, 0], [1, 11])
    with pytest.raises(ValueError, match="cells glued to each other need an order from 2"):
        cells_of([rectangle(0, 0, 1, 1), rectangle(1, 0, 2, 1)], 1)
    # What is fixed does not bend, whatever its order.
    assert after(system_of(polygons, [1, 0], [7, 1]), WEIGHT, 1).state.deflection is None
