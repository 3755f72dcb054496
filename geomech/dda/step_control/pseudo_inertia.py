"""Static steps without the inertia that keeps free blocks in place.

A static step solves (2M/dt² + K) d = F: the inertia 2M d/dt² decides how far a block goes that nothing holds, and of one
that is held it takes a part of the force, the larger the shorter the step (a joint that dilates by d = v dt tan ψ would be
pressed by 2 M v tan ψ/dt). Solved again about the displacement d_k found before, a proximal point iteration,

    2M/dt² (d_{k+1} − d_k) + K d_{k+1} = F,

what inertia takes falls by M/(M + K dt²/2) each time, to nothing on blocks that are held. On others it stays, and these
keep their first displacement.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..interfaces import SteppedSystem
from ..open_close.contact_set import ContactSet
from ..open_close.equations import Unsettled
from ..time_step import Attempt, StepStart

#: Inertia below this part of the forces on a block is none.
_NOTHING = 1e-6
#: Blocks are held on which what inertia takes falls to this part each time; it is solved again so often at most. (In a
#: slope of 200 blocks under sudden weight it falls to an eighth.)
_FALLS, _SOLUTIONS = 0.5, 12


def balanced_attempt(system: SteppedSystem, start: StepStart, dt: float, found: ContactSet, cuts: int) -> Attempt:
    """A static step of ``dt`` from ``start`` in which the blocks that are held bear their loads without inertia;
    arguments as for `Attempt`. Raises `Unsettled`."""
    attempt = Attempt(system, start, dt, found, cuts)
    left, size = attempt.inertia_and_size()
    nothing = _NOTHING * size
    held = left > nothing
    for _ in range(_SOLUTIONS):
        if not (held & (left > nothing)).any():
            break
        rest = np.where(held[:, None], attempt.increment, 0.0)
        same = attempt.found.trying(attempt.found.rows(attempt.settled), without_lost=True)
        try:
            again = Attempt(system, replace(start, rest=rest), dt, same, cuts)
        except Unsettled:
            break
        again.iterations += attempt.iterations
        after = again.inertia_and_size()[0]
        falls = after <= np.maximum(_FALLS * left, nothing)
        if falls[held].all():
            attempt, left = again, after
        elif attempt.rest is None:
            held &= falls
        else:
            break
    return attempt
