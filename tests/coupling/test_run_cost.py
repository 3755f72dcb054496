"""The processor time that `check` says a run will take: its parts by hand, and measured runs."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from geomech.coupling import run_cost
from geomech.coupling.crack_cost import crack_cost
from geomech.coupling.run_cost import run_line
from geomech.model import duration_text
from geomech.scene import load_scene

ROOT = Path(__file__).parents[2]


def test_cycles_times_the_time_of_a_cycle(torn_plate):
    static = run_cost.run_cost(torn_plate)
    assert static.cycles == math.ceil(torn_plate.run.end_time / torn_plate.dda.time_step - 1e-9)
    assert static.seconds == pytest.approx(static.once + static.cycles * static.each)
    cracks = crack_cost(torn_plate)
    moving = run_cost.run_cost(replace(torn_plate, dda=replace(torn_plate.dda, dynamic_factor=1.0)), cracks)
    assert moving.each == pytest.approx(
        run_cost.CYCLE + run_cost.BLOCK * (~torn_plate.blocks.fixed).sum() + run_cost.CRACKED
    )
    assert static.each > moving.each and moving.once > static.once > cracks.seconds


def test_the_line_states_it_with_its_uncertainty(torn_plate):
    assert "to the end, within a factor of 4" in run_line(torn_plate)
    # Steps that end at events have no number beforehand.
    to_events = replace(torn_plate, run=replace(torn_plate.run, stepping="events"))
    assert "a cycle, within a factor of 4" in run_line(to_events)
    long = replace(torn_plate, run=replace(torn_plate.run, end_time=1e5 * torn_plate.dda.time_step))
    assert " min of processor time" in run_line(long)


def test_durations_are_said_in_one_way():
    said = {0.0714: "0.071 s", 5.84: "5.8 s", 45.2: "45 s", 150.0: "2.5 min", 700.0: "12 min", 7500.0: "2 h 5 min"}
    assert {seconds: duration_text(seconds) for seconds in said} == said


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
