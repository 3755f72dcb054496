"""Curves of a run: load against strain, stress intensity factors and crack length against load."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.reading import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = ("#1f6f8b", "#c8553d", "#588157", "#8d6a9f", "#b08900", "#3d405b")


def plots(run: Run, folder: Path) -> list[Path]:
    """Draw the curves that ``run`` has data for as PNG files in ``folder``; their paths."""
    wanted = {
        "stress_strain.png": (stress_strain, np.isfinite(run.history["strain"]).sum() > 1),
        "stress_intensity.png": (stress_intensity, len(run.tips) > 0),
        "crack_length.png": (crack_length, len(run.tips) > 0),
    }
    paths = []
    for name, (curve, has_data) in wanted.items():
        if has_data:
            paths.append(_save(curve, run, folder / name))
    return paths


def stress_strain(axes: Axes, run: Run) -> None:
    """The leading load against axial strain, both positive in compression, with the run's events."""
    history = run.history
    axes.plot(1e3 * history["strain"], history["load"] / 1e6, color=_COLOURS[0], lw=1.8)
    _first_events(axes, run, 1e3 * history["strain"])
    axes.set(xlabel="axial strain, 10⁻³", ylabel="load, MPa", title=run.title)


def stress_intensity(axes: Axes, run: Run) -> None:
    """K_I (full) and K_II (dashed) against load at every tip: growth relieves a tip, the load drives it up again."""
    tips = run.tips
    ends = np.unique(np.stack([tips["crack"], tips["end"]], axis=1), axis=0)
    for k, (crack, end) in enumerate(ends):
        mine = tips[(tips["crack"] == crack) & (tips["end"] == end)]
        colour = _COLOURS[k % len(_COLOURS)]
        load = mine["load"] / 1e6
        label = f"crack {int(crack) + 1}, {'end' if end else 'start'}"
        axes.plot(load, mine["K_I"] / 1e6, color=colour, lw=1.4, label=label)
        axes.plot(load, mine["K_II"] / 1e6, color=colour, lw=1.0, ls="--")
    axes.plot([], [], color="#555555", lw=1.6, label=r"$K_I$")
    axes.plot([], [], color="#555555", lw=1.3, ls="--", label=r"$K_{II}$")
    axes.axhline(0, color="#999999", lw=0.6)
    if len(ends) <= 8:
        axes.legend(frameon=False, fontsize=8)
    axes.set(xlabel="load, MPa", ylabel="stress intensity factor, MPa√m", title=run.title)


def crack_length(axes: Axes, run: Run) -> None:
    """The length of all cracks against load: what grows at one load is a vertical line."""
    history = run.history
    axes.plot(history["load"] / 1e6, 1e3 * history["crack_length"], color=_COLOURS[0], lw=1.8)
    _first_events(axes, run, None)
    axes.set(xlabel="load, MPa", ylabel="crack length, mm", title=run.title)


def _first_events(axes: Axes, run: Run, strain: np.ndarray | None) -> None:
    """Mark the first event of every kind: as a point on the load–strain curve, or as a line at its load."""
    for k, (kind, cycle, load) in enumerate(_firsts(run)):
        colour = _COLOURS[1 + k % (len(_COLOURS) - 1)]
        if strain is None:
            axes.axvline(load / 1e6, color=colour, lw=1.0, ls=":", label=kind)
        else:
            row = min(np.searchsorted(run.history["cycle"], cycle), len(strain) - 1)
            axes.plot(strain[row], load / 1e6, "o", color=colour, ms=5, label=kind)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=8)


def _firsts(run: Run) -> list[tuple[str, float, float]]:
    first: dict[str, tuple[str, float, float]] = {}
    for event in run.events:
        first.setdefault(str(event["kind"]), (str(event["kind"]), event["cycle"], event["load"]))
    return list(first.values())


def _save(curve, run: Run, path: Path) -> Path:
    # The object interface: pyplot would keep figures and may want a display.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6, 3.6), dpi=140, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    curve(axes, run)
    axes.spines[["top", "right"]].set_visible(False)
    axes.title.set_fontsize(10)
    figure.savefig(path)
    return path
