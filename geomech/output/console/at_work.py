"""Heartbeat of long studies without steps to report: a line every few seconds on stderr, with the time left where an
earlier run of the study is known."""

from __future__ import annotations

import math
import sys
import threading
import time
from contextlib import suppress
from typing import Self, TextIO

from geomech.model import duration_text

from .pace import Compiled, Course

#: Silence, s, after which a line is written.
SILENCE = 5.0

_last = [time.monotonic()]


def note_output() -> None:
    """Record that something has been shown to the user just now."""
    _last[0] = time.monotonic()


class AtWork:
    """Context that reports ``name`` as running whenever nothing was shown for ``silence`` s.

    ``course``: name under which the wall times of its runs are kept for the next time ("": they are not), from which the
    time left follows. ``stream`` is stderr by default. ``quiet`` suppresses the lines.
    """

    def __init__(
        self,
        name: str,
        *,
        course: str = "",
        quiet: bool = False,
        stream: TextIO | None = None,
        silence: float = SILENCE,
    ) -> None:
        self.name, self.course, self.quiet, self.stream, self.silence = name, course, quiet, stream, silence
        self._done = threading.Event()
        #: Runs end in the main thread while the other one reads their course.
        self._counting = threading.Lock()
        self._ended, self._course = 0, Course()
        self._earlier = Course.found(course) if course else None

    def __enter__(self) -> Self:
        self._began = time.monotonic()
        self._course.add(0, 0.0, 0.0)
        self._compiled = Compiled()
        _studies.append(self)
        note_output()
        if not self.quiet:
            self._thread = threading.Thread(target=self._watch, name="at work", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._done.set()
        if not self.quiet:
            self._thread.join()
        _studies.remove(self)
        self._compiled.end()
        self.count_run()  # what is done after the last run counts as one more
        if kind is None and self.course and not self._compiled.any:
            self._course.keep(self.course)

    def count_run(self) -> None:
        """Record that a run of this study has ended."""
        with self._counting:
            self._ended += 1
            self._course.add(self._ended, time.monotonic() - self._began, self._ended)

    def _left(self, now: float) -> str:
        """For messages: the time left after ``now`` s; "" if it is not known."""
        if self._earlier is None:
            return ""
        with self._counting:
            seconds = self._course.left_as(self._earlier) - (now - self._course.wall[-1])
        return f", about {duration_text(seconds)} left, as in an earlier run" if 0.5 <= seconds < math.inf else ""

    def _watch(self) -> None:
        while True:
            left = self.silence - (time.monotonic() - _last[0])
            if left > 0:
                if self._done.wait(left):
                    return
                continue
            now = time.monotonic() - self._began
            self._say(f"  {self.name}: running for {now:.0f} s{self._left(now)}")
            note_output()

    def _say(self, text: str) -> None:
        stream = self.stream or sys.stderr
        with suppress(OSError, ValueError):  # nobody reads it: the study continues
            tqdm = sys.modules.get("tqdm")
            if tqdm is not None and stream is sys.stderr:
                tqdm.tqdm.write(text, file=stream)  # above a progress bar that may be shown there
            else:
                stream.write(text + "\n")
                stream.flush()


_studies: list[AtWork] = []


def run_ended() -> None:
    """Record that a run of the study at work, if there is one, has ended."""
    for study in _studies:
        study.count_run()
