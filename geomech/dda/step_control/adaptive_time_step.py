"""Adaptive time step: chosen from open–close iterations, cuts and displacement of the last steps, and from the energy that the
time scheme has taken in them."""

from __future__ import annotations

from dataclasses import dataclass

from ...model import DdaSettings
from ..energy_balance import StepEnergy
from ..results import StepResult

#: The first step is this part of the longest: loads that act at once are then resolved as they set in.
FIRST = 1 / 32
#: The step grows by this factor after a step that converged within so many open–close iterations without a cut, …
EASY, GROWTH = 6, 1.5
#: … and shrinks by that factor after one that needed more than this, or was cut: such changes happen within the step.
HARD, SHRINKAGE = 18, 0.5
#: A step of given length that was cut is followed by one of at most so many times what it was cut to, until it has its
#: length again: a slope of 10 000 blocks whose contacts settle in steps of 1 ms need not be tried at 10 ms each time.
REGROWTH = 2.0
#: Share of all converted energy that the time scheme may take in one step: vibrations that it damps by more are followed in
#: shorter ones, but not below the first. A column under sudden weight then loses 2 % in half a period, in a hundred steps, whatever
#: the longest step is.
TAKEN = 5e-4
#: Share of the allowed displacement that a step is planned to use; the rest allows for growing loads.
USE = 0.8
#: Shortest step that is planned, relative to the longest; steps that still fail are cut by the step itself.
SHORTEST = 1e-4


@dataclass(eq=False)
class StepLength:
    """Length of the next step of a run, s.

    It is ``settings.time_step``; in motion, after a step that was cut, at most `REGROWTH` times what it was cut to. With
    ``settings.automatic_time_step`` it is between ``time_step`` and a ten-thousandth of it, depending on the last step's
    open–close iterations, cuts and displacement, and in motion on the energy that the time scheme has taken.
    """

    settings: DdaSettings
    #: J/m: sums over the steps of |work of weight| and |work of loads|, and the largest energy stored.
    _worked: float = 0.0
    _stored: float = 0.0

    def __post_init__(self) -> None:
        longest = self.settings.time_step
        self.dt = FIRST * longest if self.settings.automatic_time_step else longest

    def after(self, result: StepResult, asked: float) -> None:
        """Take account of a step that was planned to last ``asked`` s."""
        facts = result.statistics
        cut, iterations = facts["step_cuts"] > 0, facts["open_close_iterations"]
        if not self.settings.automatic_time_step:
            if self.settings.dynamic_factor == 0.0:
                return  # steps of static loads stay
            grown = REGROWTH * (result.dt if cut else max(asked, self.dt))
            self.dt = min(self.settings.time_step, grown)
            return
        taken = self._taken(result.energy) if self.settings.dynamic_factor else 0.0
        if asked < self.dt or (result.dt < asked and not cut):
            # The run or a stage ended in this step, or speed alone shortened it: it says nothing about a full step.
            return
        share, longest = facts["limit_share"], self.settings.time_step
        factor = min(GROWTH, USE / share) if share > 0.0 else GROWTH
        # In motion, multipliers of contacts take some fifty iterations in steps of any length.
        least = min(1.0, FIRST * longest / result.dt) if self.settings.dynamic_factor else 0.0
        if taken > TAKEN:
            # What a scheme of first order takes in a step goes with the square of its length.
            factor = min(factor, max(least, SHRINKAGE, (TAKEN / taken) ** 0.5))
        if cut:
            factor = min(factor, 1.0)
        elif iterations > HARD:
            factor = min(factor, max(least, SHRINKAGE))
        elif iterations > EASY:
            factor = min(factor, 1.0)
        self.dt = min(longest, max(SHORTEST * longest, factor * result.dt))

    def _taken(self, energy: StepEnergy) -> float:
        """What the time scheme takes in a step, over all energy converted."""
        self._worked += abs(energy.gravity_work) + abs(energy.load_work)
        self._stored = max(self._stored, energy.stored, energy.before)
        turnover = max(self._worked, self._stored)
        return energy.scheme / turnover if turnover > 0.0 else 0.0
