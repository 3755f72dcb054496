"""Crack paths superposed: one panel per specimen, one colour per run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .plots import COLOURS, figure_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from geomech.model import Cracks

#: Margin around the cracks, relative to their extent.
_MARGIN = 0.25
#: Margin around outlines.
_TIGHT = 0.06
#: Size of a panel's axes, inches.
_WIDEST, _TALLEST = 2.0, 4.6


def crack_paths(
    panels: Mapping[str, Mapping[str, Cracks]],
    path: Path,
    columns: int = 4,
    outlines: Mapping[str, np.ndarray] | None = None,
) -> Path:
    """Draw crack paths.

    ``panels``: {title: {name: cracks at the end of a run}}. Initial cracks are black, growth has the colour of its run;
    all panels have one scale. ``outlines``: {title: (n, 2) m of the rock}. Lengths in mm.
    """
    panels = {
        title: {name: cracks for name, cracks in runs.items() if cracks.n_segments} for title, runs in panels.items()
    }
    panels, outlines = {title: runs for title, runs in panels.items() if runs}, outlines or {}
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    points = {
        title: 1e3
        * np.concatenate(
            [
                *(cracks.nodes[np.unique(cracks.segments)] for cracks in runs.values()),
                outlines.get(title, np.empty((0, 2))),
            ]
        )
        for title, runs in panels.items()
    }
    width, height = np.max([np.ptp(own, axis=0) for own in points.values()], axis=0) * (
        1 + (_TIGHT if outlines else _MARGIN)
    )
    width = max(width, 0.45 * height)
    # Inches of a panel's axes, of tick labels at the left and below, of the legend.
    wide = min(_WIDEST, _TALLEST * width / height)
    size = ((wide + 0.45) * columns + 0.3, (wide * height / width + 0.6) * rows + 0.5)
    figure, save = figure_of(size, path)
    axes = figure.subplots(rows, columns, squeeze=False)
    names = list(dict.fromkeys(name for runs in panels.values() for name in runs))
    for panel, (title, runs) in zip(axes.flat, panels.items()):
        centre = (points[title].min(axis=0) + points[title].max(axis=0)) / 2
        if title in outlines:
            panel.fill(*(1e3 * outlines[title]).T, facecolor="#f1efe9", edgecolor="#3b3f46", lw=0.9)
        _draw_runs(panel, runs, names)
        panel.set(
            title=title,
            aspect="equal",
            xlim=(centre[0] - width / 2, centre[0] + width / 2),
            ylim=(centre[1] - height / 2, centre[1] + height / 2),
        )
        panel.title.set_fontsize(10)
        panel.tick_params(labelsize=7)
        panel.spines[["top", "right"]].set_visible(False)
    for panel in axes.flat[len(panels) :]:
        panel.set_axis_off()
    axes.flat[0].set_ylabel("mm", fontsize=8)
    if len(names) > 1:
        handles = {label: handle for panel in axes.flat for handle, label in zip(*panel.get_legend_handles_labels())}
        figure.legend(
            handles.values(),
            handles.keys(),
            loc="outside lower center",
            ncols=min(len(names), 4),
            frameon=False,
            fontsize=9,
        )
    return save()


def _draw_runs(panel: Axes, runs: Mapping[str, Cracks], names: list[str]) -> None:
    """Cracks of all ``runs`` in one ``panel``, in the colours of their ``names``."""
    for name, cracks in runs.items():
        k = names.index(name)
        line, wider = ("-", "--", ":")[k // len(COLOURS) % 3], 0.45 * (len(runs) - list(runs).index(name) - 1)
        for old in (False, True):
            lines = 1e3 * cracks.nodes[cracks.segments[(cracks.birth_cycle == 0) == old]]
            if not len(lines):
                continue
            # One interrupted line for all segments.
            x, y = np.concatenate([lines, np.full((len(lines), 1, 2), np.nan)], axis=1).reshape(-1, 2).T
            colour = "#15161a" if old else COLOURS[k % len(COLOURS)]
            label = name if not old and len(names) > 1 else None
            panel.plot(
                x,
                y,
                color=colour,
                lw=2.4 if old else 1.5 + wider,
                ls="-" if old else line,
                label=label,
                solid_capstyle="round",
            )
