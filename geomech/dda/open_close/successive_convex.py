"""Contact states by rounds of problems that are nearly convex: what to try where the central path ends half way.

Coulomb's friction is no gradient of an energy: its central path may turn back long before contacts are decided, and on
slopes of some thousand blocks under sudden weight it does. Two neighbours of the problem are convex, and interior
points solve them in ten to twenty iterations whatever their size. With associated flow, slip lifts by its friction,

    w = g + N/kₙ − μ(α + β),

which is the dual of a minimum over the friction cones (Anitescu 2006 steps through time by it). Its normal forces begin
rounds with the strengths of contacts held at c = μN + cℓ of the round before (Tresca's friction, a minimum too;
Panagiotopoulos 1975). Begun from N = 0, or from contacts that cannot slide, the rounds wander about.

Held wholly, strengths take many rounds to what they belong to: what changes at one contact passes on by a block or two
a round. So a part λ of the friction only lags behind, c = (1 − λ) μN + λ μN' + cℓ with N' of the round before, and λ
falls from one round that ends to the next, from Tresca's friction towards Coulomb's, whose states come out at λ = 0; it
grows again where a round does not end. A slope of 3 000 blocks, for which Newton's method on the open–close states and
all else fail nine halvings of the step long, is so brought to states that stand.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .interior_point.central_path import CentralPath

#: Every problem starts from so many times the number of blocks, as squared forces in a pile of them go, in units of the
#: squared loads over the stiffness, about the motion of the last. (Rounds of 10 000 blocks do not end from the mean of
#: N²/kₙ, a thousandth of that; from iterates of the last round they take as long.)
_START = 10.0
#: … rounds end at the first ε, and at the second one before states are proposed, after so many iterations at most or
#: where so many in a row hardly get ahead.
_ROUND, _DECIDED, _MOST, _STOPPED = 1e-3, 1e-9, 40, 3
#: They are in balance to this part of the loads by then; strengths are no less than this part of the loads.
_BALANCED, _LEAST = 1e-4, 1e-9
#: The part that lags falls by this factor from round to round, and is none below the second one or where normal forces
#: change by less than the third. Where a round does not end, the part with which the last one did is taken again, and
#: falls by the root of the factor then, no slower than the fourth. So many rounds do not end in all.
_FALLS, _NONE, _CLOSE, _SLOWLY, _FAILURES = 0.6, 0.1, 0.02, 0.8, 20


class ConvexRounds(CentralPath):
    """Rounds for one step; arguments as for `CentralPath`. ``solutions`` counts what was spent."""

    solutions = 0

    def rounds(self) -> Iterator[float]:
        """Change of the normal forces over the forces (both as norms) round by round, 0 where none of the friction
        lags. Raises numpy.linalg.LinAlgError."""
        friction = self._mu
        self._coulomb = friction, self._base
        self._rise = np.where(self._rough, friction, 0.0)
        self._solve()
        self._rise = np.zeros_like(friction)
        lag, ended, falls, failures = 1.0, 1.0, _FALLS, 0
        known, motion = self._normal.copy(), self._motion()
        while failures < _FAILURES:
            self._mu, self._base = self._laws(known, lag)
            if not self._solve():
                if lag == 1.0:
                    return
                failures += 1
                lag, falls = ended if lag < ended else min(1.0, lag / _FALLS), min(np.sqrt(falls), _SLOWLY)
                self._unknowns, self._g, self._s = (part.copy() for part in motion)
                continue
            change = float(np.linalg.norm(self._normal - known)) / max(float(np.linalg.norm(self._normal)), 1e-300)
            known, motion, ended = self._normal.copy(), self._motion(), lag
            yield change if lag else 0.0
            lag = falls * lag if falls * lag > _NONE and change > _CLOSE else 0.0
            falls = max(_FALLS, falls**2)

    def decided(self) -> tuple[np.ndarray, np.ndarray]:
        """States and directions (n,) of the present round, taken to its end. Raises numpy.linalg.LinAlgError."""
        self._descend(_DECIDED)
        self._mu, self._base = self._coulomb
        return self.states()

    def _laws(self, known: np.ndarray, lag: float) -> tuple[np.ndarray, np.ndarray]:
        """(n,) friction and strength without normal force (N) where the part ``lag`` of friction is that on the
        ``known`` (n,) normal forces."""
        friction, firm = self._coulomb
        held = np.maximum(lag * friction * known + firm, _LEAST * np.sqrt(self._unit * self._kn))
        return np.where(self._rough, (1.0 - lag) * friction, friction), np.where(self._rough, held, firm)

    def _motion(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The motion at hand: that of blocks and what it makes of gaps and of motions along edges."""
        return self._unknowns.copy(), self._g.copy(), self._s.copy()

    def _solve(self) -> bool:
        """Solve the problem at hand, from afar; whether it was."""
        self._begin(_START * self._pattern.n)
        # Contacts that stop a path are not centred again, alone or with all others: what that leaves out of balance is
        # more than these problems ask for.
        self._again = self._lone = np.inf
        return self._descend(_ROUND)

    def _descend(self, epsilon: float) -> bool:
        """Iterate until ``epsilon`` and balance are reached; whether they were."""
        for _ in range(_MOST):
            if self.ended or self._blocked >= _STOPPED:
                break
            if self.epsilon < epsilon and self.missed < _BALANCED:
                return True
            self.advance()
            self.solutions += 1
        return self.epsilon < epsilon and self.missed < _BALANCED
