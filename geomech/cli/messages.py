"""What the command line prints in addition to its results: warnings and errors, on the standard error stream."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Iterable
from typing import Any


def say(text: str) -> None:
    """A line that is no result; results alone go to the standard output. Where nobody can read it, it is left out."""
    if sys.stderr is None:
        return
    try:
        print(text, file=sys.stderr, flush=True)
    except (OSError, ValueError):  # a full disk, a terminal that is gone, a closed stream
        silence("stderr")


def silence(name: str) -> None:
    """From now on the standard stream ``name`` takes what is written and keeps nothing: nobody can read it."""
    setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 (as long as the process)


def spell_out() -> None:
    """Let streams that know ASCII alone write something for what they cannot, instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure") and "utf" not in (stream.encoding or "").lower():
            stream.reconfigure(errors="replace")


class Compiling(logging.Handler):
    """Says that kernels are compiled, once at first and then every `EVERY` s, as long as it goes on."""

    EVERY = 5.0

    def __init__(self) -> None:
        super().__init__(logging.DEBUG)
        self.count, self.began, self.said = 0, 0.0, 0.0

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno > logging.DEBUG:
            say(f"{record.levelname.lower()}: {record.getMessage()}")
            return
        now = time.monotonic()
        self.count += 1
        if self.count == 1:
            self.began = self.said = now
            say(
                "compiling kernels, which this version does once on a machine (kept in "
                f"{os.environ.get('NUMBA_CACHE_DIR', '')}) …"
            )
        elif now - self.said >= self.EVERY:
            self.said = now
            say(f"  {self.count} compiled, {now - self.began:.0f} s so far")


def report_compiling() -> None:
    """From now on, say when kernels are compiled."""
    logger = logging.getLogger("geomech.compiled")
    if not any(isinstance(handler, Compiling) for handler in logger.handlers):
        logger.addHandler(Compiling())
        logger.setLevel(logging.DEBUG)


def say_warnings(scenes: Iterable[Any], but: str | None = None) -> None:
    """A line each, ``but`` for those that begin so; what several variants share is said once."""
    for place, message, way_out in dict.fromkeys(warning for scene in scenes for warning in scene.warnings):
        if but is not None and message.startswith(but):
            continue
        say(f"warning: {place}: {message}" + (f"; {way_out}" if way_out else ""))


def say_errors(error: Exception) -> None:
    """Every error that a scene was refused for, a place, a reason and a way out each; of another error its words."""
    errors = getattr(error, "errors", None)
    if not errors:
        say(f"geomech: {error}")
        return
    for place, message, way_out in errors:
        say(f"{place}: {message}" + (f"\n    {way_out}" if way_out else ""))
    say(f"{len(errors)} error{'s' if len(errors) > 1 else ''}; nothing was run")
