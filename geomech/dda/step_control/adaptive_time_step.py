"""Time steps that follow from how the last ones went."""

from __future__ import annotations

from dataclasses import dataclass

from ...model import DdaSettings
from ..results import StepResult

#: A run begins with this part of the longest step: what acts at once is met by steps that see it come on.
FIRST = 1 / 32
#: After an easy step, settled in so few open–close iterations and not cut, the next one is longer by this factor, …
EASY, GROWTH = 6, 1.5
#: … after one that took more than this, or was cut, shorter by that: what is hard to settle comes on within the step.
HARD, SHRINKAGE = 18, 0.5
#: The displacement allowed in a step is used to this part: so much of it is left for loads that grow.
USE = 0.8
#: Steps asked for are never shorter than this part of the longest; what still fails is cut by the step itself.
SHORTEST = 1e-4


@dataclass(eq=False)
class StepLength:
    """How long the next step of a run is to be, s: ``settings.time_step``, or with ``settings.automatic_time_step``
    between that and a ten thousandth of it, by the last step's open–close iterations, cuts and displacement."""

    settings: DdaSettings

    def __post_init__(self) -> None:
        longest = self.settings.time_step
        self.dt = FIRST * longest if self.settings.automatic_time_step else longest

    def after(self, result: StepResult, asked: float) -> None:
        """Take account of a step that was to last ``asked`` s."""
        if not self.settings.automatic_time_step:
            return
        facts = result.statistics
        cut, iterations = facts["step_cuts"] > 0, facts["open_close_iterations"]
        if asked < self.dt or (result.dt < asked and not cut):
            # The run or a stage ended in it, or speed alone shortened it: no sign of how a whole step would have gone.
            return
        share = facts["limit_share"]
        factor = min(GROWTH, USE / share) if share > 0.0 else GROWTH
        if cut:
            factor = min(factor, 1.0)
        elif iterations > HARD:
            factor = min(factor, SHRINKAGE)
        elif iterations > EASY:
            factor = min(factor, 1.0)
        longest = self.settings.time_step
        self.dt = min(longest, max(SHORTEST * longest, factor * result.dt))
