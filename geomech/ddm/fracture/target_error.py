"""Stress intensity factors to a target error: meshes are refined until two solutions agree."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..adaptivity import coarser
from ..iterative.gmres import NotSolved
from ..kernels import shape_functions
from .chord_error import chord_errors
from .sif_error_estimate import SAFETY, floor
from .tip_factors import factors, largest, negligible

if TYPE_CHECKING:
    from ..interfaces import CrackedBody, SolvedBody

_Solved = TypeVar("_Solved", bound="SolvedBody")


class TargetMissed(ValueError):
    """No mesh reaches the ``target`` error. ``solution``: the best one, with its `tip_errors`; ``reached``: the largest
    of these, relative to the largest K."""

    def __init__(self, solution: SolvedBody, target: float, where: str = "") -> None:
        k = factors(solution)
        self.solution, self.target = solution, target
        self.reached = float(solution.tip_errors.max() / max(largest(k), np.finfo(float).tiny))
        at = int(np.argmax(solution.tip_errors.max(axis=1)))
        x, y = solution.body.cracks.nodes[solution.body.cracks.tips[at]]
        chords = chord_errors(solution).max() > 0.25 * solution.tip_errors.max()
        mend = "give the curved wall more sides" if chords else "set a larger target_error"
        super().__init__(
            f"{where}stress intensity factors are accurate to {self.reached:.1e} of the largest, not to the target_error "
            f"of {target:.1e}; the largest error is at the tip at ({x:.6g}, {y:.6g}): {mend}"
        )


def refined_to_target(solution: _Solved, target: float, again: Callable[[CrackedBody], _Solved]) -> _Solved:
    """``solution``, or one on a finer mesh, whose K agrees to ``target`` with that of the next finer mesh, or of the
    next coarser one where that cannot be solved. ``again`` solves for the same load on another body. Raises
    `TargetMissed` if the finest mesh that can be solved does not suffice."""

    while True:
        k = factors(solution)
        if not len(k):
            return solution
        up = solution.body.settings.order < shape_functions.MAX_ORDER
        try:
            other = again(solution.body.refined)
        except NotSolved:
            # Too many unknowns to factor, and round-off beyond what the iteration needs.
            up, other = False, again(solution.body.remeshed(coarser(solution.body.settings)))
        better = factors(other)
        by_chords = SAFETY * chord_errors(solution)
        solution.tip_errors = SAFETY * np.abs(better - k) + floor(solution.body) * largest(k) + by_chords
        allowed = target * largest(k) + negligible(solution)
        if solution.tip_errors.max() <= allowed:
            return solution
        if not up or by_chords.max() > allowed:
            raise TargetMissed(solution, target)
        solution = other
