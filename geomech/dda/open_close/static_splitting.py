"""Contact states of a static step by operator splitting, continued until the contact forces balance.

Where many small blocks are wedged between others, friction makes the tangent matrices of nearly consistent states
indefinite: from states in which ten of twenty thousand contacts are wrong, Newton's method goes astray. The iteration of
`operator_splitting` needs no tangents. With springs ρ on all contacts, soft compared with those of the contacts and about
as stiff as the blocks, it converges linearly in statics as well,

    contacts   z:  ρ (z − ζ) = F(z)                    law of each contact, in closed form (Coulomb return)
    blocks     d:  (A + Gᵀ ρ G) d = f + Gᵀ ρ (2 z − ζ)
               ζ ← ζ + G d − z

and its solution is the result: the forces F(z) satisfy the law of every contact, and the blocks balance up to the forces
ρ (z − G d). At contacts of wedged slivers the iterates may go round in a cycle. Friction cones are convex, so that the
mean of the forces over many iterations is within the strength of all contacts, and what a cycle leaves unbalanced cancels
in it. The mean is the result once it balances every block and no longer changes.

The springs ρ are in proportion to the force that the less loaded of the two blocks carries: with the same springs for all,
slivers, which are light and have to follow the motion of large blocks, would need a hundred times as many iterations.

Blocks that nothing supports, or that have not reached their supports yet, move by the same distance in every period under the
same unbalanced force, while no other force changes any more. Their motion is extrapolated to where a contact closes. If
none does before they have moved too far, they keep moving.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import OPEN, SLIP, STICK, ContactSolver, JointLaw
from ..contact_detection.contact_records import largest_of_blocks
from ..equation_records import ContactMotion, ContactStiffness
from ..joint_laws.coulomb_return import moved
from ..linear_solver import assembly
from .equations import Equations, Unsettled
from .interior_point.contact_terms import balance
from .operator_splitting import contact_turn, linear_laws

#: Beginning of the reason why a step failed in which blocks neither came to rest nor moved too far.
NOT_BALANCED = "contact forces did not balance"
#: Cost of an iteration in Newton iterations.
_TURN = 0.04
#: Every which iteration enters the mean forces and motions of a period.
_SAMPLED = 5
#: Relative distance from the strength within which a contact slides.
AT_STRENGTH = 1e-9
#: A block moves steadily if the unbalanced forces on it in successive periods have directions with at least this cosine, and
#: magnitudes that differ by less than this fraction.
_STEADY, _ALIKE = 0.98, 0.2
#: Forces are calm if they change by no more than this multiple of `ContactSolver.static_splitting_change`: blocks that move
#: push a little on others.
CALM = 3.0
#: Part of the way to where a contact closes over which motion is extrapolated.
_NEARLY = 0.9
#: Loads smaller than this fraction of the median of all blocks count as that large.
_LIGHT = 1e-2
#: Smallest stiffness of springs on blocks that carry little, relative to others, and number of periods after which this is
#: adapted.
_LEAST, ADAPTED = 1e-4, 4
#: Number of rounds in which blocks that touch take the smallest extrapolation of their neighbours.
_SPREAD = 20


class KeepsMoving(Unsettled):
    """Blocks without support: ``motion`` (n_free, 6) in a period, ``unbalanced`` (n_free, 6) forces on them, and
    ``order`` (n_blocks,), their rows."""

    def __init__(
        self, motion: np.ndarray, unbalanced: np.ndarray, order: np.ndarray,
        reason: str = "blocks without support move too far",
    ) -> None:  # fmt: skip
        super().__init__(reason)
        self.motion, self.unbalanced, self.order = motion, unbalanced, order


@dataclass(frozen=True, eq=False)
class Converged:
    """``unknowns`` (6 n_free,); ``forces`` (n, 4) as from `contact_forces`; ``state`` and ``direction`` (n,);
    ``iterations``."""

    unknowns: np.ndarray
    forces: np.ndarray
    state: np.ndarray
    direction: np.ndarray
    iterations: int

    @property
    def spent(self) -> float:
        """Cost in Newton iterations."""
        return _TURN * self.iterations


def is_straight(law: JointLaw) -> bool:
    """Whether contacts with this ``law`` have straight strengths, without bonds and dilation."""
    return (
        law.cohesion == 0.0
        and law.tensile_strength == 0.0
        and law.dilation_angle == 0.0
        and law.roughness is None
        and law.residual_friction_angle is None
        and law.normal_stiffness is None
        and law.shear_stiffness is None
    )


def can_split_statics(equations: Equations, bonded: np.ndarray, solver: ContactSolver) -> bool:
    """Whether a step is to be solved in this way, and can be: a static step with a limit of motion (`Equations.reach`) of many
    blocks of first order, straight laws without dilation, and no intact bonds."""
    pattern = equations.pattern
    return (
        equations.reach is not None
        and equations.first_order
        and pattern.solver is not None
        and pattern.n >= solver.static_splitting
        and equations.curved is None
        and not (bonded == 1).any()
        and not equations.springs.lift.any()
    )


def split_statics(equations: Equations, bonded: np.ndarray, solver: ContactSolver) -> Converged:
    """The solution of a static step, from the motion of an earlier attempt if there is one. Raises `Unsettled`, and
    `KeepsMoving` if blocks move beyond ``equations.reach``."""
    try:
        return Splitting(equations, bonded, solver).solved()
    except np.linalg.LinAlgError as error:
        raise Unsettled(str(error)) from error


@dataclass(frozen=True, eq=False)
class Period:
    """Means over a period of iterations: ``forces`` (n, 2), ``unknowns`` (6 n_free,), and ``unbalanced`` (n_free, 6) forces
    on blocks; ``end`` (6 n_free,): unknowns at its end."""

    forces: np.ndarray
    unknowns: np.ndarray
    unbalanced: np.ndarray
    end: np.ndarray


def farthest(motion: np.ndarray) -> np.ndarray:
    """(n_free,) m: about the largest displacement of blocks in the ``motion`` (n_free, 6)."""
    return np.hypot(motion[:, 0], motion[:, 1]) + np.abs(motion[:, 2])


class Splitting:
    """The iterates of one step; arguments as for `split_statics`."""

    def __init__(self, equations: Equations, bonded: np.ndarray, solver: ContactSolver) -> None:
        pattern, found = equations.pattern, equations.found
        self._equations, self._solver, self._n = equations, solver, len(found)
        self._vectors = np.ascontiguousarray(equations.vectors)
        self._contacts = ContactMotion(found.block, found.other, pattern.order, self._vectors)
        self._law, self._intact = self._laws(bonded), np.zeros(self._n, bool)
        self._states = np.full(self._n, STICK), np.zeros(self._n)
        self._soft, self._stiff = self._stiffness()
        self._begin()
        self._take(self._stiff if self._loaded else self._soft)

    def _laws(self, bonded: np.ndarray) -> np.ndarray:
        """Laws of the contacts as for `contact_turn`."""
        return linear_laws(self._equations, bonded)

    def _stiffness(self) -> tuple[float, float]:
        """N/m of the springs at first, and later."""
        stiffest = float(self._equations.springs.normal.min())
        return self._solver.static_splitting_soft * stiffest, self._solver.static_splitting_stiff * stiffest

    def _begin(self) -> None:
        """Start from the motion of an earlier attempt, or none, and the contact forces in it."""
        equations, law = self._equations, self._law
        earlier = equations.earlier
        self._unknowns = np.zeros(equations.right.size) if earlier is None else earlier.copy()
        motion = moved(self._unknowns, *self._contacts)
        normal = np.maximum(-law[:, 1] * (law[:, 0] + motion[:, 0]), 0.0)
        strength = np.where(normal > 0.0, law[:, 4] * normal + law[:, 5], 0.0)
        shear = np.clip(law[:, 3] - law[:, 2] * motion[:, 1], -strength, strength)
        self._at_hand = np.zeros((self._n, 6))
        self._at_hand[:, 2:4] = motion
        self._rho = np.ones((2, self._n))
        self._at_hand[:, :2] = motion - np.stack([normal, shear], axis=1)
        self._loaded = bool(normal.any())

    def _take(self, stiffness: float) -> None:
        """Use springs of this ``stiffness``, or less where blocks carry little, with the same forces."""
        equations, at_hand, forces = self._equations, self._at_hand, self._forces()
        self._rho = self._springs(stiffness, self._share(forces))
        at_hand[:, :2] = at_hand[:, 2:4] - forces / self._rho.T
        pattern, data, none = equations.pattern, equations.room(), np.zeros(self._n)
        springs = ContactStiffness(self._rho[0], self._rho[1], none, none)
        assembly.assemble(pattern, data, equations.matrix, self._contacts, springs, sides=equations.sides)
        pattern.add_links(data)
        assert pattern.solver is not None  # `can_split_statics`
        self._correction = pattern.solver.corrections(data)

    def _springs(self, stiffness: float, share: np.ndarray) -> np.ndarray:
        """(2, n) N/m normal and shear, of springs of this ``stiffness`` where the ``share`` (n,) is 1."""
        return np.tile(stiffness * share, (2, 1))

    def _share(self, forces: np.ndarray) -> np.ndarray:
        """(n,) of each contact: force that the less loaded of its blocks carries, relative to the mean, at most 1."""
        found, order = self._equations.found, self._equations.pattern.order
        if not forces.any():
            return np.ones(self._n)
        carried = self._carried(forces)
        share = np.append(np.clip(carried / carried.mean(), _LEAST, 1.0), 1.0)
        return np.minimum(share[order[found.block]], share[order[found.other]])

    def _forces(self) -> np.ndarray:
        """(n, 2) normal and shear force of the contacts."""
        return self._rho.T * (self._at_hand[:, 2:4] - self._at_hand[:, :2])

    def _advance(self) -> None:
        """One iteration."""
        equations, at_hand = self._equations, self._at_hand
        pattern = equations.pattern
        contact_turn(
            self._unknowns, tuple(self._contacts), self._law, self._rho, self._intact, 1.0, at_hand, self._states
        )
        rest = equations.right - pattern.without_contacts(equations.matrix, self._unknowns)
        if equations.limits is not None:
            rows, lost = equations.limits.beyond(self._unknowns, pattern.order)
            np.add.at(rest, rows[rows >= 0], lost[rows >= 0])
        rest = rest.ravel()
        balance(0, pattern.n, *equations.sides, self._vectors, at_hand, 4, 5, rest, rest)
        self._unknowns += self._correction(rest)

    def _period(self) -> Period:
        """Iterate over a period."""
        number = self._solver.static_splitting_period
        before, forces, unknowns = self._at_hand[:, :2].copy(), np.zeros((self._n, 2)), np.zeros_like(self._unknowns)
        for k in range(number):
            self._advance()
            if k % _SAMPLED == 0:
                forces += self._forces()
                unknowns += self._unknowns
                self._sample()
        sampled = len(range(0, number, _SAMPLED))
        # The changes of ζ add up to what is unbalanced.
        pulled = np.zeros((self._n, 6))
        pulled[:, 4:] = self._rho.T * (self._at_hand[:, :2] - before) / number
        return Period(forces / sampled, unknowns / sampled, self._on_blocks(pulled), self._unknowns.copy())

    def _sample(self) -> None:
        """Record the states of contacts."""

    def _on_blocks(self, pulled: np.ndarray) -> np.ndarray:
        """(n_free, 6) sums on the blocks of the contact forces in the last two columns of ``pulled`` (n, 6)."""
        n, none = self._equations.pattern.n, np.zeros(self._unknowns.size)
        out = np.zeros_like(none)
        balance(0, n, *self._equations.sides, self._vectors, pulled, 4, 5, none, out)
        return out.reshape(n, 6)

    def solved(self) -> Converged:
        """Iterate until the mean forces balance every block and no longer change. Raises `Unsettled`."""
        solver, taken = self._solver, 0
        if not self._loaded:
            for _ in range(solver.static_splitting_begin):
                self._advance()
            taken = solver.static_splitting_begin
            self._take(self._stiff)
        last = self._period()
        while taken < solver.static_splitting_iterations:
            taken += solver.static_splitting_period
            period = self._period()
            left = self._left(period)
            steady = (left > solver.static_splitting_balance) & self._alike(last, period)
            changed = self._changed(last, period)
            if changed <= solver.static_splitting_change and self._balances(left, steady):
                return self._result(period, taken)
            if not np.isfinite(period.unknowns).all():
                break
            if steady.any():
                self._follow(last, period, steady, changed <= CALM * solver.static_splitting_change)
            last = period
            if taken % (ADAPTED * solver.static_splitting_period) == 0:
                self._take(self._stiff)
        raise Unsettled(f"{NOT_BALANCED} in {taken} iterations of operator splitting")

    def _left(self, period: Period) -> np.ndarray:
        """(n_free,) unbalanced force on each block in the mean over the ``period``, over the largest force on it."""
        return np.linalg.norm(period.unbalanced[:, :3], axis=1) / self._carried(period.forces)

    def _carried(self, forces: np.ndarray) -> np.ndarray:
        """(n_free,) largest force on each block: of its contacts (``forces`` (n, 2)) and loads."""
        found, order = self._equations.found, self._equations.pattern.order
        largest = np.zeros(len(order))
        largest_of_blocks(np.hypot(forces[:, 0], forces[:, 1]), found.block, found.other, largest)
        load = np.abs(self._equations.right[:, :3]).max(axis=1)
        out, free = np.maximum(load, _LIGHT * float(np.median(load))), order >= 0
        out[order[free]] = np.maximum(out[order[free]], largest[free])
        return np.maximum(out, 1e-300)

    def _balances(self, left: np.ndarray, steady: np.ndarray) -> bool:
        """Whether the mean forces balance all blocks except a few at which the iterates go round in a cycle; ``left``
        (n_free,): unbalanced over carried force; ``steady`` (n_free,) bool: unbalanced in one direction."""
        solver, cycling = self._solver, left > self._solver.static_splitting_balance
        few = cycling.sum() <= solver.static_splitting_cycling * len(left)
        return bool(few and not steady.any() and left.max() <= solver.static_splitting_cycle)

    def _changed(self, last: Period, period: Period) -> float:
        """Change of the mean forces from period to period, relative to the mean normal force."""
        mean, change = float(period.forces[:, 0].mean()), period.forces - last.forces
        return float(np.sqrt(np.mean(change**2))) / max(mean, 1e-300)

    @staticmethod
    def _alike(last: Period, period: Period) -> np.ndarray:
        """(n_free,) bool: blocks on which the unbalanced force of successive periods is about the same."""
        one, two = last.unbalanced[:, :3], period.unbalanced[:, :3]
        first, second = np.linalg.norm(one, axis=1), np.linalg.norm(two, axis=1)
        along = np.einsum("na,na->n", one, two) > _STEADY * first * second
        return along & (np.abs(first - second) < _ALIKE * second)

    def _follow(self, last: Period, period: Period, steady: np.ndarray, calm: bool) -> None:
        """Once forces are ``calm``, move the ``steady`` blocks (n_free,) on to where a contact closes. Raises `KeepsMoving`
        if one has moved too far, or will under a force that hardly decreases."""
        order = self._equations.pattern.order
        motion = np.where(steady[:, None], (period.end - last.end).reshape(-1, 6), 0.0)
        unbalanced = np.where(steady[:, None], period.unbalanced, 0.0)
        reach = self._reach()
        if (farthest(period.end.reshape(-1, 6)) > reach)[steady].any():
            raise KeepsMoving(motion, unbalanced, order)
        if not calm:
            return
        most = np.where(steady, reach / np.maximum(farthest(motion), 1e-300), 0.0)
        stride = self._until_contact(motion, most)
        free = steady & (stride >= most)
        before, now = (float((each.unbalanced * motion)[free].sum()) for each in (last, period))
        if free.any() and now > 0.0 and before - now <= now / most[free].min():
            raise KeepsMoving(motion, unbalanced, order)
        stride[free] = 0.0
        jump = (motion * stride[:, None]).ravel()
        self._unknowns += jump
        # Contact forces stay the same, except where closed contacts approach or separate.
        along = moved(jump, *self._contacts)
        is_open = self._states[0] == OPEN
        along[:, 0] *= is_open
        along[:, 1] *= is_open | (self._states[0] == SLIP)
        self._at_hand[:, :2] += along
        self._at_hand[:, 2:4] += along

    def _reach(self) -> np.ndarray:
        """(n_free,) m: motion beyond which blocks are given up."""
        order, reach = self._equations.pattern.order, self._equations.reach
        assert reach is not None  # `can_split_statics`
        out = np.empty(self._equations.pattern.n)
        out[order[order >= 0]] = reach[order >= 0]
        return out

    def _until_contact(self, motion: np.ndarray, stride: np.ndarray) -> np.ndarray:
        """(n_free,) the ``stride`` of the blocks' ``motion`` (n_free, 6), shortened to where open contacts close, and the
        same for blocks that press on one another."""
        found, order = self._equations.found, self._equations.pattern.order
        block, other, stride = order[found.block], order[found.other], np.append(stride, 0.0)
        moves = np.append(np.abs(motion).max(axis=1) > 0.0, False)
        is_open = self._states[0] == OPEN
        closing = -moved(motion.ravel(), *self._contacts)[:, 0]
        gap = self._law[:, 0] + self._at_hand[:, 2]
        ends = np.where(is_open & (closing > 0.0), _NEARLY * np.maximum(gap, 0.0) / np.maximum(closing, 1e-300), np.inf)
        for side in (block, other):
            np.minimum.at(stride, side, ends)
        together = ~is_open & moves[block] & moves[other]
        one, two = block[together], other[together]
        for _ in range(_SPREAD):
            least = np.minimum(stride[one], stride[two])
            np.minimum.at(stride, one, least)
            np.minimum.at(stride, two, least)
        return stride[:-1]

    def _result(self, period: Period, taken: int) -> Converged:
        law, motion, (normal, shear) = self._law, moved(period.unknowns, *self._contacts), period.forces.T
        slides = np.abs(shear) >= (law[:, 4] * normal + law[:, 5]) * (1.0 - AT_STRENGTH)
        state = np.where(normal > 0.0, np.where(slides, SLIP, STICK), OPEN)
        direction = np.where(state == SLIP, np.sign(shear), 0.0)
        closed = state != OPEN
        # Of closed contacts the gap, and of sticking ones the motion, are those of their springs.
        gap = np.where(closed, -normal / law[:, 1], law[:, 0] + motion[:, 0])
        along = np.where(state == STICK, (law[:, 3] - shear) / law[:, 2], motion[:, 1])
        forces = np.stack([np.where(closed, normal, 0.0), np.where(closed, shear, 0.0), gap, along], axis=1)
        return Converged(period.unknowns, forces, state, direction, taken)
