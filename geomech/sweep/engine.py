"""Runs in processes of this machine, by default one per core and with one thread each.

Workers are separate processes (not forked, so that they inherit no threads or locks), which receive jobs over a pipe
and return rows one by one. A worker that is killed is replaced and its job repeated, up to `ATTEMPTS` times; if the
system has killed it (as when memory runs out), it is not replaced. Short jobs are sent in batches, so that workers do
not wait for this process.
"""

from __future__ import annotations

import functools
import hashlib
import os
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Protocol, Self

from .measures import FAILED, Job, carry_out

#: Number of times that a job's worker may be killed before the job counts as failed.
ATTEMPTS = 3
#: Seconds of work per batch, and largest number of jobs in it.
_AHEAD, _MOST = 0.25, 64
#: Set in every worker: libraries take one thread.
ONE_THREAD = {
    f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "NUMEXPR", "VECLIB_MAXIMUM")
}  # fmt: skip
#: A worker is replaced after a job if it uses more than this fraction of its share of the memory.
_MEMORY = 0.8
_WORKER = "from geomech.sweep.engine import work; work({handle})"
#: Parts of the package that runs depend on.
_PARTS = ("model", "shapes", "scene", "dda", "ddm", "coupling", "output", "report", "pipeline.py", "sweep/measures.py",
          "sweep/expressions.py")  # fmt: skip


class Engine(Protocol):
    """Carries out jobs; `results` yields their rows in the order in which they end."""

    workers: int
    notes: list[str]

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def results(self, jobs: Iterable[Job]) -> Iterator[dict[str, Any]]: ...

    def stop(self) -> None:
        """Send no more jobs; `results` ends with those in progress."""


@functools.cache
def program() -> str:
    """A digest of the sources that runs depend on: rows of different versions must not be in one table."""
    package, digest = Path(__file__).parent.parent, hashlib.sha256()
    for part in _PARTS:
        place = package / part
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


class _Worker:
    """A process and the jobs that it has."""

    def __init__(self) -> None:
        parent_end, child_end = _pipe()
        environment = {**os.environ, **ONE_THREAD}
        self.process = subprocess.Popen(
            [sys.executable, "-c", _WORKER.format(handle=child_end)], pass_fds=[child_end], env=environment,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(child_end)
        self.pipe = Connection(parent_end)
        self.jobs: deque[Job] = deque()
        self.retiring = False

    def give(self, jobs: list[Job]) -> None:
        self.jobs += jobs
        with suppress(OSError):  # the worker has ended, which is noticed on reading
            self.pipe.send(jobs)

    def end(self, kill: bool = False) -> None:
        with suppress(OSError):
            if kill:
                self.process.kill()
            else:
                self.pipe.send(None)
        self.pipe.close()


def _pipe() -> tuple[int, int]:
    import socket

    parent_end, child_end = socket.socketpair()
    return parent_end.detach(), child_end.detach()


class LocalEngine:
    """``workers`` processes of this machine (default: one per core available to this process)."""

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or len(os.sched_getaffinity(0))
        self._all: list[_Worker] = []
        self._stopping = False
        self._seconds = 0.0
        self._known: deque[float] = deque(maxlen=50)
        self.notes: list[str] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for each in self._all:
            each.end(kill=bool(each.jobs))
        for each in self._all:
            try:
                each.process.wait(5)
            except subprocess.TimeoutExpired:
                each.process.kill()
                each.process.wait()
        self._all = []

    def stop(self) -> None:
        self._stopping = True

    def results(self, jobs: Iterable[Job]) -> Iterator[dict[str, Any]]:
        waiting = iter(jobs)
        again: deque[Job] = deque()
        attempts: dict[int, int] = {}
        exhausted = False
        while True:
            while not self._stopping and (worker := self._idle(bool(again) or not exhausted)) is not None:
                taken = self._take(waiting, again)
                exhausted = exhausted or not taken
                if not taken:
                    break
                worker.give(taken)
            busy = [each for each in self._all if each.jobs]
            if not busy:
                return
            by_pipe: dict[Any, _Worker] = {each.pipe: each for each in busy}
            for pipe in wait(list(by_pipe), timeout=0.5):
                yield from self._read(by_pipe[pipe], again, attempts)

    def _idle(self, wanted: bool) -> _Worker | None:
        """A worker with at most one job left; a new one if there are too few workers."""
        if not wanted:
            return None
        usable = [each for each in self._all if not each.retiring]
        free = next((each for each in usable if not each.jobs), None)
        if free is None and len(usable) < self.workers:
            free = _Worker()
            self._all.append(free)
        if free is None and self._pace() < _AHEAD:
            free = next((each for each in usable if len(each.jobs) <= 1), None)
        return free

    def _pace(self) -> float:
        """Mean duration of the last jobs, s; infinite before the first has ended."""
        return sum(self._known) / len(self._known) if self._known else float("inf")

    def _take(self, waiting: Iterator[Job], again: deque[Job]) -> list[Job]:
        count = max(1, min(_MOST, int(_AHEAD / max(self._pace(), 1e-4)))) if self._known else 1
        taken: list[Job] = []
        while len(taken) < count:
            if again:
                # Alone: its worker may be killed once more.
                return taken if taken else [again.popleft()]
            job = next(waiting, None)
            if job is None:
                break
            taken.append(job)
        return taken

    def _read(self, worker: _Worker, again: deque[Job], attempts: dict[int, int]) -> Iterator[dict[str, Any]]:
        try:
            row = worker.pipe.recv()
        except (EOFError, OSError):
            yield from self._buried(worker, again, attempts)
            return
        job = worker.jobs.popleft()
        self._known.append(row["seconds"])
        row["attempts"] = attempts.get(job.number, 0) + 1
        if not worker.jobs and _memory(worker.process.pid) > _MEMORY * _all_memory() / self.workers:
            worker.retiring = True
            worker.end()
        yield row

    def _buried(self, worker: _Worker, again: deque[Job], attempts: dict[int, int]) -> Iterator[dict[str, Any]]:
        """Deal with the jobs of a worker that has ended."""
        worker.pipe.close()
        code = worker.process.wait()
        self._all.remove(worker)
        if worker.jobs:
            job = worker.jobs.popleft()
            again.extendleft(reversed(worker.jobs))
            worker.jobs.clear()
            attempts[job.number] = attempts.get(job.number, 0) + 1
            why = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
            if -code == signal.SIGKILL and self.workers > 1:
                self.workers -= 1
                self.notes.append(f"a worker was killed, as when memory runs out: {self.workers} continue")
            if attempts[job.number] < ATTEMPTS:
                again.append(job)
            else:
                yield lost(job, f"its worker ended with {why}, {ATTEMPTS} times", attempts[job.number])


def lost(job: Job, reason: str, attempts: int) -> dict[str, Any]:
    """The row of a ``job`` that no worker has completed."""
    return {
        "run": job.number, "status": FAILED, "reason": reason, "fails": None, "warnings": 0, "first_warnings": [],
        "seconds": 0.0, "processor_seconds": 0.0, "host": "", "process": 0, "attempts": attempts,
    }  # fmt: skip


def work(handle: int) -> None:
    """Main loop of a worker: read jobs from the pipe ``handle`` and write rows, until None or the end of the pipe."""
    prepare_worker()
    pipe = Connection(handle)
    with suppress(EOFError, OSError):
        while (jobs := pipe.recv()) is not None:
            for job in jobs:
                pipe.send(made(job))


def prepare_worker() -> None:
    """Ignore Ctrl-C, which is handled by the sweep (runs in progress are completed); collect garbage less often."""
    import gc

    with suppress(ValueError):  # another thread than the main one
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(50_000, 20, 20)


def made(job: Job) -> dict[str, Any]:
    """`carry_out`. The first run of a version on a machine is made alone, so that kernels are compiled only once."""
    with _compiling_alone(job):
        return carry_out(job)


_WARM: set[str] = set()


@contextmanager
def _compiling_alone(job: Job) -> Iterator[None]:
    """Until this version has made a run of this kind on this machine, one process runs alone and the others wait, so
    that only the first compiles kernels."""
    kind = f"{job.program}-{job.settings['measure']}"
    if job.settings["measure"] == "pause" or kind in _WARM:
        yield
        return
    from ..kernel_folder import kernel_place

    folder = Path(kernel_place().folder)
    mark = folder / f"sweep-{kind}.warm"
    if mark.exists():
        _WARM.add(kind)
        yield
        return
    with _locked(folder / "sweep.lock"):
        if mark.exists():
            # Another one was first.
            alone = False
        else:
            alone = True
            yield
            with suppress(OSError):
                mark.touch()
    _WARM.add(kind)
    if not alone:
        yield


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """A file lock on ``path``, if the system has such locks."""
    try:
        import fcntl

        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except (ImportError, OSError):
        yield
        return
    try:
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _memory(process: int) -> float:
    """Memory of a process in bytes; 0 if unknown."""
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0.0


@functools.cache
def _all_memory() -> float:
    """Memory available to this process, bytes."""
    found = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    for path in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        with suppress(OSError, ValueError):
            found = min(found, float(Path(path).read_text()))
    return found


def time_left(done: int, total: int, durations: Iterable[float], workers: int, began: float) -> float:
    """Seconds until ``total`` runs are done: the remaining runs at the mean duration on all ``workers`` or, if waiting
    has made the sweep slower, at its pace so far."""
    known = list(durations)
    if not known or not done:
        return float("nan")
    ideal = (total - done) * sum(known) / len(known) / max(1, min(workers, total - done))
    kept = (total - done) * (time.monotonic() - began) / done
    return max(ideal, min(kept, 2.0 * ideal))


Progress = Callable[[dict[str, Any]], None]
