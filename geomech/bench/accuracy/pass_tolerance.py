"""Tolerance of the coupling passes: time and error of a wall with cracked bricks.

A static step is repeated until the strain of every brick's cracks agrees, within a tolerance, with the one used in the
block step. A loose tolerance needs a single pass, as in staggered schemes; the error is that of the stress intensity
factors, relative to a tolerance of 1e-10. (In dynamics cracks follow their block's mean stress, and open ones need one
pass.)
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from ..figures import Point, stopwatch

PROBLEM = "wall with cracked bricks, by tolerance of the passes"
METHOD, ONE_PASS = "passes until strains agree", "one pass a step (staggered)"
METHODS = (METHOD, ONE_PASS)
#: Relative strain; the first needs a single pass.
TOLERANCES, EXACT = (1e3, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6), 1e-10
#: Number of bricks, of cracked ones, and of load steps.
WALL, STEPS = (40, 8), 3


@dataclass(frozen=True)
class Passes(Point):
    """``size`` is the tolerance, ``passes`` the total of all steps."""

    passes: int


def errors() -> dict[str, float]:
    """Errors of K by tolerance, by name."""
    return by_name(points())


def by_name(found: list[Passes]) -> dict[str, float]:
    """Errors of K by the name of the tolerance."""
    return {f"K by a tolerance of {p.size:g}": p.error for p in found}


def points() -> list[Passes]:
    """Errors and costs of runs, one per tolerance."""
    # The first run may compile, and is the reference for the others.
    exact, _, _ = _run(EXACT)
    out = []
    for tolerance in TOLERANCES:
        found, passes, seconds = _run(tolerance)
        error = float(np.abs(found - exact).max() / np.abs(exact).max())
        method = ONE_PASS if passes == STEPS else METHOD
        out.append(Passes(PROBLEM, method, tolerance, max(error, 1e-16), seconds, passes))
    return out


def _run(tolerance: float) -> tuple[np.ndarray, int, float]:
    """K of all tips at the end, number of passes, and seconds of the steps, with bodies made before."""
    from ...coupling import cycles
    from ..cost.block_scenes import cracked_wall

    passes, cycle = 0, None
    with _until(tolerance):
        problem = cracked_wall(*WALL)
        steps = cycles(replace(problem, dda=replace(problem.dda, dynamic_factor=0.0)))
        next(steps)
        spent_on = stopwatch()
        for cycle in steps:
            passes += int(cycle.statistics["compliance_passes"])
            if cycle.load_step == STEPS:
                break
        seconds = spent_on()
    return np.concatenate([cycle.tips["k_i"], cycle.tips["k_ii"]]), passes, seconds


@contextmanager
def _until(tolerance: float) -> Iterator[None]:
    from ...coupling import load_pass

    before = load_pass.COMPLIANCE_TOLERANCE, load_pass.FAILED
    # With a loose tolerance the coupling itself would report that it has not converged.
    load_pass.COMPLIANCE_TOLERANCE, load_pass.FAILED = tolerance, max(before[1], tolerance)
    try:
        yield
    finally:
        load_pass.COMPLIANCE_TOLERANCE, load_pass.FAILED = before
