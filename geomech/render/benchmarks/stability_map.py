"""Pictures of `geomech bench stability`: one row of panels per map, one square per scene.

The first panel is coloured by the outcome, each of the others by a quantity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

COLOURS = {"right": "#9cc5a1", "reported": "#f2d388", "refused": "#c9ccd1", "wrong": "#d1495b"}
#: Colour of a square whose quantity is zero.
_ZERO = "#f4f4f4"


class Judged(Protocol):
    """A cell of a map with its verdict and error."""

    map: str
    verdict: str
    error: float


class Grid(Protocol):
    """A map: the measured quantity, and its rows and columns."""

    title: str
    measure: str
    row_name: str
    rows: Sequence[float]
    column_name: str
    columns: Sequence[float]
    bound: float


def draw(grids: Sequence[Grid], cells: Sequence[Judged], path: Path, quantities: Mapping[str, str]) -> Path:
    """Draw ``cells``, in the order of their grids, row by row, each with its error.

    A further panel for each of the ``quantities`` (attribute → name) that a grid has is coloured by its logarithm, from
    the least to the largest value in the picture.
    """
    from matplotlib.patches import Patch

    figure, panels, foot = _panels([len(grid.rows) for grid in grids], 1 + len(quantities))
    shades = {quantity: _Shades([getattr(c, quantity) for c in cells]) for quantity in quantities}
    for row, grid in zip(panels, grids):
        selected = [c for c in cells if c.map == grid.title]
        texts = ["–" if c.verdict == "refused" else _short(c.error) for c in selected]
        _squares(row[0], grid, [COLOURS[c.verdict] for c in selected], texts)
        row[0].set_title(f"{grid.title}: error, right below {grid.bound:g}", fontsize=10, loc="left")
        for panel, (quantity, name) in zip(row[1:], quantities.items()):
            values = [math.nan if c.verdict == "refused" else float(getattr(c, quantity)) for c in selected]
            if all(math.isnan(value) for value in values):
                panel.set_axis_off()
                continue
            faces = [COLOURS["refused"] if math.isnan(v) else shades[quantity](v) for v in values]
            texts = ["–" if math.isnan(v) else _short(v) for v in values]
            _squares(panel, grid, faces, texts)
            panel.set_ylabel("")
            panel.set_title(name, fontsize=10, loc="left")
    figure.legend(
        [Patch(facecolor=colour) for colour in COLOURS.values()],
        ["right: error below the bound", "reported: beyond it, with a warning", "refused with a reason (–)",
         "wrong without a warning"],
        loc="lower center", ncols=4 if quantities else 2, frameon=False, fontsize=10, bbox_to_anchor=(0.5, foot),
    )  # fmt: skip
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path


class _Shades:
    """Colours of positive numbers by their logarithm; others are pale."""

    def __init__(self, values: Sequence[float]) -> None:
        from matplotlib import colormaps

        positive = [math.log(v) for v in values if v > 0]
        self._least = min(positive, default=0.0)
        self._range = max(max(positive, default=0.0) - self._least, 1e-12)
        # The darker half would hide the numbers.
        self._map = colormaps["YlGnBu"]

    def __call__(self, value: float):
        if not value > 0:
            return _ZERO
        return self._map(0.05 + 0.65 * (math.log(value) - self._least) / self._range)


def _panels(rows: Sequence[int], across: int):
    """A figure, its panels, and the height of its legend area relative to the figure's.

    There are ``across`` panels for each grid, with ``rows`` rows; without further panels, three grids stand side by
    side.
    """
    from matplotlib.figure import Figure

    # Margins in inches, the same for all: a layout that measures every text takes longer than everything else.
    over, under, square, foot = 0.35, 0.55, 0.21, 0.4
    if across == 1:
        n_columns = 3
        rows = [max(rows[k : k + n_columns]) for k in range(0, len(rows), n_columns)]
        figure, made, height = _stacked(Figure, rows, n_columns, over, under, square, foot)
        return figure, [[panel] for row in made for panel in row], 0.08 / height
    figure, made, height = _stacked(Figure, rows, across, over, under, square, foot)
    return figure, made, 0.08 / height


def _stacked(make, rows: Sequence[int], across: int, over: float, under: float, square: float, foot: float):
    high = [square * max(n, 3) for n in rows]
    height, width = sum(high) + len(rows) * (over + under) + foot, 4.1 * across
    figure = make(figsize=(width, height), dpi=100)
    panels, top = [], height
    for tall in high:
        top -= over + tall
        panels.append(
            [
                figure.add_axes(((4.1 * k + 0.75) / width, top / height, 3.2 / width, tall / height))
                for k in range(across)
            ]
        )
        top -= under
    for row in panels:
        for panel in row:
            panel.set_axis_off()
    return figure, panels, height


def _squares(panel, grid: Grid, colours: Sequence, texts: Sequence[str]) -> None:
    from matplotlib.patches import Rectangle

    panel.set_axis_on()
    n, m = len(grid.rows), len(grid.columns)
    for k, (colour, text) in enumerate(zip(colours, texts)):
        i, j = divmod(k, m)
        panel.add_patch(Rectangle((j, i), 1, 1, facecolor=colour, edgecolor="white", lw=1.5))
        panel.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=7.5, color="#222222")
    panel.set(xlim=(0, m), ylim=(n, 0), xlabel=grid.column_name, ylabel=grid.row_name)
    panel.set_xticks([j + 0.5 for j in range(m)], [f"{v:g}" for v in grid.columns], fontsize=8)
    panel.set_yticks([i + 0.5 for i in range(n)], [f"{v:g}" for v in grid.rows], fontsize=8)
    panel.xaxis.label.set_fontsize(9)
    panel.yaxis.label.set_fontsize(9)
    panel.tick_params(length=0)
    for side in panel.spines.values():
        side.set_visible(False)


def _short(value: float) -> str:
    if value == int(value) and abs(value) < 1000:
        return f"{value:g}"
    figure, power = f"{value:.0e}".split("e")
    return f"{figure}e{int(power)}"
