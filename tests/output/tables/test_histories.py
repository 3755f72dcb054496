"""Histories, summary, log, progress and reading back, held against the made-up run's own numbers."""

from __future__ import annotations

import io
import json
import logging
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import synthetic_run as made

from geomech.model import RunSettings
from geomech.output import (
    Group,
    Histories,
    Observer,
    Progress,
    Run,
    RunLog,
    SceneCopy,
    Series,
    Summary,
    standard_observers,
)
from geomech.output.fields import EVENTS, HISTORY, TIPS
from geomech.output.tables.histories import Table


def test_history_reads_back_to_the_last_bit(run_folder):
    run, cycles = Run(run_folder), made.cycles()
    assert run.history.dtype.names[: len(HISTORY)] == tuple(HISTORY)
    assert np.array_equal(run.history["load"], [c.load for c in cycles])
    assert np.array_equal(run.history["strain"], [c.strain for c in cycles])
    assert np.array_equal(run.history["open_close_iterations"], [c.statistics["open_close_iterations"] for c in cycles])
    assert np.array_equal(run.history["top_uy"], [c.monitors["top"][1] for c in cycles])
    assert np.array_equal(run.history["growing"], [0, 0, 0, 0, 2, 2, 2])
    assert np.allclose(run.history["crack_length"], 0.01 + 2e-3 * np.array([0, 0, 0, 0, 1, 2, 3]), rtol=1e-12)
    assert run.at(3)["time"] == 3.0


def test_tips_and_events_read_back(run_folder):
    run, cycles = Run(run_folder), made.cycles()
    assert run.tips.dtype.names == tuple(TIPS)
    assert len(run.tips) == sum(len(c.tips) for c in cycles)
    assert np.array_equal(run.tips["K_II"], np.concatenate([c.tips["k_ii"] for c in cycles]))
    assert np.allclose(run.tips["angle_deg"], math.degrees(1.0), rtol=1e-15)
    assert run.events.dtype.names == tuple(EVENTS)
    assert [(str(e["kind"]), e["cycle"], e["load"]) for e in run.events] == [("initiation", 4, 3 * made.RATE)]


def test_rows_are_on_disk_after_every_cycle(tmp_path):
    watch = Histories()
    watch.on_start(made.problem(), tmp_path)
    for k in range(3):
        watch.on_cycle(made.cycle(k, k, 0, 0))
        assert len(Run(tmp_path).history) == k + 1


def test_a_line_cut_short_is_left_out(tmp_path):
    made.write(tmp_path, [Histories()])
    whole = (tmp_path / "history.csv").read_text()
    (tmp_path / "history.csv").write_text(whole[:-7])
    assert np.array_equal(Run(tmp_path).history["cycle"], [0, 1, 2, 3, 4, 5])


def test_statistics_that_come_late_get_a_column(tmp_path):
    watch = Histories()
    watch.on_start(made.problem(), tmp_path)
    first, second = made.cycle(0, 0, 0, 0), made.cycle(1, 1, 0, 0)
    watch.on_cycle(first)
    watch.on_cycle(replace(second, statistics={**second.statistics, "worst_penetration": 2e-9}))
    watch.on_end({})
    history = Run(tmp_path).history
    assert math.isnan(history["worst_penetration"][0])
    assert history["worst_penetration"][1] == 2e-9
    assert np.array_equal(history["load"], [first.load, second.load])


def test_table_quotes_text_and_keeps_floats(tmp_path):
    table = Table(tmp_path / "t.csv", ["a", "detail"])
    table.add([{"a": 0.1 + 0.2, "detail": 'crack 1, "upper" tip'}])
    table.close()
    from geomech.output.reading import read_table

    row = read_table(tmp_path / "t.csv", ())[0]
    assert (row["a"], row["detail"]) == (0.1 + 0.2, 'crack 1, "upper" tip')


def test_summary_tells_loads_as_they_are_and_normalised(run_folder):
    summary = json.loads((run_folder / "summary.json").read_text())
    load = 3 * made.RATE
    first = summary["first"]["initiation"]
    assert first["load_pa"] == load
    # σ√(πb)/K_Ic, b the half-length of the flaw, by hand.
    assert math.isclose(first["load_normalised"], load * math.sqrt(math.pi * 5e-3) / 2e6, rel_tol=1e-12)
    assert summary["cycles"] == 7
    assert summary["load_steps"] == 3
    assert summary["growing_cycles"] == 3
    assert math.isclose(summary["crack_growth_m"], 6e-3, rel_tol=1e-12)
    assert summary["peak_load_pa"] == load
    assert math.isclose(summary["seconds"]["ddm"], 12e-3, rel_tol=1e-9)
    assert summary["seconds"]["writing series"] > 0
    assert summary["versions"]["numpy"] == np.__version__


def test_a_failed_run_says_so_and_stays_readable(tmp_path):
    out = io.StringIO()
    watchers = [*standard_observers()[:-1], Progress(stream=out)]
    made.write(tmp_path, watchers, error=RuntimeError("no equilibrium"))
    run = Run(tmp_path)
    assert run.summary["end"] == "failed"
    assert "no equilibrium" in run.summary["error"]
    # The exception itself is for whoever catches it.
    assert "no equilibrium" not in out.getvalue()
    assert "stopped at 3 %, load 0.60 MPa, cycle 6" in out.getvalue() and str(tmp_path) in out.getvalue()
    assert "no equilibrium" in (tmp_path / "run.log").read_text()
    assert len(run.history) == 7


def test_summary_of_a_run_without_cycles_cracks_or_toughness(tmp_path):
    from geomech.model import Cracks

    problem = replace(made.problem(), cracks=Cracks.from_polylines([]))
    watch = Summary()
    watch.on_start(problem, tmp_path)
    watch.on_end({})
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["events"] == {}
    assert "normalisation" not in summary


def test_resolved_scene_is_toml_without_none(tmp_path):
    SceneCopy({"title": "a", "run": {"end_time_s": 1.0, "seed": None}}).on_start(made.problem(), tmp_path)
    assert tomllib.loads((tmp_path / "scene.toml").read_text()) == {"title": "a", "run": {"end_time_s": 1.0}}


def test_log_stops_with_the_run(tmp_path):
    import logging

    before = list(logging.getLogger("geomech").handlers)
    made.write(tmp_path, [RunLog()])
    assert logging.getLogger("geomech").handlers == before
    assert "initiation" in (tmp_path / "run.log").read_text()


def test_progress_is_quiet_off_a_terminal(tmp_path):
    out = io.StringIO()
    made.write(tmp_path, [Summary(), Progress(stream=out, interval=1e9)], steps=50)
    lines = out.getvalue().splitlines()
    # One line at the start, the closing lines at the end, none between.
    assert lines[0].startswith("Made-up specimen: 3 blocks, 1 crack →")
    assert any("initiation" in line and "9.800 MPa" in line for line in lines)
    assert len(lines) <= 6
    out = io.StringIO()
    made.write(tmp_path, [Progress(stream=out, interval=0.0)], steps=10, passes=0)
    assert sum("%" in line for line in out.getvalue().splitlines()) == 10


def test_warnings_of_a_run_are_shown_at_its_end(tmp_path):
    """How many, and the first of each kind; not those of the scene, which were said before; and no other run's."""
    log, out = logging.getLogger("geomech.coupling.cycle"), io.StringIO()
    log.warning("before")
    watch = Progress(stream=out, interval=1e9)
    watch.on_start(made.problem(), tmp_path)
    logging.getLogger("geomech.pipeline").warning("of the scene")
    for cycle in range(5):
        log.warning("cycle %d: tips still grow", cycle)
    log.warning("another")
    log.info("no warning")
    watch.on_end({"title": "made up", "end": "end of the scene"})
    log.warning("after")
    assert out.getvalue().splitlines()[-3:] == [
        "  6 warnings in run.log, such as", "    cycle 0: tips still grow", "    another"
    ]  # fmt: skip


def test_progress_tells_the_time_left_at_a_steady_pace(tmp_path, monkeypatch):
    """The first load step takes a minute, and sets no pace; then one a second, so that after step k of 100, 100 − k
    seconds are left, once there have been five of them; growth passes at one load stop the clock, and nothing is said
    until there is a pace again."""
    from geomech.output.console import progress as module

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # no earlier run
    clock = [0.0]
    monkeypatch.setattr(module.time, "perf_counter", lambda: clock[0])
    out = io.StringIO()
    watch = Progress(stream=out, interval=0.5)
    watch.on_start(replace(made.problem(), run=RunSettings(end_time=100.0, stop_at=())), tmp_path)
    cycles = [(k, k, 0) for k in range(21)] + [(21 + k, 20, 1 + k) for k in range(20)]
    for k, step, growth_pass in cycles:
        clock[0] = 60.0 + k if k else 1.0
        watch.on_cycle(made.cycle(k, step, growth_pass, 0))
    lines = [line for line in out.getvalue().splitlines() if "%" in line]
    left = [line.rpartition(", about ")[2] if "left" in line else "" for line in lines]
    # No line for the first cycle, which came at once.
    assert left[0] == "" and left[-1] == ""
    first = next(k for k, told in enumerate(left) if told)
    assert [told for told in left[first : first + 13]] == [f"{k} s left" for k in range(92, 79, -1)]


def test_cracks_that_end_a_run_by_an_event_have_no_time_left(tmp_path, monkeypatch):
    """The scene's end means nothing where coalescence comes at a sixth of it."""
    from geomech.output.console import progress as module

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # no earlier run
    clock = [0.0]
    monkeypatch.setattr(module.time, "perf_counter", lambda: clock[0])
    out = io.StringIO()
    watch = Progress(stream=out, interval=0.5)
    watch.on_start(made.problem(end_time=100.0), tmp_path)
    for k in range(21):
        clock[0] = float(k)
        watch.on_cycle(made.cycle(k, k, 0, 0))
    lines = [line for line in out.getvalue().splitlines() if "%" in line]
    assert lines and all(line.endswith(", until coalescence or split") for line in lines)


def test_the_pace_is_the_recent_one():
    """A second a step, then ten: after as long at the new pace as at the old one, it is the new one."""
    from geomech.output.console.pace import Pace

    pace, wall = Pace(), 0.0
    for step in range(60):
        wall += 1.0 if step < 40 else 10.0
        pace.add(wall, float(step))
        if step == 39:
            assert pace.time_for(10.0) == pytest.approx((10.0, 10.0))
        if step == 42:
            assert pace.time_for(10.0) == (math.inf, math.inf)
    assert pace.time_for(10.0) == pytest.approx((100.0, 100.0))


def test_a_percentage_is_not_said_again_at_once(tmp_path, monkeypatch):
    from geomech.output.console import progress as module

    clock = [0.0]
    monkeypatch.setattr(module.time, "perf_counter", lambda: clock[0])
    out = io.StringIO()
    watch = Progress(stream=out)
    watch.on_start(made.problem(end_time=1e6), tmp_path)
    for k in range(60):
        clock[0] = k + 1.0
        watch.on_cycle(made.cycle(k, k, 0, 0))
    # A minute at 0 %: a line after 5 s, then every 10 s.
    assert sum("0 %" in line for line in out.getvalue().splitlines()) == 6


def test_loads_in_tension_are_told_by_their_size(tmp_path):
    watch = Summary()
    watch.on_start(made.problem(), tmp_path)
    for k in range(4):
        cycle = made.cycle(k, k, 0, 0)
        pulled = tuple(replace(e, load=-e.load) for e in cycle.events)
        if k == 3:
            pulled = (made.Event("initiation", k, 3.0, -3 * made.RATE, (0.0, 0.0)),)
        watch.on_cycle(replace(cycle, load=-cycle.load, events=pulled))
    summary = {}
    watch.on_end(summary)
    first = summary["first"]["initiation"]
    assert first["load_pa"] == -3 * made.RATE == summary["peak_load_pa"]
    assert first["load_normalised"] == pytest.approx(
        3 * made.RATE * math.sqrt(math.pi * made.HALF_LENGTH) / made.ROCK.k_ic, rel=1e-12
    )
    from geomech.output.console.progress import closing_lines

    (line,) = [line for line in closing_lines(summary, tmp_path) if "initiation" in line]
    assert "0.600 MPa in tension" in line and "-" not in line


def test_quiet_says_nothing(tmp_path):
    out = io.StringIO()
    made.write(tmp_path, [Summary(), Progress(quiet=True, stream=out)])
    assert out.getvalue() == ""


def test_bar_on_a_terminal_shows_load_and_growing_tips(tmp_path):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    out = Terminal()
    progress = Progress(stream=out)
    progress.on_start(made.problem(), tmp_path)
    progress._bar.mininterval = progress._bar.miniters = 0
    for cycle in made.cycles():
        progress.on_cycle(cycle)
    progress.on_end({})
    assert "load 0.60 MPa, cycle 6, 2 of 2 tips growing" in out.getvalue()


def test_group_ends_every_observer_even_if_one_fails(tmp_path):
    ended = []

    class Watch:
        def __init__(self, name, fails=False):
            self.name, self.fails = name, fails

        def on_start(self, problem, folder): ...

        def on_cycle(self, cycle): ...

        def on_end(self, summary, error=None):
            ended.append(self.name)
            if self.fails:
                raise OSError("disk full")

    group = Group([Watch("a", fails=True), Watch("b")])
    group.on_start(made.problem(), tmp_path)
    with pytest.raises(OSError, match="disk full"):
        group.on_end({})
    assert ended == ["a", "b"]


def test_all_standard_observers_keep_the_protocol():
    assert all(isinstance(watch, Observer) for watch in standard_observers())


def test_no_run_is_said_plainly(tmp_path):
    with pytest.raises(FileNotFoundError, match="holds no run"):
        Run(tmp_path)


def test_series_refuses_an_unknown_configuration():
    with pytest.raises(ValueError, match="configuration"):
        Series(configuration="deformed")


def test_writing_imports_no_vtk(tmp_path):
    """A run that asks for no picture must not pay for VTK."""
    import subprocess
    import sys
    from pathlib import Path

    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})\n"
        "import pathlib, synthetic_run as made\n"
        "from geomech.output import standard_observers\n"
        f"made.write(pathlib.Path({str(tmp_path)!r}), standard_observers())\n"
        "heavy = {'vtk', 'vtkmodules', 'pyvista', 'matplotlib', 'numba'}\n"
        "assert not heavy & {m.split('.')[0] for m in sys.modules}\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_closing_lines_say_how_to_go_on_beyond_a_stop(tmp_path):
    from geomech.output.console.progress import closing_lines

    assert f"geomech resume {tmp_path} --set 'run.stop_at=[]'" in "\n".join(closing_lines({"end": "split"}, tmp_path))
    assert "resume" not in "\n".join(closing_lines({"end": "collapse"}, tmp_path))
