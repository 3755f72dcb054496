"""Faces that crush: a normal law that is elastic and perfectly plastic, with closure that does not open again.

With the gap g at the end of a step, counted from where the faces meet, and the strength f of the joint per area,

    N = min(−k g, f ℓ),    Δc = max(0, −g − f ℓ/k),

where ℓ is the contact's share of the face. The irreversible closure Δc moves the place where the faces meet: it is a
negative lift of the contact, and its work f ℓ Δc is dissipated. As for any law of plasticity without hardening, a
motion determines forces and closure; the resultant of a face is that of a stress block at its limit (Heyman 1966 for
infinite, Livesley 1978 for finite strength of masonry joints).

Either branch is linear, so that the open–close iteration finds branches together with contact states. The plastic one
has a stiffness of `_HARDENING` k within a step; in the next one the force returns to f ℓ. A dashpot of the contact acts
beside its spring: both together bear f ℓ at most.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...model import OPEN
from ..kinematics.tolerances import NOTHING
from .penalty_springs import Springs

if TYPE_CHECKING:
    from ..open_close.contact_set import ContactSet

#: Stiffness of crushing faces relative to that of elastic ones, within a step: so small that closure by a thousand times
#: the elastic one raises the force by 1e-5 of itself, and so large that rounding leaves eight digits of that closure.
_HARDENING = 1e-8
#: If the open–close iteration does not converge with it, these are taken one after the other: first faces that do not
#: crush, and each next law from the states of the last one. (An arch of twelve voussoirs under its weight in one step
#: takes 40 iterations. Without them trial states with many crushing faces move blocks by metres.)
_CONTINUED = (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6, _HARDENING)


class CrushingFaces:
    """The contacts of ``found`` whose normal force is limited (`NonlinearLaws`)."""

    def __init__(self, found: ContactSet) -> None:
        self.rows = np.flatnonzero(np.isfinite(found.springs.crushing))
        self._limit = found.springs.crushing[self.rows]
        self._laws, self._were_continued = [_HARDENING], False

    def continued(self) -> bool:
        if self._were_continued:
            return False
        self._laws, self._were_continued = list(_CONTINUED), True
        return True

    def proceeded(self) -> bool:
        if len(self._laws) == 1:
            return False
        del self._laws[0]
        return True

    def lines(
        self, springs: Springs, gap: np.ndarray, found: ContactSet, state: np.ndarray, direction: np.ndarray,
        bonded: np.ndarray, normal_force: np.ndarray, plastic: np.ndarray,
    ) -> tuple[Springs, np.ndarray]:  # fmt: skip
        """``springs`` and starting ``gap`` (n,) of the branches to which the ``normal_force`` (n,) N belongs: closed contacts
        beyond the limit close further with hardly more force."""
        at, limit = self.rows, self._limit
        crushes = (state[at] != OPEN) & (normal_force[at] > limit)
        if not crushes.any():
            return springs, gap
        stiff = springs.normal[at]
        tangent, begins = self._laws[0] * stiff, -limit / stiff - gap[at]
        normal, start = springs.normal.copy(), gap.copy()
        normal[at] = np.where(crushes, tangent, stiff)
        start[at] = np.where(crushes, -limit / tangent - begins, gap[at])
        return springs._replace(normal=normal), start

    def misfit(
        self, was: Springs, gap_was: np.ndarray, now: Springs, gap_now: np.ndarray, state: np.ndarray,
        forces: np.ndarray, slack: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """(n,) N: difference between ``forces`` (n, 4), found on the branches of ``was``, and those of the branches to which
        they belong; 0 within the tolerance. ``slack`` (n,) m: rounding of gaps."""
        out, at = np.zeros(len(state)), self.rows
        moved = forces[at, 2] - gap_was[at]
        off = np.abs(now.normal[at] * (gap_now[at] + moved) + forces[at, 0])
        least = np.maximum(NOTHING * self._limit, np.maximum(was.normal[at], now.normal[at]) * slack[at])
        wrong = (state[at] != OPEN) & (was.normal[at] != now.normal[at]) & (off > least)
        out[at] = np.where(wrong, off, 0.0)
        return out

    def lifted(
        self, springs: Springs, gap: np.ndarray, found: ContactSet, direction: np.ndarray, slip: np.ndarray,
        forces: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """(n,) m: irreversible closure of the step, negative, of contacts that bear more than their limit on the branch of
        ``springs``."""
        out, at = np.zeros(len(forces)), self.rows
        crushes = springs.normal[at] < 0.5 * found.springs.normal[at]
        out[at] = np.where(crushes, np.minimum((self._limit - forces[at, 0]) / springs.normal[at], 0.0), 0.0)
        return out
