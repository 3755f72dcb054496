"""Runs of scenes with a limit of processor time: how each ended, and its warnings.

Times are processor times, so that an outcome does not depend on other programs.
"""

from __future__ import annotations

import logging
import math
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from .refusals import reason_of

RIGHT, REPORTED, REFUSED, LONG, WRONG = VERDICTS = ("right", "reported", "refused", "long", "wrong")


#: Processor seconds after which to look again, where a run could not be broken off.
_LOOK_AGAIN = 0.02


class TimeUp(BaseException):
    """Not an error of the run: nothing may catch it."""


class CollectedWarnings(logging.Handler):
    """Handler that collects the `messages` of warnings."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


@dataclass(frozen=True)
class Ended:
    """End of a run: `RIGHT` (to its end), `REFUSED` for one of the `refusals` (``reason`` is its name), `LONG`: time
    limit, or `WRONG`: another error. ``message`` is the error's; ``cycles`` were finished."""

    verdict: str = RIGHT
    reason: str = ""
    message: str = ""
    cycles: int = 0
    warnings: tuple[str, ...] = ()
    seconds: float = 0.0


def limited(run: Callable[[CollectedWarnings], Iterable], seconds: float) -> Ended:
    """Exhaust ``run``, which takes the `CollectedWarnings` and yields once per cycle, within ``seconds`` processor seconds."""
    collected, log, began = CollectedWarnings(), logging.getLogger("geomech"), time.process_time()
    log.addHandler(collected)
    verdict, reason, message, number = RIGHT, "", "", 0
    try:
        with at_most(seconds):
            for _ in run(collected):
                number += 1
    except TimeUp as up:
        verdict, message = LONG, str(up)
    except Exception as error:
        up = time_up(error)
        if up is not None:
            # It came inside a compiled function, which converts it to another error.
            verdict, message = LONG, str(up)
        else:
            reason = reason_of(error, begun=number > 0) or ""
            verdict = REFUSED if reason else WRONG
            message = str(error) if reason else traceback.format_exc(limit=-3)
    finally:
        log.removeHandler(collected)
    return Ended(verdict, reason, message, number, tuple(collected.messages), time.process_time() - began)


def time_up(error: BaseException | None) -> TimeUp | None:
    """The cause of ``error``, if that is the time limit."""
    while error is not None and not isinstance(error, TimeUp):
        error = error.__cause__ or error.__context__
    return error


def breakable(frame: FrameType | None) -> bool:
    """Whether an exception raised at ``frame`` reaches its callers. It does not while Numba compiles a function (LLVM
    loses what its callbacks raise, and goes on without the function) or wraps its result as a named tuple (its code
    takes the missing tuple for one: the process crashes). Files of named tuples have no name."""
    if frame is not None and frame.f_code.co_filename.startswith("<"):
        return False
    while frame is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] in ("numba", "llvmlite"):
            return False
        frame = frame.f_back
    return True


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Raises `TimeUp`, with the place, after ``seconds`` processor seconds (inf: never), or later where `breakable` says
    so; on systems without timers, never."""
    if (
        math.isinf(seconds)
        or not hasattr(signal, "setitimer")
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return

    def up(_number, frame) -> None:
        if not breakable(frame):
            signal.setitimer(signal.ITIMER_PROF, _LOOK_AGAIN)
            return
        places = [f"{Path(at.filename).stem}.{at.name}" for at in traceback.extract_stack(frame)]
        raise TimeUp(" > ".join(name for name in places if not name.startswith("_"))[-300:])

    before = signal.signal(signal.SIGPROF, up)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
