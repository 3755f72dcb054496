"""``geomech report``: a table, and a page with tables, curves and pictures; ``geomech view``: runs in the browser,
cycle by cycle, also while they run."""

from __future__ import annotations

import argparse
import os
import sys
import webbrowser
from pathlib import Path

from ..messages import say
from ..runs import open_run, run_folders
from ..verb import DONE, BadInput, Verbs, add_verb, check_writable


def declare(verbs: Verbs) -> None:
    """The verbs' arguments."""
    _declare_view(verbs)
    report = add_verb(
        verbs, "report", _report, "tabulate the results of runs, and write a page with tables, curves and pictures",
        "geomech report outputs/two_cracks/phi_0\ngeomech report outputs/two_cracks\ngeomech report outputs/bench_ddm\n"
        "geomech report outputs/slope_sweep",
    )  # fmt: skip
    report.description = (
        str(report.description)
        + " The page is one self-contained file: of a run, of several runs side by side, of a sweep, or of a benchmark."
    )
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
        "--play",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="include a player with a slider over the cycles",
    )
    report.add_argument("--page", action=argparse.BooleanOptionalAction, default=True, help="write the page")


def _declare_view(verbs: Verbs) -> None:
    view = add_verb(
        verbs, "view", _view, "play runs in the browser, cycle by cycle, also while they run",
        "geomech view outputs/two_cracks/phi_30\ngeomech view outputs/two_cracks/phi_0 outputs/two_cracks/phi_30\n"
        "geomech view outputs/slope --out slope.html",
    )  # fmt: skip
    view.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="run folders, up to four side by side")
    view.add_argument(
        "--out", type=Path, metavar="FILE", help="write the page as one self-contained file, and do not open it"
    )
    view.add_argument(
        "--megabytes", type=float, default=8.0, metavar="N", help="size of that file, in which cycles are thinned (8)"
    )
    view.add_argument("--port", type=int, default=0, help="port of the server (default: any free one)")
    view.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to serve at (default: this machine alone); others need the token that is printed",
    )
    view.add_argument(
        "--browser", action=argparse.BooleanOptionalAction, default=True, help="open the page in the browser"
    )


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


def _view(options: argparse.Namespace) -> int:
    from ...player.page import MOST_RUNS

    if not 0 <= options.port <= 65535:
        raise BadInput(f"--port: {options.port} is no port; give 0 to 65535")
    folders = [_only_run(place) for place in options.runs]
    if len(folders) > MOST_RUNS:
        raise BadInput(f"{len(folders)} runs do not fit side by side; give up to {MOST_RUNS}")
    return _write(options, folders) if options.out is not None else _serve(options, folders)


def _only_run(place: Path) -> Path:
    """The run in ``place``; else the only one below it."""
    below = run_folders(place)
    folder = below[0] if len(below) == 1 else place
    open_run(folder)
    return folder


def _write(options: argparse.Namespace, folders: list[Path]) -> int:
    from ...player.page import write_player
    from ...player.recording import NothingToPlay

    check_writable("--out", options.out)
    if not 0.01 <= options.megabytes <= 1000:
        raise BadInput(f"--megabytes: {options.megabytes:g} is not a possible size of a page; give 0.01 to 1000")
    try:
        path = write_player([open_run(folder) for folder in folders], options.out, int(1e6 * options.megabytes))
    except NothingToPlay as error:
        raise BadInput(str(error)) from None
    say(f"page: {path}, {path.stat().st_size / 1e6:.1f} MB")
    return DONE


def _serve(options: argparse.Namespace, folders: list[Path]) -> int:
    from ...player.server import PortInUse, Viewer

    try:
        viewer = Viewer(folders, options.host, options.port)
    except PortInUse as error:
        raise BadInput(f"--port: {error}; leave it out to use a free one") from None
    except OSError as error:
        raise BadInput(f"--host: {options.host} is no address of this machine ({error.strerror})") from None
    say(f"{viewer.title}: {viewer.address}")
    if not viewer.local:
        say("anyone with this address can see the runs; it is not encrypted, so use it in a trusted network only")
    if options.browser and not _opened(viewer.address):
        say("no browser could be opened here: open the address in yours; from another machine, first\n"
            f"    ssh -L {viewer.port}:localhost:{viewer.port} THIS_MACHINE")  # fmt: skip
    say("Ctrl-C ends it")
    try:
        viewer.serve()
    except KeyboardInterrupt:
        say("ended")
    return DONE


def _opened(address: str) -> bool:
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False  # a browser that could be opened here would run in this terminal
    try:
        return webbrowser.open(address)
    except webbrowser.Error:
        return False
