"""Ctrl-C, SIGTERM and SIGHUP while a run lasts: the first lets the cycle end, the second ends the run at once."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from types import FrameType
from typing import Any, Self

_MESSAGE = "stopping when this cycle is done; once more to stop at once"


class Interruption:
    """While this context lasts, a first interrupt only sets ``asked``; the next raises KeyboardInterrupt, as all do
    outside. ``message`` is what a first one is answered with.

    SIGTERM and SIGHUP are taken the same way where they raise KeyboardInterrupt already, as on the command line. What is
    ignored stays ignored: a shell script starts its background jobs so, in order that a Ctrl-C meant for another
    program leaves them alone. In other threads than the main one, where signals do not arrive, nothing changes.
    """

    def __init__(self, message: str = _MESSAGE) -> None:
        self.asked, self.message = False, message
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                if signal.getsignal(number) is signal.default_int_handler:
                    self._before[number] = signal.signal(number, self._take)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before = {}

    def _take(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
        with suppress(OSError):  # of a terminal that is gone
            os.write(2, f"\n{self.message}\n".encode())
