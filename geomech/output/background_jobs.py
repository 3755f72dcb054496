"""Long jobs done in a background thread: Gmsh, compiled kernels and compression leave the interpreter to the run."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any


class BackgroundJobs:
    """Jobs done one after another in a thread, in the order given; at most ``most`` wait.

    Useful for jobs of many milliseconds outside the interpreter; for short ones the two threads only take turns. A job
    that fails raises its exception in a later `do`, or in `close`, which waits for all jobs.
    """

    def __init__(self, most: int = 4) -> None:
        self.most = most
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="geomech-background")
        self._jobs: deque[Future] = deque()

    def do(self, job: Callable[..., Any], *arguments: Any) -> None:
        while self._jobs and (self._jobs[0].done() or len(self._jobs) >= self.most):
            self._jobs.popleft().result()
        self._jobs.append(self._thread.submit(job, *arguments))

    def wait(self) -> None:
        """Wait until all jobs are done."""
        while self._jobs:
            self._jobs.popleft().result()

    def close(self) -> None:
        try:
            self.wait()
        finally:
            self._thread.shutdown(cancel_futures=True)
