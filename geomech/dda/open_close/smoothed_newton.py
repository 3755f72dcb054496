"""Contact states by laws whose corners are rounded off: what to try where the central path is blocked.

The forces of a contact are functions of the step's motion alone, with corners where it opens and where it begins to
slide. Rounded off over a force f (N), they are

    N = ½ (√(kₙ²g² + 4f²) − kₙg),   S = ½ (√((T + c)² + 4f²) − √((T − c)² + 4f²)),   T = S₀ − kₛs,   c = μN + firm,

(Chen & Harker 1993; Kanzow 1996), and Newton's method finds the motion in which all blocks are in balance, each step
cut to where the next one, solved with the same factors, is the shorter (Deuflhard 1974: a test that no scaling of the
equations changes, where the residual of springs ten thousand times as stiff as the inertia behind them says nothing).
Then f is taken down by stages until the states are those of the laws themselves. A stage that does not end is begun
again with a larger f. It takes a hundred solutions where they are needed: more than a central path that is not blocked,
a few times less than rounds of lagged friction.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...model import OPEN, SLIP, STICK
from ..joint_laws.coulomb_return import moved
from ..joint_laws.penalty_springs import Springs
from ..linear_solver import assembly
from .contact_set import ContactSet
from .interior_point.central_path import WITHIN, add_forces, solution_of

#: Newton's steps in a stage at most; the least part of one that is worth while.
_STEPS, _LEAST = 15, 1e-4
#: A stage ends when the imbalance is below this part of f (or of the largest load).
_BALANCED = 0.1
#: From stage to stage f falls to this part, to half of it after stages of fewer than so many steps, never below the
#: last.
_SHRINK, _QUICK, _LEAST_SHRINK = 0.2, 5, 1e-3
#: A first stage that does not end is tried again so often with so much larger f. Later ones give up when f would hardly
#: fall.
_AGAIN, _LARGER, _HARDLY = 6, 4.0, 0.9
#: States are proposed once f is below this part of the loads, and f goes down to the last.
_DECIDED, _END = 3e-3, 1e-6


class RoundedLaws:
    """Stages of one step's contacts from ``unknowns`` (6 n,) on; other arguments as for `settle`, ``bonded`` (n,) the
    bonds, which hold. ``force`` is f at the start, in units of the load on a contact's blocks. ``solutions`` counts
    factorisations.
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
        unknowns: np.ndarray,
        force: float,
    ) -> None:
        self._pattern, self._matrix, self._right = pattern, matrix, right.ravel()
        order, self._n = pattern.order, len(found)
        self._at = found.block, found.other, order, vectors
        self._upper, self._lower = pattern.upper, pattern.lower
        self._kn, self._ks, self._lift = springs.normal, springs.shear, springs.lift
        self._gap, self._before, self._held = gap, found.shear, bonded > 0
        slides = found.state == SLIP
        self._mu = np.where(slides, springs.friction, springs.peak)
        self._firm = np.where(slides, springs.sliding, springs.hold)
        load = np.append(np.abs(right).max(axis=1, initial=0.0), 0.0)
        load = np.maximum(load[order[self._at[0]]], load[order[self._at[1]]])
        # Blocks without load share a little of the others'; without any, any unit will do.
        self._unit = np.maximum(load, 1e-3 * load.mean()) if load.any() else np.ones(self._n)
        self._load = max(float(np.abs(right).max(initial=0.0)), 1e-300)
        self._data = np.empty(pattern.size)
        self._unknowns, self._force = unknowns.copy(), force
        self.solutions = 0

    def stages(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """State (n,) and direction (n,) after each stage with a small f. Raises numpy.linalg.LinAlgError."""
        force, last, shrink, again = self._force, None, _SHRINK, 0
        while force > _END:
            before = self.solutions
            unknowns = self._stage(force)
            if unknowns is not None:
                self._unknowns, last = unknowns, force
                if force < _DECIDED:
                    yield self._states()
                if self.solutions - before < _QUICK:
                    shrink = max(0.5 * shrink, _LEAST_SHRINK)
            elif last is None:
                again += 1
                if again > _AGAIN:
                    return
                force *= _LARGER
                continue
            elif shrink > _HARDLY:
                return
            else:
                shrink = np.sqrt(shrink)
            force = shrink * last

    def _stage(self, force: float) -> np.ndarray | None:
        """The motion in balance with laws rounded off over ``force``, from the motion at hand; None if it is not
        found."""
        unknowns = self._unknowns
        motion = self._motion(unknowns)
        forces = self._laws(motion, force)
        residual = self._residual(unknowns, *forces[:2])
        share = 1.0
        for _ in range(_STEPS):
            if float(np.abs(residual).max()) < _BALANCED * min(force, 1.0) * self._load:
                return unknowns
            p = self._pattern
            assembly.assemble(p, self._data, self._matrix, self._upper, self._lower, *self._at, *forces[2:], self._lift)
            solve = solution_of(p, self._data)
            self.solutions += 1
            step = solve(residual, WITHIN)
            along, length, share = self._motion(step), float(np.linalg.norm(step)), min(1.0, 4.0 * share)
            while True:
                forces = self._laws(motion + share * along, force)
                residual = self._residual(unknowns + share * step, *forces[:2])
                if np.linalg.norm(solve(residual, WITHIN)) <= (1.0 - 0.25 * share) * length:
                    break
                share *= 0.5
                if not share > _LEAST:
                    return None
            unknowns, motion = unknowns + share * step, motion + share * along
        return None

    def _motion(self, unknowns: np.ndarray) -> np.ndarray:
        motion = moved(unknowns, *self._at)
        motion[:, 0] -= self._lift * motion[:, 1]
        return motion

    def _laws(self, motion: np.ndarray, force: float) -> tuple[np.ndarray, ...]:
        """N, S, and how they answer motions: −∂N/∂g, −∂S/∂s and ∂S/∂N (n,)."""
        kn, held, f = self._kn, self._held, force * self._unit
        pressed, trial = -kn * (self._gap + motion[:, 0]), self._before - self._ks * motion[:, 1]
        root = np.sqrt(pressed**2 + 4.0 * f**2)
        # The smaller of the roots of N (N − pressed) = f² would cancel.
        normal = np.where(pressed > 0.0, 0.5 * (root + pressed), 2.0 * f**2 / (root - np.minimum(pressed, 0.0)))
        stiff = kn * normal / root
        strength = self._mu * normal + self._firm
        above, below = trial + strength, trial - strength
        high, low = np.sqrt(above**2 + 4.0 * f**2), np.sqrt(below**2 + 4.0 * f**2)
        shear, above, below = 0.5 * (high - low), above / high, below / low
        return (
            np.where(held, pressed, normal),
            np.where(held, trial, shear),
            np.where(held, kn, stiff),
            self._ks * np.where(held, 1.0, 0.5 * (above - below)),
            self._mu * np.where(held, 0.0, 0.5 * (above + below)),
        )

    def _residual(self, unknowns: np.ndarray, normal: np.ndarray, shear: np.ndarray) -> np.ndarray:
        residual = self._right - self._pattern.without_contacts(self._matrix, unknowns).ravel()
        add_forces(residual, *self._at, normal, shear)
        return residual

    def _states(self) -> tuple[np.ndarray, np.ndarray]:
        """States and directions (n,) that the laws themselves give the motion at hand."""
        motion = self._motion(self._unknowns)
        pressed, trial = -self._kn * (self._gap + motion[:, 0]), self._before - self._ks * motion[:, 1]
        closed = (pressed > 0.0) | self._held
        slides = closed & ~self._held & (np.abs(trial) > self._mu * pressed + self._firm)
        smooth = closed & ~self._held & (self._mu == 0.0) & (self._firm == 0.0)
        state, direction = np.full(self._n, OPEN), np.zeros(self._n)
        state[:] = np.where(slides | smooth, SLIP, np.where(closed, STICK, OPEN))
        direction[:] = np.where(slides & ~smooth, np.sign(trial), 0.0)
        return state, direction
