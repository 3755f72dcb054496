"""Warnings about the energy of a run: unexplained energy, cracks that take no energy from bent blocks, and energy
released by unstable growth in statics."""

from __future__ import annotations

import logging

from ...dda.energy_balance import GAIN, EnergyBudget

log = logging.getLogger(__name__)

#: Fraction of the fracture energy that the blocks may not have supplied: increments and steps leave some per cent.
UNPAID = 0.25


class BudgetWatch:
    """Warns when the unexplained energy of blocks and cracks exceeds `GAIN` times all energy converted, and again
    whenever it has doubled."""

    def __init__(self) -> None:
        self._told = GAIN

    def check(self, share: float, time: float) -> None:
        """``share``: unexplained energy until ``time`` s, relative to all energy converted."""
        if not abs(share) > self._told:
            return
        self._told = 2.0 * abs(share)
        log.warning(
            "t = %g s: %.2g of all converted energy is not accounted for (budget_residual in history.csv): reduce the "
            "time step and, where cracks grow, growth.increment_m",
            time,
            share,
        )


class BendingWatch:
    """Warns, once, when moving blocks have supplied less energy to their cracks than the rock takes as it breaks: a
    block of uniform strain stores no bending energy, so that cracks opened by bending cost it nothing."""

    def __init__(self) -> None:
        self._told, self._before = False, 0.0

    def check(self, toughness: float, spent: float, time: float) -> None:
        """Called after every step: ``toughness``, J/m: fracture energy until ``time`` s; ``spent``, J/m: what the
        blocks supplied for it. Part of the growth in a step is paid for in the next one."""
        before, self._before = self._before, toughness
        if self._told or not before - spent > UNPAID * before:
            return
        self._told = True
        log.warning(
            "t = %g s: of the %.3g J/m of fracture energy, the blocks supplied %.3g (unpaid_toughness in summary.json): "
            "blocks of uniform strain store no bending energy, so that cracks opened by bending take none from the "
            "motion, and K under an impact may be several times too high. Bond the block from smaller ones, which bend "
            "together, or take such cracks as an upper bound",
            time,
            before,
            spent,
        )


class GrowthWatch:
    """Reports, once, that growth at constant load has released more than `GAIN` of all energy converted: it is
    unstable."""

    def __init__(self) -> None:
        self._told = False

    def check(self, budget: EnergyBudget, time: float) -> None:
        """``budget`` after a load step that ends at ``time`` s."""
        if self._told or not budget.released > GAIN * budget.turnover:
            return
        self._told = True
        log.warning(
            "t = %g s: cracks grow unstably at constant load and have released %.3g J/m so far, which a static run does "
            "not convert to motion (growth_release in history.csv); set dda.dynamic_factor = 1 to follow the motion",
            time,
            budget.released,
        )
