"""Estimate of the time left of a run: from the rate at which it proceeds through its scene, or from an earlier run of
the same scene.

The rate of a run under base motion, or with growing cracks, changes by a factor of five, and a run that ends with an
event stops at an unknown time. The recorded duration of each cycle of an earlier run accounts for both; the ratio of
the present durations to the recorded ones gives the present speed of the machine.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import os
from bisect import bisect_left
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Self

import numpy as np

from geomech.model import Problem

#: Courses of geomech's own studies, by the name of the file in which a machine stores its own (`python -m
#: docs.generate.courses`).
STUDIES = Path(__file__).with_name("courses.json")
#: Largest number of courses stored below ~/.cache (or $XDG_CACHE_HOME).
KEPT = 500


class Pace:
    """Rate at which a run proceeds through its scene, from the later half of the elapsed wall time.

    It is meaningful after `LEAST` s, if the rates in the two halves of that time differ by less than a factor `UNEVEN`:
    while rock cracks, the scene's clock stands still. Rates that differ by more than `STEADY` give a range.
    """

    LEAST, STEADY, UNEVEN = 1.0, 1.3, 2.5

    def __init__(self) -> None:
        self._began: float | None = None
        self._seen: deque[tuple[float, float]] = deque()

    def add(self, wall: float, time: float) -> None:
        """Record that the scene has reached ``time`` (s) at ``wall`` (s)."""
        self._began = wall if self._began is None else self._began
        self._seen.append((wall, time))
        half = 0.5 * (self._began + wall)
        while len(self._seen) > 2 and self._seen[1][0] <= half:
            self._seen.popleft()

    def time_for(self, rest: float) -> tuple[float, float]:
        """Least and greatest wall time, s, for another ``rest`` s of the scene; inf if unknown. Both are the same
        where the rate is steady."""
        if self._began is None or len(self._seen) < 5 or self._seen[-1][0] - self._began < self.LEAST:
            return math.inf, math.inf
        first, last = self._seen[0], self._seen[-1]
        halfway = min(self._seen, key=lambda seen: abs(seen[0] - 0.5 * (first[0] + last[0])))
        early, late = (
            (b[1] - a[1]) / (b[0] - a[0]) if b[0] > a[0] else 0.0 for a, b in ((first, halfway), (halfway, last))
        )
        if not 0.0 < early <= self.UNEVEN * late <= self.UNEVEN**2 * early:
            return math.inf, math.inf
        rest = max(0.0, rest)
        if max(early, late) > self.STEADY * min(early, late):
            return rest / max(early, late), rest / min(early, late)
        mean = rest * (last[0] - first[0]) / (last[1] - first[1])
        return mean, mean


class Course:
    """Wall time (s, from the start of the run) and scene time (s) by cycle; for a study, wall time by the number of
    runs that have ended, which also takes the place of scene time."""

    #: Most cycles that are kept, every second one dropped beyond it. Runs shorter than `LEAST` s are not remembered; an
    #: earlier run counts while this one's scene time is as then to `SAME` of it. Until a `SHARE` of its wall time has been
    #: run through, the rest of that share is taken as fast as then.
    MOST, LEAST, SHARE, SAME = 400, 2.0, 0.02, 0.1

    def __init__(self) -> None:
        self.cycle: list[int] = []
        self.wall: list[float] = []
        self.time: list[float] = []

    def add(self, cycle: int, wall: float, time: float) -> None:
        """Record that ``cycle`` has ended at ``wall``, the scene at ``time``."""
        if len(self.cycle) > self.MOST:
            for row in (self.cycle, self.wall, self.time):
                del row[1:-1:2]
        self.cycle.append(cycle)
        self.wall.append(wall)
        self.time.append(time)

    def left_as(self, earlier: Course) -> float:
        """Wall time left, s, if this run proceeds as ``earlier`` did; inf if it does not, or if too little of it is
        known."""
        if not self.cycle or not earlier.cycle or self.cycle[-1] > earlier.cycle[-1]:
            return math.inf
        spent = np.interp(self.cycle, earlier.cycle, earlier.wall)
        time = np.interp(self.cycle[-1], earlier.cycle, earlier.time)
        if abs(time - self.time[-1]) > self.SAME * earlier.time[-1]:
            return math.inf
        # Of the later half of this run: the machine may have become busier.
        since = max(0, bisect_left(self.wall, 0.5 * (self.wall[0] + self.wall[-1])) - 1)
        as_then = max(0.0, self.SHARE * earlier.wall[-1] - float(spent[-1] - spent[0]))
        gone, then = self.wall[-1] - self.wall[since] + as_then, spent[-1] - spent[since] + as_then
        return float(gone / then * (earlier.wall[-1] - spent[-1])) if then > 0.0 else math.inf

    @classmethod
    def found(cls, name: str) -> Self | None:
        """The course of an earlier run of this ``name`` on this machine, else the one distributed with geomech's own
        studies; None without either."""
        with suppress(OSError, ValueError, TypeError, KeyError):
            return cls._of(json.loads(_file(name).read_text(encoding="utf-8")))
        with suppress(OSError, ValueError, TypeError, KeyError):
            return cls._of(json.loads(STUDIES.read_text(encoding="utf-8"))[name])
        return None

    @classmethod
    def _of(cls, stored: dict[str, list]) -> Self:
        """The course from its stored form. Raises ValueError, TypeError or KeyError."""
        out = cls()
        out.cycle = [int(c) for c in stored["cycle"]]
        out.wall, out.time = ([float(v) for v in stored[name]] for name in ("wall", "time"))
        if not len(out.cycle) == len(out.wall) == len(out.time) > 0:
            raise ValueError("a course has as many cycles as times")
        return out

    def keep(self, name: str) -> None:
        """Store the course for the next run of this ``name``, if it took longer than `LEAST` s. If the folder is not
        writable, nothing is stored."""
        if not self.wall or self.wall[-1] - self.wall[0] < self.LEAST:
            return
        with suppress(OSError):
            file = _file(name)
            file.parent.mkdir(parents=True, exist_ok=True)
            partial = file.with_suffix(f".{os.getpid()}")
            text = json.dumps({"cycle": self.cycle, "wall": self.wall, "time": self.time})
            partial.write_text(text, encoding="utf-8")
            partial.replace(file)
            kept = sorted(file.parent.glob("*.json"), key=lambda path: path.stat().st_mtime)
            for oldest in kept[:-KEPT]:
                oldest.unlink()


class Compiled(logging.Handler):
    """Whether kernels have been compiled since its construction (as far as the log of `geomech.compiled` says so)."""

    def __init__(self) -> None:
        super().__init__(logging.DEBUG)
        self.any = False
        logging.getLogger("geomech.compiled").addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        self.any |= record.levelno <= logging.DEBUG

    def end(self) -> None:
        logging.getLogger("geomech.compiled").removeHandler(self)


def name_of_run(problem: Problem) -> str:
    """Name of the course of ``problem``: from its title, content and time settings."""
    return _digest((problem.title, problem.inventory, problem.run.end_time, problem.run.stop_at, problem.dda.time_step))


def name_of_study(folder: Path, asked: object) -> str:
    """Name of the course of the study in ``folder``: from its scripts, its scenes and its arguments ``asked``."""
    files = sorted(path for path in Path(folder).iterdir() if path.suffix in (".py", ".toml", ".geo"))
    return _digest(([(path.name, path.read_bytes()) for path in files], asked))


def _digest(settings: object) -> str:
    return hashlib.sha256(repr(settings).encode()).hexdigest()[:24]


def _file(name: str) -> Path:
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(caches) / "geomech" / "paces" / f"{name}.json"
