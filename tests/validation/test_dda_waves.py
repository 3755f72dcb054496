"""Waves along a row of blocks against `geomech.reference.blocks.block_chain`: dispersion, speed, reflection, energy."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import march, moved, rectangle, system_of

from geomech import dda
from geomech.model import JointLaw, Loads, Material, State
from geomech.reference.blocks import block_chain as exact

E, DENSITY, JOINT = 10e9, 2600.0, 20e9  # Pa, kg/m³, Pa/m; blocks of 1 m
CHAIN = (1.0, DENSITY, JOINT, E)  # length, mass, joint and axial stiffness


def row(n: int, fixed_end: bool = False, newmark=(0.25, 0.5)) -> dda.BlockSystem:
    """Blocks along x, joints that carry tension; ν = 0, so that nothing but the motion along the row stirs."""
    blocks = [rectangle(k, 0, k + 1, 1) for k in range(n)]
    law = JointLaw("bonded", 0.5, 1e9, 1e9, normal_stiffness=JOINT, shear_stiffness=JOINT)
    return system_of(
        [rectangle(n, -1, n + 1, 2), *blocks] if fixed_end else blocks, [law], fixed=int(fixed_end),
        rock=Material("rock", E, 0.0, density=DENSITY), damping=0.0, max_displacement_ratio=1.0, newmark=newmark,
    )  # fmt: skip


def struck(system: dda.BlockSystem, speed: np.ndarray, strain_rate: np.ndarray | None = None) -> State:
    state = State.at_rest(system.blocks)
    state.velocity[-len(speed) :, 0] = speed
    if strain_rate is not None:
        state.velocity[-len(speed) :, 3] = strain_rate
    return state


@pytest.mark.parametrize("mode", [1, 10, 20, 30, 39])
def test_standing_waves_have_the_frequencies_of_the_chain(verified, mode):
    # u ∝ cos q(k+½)h and e ∝ sin q(k+½)h are modes of a row with free ends. The trapezoidal rule makes tan(ω'dt/2) = ω
    # dt/2.
    n = 40
    q = mode * np.pi / n
    omega = exact.dispersion(np.array([q]), *CHAIN)[0, 0]
    dt = 2 * np.pi / omega / 50
    # Ratio of the amplitudes from the first row of the chain's equations: (2K(1−c) − m ω²) u = 2K s (e h/2).
    ratio = 2 * (2 * JOINT * (1 - np.cos(q)) - DENSITY * omega**2) / (2 * JOINT * np.sin(q))
    phase = q * (np.arange(n) + 0.5)
    speed = 1e-3 * np.cos(phase)
    system = row(n)
    seen = 2 / dt * np.arctan(0.5 * omega * dt)
    end = dt * round(3.3 * 2 * np.pi / seen / dt)
    state = march(system, struck(system, speed, -1e-3 * ratio * np.sin(phase)), Loads(), end, dt)
    got = float(state.velocity[:, 0] @ speed / (speed @ speed))
    print(
        f"q h = {q:.4f}: ω = {omega:.2f} rad/s, after {seen * end / 2 / np.pi:.3f} periods {got:.8f} "
        f"({np.cos(seen * end):.8f})"
    )
    verified(
        "standing waves of five lengths in a row of 40 blocks: amplitude after 3.3 periods",
        got - np.cos(seen * end),
        "closed form of the chain",
    )
    # The blocks' geometry follows the wave: strains of 1e-6.
    assert got == pytest.approx(np.cos(seen * end), abs=1e-6)
    assert state.velocity[:, 0] == pytest.approx(got * speed, abs=1e-8)


def run_and_back(fixed_end: bool, finer: int = 1) -> float:
    """Error, in units of its height, of a pulse ten blocks wide that has run to the end of a row and back, against the
    continuum's; of one ``finer`` times as many blocks wide in as many times as long a row. Asserts that it is the
    chain's."""
    n, wide, dt, speed = 60 * finer, 5.0 * finer, 2e-4, exact.long_wave_speed(*CHAIN)
    x, at = np.arange(n) + 0.5, 25 * finer
    pulse = 1e-3 * np.exp(-(((x - at) / wide) ** 2))
    system = row(n, fixed_end)
    masses, stiffness = exact.chain_matrices(n, *CHAIN, fixed_end)
    rate = np.zeros(2 * n)
    rate[::2] = pulse
    # Half of it runs each way; the right half, reflected at the end, stands 40 m from it when it has run 75 m.
    end = dt * round(75.0 * finer / speed / dt)
    start = struck(system, pulse)
    state = march(system, start, Loads(), end, dt)
    displacement, velocity = exact.chain_motion(masses, stiffness, rate, end, dt)
    got = state.velocity[-n:, 0]
    assert got == pytest.approx(velocity[::2], abs=2e-9 * finer)
    assert moved(system, state)[-n:, 0] == pytest.approx(displacement[::2], abs=2e-6 * np.abs(displacement).max())
    # d'Alembert: at a free end velocity comes back as it went, at a fixed one reversed. The left half, reflected at the
    # free left end, has met it there, and its front is at the right end.
    travelled, sign = speed * end, -1 if fixed_end else 1

    def half(x0):
        return 0.5e-3 * np.exp(-(((x - x0) / wide) ** 2))

    continuum = half(travelled - at) + sign * (half(2 * n - (at + travelled)) + half(2 * n - (travelled - at)))
    error = np.abs(got - continuum).max() / 0.5e-3
    print(
        f"{'fixed' if fixed_end else 'free'} end: speed {speed:.1f} m/s, pulse of {2 * wide:g} blocks against the "
        f"continuum {error:.4f} of its height"
    )
    return error


def test_a_pulse_comes_back_from_a_fixed_end():
    # (q h)²/24 of dispersion over 75 blocks, a pulse of ten: a few per cent.
    assert run_and_back(fixed_end=True) < 0.05


def test_a_pulse_comes_back_from_a_free_end_and_a_row_is_a_continuum_to_second_order(verified):
    coarse, fine = run_and_back(fixed_end=False), run_and_back(fixed_end=False, finer=2)
    print(f"order {np.log2(coarse / fine):.2f}")
    verified(
        "pulse that runs to the end of a row and back", [coarse, fine], "bar", over=("blocks in the pulse", (10, 20))
    )
    assert coarse < 0.05
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.1)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("newmark", [(0.25, 0.5), (0.5, 1.0)])
def test_waves_gain_no_energy(newmark):
    n, dt = 40, 1e-4
    system = row(n, newmark=newmark)
    state = struck(system, 1e-3 * np.exp(-(((np.arange(n) - 12) / 3.0) ** 2)))
    start = 0.5 * DENSITY * np.sum(state.velocity[:, 0] ** 2)
    energies = []

    def watch(result):
        s = result.statistics
        energies.append((s["kinetic_energy"] + s["elastic_energy"] + s["contact_energy"]) / start)

    end = march(system, state, Loads(), 0.05, dt, watch)
    print(f"Newmark {newmark}: energy left after 500 steps {energies[-1]:.8f}")
    # Strains of 1e-6 change the geometry, and with it the stiffness.
    assert max(energies) < 1 + 1e-6
    assert max(np.diff(energies)) < 1e-6
    if newmark == (0.25, 0.5):
        assert energies[-1] == pytest.approx(1.0, abs=1e-5)
    assert np.sum(end.velocity[:, 0]) == pytest.approx(np.sum(state.velocity[:, 0]), rel=1e-9)
