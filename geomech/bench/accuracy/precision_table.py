"""Evaluation of run time–error curves: times to an error, goals, and the table of `geomech bench ddm`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..peers import finite_elements, free_surface
from . import growth_paths

#: The methods, in the order of the table and the legend.
OURS, LOW, QUADRATIC = "this solver, p = 2 … 10", "constant elements, √r at the tips", "quadratic elements, equal nodes"
ASKED = "this solver, by the error asked for"
FITTED, CALIBRATED, FEM = (
    "constant elements, K by √r fit",
    "constant elements, K calibrated",
    "finite elements, scikit-fem",
)
METHODS = (OURS, ASKED, LOW, QUADRATIC, FITTED, CALIBRATED, FEM)

#: Goals: K to 1e-6 in this time (s), and the ratio of times of constant elements at 1e-4; the error at which growth
#: runs are compared, for which uncorrected steps need hundreds of increments.
ONE_CRACK_S, SPECIMEN_S, RATIO, ERROR, GROWTH_ERROR = 1e-3, 30e-3, 200.0, 1e-4, 3e-3


@dataclass(frozen=True)
class Point:
    """``size`` is the varied parameter: order, target digits, elements per crack, refinement, or increments of a growth
    run.

    ``curve`` is the fixed parameter if a method has several curves; ``parts``: the errors whose maximum is ``error``.
    """

    problem: str
    method: str
    size: int
    unknowns: int
    error: float
    seconds: float
    curve: str = ""
    parts: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """Unique within a run."""
        return f"{self.problem}, {self.label}: {self.size}"

    @property
    def label(self) -> str:
        """The method, and which of its curves."""
        return f"{self.method.split(', p =')[0]}, {self.curve}" if self.curve else self.method


def curves(points: Sequence[Point], problem: str, method: str) -> list[list[Point]]:
    """Curves of a method, sorted by size."""
    selected = [p for p in points if (p.problem, p.method) == (problem, method)]
    names = dict.fromkeys(p.curve for p in selected)
    return [sorted((p for p in selected if p.curve == name), key=lambda p: p.size) for name in names]


def _error_of(problem: str) -> float:
    """Error at which methods are compared."""
    return GROWTH_ERROR if problem == growth_paths.PROBLEM else ERROR


def time_to(points: Sequence[Point], problem: str, method: str, error: float) -> float | None:
    """Least time at which ``method`` has reached ``error`` for good, interpolated logarithmically; None if it has not
    within its time limit."""
    times = [_down_to(curve, error) for curve in curves(points, problem, method)]
    return min((t for t in times if t is not None), default=None)


def _down_to(curve: list[Point], error: float) -> float | None:
    for k, p in enumerate(curve):
        if all(q.error <= error for q in curve[k:]):
            if k == 0:
                return p.seconds
            before = curve[k - 1]
            share = math.log(before.error / error) / math.log(before.error / p.error)
            return before.seconds * (p.seconds / before.seconds) ** share
    return None


def own_time(points: Sequence[Point], problem: str, error: float) -> float | None:
    """This solver's time to ``error``, by chosen order or by target error."""
    times = [p.seconds for p in points if (p.problem, p.method) == (problem, ASKED) and p.error <= error]
    times += [t for t in [time_to(points, problem, OURS, error)] if t is not None]
    return min(times, default=None)


def extrapolated(points: Sequence[Point], problem: str, method: str, error: float) -> float | None:
    """Time at which ``method`` would reach ``error`` if its error continued to decrease with its unknowns as between
    its last two points, and its time grew no faster than they; None if the error does not decrease."""
    found = curves(points, problem, method)
    if not found or len(found[-1]) < 2:
        return None
    before, last = found[-1][-2:]
    order = math.log(before.error / last.error) / math.log(last.unknowns / before.unknowns)
    # Below a tenth it has stagnated, which no size would change.
    return last.seconds * (last.error / error) ** (1 / order) if order > 0.1 else None


def _asked(points: Sequence[Point], problem: str, digits: int) -> float | None:
    curve = (p for p in points if (p.problem, p.method, p.size) == (problem, ASKED, digits))
    return next((p.seconds for p in curve if p.error <= 10.0**-digits), None)


def goals_of(points: Sequence[Point]) -> dict:
    """Results for the goals, by name."""
    problems = list(dict.fromkeys(p.problem for p in points))
    goals: dict = {f"{name}: s to 1e-6": time_to(points, name, OURS, 1e-6) for name in problems}
    goals |= {f"{name}: s when 1e-6 is asked for": _asked(points, name, 6) for name in problems}
    goals["time at one error over this solver's"] = ratios = []
    for name in problems:
        error = _error_of(name)
        own_seconds = own_time(points, name, error)
        for method in METHODS[2:]:
            curve = [p for p in points if (p.problem, p.method) == (name, method)]
            if not curve or own_seconds is None:
                continue
            other_seconds = time_to(points, name, method, error)
            further = None if other_seconds is not None else extrapolated(points, name, method, error)
            best, longest = min(p.error for p in curve), max(p.seconds for p in curve)
            ratios.append(
                {
                    "problem": name,
                    "method": method,
                    "error": error,
                    "sizes": len({p.size for p in curve}),
                    "ratio": (longest if other_seconds is None else other_seconds) / own_seconds,
                    "reached": other_seconds is not None,
                    "best": best,
                    "extrapolated": None if further is None else further / own_seconds,
                }
            )
    return goals


def table(points: Sequence[Point], growth: dict, goals: dict) -> str:
    """``growth``: the result of `growth_run.measure`."""
    lines = ["Stress intensity factors: error and time of assembly and solution", ""]
    for name in (n for n in dict.fromkeys(p.problem for p in points) if n != free_surface.PROBLEM):
        lines.append(f"{name}")
        for method in METHODS:
            for curve in curves(points, name, method):
                lines += [_row(p, p is curve[0]) for p in curve]
        lines.append("")
    lines.append(free_surface.PROBLEM)
    for p in (p for p in points if p.problem == free_surface.PROBLEM):
        what = f"{p.method} {'1e-' if p.method == free_surface.IN_KERNELS else ''}{p.size}"
        lines.append(f"  {what:<44}{p.unknowns:>8} unknowns   {p.error:8.1e}   {1e3 * p.seconds:10.2f} ms")
    lines.append("")
    if not finite_elements.available():
        lines += ["scikit-fem is not installed: finite elements left out (pip install 'geomech[bench]')", ""]
    g = growth
    lines += [
        (
            f"growth, {g['increments']} increments at two tips of the specimen ({g['elements_at_the_end']} elements at "
            "the end)"
        ),
        f"  an incremental step {1e3 * g['incremental_s']:.1f} ms, all {g['all_incremental_s']:.2f} s",
        f"  fresh bodies {1e3 * g['fresh_s']:.1f} ms ({g['fresh_s'] / g['incremental_s']:.1f} times),"
        + f" all {g['all_fresh_s']:.2f} s ({g['all_fresh_s'] / g['all_incremental_s']:.1f} times);"
        + f" K differs by {g['difference']:.1e}; {g['factorisations']} whole factorisations",
        "",
        "K to 1e-6: "
        + "; ".join(
            f"{label} {_time_text(goals[f'{name}: s to 1e-6'])} with the order chosen,"
            f" {_time_text(goals[f'{name}: s when 1e-6 is asked for'])} when 1e-6 is asked for (goal {1e3 * goal:.0f} ms)"
            for label, name, goal in (
                ("one crack", "Griffith crack", ONE_CRACK_S),
                ("specimen", "two-crack specimen", SPECIMEN_S),
            )
        ),
        "",
        (
            f"time at error {ERROR:.0e} (growth {GROWTH_ERROR:.0e}) relative to this solver's (goal {RATIO:.0f} for constant "
            "elements): measured,"
        ),
        "or for methods that do not reach this error, the longest time measured and the time extrapolated from the last",
        "decrease of their error, if time is proportional to the number of unknowns",
    ]
    for row in goals["time at one error over this solver's"]:
        result = f"{row['ratio']:8.0f}  measured"
        if not row["reached"]:
            result = f"{row['ratio']:8.0f}  with an error of {row['best']:.0e}; "
            further = row["extrapolated"]
            still = "its error does not decrease" if row["sizes"] > 1 else "one size only"
            result += still if further is None else f"{further:.1g} extrapolated"
        lines.append(f"  {row['problem']:<30}{row['method']:<36}{result}")
    return "\n".join(lines)


def _row(p: Point, first: bool) -> str:
    label = p.label if first else ""
    what = {OURS: f"p = {p.size}", ASKED: f"1e-{p.size}"}.get(p.method, f"{p.size}")
    what = f"{p.size}" if p.parts else what
    parts = f"   (path {p.parts[0]:.1e}, load {p.parts[1]:.1e})" if p.parts else ""
    return f"  {label:<36}{what:>8}{p.unknowns:>8} unknowns   {p.error:8.1e}   {1e3 * p.seconds:10.2f} ms{parts}"


def _time_text(seconds: float | None) -> str:
    return "not reached" if seconds is None else f"{1e3 * seconds:.3g} ms"
