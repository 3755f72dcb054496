"""Corners of blocks that turn, and corners that pass one another, in steps in which they go a long way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from geomech import dda
from geomech.dda.kinematics.simplex_integration import block_moments
from geomech.model import OPEN, Blocks, DdaSettings, History, JointLaw, Loads, Material, State

ROCK = Material("rock", 10e9, 0.25, density=2600.0)
WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))
FLOOR = np.array([[-30.0, -1.0], [0.0, -1.0], [0.0, 0.0], [-30.0, 0.0]])


def above(polygon: np.ndarray, friction_deg: float, **settings) -> dda.BlockSystem:
    """``polygon`` and a floor that ends at x = 0."""
    return dda.BlockSystem(
        Blocks.from_polygons([FLOOR, polygon], fixed=[True, False]), [ROCK],
        [JointLaw("joint", friction_angle=np.radians(friction_deg))],
        settings=DdaSettings(**{"dynamic_factor": 1.0, "max_displacement_ratio": 0.05, **settings}),
    )  # fmt: skip


def regular(corners: int, radius: float, x: float, lowest: float) -> np.ndarray:
    """A regular polygon above the floor whose lowest corner is at (``x``, ``lowest``)."""
    angle = 2 * np.pi * np.arange(corners) / corners - np.pi / 2
    return radius * np.column_stack([np.cos(angle), np.sin(angle)]) + [x, lowest + radius]


@pytest.mark.parametrize(
    "settings",
    [{}, {"newmark": (0.25, 0.5)}, {"spectral_radius": 0.8}, {"contact": "augmented"}],
    ids=["Shi", "trapezoidal", "alpha", "multipliers"],
)
def test_a_block_turns_on_its_corner_as_a_pendulum(settings):
    """I θ'' = m g r sin θ about the corner, which stays where it is on the floor; a step leaves it where the vertex
    then is."""
    radius, speed, end = 0.5, 3.0, 0.1
    missed = []
    for dt in (5e-3, 2.5e-3):
        system = above(regular(5, radius, -12.0, 0.0), 60.0, **settings)
        state, budget = State.at_rest(system.blocks), dda.EnergyBudget()
        state.velocity[1, :3] = [radius * speed, 0.0, -speed]
        _, _, _, xx, yy, _ = block_moments(state.vertices, system.blocks.next_vertex, system.blocks.vertex_start)[1]
        inertia = (xx + yy) / system.blocks.areas()[1] + radius**2
        exact = solve_ivp(
            lambda t, y, i=inertia: [y[1], 9.81 * radius / i * np.sin(y[0])],
            (0, end),
            [0, speed],
            rtol=1e-10,
            atol=1e-12,
        ).y[:, -1]
        size, off = float(np.sqrt(system.blocks.areas()[1])), 0.0
        while state.time < end * (1 - 1e-9):
            result = system.step(state, WEIGHT, min(dt, end - state.time))
            state, budget = result.state, budget.after(result.energy, result.state.time)
            touching = result.contacts[(result.contacts["state"] != OPEN) & (result.contacts["block"] == 1)]
            assert len(touching) == 1
            # The floor's top is y = 0.
            off = max(off, float(np.abs(state.vertices[touching["vertex"], 1] - touching["gap"]).max()))
        missed.append(np.abs([-state.rotation[1] / exact[0] - 1, -state.velocity[1, 2] / exact[1] - 1]))
        print(f"dt = {dt:g} s: angle and speed off by {missed[-1]}, the corner's gap by {off / size:.1e} of the block")
        # Known to a tenth of the radius of corners.
        assert off < 2e-6 * size
        assert abs(budget.residual) < 1e-5 * budget.turnover
        assert abs(budget.scheme) < 3e-4 * budget.turnover
    # Second order, and 1e-6 of elastic give; the speed swings about by as much as the angle is off.
    assert missed[1][0] < 0.29 * missed[0][0] < 4e-5 and (np.array(missed)[:, 1] < 1e-4).all()


def pivoting(dt: float, end: float, **settings) -> np.ndarray:
    """Angle and speed at ``end`` (s) of a pentagon that turns on its corner, 3 rad/s at the start."""
    system = above(regular(5, 0.5, -12.0, 0.0), 60.0, **settings)
    state = State.at_rest(system.blocks)
    state.velocity[1, :3] = [1.5, 0.0, -3.0]
    while state.time < end * (1 - 1e-9):
        state = system.step(state, WEIGHT, min(dt, end - state.time)).state
    return -np.array([state.rotation[1], state.velocity[1, 2]])


def pivot(end: float, delay: float = 0.0) -> np.ndarray:
    """The same of the pendulum I θ'' = m g r sin θ. With accelerations a + ``delay`` ȧ the moment of the force F of the
    corner does not change as that of F + ``delay`` Ḟ does, but by ``delay`` ṙ × F more: r θ' m (g cos θ − r θ'²)."""
    r, polygon = 0.5, regular(5, 0.5, -12.0, 0.0)
    area, _, _, xx, yy, _ = block_moments(polygon, np.roll(np.arange(5), -1), np.array([0, 5]))[0]
    share = r * r / ((xx + yy) / area + r * r)

    def rates(t, y):
        turn, speed = y
        return [speed, share * (9.81 / r * np.sin(turn) + delay * speed * (9.81 / r * np.cos(turn) - speed * speed))]

    return solve_ivp(rates, (0, end), [0, 3.0], rtol=1e-10, atol=1e-12).y[:, -1]


@pytest.mark.parametrize("radius", [0.0, 0.4142, 0.8])
def test_the_alpha_scheme_follows_a_block_that_turns_to_second_order(radius):
    missed = np.array([pivoting(dt, 0.1, spectral_radius=radius) / pivot(0.1) - 1 for dt in (1e-2, 5e-3, 2.5e-3)])
    print(f"ϱ = {radius}: angle and speed off by {missed.tolist()}")
    assert np.log2(missed[:-1] / missed[1:]) == pytest.approx(2.0, abs=0.2) and np.abs(missed[-1]).max() < 7e-5


@pytest.mark.parametrize("newmark", [(1.0, 1.5), (0.75, 1.0), (0.5, 0.75)])
def test_newmarks_scheme_off_gamma_2_beta_follows_a_block_that_turns_as_well_as_one_on_it(newmark):
    """The acceleration kept would be late by (γ − 2β) dt ȧ; of contacts that steps do not resolve none is kept."""
    beta, gamma = newmark
    exact, dt = pivot(0.1), 5e-3
    late = np.abs(pivot(0.1, (gamma - 2 * beta) * dt) / exact - 1)
    missed = np.array([np.abs(pivoting(step, 0.1, newmark=newmark) / exact - 1) for step in (dt, 0.5 * dt)])
    print(f"{newmark}: angle and speed off by {missed.tolist()}, would be late by {late}")
    assert (missed[0] < 0.1 * late).all() and missed[0].max() < 7e-5 and missed[1].max() < 7e-5


@pytest.mark.parametrize("settings", [{}, {"contact": "augmented"}], ids=["springs", "multipliers"])
def test_a_block_that_falls_over_in_statics_stays_on_its_corner_and_gains_no_energy(settings):
    """Nothing holds it: it turns by some 0.02 rad a step about a corner, which would lift off the floor by 1e-4 of the
    block, or be pressed in, if it went straight on."""
    system = above(
        regular(5, 0.5, -12.0, 0.0) @ np.array([[1.0, 0.0], [0.2, 1.0]]), 60.0, dynamic_factor=0.0, **settings
    )
    state, budget = State.at_rest(system.blocks), dda.EnergyBudget()
    size = float(np.sqrt(system.blocks.areas()[1]))
    for _ in range(6):
        result = system.step(state, WEIGHT, 0.12)
        state, budget = result.state, budget.after(result.energy, result.state.time)
        touching = result.contacts[(result.contacts["state"] != OPEN) & (result.contacts["block"] == 1)]
        assert len(touching) == 1
        # The floor's top is y = 0; known to a thousandth of the radius of corners.
        assert np.abs(state.vertices[touching["vertex"], 1] - touching["gap"]).max() < 2e-8 * size
    print(f"turned by {state.rotation[1]:.3f}, residual {budget.residual / budget.turnover:.1e}")
    assert abs(state.rotation[1]) > 0.1
    assert abs(budget.residual) < 1e-6 * budget.turnover


@pytest.mark.parametrize("corners", [3, 4, 7])
@pytest.mark.parametrize("short", [2e-2, 1e-3, 2e-4, 1e-4, 1e-6])
def test_a_corner_that_comes_to_the_end_of_a_face_is_not_pushed_on(short, corners):
    """Without friction the floor pushes upwards: nothing changes the speed along it before its end is passed, nor is
    there an overlap to be pushed out of, though the floor's end is behind one of the block's edges by what a step
    goes."""
    speed, dt, steps = 5.0, 5e-3, 6
    system = above(regular(corners, 0.5, -steps * speed * dt - short, 0.0), 0.0)
    state = State.at_rest(system.blocks)
    state.velocity[1, 0] = speed
    for _ in range(steps):
        result = system.step(state, WEIGHT, dt)
        state = result.state
        assert abs(state.velocity[1, 0] - speed) < 1e-12 * speed and result.energy.overlap == 0.0
    assert state.vertices[4, 0] == pytest.approx(-short, abs=1e-4)
