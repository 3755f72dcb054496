"""Pictures of `geomech bench slopes`, of invariants and of invariance: one square per slope, coloured by its outcome,
and each quantity relative to its bound."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

COLOURS = {"right": "#9cc5a1", "reported": "#f2d388", "refused": "#c9ccd1", "long": "#a9c4dd", "wrong": "#d1495b"}
MEANING = {
    "right": "right to the end",
    "reported": "beyond a bound, with a warning",
    "refused": "refused with a reason",
    "long": "right until its time limit",
    "wrong": "wrong without a warning",
}
#: Squares per row.
ACROSS = 25
#: Smaller values are not drawn.
LEAST = 1e-16


class Outcome(Protocol):
    """Outcome of a random slope."""

    seed: int
    verdict: str
    reason: str
    worst: Mapping[str, float]
    seconds: float


def draw(
    slopes: Sequence[Outcome],
    verdicts: Sequence[str],
    bounds: Mapping[str, float],
    path: Path,
    *,
    title: str = "",
    meaning: Mapping[str, str] = MEANING,
) -> Path:
    """Draw the outcomes of ``slopes`` in their order.

    ``bounds``: {quantity: bound}; ``meaning`` of the verdicts, for the legend.
    """
    from matplotlib.figure import Figure

    down = math.ceil(len(slopes) / ACROSS)
    heights = [0.3 * down + 0.9, 0.28 * len(bounds) + 1.0]
    figure = Figure(figsize=(11.5, sum(heights) + 0.4), dpi=120, layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=heights, squeeze=False)[:, 0]
    _squares(top, slopes, verdicts, down, title or f"Outcome of {len(slopes)} random slopes (by seed)", meaning)
    quantities, times = bottom.subplots(1, 2, width_ratios=[3, 1.3])
    _quantities(quantities, slopes, bounds)
    _times(times, slopes, verdicts)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path


def _squares(
    figure, slopes: Sequence[Outcome], verdicts: Sequence[str], down: int, title: str, meaning: Mapping[str, str]
) -> None:
    from matplotlib.patches import Patch, Rectangle

    axes = figure.subplots()
    for k, slope in enumerate(slopes):
        row, column = divmod(k, ACROSS)
        axes.add_patch(Rectangle((column, row), 1, 1, facecolor=COLOURS[slope.verdict], edgecolor="white", lw=1.2))
        axes.text(column + 0.5, row + 0.5, str(slope.seed), ha="center", va="center", fontsize=6.5, color="#333333")
    axes.set(xlim=(0, ACROSS), ylim=(down, 0), xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    axes.set_title(title, fontsize=11, loc="left")
    counts = Counter(slope.verdict for slope in slopes)
    reasons = Counter(slope.reason for slope in slopes if slope.verdict == "refused")
    handles, labels = [], []
    for verdict in verdicts:
        if counts[verdict] or verdict == "wrong":
            handles.append(Patch(facecolor=COLOURS[verdict]))
            labels.append(f"{counts[verdict]} {meaning[verdict]}")
        if verdict == "refused":
            for reason, count in reasons.most_common():
                handles.append(Patch(facecolor="none"))
                labels.append(f"{count} {reason}")
    figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize=9)


def _quantities(axes, slopes: Sequence[Outcome], bounds: Mapping[str, float]) -> None:
    for k, (name, bound) in enumerate(bounds.items()):
        for verdict, colour in COLOURS.items():
            values = [s.worst[name] for s in slopes if s.verdict == verdict and s.worst.get(name, 0.0) > LEAST]
            # Spread a little by their order, so that coinciding points are visible.
            ys = [k + 0.3 * (((7 * j) % 11) / 5 - 1) for j in range(len(values))]
            axes.plot(
                values, ys, "o", ms=3, color=colour, mec="#55555555", mew=0.3, zorder=3 if verdict == "wrong" else 2
            )
        axes.plot([bound, bound], [k - 0.42, k + 0.42], color="#222222", lw=1.6)
    axes.set(xscale="log", ylim=(len(bounds) - 0.5, -0.5), xlim=(LEAST, 10))
    axes.set_yticks(range(len(bounds)), list(bounds), fontsize=9)
    axes.set_title("Worst of each slope, and the bound (black)", fontsize=10, loc="left")
    axes.tick_params(axis="y", length=0)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _times(axes, slopes: Sequence[Outcome], verdicts: Sequence[str]) -> None:
    import numpy as np

    spent = {verdict: [max(s.seconds, 0.1) for s in slopes if s.verdict == verdict] for verdict in verdicts}
    edges = np.geomspace(0.1, 1.2 * max(max(of, default=1.0) for of in spent.values()), 16)
    axes.hist(list(spent.values()), edges, stacked=True, color=[COLOURS[verdict] for verdict in spent])
    axes.set(xscale="log", xlabel="processor time per slope, s", ylabel="slopes")
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.spines[["top", "right"]].set_visible(False)
