"""What runs and benchmarks came to: a table for the terminal, a page for the reader."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..output.reading import Run
from .table import COLUMNS, as_csv, as_text, table

__all__ = ["COLUMNS", "as_csv", "as_text", "is_benchmark", "table", "write_page", "write_sweep_page"]


def write_page(folder: Path, runs: Sequence[Run], path: Path | None = None, *, play: bool = True) -> Path:
    """Write the page of ``runs``, which lie in ``folder`` (one: in it), or with none of the benchmark there; the file,
    by default ``report.html`` in ``folder``, or ``runs.html`` where runs are below it: there a study leaves its own
    ``report.html``. With ``play`` the cycles of runs can be played in the page."""
    if not runs:
        from .benchmark_page import page_of_benchmark

        made = page_of_benchmark(folder)
    elif len(runs) == 1:
        from .run_page import page_of_run

        made = page_of_run(runs[0], play)
    else:
        from .comparison_page import page_of_runs

        made = page_of_runs(runs, folder, play)
    below = any(run.folder.resolve() != folder.resolve() for run in runs)
    return made.write(folder / ("runs.html" if below else "report.html") if path is None else path)


def write_sweep_page(folder: Path, path: Path | None = None) -> Path:
    """Write the page of the sweep in ``folder``; the file, by default ``report.html`` in it."""
    from .sweep_page import page_of_sweep

    return page_of_sweep(folder).write(folder / "report.html" if path is None else path)


def is_benchmark(folder: Path) -> bool:
    """Whether ``folder`` holds what `geomech bench` leaves, and no runs."""
    return any(folder.glob("*.json")) and not any(folder.rglob("history.csv"))
