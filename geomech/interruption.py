"""Ctrl-C, SIGTERM and SIGHUP during a run: the first one lets the current cycle end if that does not take long, the
second ends the run at once."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from types import FrameType
from typing import Any, Self

#: A cycle that lasts longer than this after the first interrupt is broken off, s. The cycle is lost, and everything
#: since the last checkpoint, which is written every half a minute.
PATIENCE = 5.0
_MESSAGE = f"stopping when this cycle is done, or in {PATIENCE:g} s; once more to stop at once"


class Interruption:
    """In this context a first interrupt only sets ``asked``; the next raises KeyboardInterrupt, as every interrupt does
    outside. ``message``: the answer to the first one. KeyboardInterrupt is raised ``patience`` seconds after the first
    one, unless `wait` has been called; None: never.

    SIGTERM and SIGHUP are treated in the same way if they already raise KeyboardInterrupt, as on the command line.
    Signals that are ignored remain ignored: a shell script starts its background jobs in this way, so that a Ctrl-C
    meant for another program does not stop them. Nothing changes in threads other than the main one, which receive no
    signals.
    """

    def __init__(self, message: str = _MESSAGE, patience: float | None = PATIENCE) -> None:
        self.asked, self.message, self.patience = False, message, patience
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                if signal.getsignal(number) is signal.default_int_handler:
                    self._before[number] = signal.signal(number, self._take)
        return self

    def wait(self) -> None:
        """The present work may take any time."""
        if signal.SIGALRM in self._before:
            signal.setitimer(signal.ITIMER_REAL, 0.0)

    def __exit__(self, *_: object) -> None:
        self.wait()
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before = {}

    def _take(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
        # An alarm set by other code is not changed.
        if self.patience is not None and signal.getsignal(signal.SIGALRM) is signal.SIG_DFL:
            self._before[signal.SIGALRM] = signal.signal(signal.SIGALRM, self._take)
            signal.setitimer(signal.ITIMER_REAL, self.patience)
        with suppress(OSError):  # of a terminal that is gone
            os.write(2, f"\n{self.message}\n".encode())
