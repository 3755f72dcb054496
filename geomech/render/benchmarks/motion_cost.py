"""Picture of `geomech bench motion`: time per simulated second against the error, one line per size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

_STYLES = (("#1f6f8b", "o"), ("#588157", "s"), ("#c8553d", "^"), ("#8e6c8a", "D"), ("#c9a227", "v"))
#: Smaller errors are drawn at this value.
LEAST = 1e-4


class Cost(Protocol):
    """Cost and error of a simulated second with one time step."""

    dt: float
    off_slab: float
    second: float
    iteration: float
    iterations: float


class Sized(Protocol):
    """The costs for one number of blocks."""

    blocks: int
    costs: Sequence[Cost]
    wall: float

    def errors(self) -> list[float]: ...


def draw(slopes: Sequence[Sized], path: Path) -> Path:
    """Draw cost against error, and cost per iteration.

    Left: time against error, relative to the shortest steps and (dashed) to the rigid slab. Right: time of an iteration
    relative to that of a wall with as many blocks, and iterations per step, against the time step.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator

    figure = Figure(figsize=(11.0, 4.6), dpi=120, layout="constrained")
    of_error, of_step = figure.subplots(1, 2)
    counts = of_step.twinx()
    for sized, (colour, marker) in zip(slopes, _STYLES):
        if not sized.costs:
            continue
        seconds = [cost.second for cost in sized.costs]
        # nan values are not drawn.
        errors = [max(error, LEAST) for error in sized.errors()]
        off_slab = [max(abs(cost.off_slab), LEAST) for cost in sized.costs]
        of_error.plot(errors, seconds, color=colour, marker=marker, lw=1.6, label=f"{sized.blocks} blocks")
        of_error.plot(off_slab, seconds, color=colour, marker=marker, mfc="white", lw=1.0, ls="--")
        for cost, error in zip(sized.costs, off_slab):
            if math.isfinite(error):
                of_error.annotate(
                    f"{1e3 * cost.dt:g} ms", (error, cost.second), xytext=(6, 3), textcoords="offset points",
                    fontsize=7, color=colour,
                )  # fmt: skip
        steps = [1e3 * cost.dt for cost in sized.costs]
        of_step.plot(steps, [c.iteration / sized.wall for c in sized.costs], color=colour, marker=marker, lw=1.6)
        counts.plot(steps, [c.iterations for c in sized.costs], color=colour, marker=marker, ms=3, lw=1.0, ls=":")
    of_error.set(xscale="log", yscale="log", ylabel="s per simulated second")
    of_error.set_xlim(max(2.0, of_error.get_xlim()[1]), LEAST)
    of_error.set_xlabel("error of gravity's work on moving blocks, relative to the shortest steps (dashed: rigid slab)")
    of_error.set_title("better to the right and below", fontsize=10, loc="left")
    if any(sized.costs for sized in slopes):
        of_error.legend(frameon=False, fontsize=9)
    of_step.set_xscale("log", base=2)
    of_step.xaxis.set_major_locator(FixedLocator(sorted({1e3 * c.dt for sized in slopes for c in sized.costs})))
    of_step.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    of_step.set(xlabel="time step, ms", ylabel="time of an iteration over the wall's")
    counts.set_ylabel("open–close iterations per step (dotted)")
    for axes in (of_step, counts):
        axes.set_ylim(0, 1.1 * axes.get_ylim()[1])
    for axes in (of_error, of_step, counts):
        axes.spines["top"].set_visible(False)
    of_error.grid(which="major", color="#e4e4e4", lw=0.7)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path
