"""Runs on a cluster, by dask.distributed: whatever it can be started on (ssh, Slurm, Kubernetes …).

    dask scheduler --port 8786                           # on one machine
    dask worker tcp://HOST:8786 --nworkers 16 --nthreads 1   # on every machine
    geomech sweep SCENE … --scheduler tcp://HOST:8786    # anywhere that sees both

The scheduler distributes jobs, repeats them if a worker disappears, and returns rows; the journal is written in this
process only. Each thread of a worker has a process that makes the runs (a `engine.LocalEngine` with one worker), so
that Dask workers stay responsive while kernels compute, and survive a run that crashes. If the scheduler disappears,
the sweep waits for it and submits the missing jobs again.
"""

from __future__ import annotations

import hashlib
import os
import queue
import socket
import threading
import time
import uuid
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from .. import __version__
from .engine import LocalEngine, lost, program
from .measures import Job

#: Number of batches that wait at each thread of the cluster: short ones, and those that take longer than `_LONG` s
#: (fewer, so that a sweep can be stopped sooner).
_AHEAD, _AHEAD_LONG, _LONG = 2, 1, 2.0
#: Seconds of work in a batch, and the most jobs in one.
_BATCH_SECONDS, _MOST = 0.5, 256
#: A job that has been lost this many times counts as failed.
_ATTEMPTS = 3


class EngineRefused(RuntimeError):
    """The cluster cannot make the runs; the message gives the reason and a way out."""


class DaskEngine:
    """The cluster whose scheduler has this ``address``, or that of a ``client`` of dask.distributed (which stays open).

    ``patience`` s: waiting time for workers, and for a scheduler that has disappeared. ``scene``, and ``folder`` if
    runs write files, must exist on each worker. Raises EngineRefused if there is no scheduler or worker, or if a worker
    has another version of geomech or not this scene.
    """

    def __init__(
        self, address: str | None = None, client: Any = None, *, scene: Path | None = None,
        folder: Path | None = None, patience: float = 600.0,
    ) -> None:  # fmt: skip
        self.address, self.patience = address, patience
        self.workers = 1
        self.notes: list[str] = []
        self._scene, self._folder = scene, folder
        self._client, self._own = client, client is None
        self._stopping = False
        self._known: deque[float] = deque(maxlen=200)

    def __enter__(self) -> Self:
        if self._client is None:
            self._client = self._connected(min(10.0, self.patience))
        self.address = self.address or self._client.scheduler.address
        self._check_workers(min(30.0, self.patience))
        return self

    def __exit__(self, *_: object) -> None:
        if self._own and self._client is not None:
            with suppress(Exception):
                self._client.close(timeout=2)

    def stop(self) -> None:
        self._stopping = True

    def _connected(self, seconds: float) -> Any:
        try:
            from distributed import Client
        except ImportError:
            raise EngineRefused("a cluster needs dask.distributed: pip install 'geomech[sweep]'") from None
        try:
            return Client(self.address, timeout=seconds, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise EngineRefused(
                f"no scheduler answers at {self.address} ({error}): start one: dask scheduler --port 8786"
            ) from error

    def _check_workers(self, seconds: float) -> None:
        """Wait for workers, and refuse those with other sources or scenes."""
        until = time.monotonic() + seconds
        while not self._client.nthreads():
            if time.monotonic() > until:
                raise EngineRefused(
                    f"the scheduler at {self.address} has no workers: start some: dask worker {self.address} "
                    "--nthreads 1"
                )
            time.sleep(0.2)
        self.workers = sum(self._client.nthreads().values())
        here = about(str(self._scene) if self._scene else None, str(self._folder) if self._folder else None)
        try:
            found = self._client.run(
                about, str(self._scene) if self._scene else None, str(self._folder) if self._folder else None
            )
        except Exception as error:
            raise EngineRefused(
                f"the workers at {self.address} cannot import geomech.sweep ({error}): install geomech "
                f"{__version__} there"
            ) from error
        for worker, on_worker in found.items():
            for name, what in (("version", "geomech"), ("program", "geomech's sources"), ("scene", "the scene")):
                if on_worker[name] != here[name]:
                    raise EngineRefused(
                        f"the worker {worker} on {on_worker['host']} has a different version of {what} ({on_worker[name]}, here "
                        f"{here[name]}): "
                        + ("put the scene and its files there under the same path" if name == "scene"
                           else f"install the same geomech on all machines, {__version__} as here")
                    )  # fmt: skip
            if self._folder is not None and not on_worker["folder"]:
                raise EngineRefused(
                    f"the worker {worker} on {on_worker['host']} does not see {self._folder}: --keep needs a "
                    "folder that all machines share"
                )

    def results(self, jobs: Iterable[Job]) -> Iterator[dict[str, Any]]:
        """The row of every job, in the order in which they end."""
        waiting, again = iter(jobs), deque[list[Job]]()
        ended: queue.Queue[Any] = queue.Queue()
        under_way: dict[str, tuple[Any, list[Job]]] = {}
        attempts: dict[int, int] = {}
        while True:
            while not self._stopping and len(under_way) < self.workers * (1 + self._ahead()):
                batch = again.popleft() if again else self._batch(waiting)
                if not batch:
                    break
                self._hand_out(batch, under_way, ended)
            if not under_way:
                return
            try:
                key = ended.get(timeout=1.0)
            except queue.Empty:
                self._count_workers()
                continue
            future, batch = under_way.pop(key, (None, []))
            if future is None:
                continue
            yield from self._taken(future, batch, again, attempts)

    def _ahead(self) -> int:
        return _AHEAD if self._known and sum(self._known) / len(self._known) < _LONG else _AHEAD_LONG

    def _batch(self, waiting: Iterator[Job]) -> list[Job]:
        pace = sum(self._known) / len(self._known) if self._known else float("inf")
        count = max(1, min(_MOST, int(_BATCH_SECONDS / max(pace, 1e-4))))
        return [job for _, job in zip(range(count), waiting, strict=False)]

    def _hand_out(self, batch: list[Job], under_way: dict[str, Any], ended: queue.Queue[Any]) -> None:
        key = f"geomech-{batch[0].number}-{uuid.uuid4().hex[:12]}"
        while True:
            try:
                future = self._client.submit(made_there, batch, key=key, pure=False)
                break
            except Exception:
                self._reconnect()
        under_way[key] = future, batch
        future.add_done_callback(lambda _: ended.put(key))

    def _taken(
        self, future: Any, batch: list[Job], again: deque[list[Job]], attempts: dict[int, int]
    ) -> Iterator[dict[str, Any]]:
        status = future.status
        if status == "finished":
            try:
                rows = future.result(timeout=30)
            except Exception:
                status = "lost"
            else:
                for row in rows:
                    self._known.append(row["seconds"])
                    yield row
                return
        if status == "error":
            error = future.exception()
            if isinstance(error, EngineRefused):
                raise error
            for job in batch:
                attempts[job.number] = attempts.get(job.number, 0) + (1 if len(batch) == 1 else 0)
                if attempts[job.number] >= _ATTEMPTS or (len(batch) == 1 and type(error).__name__ == "KilledWorker"):
                    yield lost(
                        job, f"the cluster gave up the run: {type(error).__name__}: {error}"[:400], attempts[job.number]
                    )
                else:
                    again.append([job])
            return
        # Cancelled or lost, as all jobs are when the scheduler disappears.
        again.append(batch)
        if self._client.status != "running":
            self._reconnect()

    def _reconnect(self) -> None:
        """Wait until the scheduler is back, and connect a new client."""
        self.notes.append(f"the scheduler at {self.address} has disappeared: waiting for it")
        with suppress(Exception):
            self._client.close(timeout=1)
        self._own, until = True, time.monotonic() + self.patience
        while True:
            try:
                self._client = self._connected(5.0)
                self._check_workers(max(1.0, until - time.monotonic()))
                self.notes.append("the scheduler is back")
                return
            except EngineRefused as refused:
                if time.monotonic() > until or "other geomech" in str(refused):
                    raise
                time.sleep(1.0)

    def _count_workers(self) -> None:
        with suppress(Exception):
            self.workers = max(1, sum(self._client.nthreads().values()))


_OWN = threading.local()


def made_there(jobs: list[Job]) -> list[dict[str, Any]]:
    """The rows of ``jobs``, on a worker, by the process that belongs to this thread."""
    if jobs[0].program != program():
        raise EngineRefused(
            f"{socket.gethostname()} has geomech {__version__} of other sources than this sweep: install the "
            "same version everywhere"
        )
    if getattr(_OWN, "engine", None) is None:
        _OWN.engine = LocalEngine(1)
    return list(_OWN.engine.results(jobs))


def about(scene: str | None, folder: str | None) -> dict[str, Any]:
    """Data of a machine: version and sources of geomech, the scene, and whether the folder for files exists."""
    try:
        digest = hashlib.sha256(Path(scene).read_bytes()).hexdigest()[:12] if scene else ""
    except OSError:
        digest = "none"
    return {
        "version": __version__, "program": program(), "host": socket.gethostname(), "scene": digest,
        "folder": folder is None or os.path.isdir(folder),
    }  # fmt: skip
