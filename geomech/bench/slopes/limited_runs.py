"""Runs of scenes within a time of the processor: how each ended, and what it warned of.

Seconds are those of the processor, so that an outcome does not depend on what else runs.
"""

from __future__ import annotations

import logging
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
    """No error of the run's own: nothing may catch it."""


class Heard(logging.Handler):
    """The warnings ``said`` so far."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())


@dataclass(frozen=True)
class Ended:
    """How a run ended: `RIGHT` (to its end), `REFUSED` for one of the `refusals` (``reason`` is its name), `LONG`: its
    time was up, or `WRONG`: another error came. ``message`` is the error's; ``cycles`` were finished."""

    verdict: str = RIGHT
    reason: str = ""
    message: str = ""
    cycles: int = 0
    warnings: tuple[str, ...] = ()
    seconds: float = 0.0


def limited(run: Callable[[Heard], Iterable], seconds: float) -> Ended:
    """Exhausts ``run``, which is given the `Heard` and yields once a cycle, within so many processor ``seconds``."""
    heard, log, began = Heard(), logging.getLogger("geomech"), time.process_time()
    log.addHandler(heard)
    verdict, reason, message, number = RIGHT, "", "", 0
    try:
        with at_most(seconds):
            for _ in run(heard):
                number += 1
    except TimeUp as up:
        verdict, message = LONG, str(up)
    except Exception as error:
        up = time_up(error)
        if up is not None:
            # It came within a compiled function, which makes another error of it.
            verdict, message = LONG, str(up)
        else:
            reason = reason_of(error, begun=number > 0) or ""
            verdict = REFUSED if reason else WRONG
            message = str(error) if reason else traceback.format_exc(limit=-3)
    finally:
        log.removeHandler(heard)
    return Ended(verdict, reason, message, number, tuple(heard.said), time.process_time() - began)


def time_up(error: BaseException | None) -> TimeUp | None:
    """What ``error`` was made of or followed upon, if that is the end of the time."""
    while error is not None and not isinstance(error, TimeUp):
        error = error.__cause__ or error.__context__
    return error


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Raises `TimeUp`, saying where it was, after so many ``seconds`` of the processor; where there are no timers,
    never."""
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
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
