"""Stress intensity factors to a target error: finer meshes, until two solutions agree to the target."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..kernels import shape_functions
from .chord_error import chord_errors
from .sif_error_estimate import SAFETY, floor
from .tip_factors import factors, largest, negligible

if TYPE_CHECKING:
    from ..interfaces import CrackedBody, SolvedBody


class TargetMissed(ValueError):
    """The ``target`` error cannot be reached by any mesh; ``solution`` is the best one, with its `tip_errors`, and
    ``reached`` the largest of these, relative to the largest K."""

    def __init__(self, solution: SolvedBody, target: float, where: str = "") -> None:

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


def met(solution: SolvedBody, target: float, again: Callable[[CrackedBody], SolvedBody]) -> SolvedBody:
    """``solution``, or one on a finer mesh, whose K is accurate to ``target`` by comparison with a still finer one.
    ``again`` solves for the same load on another body. Raises `TargetMissed` when the finest mesh does not suffice."""

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
