"""Sticking contacts with tangential motion in the step that is not part of the unknowns: prescribed motion, arcs.

Their shear force contains −k times this motion, k the stiffness of the shear spring. For a nonlinear law this is the
stiffness at the normal force at the end of the step, and is found together with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...model import OPEN
from ..open_close.contact_set import ContactSet
from ..open_close.equations import Unsettled
from ..open_close.settled_states import Settled
from .nonlinear_laws import NonlinearLaws
from .penalty_springs import Springs

#: Tolerance of shear forces, relative to the contact's force, as for nonlinear laws.
_AGREED = 1e-8
#: Largest number of iterations; stiffness that depends on the normal force takes four to six.
_ROUNDS = 30


def settle_sheared_sticks(
    settle: Callable[[ContactSet], Settled],
    found: ContactSet,
    springs: Springs,
    gap: np.ndarray,
    stretch: np.ndarray,
    curved: NonlinearLaws | None,
) -> Settled:
    """Result of ``settle`` for the contacts ``found`` with the motion ``stretch`` (n,) m in their shear springs;
    ``springs``, starting ``gap`` (n,) m and ``curved`` laws of the step as for `open_close.settle`.

    Raises `Unsettled` if stiffness and normal force do not converge."""
    if curved is None:
        return settle(replace(found, shear=found.shear - springs.shear * stretch))

    def stiffness_at(state, direction, bonded, normal_force, slip) -> np.ndarray:
        return curved.lines(springs, gap, found, state, direction, bonded, normal_force, slip)[0].shear

    stiffness = stiffness_at(found.state, found.direction, found.bonded, found.normal, np.zeros(len(found)))
    iterations = 0
    for _ in range(_ROUNDS):
        settled = settle(replace(found, shear=found.shear - stiffness * stretch))
        iterations += settled.iterations
        # (The motion of the unknowns may be too small to determine another stiffness.)
        better = stiffness_at(
            settled.state, settled.direction, settled.bonded, settled.normal_force, settled.slip + np.zeros(len(found))
        )
        off = np.abs((better - stiffness) * stretch) > _AGREED * np.hypot(settled.normal_force, settled.shear_force)
        if not off[settled.state != OPEN].any():
            return replace(settled, iterations=iterations)
        stiffness = better
    raise Unsettled("prescribed motion and the pressure-dependent stiffness of joints do not converge")
