"""Wall time of the phases of a run."""

from __future__ import annotations

import time as clock
from contextlib import contextmanager


class Phases:
    """Wall time by phase: ``with phases("dda"): …`` adds to ``phases.seconds["dda"]``."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, phase: str):
        start = clock.perf_counter()
        try:
            yield
        finally:
            self.seconds[phase] = self.seconds.get(phase, 0.0) + clock.perf_counter() - start
