"""Figures of a sweep from plain arrays: distribution, convergence, sensitivities, responses, moving region."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from geomech.model import Blocks

INK, SOFT, ACCENT, FAILS, BAND = "#2f3136", "#8aa4a0", "#1f6f8b", "#c8553d", "#cfe0e6"
#: Least and largest number of bars of a histogram.
_LEAST_BARS, _MOST_BARS = 8, 40


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=110, layout="constrained")


def _plain(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8, colors=INK)


def _saved(figure: Figure, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, facecolor="white")
    return path


def draw_distribution(
    values: np.ndarray, shares: np.ndarray, half_width: float, label: str, path: Path, limit: float | None = None
) -> Path:
    """Histogram of sorted ``values`` (n,), and their cumulative distribution (``shares``) with a band of
    ``half_width``.

    Failure is below ``limit``.
    """
    figure = _figure(8.6, 3.5)
    left, right = figure.subplots(1, 2)
    span = float(np.ptp(values)) or 1.0
    quartiles = np.subtract(*np.quantile(values, (0.75, 0.25)))
    width = 2.0 * quartiles / len(values) ** (1 / 3) if quartiles > 0 else span / _LEAST_BARS
    bars = int(np.clip(span / width, _LEAST_BARS, _MOST_BARS)) if width > 0 else _LEAST_BARS
    edges = np.histogram_bin_edges(values, bars)
    if limit is not None and edges[0] < limit < edges[-1]:
        # No bar contains both failed and stable runs.
        edges = edges + (limit - edges[np.argmin(np.abs(edges - limit))])
        step = edges[1] - edges[0]
        edges = np.concatenate([[edges[0] - step], edges, [edges[-1] + step]])
    counts, _ = np.histogram(values, edges)
    colours = [FAILS if limit is not None and right_end <= limit + 1e-12 else SOFT for right_end in edges[1:]]
    left.bar(edges[:-1], counts, np.diff(edges), align="edge", color=colours, edgecolor="white", lw=0.5)
    left.set(xlabel=label, ylabel="runs")
    right.fill_between(
        values, np.clip(shares - half_width, 0, 1), np.clip(shares + half_width, 0, 1), color=BAND, lw=0, step="mid"
    )
    right.step(values, shares, where="mid", color=ACCENT, lw=1.5)
    right.set(xlabel=label, ylabel="share of runs below", ylim=(0, 1))
    for axes in (left, right):
        _plain(axes)
        if limit is not None:
            axes.axvline(limit, color=FAILS, lw=1, ls="--")
    return _saved(figure, path)


def draw_convergence(table: np.ndarray, path: Path) -> Path:
    """Probability of failure after each run with its interval; ``table`` (n, 4): runs, value, low, high."""
    figure = _figure(8.6, 3.0)
    axes = figure.subplots()
    axes.fill_between(table[:, 0], 100 * table[:, 2], 100 * table[:, 3], color=BAND, lw=0, label="95 % (Wilson)")
    axes.plot(table[:, 0], 100 * table[:, 1], color=ACCENT, lw=1.5, label="probability of failure")
    last = table[-1]
    top = 100 * min(1.0, max(last[3] * 2.0, last[1] * 2.5, 1e-4))
    axes.set(xlabel="runs", ylabel="%", ylim=(0, top), xlim=(1, max(2, last[0])))
    axes.legend(frameon=False, fontsize=8)
    _plain(axes)
    return _saved(figure, path)


def draw_tornado(swings: Sequence[Any], centre: float, label: str, path: Path) -> Path:
    """One bar for each of ``swings`` (name, low, high and their errors), from its mean at low to that at high values of
    the variable, around ``centre``."""
    figure = _figure(8.6, 0.9 + 0.42 * len(swings))
    axes = figure.subplots()
    for k, each in enumerate(swings):
        for value, error, colour in ((each.low, each.low_error, SOFT), (each.high, each.high_error, ACCENT)):
            axes.barh(k, value - centre, 0.6, left=centre, color=colour)
            if math.isfinite(error):
                axes.plot([value - 1.96 * error, value + 1.96 * error], [k, k], color=INK, lw=1.2)
    axes.axvline(centre, color=INK, lw=0.8)
    axes.set_yticks(range(len(swings)), [each.name for each in swings], fontsize=8)
    axes.set_ylim(len(swings) - 0.5, -0.5)
    axes.set_xlabel(f"mean {label} where the variable is among its lowest (grey) and highest (blue) fifth")
    _plain(axes)
    axes.tick_params(axis="y", length=0)
    return _saved(figure, path)


def draw_sensitivities(found: Sequence[Any], path: Path) -> Path:
    """First and total Sobol' indices of the variables, with their intervals."""
    figure = _figure(8.6, 0.9 + 0.5 * len(found))
    axes = figure.subplots()
    totals = any(math.isfinite(each.total) for each in found)
    for k, each in enumerate(found):
        thick = 0.36 if totals else 0.6
        axes.barh(k - (0.2 if totals else 0), each.first, thick, color=ACCENT, label="alone" if k == 0 else None)
        axes.plot(
            [each.first - each.first_error, each.first + each.first_error],
            [k - (0.2 if totals else 0)] * 2,
            color=INK,
            lw=1.2,
        )
        if math.isfinite(each.total):
            axes.barh(k + 0.2, each.total, thick, color=SOFT, label="with all others" if k == 0 else None)
            axes.plot([each.total - each.total_error, each.total + each.total_error], [k + 0.2] * 2, color=INK, lw=1.2)
    axes.set_yticks(range(len(found)), [each.name for each in found], fontsize=8)
    axes.set_ylim(len(found) - 0.5, -0.5)
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    axes.axvline(0, color=INK, lw=0.8)
    axes.set_xlabel("part of the variance due to the variable")
    if totals:
        axes.legend(frameon=False, fontsize=8, loc="lower right")
    _plain(axes)
    axes.tick_params(axis="y", length=0)
    return _saved(figure, path)


def draw_responses(
    columns: Mapping[str, np.ndarray],
    values: np.ndarray,
    fails: np.ndarray,
    label: str,
    path: Path,
    limit: float | None,
) -> Path:
    """``values`` (n,) against each of the variables ``columns`` (n,), failed runs in another colour, with means of
    tenths of the runs."""
    across = min(3, len(columns))
    down = math.ceil(len(columns) / across)
    figure = _figure(8.6, 2.6 * down)
    grid = figure.subplots(down, across, squeeze=False, sharey=True)
    for axes in grid.flat[len(columns) :]:
        axes.set_visible(False)
    for axes, (name, at) in zip(grid.flat, columns.items(), strict=False):
        small = 9 if len(at) < 1000 else 3
        axes.scatter(at[~fails], values[~fails], s=small, color=SOFT, lw=0, alpha=0.7)
        axes.scatter(at[fails], values[fails], s=small, color=FAILS, lw=0, alpha=0.8)
        order = np.argsort(at, kind="stable")
        distinct = np.unique(at)
        groups = (
            [np.flatnonzero(at == one) for one in distinct]
            if len(distinct) <= 12
            else np.array_split(order, min(10, max(1, len(at) // 5)))
        )
        axes.plot(
            [at[g].mean() for g in groups], [values[g].mean() for g in groups], color=INK, lw=1.4, marker="o", ms=3
        )
        if limit is not None:
            axes.axhline(limit, color=FAILS, lw=1, ls="--")
        axes.set_xlabel(name, fontsize=8)
        _plain(axes)
    for row in grid:
        row[0].set_ylabel(label, fontsize=8)
    return _saved(figure, path)


def draw_map(
    shares: np.ndarray, box: Sequence[float], outlines: Sequence[np.ndarray], fixed: Sequence[bool], path: Path
) -> Path:
    """How often each place moves: ``shares`` (ny, nx) over the ``box`` (x0, y0, x1, y1).

    ``outlines`` are the blocks of one drawing; ``fixed`` ones are grey.
    """
    from matplotlib.collections import PolyCollection

    ratio = (box[3] - box[1]) / (box[2] - box[0])
    figure = _figure(8.6, min(7.5, max(2.6, 7.4 * ratio + 0.8)))
    axes = figure.subplots()
    shown = np.ma.masked_where(shares <= 0, 100 * shares)
    top = float(shares.max()) * 100 or 1.0
    image = axes.imshow(
        shown,
        extent=(box[0], box[2], box[1], box[3]),
        origin="lower",
        cmap="YlOrRd",
        vmin=0,
        vmax=top,
        interpolation="nearest",
    )
    still = [outline for outline, is_fixed in zip(outlines, fixed, strict=True) if is_fixed]
    free = [outline for outline, is_fixed in zip(outlines, fixed, strict=True) if not is_fixed]
    axes.add_collection(PolyCollection(still, facecolors="#d5d2ca", edgecolors="none"))
    axes.add_collection(PolyCollection(free, facecolors="none", edgecolors=INK, linewidths=0.4, alpha=0.6))
    width, height = box[2] - box[0], box[3] - box[1]
    axes.set(
        xlim=(box[0] - 0.08 * width, box[2] + 0.04 * width),
        ylim=(box[1] - 0.08 * height, box[3] + 0.04 * height),
        aspect="equal",
    )
    axes.set_xlabel("m", fontsize=8)
    figure.colorbar(image, ax=axes, shrink=0.8, label="% of runs in which the place moves")
    _plain(axes)
    return _saved(figure, path)


def draw_moved(blocks: Blocks, vertices: np.ndarray, title: str, path: Path) -> Path:
    """Blocks at their final ``vertices``, coloured by displacement, m."""
    from matplotlib.collections import PolyCollection

    moved = blocks.displacements(vertices)
    far = np.hypot(moved[:, 0], moved[:, 1])
    own = [vertices[blocks.vertex_start[b] : blocks.vertex_start[b + 1]] for b in range(blocks.n_blocks)]
    fixed = np.asarray(blocks.fixed, bool)
    figure = _figure(8.6, 5.2)
    axes = figure.subplots()
    axes.add_collection(
        PolyCollection(
            [o for o, f in zip(own, fixed, strict=True) if f], facecolors="#d5d2ca", edgecolors=INK, linewidths=0.4
        )
    )
    free = PolyCollection(
        [o for o, f in zip(own, fixed, strict=True) if not f], cmap="YlOrRd", edgecolors=INK, linewidths=0.4
    )
    free.set_array(far[~fixed])
    free.set_clim(0, float(far[~fixed].max(initial=0)) or 1.0)
    axes.add_collection(free)
    axes.autoscale_view()
    axes.set(aspect="equal")
    axes.set_xlabel("m", fontsize=8)
    axes.set_title(title, fontsize=10, loc="left")
    figure.colorbar(free, ax=axes, shrink=0.8, label="displacement, m")
    _plain(axes)
    return _saved(figure, path)
