"""Contact states by rounds of convex problems: what to try where the central path of Coulomb's friction ends half way.

Coulomb's friction is no gradient of an energy: its central path may turn back long before contacts are decided, and on
slopes of some thousand blocks under sudden weight it does. Two neighbours of the problem are convex, and interior
points solve them in ten to twenty iterations whatever their size. With associated flow, slip lifts by its friction,

    w = g + N/kₙ − μ(α + β),

which is the dual of a minimum over the friction cones (Anitescu 2006 steps through time by it). Its normal forces begin
rounds with the strengths of contacts held at c = μN + cℓ of the round before (Tresca's friction, a minimum too;
Panagiotopoulos 1975). Begun from N = 0, or from contacts that cannot slide, the rounds wander about; from here a slope
of 3 000 blocks, for which Newton's method on the open–close states and all else fail nine halvings of the step long,
comes to states that stand after 25 rounds of ten iterations.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .central_path import CentralPath

#: The first problem starts from so many times the number of blocks, as squared forces in a pile of them go, in units of
#: the squared loads over the stiffness; …
_START = 10.0
#: … rounds end at the first ε, and at the second one before states are proposed, after so many iterations at most.
_ROUND, _DECIDED, _MOST = 1e-3, 1e-9, 60
#: They are in balance to this part of the loads by then; strengths are no less than this part of the loads.
_BALANCED, _LEAST = 1e-4, 1e-9
#: They go on while normal forces change by no more than this part of what they did so many rounds before.
_FALLING, _ROUNDS = 0.7, 6


class ConvexRounds(CentralPath):
    """Rounds for one step; arguments as for `CentralPath`. ``solutions`` counts what was spent."""

    solutions = 0

    def rounds(self) -> Iterator[float]:
        """Change of the normal forces over the forces (both as norms) round by round, while rounds get nearer to one
        another. Raises numpy.linalg.LinAlgError."""
        rough, kn, unit = self._rough, self._kn, self._unit
        friction, firm = self._coulomb = self._mu, self._base
        self._rise = np.where(rough, friction, 0.0)
        self._begin(_START * self._pattern.n)
        self._descend(_ROUND)
        self._rise = np.zeros_like(kn)
        least = _LEAST * np.sqrt(unit * kn)
        changes: list[float] = []
        while len(changes) <= _ROUNDS or changes[-1] <= _FALLING * changes[-_ROUNDS - 1]:
            known = self._normal
            self._mu = np.where(rough, 0.0, friction)
            self._base = np.where(rough, np.maximum(friction * known + firm, least), firm)
            self._begin(float(np.mean(known * known / kn / unit)))
            self._descend(_ROUND)
            size = max(float(np.linalg.norm(self._normal)), 1e-300)
            changes.append(float(np.linalg.norm(self._normal - known)) / size)
            yield changes[-1]

    def decided(self) -> tuple[np.ndarray, np.ndarray]:
        """States and directions (n,) of the present round, taken to its end. Raises numpy.linalg.LinAlgError."""
        self._descend(_DECIDED)
        self._mu, self._base = self._coulomb
        return self.states()

    def _descend(self, epsilon: float) -> None:
        for _ in range(_MOST):
            if self.ended or (self.epsilon < epsilon and self.missed < _BALANCED):
                return
            self.advance()
            self.solutions += 1
