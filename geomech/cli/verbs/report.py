"""``geomech report``: a table of runs, and a page with tables, curves and pictures."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from ..messages import say
from ..runs import open_run, run_folders
from ..verb import DONE, Verbs, add_verb, check_writable


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    report = add_verb(
        verbs, "report", _report, "tabulate what runs came to, and write a page with tables, curves and pictures",
        "geomech report outputs/two_cracks/phi_0\ngeomech report outputs/two_cracks\ngeomech report outputs/bench_ddm\n"
        "geomech report outputs/slope_sweep",
    )  # fmt: skip
    report.description += " The page is one file that needs nothing else: of a run, of runs side by side, of a sweep, or of what a benchmark left."
    report.add_argument(
        "runs", nargs="+", type=Path, metavar="RUN", help="run folders, folders of run folders, or a benchmark's folder"
    )
    report.add_argument("--csv", action="store_true", help="write the table as CSV, and no page")
    report.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="where the page goes (default report.html in RUN, runs.html where RUN holds several)",
    )
    report.add_argument(
        "--play", action=argparse.BooleanOptionalAction, default=True, help="a slider over the cycles in the page"
    )
    report.add_argument("--page", action=argparse.BooleanOptionalAction, default=True, help="write the page")


def _report(options: argparse.Namespace) -> int:
    check_writable("--out", options.out)
    from ...report import as_csv, as_text, is_benchmark, table, write_page

    if len(options.runs) == 1 and (options.runs[0] / "sweep.json").is_file():
        return _report_sweep(options)
    place, benchmark = options.runs[0], len(options.runs) == 1 and is_benchmark(options.runs[0])
    folders = [] if benchmark else [found for place in options.runs for found in run_folders(place)]
    runs = [open_run(folder) for folder in folders]
    if runs:
        rows = table(runs)
        print(as_csv(rows) if options.csv else as_text(rows))
    if options.page and not options.csv:
        if len(options.runs) > 1:
            place = Path(os.path.commonpath([folder.resolve() for folder in folders]))
        say(f"page: {write_page(place, runs, options.out, play=options.play)}")
    return DONE


def _report_sweep(options: argparse.Namespace) -> int:
    from ...report import write_sweep_page
    from ...sweep.execution import read_sweep

    found = read_sweep(options.runs[0])
    if options.csv:
        print((found.folder / "runs.csv").read_text(encoding="utf-8"), end="")
        return DONE
    print(found.text())
    if options.page:
        say(f"page: {write_sweep_page(found.folder, options.out)}")
    return DONE
