"""Operator splitting for static steps with cohesion, joint stiffness or bolts, as `static_splitting` does with friction alone.

Faces keep their cohesion while they slide, as in limit equilibrium. Their admissible forces |S| ≤ c ℓ + N tan φ, N ≥ 0 are a
convex set, whatever slip they have behind them, and the iteration needs no states of bonds:

    c  counts in full on faces that touch anywhere (`whole_faces`); on others it falls to zero over the gap that the contact's
       spring has under a force of c ℓ, so that a face that is open by a hairline does not lose all of it at once
    ρ  in series with the springs of the contacts: joint stiffness may be far below that of the blocks. In an iteration a block
       on contacts that slide or are open moves by its unbalanced force over the sum of their ρ, which is far less than a bolt or
       a soft joint needs to take up the force. Contacts that were open or slid throughout a period, at blocks that move steadily,
       get springs of a hundredth of that stiffness until they have been closed, or have stuck, for a whole period
    S₀ and N₀ of the last step are the forces at first

Bolts are part of the blocks' equations as if they were elastic. What a bolt's force exceeds its limits by after the motion of
an iteration is taken off the right side of the next one. Cohesive blocks stay wedged in more ways than blocks with friction
alone, and iterates go round in longer cycles: means are also taken over more and more periods. Blocks that stay beyond the
limit of motion, and those that do not balance in `ContactSolver.static_splitting_iterations`, have failed, which may underrate
the factor, and never overrates it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import OPEN, SLIP, STICK, ContactSolver, JointLaw
from ..joint_laws.coulomb_return import moved
from ..joint_laws.penalty_springs import PENALTY_RATIO
from .equations import Equations, Unsettled
from .interior_point.central_path import SLIPPED
from .static_splitting import (
    ADAPTED,
    AT_STRENGTH,
    CALM,
    NOT_BALANCED,
    Converged,
    KeepsMoving,
    Period,
    Splitting,
    farthest,
)


def is_plastic(law: JointLaw) -> bool:
    """Whether contacts with this ``law`` keep their strength as they slide, without dilation and tensile strength."""
    friction = law.residual_friction_angle
    return (
        law.tensile_strength == 0.0
        and law.dilation_angle == 0.0
        and law.roughness is None
        and law.max_closure is None
        and (friction is None or friction == law.friction_angle)
        and law.residual_cohesion == law.cohesion
    )


def is_stronger(law: JointLaw) -> bool:
    """Whether the ``law`` has more than friction: cohesion or stiffness of its own."""
    return law.cohesion > 0.0 or law.normal_stiffness is not None or law.shear_stiffness is not None


def split_plastic(equations: Equations, solver: ContactSolver) -> tuple[Converged, np.ndarray]:
    """The solution of a static step, from the motion and forces of an earlier attempt if there is one, and the bonds (n,) after
    it. Raises `Unsettled`, and `KeepsMoving` if blocks move beyond ``equations.reach`` or their forces do not balance."""
    found = equations.found
    bonded = found.bonded if found.tried is None else found.tried[2]
    try:
        solved = _PlasticSplitting(equations, bonded, solver).solved()
    except np.linalg.LinAlgError as error:
        raise Unsettled(str(error)) from error
    return solved, np.where((bonded > 0) & (solved.state == SLIP), SLIPPED, bonded)


@dataclass(frozen=True, eq=False)
class _Span(Period):
    """Means over ``number`` periods."""

    number: int = 1

    @classmethod
    def of(cls, period: Period) -> _Span:
        return cls(period.forces, period.unknowns, period.unbalanced, period.end)

    def joined(self, period: Period) -> _Span:
        """The means over this span and the next ``period``."""
        share = 1.0 / (self.number + 1)

        def mean(one: np.ndarray, two: np.ndarray) -> np.ndarray:
            return one + share * (two - one)

        return _Span(
            mean(self.forces, period.forces), mean(self.unknowns, period.unknowns),
            mean(self.unbalanced, period.unbalanced), period.end, self.number + 1,
        )  # fmt: skip


class _PlasticSplitting(Splitting):
    #: (2, n) bool, normal and shear springs that give.
    _gives: np.ndarray

    def _laws(self, bonded: np.ndarray) -> np.ndarray:
        found, springs, holds = self._equations.found, self._equations.springs, bonded > 0
        gap = self._equations.gap
        if self._equations.curved is not None:
            none = np.zeros(self._n)
            springs, gap = self._equations.curved.lines(
                springs, gap, found, np.full(self._n, STICK), none, np.where(holds, SLIPPED, 0), none, none
            )
        cohesion = np.where(holds, springs.cohesion, 0.0)
        self._fades = np.maximum(found.precision, cohesion / springs.normal) * (cohesion > 0.0)
        return np.stack(
            [gap, springs.normal, springs.shear, found.shear, springs.friction, cohesion, self._fades], axis=1
        )

    def _stiffness(self) -> tuple[float, float]:
        # E' of the blocks; of rigid ones the springs alone know it.
        of_blocks = float(self._equations.matrix[:, 3, 3].min())
        modulus = max(of_blocks, float(self._equations.springs.normal.min()) / PENALTY_RATIO)
        stiffest = PENALTY_RATIO * modulus
        return self._solver.static_splitting_soft * stiffest, self._solver.static_splitting_stiff * stiffest

    def _springs(self, stiffness: float, share: np.ndarray) -> np.ndarray:
        contacts = np.ascontiguousarray(self._law[:, 1:3].T)
        given = np.where(self._gives, self._solver.plastic_splitting_gives, 1.0)
        return given * share / (1.0 / stiffness + 1.0 / contacts)

    def _period(self) -> Period:
        self._always, self._ever = np.ones((2, self._n), bool), np.zeros((2, self._n), bool)
        return super()._period()

    def _sample(self) -> None:
        state = self._states[0]
        gives = np.stack([state == OPEN, state != STICK])
        self._always &= gives
        self._ever |= gives

    def _give(self, steady: np.ndarray) -> bool:
        """Whether other springs than before give: those of contacts of ``steady`` blocks (n_free,) that were open or slid for a
        whole period, until they are closed or stick for as long."""
        found, order = self._equations.found, self._equations.pattern.order
        moves = np.append(steady, False)
        gives = (self._always & (moves[order[found.block]] | moves[order[found.other]])) | (self._gives & self._ever)
        before = self._gives
        self._gives = self._equations.giving.which = gives
        return bool((before != gives).any())

    def _begin(self) -> None:
        equations, law = self._equations, self._law
        earlier, forces = equations.earlier, equations.earlier_forces
        self._beyond = np.zeros(equations.pattern.n, int)
        gave = equations.giving.which
        self._gives = np.zeros((2, self._n), bool) if gave is None or gave.shape[1] != self._n else gave
        self._unknowns = np.zeros(equations.right.size) if earlier is None else earlier.copy()
        motion = moved(self._unknowns, *self._contacts)
        if forces is None or len(forces) != self._n:
            forces = np.stack([np.maximum(equations.found.normal, 0.0), equations.found.shear], axis=1)
        normal = forces[:, 0]
        strength = np.where(normal > 0.0, law[:, 4] * normal + law[:, 5], 0.0)
        shear = np.clip(forces[:, 1], -strength, strength)
        # The springs of closed contacts give the gap, and of sticking ones the motion.
        self._at_hand = np.zeros((self._n, 6))
        self._at_hand[:, 2] = np.where(normal > 0.0, -normal / law[:, 1] - law[:, 0], motion[:, 0])
        self._at_hand[:, 3] = np.where(np.abs(shear) < strength, (law[:, 3] - shear) / law[:, 2], motion[:, 1])
        self._rho = np.ones((2, self._n))
        self._at_hand[:, :2] = self._at_hand[:, 2:4] - np.stack([normal, shear], axis=1)
        self._loaded = bool(normal.any())
        self._keep_cohesion(normal if self._loaded else None)

    def _keep_cohesion(self, normal: np.ndarray | None) -> None:
        """Let whole faces that touch anywhere, by their ``normal`` forces (n,), keep their cohesion; all of them if None."""
        whole = self._equations.found.whole
        if whole is None:
            return
        touch = whole.face >= 0 if normal is None else whole.touch(np.where(normal > 0.0, STICK, OPEN))
        self._law[:, 6] = np.where(touch & (self._fades > 0.0), np.inf, self._fades)

    def solved(self) -> Converged:
        """Iterate until the mean forces balance every block and no longer change. Raises `KeepsMoving`, or `Unsettled` if
        iterates are not finite."""
        solver, taken = self._solver, 0
        if not self._loaded:
            for _ in range(solver.static_splitting_begin):
                self._advance()
            taken = solver.static_splitting_begin
            self._take(self._stiff)
        last = self._period()
        mean = before = _Span.of(last)
        longest = 1
        while True:
            taken += solver.static_splitting_period
            period = self._period()
            if not np.isfinite(period.unknowns).all():
                raise Unsettled("operator splitting diverged")
            self._keep_cohesion(period.forces[:, 0])
            self._refuse_beyond(period)
            steady = (self._left(period) > solver.static_splitting_balance) & self._alike(last, period)
            # What goes round in a cycle cancels in means over longer and longer times.
            if mean.number < longest:
                mean = mean.joined(period)
            else:
                before, mean, longest = mean, _Span.of(period), 2 * longest
            for one, two in ((last, period), (before, mean)) if not steady.any() else ():
                if self._settled(one, two):
                    return self._result(two, taken)
            if taken >= solver.static_splitting_iterations:
                raise self._unbalanced(last, period, mean, taken)
            if steady.any():
                mean = before = _Span.of(period)
                longest = 1
            if self._give(steady):
                self._take(self._stiff)
            else:
                if steady.any():
                    calm = self._changed(last, period) <= CALM * solver.static_splitting_change
                    self._follow(last, period, steady, calm)
                if taken % (ADAPTED * solver.static_splitting_period) == 0:
                    self._take(self._stiff)
            last = period

    def _settled(self, last: Period, period: Period) -> bool:
        """Whether the forces in the means of a ``period`` balance, and are those of the ``last``."""
        balanced = self._left(period).max() <= self._solver.static_splitting_balance
        return bool(balanced and self._changed(last, period) <= self._solver.static_splitting_change)

    def _refuse_beyond(self, period: Period) -> None:
        """Raise `KeepsMoving` if a block has been beyond its reach for some periods: it would not be accepted there at rest."""
        self._beyond = np.where(farthest(period.end.reshape(-1, 6)) > self._reach(), self._beyond + 1, 0)
        if self._beyond.max(initial=0) >= ADAPTED:
            raise KeepsMoving(period.end.reshape(-1, 6), period.unbalanced, self._equations.pattern.order)

    def _unbalanced(self, last: Period, period: Period, mean: Period, taken: int) -> KeepsMoving:
        moves = (self._left(mean) > self._solver.static_splitting_balance)[:, None]
        moves = moves if moves.any() else ~moves
        return KeepsMoving(
            np.where(moves, (period.end - last.end).reshape(-1, 6), 0.0), np.where(moves, mean.unbalanced, 0.0),
            self._equations.pattern.order, f"{NOT_BALANCED} in {taken} iterations of operator splitting",
        )  # fmt: skip

    def _result(self, period: Period, taken: int) -> Converged:
        law, motion, (normal, shear) = self._law, moved(period.unknowns, *self._contacts), period.forces.T
        slides = np.abs(shear) >= (law[:, 4] * normal + law[:, 5]) * (1.0 - AT_STRENGTH)
        # A contact that is open by less than its cohesion reaches may carry shear alone.
        closed = (normal > 0.0) | (shear != 0.0)
        state = np.where(closed, np.where(slides, SLIP, STICK), OPEN)
        direction = np.where(state == SLIP, np.sign(shear), 0.0)
        # Of pressed contacts the gap, and of sticking ones the motion, are those of their springs.
        gap = np.where(normal > 0.0, -normal / law[:, 1], law[:, 0] + motion[:, 0])
        along = np.where(state == STICK, (law[:, 3] - shear) / law[:, 2], motion[:, 1])
        forces = np.stack([np.where(closed, normal, 0.0), np.where(closed, shear, 0.0), gap, along], axis=1)
        return Converged(period.unknowns, forces, state, direction, taken)
