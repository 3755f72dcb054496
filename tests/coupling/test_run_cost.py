"""The processor time that `check` says a run will take: its parts by hand, and measured runs."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from small_scenes import PLATE

from geomech.coupling import run_cost
from geomech.coupling.crack_cost import crack_cost
from geomech.coupling.run_cost import run_line
from geomech.scene import load_scene

ROOT = Path(__file__).parents[2]


@pytest.fixture
def problem(tmp_path):
    path = tmp_path / "plate.toml"
    path.write_text(PLATE, encoding="utf-8")
    return load_scene(path).problem()


def test_cycles_times_the_time_of_a_cycle(problem):
    static = run_cost.run_cost(problem)
    assert static.cycles == math.ceil(problem.run.end_time / problem.dda.time_step - 1e-9)
    assert static.seconds == pytest.approx(static.once + static.cycles * static.each)
    cracks = crack_cost(problem)
    moving = run_cost.run_cost(replace(problem, dda=replace(problem.dda, dynamic_factor=1.0)), cracks)
    assert moving.each == pytest.approx(
        run_cost.CYCLE + run_cost.BLOCK * (~problem.blocks.fixed).sum() + run_cost.CRACKED
    )
    assert static.each > moving.each and moving.once > static.once > cracks.seconds


def test_the_line_states_it_with_its_uncertainty(problem):
    assert "to the end, within a factor of 4" in run_line(problem)
    # Steps that end at events have no number beforehand.
    to_events = replace(problem, run=replace(problem.run, stepping="events"))
    assert "a cycle, within a factor of 4" in run_line(to_events)
    long = replace(problem, run=replace(problem.run, end_time=1e5 * problem.dda.time_step))
    assert " h of processor time" in run_line(long) or " min of processor time" in run_line(long)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two_set_slope", "brick_wall", "rockfall"])
def test_runs_take_the_time_that_is_said(name, tmp_path):
    """Processor time of whole runs, start included, after one that compiles what is missing."""
    scene = ROOT / "geometry" / f"{name}.toml"
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    for folder in ("compiles", "measured"):
        before = os.times()
        run = [sys.executable, "-m", "geomech", "run", str(scene), "--out", str(tmp_path / folder)]
        subprocess.run(run, check=True, capture_output=True, env=environment)
        after = os.times()
    taken = after.children_user + after.children_system - before.children_user - before.children_system
    said = run_cost.run_cost(load_scene(scene).problem()).seconds
    assert said / run_cost.WITHIN < taken < said * run_cost.WITHIN
