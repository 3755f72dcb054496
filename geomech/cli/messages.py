"""Messages of the command line other than results: warnings and errors, on the standard error stream."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Iterable
from typing import Any


def say(text: str) -> None:
    """Print a line that is not a result (results alone go to the standard output). It is dropped if it cannot be
    written."""
    if sys.stderr is None:
        return
    try:
        print(text, file=sys.stderr, flush=True)
    except (OSError, ValueError):  # a full disk, a terminal that is gone, a closed stream
        silence("stderr")


def silence(name: str) -> None:
    """From now on discard what is written to the standard stream ``name``, which nobody can read."""
    setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 (as long as the process)


def spell_out() -> None:
    """Let streams with ASCII only write replacements for other characters instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure") and "utf" not in (stream.encoding or "").lower():
            stream.reconfigure(errors="replace")


class Compiling(logging.Handler):
    """Reports that kernels are compiled: once at first, and then every `EVERY` s while it goes on."""

    EVERY = 5.0

    def __init__(self) -> None:
        super().__init__(logging.DEBUG)
        self.count, self.began, self.last_shown = 0, 0.0, 0.0

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno > logging.DEBUG:
            say(f"{record.levelname.lower()}: {record.getMessage()}")
            return
        now = time.monotonic()
        self.count += 1
        if self.count == 1:
            self.began = self.last_shown = now
            say(f"compiling kernels, once per version and machine (kept in {os.environ.get('NUMBA_CACHE_DIR', '')}) …")
        elif now - self.last_shown >= self.EVERY:
            self.last_shown = now
            say(f"  {self.count} compiled, {now - self.began:.0f} s so far")


def report_compiling() -> None:
    """From now on report when kernels are compiled."""
    logger = logging.getLogger("geomech.compiled")
    if not any(isinstance(handler, Compiling) for handler in logger.handlers):
        logger.addHandler(Compiling())
        logger.setLevel(logging.DEBUG)


def say_warnings(scenes: Iterable[Any], but: str | None = None) -> None:
    """One line per warning, except those that begin with ``but``; warnings common to several variants are printed
    once."""
    for place, message, way_out in dict.fromkeys(warning for scene in scenes for warning in scene.warnings):
        if but is not None and message.startswith(but):
            continue
        say(f"warning: {place}: {message}" + (f"; {way_out}" if way_out else ""))


def say_errors(error: Exception) -> None:
    """Every error for which a scene was refused, with place, reason and way out; other errors by their text."""
    errors = getattr(error, "errors", None)
    if not errors:
        say(f"geomech: {error}")
        return
    for place, message, way_out in errors:
        say(f"{place}: {message}" + (f"\n    {way_out}" if way_out else ""))
    say(f"{len(errors)} error{'s' if len(errors) > 1 else ''}; nothing was run")
