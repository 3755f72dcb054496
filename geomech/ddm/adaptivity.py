"""From the error that is asked for to order, elements and grading.

More elements of one order do not make K more accurate, a higher order does: by a factor of ten to a hundred from one
even order to the next (odd ones are hardly better than the even one below). So a straight crack is one element as long
as nothing is near (`proximity` halves what is), a side of a body two, and the order follows the target. The orders are
those whose median error over the problems of `tests/validation/test_automatic.py` is below half the target.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..model import Cracks, DdmSettings, Material
from .kernels import shape_functions

if TYPE_CHECKING:
    from .body import Body
    from .loads.body_loads import BodyLoad
    from .solution import Solution

#: (relative error of K, order that reaches it).
_ORDERS = ((1e-2, 2), (1e-4, 4), (1e-5, 6), (1e-7, 8))
#: The order for smaller errors.
HIGHEST = 10
#: Elements are graded by this ratio: half as many layers do what those of 0.3 do.
_RATIO = 0.15
_PER_SIDE = 2


def for_target(settings: DdmSettings) -> DdmSettings:
    """``settings`` with the mesh that their ``target_error`` asks for; as they are without one. ValueError when it is
    not between 0 and 1."""
    target = settings.target_error
    if target is None:
        return settings
    _check(target)
    return _of_order(settings, _order_for(target), target)


def _check(target: float) -> None:
    if not 0 < target < 1:
        raise ValueError(f"target_error must lie between 0 and 1, got {target!r}")


def _order_for(target: float) -> int:
    return next((p for error, p in _ORDERS if target >= 0.999 * error), HIGHEST)


def _of_order(settings: DdmSettings, order: int, target: float) -> DdmSettings:
    """The mesh of ``order``, graded for ``target``."""
    return replace(
        settings,
        order=order,
        elements_per_crack=1,
        elements_per_side=_PER_SIDE,
        grading_ratio=_RATIO,
        # Only the ends of supports ask for these: corners, kinks and mouths are graded for the target itself.
        grading_layers=math.ceil(-math.log10(target)),
        grading_error=target,
        target_error=None,
    )


def finer(settings: DdmSettings) -> DdmSettings:
    """The next even order, graded one step deeper; at the highest order the even one below instead, as what differs
    from it is known then as well."""
    up = settings.order < shape_functions.MAX_ORDER
    error = settings.grading_error
    return replace(
        settings,
        order=settings.order + (2 if settings.order % 2 == 0 else 1) * (1 if up else -1),
        grading_layers=settings.grading_layers + 2 if up else settings.grading_layers,
        grading_error=None if error is None else error / 10 if up else min(10 * error, 0.5),
    )


def solve_to(
    loops: Sequence[np.ndarray],
    cracks: Cracks,
    material: Material,
    load: BodyLoad,
    target_error: float = 1e-6,
    nodes: str = "chebyshev",
    **body,
) -> Solution:
    """The body under ``load`` with stress intensity factors to ``target_error``, relative to the largest K.

    Meshes of two orders, and of further ones while their K differ by more than the target. ``tip_errors`` of the
    solution, which is that of the last mesh, is what it differs by from the one before: a bound of the error, ten times
    as large as a rule. Raises `TargetMissed`, with the last solution, when the highest order does not reach the target.
    ``body``: further arguments of `Body`.
    """
    from .body import Body
    from .fracture.chord_error import chord_errors
    from .fracture.sif_error_estimate import factors, floor, largest, negligible, warn

    _check(target_error)
    # What is graded for twice the target is a tenth finer the second time.
    order = _order_for(min(10 * target_error, 0.5))
    settings = _of_order(DdmSettings(nodes=nodes), min(order, HIGHEST - 2), min(2 * target_error, 0.5))
    before = Body(loops, cracks, material, settings, **body).solve(load)
    while settings.order < shape_functions.MAX_ORDER:
        settings = finer(settings)
        solution = before.body.remeshed(settings).solve(load)
        k = factors(solution)
        errors = np.abs(k - factors(before)) + floor(solution.body) * largest(k)
        if errors.max(initial=0.0) <= target_error * largest(k) + negligible(solution):
            solution.tip_errors = errors = errors + chord_errors(solution)
            if errors.max(initial=0.0) > target_error * largest(k) + negligible(solution):
                raise TargetMissed(solution, target_error)
            warn(errors, k)
            return solution
        before = solution
    solution.tip_errors = errors
    raise TargetMissed(solution, target_error)


class TargetMissed(ValueError):
    """Stress intensity factors that no mesh of ours brings to the ``target`` error that was asked for; ``solution`` is
    the best one, with its `tip_errors`, and ``reached`` their largest beside the largest K."""

    def __init__(self, solution: Solution, target: float, where: str = "") -> None:
        from .fracture.chord_error import chord_errors
        from .fracture.sif_error_estimate import factors, largest

        k = factors(solution)
        self.solution, self.target = solution, target
        self.reached = float(solution.tip_errors.max() / max(largest(k), np.finfo(float).tiny))
        at = int(np.argmax(solution.tip_errors.max(axis=1)))
        x, y = solution.body.cracks.nodes[solution.body.cracks.tips[at]]
        chords = chord_errors(solution).max() > 0.25 * solution.tip_errors.max()
        mend = "give the curved wall more sides" if chords else "ask for a larger target_error"
        super().__init__(
            f"{where}stress intensity factors are good to {self.reached:.1e} of the largest, not to the target_error of "
            f"{target:.1e}; the worst are at the tip at ({x:.6g}, {y:.6g}): {mend}"
        )


def met(solution: Solution, target: float, again: Callable[[Body], Solution]) -> Solution:
    """``solution``, or that of a finer mesh, whose K are good to ``target`` by comparison with one that is finer still;
    ``again`` solves for the same load on another body. Raises `TargetMissed` when the finest mesh is not enough."""
    from .fracture.chord_error import chord_errors
    from .fracture.sif_error_estimate import SAFETY, factors, floor, largest, negligible

    while True:
        k = factors(solution)
        if not len(k):
            return solution
        up = solution.body.settings.order < shape_functions.MAX_ORDER
        other = again(solution.body.one_finer)
        better = factors(other)
        by_chords = SAFETY * chord_errors(solution)
        solution.tip_errors = SAFETY * np.abs(better - k) + floor(solution.body) * largest(k) + by_chords
        allowed = target * largest(k) + negligible(solution)
        if solution.tip_errors.max() <= allowed:
            return solution
        if not up or by_chords.max() > allowed:
            raise TargetMissed(solution, target)
        solution = other
