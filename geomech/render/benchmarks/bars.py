"""Horizontal bars of several quantities side by side, on a logarithmic axis."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

#: Colours of series, the first for the one of interest.
_COLOURS = ("#c8553d", "#8aa4a0", "#d9a441")


def draw_bars(series: Mapping[str, Mapping[str, float]], path: Path, label: str, title: str = "") -> Path:
    """One row per name in the ``series`` (legend → name → positive value), with one bar and its value per series.

    ``label`` is that of the axis. Zero values are drawn at the axis's lower end.
    """
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(name for values in series.values() for name in values))
    known = [value for values in series.values() for value in values.values() if value > 0]
    low, high = (min(known), max(known)) if known else (1.0, 10.0)
    low, thick = low / 2.0, 0.8 / len(series)
    figure = Figure(figsize=(10, 1.3 + len(names) * (0.2 + 0.12 * len(series))), dpi=110, layout="constrained")
    axes = figure.subplots()
    for k, (legend, values) in enumerate(series.items()):
        rows = [j for j, name in enumerate(names) if name in values]
        lengths = [max(values[names[j]], low) for j in rows]
        heights = [j + (k - 0.5 * (len(series) - 1)) * thick for j in rows]
        axes.barh(heights, lengths, 0.9 * thick, left=0, color=_COLOURS[k % len(_COLOURS)], label=legend)
        for height, length, j in zip(heights, lengths, rows):
            value = values[names[j]]
            axes.annotate(
                f"{value:.3g}", (length, height), (4, 0), textcoords="offset points", va="center", fontsize=7,
                color="#444444",
            )  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlim(low, high * max(2.0, (high / low) ** 0.15))
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlabel(label)
    axes.set_title(title, fontsize=11, loc="left")
    axes.grid(axis="x", color="#e4e4e4", lw=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)
    axes.spines[["top", "right"]].set_visible(False)
    if len(series) > 1:
        axes.legend(frameon=False, fontsize=8, loc="lower right")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path
