"""The picture of `geomech bench stability`: a panel a map, a square a scene, coloured by what became of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

COLOURS = {"right": "#9cc5a1", "reported": "#f2d388", "refused": "#c9ccd1", "wrong": "#d1495b"}


class Judged(Protocol):
    map: str
    verdict: str
    error: float


class Grid(Protocol):
    title: str
    row_name: str
    rows: Sequence[float]
    column_name: str
    columns: Sequence[float]
    bound: float


def draw(grids: Sequence[Grid], cells: Sequence[Judged], path: Path) -> Path:
    """``cells`` in the order of their grids, row by row; each square carries its error."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, Rectangle

    across = 3
    down = math.ceil((len(grids) + 1) / across)
    figure = Figure(figsize=(14, 3.1 * down), dpi=120, layout="constrained")
    axes = figure.subplots(down, across).ravel()
    for panel, grid in zip(axes, grids):
        mine = iter([c for c in cells if c.map == grid.title])
        n, m = len(grid.rows), len(grid.columns)
        for i in range(n):
            for j in range(m):
                cell = next(mine)
                panel.add_patch(Rectangle((j, i), 1, 1, facecolor=COLOURS[cell.verdict], edgecolor="white", lw=1.5))
                text = "–" if cell.verdict == "refused" else _short(cell.error)
                panel.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=7.5, color="#222222")
        panel.set(xlim=(0, m), ylim=(n, 0), xlabel=grid.column_name, ylabel=grid.row_name)
        panel.set_xticks([j + 0.5 for j in range(m)], [f"{v:g}" for v in grid.columns], fontsize=8)
        panel.set_yticks([i + 0.5 for i in range(n)], [f"{v:g}" for v in grid.rows], fontsize=8)
        panel.tick_params(length=0)
        panel.set_title(f"{grid.title}  (right below {grid.bound:g})", fontsize=10, loc="left")
        for side in panel.spines.values():
            side.set_visible(False)
    for panel in axes[len(grids) :]:
        panel.set_axis_off()
    axes[len(grids)].legend(
        [Patch(facecolor=colour) for colour in COLOURS.values()],
        ["right: error below the bound", "reported: beyond it, a warning says so", "refused with a reason", "wrong in silence"],
        loc="center", frameon=False, fontsize=11,
    )  # fmt: skip
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path


def _short(error: float) -> str:
    if error == 0:
        return "0"
    power = math.floor(math.log10(error))
    return f"{error / 10**power:.0f}e{power:d}"
