"""Clusters of real `dask scheduler` and `dask worker` processes: the same table as here, and what happens when a part
of them goes away."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from geomech.sweep import cluster as clusters
from geomech.sweep.cluster import DaskEngine, EngineRefused
from geomech.sweep.engine import LocalEngine
from geomech.sweep.execution import carry_out_sweep
from geomech.sweep.plan import plan_of
from geomech.sweep.results import read_journal

from .conftest import PAUSES, PLANE


class Cluster:
    """A scheduler and workers, each a process of its own."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address, self.folder = f"tcp://127.0.0.1:{self.port}", folder
        self.processes: list[subprocess.Popen] = []

    def _start(self, *words: str) -> subprocess.Popen:
        log = (self.folder / f"{len(self.processes)}.log").open("w")
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *words, "--no-dashboard"], stdout=log, stderr=log, cwd=self.folder
        )
        self.processes.append(process)
        return process

    def scheduler(self) -> subprocess.Popen:
        process = self._start("scheduler", "--host", "127.0.0.1", "--port", str(self.port))
        until = time.monotonic() + 60
        while time.monotonic() < until:
            with socket.socket() as tried:
                if tried.connect_ex(("127.0.0.1", self.port)) == 0:
                    return process
            time.sleep(0.1)
        raise TimeoutError("the scheduler does not listen")

    def worker(self) -> subprocess.Popen:
        # Without a nanny, so that a worker that is killed stays away.
        return self._start(
            "worker", self.address, "--nthreads", "1", "--no-nanny", "--local-directory", str(self.folder)
        )

    def end(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    yield made
    made.end()


def when(condition: Callable[[], bool], then: Callable[[], None]) -> threading.Thread:
    """Do something as soon as a condition holds, beside."""

    def watch() -> None:
        until = time.monotonic() + 120
        while not condition() and time.monotonic() < until:
            time.sleep(0.02)
        then()

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    return thread


def test_a_cluster_makes_the_table_that_this_machine_makes(plane, tmp_path, cluster, monkeypatch):
    plan = plan_of(plane, {**PAUSES, "runs": 50})
    cluster.scheduler()
    cluster.worker()
    found = carry_out_sweep(plan, tmp_path / "there", DaskEngine(cluster.address, scene=plan.scene))
    assert found.complete and {row["status"] for row in found.rows} == {"done"}
    carry_out_sweep(plan, tmp_path / "here", LocalEngine(1))
    assert (tmp_path / "there" / "runs.csv").read_bytes() == (tmp_path / "here" / "runs.csv").read_bytes()
    # What the workers have is looked at before anything is handed out.
    monkeypatch.setattr(clusters, "__version__", "0.0.1")
    with (
        pytest.raises(EngineRefused, match="a different version of geomech"),
        DaskEngine(cluster.address, scene=plan.scene),
    ):
        pass
    monkeypatch.undo()
    monkeypatch.setattr(clusters, "program", lambda: "another")
    with pytest.raises(EngineRefused, match="a different version of geomech's sources"), DaskEngine(cluster.address):
        pass
    monkeypatch.undo()
    with pytest.raises(EngineRefused, match="does not see"), DaskEngine(cluster.address, folder=tmp_path / "nowhere"):
        pass


def test_a_scheduler_that_does_not_answer_is_refused():
    with pytest.raises(EngineRefused, match=r"no scheduler answers at tcp://127.0.0.1:9"):
        DaskEngine("tcp://127.0.0.1:9", patience=1.0).__enter__()


@pytest.mark.slow
def test_a_client_a_killed_worker_and_a_scheduler_that_restarts(plane, tmp_path, cluster):
    """Nothing that has ended is lost, nothing stands twice, and the table is the same."""
    from distributed import Client

    plan = plan_of(plane, {**PAUSES, "runs": 300, "pause_s": 0.1})
    carry_out_sweep(plan, tmp_path / "here", LocalEngine(4))
    scheduler = cluster.scheduler()
    workers = [cluster.worker() for _ in range(3)]
    folder = tmp_path / "there"

    def rows() -> int:
        return len(read_journal(folder / "runs.jsonl"))

    def restart() -> None:
        scheduler.kill()
        scheduler.wait()
        for worker in workers:
            worker.kill()
            worker.wait()
        time.sleep(1.0)
        cluster.scheduler()
        cluster.worker()
        cluster.worker()

    killed = when(lambda: rows() >= 40, lambda: os.kill(workers[0].pid, signal.SIGKILL))
    restarted = when(lambda: rows() >= 120, restart)
    with Client(cluster.address, set_as_default=False) as client:
        engine = DaskEngine(client=client, scene=plan.scene, patience=60.0)
        found = carry_out_sweep(plan, folder, engine)
    killed.join(1)
    restarted.join(1)
    assert any("has disappeared" in note for note in engine.notes)
    assert found.complete and [row["run"] for row in found.rows] == list(range(300))
    assert len((folder / "runs.jsonl").read_text().splitlines()) == 300
    assert (folder / "runs.csv").read_bytes() == (tmp_path / "here" / "runs.csv").read_bytes()


@pytest.mark.slow
def test_factors_of_safety_are_the_same_to_the_last_digit(tmp_path, cluster):
    scene = tmp_path / "plane.toml"
    scene.write_text(PLANE, encoding="utf-8")
    plan = plan_of(scene, {"vary": {"joints.default.friction_angle_deg": "normal(35, 3)"}, "runs": 12})
    cluster.scheduler()
    for _ in range(2):
        cluster.worker()
    carry_out_sweep(plan, tmp_path / "there", DaskEngine(cluster.address, scene=plan.scene))
    carry_out_sweep(plan, tmp_path / "here", LocalEngine(2))
    assert (tmp_path / "there" / "runs.csv").read_bytes() == (tmp_path / "here" / "runs.csv").read_bytes()
