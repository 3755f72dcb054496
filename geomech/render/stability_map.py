"""The picture of `geomech bench stability`: a panel a map, a square a scene, coloured by what became of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

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
    from matplotlib.patches import Patch

    figure, panels, last = _panels(len(grids))
    for panel, grid in zip(panels, grids):
        mine = [c for c in cells if c.map == grid.title]
        texts = ["–" if c.verdict == "refused" else _short(c.error) for c in mine]
        _squares(panel, grid, [COLOURS[c.verdict] for c in mine], texts)
        panel.set_title(f"{grid.title}  (right below {grid.bound:g})", fontsize=10, loc="left")
    last.legend(
        [Patch(facecolor=colour) for colour in COLOURS.values()],
        ["right: error below the bound", "reported: beyond it, a warning says so", "refused with a reason",
         "wrong in silence"],
        loc="center", frameon=False, fontsize=11,
    )  # fmt: skip
    return _saved(figure, path)


def draw_quantity(grids: Sequence[Grid], cells: Sequence[Judged], quantity: str, name: str, path: Path) -> Path | None:
    """The ``quantity`` that cells have (nan: have not), its logarithm as the colour; None where no grid has any."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, LogNorm
    from matplotlib.ticker import LogLocator

    told = {g.title: [getattr(c, quantity) for c in cells if c.map == g.title] for g in grids}
    grids = [g for g in grids if any(v > 0 for v in told[g.title])]
    if not grids:
        return None
    positive = [v for g in grids for v in told[g.title] if v > 0]
    # The darker half would hide the figures.
    shades = ListedColormap(colormaps["YlGnBu"](np.linspace(0.05, 0.7, 256)))
    norm = LogNorm(min(positive), 1.001 * max(positive))
    figure, panels, last = _panels(len(grids))
    for panel, grid in zip(panels, grids):
        values = told[grid.title]
        faces = [shades(norm(v)) if v > 0 else "#f4f4f4" for v in values]
        _squares(panel, grid, faces, ["–" if math.isnan(v) else _short(v) for v in values])
        panel.set_title(grid.title, fontsize=10, loc="left")
    bar = figure.colorbar(
        ScalarMappable(norm, shades), ax=last, orientation="horizontal", fraction=0.15, ticks=LogLocator(numticks=6),
        label=f"{name} (–: refused, or none)",
    )  # fmt: skip
    bar.minorticks_off()
    return _saved(figure, path)


def _panels(number: int):
    """A figure, its panels, and one panel more, empty, for what the colours mean."""
    from matplotlib.figure import Figure

    across = 3
    down = math.ceil((number + 1) / across)
    height = 3.1 * down
    figure = Figure(figsize=(14, height), dpi=120)
    # Margins in inches, the same for all: a layout that measures every text takes longer than all else.
    room = {
        "left": 0.06,
        "right": 0.99,
        "bottom": 0.55 / height,
        "top": 1 - 0.35 / height,
        "wspace": 0.2,
        "hspace": 0.36,
    }
    axes = figure.subplots(down, across, gridspec_kw=room).ravel()
    for panel in axes[number:]:
        panel.set_axis_off()
    return figure, axes[:number], axes[number]


def _squares(panel, grid: Grid, colours: Sequence, texts: Sequence[str]) -> None:
    from matplotlib.patches import Rectangle

    n, m = len(grid.rows), len(grid.columns)
    for k, (colour, text) in enumerate(zip(colours, texts)):
        i, j = divmod(k, m)
        panel.add_patch(Rectangle((j, i), 1, 1, facecolor=colour, edgecolor="white", lw=1.5))
        panel.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=7.5, color="#222222")
    panel.set(xlim=(0, m), ylim=(n, 0), xlabel=grid.column_name, ylabel=grid.row_name)
    panel.set_xticks([j + 0.5 for j in range(m)], [f"{v:g}" for v in grid.columns], fontsize=8)
    panel.set_yticks([i + 0.5 for i in range(n)], [f"{v:g}" for v in grid.rows], fontsize=8)
    panel.tick_params(length=0)
    for side in panel.spines.values():
        side.set_visible(False)


def _saved(figure, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path


def _short(error: float) -> str:
    if error == 0:
        return "0"
    figure, power = f"{error:.0e}".split("e")
    return f"{figure}e{int(power)}"
