"""Automatic time steps: bounded, long where nothing happens, short where it is hard."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.coupling.cycle import cycles
from geomech.dda.energy_balance import StepEnergy
from geomech.dda.step_control import adaptive_time_step
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)

WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))
ROCK = Material("rock", 10e9, 0.25, density=2600.0)


def finished(dt, iterations=1, cuts=0, share=0.0, taken=0.0):
    facts = {"open_close_iterations": iterations, "step_cuts": cuts, "limit_share": share}
    energy = dict.fromkeys(StepEnergy._fields, 0.0) | {"kinetic": 1.0, "scheme": taken}
    return SimpleNamespace(dt=dt, statistics=facts, energy=StepEnergy(**energy))


def test_steps_grow_and_shrink_by_what_is_stated_and_stay_bounded():
    length = dda.StepLength(DdaSettings(time_step=1.0, automatic_time_step=True))
    assert length.dt == adaptive_time_step.FIRST
    for _ in range(100):
        length.after(finished(length.dt), length.dt)
    assert length.dt == 1.0
    length.after(finished(1.0, iterations=adaptive_time_step.EASY + 1), 1.0)
    assert length.dt == 1.0
    length.after(finished(1.0, iterations=adaptive_time_step.HARD + 1), 1.0)
    assert length.dt == 0.5
    length.after(finished(0.125, cuts=2), 0.5)
    assert length.dt == 0.125
    # What a step may move is approached from below.
    length.after(finished(0.125, share=1.0), 0.125)
    assert length.dt == pytest.approx(0.1)
    # A step that was short for other reasons says nothing.
    length.after(finished(1e-3), 1e-3)
    length.after(finished(1e-3), length.dt)
    assert length.dt == pytest.approx(0.1)
    for _ in range(100):
        length.after(finished(length.dt, iterations=99), length.dt)
    assert length.dt == adaptive_time_step.SHORTEST


def test_in_motion_neither_iterations_nor_what_the_scheme_takes_shorten_steps_below_the_first():
    length = dda.StepLength(DdaSettings(time_step=1.0, automatic_time_step=True, dynamic_factor=1.0))
    for _ in range(100):
        length.after(finished(length.dt), length.dt)
    assert length.dt == 1.0
    length.after(finished(1.0, taken=2 * adaptive_time_step.TAKEN), 1.0)
    assert length.dt == pytest.approx(np.sqrt(0.5))
    for trouble in ({"iterations": 99}, {"taken": 0.5}):
        for _ in range(20):
            length.after(finished(length.dt, **trouble), length.dt)
        assert length.dt == adaptive_time_step.FIRST
    length.after(finished(length.dt / 8, cuts=3), length.dt)
    assert length.dt == adaptive_time_step.FIRST / 8


def test_a_vibration_is_followed_whatever_the_longest_step_is():
    """Work of gravity on a column under sudden weight after half a period, against steps of its thousandth part."""
    column = [rectangle(-1, -1, 2, 0), *(rectangle(0, k, 1, k + 1) for k in range(5))]
    blocks, soft = Blocks.from_polygons(column, fixed=[True] + [False] * 5), Material("soft", 1e9, 0.25, density=2600.0)
    period = 4 * 5 / np.sqrt(1e9 / (1 - 0.25**2) / 2600)

    def work(dt, automatic):
        done = []
        settings = DdaSettings(
            time_step=dt, automatic_time_step=automatic, dynamic_factor=1.0, max_displacement_ratio=0.05, damping=0.0
        )
        for _ in dda.run(
            blocks, [soft], [JointLaw("joint", friction_angle=0.6)], WEIGHT, settings, end_time=0.5 * period,
            watch=lambda result: done.append(result.energy.gravity_work),
        ):  # fmt: skip
            pass
        return sum(done), len(done)

    exact, _ = work(period / 1000, False)
    for parts, off in ((4, 0.3), (16, 0.1)):
        assert work(period / parts, False)[0] < (1 - off) * exact
        followed, steps = work(period / parts, True)
        assert followed == pytest.approx(exact, rel=0.03) and steps < 120


def test_without_it_every_static_step_is_the_one_asked_for():
    length = dda.StepLength(DdaSettings(time_step=0.5))
    length.after(finished(0.1, iterations=99, cuts=3), 0.5)
    assert length.dt == 0.5


def test_without_it_a_step_in_motion_that_was_cut_grows_back_by_doubling():
    length = dda.StepLength(DdaSettings(time_step=0.5, dynamic_factor=1.0))
    length.after(finished(0.5, iterations=99), 0.5)
    assert length.dt == 0.5
    length.after(finished(0.0625, cuts=3), 0.5)
    assert length.dt == 0.125
    # A step that is short for another reason, as the end of a stage, does not count.
    length.after(finished(1e-3), 1e-3)
    assert length.dt == 0.25
    for _ in range(3):
        length.after(finished(length.dt), length.dt)
    assert length.dt == 0.5
    # What was cut once is tried in its whole length.
    length.after(finished(0.25, cuts=1), 0.5)
    assert length.dt == 0.5


def brick_wall(rows: int, columns: int) -> Blocks:
    polygons = [rectangle(-1, -0.5, columns + 1, 0)]
    for row in range(rows):
        ends = [0, *np.arange(0.5, columns), columns] if row % 2 else range(columns + 1)
        polygons += [rectangle(a, 0.5 * row, b, 0.5 * row + 0.5) for a, b in itertools.pairwise(ends)]
    return Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))


def test_a_wall_begins_with_short_steps_and_rests_in_long_ones():
    settings = DdaSettings(time_step=0.1, automatic_time_step=True, dynamic_factor=1.0, max_displacement_ratio=0.05)
    states = list(
        dda.run(brick_wall(5, 6), [ROCK], [JointLaw("joint", friction_angle=0.6)], WEIGHT, settings, end_time=2.0)
    )
    dt = np.diff([s.time for s in states])
    assert dt.max() <= 0.1 * (1 + 1e-12)
    # From the first step to the longest at the rate of growth, and all further ones as long.
    least = np.ceil(np.log(1 / adaptive_time_step.FIRST) / np.log(adaptive_time_step.GROWTH))
    assert dt[-2] == pytest.approx(0.1)
    assert len(dt) <= least + 2.0 / 0.1 + 10
    rows = states[-1].contacts[states[-1].contacts["other"] == 0]
    # Shi's scheme turns what it does not resolve about from step to step, at this dt with a hundredth of the amplitude.
    assert rows["normal_force"].sum() == pytest.approx(2600 * 9.81 * 6 * 2.5, rel=1e-2)


def test_coupled_runs_take_them_too():
    # A block in free fall: steps grow until the displacement allowed in one holds them, and never beyond.
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    settings = DdaSettings(time_step=0.05, automatic_time_step=True, dynamic_factor=1.0, max_displacement_ratio=0.05)
    problem = Problem(
        "falling", blocks, Cracks.from_polylines([]), (ROCK,), (JointLaw("none"),), loads=WEIGHT, dda=settings,
        run=RunSettings(end_time=0.2),
    )  # fmt: skip
    recorded = list(cycles(problem))
    dt = np.diff([c.state.time for c in recorded])
    assert dt[0] == pytest.approx(0.05 * adaptive_time_step.FIRST)
    assert dt[1] == pytest.approx(adaptive_time_step.GROWTH * dt[0])
    assert dt.max() <= 0.05
    ratios = [c.statistics["max_displacement_ratio"] for c in recorded[1:]]
    assert max(ratios) <= 0.05 * 1.001
    fallen = recorded[-1].state.vertices[0, 1]
    assert fallen == pytest.approx(-0.5 * 9.81 * 0.2**2, rel=1e-10)
