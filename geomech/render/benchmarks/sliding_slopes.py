"""Picture of `geomech bench sliding`: work of gravity on moving blocks against the time step, one line per slope."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from .slope_outcomes import COLOURS


class Sliding(Protocol):
    """Results of a slope with a known slide, by time step."""

    seed: int
    verdict: str
    steps: Sequence[float]
    work: Sequence[float]
    moved: Sequence[float]
    slab_work: float


def draw(slopes: Sequence[Sliding], bound: float, path: Path) -> Path:
    """``slopes`` with works relative to that in the shortest steps, and to the rigid slab's if there is one.

    The band is ``bound`` wide to each side.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 4.8), dpi=120, layout="constrained")
    of_steps, of_slab = figure.subplots(1, 2)
    for axes, title, scale in (
        (of_steps, "relative to the shortest steps", lambda slope: slope.work[-1]),
        (of_slab, "relative to the rigid slab above the lowest daylighting bed", lambda slope: slope.slab_work),
    ):
        for slope in slopes:
            unit = scale(slope)
            if not (math.isfinite(unit) and unit > 0):
                continue
            values = [work / unit for work in slope.work]
            axes.plot(
                [1e3 * dt for dt in slope.steps], values, marker="o", ms=3.5, lw=1.2, color=COLOURS[slope.verdict],
                mec="#555555", mew=0.3, zorder=3 if slope.verdict == "wrong" else 2,
            )  # fmt: skip
            at = next((k for k, value in enumerate(values) if math.isfinite(value)), None)
            if at is not None:
                axes.annotate(
                    str(slope.seed), (1e3 * slope.steps[at], values[at]), xytext=(4, 0), textcoords="offset points",
                    fontsize=6.5, va="center", color="#333333",
                )  # fmt: skip
        axes.axhspan(1 - bound, 1 + bound, color="#dfe7ea", zorder=0)
        axes.axhline(1.0, color="#777777", lw=0.8)
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlabel("time step, ms")
        axes.set_title(title, fontsize=10, loc="left")
        axes.spines[["top", "right"]].set_visible(False)
    of_steps.set_ylabel("work of gravity on moving blocks")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path
