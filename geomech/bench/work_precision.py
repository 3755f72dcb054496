"""Run time against error of the stress intensity factors: this solver, constant and quadratic elements, finite
elements.

Everything is timed in one run of one process: assembly and solution from nothing (mesh included), the median of three
repetitions or more after one that is not counted, which the error is of. The error is the largest of any tip's K_I or
K_II, relative to the largest K.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from ..model import DdmSettings
from ..output.summary import write_json
from . import constant_elements, crack_problems, finite_elements, free_surface, growth_run
from .crack_problems import CrackProblem, factors, with_reference
from .figures import Measured, machine, stopwatch

#: Where the picture and the numbers go, below the working folder.
FOLDER = Path("outputs/bench_ddm")

#: The methods, in the order of the table and the legend.
OURS, LOW, QUADRATIC = "this solver, p = 2 … 10", "constant elements, √r at the tips", "quadratic elements, equal nodes"
ASKED = "this solver, by the error asked for"
FITTED, CALIBRATED, FEM = (
    "constant elements, K by √r fit",
    "constant elements, K calibrated",
    "finite elements, scikit-fem",
)
#: Below it an error is round-off (one element holds the whole solution of the Griffith crack).
LEAST = 1e-13

Found = TypeVar("Found")

METHODS = (OURS, ASKED, LOW, QUADRATIC, FITTED, CALIBRATED, FEM)

#: Goals: K to 1e-6 in so many seconds, and how many times less than constant elements at 1e-4.
ONE_CRACK_S, SPECIMEN_S, RATIO, ERROR = 1e-3, 30e-3, 200.0, 1e-4
#: Seconds that a method's last point may take about.
LONGEST = 4.0
#: Orders of this solver, digits asked for, elements of a crack of other methods, refinements of finite elements; those
#: of a quick run for single cracks, bodies, and many cracks.
ORDERS, DIGITS, COUNTS, REFINEMENTS = range(2, 11), range(2, 9), [2**k for k in range(2, 13)], (1, 2, 3, 4)
QUICK_ORDERS = {"arc": (2, 4, 6), "50 random cracks": (2, 3, 4)}
QUICK_DIGITS = {"arc": (2, 4), "50 random cracks": (2, 4)}
QUICK_COUNTS = {"Griffith crack": (4, 16, 64, 256), "arc": (4, 16, 64, 256), "50 random cracks": (2, 4)}
#: Constant elements are not given more unknowns than these: their matrix takes 2 GB, and its solution as much again.
MOST_UNKNOWNS = 16000


@dataclass(frozen=True)
class Point:
    """``size`` is what was varied: the order, the digits asked for, the elements of a crack, or a refinement."""

    problem: str
    method: str
    size: int
    unknowns: int
    error: float
    seconds: float


def measure(quick: bool = False) -> Measured:
    """The table; leaves ``work_precision.png`` and ``work_precision.json`` in `FOLDER`. ``quick`` takes few sizes, the
    same ones on every machine; else constant elements are given `RATIO` times this solver's time to `ERROR` at
    least."""
    from ..ddm import Body
    from ..render.work_precision import draw

    # Kernels are compiled before anything is measured, or read from where they are kept.
    first = crack_problems.specimen()
    Body([first.outline], first.cracks, crack_problems.ROCK).solve(first.load)
    points = [point for name in PROBLEMS for point in _curves(name, quick)]
    surface = [
        Point(free_surface.PROBLEM, method, size, unknowns, error, timed(again)[1])
        for method, size, unknowns, error, again in free_surface.rows()
    ]
    growth = growth_run.measure(5 if quick else 40)
    goals = _goals(points)
    FOLDER.mkdir(parents=True, exist_ok=True)
    written = {
        "machine": machine(), "points": [asdict(p) for p in (*points, *surface)], "growth": growth, "goals": goals,
        "quick": quick,
    }  # fmt: skip
    write_json(FOLDER / "work_precision.json", written)
    if not quick:
        draw(points, METHODS, FOLDER / "work_precision.png")
    own = [(f"{p.problem}, {p.method}: {p.size}", p) for p in (*points, *surface) if p.method not in METHODS[2:]]
    return Measured.of(
        _table([*points, *surface], growth, goals),
        errors={name: p.error for name, p in own} | {"growth: K by increments": growth["difference"]},
        times={name: p.seconds for name, p in own} | {"growth: an increment": growth["incremental_s"]},
    )


def errors() -> dict[str, float]:
    """Those of a quick `measure` by the order chosen and by the digits asked for, without its times; without the many
    cracks, whose reference is dear."""
    out = {}
    for name, (make, _, ours) in PROBLEMS.items():
        if name == "50 random cracks":
            continue
        given = make()
        problem = with_reference(given, False) if given is not None else None
        for order in QUICK_ORDERS.get(name, (2, 3, 4, 6, 8)):
            own, settings = ours(problem, order)
            out[f"{name}, {OURS}: {order}"] = max(own.error(factors(own.solve(settings))), LEAST)
        for digits in QUICK_DIGITS.get(name, (2, 4, 6)):
            own = ours(None, digits + 1)[0] if problem is None else problem
            asked = DdmSettings(target_error=10.0**-digits)
            out[f"{name}, {ASKED}: {digits}"] = max(own.error(factors(own.solve(asked))), LEAST)
    return out


def timed(work: Callable[[], Found]) -> tuple[Found, float]:
    """What ``work`` gives, and the seconds that it takes when it is done again: the median of three times, or of as
    many as a twentieth of a second has room for; that of the first alone where it takes more than a third of a
    second."""
    spent_on = stopwatch()
    found = work()
    first = spent_on()
    if first > 0.3:
        return found, first
    spent: list[float] = []
    while len(spent) < 3 or (sum(spent) < 0.05 and len(spent) < 30):
        spent_on = stopwatch()
        work()
        spent.append(spent_on())
    return found, statistics.median(spent)


def _curves(name: str, quick: bool) -> Iterator[Point]:
    """The sizes of a quick run, or `LONGEST` s a method, but constant elements `RATIO` times this solver's time to
    `ERROR` where that is longer."""
    orders, digits = (
        (QUICK_ORDERS.get(name, (2, 3, 4, 6, 8)), QUICK_DIGITS.get(name, (2, 4, 6))) if quick else (ORDERS, DIGITS)
    )
    counts = QUICK_COUNTS.get(name, (4, 8, 16)) if quick else COUNTS
    make, low, ours = PROBLEMS[name]
    given = make()
    problem = with_reference(given, quick and name == "50 random cracks") if given is not None else None
    own = list(_until(name, OURS, orders, lambda p: ours(problem, p)))

    def asked_for(digits: int):
        refined = ours(None, digits + 1)[0] if problem is None else problem
        return refined, DdmSettings(target_error=10.0**-digits)

    own += _until(name, ASKED, digits, asked_for)
    yield from own

    def with_elements(order: int, nodes: str):
        def solve(n: int):
            refined = crack_problems.arc_of_chords(n) if problem is None else problem
            elements = 1 if problem is None else n
            side = max(2, round(n * low)) if refined.outline is not None else 1
            settings = DdmSettings(order, nodes, elements, side, grading_layers=0)
            return refined, settings

        return solve

    yield from _until(name, LOW, counts, with_elements(0, "chebyshev"))
    yield from _until(name, QUADRATIC, counts, with_elements(2, "equal"))
    given = None if quick else max(LONGEST, RATIO * (own_time(own, name, ERROR) or 0.0))
    yield from _constant_elements(name, problem, low, counts, given)
    run = {"edge crack in a strip": finite_elements.edge_crack, "two-crack specimen": finite_elements.specimen}.get(
        name
    )
    if run and finite_elements.available():
        run(problem, 1)
        for refinement in REFINEMENTS[:1] if quick else REFINEMENTS:
            k, unknowns, seconds = run(problem, refinement)
            yield Point(name, FEM, refinement, unknowns, problem.error(k), seconds)
            if 4 * seconds > LONGEST:
                break


def _constant_elements(
    name: str, problem: CrackProblem | None, low: float, counts: Sequence[int], longest: float | None
) -> list[Point]:
    """Both ways to K from one solution each: with the ``counts`` of elements, or on until the last takes ``longest``
    s."""
    rows: dict[str, list[Point]] = {FITTED: [], CALIBRATED: []}
    n, rest = counts[0], iter(counts[1:])
    while True:
        refined = crack_problems.arc_of_chords(n) if problem is None else problem
        (*found, unknowns), seconds = timed(partial(constant_elements.stress_intensity, refined, n, round(n * low)))
        for method, k in zip((FITTED, CALIBRATED), found):
            rows[method].append(Point(name, method, n, unknowns, refined.error(k), seconds))
        if longest is None:
            n = next(rest, 0)
            if not n:
                return rows[FITTED] + rows[CALIBRATED]
            continue
        most = MOST_UNKNOWNS * n // unknowns
        if seconds >= longest or n >= most:
            return rows[FITTED] + rows[CALIBRATED]
        # Most of it goes with the third power of n.
        growth = max(1.1, (1.2 * longest / seconds) ** (1 / 3))
        n = min(2 * n if growth > 2 else math.ceil(n * growth), most)


def _until(name: str, method: str, sizes: Iterable[int], solve: Callable) -> Iterator[Point]:
    """Points for growing sizes until the next one would take longer than `LONGEST`."""
    for size in sizes:
        problem, settings = solve(size)
        solution, seconds = timed(partial(problem.solve, settings))
        unknowns = solution.body.boundary.n_unknowns + solution.body.faces.n_unknowns
        yield Point(name, method, int(size), unknowns, max(problem.error(factors(solution)), LEAST), seconds)
        if 4 * seconds > LONGEST:
            return


def _one_crack(problem: CrackProblem, order: int):
    return problem, DdmSettings(order=order)


def _arc(_: None, order: int):
    # Elements are straight: an order deserves a polygon that follows the arc as closely.
    return crack_problems.arc_of_tangents(round(8 * 1.6 ** (order - 2))), DdmSettings(order=order, elements_per_crack=1)


def _body(problem: CrackProblem, order: int):
    return problem, DdmSettings(order=order, grading_layers=2 if order < 6 else 3)


def _many(problem: CrackProblem, order: int):
    return problem, DdmSettings(order=order, elements_per_crack=2)


#: Name → the problem (None: another one for every number of elements), elements of the outline's shortest side per
#: element of a crack, and our own mesh for an order.
PROBLEMS = {
    "Griffith crack": (crack_problems.griffith, 0.0, _one_crack),
    "arc": (lambda: None, 0.0, _arc),
    "edge crack in a strip": (crack_problems.edge_crack, 2.0, _body),
    "two-crack specimen": (crack_problems.specimen, 2.0, _body),
    "50 random cracks": (crack_problems.random_cracks, 0.0, _many),
}


def time_to(points: list[Point], problem: str, method: str, error: float) -> float | None:
    """Least time at which ``method`` has come down to ``error`` for good, interpolated in logarithms; None where it has
    not in the time it was given."""
    curve = sorted((p for p in points if (p.problem, p.method) == (problem, method)), key=lambda p: p.size)
    for k, p in enumerate(curve):
        if all(q.error <= error for q in curve[k:]):
            if k == 0:
                return p.seconds
            before = curve[k - 1]
            share = math.log(before.error / error) / math.log(before.error / p.error)
            return before.seconds * (p.seconds / before.seconds) ** share
    return None


def own_time(points: list[Point], problem: str, error: float) -> float | None:
    """This solver's time to ``error``, by the order chosen or the error asked for."""
    times = [p.seconds for p in points if (p.problem, p.method) == (problem, ASKED) and p.error <= error]
    times += [t for t in [time_to(points, problem, OURS, error)] if t is not None]
    return min(times, default=None)


def extrapolated(points: list[Point], problem: str, method: str, error: float) -> float | None:
    """Time at which ``method`` would come down to ``error`` if its error went on falling with its unknowns as between
    its last two points, and its time grew no faster than they; None where the error does not fall."""
    curve = sorted((p for p in points if (p.problem, p.method) == (problem, method)), key=lambda p: p.size)[-2:]
    if len(curve) < 2:
        return None
    before, last = curve
    order = math.log(before.error / last.error) / math.log(last.unknowns / before.unknowns)
    # Below a tenth it has come to a standstill, which no size will end.
    return last.seconds * (last.error / error) ** (1 / order) if order > 0.1 else None


def _asked(points: list[Point], problem: str, digits: int) -> float | None:
    curve = (p for p in points if (p.problem, p.method, p.size) == (problem, ASKED, digits))
    return next((p.seconds for p in curve if p.error <= 10.0**-digits), None)


def _goals(points: list[Point]) -> dict:
    goals: dict = {f"{name}: s to 1e-6": time_to(points, name, OURS, 1e-6) for name in PROBLEMS}
    goals |= {f"{name}: s when 1e-6 is asked for": _asked(points, name, 6) for name in PROBLEMS}
    goals["time at error 1e-4 over this solver's"] = ratios = []
    for name in PROBLEMS:
        ours = own_time(points, name, ERROR)
        for method in METHODS[2:]:
            curve = [p for p in points if (p.problem, p.method) == (name, method)]
            if not curve or ours is None:
                continue
            theirs = time_to(points, name, method, ERROR)
            further = None if theirs is not None else extrapolated(points, name, method, ERROR)
            best, longest = min(p.error for p in curve), max(p.seconds for p in curve)
            ratios.append(
                {
                    "problem": name,
                    "method": method,
                    "ratio": (longest if theirs is None else theirs) / ours,
                    "reached": theirs is not None,
                    "best": best,
                    "extrapolated": None if further is None else further / ours,
                }
            )
    return goals


def _table(points: list[Point], growth: dict, goals: dict) -> str:
    lines = ["Stress intensity factors: error and time of assembly and solution", ""]
    for name in PROBLEMS:
        lines.append(f"{name}")
        for method in METHODS:
            curve = [p for p in points if (p.problem, p.method) == (name, method)]
            for p in curve:
                what = {OURS: f"p = {p.size}", ASKED: f"1e-{p.size}"}.get(method, f"{p.size}")
                label = method if p is curve[0] else ""
                lines.append(
                    f"  {label:<36}{what:>8}{p.unknowns:>8} unknowns   {p.error:8.1e}   {1e3 * p.seconds:10.2f} ms"
                )
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
        f"  an increment with what is known {1e3 * g['incremental_s']:.1f} ms, all {g['all_incremental_s']:.2f} s",
        f"  fresh bodies {1e3 * g['fresh_s']:.1f} ms ({g['fresh_s'] / g['incremental_s']:.1f} times),"
        + f" all {g['all_fresh_s']:.2f} s ({g['all_fresh_s'] / g['all_incremental_s']:.1f} times);"
        + f" K differs by {g['difference']:.1e}; {g['factorisations']} whole factorisations",
        "",
        "K to 1e-6: "
        + "; ".join(
            f"{label} {_said(goals[f'{name}: s to 1e-6'])} with the order chosen,"
            f" {_said(goals[f'{name}: s when 1e-6 is asked for'])} when 1e-6 is asked for (goal {1e3 * goal:.0f} ms)"
            for label, name, goal in (
                ("one crack", "Griffith crack", ONE_CRACK_S),
                ("specimen", "two-crack specimen", SPECIMEN_S),
            )
        ),
        "",
        (
            f"time at error 1e-4 over this solver's (goal {RATIO:.0f} for constant elements): measured, or how much "
            "more time it was"
        ),
        (
            "given without coming down to 1e-4, and then what that would take if its error went on falling as it last "
            "did and its"
        ),
        "time grew no faster than its unknowns (extrapolated)",
    ]
    for row in goals["time at error 1e-4 over this solver's"]:
        said = f"{row['ratio']:8.0f}  measured"
        if not row["reached"]:
            said = f"{row['ratio']:8.0f}  and then still at {row['best']:.0e}; "
            further = row["extrapolated"]
            said += "its error does not fall" if further is None else f"{further:.1g} extrapolated"
        lines.append(f"  {row['problem']:<24}{row['method']:<36}{said}")
    return "\n".join(lines)


def _said(seconds: float | None) -> str:
    return "not reached" if seconds is None else f"{1e3 * seconds:.3g} ms"
