"""Contacts that a step begins with a motion along their edges which no unknown of its equations has: given motion, arcs.

Sticking they bear −k of it besides, k the stiffness of their shear springs. Where a law bends, that is the stiffness at
the normal force with which the step ends, and is found with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...model import OPEN
from ..open_close.contact_set import ContactSet
from ..open_close.equations import Unsettled
from ..open_close.settled_states import Settled
from .nonlinear_laws import CurvedJoints
from .penalty_springs import Springs

#: Shear forces are found to this part of a contact's own force, as those of laws that bend are.
_AGREED = 1e-8
#: … in so many rounds, which stiffnesses that follow the normal force need four to six of.
_ROUNDS = 30


def settle_sheared_sticks(
    settle: Callable[[ContactSet], Settled],
    found: ContactSet,
    springs: Springs,
    gap: np.ndarray,
    stretch: np.ndarray,
    curved: CurvedJoints | None,
) -> Settled:
    """What ``settle`` makes of the contacts ``found`` with the motion ``stretch`` (n,) m in their shear springs; the
    step's ``springs``, starting ``gap`` (n,) m and laws that are ``curved`` as for `open_close.settle`.

    Raises `Unsettled` where stiffness and normal force do not find each other."""
    if curved is None:
        return settle(replace(found, shear=found.shear - springs.shear * stretch))

    def stiffness_at(state, direction, bonded, normal_force, slip) -> np.ndarray:
        return curved.lines(springs, gap, found, state, direction, bonded, normal_force, slip)[0].shear

    stiffness = stiffness_at(found.state, found.direction, found.bonded, found.normal, np.zeros(len(found)))
    iterations = 0
    for _ in range(_ROUNDS):
        settled = settle(replace(found, shear=found.shear - stiffness * stretch))
        iterations += settled.iterations
        # (What the unknowns themselves move may be too little to tell of a stiffness that is another.)
        better = stiffness_at(
            settled.state, settled.direction, settled.bonded, settled.normal_force, settled.slip + np.zeros(len(found))
        )
        off = np.abs((better - stiffness) * stretch) > _AGREED * np.hypot(settled.normal_force, settled.shear_force)
        if not off[settled.state != OPEN].any():
            return replace(settled, iterations=iterations)
        stiffness = better
    raise Unsettled("given motion and the stiffness of joints that follows their pressure do not settle")
