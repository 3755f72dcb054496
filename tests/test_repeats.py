"""Runs that are repeated with one thing changed, and what they say of it."""

from __future__ import annotations

import json
import logging
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import PLATE, block

from geomech import cli
from geomech.bench.slopes.drawn_slopes import drawn, problem_of
from geomech.bench.slopes.random_slopes import scene_text
from geomech.coupling import cycles
from geomech.model import REPEATS, RunSettings
from geomech.pipeline import run, run_problem
from geomech.repeats import NOISE, Repeats, changed
from geomech.scene import load_scene


@pytest.fixture
def scene(tmp_path):
    def load(text, *overrides):
        path = tmp_path / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return load_scene(path, overrides)

    return load


class Quantities:
    """Observer that keeps the scatter of a run."""

    def on_start(self, problem, folder):
        self.scatter = None

    def on_cycle(self, cycle):
        pass

    def on_end(self, summary, error=None):
        self.scatter = summary.get("scatter")


def test_noise_does_not_tear_an_outline_or_a_crack_off():
    """Random slope 56, in which a block touches itself, and cracks end at its vertices."""
    problem = problem_of(drawn(scene_text(56)))
    blocks, cracks = problem.blocks, problem.cracks
    rows = np.column_stack([blocks.vertex_block, blocks.vertices])
    noisy = changed(problem, "noise")
    moved = np.column_stack([blocks.vertex_block, noisy.blocks.vertices])
    places = len(np.unique(rows, axis=0))
    assert places < len(rows) and places == len(np.unique(moved, axis=0)) == len(
        np.unique(np.hstack([rows, moved]), axis=0)
    )
    owner = np.repeat(cracks.block, 2)
    ends = [np.column_stack([owner, of.cracks.nodes[cracks.segments.ravel()]]).tolist() for of in (problem, noisy)]
    at = [
        [rows_of.tolist().index(end) if end in rows_of.tolist() else -1 for end in each]
        for rows_of, each in zip((rows, moved), ends)
    ]
    assert at[0] == at[1] and max(at[0]) >= 0


def test_every_kind_changes_one_thing(scene):
    problem = scene(PLATE, "run.stepping=events", "run.longest_step_s=0.5", "ddm.target_error=1e-3").problem()
    noisy = changed(problem, "noise")
    off = np.abs(noisy.blocks.vertices - problem.blocks.vertices).max()
    assert 0 < off <= NOISE * np.ptp(problem.blocks.vertices, axis=0).max()
    assert replace(noisy, blocks=problem.blocks).dda == problem.dda

    steps = changed(problem, "steps")
    assert steps.dda.time_step == problem.dda.time_step / 2 and steps.run.longest_step == 0.25
    assert steps.growth == problem.growth and steps.ddm == problem.ddm

    growth = changed(problem, "increment").growth
    assert growth.increment == problem.growth.increment / 2 >= growth.min_increment

    ddm = changed(problem, "elements").ddm
    assert (ddm.elements_per_crack, ddm.target_error) == (2 * problem.ddm.elements_per_crack, 1e-4)


def test_a_block_that_falls_is_the_same_whatever_is_changed(scene, tmp_path):
    """It falls freely: its fall is exact in steps of any size."""
    text = block(moving=True).replace("rectangle = [1, 0, 2, 1]", "rectangle = [1, 5, 2, 6]")
    summary = run(scene(text, 'run.repeat=["noise", "steps"]'), tmp_path / "run", [seen := Quantities()])
    assert set(summary["scatter"]) == {"noise", "steps"} and seen.scatter is summary["scatter"]
    for told in summary["scatter"].values():
        assert told["quantities"]["largest_displacement_m"]["run"] == pytest.approx(0.5 * 9.81 * 0.03**2, rel=1e-9)
        assert told["quantities"]["moving_share"]["run"] == 1.0
        assert told["largest"] < 1e-6


def test_what_differs_is_warned_of_with_both_values(scene, tmp_path, caplog):
    """Steps that also halve gravity stand for an answer that depends on them."""
    text = block(moving=True).replace("rectangle = [1, 0, 2, 1]", "rectangle = [1, 5, 2, 6]")
    problem = scene(text, 'run.repeat=["steps"]').problem()

    def lighter(other):
        slower = replace(other.loads, gravity=scene(text, "loads.gravity_m_s2=[0, -4.905]").problem().loads.gravity)
        return cycles(replace(other, loads=slower))

    repeats = Repeats(lighter)
    with caplog.at_level(logging.WARNING, "geomech"):
        summary = run_problem(replace(problem, run=RunSettings(end_time=0.03)), tmp_path, [])
        assert "scatter" not in summary
        repeats.on_start(problem, tmp_path)
        for cycle in cycles(problem):
            repeats.on_cycle(cycle)
        repeats.on_end(summary)
    assert summary["scatter"]["steps"]["quantities"]["largest_displacement_m"]["scatter"] == pytest.approx(0.5)
    (line,) = [text for text in caplog.messages if "repeated" in text]
    assert line.startswith("repeated with steps half as large, the run differs: work of gravity")
    assert "largest displacement 0.002207 instead of 0.004415 m" in line


def test_a_repetition_that_fails_or_is_interrupted_leaves_the_run_as_it_is(scene, tmp_path, caplog):
    problem = scene(block(), 'run.repeat=["noise", "steps"]').problem()

    def ended_by(error):
        def broken(other):
            yield next(iter(cycles(other)))
            raise error

        repeats, summary = Repeats(broken), {"end": "end of the scene"}
        repeats.on_start(problem, tmp_path)
        for cycle in cycles(problem):
            repeats.on_cycle(cycle)
        with caplog.at_level(logging.WARNING, "geomech"):
            repeats.on_end(summary)
        return summary

    summary = ended_by(ValueError("no way on"))
    assert summary["end"] == "end of the scene"
    assert summary["scatter"] == {kind: {"failed": "ValueError: no way on"} for kind in ("noise", "steps")}
    assert sum("did not when repeated" in text for text in caplog.messages) == 2
    assert ended_by(KeyboardInterrupt())["scatter"] == {}
    assert "its scatter is not complete" in caplog.messages[-1]


def test_counts_go_on_after_a_checkpoint(scene, tmp_path):
    """Crack length, coalescences and the peak load of a plate that is torn; what it has remembered half-way counts."""
    problem = scene(PLATE, 'run.repeat=["noise"]').problem()
    straight, resumed = Repeats(cycles), Repeats(cycles)
    straight.on_start(problem, tmp_path)
    every = list(cycles(problem))
    for number, cycle in enumerate(every):
        straight.on_cycle(cycle)
        if number == len(every) // 2:
            resumed.on_resume(problem, tmp_path, json.loads(json.dumps(straight.memory())))
        elif number > len(every) // 2:
            resumed.on_cycle(cycle)
    values = straight.outcome.values(problem)
    assert values == resumed.outcome.values(problem)
    # The crack has run through: the plate is in two, and no crack is left.
    assert values["peak_load_pa"] != 0 and values["blocks"] == 2 and values["crack_length_m"] == 0
    summary = {}
    straight.on_end(summary)
    # How far one static step takes parts that nothing holds any more depends on rounding, which the run reports.
    scatter = summary["scatter"]["noise"]["quantities"]
    assert {"peak_load_pa", "blocks"} <= set(scatter)
    assert max(row["scatter"] for name, row in scatter.items() if name != "largest_displacement_m") < 1e-6


def test_the_command_line_takes_kinds_and_refuses_others(tmp_path, capsys):
    path = tmp_path / "scene.toml"
    path.write_text(block(), encoding="utf-8")
    folder = tmp_path / "run"
    assert cli.main(["run", str(path), "--out", str(folder), "--repeat", "noise, steps", "--quiet"]) == cli.DONE
    told = json.loads((folder / "summary.json").read_text())["scatter"]
    assert list(told) == ["noise", "steps"]
    assert tomllib.loads((folder / "scene.toml").read_text())["run"]["repeat"] == ["noise", "steps"]
    capsys.readouterr()
    assert cli.main(["run", str(path), "--out", str(tmp_path / "no"), "--repeat", "mesh"]) == cli.BAD_INPUT
    assert "run.repeat" in (said := capsys.readouterr().err) and all(kind in said for kind in REPEATS)
    with pytest.raises(ValueError, match="repeat is any of 'noise'"):
        RunSettings(repeat=("mesh",))
