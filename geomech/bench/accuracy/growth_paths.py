"""Run time against error of a whole growth run: two offset edge cracks that hook around each other.

A plate of 60 × 120 mm in tension; its edge cracks, 15 mm long and 10 mm apart, grow by 20 mm each, in 10, 20, 40 or 80
increments, by maximum tangential stress (Erdogan & Sih 1963), at the load that just drives them. This solver corrects
its steps (`GrowthSettings.correct`); the others step along the tangent, as such codes do: constant elements with
calibrated K, quadratic elements with equidistant nodes, and finite elements remeshed for every increment. The reference
is this solver without correction, extrapolated to zero increment. The error is the larger of two: the distance of a tip
from its reference position at the same length, relative to the growth; and the relative error of the load there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ...ddm.fracture.criteria import maximum_tangential_stress
from ...model import DdmSettings, GrowthSettings, Material
from ..figures import stopwatch
from ..peers import constant_elements
from .crack_problems import ROCK, CrackProblem, rectangle

PROBLEM = "growth in 5 to 40 increments"
#: m; half the distance between the cracks' lines, their length, their growth.
OFFSET, LENGTH, GROWN = 5e-3, 15e-3, 20e-3
TOUGH = Material("rock", ROCK.youngs_modulus, ROCK.poissons_ratio, k_ic=1e6)
#: Constant elements per increment, and ratio of those to the outline's.
OF_AN_INCREMENT, ON_OUTLINE = 2, 2
#: Sides of triangles: away from cracks (m), at tips (in increments), and their growth rate.
AWAY, AT_TIPS, SLOPE = 4e-3, 0.1, 0.35
#: Methods, the orders of this solver, and the increments of each; those of a quick run.
OWN, QUADRATIC, CONSTANT, FINITE = "own", "quadratic", "constant", "finite"
ORDERS = (2, 4, 6)
INCREMENTS = {OWN: (5, 10, 20, 40), QUADRATIC: (5, 10, 20, 40), CONSTANT: (10, 20, 40), FINITE: (5, 10, 20, 40)}
QUICK_ORDERS, QUICK_INCREMENTS = (4,), {OWN: (5, 10), QUADRATIC: (10,), CONSTANT: (10,), FINITE: (5,)}


@dataclass(frozen=True, eq=False)
class Run:
    """``tips`` (n+1, 2, 2) positions of both tips before every increment and at the end, ``load`` (n+1,) there, Pa; the
    number of unknowns of the last step."""

    tips: np.ndarray
    load: np.ndarray
    unknowns: int
    seconds: float

    def errors(self, reference: Run) -> tuple[float, float]:
        """Errors of the path and of the load, relative to another run at equal lengths."""
        ends = [len(run.load) - 1 for run in (self, reference)]
        own, its = (slice(None, None, n // math.gcd(*ends)) for n in ends)
        away = np.hypot(*np.moveaxis(self.tips[own] - reference.tips[its], -1, 0))
        return float(away.max() / GROWN), float(np.abs(self.load[own] / reference.load[its] - 1).max())


def rows(quick: bool, own: bool = False) -> Iterator[tuple[str, str, int, Run, tuple[float, float]]]:
    """Method, its fixed parameter, increments, the run, and its errors of path and load; ``own``: this solver only."""
    from ..peers.finite_elements import available

    exact = reference(20) if quick else reference()
    counts = QUICK_INCREMENTS if quick else INCREMENTS
    for order in QUICK_ORDERS if quick else ORDERS:
        for n in counts[OWN]:
            run = of_this_solver(n, DdmSettings(order=order))
            yield OWN, f"p = {order}", n, run, run.errors(exact)
    others = {QUADRATIC: of_quadratic_elements, CONSTANT: of_constant_elements, FINITE: of_finite_elements}
    for method, measured in others.items():
        if own or (method == FINITE and not available()):
            continue
        for n in counts[method]:
            run = measured(n)
            yield method, "", n, run, run.errors(exact)


def problem() -> CrackProblem:
    """Two offset cracks that grow towards each other from the sides of a plate in tension."""
    (left, _), (right, _) = rectangle(0.03, 0.06)[:2]
    lines = [
        np.array([[left, -OFFSET], [left + LENGTH, -OFFSET]]),
        np.array([[right, OFFSET], [right - LENGTH, OFFSET]]),
    ]
    return CrackProblem(PROBLEM, lines, (0.0, 1e6, 0.0), rectangle(0.03, 0.06), [(True, False)] * 2)


def of_this_solver(increments: int, settings: DdmSettings, correct: bool = True) -> Run:
    """By `ddm.propagate`."""
    from ... import ddm

    given = problem()
    spent_on = stopwatch()
    length = GROWN / increments
    growth = GrowthSettings(increment=length, min_increment=0.1 * length, correct=correct)
    steps = list(
        ddm.propagate(
            [given.outline], given.cracks, TOUGH, given.load, growth, settings=settings, control="toughness",
            max_steps=increments + 1,
        )
    )  # fmt: skip
    seconds = spent_on()
    body = steps[-1].solution.body
    return Run(
        np.array([step.tips["point"] for step in steps]),
        np.array([step.load_factor * given.stress[1] for step in steps]),
        body.boundary.n_unknowns + body.faces.n_unknowns,
        seconds,
    )


@cache
def reference(increments: int = 80, order: int = 4) -> Run:
    """Uncorrected steps, a first-order method: from ``increments``, half and a quarter as many, extrapolated twice."""
    runs = [of_this_solver(increments // k, DdmSettings(order=order), correct=False) for k in (4, 2, 1)]
    found = []
    for name in ("tips", "load"):
        coarse = getattr(runs[0], name)
        medium, fine = getattr(runs[1], name)[::2], getattr(runs[2], name)[::4]
        once, again = 2 * medium - coarse, 2 * fine - medium
        found.append((4 * again - once) / 3)
    return Run(*found, runs[-1].unknowns, sum(run.seconds for run in runs))


def of_quadratic_elements(increments: int) -> Run:
    """With elements as long as increments."""
    n = round(increments * LENGTH / GROWN)
    sides = round(0.06 / (GROWN / increments))
    return of_this_solver(increments, DdmSettings(2, "equal", n, sides, grading_layers=0), correct=False)


def of_constant_elements(increments: int) -> Run:
    """With equal elements, all assembled again for every increment."""
    size = GROWN / increments / OF_AN_INCREMENT

    def factors(now: CrackProblem) -> tuple[np.ndarray, int]:
        length = np.hypot(*np.diff(now.polylines[0], axis=0).T).sum()
        _, k, n = constant_elements.stress_intensity(now, round(length / size), round(0.06 / (ON_OUTLINE * size)))
        return k, n

    return _along_tangents(increments, factors)


def of_finite_elements(increments: int) -> Run:
    """Remeshed for every increment."""
    from ..peers.finite_elements import disc_radii, tips_of
    from ..peers.quarter_point import Plate, Sizes

    sizes = Sizes(AWAY, AT_TIPS * GROWN / increments, SLOPE)

    def factors(now: CrackProblem) -> tuple[np.ndarray, int]:
        points, ways, length = tips_of(now.polylines, now.mouths)
        plate = Plate(now.outline, now.cracks, sizes)
        radii = disc_radii(points, length, now.outline, now.polylines)
        return plate.factors(plate.pulled(now.stress[1]), points, ways, radii), plate.n_unknowns

    return _along_tangents(increments, factors)


def _along_tangents(increments: int, factors: Callable[[CrackProblem], tuple[np.ndarray, int]]) -> Run:
    """Both tips advance by an increment at the criterion's angle; ``factors``: problem → K of its two tips,
    unknowns."""
    now = problem()
    spent_on = stopwatch()
    tips, load = [], []
    for step in range(increments + 1):
        k, unknowns = factors(now)
        angle, k_eq = maximum_tangential_stress(*k.T)
        tips.append([line[-1] for line in now.polylines])
        load.append(now.stress[1] * TOUGH.k_ic / k_eq.max())
        grown = []
        for line, turn in zip(now.polylines, angle):
            heading = math.atan2(*(line[-1] - line[-2])[::-1]) + turn
            ahead = line[-1] + GROWN / increments * np.array([math.cos(heading), math.sin(heading)])
            grown.append(np.vstack([line, ahead]))
        if step < increments:
            now = replace(now, polylines=grown)
    return Run(np.array(tips), np.array(load), unknowns, spent_on())
