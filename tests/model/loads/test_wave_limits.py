"""Up to which frequency a scheme keeps waves: against closed forms of the schemes, and waves in a row of blocks."""

import math

import numpy as np
import pytest

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State, ViscousBoundary
from geomech.model.loads.wave_limits import scheme_eigenvalue, wave_limits
from geomech.reference.blocks import block_chain

ROCK = Material("rock", 10e9, 0.25, density=2500.0)
SPEED = ROCK.pressure_wave_speed


def test_the_trapezoidal_rule_keeps_amplitude_and_lengthens_the_period():
    value = scheme_eigenvalue(0.3, (0.25, 0.5), None)
    assert abs(value) == pytest.approx(1.0, abs=1e-14)
    assert math.atan2(value.imag, value.real) == pytest.approx(2 * math.atan(0.15), rel=1e-12)


def test_shis_scheme_damps_in_proportion_to_the_step():
    # Newmark's schemes damp by (γ − ½) Ω/2 of critical to first order in Ω (Hughes 1987): Ω/4 with γ = 1.
    for omega in (0.01, 0.1):
        value = scheme_eigenvalue(omega, (0.5, 1.0), None)
        assert -math.log(abs(value)) / omega == pytest.approx(omega / 4, rel=omega)


def test_the_second_order_scheme_ends_at_its_spectral_radius():
    assert abs(scheme_eigenvalue(1e5, (0.5, 1.0), 0.8)) == pytest.approx(0.8, rel=1e-3)
    assert abs(scheme_eigenvalue(0.1, (0.5, 1.0), 0.8)) == pytest.approx(1.0, abs=1e-5)


def test_each_limit_is_where_its_formula_puts_it():
    found = wave_limits(2000.0, 4.0, 1e-4, 0.0, 1e-3, (0.25, 0.5), None)
    # 1 − exp(−2π π f τ) = 0.05 (frequencies are 2 % apart); a row of blocks on stiff joints at kh = 1.092, whose wave is 5 %
    # too fast.
    assert found.damping == pytest.approx(-math.log(0.95) / (2 * math.pi**2 * 1e-4), rel=0.03)
    wave = 1.092 / 4.0
    chain = block_chain.dispersion(np.array([wave]), 4.0, 4 * 2500.0, 1e16, 2500.0 * 2000.0**2 / 4.0)[0, 0]
    assert chain == pytest.approx(1.05 * 2000.0 * wave, rel=1e-3)
    assert 0.999 < found.size / (chain / (2 * math.pi)) < 1.03
    # 2 atan(Ω/2) = 0.95 Ω at Ω = 0.81.
    assert found.scheme == pytest.approx(0.81 / (2 * math.pi * 1e-3), rel=0.03)
    assert found.all <= min(found.scheme, found.damping, found.size)


def kept_in_a_row(frequency: float, dt: float, damping: float, newmark, radius) -> float:
    """What is left of the amplitude of a wave of ``frequency``, Hz, after a wavelength in a row of glued squares of 1 m."""
    n = 70
    names = [[["", "right" if k == n - 1 else "", "", "left" if k == 0 else ""]] for k in range(n)]
    blocks = Blocks.from_polygons(
        [np.array([[k, 0], [k + 1, 0], [k + 1, 1], [k, 1.0]]) for k in range(n)],
        edge_names=names, constrained=[[False, True, True, False, True, True]] * n,
    )  # fmt: skip
    settings = DdaSettings(
        dynamic_factor=1.0, damping=damping, newmark=newmark, spectral_radius=radius, max_displacement_ratio=1.0
    )
    system = dda.BlockSystem(
        blocks, [ROCK], [JointLaw("glue", cohesion=1e12, tensile_strength=1e12)], settings=settings
    )
    t = np.linspace(0, 4 / frequency, 1601)
    pulse = History(t, np.stack([1e-3 * np.sin(2 * np.pi * frequency * t), 0 * t], axis=1))
    loads = Loads(viscous_boundaries=(ViscousBoundary("left", pulse), ViscousBoundary("right")))
    state, seen = State.at_rest(blocks), []
    a, b = 15, 55
    while state.time < 3.2 / frequency:
        state = system.step(state, loads, dt).state
        seen.append((state.time, *state.velocity[[a, b], 0]))
    time, *speeds = np.array(seen).T
    late = time > 2.0 / frequency
    # Amplitudes over the last period and more, by least squares; waves of one frequency fall alike from place to place.
    waves = np.stack([np.sin(2 * np.pi * frequency * time), np.cos(2 * np.pi * frequency * time)], axis=1)[late]
    at = [np.hypot(*np.linalg.lstsq(waves, v[late], rcond=None)[0]) for v in speeds]
    return (at[1] / at[0]) ** (SPEED / frequency / (b - a))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damping", "newmark", "radius"),
    [(0.0, (0.5, 1.0), None), (0.4, (0.5, 1.0), None), (0.4, (0.25, 0.5), None), (0.4, (0.5, 1.0), 0.9)],
)
def test_a_wave_in_blocks_falls_as_is_reported(damping, newmark, radius):
    lag = 2 * damping / (math.sqrt(12.0) * SPEED)
    dt = 5e-4
    frequency = 70.0  # two wavelengths in the row, 29 steps a period
    turn = scheme_eigenvalue(2 * math.pi * frequency * dt, newmark, radius)
    told = abs(turn) ** (2 * math.pi / math.atan2(turn.imag, turn.real)) * math.exp(-2 * math.pi**2 * frequency * lag)
    kept = kept_in_a_row(frequency, dt, damping, newmark, radius)
    print(f"{damping} {newmark} {radius}: {frequency:.3g} Hz, told {told:.4f}, kept {kept:.4f}")
    # Springs between blocks, a hundredth of the blocks' compliance, and their dashpots are left out of what is told.
    assert kept == pytest.approx(told, abs=0.1 * (1 - told) + 0.01)
