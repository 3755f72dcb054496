"""Run time against error, one panel per problem: pictures of `geomech bench ddm`, `schemes`, `coupling`, `boundary` and
`steps`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

_STYLES = (
    ("#1f6f8b", "o", "-"), ("#58a9c4", "*", ":"), ("#8d6a9f", "v", "-"), ("#588157", "s", "-"),
    ("#b9a394", "x", "--"), ("#c8553d", "^", "-"), ("#b08900", "D", "-"),
)  # fmt: skip


class Measured(Protocol):
    """Cost and error of a method at one size of a problem."""

    problem: str
    method: str
    size: int
    error: float
    seconds: float


def draw(
    points: Sequence[Measured],
    methods: Sequence[str],
    path: Path,
    panels: tuple[int, int] = (2, 3),
    size_of: Callable[[Measured], str] = lambda p: f"p = {p.size}",
    labels: tuple[str, str] = (
        "largest error of a stress intensity factor, better to the right",
        "assembly and solution, ms",
    ),
    goal: float | None = 1e-4,
) -> Path:
    """Draw ``points`` as one curve per method (at most seven, in the legend's order).

    There may be several curves of one colour, whose ends are labelled by the ``curve`` of their points; otherwise the
    ends of the first method are labelled by ``size_of``. All ``panels`` (rows, columns) share logarithmic axes with
    these ``labels``; ``goal`` is an error to mark.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    problems = list(dict.fromkeys(p.problem for p in points))
    rows, columns = panels
    figure = Figure(figsize=(0.4 + 4 * columns, 3.8 * rows), dpi=130, layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    handles = {}
    for panel, problem in zip(axes.flat, problems):
        for method, (colour, marker, line) in zip(methods, _STYLES):
            every = [p for p in points if (p.problem, p.method) == (problem, method)]
            ours = method == methods[0]
            for name in dict.fromkeys(getattr(p, "curve", "") for p in every):
                curve = [p for p in every if getattr(p, "curve", "") == name]
                handles[method] = panel.loglog(
                    [p.error for p in curve], [1e3 * p.seconds for p in curve], color=colour, marker=marker, ls=line,
                    lw=2.2 if ours else 1.2, ms=5.5 if ours else 4, zorder=3 if ours else 2,
                )[0]  # fmt: skip
                if ours:
                    ends = [(curve[-1], name, (8, -3))] if name else _ends(curve, size_of)
                    for p, text, shift in ends:
                        panel.annotate(
                            text, (p.error, 1e3 * p.seconds), textcoords="offset points", xytext=shift,
                            ha="left" if name else "center", fontsize=8, color=colour,
                        )  # fmt: skip
        panel.set_title(problem, fontsize=11, loc="left")
        panel.margins(0.08, 0.12)
        panel.grid(which="major", color="#e4e4e4", lw=0.7)
        panel.set_axisbelow(True)
        panel.tick_params(which="minor", length=0)
        if goal is not None:
            panel.axvline(goal, color="#999999", lw=0.8, ls=":")
        panel.xaxis.set_major_locator(LogLocator(numticks=9))
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
    for panel in axes.flat[len(problems) :]:
        panel.set_axis_off()
    axes.flat[0].invert_xaxis()
    figure.supxlabel(labels[0], fontsize=10)
    figure.supylabel(labels[1], fontsize=10)
    order = [m for m in methods if m in handles]
    drawn = [handles[m] for m in order]
    if len(problems) < axes.size:
        axes.flat[-1].legend(drawn, order, loc="center", frameon=False, fontsize=10)
    else:
        figure.legend(drawn, order, loc="outside upper center", ncols=min(len(order), columns + 1), frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path


def _ends(curve: Sequence[Measured], size_of: Callable[[Measured], str]):
    """Points at both ends, with their labels and offsets in points."""
    return [(curve[0], size_of(curve[0]), (0, -14)), (curve[-1], size_of(curve[-1]), (6, 7))]
