"""Viscous boundaries, a shaken base and driven blocks beside blocks of higher order: pulses that leave, one motion in two
frames, and a platen that presses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import after, body_of, moved, rectangle, system_of
from scenes_of_cells import cells_of, columns_and_rows

from geomech import dda
from geomech.dda import EnergyBudget
from geomech.model import (
    GROUND,
    BaseMotion,
    BlockMotion,
    Bolt,
    History,
    JointLaw,
    Loads,
    Material,
    State,
    ViscousBoundary,
)

BAR = Material("rock", 1e10, 0.0, 2500.0, plane="stress")
SPEED = 2000.0
PULSE = 20.0
MOVING = {"dynamic_factor": 1.0, "newmark": (0.25, 0.5), "damping": 0.0, "max_displacement_ratio": 1.0}
CLAMP = JointLaw("clamp", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e14, shear_stiffness=1e14)


def bar(cells: int, order: int, across: bool = False) -> dda.BlockSystem:
    """A free bar of 60 m of ``cells``, its ends "left" and "right"."""
    system = cells_of(
        columns_and_rows(np.linspace(0, 60, cells + 1), np.linspace(0, 1, 2)), order, rock=BAR, **MOVING,
        time_step=1.0 / SPEED,
    )  # fmt: skip
    blocks, names = system.blocks, np.zeros(system.blocks.n_vertices, int)
    middle = 0.5 * (blocks.vertices + blocks.vertices[blocks.next_vertex])
    names[np.abs(middle[:, 0]) < 1e-9], names[np.abs(middle[:, 0] - 60) < 1e-9] = 1, 2
    return dda.BlockSystem(
        replace(blocks, edge_name=names, edge_names=("", "left", "right")), system.materials, system.joints,
        settings=system.settings,
    )  # fmt: skip


def passing(system: dda.BlockSystem, quiet: bool = True) -> tuple[np.ndarray, np.ndarray, EnergyBudget]:
    """Times, m of travel, and speeds of the cell in the middle over that of the pulse that enters on the left."""
    t = np.linspace(0, PULSE / SPEED, 401)
    pulse = History(t, np.stack([1e-3 * np.sin(np.pi * t * SPEED / PULSE) ** 2, 0 * t], axis=1))
    edges = (ViscousBoundary("left", pulse), *([ViscousBoundary("right")] if quiet else []))
    state, budget, times, speeds = State.at_rest(system.blocks), EnergyBudget(), [], []
    middle = system.blocks.n_blocks // 2
    while state.time * SPEED < 115:
        result = system.step(state, Loads(viscous_boundaries=edges))
        state, budget = result.state, budget.after(result.energy, result.state.time)
        times.append(state.time * SPEED)
        speeds.append(1e3 * state.velocity[middle, 0])
    return np.array(times), np.array(speeds), budget


@pytest.mark.parametrize(("cells", "order"), [pytest.param(20, 2, marks=pytest.mark.slow), (12, 3)])
def test_a_pulse_enters_and_leaves_a_bar_of_cells(cells, order):
    """What comes back to the middle is below 1 %; a free end sends all of it back."""
    times, speeds, budget = passing(bar(cells, order))
    late = times > 60
    print(f"order {order}: peak {speeds.max():.4f}, {100 * np.abs(speeds[late]).max():.2f} % comes back")
    # A cell has the mean of the pulse over its length.
    assert speeds.max() == pytest.approx(1.0, abs=0.08)
    assert np.abs(speeds[late]).max() < 0.01
    assert abs(budget.residual) < 1e-5 * budget.turnover
    assert budget.last.stored < 1e-3 * budget.turnover
    free = passing(bar(cells, order), quiet=False)[1]
    assert np.abs(free[late]).max() > 0.9


def test_dashpots_of_first_order_are_the_same_beside_blocks_that_bend():
    """A block of first order on dashpots and on a bolt moves as it does without a beam far away."""
    found = []
    for polygons, order in (([rectangle(0, 0, 2, 1)], [1]), ([rectangle(0, 0, 2, 1), rectangle(9, 0, 12, 1)], [1, 3])):
        system = system_of(
            polygons, [False] * len(order), order, rock=BAR, loaded=(0, 0), **MOVING, time_step=1e-4
        )  # fmt: skip
        velocity = np.zeros((len(order), 6))
        velocity[0, :3] = 0.3, -1.0, 0.2
        bolt = Bolt(0, (1.0, 0.9), GROUND, (1.0, 3.0), 1e7, pretension=1e4)
        loads = Loads(viscous_boundaries=(ViscousBoundary("loaded"),), bolts=(bolt,))
        result = after(system, loads, 40, velocity=velocity)
        found.append((result.state.velocity[0], result.state.vertices[:4], result.statistics["bolt:bolt"]))
    for alone, beside in zip(*found, strict=True):
        assert beside == pytest.approx(alone, rel=1e-9, abs=1e-12)


def shaken(frame: str, order: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal motion of the top of a slender column clamped on a base that shakes, and of the base, m."""
    system = system_of(
        [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 8)], [True, False], [1, order], joint=CLAMP, rock=BAR, **MOVING,
        time_step=2e-3,
    )  # fmt: skip
    t = np.linspace(0, 0.3, 301)
    record = History(t, np.stack([2.0 * np.sin(2 * np.pi * 5 * t), 0.5 * np.sin(2 * np.pi * 8 * t)], axis=1))
    loads = Loads(base=BaseMotion(record, frame))
    state, top, base = State.at_rest(system.blocks), [], []
    for _ in range(150):
        state = system.step(state, loads).state
        top.append(moved(system, state, 1, np.array([0.5, 8.0])))
        base.append(state.vertices[0] - system.blocks.vertices[0])
    return np.array(top), np.array(base)


@pytest.mark.parametrize("order", [2, pytest.param(5, marks=pytest.mark.slow)])
def test_a_column_on_a_shaken_base_moves_alike_in_both_frames(order):
    seen, still = shaken("base", order)
    there, base = shaken("ground", order)
    assert not still.any() and np.abs(base).max() > 1e-2
    relative = there - base
    assert np.abs(seen).max() > 1e-3
    # The trapezoidal rule takes the base's record by its mean over a step in one frame, by its displacement in the other.
    assert np.abs(relative - seen).max() < 0.01 * np.abs(seen).max()


@pytest.mark.parametrize("platen_moves", [False, True])
def test_a_driven_platen_presses_a_block_that_bends(platen_moves):
    """A platen, fixed or of first order and driven, comes down by 10 µm on a smooth block of 1 × 2 m: σ = E' · strain, less what
    contacts take; the reaction is its force."""
    law = JointLaw("plate", 0.0, normal_stiffness=1e14, shear_stiffness=1e14)
    system = system_of(
        [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 2), rectangle(-0.5, 2, 1.5, 3)], [True, False, not platen_moves],
        [1, 4, 1], joint=law, rock=BAR,
    )  # fmt: skip
    # A block that moves is driven in its strains as well: a rigid platen.
    unknowns = ("u0", "v0", "r0", "ex", "ey", "gxy") if platen_moves else ("u0", "v0", "r0")
    down = History(np.array([0.0, 30.0]), np.array([[0.0] * len(unknowns), [0.0, -1e-5, *[0.0] * (len(unknowns) - 2)]]))
    loads = Loads(block_motions=(BlockMotion(2, down, unknowns),))
    result = after(system, loads, 4)
    expected = -1e-5 / (2.0 / 1e10 + 2.0 / 1e14)
    inside = body_of(system, result.state, 1).fields(np.array([[0.1, 0.2], [0.9, 1.9], [0.5, 1.0]]))[0]
    assert inside[:, 1] == pytest.approx(np.full(3, expected), rel=3e-6)
    name = system.blocks.names[2]
    assert result.statistics[f"reaction_y:{name}"] == pytest.approx(expected, rel=3e-6)


def test_a_platen_that_shears_drags_a_block():
    """The platen presses, then moves along: the block bears friction, and the work of the platen is stored or rubbed away."""
    law = JointLaw("plate", 0.4, normal_stiffness=1e13, shear_stiffness=1e13)
    system = system_of(
        [rectangle(-1, -1, 3, 0), rectangle(0, 0, 2, 1), rectangle(-1, 1, 3, 2)], [True, False, True], [1, 4, 1],
        joint=law, rock=BAR,
    )  # fmt: skip
    path = History(np.array([0.0, 20.0, 60.0]), np.array([[0, 0, 0], [0, -1e-3, 0], [5e-3, -1e-3, 0]], float))
    loads, state, budget = Loads(block_motions=(BlockMotion(2, path),)), State.at_rest(system.blocks), EnergyBudget()
    for _ in range(6):
        result = system.step(state, loads)
        state, budget = result.state, budget.after(result.energy, result.state.time)
    name = system.blocks.names[2]
    normal, shear = result.statistics[f"reaction_y:{name}"], result.statistics[f"reaction_x:{name}"]
    assert shear == pytest.approx(np.tan(0.4) * -normal, rel=2e-3)
    assert budget.friction > 0
    assert abs(budget.residual) < 1e-3 * budget.turnover
