"""Reports of runs and benchmarks: a table for the terminal, and a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..output.reading import Run
from .table import COLUMNS, as_csv, as_text, table

__all__ = ["COLUMNS", "as_csv", "as_text", "is_benchmark", "table", "write_page", "write_sweep_page"]


def write_page(folder: Path, runs: Sequence[Run], path: Path | None = None, *, play: bool = True) -> Path:
    """Write the page of ``runs``, or, with none, of the benchmark in ``folder``; returns the file.

    ``folder`` is the run's own folder, or the one with the ``runs``. By default the file is ``report.html`` in
    ``folder``, or ``runs.html`` for several runs: a study leaves its own ``report.html`` there. With ``play`` the page
    includes a player.
    """
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
    """Write the page of the sweep in ``folder``; returns the file, by default ``report.html`` in it."""
    from .sweep_page import page_of_sweep

    return page_of_sweep(folder).write(folder / "report.html" if path is None else path)


def is_benchmark(folder: Path) -> bool:
    """Whether ``folder`` holds the output of `geomech bench`, and no runs."""
    return any(folder.glob("*.json")) and not any(folder.rglob("history.csv"))
