"""Static steps of a trial of joint strength by operator splitting with cohesion (`open_close.plastic_splitting`).

A trial takes a few long steps, each of which begins where the last one has ended, and is stable only once nothing moves. Its
steps therefore need not be exact: the gaps of rotating blocks are linear in their motion, and what that leaves, as what moves
too far, is found by the next step.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from ...model import STICK, Loads
from ..loads.step_actions import StepActions
from ..open_close.contact_set import ContactSet
from ..open_close.equations import GivingSprings
from ..step_cutting import StepCutting
from ..time_step import Attempt
from .step_limits import Crossed


class TrialAttempt(Attempt):
    """An attempt at such a step."""

    #: The next step begins with the actual gaps.
    bends = 0
    #: Each contact of a whole face has the cohesion of its own length from the start.
    shares = 0

    def __init__(self, *arguments: Any) -> None:
        self.giving = GivingSprings()
        super().__init__(*arguments)

    def _first_contacts(self) -> ContactSet:
        return self.found.sharing_cohesion(np.full(len(self.found), STICK), self.found.bonded)

    def _actions(self, loads: Loads, end: float) -> StepActions | None:
        actions = super()._actions(loads, end)
        if actions is not None:
            actions.limits_in_settle = True
        return actions

    def _further_equations(self, pattern, matrix, right, contacts, vectors) -> dict[str, Any]:
        bolts = None if self.actions is None else self.actions.bolts
        return super()._further_equations(pattern, matrix, right, contacts, vectors) | {
            "plastic": True, "limits": bolts, "giving": self.giving,
        }  # fmt: skip


class TrialCutting(StepCutting):
    """Attempts at such a step."""

    attempts = TrialAttempt
    #: Bonds are lost in most steps.
    glue_holds = False
    #: The next step finds what one step has moved too far.
    level_of_crossings = logging.DEBUG

    def _most_extensions(self, crossed: Crossed) -> int:
        # Without the arcs of rotating blocks corners enter a little at any search distance.
        return super()._most_extensions(crossed) if crossed.through else 1
