"""Tells when the energy of a run is no longer accounted for."""

from __future__ import annotations

import logging

from ..dda.energy import GAIN

log = logging.getLogger(__name__)


class BudgetWatch:
    """Logs a warning, once, when more than `GAIN` of all energy turned over is left over, blocks and cracks together."""

    def __init__(self) -> None:
        self._told = False

    def check(self, share: float, time: float) -> None:
        """``share`` of what was turned over until ``time``, s, came from nowhere, or went nowhere."""
        if self._told or not abs(share) > GAIN:
            return
        self._told = True
        log.warning(
            "t = %g s: %.2g of all energy turned over is not accounted for (budget_residual in history.csv): shorten the "
            "time step, where cracks grow also growth.increment_m",
            time,
            share,
        )
