"""Heartbeat of long studies without steps to report: a line every few seconds on stderr."""

from __future__ import annotations

import sys
import threading
import time
from contextlib import suppress
from typing import Self, TextIO

#: Silence, s, after which a line is written.
SILENCE = 5.0

_last = [time.monotonic()]


def spoken() -> None:
    """Record that something has been shown to the user just now."""
    _last[0] = time.monotonic()


class AtWork:
    """Context that reports ``name`` as running whenever nothing was shown for ``silence`` s.

    ``stream`` is stderr by default. ``quiet`` suppresses the lines.
    """

    def __init__(
        self, name: str, *, quiet: bool = False, stream: TextIO | None = None, silence: float = SILENCE
    ) -> None:
        self.name, self.quiet, self.stream, self.silence = name, quiet, stream, silence
        self._done = threading.Event()

    def __enter__(self) -> Self:
        self._began = time.monotonic()
        spoken()
        if not self.quiet:
            self._thread = threading.Thread(target=self._watch, name="at work", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        if not self.quiet:
            self._thread.join()

    def _watch(self) -> None:
        while True:
            left = self.silence - (time.monotonic() - _last[0])
            if left > 0:
                if self._done.wait(left):
                    return
                continue
            self._say(f"  {self.name}: running for {time.monotonic() - self._began:.0f} s")
            spoken()

    def _say(self, text: str) -> None:
        stream = self.stream or sys.stderr
        with suppress(OSError, ValueError):  # nobody reads it: the study continues
            tqdm = sys.modules.get("tqdm")
            if tqdm is not None and stream is sys.stderr:
                tqdm.tqdm.write(text, file=stream)  # above a progress bar that may be shown there
            else:
                stream.write(text + "\n")
                stream.flush()
