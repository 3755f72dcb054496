"""Contact states by lagged friction: what to try where neither switching nor the central path comes to an end.

With the strength of every contact taken from the normal forces of the round before, c = μN + cℓ (Tresca's friction), a
step is the minimum of a convex function,

    ½ dᵀM d − fᵀd + Σ ½ kₙ ⟨−g⟩² + Σ ∫ min(kₛ|s|, c) d|s|,

which Newton's method with a line search finds from anywhere. The rounds are a fixed-point iteration on N
(Panagiotopoulos 1975; Nečas, Jarušek & Haslinger 1980), taken half way each time: undamped, shear and normal forces
feed each other and two rounds may alternate. It takes a hundred solutions where it is needed, and it is slow and sure:
a step of a jointed slope under its sudden weight that eight halvings of the time step did not settle otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...compiled import kept, part
from ...model import OPEN, SLIP, STICK
from ..joint_laws.coulomb_return import moved
from ..joint_laws.penalty_springs import Springs
from ..linear_solver import assembly
from .contact_set import ContactSet

#: The part of the way to the new normal forces that a round takes.
_WAY = 0.5
#: Newton's method ends a round after so many solutions at most; the line search halves its interval so often.
_SOLUTIONS, _HALVINGS = 30, 14


@part(fastmath=False, error_model="numpy", nogil=True)
def _slope(t, start, curved, gap, trial, apart, along, strength, bonded, normal, shear):
    """How the energy changes along a step, at its part ``t``. See `LaggedFriction._way`."""
    n = gap.shape[0]
    found = start + t * curved
    for c in range(n):
        end = gap[c] + t * apart[c]
        if end < 0.0 or bonded[c]:
            found += normal[c] * end * apart[c]
        pull = trial[c] - t * shear[c] * along[c]
        found -= min(max(pull, -strength[c]), strength[c]) * along[c]
    return found


@kept(fastmath=False, error_model="numpy", nogil=True)
def _least_energy(start, curved, gap, trial, apart, along, strength, bonded, normal, shear):
    """The part of a step at which the energy is least, by halving; arguments as for `_slope`."""
    same = (start, curved, gap, trial, apart, along, strength, bonded, normal, shear)
    if _slope(1.0, *same) <= 1e-9 * abs(_slope(0.0, *same)):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _slope(middle, *same) > 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


class LaggedFriction:
    """Rounds of lagged friction for one step; arguments as for `settle`, ``bonded`` (n,) as the step began.

    Bonds hold throughout: whether they break is decided when all else is right. ``solutions`` counts what was spent.
    """

    def __init__(
        self,
        pattern: assembly.Pattern,
        matrix: np.ndarray,
        right: np.ndarray,
        found: ContactSet,
        vectors: np.ndarray,
        springs: Springs,
        gap: np.ndarray,
        bonded: np.ndarray,
    ) -> None:
        self._pattern, self._matrix, self._right, self._found = pattern, matrix, right, found
        self._vectors, self._springs, self._gap, self._bonded = vectors, springs, gap, bonded > 0
        n = len(found)
        # A normal spring and a shear spring a contact, each with states of its own: two rows.
        none = np.zeros(n)
        self._rows = (np.concatenate([found.block, found.block]), np.concatenate([found.other, found.other]))
        self._upper = np.concatenate([pattern.upper, pattern.upper])
        self._lower = np.concatenate([pattern.lower, pattern.lower])
        self._both = np.concatenate([vectors, vectors])
        self._normal, self._shear = np.concatenate([springs.normal, none]), np.concatenate([none, springs.shear])
        self._gaps, self._before = np.concatenate([gap, none]), np.concatenate([none, found.shear])
        self._data, self._side = np.empty(pattern.size), np.empty(6 * pattern.n)
        self._motion = np.zeros(6 * pattern.n)
        self._contact_motion = np.zeros((n, 2))
        self.solutions = 0

    def rounds(self) -> Iterator[float]:
        """Largest change of a normal force over the largest, round by round, for ever. Raises
        numpy.linalg.LinAlgError."""
        springs = self._springs
        force = np.maximum(0.0, self._found.normal)
        while True:
            strength = np.where(self._bonded, np.inf, springs.friction * force + springs.sliding)
            self._minimise(strength)
            gap, _ = self._forces(self._contact_motion)
            # (A bond that pulls has no friction.)
            new = np.where(self._closed(gap), np.maximum(0.0, -springs.normal * gap), 0.0)
            moved = float(np.abs(new - force).max())
            change = moved / max(float(new.max(initial=0.0)), 1e-30 * moved, 1e-300)
            force = force + _WAY * (new - force)
            self._strength = strength
            yield change

    def decided(self) -> tuple[np.ndarray, np.ndarray]:
        """States and directions (n,) of the present round."""
        gap, trial = self._forces(self._contact_motion)
        slides = np.abs(trial) > self._strength
        state = np.where(self._closed(gap), np.where(slides, SLIP, STICK), OPEN)
        return state, np.where(state == SLIP, np.sign(trial), 0.0)

    def _closed(self, gap: np.ndarray) -> np.ndarray:
        return (gap < 0.0) | self._bonded

    def _forces(self, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._gap + motion[:, 0], self._found.shear - self._springs.shear * motion[:, 1]

    def _minimise(self, strength: np.ndarray) -> None:
        """Newton's method on the motion, until no spring changes its state."""
        pattern = self._pattern
        order = pattern.order
        last = None
        for _ in range(_SOLUTIONS):
            gap, trial = self._forces(self._contact_motion)
            sticks = np.abs(trial) <= strength
            state = np.concatenate([np.where(self._closed(gap), SLIP, OPEN), np.where(sticks, STICK, SLIP)])
            direction = np.concatenate([np.zeros(len(gap)), np.where(sticks, 0.0, np.sign(trial))])
            key = state.tobytes() + direction.tobytes()
            if key == last:
                return
            last = key
            none = np.zeros(2 * len(gap))
            sliding = np.concatenate([none[: len(gap)], np.where(sticks, 0.0, strength)])
            assembly.assemble_contacts(
                pattern, self._data, self._side, self._matrix, self._right, self._upper, self._lower, *self._rows,
                order, self._both, state, direction, self._gaps, self._normal, self._shear, none, sliding, none,
                self._before,
            )  # fmt: skip
            step = assembly.solve(pattern, self._data, self._side, True) - self._motion
            self.solutions += 1
            along = moved(step, self._found.block, self._found.other, order, self._vectors)
            share = self._way(step, along, strength)
            self._motion = self._motion + share * step
            self._contact_motion = self._contact_motion + share * along

    def _way(self, step: np.ndarray, along: np.ndarray, strength: np.ndarray) -> float:
        """The part of ``step`` at which the energy is least: its slope along the way only grows."""
        rows = step.reshape(-1, 6)
        turned = self._pattern.without_contacts(self._matrix, step)
        curved = float((rows * turned).sum())
        start = float((turned * self._motion.reshape(-1, 6)).sum() - (rows * self._right).sum())

        gap, trial = self._forces(self._contact_motion)
        springs = self._springs
        return _least_energy(
            start, curved, gap, trial, np.ascontiguousarray(along[:, 0]), np.ascontiguousarray(along[:, 1]), strength,
            self._bonded, springs.normal, springs.shear,
        )  # fmt: skip
