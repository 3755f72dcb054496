"""Ctrl-C, SIGTERM and SIGHUP while a run lasts: the first lets the cycle end if that does not take long, the second ends
the run at once."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from types import FrameType
from typing import Any, Self

#: A cycle that lasts longer than this after the first interrupt is broken off, s. What is lost is the cycle and what came
#: since the last checkpoint, which is written every half a minute.
PATIENCE = 5.0
_MESSAGE = f"stopping when this cycle is done, or in {PATIENCE:g} s; once more to stop at once"


class Interruption:
    """While this context lasts, a first interrupt only sets ``asked``; the next raises KeyboardInterrupt, as all do
    outside. ``message``: the answer to a first one. ``patience`` seconds after the first one KeyboardInterrupt is raised
    by itself, unless `wait` has been called; None: never.

    SIGTERM and SIGHUP are taken the same way where they raise KeyboardInterrupt already, as on the command line. What is
    ignored stays ignored: a shell script starts its background jobs so, in order that a Ctrl-C meant for another
    program leaves them alone. In other threads than the main one, where signals do not arrive, nothing changes.
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
        """What is done now may take as long as it does."""
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
        # An alarm of somebody else's is left alone.
        if self.patience is not None and signal.getsignal(signal.SIGALRM) is signal.SIG_DFL:
            self._before[signal.SIGALRM] = signal.signal(signal.SIGALRM, self._take)
            signal.setitimer(signal.ITIMER_REAL, self.patience)
        with suppress(OSError):  # of a terminal that is gone
            os.write(2, f"\n{self.message}\n".encode())
