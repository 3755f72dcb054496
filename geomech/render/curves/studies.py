"""Curves of a study: results of several runs against the varied quantity, with published values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from .drive import COLOURS, line_of
from .plots import figure_of

#: A published range: its lower and upper end.
Range = tuple[float, float]
#: Curves with no more points than this have a mark at each.
MARKED = 12


def against(
    curves: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    path: Path,
    x: str,
    y: str,
    ranges: Mapping[str, Range] | None = None,
    log: bool = False,
) -> Path:
    """``curves``: {name: (x, y)}; ``ranges`` are horizontal bands; ``log`` selects logarithmic axes."""
    from matplotlib.ticker import LogLocator, NullLocator

    figure, save = figure_of((5.6, 3.6 + 0.2 * ((len(curves) + len(ranges or {})) // 2)), path)
    axes = figure.add_subplot()
    for k, (name, (xs, ys)) in enumerate(curves.items()):
        mark = "osD^v*"[k % 6] if len(xs) <= MARKED else None
        axes.plot(xs, ys, marker=mark, **line_of(k), lw=1.5, ms=4.5, label=name)
    for k, (name, (low, high)) in enumerate((ranges or {}).items(), len(curves)):
        axes.axhspan(low, high, color=COLOURS[k % len(COLOURS)], alpha=0.22, lw=0, label=name)
    if log:
        axes.set(xscale="log", yscale="log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter(lambda value, _: f"{value:g}")
            axis.set_minor_locator(NullLocator())
    else:
        reached = [value for _, ys in curves.values() for value in ys] + [high for _, high in (ranges or {}).values()]
        axes.set_ylim(0, 1.06 * max(reached, default=1.0))
        if curves and all(len(xs) <= 8 for xs, _ in curves.values()):
            axes.set_xticks(sorted({float(value) for xs, _ in curves.values() for value in xs}))
    axes.set(xlabel=x, ylabel=y)
    if len(curves) + len(ranges or {}) > 1:
        figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    return save()
