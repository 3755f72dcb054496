"""The time left: of an earlier run of the scene, of a steady pace, or a range."""

import io
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
import synthetic_run as made

from geomech.model import Cracks, RunSettings
from geomech.output import Progress
from geomech.output.console import pace as module
from geomech.output.console import progress
from geomech.output.console.pace import Course, Pace, name_of_run


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder of its own for what is remembered."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "geomech" / "paces"


def shaken(cycle: np.ndarray) -> np.ndarray:
    """Wall time, s, by ``cycle`` (n,) of 0 … 400: a cycle in the middle costs nine times one at the beginning."""
    return np.cumsum(0.1 + 0.8 * np.exp(-(((cycle - 200) / 60.0) ** 2)))


def course(wall: np.ndarray, time: np.ndarray) -> Course:
    out = Course()
    for cycle, (w, t) in enumerate(zip(wall, time)):
        out.add(cycle, float(w), float(t))
    return out


@pytest.mark.parametrize("slower", [0.5, 1.0, 3.0])
def test_an_earlier_run_knows_what_is_to_come(slower):
    """The rate changes by nine, and the clock stands still for a quarter of the cycles: after a tenth of the run the
    time left is right to what a course keeps of its cycles (every fourth), on a machine of any speed; by the rate it is wrong by four."""
    cycle = np.arange(401)
    wall, time = shaken(cycle), np.minimum(cycle, 300) / 100.0
    earlier, now, rate = course(wall, time), Course(), Pace()
    for k in cycle[:-1]:
        now.add(int(k), slower * wall[k], time[k])
        rate.add(slower * wall[k], time[k])
        left = slower * (wall[-1] - wall[k])
        if wall[k] > 0.1 * wall[-1]:
            assert now.left_as(earlier) == pytest.approx(left, rel=0.02)
        if k == 60:
            assert max(rate.time_for(time[-1] - time[k])) < left / 3.0


def test_a_run_that_takes_another_course_has_no_earlier_one():
    cycle = np.arange(401)
    earlier = course(shaken(cycle), cycle / 100.0)
    assert math.isinf(course(shaken(cycle[:100]), cycle[:100] / 50.0).left_as(earlier))
    assert math.isinf(course(shaken(np.arange(500)), np.arange(500) / 100.0).left_as(earlier))


def test_the_first_cycles_are_taken_as_fast_as_in_an_earlier_run():
    """Two cycles say little of the machine; they count for their part of the share that is asked for."""
    cycle = np.arange(401)
    earlier = course(shaken(cycle), cycle / 100.0)
    left = earlier.wall[-1] - earlier.wall[1]
    assert course(shaken(cycle[:1]), cycle[:1] / 100.0).left_as(earlier) == pytest.approx(left, rel=0.01)
    assert course(3 * shaken(cycle[:2]), cycle[:2] / 100.0).left_as(earlier) == pytest.approx(left, rel=0.15)


def test_studies_come_with_their_course(folder, monkeypatch, tmp_path):
    """A first run knows the course of geomech's own studies, until it has one of its own."""
    problem = made.problem()
    monkeypatch.setattr(module, "STUDIES", tmp_path / "courses.json")
    module.STUDIES.write_text(json.dumps({name_of_run(problem): {"cycle": [0, 9], "wall": [1, 5], "time": [0, 1]}}))
    assert Course.found(name_of_run(problem)).wall == [1.0, 5.0]
    course(np.arange(10.0), np.arange(10.0)).keep(name_of_run(problem))
    assert Course.found(name_of_run(problem)).wall == list(range(10))
    assert Course.found(name_of_run(replace(problem, title="another"))) is None


def told(problem, tmp_path, monkeypatch, cost: float, error: BaseException | None = None, resumed=False) -> list[str]:
    """What a run of 30 cycles says, each of which takes ``cost`` s."""
    clock = [0.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: clock[0])
    out = io.StringIO()
    watch = Progress(stream=out, interval=0.5 * cost)
    if resumed:
        watch.on_resume(problem, tmp_path, (3, 3.0))
    else:
        watch.on_start(problem, tmp_path)
    for k in range(30):
        clock[0] = cost * (k + 1)
        watch.on_cycle(made.cycle(k, k, 0, 0))
    watch.on_end({"title": "made up", "end": "coalescence"}, error)
    return [line for line in out.getvalue().splitlines() if " %  " in line]


def test_a_second_run_tells_when_its_event_comes(tmp_path, monkeypatch, folder):
    problem = made.problem(end_time=100.0)
    first = told(problem, tmp_path, monkeypatch, 1.0)
    assert first and all(line.endswith(", until coalescence or split") and "left" not in line for line in first)
    second = told(problem, tmp_path, monkeypatch, 2.0)
    # After cycle 10, 19 more at 2 s each.
    assert second[10].endswith(", about 38 s left, as in an earlier run, until coalescence or split")
    other = told(replace(problem, title="another"), tmp_path, monkeypatch, 1.0)
    assert not any("earlier" in line for line in other)
    assert len(list(folder.iterdir())) == 2


def test_runs_that_fail_go_on_compile_or_end_at_once_are_not_remembered(tmp_path, monkeypatch, folder):
    problem = made.problem(end_time=100.0)
    told(problem, tmp_path, monkeypatch, 1.0, RuntimeError("no equilibrium"))
    told(problem, tmp_path, monkeypatch, 1.0, resumed=True)
    told(problem, tmp_path, monkeypatch, 0.9 * Course.LEAST / 29)
    with monkeypatch.context() as patch:
        patch.setattr(progress, "Compiled", lambda: type("Did", (), {"any": True, "end": lambda self: None})())
        told(problem, tmp_path, monkeypatch, 1.0)
    assert not folder.exists()


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"cycle": [1], "wall": [], "time": []}', '{"cycle": 1}'])
def test_what_cannot_be_read_is_no_earlier_run(text, folder):
    problem = made.problem()
    folder.mkdir(parents=True)
    module._file(name_of_run(problem)).write_text(text)
    assert Course.found(name_of_run(problem)) is None


def test_only_the_newest_are_kept(monkeypatch, folder):
    monkeypatch.setattr(module, "KEPT", 3)
    long = course(np.arange(10.0), np.arange(10.0))
    for k in range(5):
        long.keep(name_of_run(replace(made.problem(), title=f"run {k}")))
    assert len(list(folder.iterdir())) == 3
    assert Course.found(name_of_run(replace(made.problem(), title="run 4"))).wall == long.wall


def test_an_uneven_pace_is_told_as_a_range(tmp_path, monkeypatch):
    """Steps that take ever longer: the rates of both halves are the ends of the range, more than a third apart."""
    clock = [0.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: clock[0])
    out = io.StringIO()
    watch = Progress(stream=out, interval=0.1)
    watch.on_start(replace(made.problem(), run=RunSettings(end_time=100.0, stop_at=())), tmp_path)
    for k in range(40):
        clock[0] += 0.1 * 1.06**k
        watch.on_cycle(replace(made.cycle(k, k, 0, 0), cracks=Cracks.from_polylines([])))
    last = out.getvalue().splitlines()[-1]
    low, high = (float(n) for n in re.search(r", (\d+) s to (\d+) s left", last).groups())
    # Sixty steps are left; a step has taken from 0.4 to 1 s in the later half of the time.
    assert 60 * 0.1 * 1.06**27 < low < high / 1.3 and high < 61 * 0.1 * 1.06**39
