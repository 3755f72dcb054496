"""Abscissa of a run's curves: its leading load, or time without one; with events."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geomech.output.reading import Run
from geomech.output.units import largest_of, stress_unit

from ..pictures.look import final_cycle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: One per curve.
COLOURS = ("#1f6f8b", "#c8553d", "#588157", "#8d6a9f", "#b08900", "#3d405b")
#: Full and broken lines, one for each colour, because colours look alike in a grey print.
DASHES = (
    "-",
    (0, (5, 1.8)),
    (0, (1.2, 1.4)),
    (0, (6, 1.6, 1.2, 1.6)),
    (0, (9, 2.5)),
    (0, (3, 1.2, 1.2, 1.2, 1.2, 1.2)),
)
#: Curves that differ by less than this part of the largest value coincide on paper.
SAME = 0.01


def line_of(k: int) -> dict[str, Any]:
    """Colour and dashes of curve number ``k``, for Matplotlib."""
    return {"color": COLOURS[k % len(COLOURS)], "ls": DASHES[k % len(DASHES)]}


def sense(run: Run) -> float:
    """1 if the leading load is compressive, −1 if tensile: its largest value is drawn at the right."""
    load = run.history["load"]
    return -1.0 if np.nanmax(np.abs(load)) > np.nanmax(load) else 1.0


def load_unit(run: Run) -> tuple[str, float]:
    """(name, Pa) of the unit of the run's leading load."""
    return stress_unit(largest_of(run.history["load"]))


def drive(run: Run, rows: np.ndarray) -> np.ndarray:
    """Abscissa of ``rows``: the leading load in its unit, or the time (s) of a run without one."""
    return sense(run) * rows["load"] / load_unit(run)[1] if run.led else rows["time"]


def drive_label(run: Run) -> str:
    """Label of that axis."""
    return load_label(run) if run.led else "time, s"


def load_label(run: Run) -> str:
    """Label of the axis of the leading load, with its unit."""
    unit = load_unit(run)[0]
    return f"load in tension, {unit}" if sense(run) < 0 else f"load, {unit}"


def to_the_end(run: Run) -> np.ndarray:
    """The history up to the end that is drawn: without the final cut, in which cracks become block faces."""
    return run.history[run.history["cycle"] <= final_cycle(run)]


def first_events(axes: Axes, run: Run, strain: np.ndarray | None) -> None:
    """Mark the first event of every kind: a point on the load–strain curve, or a line at its load (or time).

    Coinciding events share one mark.
    """
    history = to_the_end(run)
    if not len(run.events):
        return
    _, first = np.unique(run.events["kind"], return_index=True)
    events = run.events[np.sort(first)]
    # On paper, a hundredth of the axes is the size of a mark.
    size = np.array(
        [1.0 if strain is None else np.nanmax(np.abs(strain)), np.nanmax(np.abs(drive(run, history)), initial=0.0)]
    )
    marks: dict[tuple[float, float], list[str]] = {}
    for event, place in zip(events, drive(run, events), strict=True):
        row = min(np.searchsorted(history["cycle"], event["cycle"]), len(history) - 1)
        at = (0.0 if strain is None else float(strain[row]), float(place))
        near = [other for other in marks if np.all(np.abs(np.subtract(other, at)) <= 0.01 * size)]
        marks.setdefault(near[0] if near else at, []).append(str(event["kind"]))
    for k, ((x, place), kinds) in enumerate(marks.items()):
        colour, label = COLOURS[1 + k % (len(COLOURS) - 1)], ", ".join(kinds)
        if strain is None:
            axes.axvline(place, color=colour, lw=1.0, ls=":", label=label)
        else:
            axes.plot(x, place, "o", color=colour, ms=5, label=label)
    axes.legend(frameon=False, fontsize=8)
