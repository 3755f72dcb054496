"""Cells of one rock against closed forms of elasticity: curved bars, rock that hardly changes its volume, and waves."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scenes_of_bending import after, rectangle
from scenes_of_cells import cells_of, columns_and_rows, meshed, moved_corners
from scipy.optimize import minimize_scalar

from geomech.model import EdgeTraction, History, JointLaw, Loads, Material, State

CLAMP = JointLaw("clamp", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e15, shear_stiffness=1e15)
STEPS = {"dynamic_factor": 1.0, "newmark": (0.25, 0.5), "damping": 0.0, "max_displacement_ratio": 0.1}


def loaded(*force: float) -> Loads:
    return Loads(edge_tractions=(EdgeTraction("loaded", History.constant(force)),))


def end_of_a_quarter_ring(along: int, order: int) -> float:
    """m by which the end of a quarter of a ring of radii 1 and 2 m moves along the force of 100 kN in its face."""
    turn = np.linspace(0, math.pi / 2, along + 1)
    ways = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    cells = [np.array([a, 2 * a, 2 * b, b]) for a, b in pairwise(ways)]
    rock = Material("rock", 2e10, 0.25, 2500.0, plane="stress")
    system = cells_of(
        cells, order, below=[rectangle(0.5, -1, 2.5, 0)], joint=CLAMP, rock=rock, loaded=lambda at: abs(at[0]) < 1e-9
    )
    result = after(system, loaded(0.0, -1e5), 2)
    end = np.abs(system.blocks.vertices[:, 0]) < 1e-9
    return -moved_corners(system, result.state)[end, 1].mean()


def test_a_thick_curved_bar_bends_as_elasticity_has_it():
    """Timoshenko & Goodier (Theory of Elasticity, §33): δ = π P (a² + b²)/(E N), N = a² − b² + (a² + b²) ln(b/a). Its clamp
    holds the middle of the face alone; chords in place of arcs take 7e-4 of the area."""
    shape = 1 - 4 + 5 * math.log(2)
    exact = math.pi * 1e5 * 5 / (2e10 * shape)
    error = {order: abs(end_of_a_quarter_ring(24, order) / exact - 1) for order in (3, 4)}
    assert error[4] < 2e-3
    assert error[4] < 0.1 * error[3]


@pytest.mark.parametrize("ratio", [0.49, 0.4999])
def test_rock_that_hardly_changes_its_volume_does_not_lock(ratio):
    """A cantilever of slenderness 8 in plane strain: Timoshenko's deflection with E/(1 − ν²), less some 2 % because the
    clamp keeps its section from swelling."""
    rock = Material("rock", 2e10, ratio, 2500.0, plane="strain")
    modulus, shear = 2e10 / (1 - ratio**2), 2e10 / (2 * (1 + ratio))
    exact = 1e5 * (8**3 / (3 * modulus / 12) + 1.2 * 8 / shear)
    cells, tips = columns_and_rows(np.linspace(0, 8, 9), np.linspace(0, 1, 2)), []
    for order in (4, 5, 6):
        system = cells_of(
            cells, order, below=[rectangle(-1, 0, 0, 1)], joint=CLAMP, rock=rock,
            loaded=lambda at: abs(at[0] - 8) < 1e-9,
        )  # fmt: skip
        result = after(system, loaded(0.0, -1e5), 2)
        tip = np.abs(system.blocks.vertices[:, 0] - 8) < 1e-9
        tips.append(float(-moved_corners(system, result.state)[tip, 1].mean() / exact))
    assert 0.94 < tips[0] < tips[1] < tips[2] < 0.98
    assert tips[2] - tips[1] < 0.5 * (tips[1] - tips[0])


def frequency(cells: int, order: int, half_waves: int) -> float:
    """Of the standing wave with so many half waves in a free bar of 8 m, over c π n/L: of what fits ten periods of its
    motion best. The trapezoidal rule lowers ω to (2/dt) atan(ω dt/2), exactly, which is taken back."""
    rock = Material("rock", 2e10, 0.0, 2500.0, plane="stress")
    k = half_waves * math.pi / 8
    exact = k * math.sqrt(2e10 / 2500.0)
    step, x = 2 * math.pi / exact / 24, np.linspace(0, 8, cells + 1)
    system = cells_of(columns_and_rows(x, np.linspace(0, 1, 2)), order, rock=rock, **STEPS | {"time_step": step})
    state, shape, velocity = State.at_rest(system.blocks), np.diff(np.sin(k * x)), np.zeros((cells, 6))
    velocity[:, 0], velocity[:, 3] = 1e-3 * shape / (k * np.diff(x)), 1e-3 * np.diff(np.cos(k * x)) / np.diff(x)
    state, speeds = replace(state, velocity=velocity), []
    for _ in range(240):
        state = system.step(state, Loads()).state
        speeds.append(float(shape @ state.velocity[:, 0]))
    time, seen = step * (1 + np.arange(240)), np.array(speeds)

    def misfit(omega: float) -> float:
        waves = np.stack([np.cos(omega * time), np.sin(omega * time)], axis=1)
        return float(np.linalg.lstsq(waves, seen, rcond=None)[1][0])

    found = minimize_scalar(
        misfit, bounds=(0.98 * exact, 1.02 * exact), method="bounded", options={"xatol": 1e-7 * exact}
    )
    return 2 / step * math.tan(0.5 * step * found.x) / exact


def observed_order(order: int) -> tuple[float, float]:
    """Error of the frequency of four half waves with two cells to each, and its order from there to four cells."""
    coarse, fine = (frequency(cells, order, 4) - 1 for cells in (8, 16))
    return coarse, math.log2(coarse / fine)


def test_waves_in_a_bar_of_cells_run_at_their_speed():
    """Dispersion falls with twice the order of the cells: 2.5e-3 with four cells of order 2 to a wave, 1.5e-4 with eight."""
    error, rate = observed_order(2)
    assert abs(error) < 3e-3
    assert rate == pytest.approx(4, abs=0.5)


@pytest.mark.slow
def test_waves_in_a_bar_of_cells_of_order_three_run_at_their_speed():
    """6e-5 with four cells to a wave, 1e-6 with eight."""
    error, rate = observed_order(3)
    assert abs(error) < 1e-4
    assert rate == pytest.approx(6, abs=0.7)


def test_one_polynomial_hardly_bends_around_a_large_hole():
    """A plate of 2 by 1 m in tension with a hole of 6 % of its area, in which the hole adds 23 % to the elongation: one block of
    order 8 is 12 % too stiff, which `geomech check` says, cells of order 3 are right to a few thousandths."""
    turn = -np.linspace(0, 2 * math.pi, 24, endpoint=False)
    hole = [1.0, 0.5] + 0.2 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    plate, names = [rectangle(0, 0, 2, 1), hole], [["", "loaded", "", ""], [""] * 24]
    rock = Material("rock", 2e10, 0.25, 2500.0, plane="stress")

    def elongation(size: float, order: int) -> float:
        system = meshed(plate, size, order, below=rectangle(-1, 0, 0, 1), names=names, joint=CLAMP, rock=rock)
        state = after(system, loaded(1e5, 0.0), 2).state
        return moved_corners(system, state)[np.abs(system.blocks.vertices[:, 0] - 2) < 1e-9, 0].mean()

    exact = elongation(0.2, 4)
    assert elongation(np.nan, 8) / exact - 1 == pytest.approx(-0.12, abs=0.01)
    assert elongation(0.4, 3) == pytest.approx(exact, rel=3e-3)
