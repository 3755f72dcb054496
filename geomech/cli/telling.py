"""What the command line says beside its results: warnings and errors, on the standard error stream."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any


def say(text: str) -> None:
    """A line beside the results, which alone go to the standard output."""
    print(text, file=sys.stderr)


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
