"""Tells when the energy of a run is no longer accounted for, when cracks take none from the blocks they break, and when
growth without motion has set some free."""

from __future__ import annotations

import logging

from ...dda.energy_balance import GAIN, EnergyBudget

log = logging.getLogger(__name__)

#: Part of what rock takes as it breaks that its blocks need not have given: increments and steps leave some per cent.
UNPAID = 0.25


class BudgetWatch:
    """Logs a warning when more than `GAIN` of all energy turned over is left over, blocks and cracks together, and
    again
    whenever that has doubled since."""

    def __init__(self) -> None:
        self._told = GAIN

    def check(self, share: float, time: float) -> None:
        """``share`` of what was turned over until ``time``, s, came from nowhere, or went nowhere."""
        if not abs(share) > self._told:
            return
        self._told = 2.0 * abs(share)
        log.warning(
            "t = %g s: %.2g of all energy turned over is not accounted for (budget_residual in history.csv): shorten the "
            "time step, where cracks grow also growth.increment_m",
            time,
            share,
        )


class BendingWatch:
    """Logs a warning, once, when cracks in motion took less from their blocks than rock takes as it breaks: a block has
    one strain and does not store what bends it, so that cracks which bending opens cost it nothing."""

    def __init__(self) -> None:
        self._told, self._before = False, 0.0

    def check(self, toughness: float, spent: float, time: float) -> None:
        """After every step: ``toughness`` is what rock took until ``time``, s, ``spent`` what blocks gave for it, J/m.
        What grows in a step releases some of that in the next."""
        before, self._before = self._before, toughness
        if self._told or not before - spent > UNPAID * before:
            return
        self._told = True
        log.warning(
            "t = %g s: of the %.3g J/m that cracks took as they broke the rock, their blocks gave %.3g: blocks of one "
            "strain do not store bending, so that cracks which it opens take no energy from the motion, and K of a blow "
            "may be several times too high (unpaid_toughness in summary.json): glue the block from smaller ones, which "
            "bend together, or take such cracks for a bound",
            time,
            before,
            spent,
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
