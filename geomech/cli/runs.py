"""Run folders named on a command line, or below a named folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .verb import BadInput

if TYPE_CHECKING:
    from ..output import Run


def run_folders(place: Path) -> list[Path]:
    """``place`` itself if it is a run folder (or cannot contain one), else all run folders below it."""
    if (place / "history.csv").is_file() or not place.is_dir():
        return [place]
    return sorted(found.parent for found in place.rglob("history.csv")) or [place]


def open_run(folder: Path) -> Run:
    """The run in ``folder``; if there is none, raises BadInput with those below it."""
    from ..output import Run

    try:
        return Run(folder)
    except FileNotFoundError as error:
        below = [str(found) for found in run_folders(folder) if found != folder]
        listed = ", ".join(below[:12]) + (f" and {len(below) - 12} more" if len(below) > 12 else "")
        raise BadInput(f"{error}" + (f"; runs below it: {listed}" if below else "")) from None
