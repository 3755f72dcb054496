"""Energy created by overlaps: a warning at one fraction of the energy converted, the end of the run at another.

A contact that closes with its vertex already inside a block pushes it out, with the work ½ k g² of a spring that
nothing has compressed. Blocks that do not overlap create none; overlaps in the drawing create theirs in the first step
(`EnergyBudget.drawn`).
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

from ..energy_balance import EnergyBudget
from ..kinematics.tolerances import NOTABLE
from ..results import NotConverged

log = logging.getLogger(__name__)

#: Fractions of the energy converted: for the warning, and for the end of the run.
WARNED, ENDED = NOTABLE, 10 * NOTABLE


class Overlap(NamedTuple):
    """The overlap that created most ``energy`` (J/m) in a step: its blocks, its depth ``deep`` (m), and its location
    (m)."""

    energy: float
    block: int
    other: int
    deep: float
    x: float
    y: float


class OverlapWatch:
    """Logs one warning when overlaps have created `WARNED` of the energy converted, and ends the run at `ENDED`.

    ``names`` are those of the blocks of the step.
    """

    def __init__(self) -> None:
        self._warned = False
        self._worst: Overlap | None = None
        self._when = 0.0

    def check(self, budget: EnergyBudget, overlap: Overlap | None, names: Sequence[str], time: float) -> None:
        """Check the ``budget`` after a step to ``time`` s; ``overlap`` is the largest of the step, None without one.

        Raises NotConverged naming blocks, place and time of the largest one.
        """
        if overlap is not None and budget.steps > 1 and (self._worst is None or overlap.energy > self._worst.energy):
            self._worst, self._when = overlap, time
        share, worst = budget.by_overlap, self._worst
        if share <= WARNED or worst is None or (self._warned and share <= ENDED):
            return
        a, b = names[worst.block], names[worst.other]
        what = (
            f"overlapping blocks have created {share:.2g} of all converted energy in the run, most of it at "
            f"t = {self._when:.6g} s: {a!r} and {b!r} overlapped by {worst.deep:.3g} m near x = {worst.x:.6g}, "
            f"y = {worst.y:.6g} m; shorten dda.time_step_s, or merge slivers (geometry.smallest_block_m2)"
        )
        if share > ENDED:
            raise NotConverged(what)
        self._warned = True
        log.warning("t = %g s: %s", time, what)
