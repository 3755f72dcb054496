"""Energy that overlaps bring in: reported at one fraction of all energy turned over, the end of a run at another.

Contacts that close with a vertex that lies in a block already push it out, with the work ½ k g² of springs that nothing
has pressed. Blocks that do not go into each other bring none; what was drawn with an overlap brings its own in the first
step (`EnergyBudget.drawn`).
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

from ..energy_balance import EnergyBudget
from ..results import NotConverged

log = logging.getLogger(__name__)

#: Fractions of all energy turned over: what is reported, and what makes the run meaningless.
WARNED, ENDED = 0.01, 0.1


class Overlap(NamedTuple):
    """The overlap that brought most ``energy`` (J/m) into a step: of which blocks, how ``deep`` (m), and where (m)."""

    energy: float
    block: int
    other: int
    deep: float
    x: float
    y: float


class OverlapWatch:
    """Logs a warning, once, when overlaps have brought in `WARNED` of all energy turned over, and ends the run at
    `ENDED`. ``names`` of blocks are those of the step."""

    def __init__(self) -> None:
        self._told = False
        self._worst: Overlap | None = None
        self._when = 0.0

    def check(self, budget: EnergyBudget, overlap: Overlap | None, names: Sequence[str], time: float) -> None:
        """Look at the ``budget`` after a step to ``time`` s, whose worst ``overlap`` is None where there was none.

        Raises NotConverged naming the blocks, the place and the time of the largest one.
        """
        if overlap is not None and budget.steps > 1 and (self._worst is None or overlap.energy > self._worst.energy):
            self._worst, self._when = overlap, time
        share, worst = budget.by_overlap, self._worst
        if share <= WARNED or worst is None or (self._told and share <= ENDED):
            return
        a, b = (names[k] if names else f"block {k}" for k in (worst.block, worst.other))
        what = (
            f"blocks that overlap have brought {share:.2g} of all energy turned over into the run, most of it at "
            f"t = {self._when:.6g} s: {a!r} and {b!r} lay {worst.deep:.3g} m in each other near x = {worst.x:.6g}, "
            f"y = {worst.y:.6g} m; shorten dda.time_step_s, or merge slivers (geometry.smallest_block_m2)"
        )
        if share > ENDED:
            raise NotConverged(what)
        self._told = True
        log.warning("t = %g s: %s", time, what)
