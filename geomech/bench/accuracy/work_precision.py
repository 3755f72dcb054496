"""Run time against error of the stress intensity factors: this solver, constant and quadratic elements, finite
elements.

Everything is timed in one run of one process: assembly and solution from scratch (mesh included), the median of three
or more repetitions after a first one, which gives the error. The error is the largest of any tip's K_I or K_II,
relative to the largest K; for growth runs (`growth_paths`), which are timed once, that of the path or the load.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TypeVar

from ...ddm.fracture.target_error import TargetMissed
from ...model import DdmSettings
from ...output.tables.summary import write_json
from ..cost import growth_cost
from ..figures import Measured, machine, stopwatch
from ..peers import constant_elements, finite_elements, free_surface
from . import crack_problems, growth_paths
from .crack_problems import CrackProblem, factors, with_reference
from .precision_table import (
    ASKED,
    CALIBRATED,
    ERROR,
    FEM,
    FITTED,
    LOW,
    METHODS,
    OURS,
    QUADRATIC,
    RATIO,
    Point,
    goals_of,
    own_time,
    table,
)

#: Folder of the picture and the numbers, in the working folder.
FOLDER = Path("outputs/bench_ddm")

#: Smaller errors are round-off (one element contains the exact solution of the Griffith crack).
LEAST = 1e-13

Found = TypeVar("Found")

#: The problem with an expensive body, to which a quick run gives little time.
MANY = "50 random cracks"
#: Approximate time limit of a method's last point, s.
LONGEST = 4.0
#: Orders of this solver, target digits, elements per crack of other methods, refinements of finite elements; those of a
#: quick run for single cracks, bodies, and many cracks.
ORDERS, DIGITS, COUNTS, REFINEMENTS = range(2, 11), range(2, 9), [2**k for k in range(2, 13)], range(6)
QUICK_ORDERS = {"arc": (2, 4, 6), MANY: (2, 3, 4)}
QUICK_DIGITS = {"arc": (2, 4), MANY: (2, 4)}
QUICK_COUNTS = {"Griffith crack": (4, 16, 64, 256), "arc": (4, 16, 64, 256), MANY: (2, 4)}
#: Largest number of unknowns of constant elements: the matrix takes 2 GB, and its solution as much again.
MOST_UNKNOWNS = 16000


def measure(quick: bool = False) -> Measured:
    """The table; writes ``work_precision.png`` and ``work_precision.json`` to `FOLDER`.

    ``quick`` takes few sizes, the same ones on every machine; otherwise constant elements get at least `RATIO` times
    this solver's time to `ERROR`.
    """
    from ...ddm import Body
    from ...render.benchmarks.work_precision import draw

    # Kernels are compiled, or loaded from the cache, before anything is measured.
    first = crack_problems.specimen()
    Body([first.outline], first.cracks, crack_problems.ROCK).solve(first.load)
    points = [point for name in PROBLEMS for point in _curves(name, quick)]
    points += _growth(quick)
    surface = [
        Point(free_surface.PROBLEM, method, size, unknowns, error, timed(again)[1])
        for method, size, unknowns, error, again in free_surface.rows()
    ]
    growth = growth_cost.measure(5 if quick else 40)
    goals = goals_of(points)
    FOLDER.mkdir(parents=True, exist_ok=True)
    written = {
        "machine": machine(), "points": [asdict(p) for p in (*points, *surface)], "growth": growth, "goals": goals,
        "quick": quick,
    }  # fmt: skip
    write_json(FOLDER / "work_precision.json", written)
    if not quick:
        what = "largest error of a stress intensity factor (of growth: of path and load), better to the right"
        draw(points, METHODS, FOLDER / "work_precision.png", labels=(what, "mesh, assembly and solution, ms"))
    own = [(p.name, p) for p in (*points, *surface) if p.method not in METHODS[2:]]
    return Measured.of(
        table([*points, *surface], growth, goals),
        errors={name: p.error for name, p in own} | {"growth: K by increments": growth["difference"]},
        times={name: p.seconds for name, p in own} | {"growth: an increment": growth["incremental_s"]},
    )


def errors() -> dict[str, float]:
    """Errors of a quick `measure` by chosen order and by target digits, without times; without the many cracks, whose
    reference is expensive."""
    out = {}
    for name, (make, _, own_problem) in PROBLEMS.items():
        if name == MANY:
            continue
        given = make()
        problem = with_reference(given, False) if given is not None else None
        for order in QUICK_ORDERS.get(name, (2, 3, 4, 6, 8)):
            own, settings = own_problem(problem, order)
            out[f"{name}, {OURS}: {order}"] = max(own.error(factors(own.solve(settings))), LEAST)
        for digits in QUICK_DIGITS.get(name, (2, 4, 6)):
            own = own_problem(None, digits + 1)[0] if problem is None else problem
            asked = DdmSettings(target_error=10.0**-digits)
            out[f"{name}, {ASKED}: {digits}"] = max(own.error(factors(own.solve(asked))), LEAST)
    return out | {p.name: p.error for p in _growth(True, own=True)}


def timed(work: Callable[[], Found]) -> tuple[Found, float]:
    """Result of ``work``, and the time in seconds of its repetition: the median of three runs, or of as many as fit in
    a twentieth of a second; that of the first one alone if it takes more than a third of a second."""
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
    """The sizes of a quick run, or `LONGEST` s per method, but for constant elements `RATIO` times this solver's time
    to `ERROR` if that is longer."""
    orders, digits = (
        (QUICK_ORDERS.get(name, (2, 3, 4, 6, 8)), QUICK_DIGITS.get(name, (2, 4, 6))) if quick else (ORDERS, DIGITS)
    )
    counts = QUICK_COUNTS.get(name, (4, 8, 16)) if quick else COUNTS
    make, low, own_problem = PROBLEMS[name]
    given = make()
    problem = with_reference(given, quick and name == MANY) if given is not None else None
    own = list(_until(name, OURS, orders, lambda p: own_problem(problem, p)))

    def asked_for(digits: int):
        refined = own_problem(None, digits + 1)[0] if problem is None else problem
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
    if finite_elements.available() and not (quick and name == MANY):
        run = finite_elements.solver(problem)
        exact = crack_problems.arc_of_chords(1) if problem is None else problem
        if name != MANY:
            run(0)
        for refinement in REFINEMENTS[1:2] if quick else REFINEMENTS:
            k, unknowns, seconds = run(refinement)
            yield Point(name, FEM, refinement, unknowns, exact.error(k), seconds)
            if seconds > 2 * LONGEST:
                break


def _growth(quick: bool, own: bool = False) -> list[Point]:
    """Whole growth runs; ``own``: this solver only."""
    methods = {growth_paths.QUADRATIC: QUADRATIC, growth_paths.CONSTANT: CALIBRATED, growth_paths.FINITE: FEM}
    return [
        Point(
            growth_paths.PROBLEM,
            methods.get(kind, OURS),
            increments,
            run.unknowns,
            max(parts),
            run.seconds,
            curve,
            parts,
        )
        for kind, curve, increments, run, parts in growth_paths.rows(quick, own)
    ]


def _constant_elements(
    name: str, problem: CrackProblem | None, low: float, counts: Sequence[int], longest: float | None
) -> list[Point]:
    """Both ways to K from one solution each: with the ``counts`` of elements, or more until the last takes ``longest``
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
        # The time is mostly proportional to n³.
        growth = max(1.1, (1.2 * longest / seconds) ** (1 / 3))
        n = min(2 * n if growth > 2 else math.ceil(n * growth), most)


def _until(name: str, method: str, sizes: Iterable[int], solve: Callable) -> Iterator[Point]:
    """Points for growing sizes until the next one would take longer than `LONGEST` or misses its target."""
    for size in sizes:
        problem, settings = solve(size)
        try:
            solution, seconds = timed(partial(problem.solve, settings))
        except TargetMissed:
            return
        unknowns = solution.body.boundary.n_unknowns + solution.body.faces.n_unknowns
        yield Point(name, method, int(size), unknowns, max(problem.error(factors(solution)), LEAST), seconds)
        if 4 * seconds > LONGEST:
            return


def _one_crack(problem: CrackProblem, order: int):
    return problem, DdmSettings(order=order)


def _arc(_: None, order: int):
    # Elements are straight: with increasing order the polygon must follow the arc more closely.
    return crack_problems.arc_of_tangents(round(8 * 1.6 ** (order - 2))), DdmSettings(order=order, elements_per_crack=1)


def _body(problem: CrackProblem, order: int):
    return problem, DdmSettings(order=order, grading_layers=2 if order < 6 else 3)


def _many(problem: CrackProblem, order: int):
    return problem, DdmSettings(order=order, elements_per_crack=2)


#: Name → the problem (None: a different one for every number of elements), elements on the outline's shortest side per
#: element of a crack, and our own mesh for an order.
PROBLEMS = {
    "Griffith crack": (crack_problems.griffith, 0.0, _one_crack),
    "arc": (lambda: None, 0.0, _arc),
    "edge crack in a strip": (crack_problems.edge_crack, 2.0, _body),
    "two-crack specimen": (crack_problems.specimen, 2.0, _body),
    MANY: (crack_problems.random_cracks, 0.0, _many),
}
