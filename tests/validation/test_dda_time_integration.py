"""Time schemes and damping against the closed forms of an oscillator: amplification, decay, period, impact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.conventions import rotate_stress
from geomech.model import (
    OPEN,
    Blocks,
    DdaSettings,
    History,
    JointLaw,
    Loads,
    Material,
    State,
    rayleigh_coefficients,
)
from geomech.reference.blocks import block_motion as exact

SCHEMES = {
    "Shi": (0.5, 1.0),
    "trapezoidal": (0.25, 0.5),
    "between": (0.3, 0.6),
    "damped": (0.3025, 0.6),
    "strong": (1.0, 1.5),
}


def square(newmark, *, damping=0.0, **more) -> tuple[dda.BlockSystem, float]:
    """A free unit square that breathes along x (ν = 0 uncouples y), and its frequency ω."""
    settings = DdaSettings(dynamic_factor=1.0, damping=damping, max_displacement_ratio=1.0, newmark=newmark, **more)
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    system = dda.BlockSystem(blocks, [Material("rock", 10e9, 0.0, density=2600.0)], settings=settings)
    return system, exact.square_block_frequency(1.0, 10e9, 2600.0)


def bouncer(newmark, *, ratio=1.0, normal_stiffness=1e8, **more) -> tuple[dda.BlockSystem, float, float]:
    """A stiff 1 × 1 m block on a soft joint of a fixed floor, the frequency of its bouncing, and its settlement, m."""
    blocks = Blocks.from_polygons([rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 1)], fixed=[True, False])
    settings = DdaSettings(dynamic_factor=1.0, damping=0.0, max_displacement_ratio=ratio, newmark=newmark, **more)
    system = dda.BlockSystem(
        blocks, [Material("rock", 1e14, 0.0, density=2500.0)],
        [JointLaw("soft", normal_stiffness=normal_stiffness, shear_stiffness=normal_stiffness)], settings=settings,
    )  # fmt: skip
    return system, float(np.sqrt(normal_stiffness / 2500.0)), 2500.0 * 9.81 / normal_stiffness


@pytest.mark.parametrize("name", SCHEMES)
def test_a_block_vibrates_as_newmarks_oscillator(name):
    newmark = SCHEMES[name]
    system, omega = square(newmark)
    for omega_dt in (0.1, 1.0, 3.0, 10.0, 1000.0):
        dt = omega_dt / omega
        state = replace(State.at_rest(system.blocks), acceleration=np.zeros((1, 6)))
        state.velocity[0, 3] = 1e-8 * omega
        x = np.array([0.0, 1e-8 * omega_dt, 0.0])
        step = exact.newmark_amplification(omega_dt, *newmark)
        for _ in range(10):
            state = system.step(state, Loads(), dt).state
            x = step @ x
            # The block stretches by 1e-8, and its moments with it.
            assert [state.stress[0, 0] / 10e9, state.velocity[0, 3] * dt] == pytest.approx(x[:2], rel=2e-6, abs=1e-14)


@pytest.mark.parametrize("radius", [0.0, 0.5, 0.8, 1.0])
def test_a_block_vibrates_as_the_alpha_scheme_says(radius):
    system, omega = square((0.5, 1.0), spectral_radius=radius)
    for omega_dt in (0.1, 1.0, 3.0, 10.0, 1000.0):
        dt = omega_dt / omega
        state = replace(State.at_rest(system.blocks), acceleration=np.zeros((1, 6)))
        state.velocity[0, 3] = 1e-8 * omega
        x = np.array([0.0, 1e-8 * omega_dt, 0.0])
        step = exact.bossak_amplification(omega_dt, radius)
        for _ in range(10):
            state = system.step(state, Loads(), dt).state
            x = step @ x
            assert [state.stress[0, 0] / 10e9, state.velocity[0, 3] * dt] == pytest.approx(x[:2], rel=2e-6, abs=1e-14)
    assert np.abs(np.linalg.eigvals(exact.bossak_amplification(1e6, radius))).max() == pytest.approx(radius, abs=2e-4)


def test_the_alpha_scheme_damps_short_waves_and_not_long_ones():
    # Damping of order Ω³, period of order Ω²; Shi's damping is of order Ω and his |λ| goes to 1 as Ω goes to infinity.
    found = []
    for omega_dt in (0.2, 0.1, 0.05):
        damping, turn = exact.apparent_oscillation(exact.bossak_amplification(omega_dt, 0.5))
        found.append([damping, 1 - turn / omega_dt])
    orders = np.log2(np.array(found[:-1]) / np.array(found[1:]))
    print(f"ϱ = 0.5: damping {found[1][0]:.1e} and period error {found[1][1]:.1e} at Ω = 0.1, orders {orders.tolist()}")
    assert orders[-1] == pytest.approx([3, 2], abs=0.1)
    assert np.abs(np.linalg.eigvals(exact.shi_amplification(1e4))).max() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(("name", "decay_order"), [("Shi", 1), ("trapezoidal", None), ("damped", 1)])
def test_decay_and_period_of_a_block_on_a_joint_have_their_orders(name, decay_order):
    """The joint is the spring. Measured over five periods, held against λ of the scheme, and the orders of its
    errors."""
    newmark = SCHEMES[name]
    found = []
    for n in (20, 40):
        system, omega, settled = bouncer(newmark)
        dt = 2 * np.pi / omega / n
        state = State.at_rest(system.blocks)
        state = replace(state, vertices=state.vertices - np.repeat([[0, 0], [0, settled]], 4, axis=0))
        state = replace(state, acceleration=np.zeros((2, 6)))
        state.velocity[1, 1] = 0.3 * settled * omega  # stays in contact
        speed, height = [], []
        for _ in range(5 * n):
            state = system.step(state, Loads(gravity=History.constant([0.0, -9.81])), dt).state
            height.append(state.vertices[4:, 1].mean() - 0.5 + settled)
            speed.append(state.velocity[1, 1])
        step = exact.newmark_amplification(omega * dt, *newmark)
        x = np.linalg.matrix_power(step, 5 * n) @ np.array([0.0, 0.3 * settled * omega * dt, 0.0])
        # The block's own compliance is a millionth of the joint's: as much of the phase of five periods.
        size = 0.3 * settled
        assert [height[-1] / size, speed[-1] / omega / size] == pytest.approx(
            [x[0] / size, x[1] / omega / dt / size], abs=5e-5
        )
        damping, turn = exact.apparent_oscillation(step)
        found.append([damping, abs(turn / (omega * dt) - 1)])
    errors = np.array(found)
    orders = np.log2(np.maximum(errors[:-1], 1e-300) / np.maximum(errors[1:], 1e-300)).T
    print(f"{name}: damping {errors[:, 0]}, period error {errors[:, 1]}, orders {orders.round(2).tolist()}")
    assert orders[1] == pytest.approx([2], abs=0.1)
    if decay_order is None:
        assert np.abs(errors[:, 0]).max() < 1e-13
    else:
        assert orders[0] == pytest.approx([decay_order], abs=0.1)


def test_shi_takes_a_quarter_of_omega_dt_and_the_trapezoidal_rule_nothing():
    for omega_dt in (0.01, 0.02):
        damping, turn = exact.apparent_oscillation(exact.newmark_amplification(omega_dt, 0.5, 1.0))
        assert damping == pytest.approx(omega_dt / 4, rel=1e-3)
        assert 1 - turn / omega_dt == pytest.approx(5 / 24 * omega_dt**2, rel=0.6)
        damping, turn = exact.apparent_oscillation(exact.newmark_amplification(omega_dt, 0.25, 0.5))
        assert abs(damping) < 1e-12
        assert 1 - turn / omega_dt == pytest.approx(omega_dt**2 / 12, rel=1e-3)


@pytest.mark.parametrize("name", ["Shi", pytest.param("trapezoidal", marks=pytest.mark.slow)])
def test_a_bounce_loses_what_the_scheme_loses(verified, name):
    """Undamped, half a swing v = v₀ cos ωt on the joint: Shi's scheme takes ½ k Δg² a step, dt ½ k ∫ v² dt = (π/2) ω dt
    of ½ m v₀², by its own dissipation; the trapezoidal rule what the steps miss in which the joint is met and left, of
    second order. All of it is booked as the scheme's."""
    losses = []
    for steps in (20, 40, 80):
        lost = []
        for met in (0.01, 0.26, 0.51, 0.76):  # at which part of a step
            system, omega, _ = bouncer(SCHEMES[name], normal_stiffness=1e9)
            dt = np.pi / omega / steps
            state, budget = State.at_rest(system.blocks), dda.EnergyBudget()
            state.vertices[4:, 1] += met * dt
            state.velocity[1, 1] = -1.0
            for _ in range(steps + 4):
                result = system.step(state, Loads(), dt)
                state, budget = result.state, budget.after(result.energy, result.state.time)
            assert (state.contacts["state"] == OPEN).all() and abs(budget.residual) < 1e-12 * budget.start
            lost.append(1 - budget.last.kinetic / budget.start)
            assert budget.scheme / budget.start == pytest.approx(lost[-1], abs=1e-6)
        losses.append(max(lost))
    orders = np.log2(np.array(losses[:-1]) / losses[1:])
    print(f"{name}: a bounce of 20, 40, 80 steps loses {losses} of its energy, orders {orders.round(2)}")
    verified(f"energy that a bounce loses, {name}", losses, "none", over=("steps a bounce", (20, 40, 80)))
    if name == "Shi":
        assert losses[-1] == pytest.approx(0.5 * np.pi * np.pi / 80, rel=0.04)
        assert orders == pytest.approx([1, 1], abs=0.1)
    else:
        assert orders == pytest.approx([2, 2], abs=0.15) and losses[-1] < 1e-3


@pytest.mark.parametrize(
    ("name", "dt"),
    [
        *((name, 1e-3) for name in ("Shi", "trapezoidal", "between")),
        *(pytest.param(name, 1e-4, marks=pytest.mark.slow) for name in ("Shi", "trapezoidal", "between")),
    ],
)
def test_a_dropped_block_never_gains_energy_however_often_it_bounces(name, dt):
    # γ = 2β: contact met or left within a step loses energy, closed contact (2θ−1) of ½ k Δg², never gains.
    system, _, _ = bouncer(SCHEMES[name], normal_stiffness=1e9)
    state = State.at_rest(system.blocks)
    state = replace(state, vertices=state.vertices + np.repeat([[0, 0], [0, 0.001]], 4, axis=0))
    energies = []
    while state.time < 0.08:
        result = system.step(state, Loads(gravity=History.constant([0.0, -9.81])), dt)
        state = result.state
        s = result.statistics
        height = (state.vertices - system.blocks.vertices)[4:, 1].mean()
        energies.append(s["kinetic_energy"] + s["elastic_energy"] + s["contact_energy"] + 2500.0 * 9.81 * height)
    start = 2500.0 * 9.81 * 0.001
    energies = np.array([start, *energies])
    # Round-off of 1e-16 m on springs of 1e9 N/m and blocks of 1e14 Pa stands against 25 J.
    assert np.diff(energies).max() < 1e-7 * start
    print(f"{name}, dt = {dt:g} s: {energies[-1] / start:.4f} of the energy left after 0.08 s")
    if name == "trapezoidal" and dt == 1e-4:
        assert energies[-1] > 0.9 * start


@pytest.mark.parametrize(("newmark", "radius"), [((0.3025, 0.6), None), ((0.5, 1.0), 0.8), ((0.5, 1.0), 0.5)])
@pytest.mark.parametrize("dt", [1e-3, pytest.param(2e-4, marks=pytest.mark.slow)])
def test_schemes_that_keep_an_acceleration_gain_no_energy_from_a_bounce(newmark, radius, dt):
    # The acceleration of the step before is kept; whether a bounce gains is no theorem there: measured.
    system, _, _ = bouncer(newmark, normal_stiffness=1e9, spectral_radius=radius)
    state = State.at_rest(system.blocks)
    state = replace(state, vertices=state.vertices + np.repeat([[0, 0], [0, 0.001]], 4, axis=0))
    top, touched = 0.0, False
    while state.time < 0.08:
        result = system.step(state, Loads(gravity=History.constant([0.0, -9.81])), dt)
        state, s = result.state, result.statistics
        height = (state.vertices - system.blocks.vertices)[4:, 1].mean()
        pressed = (result.contacts["normal_force"] > 0).any()
        touched |= pressed
        if touched and not pressed:
            top = max(top, s["kinetic_energy"] + 2500.0 * 9.81 * height)
    print(
        f"β, γ = {newmark}, ϱ = {radius}, dt = {dt:g} s: {top / (2500.0 * 9.81 * 0.001):.4f} of the energy after a "
        "bounce"
    )
    assert 0 < top < 2500.0 * 9.81 * 0.001


@pytest.mark.first_by_default(3)
@pytest.mark.parametrize("newmark", [(0.5, 0.75), (1.0, 1.25), (0.3, 0.55)])
@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_steps_that_do_not_resolve_a_bounce_never_throw_the_block_higher(newmark, damping):
    """On springs of 40 E' an impact is over within a step. With the accelerations of impacts kept, a block rose to 5 times
    its height with β, γ = 1, 1.25, to 60 times with ½, ½."""
    blocks = Blocks.from_polygons([rectangle(-3, -1, 3, 0), rectangle(0, 0.02, 1, 1.02)], fixed=[True, False])
    rock = Material("rock", 5e9, 0.25, density=2600.0)
    settings = DdaSettings(dynamic_factor=1.0, damping=damping, newmark=newmark)
    system = dda.BlockSystem(blocks, [rock], [JointLaw("joint", 0.5)], settings=settings)
    state, start, most = State.at_rest(blocks), 2600.0 * 9.81 * 0.02, 0.0
    for _ in range(200):
        result = system.step(state, Loads(gravity=History.constant([0.0, -9.81])), 0.01)
        state = result.state
        height = state.vertices[4:, 1].mean() - 0.5
        stored = sum(result.statistics[f"{kind}_energy"] for kind in ("kinetic", "elastic", "contact"))
        most = max(most, (stored + 2600.0 * 9.81 * height) / start)
    print(f"β, γ = {newmark}, damping {damping}: {most:.6f} of the energy at most, {state.time:.2f} s")
    assert state.time > 0.15 and 0.9 < most < 1 + 1e-6


def test_rayleigh_damping_has_the_fractions_asked_for():
    fractions = (0.05, 0.02)
    omega = exact.square_block_frequency(1.0, 10e9, 2600.0)
    hertz = omega / (2 * np.pi)
    n = 200
    for frequencies, expected in (((hertz, 10 * hertz), fractions[0]), ((0.1 * hertz, hertz), fractions[1])):
        alpha, beta = rayleigh_coefficients(fractions if expected == fractions[0] else (0.1, 0.02), frequencies)
        system, _ = square((0.25, 0.5), rayleigh_mass=alpha, rayleigh_stiffness=beta)
        state = State.at_rest(system.blocks)
        state.velocity[0, 3] = 1e-8 * omega
        rates = []
        for _ in range(5 * n // 2):
            state = system.step(state, Loads(), 2 * np.pi / omega / n).state
            rates.append(state.velocity[0, 3])
        peaks = [max(rates[k * n + n // 2 : (k + 1) * n + n // 2]) for k in range(2)]
        # Peaks are sampled n times a cycle: (π/n)²/2; the scheme is of second order.
        assert peaks[1] / peaks[0] == pytest.approx(np.exp(-2 * np.pi * expected / np.sqrt(1 - expected**2)), rel=5e-4)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("dt", [2e-3, 4e-4])
def test_mass_damping_gives_a_falling_block_its_final_speed(dt):
    # m v' = m g − α m v: v = g/α (1 − exp(−α t)); both schemes are of second order with damping by the mean velocity.
    for newmark in ((0.5, 1.0), (0.25, 0.5)):
        system, _ = square(newmark, rayleigh_mass=20.0)
        state = State.at_rest(system.blocks)
        while state.time < 0.1 * (1 - 1e-9):
            state = system.step(state, Loads(gravity=History.constant([0.0, -9.81])), dt).state
        assert -state.velocity[0, 1] == pytest.approx(9.81 / 20 * (1 - np.exp(-2.0)), rel=2 * (20 * dt) ** 2)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("name", ["Shi", "trapezoidal", "damped"])
def test_angular_momentum_in_free_flight_is_kept_to_round_off(name):
    # A scheme that keeps the last acceleration kicks the spin with that of another geometry: 1e-7 here.
    # Soft, spinning fast, thrown, vibrating, and not symmetric: the moment of inertia swings by a few per cent.
    polygon = np.array([[0, 0], [2, 0.2], [1.6, 1.1], [0.3, 0.9]])
    blocks = Blocks.from_polygons([polygon])
    settings = DdaSettings(dynamic_factor=1.0, damping=0.0, max_displacement_ratio=10.0, newmark=SCHEMES[name])
    system = dda.BlockSystem(blocks, [Material("soft", 1e7, 0.3, density=2000.0)], settings=settings)
    state = State.at_rest(blocks)
    state.velocity[0] = [3.0, 1.0, 20.0, 0.5, -0.3, 0.8]

    def momentum(state):
        moments = dda.block_moments(state.vertices, blocks.next_vertex, blocks.vertex_start)[0]
        return (dda.mass_matrix(moments, 2000.0 * blocks.areas()[0] / moments[0]) @ state.velocity[0])[:3]

    start, inertia = momentum(state), []
    for _ in range(300):
        state = system.step(state, Loads(), 1e-3).state
        assert momentum(state) == pytest.approx(start, rel=1e-12 if name != "damped" else 1e-6)
        inertia.append(float(state.velocity[0, 2]))
    assert np.ptp(inertia) > 0.02 * 20.0


def test_stress_turns_with_the_block_whatever_the_axes():
    """Objectivity: the same spinning, vibrating block drawn at another angle has the same history, turned by that
    angle."""
    polygon = np.array([[0, 0], [2, 0.2], [1.6, 1.1], [0.3, 0.9]])
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    ends = []
    for a, r in ((0.0, np.eye(2)), (angle, turn)):
        blocks = Blocks.from_polygons([polygon @ r.T])
        settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=10.0)
        system = dda.BlockSystem(blocks, [Material("soft", 1e8, 0.3, density=2000.0)], settings=settings)
        state = State.at_rest(blocks)
        state.velocity[0, 2] = 20.0
        state.stress[0] = rotate_stress(np.array([1e5, -2e5, 3e4]), a)
        for _ in range(200):
            state = system.step(state, Loads(), 1e-3).state
        ends.append((state.stress[0], state.vertices @ r))
    assert rotate_stress(ends[0][0], angle) == pytest.approx(ends[1][0], rel=1e-9, abs=1e-9 * 1e5)
    assert ends[1][1] == pytest.approx(ends[0][1], abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"newmark": (0.25, 0.4)}, "2β ≥ γ ≥ ½"),
        ({"newmark": (0.2, 0.5)}, "not unconditionally stable"),
        ({"newmark": (0.5, 0.5)}, "blocks that bounce gain energy"),
        ({"newmark": (1.0, 1.0)}, "blocks that bounce gain energy"),
        ({"damping": -0.1}, "damping must not be negative"),
        ({"rayleigh_mass": -1.0}, "rayleigh_mass must not be negative"),
        ({"spectral_radius": 1.5}, "spectral_radius must be from 0 to 1"),
        ({"dynamic_factor": 1.2}, "dynamic_factor must be from 0 to 1"),
    ],
)
def test_schemes_that_drive_the_blocks_are_refused(change, message):
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    with pytest.raises(ValueError, match=message):
        dda.BlockSystem(blocks, [Material("rock", 1e10, 0.2)], settings=DdaSettings(**change))


def test_rayleigh_fractions_that_need_driving_are_refused():
    with pytest.raises(ValueError, match="negative coefficient"):
        rayleigh_coefficients((0.01, 0.5), (10.0, 1.0))
