"""Contact states along the central path, for steps in which switching contact states does not converge.

Where many contacts open, close and slide at once, as in a wall under sudden weight, each set of states moves the blocks
so far that most of the next set is inconsistent too. The interior-point method decides no states on the way: each
contact keeps a force N > 0 and a gap w > 0, and rough contacts keep slips α, β > 0 and remaining strengths on either
side of S,

    w = g + N/kₙ,   N w = ε,       (μN + c ∓ S) (α, β) = ε,   Δs + (S − S₀)/kₛ = β − α,

and ε is driven to zero by Newton's method with Mehrotra's (1992) predictor and corrector and Gondzio's (1996) further
correctors, which bring products far from ε back towards it, for the linear complementarity problem of Coulomb friction
in an implicit step (Klarbring 1986; Stewart & Trinkle 1996). After elimination a contact is a spring with a stiffness
between zero and that of the contact, so that each iteration takes one factorisation of the matrix of the open–close
iteration. Where steps become short the contacts are centred again about the present motion, with a larger ε. Bonds are
springs that do not break; their strength is checked once everything else is consistent. Friction that depends on the
present normal force is not the gradient of an energy, so convergence is not guaranteed; the result is only a proposal,
from which the open–close iteration continues.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ....compiled import UNCOUNTED, kept
from ....model import OPEN, SLIP, STICK, ContactSolver
from ...equation_records import ContactMotion, ContactStiffness
from ...joint_laws.coulomb_return import moved
from ...joint_laws.penalty_springs import Springs
from ...linear_solver import assembly
from ..equations import Equations
from .contact_terms import LEAST_LEFT, SHORT_OF, PathSprings, Variables
from .newton_steps import THREADED, PathSteps

#: Bond state of a contact that has slipped but kept some cohesion: it may slide.
SLIPPED = 2
#: Further correctors are computed while the step length is less than this, …
_FAR = 0.9
#: … aiming at a length larger by a factor and an amount, and accepted if a step gains this fraction of it (Gondzio
#: 1996).
_FARTHER, _FURTHER, _GAIN = 1.2, 0.1, 0.1
#: Steps shorter than this, relative to the full step, …
_ALONE_SHORT = 0.05
#: … are made longer: contacts that limit one to less than this length are centred again about the motion that the others
#: allow, if they are no more than this fraction of all contacts, or this number, …
_ALONE_FAR, _ALONE, _ALONE_FEW = 0.3, 0.005, 8
#: … with ε larger by this factor, and at most this many times. (Friction at the corners of two neighbours may block the
#: path.)
_ALONE_LARGER, _ALONE_AGAIN = 1000.0, 40
#: ε, relative to its initial value, at which only round-off is left; and step length below which the path is blocked.
_END, _STUCK = 1e-14, 1e-3
#: Residual of a step, relative to its right-hand side; the next step includes the remainder in the balance of forces. A
#: slope of 976 blocks under sudden weight takes 27 to 144 iterations with 1e-4 in the predictor, depending on the last
#: digits, and 27 with 1e-5. (For walls 1e-4 suffices.)
WITHIN = 1e-5


@kept(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def add_forces(right, block, other, order, vectors, normal, shear):
    """Add to ``right`` (6 n,) the forces ``normal`` and ``shear`` (n_contacts,) on the blocks."""
    for c in range(block.shape[0]):
        push, drag, n, t = normal[c], shear[c], vectors[c, 0], vectors[c, 1]
        for side in range(2):
            i, k = order[block[c]] if side == 0 else order[other[c]], 6 * side
            if i < 0:
                continue
            here = right[6 * i : 6 * i + 6]
            # All six are computed before any is stored, so that they are vectorised.
            r0, r1 = here[0] + push * n[k] + drag * t[k], here[1] + push * n[k + 1] + drag * t[k + 1]
            r2, r3 = here[2] + push * n[k + 2] + drag * t[k + 2], here[3] + push * n[k + 3] + drag * t[k + 3]
            r4, r5 = here[4] + push * n[k + 4] + drag * t[k + 4], here[5] + push * n[k + 5] + drag * t[k + 5]
            here[0], here[1], here[2], here[3], here[4], here[5] = r0, r1, r2, r3, r4, r5


def solution_of(pattern: assembly.Pattern, data: np.ndarray) -> Callable[..., np.ndarray]:
    """A function that solves with the matrix ``data`` for a right-hand side, to a relative residual ``within``. Raises
    numpy.linalg.LinAlgError."""
    pattern.add_links(data)
    if pattern.solver is not None:
        return pattern.solver.rough_solution(data)
    from scipy.linalg.lapack import dgetrf, dgetrs

    factors, pivots, info = dgetrf(data.reshape(6 * pattern.n, -1))
    if info != 0:
        raise np.linalg.LinAlgError(f"the step's matrix is singular (unknown {info - 1})")
    return lambda right, within=WITHIN: dgetrs(factors, pivots, right)[0]


class CentralPath:
    """The path of the contacts of one step's ``equations``, with the linear ``laws`` (springs and starting gaps (n,)
    m). ``bonded`` (n,): bonds, which do not break here; ``forces`` (n,) N: expected size of normal forces. It begins
    with the motion that the equations expect, if any.

    ``missed``: unbalanced force relative to the largest load; ``epsilon``: ε in units of the squared loads over their
    stiffness; ``taken``: number of iterations so far.
    """

    def __init__(
        self,
        equations: Equations,
        laws: tuple[Springs, np.ndarray],
        bonded: np.ndarray,
        forces: np.ndarray,
        solver: ContactSolver | None = None,
    ) -> None:
        pattern, matrix, right = equations.pattern, equations.matrix, equations.right
        found, vectors, expected, (springs, gap) = equations.found, equations.vectors, equations.expected, laws
        self._solver, self.taken = solver or ContactSolver(), 0
        self._pattern, self._matrix, self._right = pattern, matrix, right
        self._n, self.bonded = len(found), bonded
        slipped = bonded == SLIPPED
        some, bonded_rows = (np.flatnonzero(which) for which in ((bonded == 0) | slipped, (bonded > 0) & ~slipped))
        order = pattern.order
        if pattern.n >= THREADED:
            # If they exceed the cache, contacts are sorted by their blocks, so that shared data are close in memory.
            one, two = order[found.block[some]], order[found.other[some]]
            some = some[np.argsort(np.maximum(one, two) * pattern.n + np.minimum(one, two), kind="stable")]
        self._some, self._bonded = some, bonded_rows

        def at(rows: np.ndarray) -> tuple[np.ndarray, ...]:
            return found.block[rows], found.other[rows], order, np.ascontiguousarray(vectors[rows])

        self._at, self._bonded_at = at(some), at(bonded_rows)
        self._all_at = at(np.concatenate([some, bonded_rows])) if len(bonded_rows) else self._at
        self._sides = assembly.sides_of(pattern.n, order, *self._all_at[:2])
        blocks, others, _, directions = self._at
        self._steps = PathSteps(pattern.n, order[blocks], order[others], directions, springs.lift[some])
        self._upper, self._lower, self._all_lift = (
            np.concatenate([array[some], array[bonded_rows]]) for array in (pattern.upper, pattern.lower, springs.lift)
        )
        # Bonds are springs in tension and compression.
        self._bonds = (
            springs.normal[bonded_rows],
            springs.shear[bonded_rows],
            gap[bonded_rows],
            found.shear[bonded_rows],
        )
        self._kn, self._ks = springs.normal[some], springs.shear[some]
        slides = found.state[some] == SLIP
        friction = np.where(slides, springs.friction[some], springs.peak[some])
        firm = np.where(
            slides, springs.sliding[some], springs.hold[some] + np.where(slipped, springs.cohesion, 0.0)[some]
        )
        self._rough = (friction > 0.0) | (firm > 0.0)
        self._mu, self._base = np.where(self._rough, friction, 1.0), np.where(self._rough, firm, 0.0)

        start = np.zeros(right.size) if expected is None else expected
        # Forces balanced by the initial motion are not loads.
        left = right - pattern.without_contacts(matrix, start)
        load = np.append(np.abs(left).max(axis=1, initial=0.0), 0.0)
        block, other = order[self._at[0]], order[self._at[1]]
        # Small blocks transmit the forces of large ones. In units of a small block's own load, contact forces would be
        # negligible compared with those to be balanced, and all steps would be short.
        for _ in range(self._solver.path_load_rings):
            known = load.copy()
            np.maximum.at(load, block, known[other])
            np.maximum.at(load, other, known[block])
            load[-1] = 0.0
        load = np.maximum(load[block], load[other])
        # Blocks without load get a small fraction of the mean; without any loads the unit is arbitrary.
        load = np.maximum(load, 1e-3 * load.mean()) if load.any() else np.ones(len(some))
        self._unit = load * load / self._kn
        self._room = equations.room
        self._unknowns = start.copy()
        # Gap and motion along the edge without contact forces.
        apart, along = moved(start, *self._at).T
        self._g = gap[some] + apart - springs.lift[some] * along
        self._s = along - found.shear[some] / self._ks
        self._load = max(float(np.abs(left).max()), 1e-300)
        mean = float(np.mean(forces[some] ** 2 / self._kn / self._unit)) if len(some) else 0.0
        self._start = max(self._solver.path_start * mean, self._solver.path_least_start)
        self._begin(self._start)

    @property
    def stopped(self) -> bool:
        """Whether contacts had to be centred again."""
        return self._lone + self._again > 0

    @property
    def arrived(self) -> bool:
        """Whether ε has reached round-off."""
        return self.ended and not self.epsilon > _END

    @property
    def unknowns(self) -> np.ndarray:
        """(6 n,) the present motion."""
        return self._unknowns

    def _begin(self, epsilon: float) -> None:
        """Start with ``epsilon``, centred about the present motion."""
        self.epsilon, self.missed, self.ended = epsilon, 1.0, not len(self._some)
        self._again, self._lone = 0, 0
        self._centre(epsilon * self._unit)

    def _centre(self, epsilon: np.ndarray) -> None:
        """Set forces, gaps and slips (n,) consistent with the present motion and with all products equal to ``epsilon``
        (n,) J."""
        # Roots of w² − g w = ε/kₙ and of the equation for N/kₙ; the smaller one follows from their product ε/kₙ,
        # without cancellation.
        larger = 0.5 * (np.sqrt(self._g**2 + 4.0 * epsilon / self._kn) + np.abs(self._g))
        smaller = epsilon / self._kn / larger
        self._width = np.where(self._g > 0.0, larger, smaller)
        self._normal = self._kn * np.where(self._g > 0.0, smaller, larger)
        strength = self._mu * self._normal + self._base
        low, high = -strength, strength
        # S cannot be closer to the strength than its round-off, and the difference is a divisor.
        least = LEAST_LEFT * strength
        for _ in range(50):
            shear = 0.5 * (low + high)
            below, above = np.maximum(strength + shear, least), np.maximum(strength - shear, least)
            less = shear / self._ks + self._s < epsilon / below - epsilon / above
            low, high = np.where(less, shear, low), np.where(less, high, shear)
        self._shear = np.where(self._rough, 0.5 * (low + high), 0.0)
        self._slip = epsilon / np.stack(self._left())

    def _left(self) -> tuple[np.ndarray, np.ndarray]:
        """Remaining strength against sliding in either direction, N: above and below S."""
        strength = self._mu * self._normal + self._base
        least = LEAST_LEFT * strength
        return np.maximum(strength - self._shear, least), np.maximum(strength + self._shear, least)

    def advance(self) -> int:
        """Make one iteration; returns the number of undecided contacts. Raises numpy.linalg.LinAlgError."""
        if self.ended:
            return 0
        self.taken += 1
        pattern, steps, unit, solver = self._pattern, self._steps, self._unit, self._solver
        total = steps.linearise(
            Variables(self._normal, self._width, self._slip, self._shear, self._g, self._s),
            PathSprings(self._kn, self._ks, self._mu, self._base, self._rough, unit),
            (self._right - pattern.without_contacts(self._matrix, self._unknowns)).ravel(),
        )
        epsilon = total / float((1 + 2 * self._rough).sum())
        residual, laws = steps.residual, steps.laws
        kn_bonded, ks_bonded, gap_bonded, before_bonded = self._bonds
        springs = list(np.ascontiguousarray(laws.T[1:]))
        if len(kn_bonded):
            apart, along = moved(self._unknowns, *self._bonded_at).T
            apart = apart - self._all_lift[len(self._kn) :] * along
            pulled, sheared = -kn_bonded * (gap_bonded + apart), before_bonded - ks_bonded * along
            add_forces(residual, *self._bonded_at, pulled, sheared)
            springs = [
                np.concatenate(pair)
                for pair in zip(springs, (kn_bonded, ks_bonded, np.zeros(len(kn_bonded))), strict=True)
            ]
        stiff, stiff_along, slope = springs
        data = self._room()
        assembly.assemble(
            pattern, data, self._matrix, ContactMotion(*self._all_at),
            ContactStiffness(stiff, stiff_along, slope, self._all_lift), (self._upper, self._lower), self._sides,
        )  # fmt: skip
        solution = solution_of(pattern, data)

        def solve(side: np.ndarray) -> np.ndarray:
            return solution(side, WITHIN)

        steps.predict(solve)
        steps.accept()
        target = epsilon * (steps.products() / total) ** 3
        far = steps.correct(solve, target)
        steps.accept()
        for _ in range(solver.path_correctors):
            if far > _FAR:
                break
            wanted = min(1.0, _FARTHER * far + _FURTHER)
            if steps.centre(solve, target, wanted) < far + _GAIN * (wanted - far):
                break
            steps.accept()
            far = steps.step.far
        alone = None
        if far < _ALONE_SHORT and self._lone < _ALONE_AGAIN:
            far, alone = self._without_few(steps.numbers.T, steps.step.changed.T, far)
        self._unknowns += far * steps.step.unknowns
        undecided = steps.go(far)
        self.missed = (1.0 - far) * float(np.abs(residual).max()) / self._load
        if alone is not None:
            self._lone += 1
            self._centre_alone(alone, max(epsilon, min(_ALONE_LARGER * epsilon, self._start)))
        self.epsilon = epsilon
        if epsilon > _END and self._again < solver.path_recentred and not far > _STUCK:
            self._again += 1
            self.epsilon = solver.path_recentred_larger**self._again * epsilon
            self._centre(self.epsilon * unit)
            return len(self._g)
        self.ended = not (epsilon > _END and far > _STUCK)
        return undecided

    def _without_few(self, numbers: np.ndarray, changed: np.ndarray, far: float) -> tuple[float, np.ndarray | None]:
        """Step length of the changes (6, n) without a few limiting contacts, and these (n,) bool; ``far`` and None if
        there are many."""
        falling = changed < 0.0
        falling[2:] &= self._rough
        reach = np.where(falling, -numbers / np.where(falling, changed, -1.0), np.inf).min(axis=0)
        few = reach < _ALONE_FAR
        if few.sum() > max(_ALONE_FEW, _ALONE * len(few)):
            return far, None
        return min(1.0, SHORT_OF * float(reach[~few].min(initial=np.inf))), few

    def _centre_alone(self, which: np.ndarray, epsilon: float) -> None:
        """`_centre` for the contacts ``which`` only. The next step removes the resulting imbalance."""
        known = self._normal, self._width, self._shear, self._slip
        self._centre(epsilon * self._unit)
        again = self._normal, self._width, self._shear, self._slip
        self._normal, self._width, self._shear, self._slip = (
            np.where(which, new, old) for new, old in zip(again, known, strict=True)
        )
        self.missed = 1.0

    def states(self) -> tuple[np.ndarray, np.ndarray]:
        """States and directions (n,) that the contacts approach."""
        above, below = self._left()
        sliding = np.where(self._ks * self._slip[0] > above, 1.0, np.where(self._ks * self._slip[1] > below, -1.0, 0.0))
        closed = np.where(self._rough & (sliding == 0.0), STICK, SLIP)
        state, direction = np.full(self._n, OPEN), np.zeros(self._n)
        state[self._bonded] = STICK
        state[self._some] = np.where(self._kn * self._width > self._normal, OPEN, closed)
        direction[self._some] = np.where(self._rough & (state[self._some] == SLIP), sliding, 0.0)
        return state, direction
