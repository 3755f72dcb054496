"""Tells when the energy of a run is no longer accounted for, and when growth without motion has set some free."""

from __future__ import annotations

import logging

from ..dda.energy import GAIN, EnergyBudget

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


class GrowthWatch:
    """Says, once, that growth at one load has set free more than `GAIN` of all energy turned over: it is unstable."""

    def __init__(self) -> None:
        self._told = False

    def check(self, budget: EnergyBudget, time: float) -> None:
        """``budget`` after a load step that ends at ``time``, s."""
        if self._told or not budget.released > GAIN * budget.turnover:
            return
        self._told = True
        log.warning(
            "t = %g s: cracks grow at one load, unstably, and have set free %.3g J/m so far, which statics has no motion "
            "to take up (growth_release in history.csv); dda.dynamic_factor = 1 follows what comes of it",
            time,
            budget.released,
        )
