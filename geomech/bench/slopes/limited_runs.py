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

from .refusals import reason_of

RIGHT, REPORTED, REFUSED, LONG, WRONG = VERDICTS = ("right", "reported", "refused", "long", "wrong")


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


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Raises `TimeUp`, with the place, after ``seconds`` processor seconds (inf: never); on systems without timers,
    never."""
    if (
        math.isinf(seconds)
        or not hasattr(signal, "setitimer")
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return

    def up(_number, frame) -> None:
        places = [f"{Path(at.filename).stem}.{at.name}" for at in traceback.extract_stack(frame)]
        raise TimeUp(" > ".join(name for name in places if not name.startswith("_"))[-300:])

    before = signal.signal(signal.SIGPROF, up)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
