"""Warnings about the energy of a run: unexplained energy, vibrations that the time step does not resolve, cracks that
take no energy from bent blocks, cracks whose growth in motion begins within a step, and energy released by unstable
growth in statics."""

from __future__ import annotations

import logging

from ...dda.energy_balance import GAIN, EnergyBudget
from ...model.loads.wave_limits import SECOND_ORDER

log = logging.getLogger(__name__)

#: Fraction of the fracture energy that the blocks may not have supplied: increments and steps leave some per cent.
UNPAID = 0.25
#: Fraction of the energy converted that the time integration may take from blocks that still move: the work of the
#: weight is then in error by up to as much, in proportion to the time step …
DISSIPATED = 0.05
#: … and their kinetic energy as a fraction of it. Blocks that have come to rest have rightly lost their energy.
IN_MOTION = 0.01
#: Fraction of it that bonds of moving blocks may have done, or not, in the steps in which they broke: the result is uncertain
#: by at least as much.
BREAKS = 0.01
#: Excess of K_eq over K_Ic, relative to K_Ic, with which cracks may begin to grow at the end of a load step. (Random slope 26
#: begins with 0.66, 0.24 and 0.04 if its weight comes in three, six and twelve steps, and breaks into other blocks.)
OVERSHOT = 0.1
#: Step in which cracks begin to grow in motion, over the time from its start to the end of the run: motion that begins a step
#: sooner or later differs by about this share. (Random slope 73, weight at once, breaks into other blocks: its work of
#: gravity is 21 and 19 % off in steps of 0.14 and 0.07, 3 % in one of 0.03.)
ONSET = 0.05
#: Fraction of it that static steps may take. Half of the work of a suddenly applied load is dissipated, and nothing of that
#: of a load that grows with the steps; a larger fraction means that unsupported blocks have moved.
UNHELD = 0.6
#: Why cracks take no energy from blocks that bend; and what to do then, and about blocks that do not bend.
_UNRESOLVED = (
    "the time step is longer than the impact or the growth, so that their cracks cannot take it from the motion"
)
_SHORTER, _HIGHER = "Shorten dda.time_step_s", "Give the zone an order of 2 to 8 (zones.NAME.order)"


class BudgetWatch:
    """Warns when the unexplained energy of blocks and cracks exceeds `GAIN` times all energy converted, and again
    whenever it has doubled."""

    def __init__(self) -> None:
        self._reported = GAIN

    def check(self, share: float, time: float) -> None:
        """``share``: unexplained energy until ``time`` s, relative to all energy converted."""
        if not abs(share) > self._reported:
            return
        self._reported = 2.0 * abs(share)
        log.warning(
            "t = %g s: %.2g of all converted energy is not accounted for (budget_residual in history.csv): reduce the "
            "time step and, where cracks grow, growth.increment_m",
            time,
            share,
        )


def check_dissipation(
    budget: EnergyBudget, time: float, static: bool, broken: float = 0.0, newmark: tuple[float, float] | None = None
) -> None:
    """Warn at the end of a run, ``time`` s, if the time integration has damped vibrations that matter to its result,
    or, in statics, a motion from one place to another. ``broken``: J/m of fracture energy, of cracks that have grown;
    ``newmark``: (β, γ) of the scheme."""
    energy, turnover = budget.last, budget.turnover
    if static:
        if turnover and budget.scheme > UNHELD * turnover:
            log.warning(
                "t = %g s: static steps have dissipated %.2g of all converted energy (scheme_loss in history.csv): some "
                "blocks moved without support, under a load that acts before the weight or the rock that resists it, "
                "or as a mechanism; their final position depends on the time step, and on rounding where events end the "
                "steps. Apply weight and water together, or follow the motion with dda.dynamic_factor = 1",
                time,
                budget.scheme / turnover,
            )
        return
    if energy is None or not turnover:
        return
    moves = energy.kinetic >= IN_MOTION * turnover
    if moves and budget.breaking > BREAKS * turnover:
        log.warning(
            "t = %g s: bonds broke within steps over which their forces would have done %.2g of all converted energy, and "
            "their blocks still move: when a bond breaks is known to one step only, and the result is uncertain by that "
            "share or some times as much, which shrinks with dda.time_step_s",
            time,
            budget.breaking / turnover,
        )
    if budget.scheme < DISSIPATED * turnover or not (moves or broken > 0):
        return
    log.warning(
        "t = %g s: the time integration has taken %.2g of all converted energy from blocks %s (scheme_loss in "
        "history.csv): the step does not resolve vibrations or impacts that matter to the result, whose error is of "
        "that order and shrinks with dda.time_step_s. dda.automatic_time_step = true takes shorter steps while "
        'vibrations are damped; dda.equilibrium = "start" avoids the vibration due to a suddenly applied load%s',
        time,
        budget.scheme / turnover,
        "that still move" if moves else "whose cracks have grown in motion",
        "" if tuple(newmark or ()) == SECOND_ORDER else f"; dda.newmark = {list(SECOND_ORDER)} has no dissipation",
    )


def check_supplied(supplied: float, budget: EnergyBudget, time: float, bend: bool = False) -> None:
    """Warn at the end of a run in motion, ``time`` s, if growing cracks and cut blocks have released more than `GAIN` times
    all energy converted that no block had ``supplied``, J/m: what the blocks spent on fracture and at the cuts, below 0.
    ``bend``: whether all cracked blocks are of higher order."""
    if not -supplied > GAIN * budget.turnover:
        return
    log.warning(
        "t = %g s: cracks that grew and cut blocks released %.3g J/m, %.2g of all converted energy, which no block supplied "
        "(fracture_energy and parting_energy in history.csv): %s. The motion is uncertain by that share or several times as "
        "much, since other steps give other cracks. %s",
        time,
        -supplied,
        -supplied / budget.turnover,
        _UNRESOLVED if bend else "forces that bend a block of uniform strain load its cracks but do no work on it",
        _SHORTER if bend else _HIGHER,
    )


def warn_of_onset(drive: float, step: float, time: float, end: float) -> None:
    """Warn if the first cracks of a run in motion that ends at ``end`` s begin to grow well above their toughness, at K_eq/K_Ic
    of up to ``drive``, in a ``step`` (s) until ``time`` that is long for the time left."""
    share = step / max(step, end - time + step)
    if drive < 1.0 + OVERSHOT or share <= ONSET:
        return
    log.warning(
        "t = %g s: cracks begin to grow at %.3g times their toughness, at the end of a step of %.3g s: when they begin in motion "
        "is known to one step only, which is %.2g of the time left, and the motion after it is uncertain by that share or some "
        "times as much; other cracks may run in other steps. Shorten dda.time_step_s; dda.automatic_time_step = true takes "
        'shorter steps at first; dda.equilibrium = "start" lets no weight act at once',
        time,
        drive,
        step,
        share,
    )


class BendingWatch:
    """Warns, once, when moving blocks have supplied less energy to their cracks than the rock takes as it breaks: a
    block of uniform strain stores no bending energy, so that cracks opened by bending cost it nothing.

    bend  whether all cracked blocks so far are of higher order
    """

    def __init__(self) -> None:
        self._reported, self._before, self.bend = False, 0.0, True

    def check(self, toughness: float, spent: float, time: float, bend: bool = False) -> None:
        """Called after every step: ``toughness``, J/m: fracture energy until ``time`` s; ``spent``, J/m: what the
        blocks supplied for it; ``bend``: whether all cracked blocks are of higher order. Part of the growth in a step is
        paid for in the next one."""
        self.bend = self.bend and bend
        before, self._before = self._before, toughness
        if self._reported or not before - spent > UNPAID * before:
            return
        self._reported = True
        log.warning(
            "t = %g s: of the %.3g J/m of fracture energy, the blocks supplied %.3g (unpaid_toughness in summary.json): "
            "%s, and K under an impact may be several times too high. %s, or take such cracks as an upper bound",
            time,
            before,
            spent,
            _UNRESOLVED
            if self.bend
            else "blocks of uniform strain store no bending energy, so that cracks opened by bending take none from the motion",
            _SHORTER if self.bend else _HIGHER,
        )


class GrowthWatch:
    """Reports, once, that growth at constant load has released more than `GAIN` of all converted energy: it is
    unstable, and with load steps of given length it begins at a load that depends on them."""

    def __init__(self) -> None:
        self._reported, self._began = False, 1.0

    def begins(self, drive: float) -> None:
        """Cracks grow at a new load, at which K_eq/K_Ic is up to ``drive``."""
        self._began = max(self._began, drive)

    def check(self, budget: EnergyBudget, time: float) -> None:
        """``budget`` after a load step that ends at ``time`` s."""
        if self._reported or not budget.released > GAIN * budget.turnover:
            return
        self._reported = True
        log.warning(
            "t = %g s: cracks grow unstably at constant load and have released %.3g J/m so far, which a static run does "
            "not convert to motion (growth_release in history.csv); set dda.dynamic_factor = 1 to follow the motion%s",
            time,
            budget.released,
            ""
            if self._began < 1.0 + OVERSHOT
            else f". They grow from {self._began:.3g} times their toughness on, at the end of a load step: which cracks run, and "
            'where, depends on the load steps; run.stepping = "events" finds the loads at which growth begins',
        )
