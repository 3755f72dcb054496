"""Processes of this machine: workers that are killed, interrupts, going on; runs that only wait, so that the engine is
what is tested."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

import geomech
from geomech.output.run_lock import FolderInUse, FolderTaken, RunLock
from geomech.sweep.engine import ATTEMPTS, LocalEngine, time_left
from geomech.sweep.execution import CannotResume, carry_out_sweep, read_sweep
from geomech.sweep.measures import Job, carry_out, kind_of_reason
from geomech.sweep.plan import plan_of
from geomech.sweep.results import Journal, read_journal

from .conftest import PAUSES

RUNS = 60


def pauses(plane, **more):
    return plan_of(plane, {**PAUSES, "runs": RUNS, **more})


class Killing(LocalEngine):
    """Kills a worker after every tenth row."""

    def results(self, jobs):
        for count, row in enumerate(super().results(jobs)):
            yield row
            busy = [each for each in self._all if each.jobs]
            if count % 10 == 9 and busy:
                os.kill(busy[0].process.pid, signal.SIGTERM)


class Breaking(LocalEngine):
    """Breaks off after so many rows, as a machine that goes down."""

    def __init__(self, after: int) -> None:
        super().__init__(2)
        self.after = after

    def results(self, jobs):
        for count, row in enumerate(super().results(jobs)):
            if count == self.after:
                raise OSError("the machine goes down")
            yield row


@pytest.mark.slow
def test_the_table_is_the_same_whatever_the_engine_and_the_number_of_workers(plane, tmp_path):
    plan = pauses(plane)
    engines = {"one": LocalEngine(1), "three": LocalEngine(3), "killed": Killing(2)}
    for name, engine in engines.items():
        found = carry_out_sweep(plan, tmp_path / name, engine)
        assert [row["run"] for row in found.rows] == list(range(RUNS)) and found.complete
        assert {row["status"] for row in found.rows} == {"done"}
    tables = {name: (tmp_path / name / "runs.csv").read_bytes() for name in engines}
    assert len(set(tables.values())) == 1
    assert any(row["attempts"] > 1 for row in read_journal(tmp_path / "killed" / "runs.jsonl").values())


def test_a_sweep_goes_on_where_it_was_broken_off(plane, tmp_path):
    plan, folder = pauses(plane), tmp_path / "out"
    with pytest.raises(OSError, match="goes down"):
        carry_out_sweep(plan, folder, Breaking(17))
    assert len(read_journal(folder / "runs.jsonl")) == 17
    # A line that was cut off as it was written.
    with (folder / "runs.jsonl").open("a") as file:
        file.write('{"run": 59, "status"')
    with pytest.raises(FolderTaken, match="--resume"):
        carry_out_sweep(plan, folder, LocalEngine(2))
    made = []

    class Counting(LocalEngine):
        def results(self, jobs):
            for row in super().results(jobs):
                made.append(row["run"])
                yield row

    found = carry_out_sweep(plan, folder, Counting(2), resume=True)
    assert len(made) == RUNS - 17 and found.complete
    lines = (folder / "runs.jsonl").read_text().splitlines()
    assert sorted(json.loads(line)["run"] for line in lines) == list(range(RUNS))
    carry_out_sweep(plan, tmp_path / "whole", LocalEngine(2))
    assert (folder / "runs.csv").read_bytes() == (tmp_path / "whole" / "runs.csv").read_bytes()


def test_what_has_changed_cannot_be_gone_on_with(plane, tmp_path):
    folder = tmp_path / "out"
    carry_out_sweep(pauses(plane), folder, LocalEngine(2))
    with pytest.raises(CannotResume, match="what varies"):
        carry_out_sweep(pauses(plane, seed=4), folder, LocalEngine(2), resume=True)
    plane.write_text(plane.read_text(encoding="utf-8").replace("2600", "2601"), encoding="utf-8")
    with pytest.raises(CannotResume, match="the scene has changed"):
        carry_out_sweep(pauses(plane), folder, LocalEngine(2), resume=True)
    with pytest.raises(CannotResume, match="no sweep"):
        carry_out_sweep(pauses(plane), tmp_path / "none", LocalEngine(2), resume=True)
    with RunLock(folder), pytest.raises(FolderInUse):
        carry_out_sweep(pauses(plane), folder, LocalEngine(2), overwrite=True)


@pytest.mark.slow
@pytest.mark.other_machines
def test_ctrl_c_keeps_what_has_ended(plane, tmp_path, interruptible):
    """The first interrupt lets the runs under way end: exit code 3, and the rest is made by --resume."""
    folder, table = tmp_path / "out", plane.with_name("sweep.toml")
    table.write_text(
        'measure = "pause"\npause_s = 0.05\nruns = 200\n'
        'vary = { materials.rock.density_kg_m3 = "uniform(2000, 3000)" }\n'
    )
    command = [
        sys.executable,
        "-m",
        "geomech",
        "sweep",
        str(plane),
        "--out",
        str(folder),
        "--workers",
        "2",
        "--no-page",
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    while len(read_journal(folder / "runs.jsonl")) < 5 and time.monotonic() < until:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 3, said
    assert "stopping after the runs in progress" in said and "--resume" in said
    kept = len(read_journal(folder / "runs.jsonl"))
    assert 5 <= kept < 200
    assert not read_sweep(folder).complete
    done = subprocess.run([*command, "--resume"], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert "200 runs" in done.stdout and read_sweep(folder).complete


@pytest.mark.slow
def test_a_run_whose_worker_always_ends_is_counted_as_failed(tmp_path):
    class Ending(LocalEngine):
        def _read(self, worker, again, attempts):
            if worker.jobs[0].number == 3:
                worker.process.terminate()
                worker.process.wait()
                # What it has sent before it ended is not read: the run did not come back.
                worker.pipe.close()
                yield from self._buried(worker, again, attempts)
            else:
                yield from super()._read(worker, again, attempts)

    jobs = [
        Job(k, "", None, (), {"measure": "pause", "pause_s": 0.0, "columns": {}, "fails": None}, (0, 0, 1, 1), (1, 1))
        for k in range(6)
    ]
    with Ending(1) as engine:
        rows = {row["run"]: row for row in engine.results(jobs)}
    assert sorted(rows) == list(range(6))
    assert rows[3]["status"] == "failed" and f"{ATTEMPTS} times" in rows[3]["reason"] and "SIGTERM" in rows[3]["reason"]
    assert {row["status"] for run, row in rows.items() if run != 3} == {"done"}


def test_a_worker_that_the_system_kills_makes_room(plane):
    job = Job(
        0, "", None, (), {"measure": "pause", "pause_s": 30.0, "columns": {}, "fails": None}, (0, 0, 1, 1), (1, 1)
    )
    with LocalEngine(3) as engine:
        engine._known.append(30.0)
        found = engine.results([job])
        worker = engine._idle(True)
        worker.give([job])
        worker.process.kill()
        rows = list(engine._read(worker, again := __import__("collections").deque(), {}))
        assert rows == [] and [each.number for each in again] == [0]
        assert engine.workers == 2 and "memory" in engine.notes[0]
        found.close()


def test_errors_are_rows(plane):
    """A scene that cannot be drawn, a strength that is none, a column that is none: the reason is told."""
    settings = {**plan_of(plane, {"vary": {"materials.rock.density_kg_m3": "2000,2600"}}).settings}

    def made(*changes, **more):
        return carry_out(Job(0, str(plane), None, changes, {**settings, **more}, (0, 0, 10, 10), (4, 4)))

    refused = made("joints.default.friction_angle_deg=95")
    assert refused["status"] == "refused" and "out of range" in refused["reason"] and refused["fails"] is None
    nothing = made("joints.default.friction_angle_deg=0")
    assert nothing["status"] == "refused" and "no friction" in nothing["reason"]
    assert made(measure="pause", columns={"x": "nothing * 2"})["reason"].startswith(
        "ValueError: column x: there is no 'nothing'"
    )
    assert (
        kind_of_reason("block 'b12' at 3.5 m")
        == kind_of_reason("block 'c' at -7e-3 m")
        != kind_of_reason("bolt 'b' at 1 m")
    )


def test_a_journal_keeps_the_first_row_of_a_run(tmp_path):
    with Journal(tmp_path / "j") as journal:
        assert journal.add({"run": 1, "x": 1}) and not journal.add({"run": 1, "x": 2})
    with Journal(tmp_path / "j") as journal:
        assert journal.rows == {1: {"run": 1, "x": 1}}


def test_time_left():
    now = time.monotonic()
    assert time_left(10, 110, [2.0] * 10, 4, now - 5.0) == pytest.approx(50.0, rel=1e-3)  # as fast as four workers can
    assert time_left(10, 110, [2.0] * 10, 4, now - 8.0) == pytest.approx(80.0, rel=1e-3)  # slower: the pace so far
    assert time_left(109, 110, [2.0] * 50, 4, now - 54.5) == pytest.approx(2.0, rel=1e-3)  # the last one, on one worker


@pytest.mark.slow
def test_overhead_is_small(plane):
    """Processor time of this process for a run that costs nothing: below 5 ms, a hundredth of half a second."""
    plan = pauses(plane)
    jobs = [Job(k, "", None, (), plan.settings, plan.box, plan.cells) for k in range(1000)]
    with LocalEngine(2) as engine:
        began = time.process_time()
        assert sum(1 for _ in engine.results(jobs)) == 1000
        assert (time.process_time() - began) / 1000 < 5e-3


def test_the_package_is_called(plane, tmp_path):
    found = geomech.sweep(plane, PAUSES["vary"], runs=5, measure="pause", pause_s=0.0, out=tmp_path / "o", workers=1)
    assert len(found.rows) == 5 and found.column("value").tolist() == [0, 1, 2, 3, 4]
