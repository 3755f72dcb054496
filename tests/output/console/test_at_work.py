"""Studies without steps say that they are at work; runs that report their steps are not spoken over; bars keep the time
that is left in sight."""

import io
import time
from dataclasses import replace

import numpy as np
import synthetic_run as made

from geomech.model import RunSettings
from geomech.output import Progress
from geomech.output.console import at_work
from geomech.output.console.at_work import AtWork, note_output, run_ended
from geomech.output.console.pace import name_of_study


def test_a_silent_study_is_said_to_be_at_work():
    out = io.StringIO()
    with AtWork("toppling_slope", stream=out, silence=0.05):
        time.sleep(0.3)
    lines = out.getvalue().splitlines()
    assert len(lines) >= 2 and all(line == "  toppling_slope: running for 0 s" for line in lines)


def test_nothing_is_said_beside_what_is_shown_nor_when_quiet():
    out = io.StringIO()
    with AtWork("study", stream=out, silence=0.5):
        for _ in range(8):
            note_output()
            time.sleep(0.02)
    with AtWork("study", stream=out, silence=0.01, quiet=True):
        time.sleep(0.05)
    assert out.getvalue() == ""


def test_a_study_knows_from_an_earlier_one_how_long_it_takes(tmp_path, monkeypatch):
    """Six runs, of which the third takes half of the time; the second study is twice as slow."""
    clock = [0.0]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(at_work.time, "monotonic", lambda: clock[0])

    def left_after_runs(slower: float) -> list[str]:
        clock[0], told = 0.0, []
        with AtWork("study", course=name, quiet=True) as study:
            for took in (2.0, 2.0, 10.0, 2.0, 2.0):
                clock[0] += slower * took
                run_ended()
                clock[0] += slower
                told.append(study._left(clock[0]))
                clock[0] -= slower
            clock[0] += slower * 2.0
        return told

    (tmp_path / "run.py").write_text("runs = 5")
    name = name_of_study(tmp_path, ())
    assert left_after_runs(1.0) == [""] * 5
    assert left_after_runs(2.0) == [f", about {s} s left, as in an earlier run" for s in (34, 30, 10, 6, 2)]
    (tmp_path / "run.py").write_text("runs = 6")
    assert name_of_study(tmp_path, ()) != name != name_of_study(tmp_path, "a variant")
    run_ended()  # outside studies


def test_the_time_left_is_in_sight_at_80_columns(tmp_path, monkeypatch):
    clock = iter(np.arange(0.0, 1e6, 1.0))
    monkeypatch.setattr("geomech.output.console.progress.time.perf_counter", lambda: next(clock))
    monkeypatch.setenv("COLUMNS", "80")

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    out = Terminal()
    watch = Progress(stream=out)
    watch.on_start(
        replace(
            made.problem(),
            title="A title of more letters than a narrow terminal has room for",
            run=RunSettings(end_time=100.0, stop_at=()),
        ),
        tmp_path,
    )
    watch._bar.dynamic_ncols, watch._bar.ncols, watch._bar.mininterval = None, 80, 0.0
    for step in range(30):
        watch.on_cycle(made.cycle(step, step, 0, 0))
        watch._bar.refresh()
    shown = out.getvalue().split("\r")[-1]
    assert len(shown.rstrip()) <= 80 and "|" in shown
    assert " left" in shown
