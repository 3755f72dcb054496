"""Overhead of a sweep: runs that only wait, on processes of this machine and on simulated clusters.

Workers of a simulated cluster are real ones (`dask worker`, one process each) on this machine; their runs sleep instead
of solving, so that many more of them than cores show how fast jobs are distributed and rows returned.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..sweep.engine import Engine, LocalEngine
from ..sweep.measures import Job
from ..sweep.results import Journal, write_tables
from .figures import Measured

#: Waiting times of a run, s, and the number of runs per worker.
_WAITS, _EACH = (0.05, 0.5), 6.0
CLUSTERS, QUICK_CLUSTERS = (4, 16, 64), ()
_TINY, _QUICK_TINY = 5000, 1000
#: Dask's workers monitor themselves: a stack sample every 10 ms, and the machine's load every 0.5 s, take 3 % of a core
#: each, also when idle. 64 of them would fill two cores; on machines of their own this is negligible.
_UNWATCHED = {
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "60s",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "5s",
}


def measure(quick: bool = False) -> Measured:
    """Tiny runs, runs of half a second, and clusters of 4, 16 and 64 workers (``quick``: none)."""
    times: dict[str, float] = {}
    lines = ["what a sweep itself costs (runs that wait in place of solving)"]
    number = _QUICK_TINY if quick else _TINY
    for workers in (1, 2):
        clock, processor = _made(LocalEngine(workers), number, 0.0)
        times[f"a tiny run of {number}, {workers} at a time, processor time here"] = processor / number
        lines.append(
            f"  {number} tiny runs, {workers} processes: {number / clock:8.0f} runs/s, "
            f"{1e3 * processor / number:.3f} ms of "
            "processor time here a run, journal and tables written"
        )
    one = None
    for workers in (1, 2):
        runs = (4 if quick else 12) * workers
        clock, _ = _made(LocalEngine(workers), runs, 0.5)
        ideal = 0.5 * runs / workers
        lines.append(
            f"  {runs} runs of 0.5 s, {workers} processes: {clock:6.2f} s, {100 * (clock / ideal - 1):.1f} % "
            "beyond the runs' own time"
        )
        rate = runs / clock
        if one is not None:
            lines.append(f"  two processes make {rate / one:.2f} times the runs of one")
        one = one or rate
    for workers in QUICK_CLUSTERS if quick else CLUSTERS:
        lines += _cluster_lines(workers)
    return Measured.of("\n".join(lines), times=times)


def _cluster_lines(workers: int) -> Iterator[str]:
    try:
        import distributed  # noqa: F401
    except ImportError:
        yield f"  a cluster of {workers} workers: needs pip install 'geomech[sweep]'"
        return
    from ..sweep.cluster import DaskEngine

    with _cluster(workers) as address:
        # Start-up in each worker at its first run.
        _made(DaskEngine(address), 4 * workers, 0.01)
        for wait in _WAITS:
            runs = int(workers * _EACH / wait)
            clock, processor = _made(DaskEngine(address), runs, wait)
            yield (
                f"  {workers:3d} dask workers, {runs:6d} runs of {wait:g} s: {clock:6.2f} s, "
                f"{runs / clock:7.0f} runs/s, "
                f"{100 * _EACH / clock:3.0f} % of what the workers could do, {1e3 * processor / runs:.2f} ms "
                "of processor time here a run"
            )


def _made(engine: Engine, runs: int, wait: float) -> tuple[float, float]:
    """Wall-clock seconds from the first row to the last (scaled to all ``runs``), and processor seconds of this
    process, for ``runs`` waits with journal and tables."""
    settings = {"measure": "pause", "pause_s": wait, "columns": {}, "fails": None}
    from ..sweep.engine import program

    jobs = (
        Job(k, "", None, (), settings, (0.0, 0.0, 1.0, 1.0), (1, 1), program=program())
        for k in range(-engine.workers, runs)
    )
    with tempfile.TemporaryDirectory() as place, Journal(Path(place) / "runs.jsonl") as journal, engine:
        rows = engine.results(jobs)
        # Processes start.
        for _ in range(engine.workers):
            next(rows)
        began, processor = time.perf_counter(), time.process_time()
        for row in rows:
            journal.add(row)
        write_tables(Path(place), [journal.rows[number] for number in sorted(journal.rows)])
        return time.perf_counter() - began, time.process_time() - processor


@contextmanager
def _cluster(workers: int) -> Iterator[str]:
    """A scheduler and ``workers`` workers, one process each, until the context ends; gives the scheduler's address."""
    from distributed import Client

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": os.environ | _UNWATCHED}
    with tempfile.TemporaryDirectory() as place:
        dask = [sys.executable, "-m", "dask"]
        worker = ["worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        own = [
            subprocess.Popen(
                [*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], cwd=place, **quiet
            )
        ]
        try:
            own += [
                subprocess.Popen([*dask, *worker, "--local-directory", place], cwd=place, **quiet)
                for _ in range(workers)
            ]  # fmt: skip
            with Client(address, timeout=120, set_as_default=False) as client:
                client.wait_for_workers(workers, timeout=600)
            yield address
        finally:
            for process in own:
                process.kill()
            for process in own:
                process.wait()
