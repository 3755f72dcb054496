"""Page of several runs side by side: a table, the differences between their scenes, a picture and curves of each."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..output.reading import Run
from .page import Page
from .run_page import LISTED, add_player
from .table import shown, table

#: Keys of a scene that give its location, not its content.
_NOT_COMPARED = ("title", "geometry.model")
#: Number of runs shown in pictures.
PICTURED = 12


def page_of_runs(runs: Sequence[Run], folder: Path, play: bool = True) -> Page:
    """Page of ``runs`` in ``folder``; with ``play`` with a player."""
    page = Page(_title(runs), f"{len(runs)} runs in {folder}")
    page.section("Side by side")
    add_table(page, runs)
    if play:
        add_player(page, runs)
    different = differences(runs)
    if different:
        page.section("Differences between their scenes")
        page.table(
            ["key", *(run.folder.name for run in runs)],
            [[key, *values] for key, values in list(different.items())[:LISTED]],
        )
        if len(different) > LISTED:
            page.text(f"{len(different) - LISTED} more keys differ.")
    add_ends(page, runs)
    add_compared_curves(page, runs)
    _add_times(page, runs)
    page.section("How to reproduce this page")
    page.code(f"geomech report {folder}\n" + "\n".join(f"geomech report {run.folder}" for run in runs))
    return page


def _add_times(page: Page, runs: Sequence[Run]) -> None:
    spent = [run.summary.get("seconds", {}) for run in runs]
    phases = sorted(
        {phase for one in spent for phase in one}, key=lambda name: -max(one.get(name, 0.0) for one in spent)
    )
    if phases:
        page.section("Computing time")
        page.table(
            ["phase, s", *(run.folder.name for run in runs)],
            [[phase, *(one.get(phase) for one in spent)] for phase in phases],
        )


def add_table(page: Page, runs: Sequence[Run]) -> None:
    """The table that the terminal shows, without columns that are empty for all runs."""
    headers, *rows = shown(table(runs))
    page.table([str(name) for name in headers], rows)


def differences(runs: Sequence[Run]) -> dict[str, list[Any]]:
    """Key of the scene → its value in every run (None: missing), for keys whose values differ."""
    flat = [dict(_leaves(run.scene)) for run in runs]
    keys = dict.fromkeys(key for leaves in flat for key in leaves if not key.startswith(_NOT_COMPARED))
    found = {key: [leaves.get(key) for leaves in flat] for key in keys}
    return {key: values for key, values in found.items() if any(value != values[0] for value in values)}


def _leaves(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, f"{place}.{key}" if place else key)
    elif isinstance(value, list) and any(isinstance(inner, (dict, list)) for inner in value):
        for k, inner in enumerate(value):
            yield from _leaves(inner, f"{place}.{k}")
    else:
        yield place, str(value) if isinstance(value, list) else value


def add_ends(page: Page, runs: Sequence[Run], title: str = "Pictures") -> None:
    """Pictures of the end of every run."""
    from ..render.fields.draw import draw_end, suited

    pictured = [run for run in runs if len(run.history) and run.grids("blocks")][:PICTURED]
    if not pictured:
        return
    page.section(title)
    with tempfile.TemporaryDirectory() as folder:
        painters = [suited(run, width=560) for run in pictured]
        # Compared pictures have one range of colours.
        spans: dict[str, tuple[float, float]] = {}
        for painter in painters:
            low, high = spans.get(painter.what.name, painter.view.limits)
            spans[painter.what.name] = min(low, painter.view.limits[0]), max(high, painter.view.limits[1])
        shown = []
        for k, run in enumerate(pictured):
            painter = suited(run, width=560, span=spans.get(painters[k].what.name))
            path = draw_end(painter, Path(folder) / f"{k}.png")
            shown.append((path, f"{run.folder.name}: {run.summary.get('end', 'not ended')}"))
        page.figures(shown, least_rem=13)
    if len(runs) > PICTURED:
        page.text(f"{len(runs) - PICTURED} more runs are not shown.")


def add_compared_curves(page: Page, runs: Sequence[Run]) -> None:
    """Load against strain of all runs in one figure, if they have both."""
    from ..render.curves.plots import compared

    with tempfile.TemporaryDirectory() as folder:
        drawn = compared({run.folder.name: run for run in runs}, Path(folder) / "compared.svg")
        if drawn is not None:
            page.section("Curves")
            page.figures([(drawn, "Load and axial strain of every run.")], least_rem=24)


def _title(runs: Sequence[Run]) -> str:
    """Common beginning of the runs' titles, up to a comma."""
    titles = {run.title.rsplit(",", 1)[0] for run in runs}
    return titles.pop() if len(titles) == 1 else "Runs side by side"
