"""Edges that absorb waves: a pulse along a row of blocks, its echo at a viscous, a free and a fixed end; a braked
block."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State, ViscousBoundary

ROCK = Material("rock", 10e9, 0.25, density=2500.0)
SPEED = float(np.sqrt(ROCK.stiffness()[0, 0] / ROCK.density))
BLOCKS = 60
PULSE = 20.0  # m long, twenty blocks


def row(newmark, *, last_fixed=False, penalty=None) -> dda.BlockSystem:
    """Unit squares glued in a row, kept from all but motion and strain along it: one-dimensional P-waves."""
    names = [[["", "right" if k == BLOCKS - 1 else "", "", "left" if k == 0 else ""]] for k in range(BLOCKS)]
    blocks = Blocks.from_polygons(
        [rectangle(k, 0, k + 1, 1) for k in range(BLOCKS)],
        edge_names=names,
        fixed=[last_fixed and k == BLOCKS - 1 for k in range(BLOCKS)],
        constrained=[[False, True, True, False, True, True]] * BLOCKS,
    )
    settings = DdaSettings(
        dynamic_factor=1.0, damping=0.0, newmark=newmark, max_displacement_ratio=1.0, normal_penalty=penalty
    )
    return dda.BlockSystem(blocks, [ROCK], [JointLaw("glue", cohesion=1e12, tensile_strength=1e12)], settings=settings)


def wave(system: dda.BlockSystem, dt: float, right: bool) -> tuple[np.ndarray, np.ndarray, dda.EnergyBudget]:
    """Time (n,) in units of a block's transit, speed (n,) at the row's middle over that of the pulse that enters on the
    left, and the energy budget."""
    t = np.linspace(0, PULSE / SPEED, 401)
    pulse = History(t, np.stack([1e-3 * np.sin(np.pi * t * SPEED / PULSE) ** 2, 0 * t], axis=1))
    quiet = (ViscousBoundary("left", pulse), *([ViscousBoundary("right")] if right else []))
    state, budget = State.at_rest(system.blocks), dda.EnergyBudget()
    times, speeds = [], []
    while state.time * SPEED < BLOCKS + 45:
        result = system.step(state, Loads(viscous_boundaries=quiet), dt)
        state, budget = result.state, budget.after(result.energy)
        times.append(state.time * SPEED)
        speeds.append(1e3 * state.velocity[BLOCKS // 2, 0])
    return np.array(times), np.array(speeds), budget


def echo(times: np.ndarray, speeds: np.ndarray) -> float:
    """What comes back to the middle, over what went by."""
    return float(speeds[times > BLOCKS / 2 + PULSE + 5][np.abs(speeds[times > BLOCKS / 2 + PULSE + 5]).argmax()])


def test_a_pulse_goes_in_along_and_out(verified):
    times, speeds, budget = wave(row((0.25, 0.5)), 2e-4, right=True)
    # The wave that the left edge lets in is the one asked for, at the speed of P-waves in the rock: springs between
    # blocks, 1/80 of a block's compliance E' each, slow it by 0.7 %.
    assert speeds.max() == pytest.approx(1.0, abs=2e-3)
    arrival = times[speeds.argmax()] - 0.5 * PULSE
    assert arrival == pytest.approx((BLOCKS / 2 + 0.5) * 1.007, abs=0.25)
    # By as much the row's impedance is below the rock's: half of that comes back.
    reflected = echo(times, speeds)
    print(f"viscous end: {100 * reflected:.2f} % comes back")
    verified("pulse into a viscous end: part that comes back", reflected, "none")
    assert abs(reflected) < 0.006
    assert abs(budget.residual) < 1e-5 * budget.turnover
    assert budget.last.stored < 1e-4 * budget.turnover


def test_the_echo_is_that_of_the_springs_between_the_blocks():
    # A hundred times stiffer: 0.005 % of compliance, and what comes back is what first-order blocks themselves scatter.
    times, speeds, _ = wave(row((0.25, 0.5), penalty=4e13), 2e-4, right=True)
    reflected = echo(times, speeds)
    print(f"viscous end, stiff springs: {100 * reflected:.3f} % comes back")
    assert abs(reflected) < 2e-3


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(("fixed", "sign"), [(False, 1.0), (True, -1.0)])
def test_free_and_fixed_ends_send_all_of_it_back(fixed, sign):
    times, speeds, _ = wave(row((0.25, 0.5), last_fixed=fixed), 2e-4, right=False)
    assert echo(times, speeds) == pytest.approx(sign, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("newmark", "order"), [((0.25, 0.5), 2), ((0.5, 1.0), 1)])
def test_waves_converge_with_the_order_of_their_scheme(newmark, order):
    seen = [wave(row(newmark), 2e-4 / n, right=True)[1][n - 1 :: n] for n in (1, 2, 4, 8)]
    least = min(len(speeds) for speeds in seen)
    changes = np.array([np.abs(a[:least] - b[:least]).max() for a, b in itertools.pairwise(seen)])
    found = np.log2(changes[:-1] / changes[1:])
    print(f"β, γ = {newmark}: halving dt from 0.2 ms on changes the wave by {changes}, orders {found.round(2)}")
    # A transit through a block takes 0.46 ms, and its springs' own period is a tenth of that.
    assert found[-1] == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize(("along", "modulus"), [(0, ROCK.stiffness()[0, 0]), (1, ROCK.shear_modulus)])
def test_dashpots_brake_a_block_as_the_impedance_says(along, modulus):
    # ρ A v' = −√(ρ M) ℓ v on an edge across the motion (P) or along it (S): v falls by exp(−√(M/ρ) t ℓ/A).
    blocks = Blocks.from_polygons(
        [rectangle(0, 0, 2, 3)],
        edge_names=[[["", "quiet", "", ""]]],
        constrained=[[False, False, True, True, True, True]],
    )
    settings = DdaSettings(dynamic_factor=1.0, newmark=(0.25, 0.5), max_displacement_ratio=1.0)
    system = dda.BlockSystem(blocks, [ROCK], settings=settings)
    state = State.at_rest(blocks)
    state.velocity[0, along] = 0.01
    dt, steps = 2e-5, 50
    for _ in range(steps):
        state = system.step(state, Loads(viscous_boundaries=(ViscousBoundary("quiet"),)), dt).state
    rate = np.sqrt(modulus / ROCK.density) / 2.0
    assert state.velocity[0, along] == pytest.approx(0.01 * np.exp(-rate * steps * dt), rel=(rate * dt) ** 2)


def test_forces_of_viscous_edges_are_reported_and_balance():
    blocks = Blocks.from_polygons([rectangle(0, 0, 2, 3)], edge_names=[[["", "quiet", "", ""]]])
    system = dda.BlockSystem(blocks, [ROCK], settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=1.0))
    state = State.at_rest(blocks)
    state.velocity[0] = [0.01, 0.02, 0.01, 0, 0, 0]
    result = system.step(state, Loads(viscous_boundaries=(ViscousBoundary("quiet"),)), 1e-4)
    f = result.forces
    force, body = f.edges["force"].sum(axis=0), f.area[0] * f.body_force[0]
    assert force == pytest.approx(-body, rel=1e-9)
    assert abs(result.energy.residual) < 1e-9 * result.energy.before


def test_names_that_no_edge_has_are_refused():
    system = row((0.25, 0.5))
    with pytest.raises(ValueError, match="viscous boundary is on edges named 'top'"):
        system.step(State.at_rest(system.blocks), Loads(viscous_boundaries=(ViscousBoundary("top"),)), 1e-4)
