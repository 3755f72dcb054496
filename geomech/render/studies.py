"""Curves of a study: what several runs came to, against what differs between them, beside published values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from .plots import COLOURS, figure_of

#: A published range: its lower and upper end.
Range = tuple[float, float]


def against(
    curves: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    path: Path,
    x: str,
    y: str,
    ranges: Mapping[str, Range] | None = None,
    log: bool = False,
) -> Path:
    """``curves``: name → (x, y) with a mark at every point; ``ranges`` are bands across; ``log`` scales both axes so."""
    figure, save = figure_of((5.6, 3.6), path)
    axes = figure.add_subplot()
    for k, (name, (xs, ys)) in enumerate(curves.items()):
        axes.plot(xs, ys, "o-", color=COLOURS[k % len(COLOURS)], lw=1.5, ms=4.5, label=name)
    for k, (name, (low, high)) in enumerate((ranges or {}).items(), len(curves)):
        axes.axhspan(low, high, color=COLOURS[k % len(COLOURS)], alpha=0.22, lw=0, label=name)
    if log:
        axes.set(xscale="log", yscale="log")
    else:
        axes.set_ylim(bottom=0)
        if curves and all(len(xs) <= 8 for xs, _ in curves.values()):
            axes.set_xticks(sorted({float(value) for xs, _ in curves.values() for value in xs}))
    axes.set(xlabel=x, ylabel=y)
    axes.legend(frameon=False, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    return save()
