"""Frictional contact of crack faces: which nodes are open, stick or slip, and the jumps that go with it.

With λ = right − S w the pressure and shear between the faces (`schur_complement`; the traction on them is −λ), every
node satisfies one linear equation in each direction, according to its state:

    open         λ_n = 0,  λ_t = 0
    closed       w_n = −a                     or, filled,  λ_n = −κ_n (w_n + a)
    stick        w_t = rest                   or, filled,  λ_t = −κ_s (w_t − rest)
    slip (±)     λ_t = ∓(c + λ_n tan φ)

and the inequalities gap ≥ 0, λ_n ≥ 0 (cemented: ≥ −strength), |λ_t| ≤ c + λ_n tan φ, with slip opposed to its shear.
All nodes that violate one change state at once: Newton's method for the semismooth equations (Alart & Curnier 1991),
which needs a handful of solutions however many cracks interact. If it cycles, the shear limits are frozen (Tresca
friction, solved one node at a time if need be) and updated in turn (Panagiotopoulos 1975), and Newton's method starts
again from there. The result satisfies all inequalities to the tolerance; `Missed` names the nodes that do not (in
blades of rock thinner than the elements no state may fit), and NotConverged is raised if there are too many.

`rest` is the slip left by the last load: the result is one step, implicit in time, of a history-dependent process.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..counters import Work
from ..iterative.crack_gmres import Iterated, IterativeCrackSystem
from ..system.closed_face_factor import HeldFactor
from ..system.contact_rows import Rows
from ..system.dense_lu import Factor
from ..system.schur_complement import CrackSystem
from .face_laws import FaceLaws, FaceMemory, FaceStates, Released
from .frictionless_contact import NotConverged

#: Smallest load, Pa; strengths divided by it are still finite.
NO_STRESS = 1e-100
#: Allowed violation, relative to the largest stress (and the opening it causes).
TOLERANCE = 1e-10
#: Newton steps without a new minimum of violated nodes before the limits are frozen, and most steps in total.
_PATIENCE, _PASSES = 12, 2000
#: Most updates of frozen limits, and their tolerance relative to the largest stress.
_FREEZES, _FROZEN_TOLERANCE = 60, 1e-6
#: Most single changes, per node.
_ONE_BY_ONE = 3
#: Number of states whose factors are kept.
_KEPT = 8
#: Fraction of changed prescribed jumps below which only the changes are multiplied.
FEW_CHANGED = 0.1


class Missed(NamedTuple):
    """``undecided`` (n_nodes,) bool: nodes without a consistent state; ``violation``: largest violation, relative to
    the largest stress."""

    undecided: np.ndarray
    violation: float


class FaceEquations:
    """The linear equations of nodes in given states: ``system`` with rows and columns changed according to ``laws``."""

    def __init__(self, system: CrackSystem | IterativeCrackSystem, laws: FaceLaws, work: Work):
        self.system, self.laws, self._work = system, laws, work
        self._factors: dict[bytes, tuple[np.ndarray, Factor | HeldFactor | Iterated]] = {}
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        self._pull: tuple[np.ndarray, np.ndarray] | None = None

    def solve(
        self, right: np.ndarray, states: FaceStates, memory: FaceMemory, limit: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Jumps and λ (n,) under ``right`` (n,); ``limit`` (n_nodes,) replaces the shear limit of slipping nodes."""
        laws, s = self.laws, self.system.matrix
        prescribed, slides, spring = self._rows(states, limit is not None)
        a, t = laws.across, laws.along
        w, extra = np.zeros_like(right), np.zeros_like(right)
        w[a[states.closed]] = -laws.aperture[states.closed]
        w[t] = np.where(prescribed[t], memory.rest, 0.0)
        w[~prescribed] = 0.0
        bound = laws.cohesive_strength(memory.broken) if limit is None else limit
        bound = np.where(states.way != 0, bound, 0.0)  # it may be infinite where nothing slips
        free, factor = self._factor(states, limit is not None)
        if isinstance(factor, HeldFactor):
            extra[t] = states.way * bound
            w, reaction = factor.respond(self._opened(right, factor), extra, w)
            reaction[t] = np.where(states.way != 0, -(extra[t] + slides * reaction[a]), reaction[t])
            return w, reaction
        extra[t] = states.way * bound + slides * right[a]
        extra[a] += spring[a] * laws.aperture
        extra[t] -= spring[t] * memory.rest
        pull = self._pull_of(w)
        known = right + extra - pull
        known[t] -= slides * pull[a]
        w[free] = factor.solve(known[free])
        self._work.back_substitutions += 1
        reaction = np.zeros_like(right)
        missing = right - s @ w
        closed = states.closed
        reaction[a[closed]] = missing[a[closed]]
        filled = spring[a] > 0
        reaction[a[filled]] = -(spring[a] * (w[a] + laws.aperture))[filled]
        stuck = prescribed[t]
        reaction[t[stuck]] = missing[t[stuck]]
        springy = spring[t] > 0
        reaction[t[springy]] = -(spring[t] * (w[t] - memory.rest))[springy]
        slipping = states.way != 0
        reaction[t[slipping]] = -(states.way * bound + slides * reaction[a])[slipping]
        return w, reaction

    def _pull_of(self, w: np.ndarray) -> np.ndarray:
        """S ``w`` of prescribed jumps; updated, since few of them change from state to state."""
        if self._pull is not None:
            changed = np.flatnonzero(w != self._pull[0])
            if len(changed) < FEW_CHANGED * len(w):
                if len(changed):
                    step = w[changed] - self._pull[0][changed]
                    pull = self._pull[1] + self.system.matrix.entries(np.arange(len(w)), changed) @ step
                    self._pull = w.copy(), pull
                return self._pull[1]
        pull = self.system.matrix @ w if w.any() else np.zeros_like(w)
        if not isinstance(self.system, IterativeCrackSystem):
            self._pull = w.copy(), pull
        return pull

    def _opened(self, right: np.ndarray, factor: HeldFactor) -> np.ndarray:
        """S⁻¹ ``right``, computed once per load."""
        if self._last is None or self._last[0] is not right:
            self._work.back_substitutions += 1
            self._last = right, factor.open.solve(right)
        return self._last[1]

    def tangent(self, right: np.ndarray, states: FaceStates) -> np.ndarray:
        """(n, k) change of the jumps per change of ``right`` (n, k) at constant states."""
        w = np.zeros_like(right)
        free, factor = self._factor(states, False)
        w[free] = factor.solve(np.asfortranarray(self._mixed(right, states)[free]))
        self._work.back_substitutions += right.shape[1]
        return w

    def adjoint(self, weights: np.ndarray, states: FaceStates) -> np.ndarray:
        """(n, k) y with ``weights``ᵀ w = yᵀ ``right`` at constant states (adjoint solution)."""
        laws = self.laws
        free, factor = self._factor(states, False)
        out = np.zeros_like(weights)
        out[free] = factor.solve(weights[free], transposed=True)
        self._work.back_substitutions += weights.shape[1]
        out[laws.across] += self._rows(states, False)[1][:, None] * out[laws.along]
        return out

    def rcond(self, states: FaceStates) -> float:
        return self._factor(states, False)[1].rcond

    def _mixed(self, right: np.ndarray, states: FaceStates) -> np.ndarray:
        out = right.copy()
        out[self.laws.along] += self._rows(states, False)[1][:, None] * right[self.laws.across]
        return out

    def _rows(self, states: FaceStates, frozen: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Prescribed unknowns (n,) bool, ± tan φ of sliding nodes (n_nodes,), stiffness of springs (n,)."""
        laws = self.laws
        prescribed, spring = np.zeros(self.system.n, bool), np.zeros(self.system.n)
        filled = np.isfinite(laws.normal)
        prescribed[laws.across] = states.closed & ~filled
        spring[laws.across] = np.where(states.closed & filled, laws.normal, 0.0)
        sticks, soft = states.closed & laws.rough & (states.way == 0), np.isfinite(laws.shear)
        prescribed[laws.along] = sticks & ~soft
        spring[laws.along] = np.where(sticks & soft, laws.shear, 0.0)
        slides = states.way * np.where(states.pulled | frozen, 0.0, laws.friction)
        return prescribed, slides, spring

    def _factor(self, states: FaceStates, frozen: bool) -> tuple[np.ndarray, Factor | Iterated]:
        key = states.key + bytes([frozen])
        if key not in self._factors:
            if len(self._factors) >= _KEPT:
                self._factors.pop(next(iter(self._factors)))
            prescribed, slides, spring = self._rows(states, frozen)
            mixed = np.zeros(self.system.n)
            mixed[self.laws.along] = slides
            self._factors[key] = self.system.changed(Rows(prescribed, mixed, spring, self.laws.elements.per))
        return self._factors[key]


class _Contact:
    """The search for the contact states under one load."""

    def __init__(self, equations: FaceEquations, right: np.ndarray, memory: FaceMemory):
        self.equations, self.laws, self.right, self.memory = equations, equations.laws, right, memory
        self.broken = memory.broken.copy()
        self.length = float(self.laws.elements.length.max())
        # Without load the slip left behind is the only scale.
        left = 1e-8 * float(np.abs(memory.rest).max(initial=0.0)) / self.length
        self.stress = max(float(np.abs(right).max()), left, NO_STRESS)
        self.solves = 0
        #: (n_nodes,) nodes without a consistent state.
        self.undecided = np.zeros(len(memory.broken), bool)
        #: Largest violation of their laws, relative to the largest stress.
        self.violation = 0.0

    @property
    def _now(self) -> FaceMemory:
        return replace(self.memory, broken=self.broken)

    def first_guess(self) -> FaceStates:
        """States of isolated faces: exact for a straight crack under uniform stress."""
        laws = self.laws
        pressure, shear = self.right[laws.across], -self.right[laws.along]
        cemented = laws.cemented(self.broken)
        closed = laws.closes & ((laws.aperture == 0) & (pressure > 0) | cemented)
        way = np.where(closed & laws.rough & (np.abs(shear) > laws.limit(pressure, self.broken)), np.sign(shear), 0)
        return FaceStates(closed, way.astype(np.int8), cemented & (pressure < 0))

    def admissible(self, states: FaceStates) -> FaceStates:
        """``states`` restricted to those that the laws allow."""
        closed = states.closed & self.laws.closes | self.laws.cemented(self.broken)
        way = np.where(closed & self.laws.rough, states.way, 0).astype(np.int8)
        return FaceStates(closed, way, states.pulled & self.laws.cemented(self.broken))

    def _respond(self, states: FaceStates, limit: np.ndarray | None):
        self.solves += 1
        if self.solves > _PASSES:
            raise NotConverged(f"crack faces did not settle in {_PASSES} solves{self.report}", self.node)
        return self.equations.solve(self.right, states, self._now, limit)

    report, node = "", None

    def _next(self, states: FaceStates, w: np.ndarray, reaction: np.ndarray, limit: np.ndarray | None) -> tuple:
        """The states that ``w`` and ``reaction`` require, the nodes that change, and the largest violation."""
        laws, tol = self.laws, TOLERANCE
        gap = (w[laws.across] + laws.aperture) / (self.stress * self.length)
        pressure, shear = reaction[laws.across] / self.stress, -reaction[laws.along] / self.stress
        cemented = laws.cemented(self.broken)
        lifts = states.closed & ~cemented & (pressure < -tol)
        meets = ~states.closed & laws.closes & (gap < -tol)
        closed = states.closed & ~lifts | meets
        pulled = closed & cemented & np.where(states.pulled, pressure < tol, pressure < -tol)
        bound = laws.limit(pressure * self.stress, self.broken) if limit is None else limit
        bound = bound / self.stress
        over = np.abs(shear) - bound
        slip = (w[laws.along] - self._offset(states, reaction) - self.memory.rest) / (self.stress * self.length)
        way = states.way.copy()
        stuck = states.closed & laws.rough & (way == 0)
        starts = stuck & (over > tol)
        way[starts] = np.sign(shear[starts])
        back = (states.way != 0) & (states.way * slip < -tol)
        way[back] = 0
        # Faces that close were free to slip, and are assumed to continue.
        way[meets & laws.rough] = np.sign(slip[meets & laws.rough])
        way[~closed] = 0
        if limit is None:
            # A limit cannot be negative: cement in tension has no friction, other faces open.
            changed = (closed != states.closed) | (way != states.way) | (pulled != states.pulled)
        else:
            pulled = states.pulled
            changed = (closed != states.closed) | (way != states.way)
        worst = max(
            np.max(-pressure, where=lifts, initial=0.0),
            np.max(-gap, where=meets, initial=0.0),
            np.max(over, where=starts, initial=0.0),
            np.max(np.abs(slip), where=back, initial=0.0),
        )
        return FaceStates(closed, way, pulled), changed, worst

    def _offset(self, states: FaceStates, reaction: np.ndarray) -> np.ndarray:
        """Slip carried by shear springs at slipping nodes."""
        soft = np.isfinite(self.laws.shear) & (states.way != 0)
        stiffness = np.where(soft, self.laws.shear, 1.0)
        return np.where(soft, -reaction[self.laws.along] / stiffness, 0.0)

    def newton(self, states: FaceStates, limit: np.ndarray | None = None, single: bool = False):
        """(states, w, λ) that satisfy all inequalities; None when the iteration cycles. ``single``: from then on one
        node at a time, which converges for frozen limits (Murty 1974)."""
        best, patience, one = len(states.closed) + 1, _PATIENCE, False
        been: list[FaceStates] = []
        while True:
            w, reaction = self._respond(states, limit)
            new, changed, worst = self._next(states, w, reaction, limit)
            disputed = changed & self.undecided
            changed &= ~self.undecided
            n = int(changed.sum())
            self.report = f"; {n} nodes are in violation, by {worst:.1e} of the largest stress"
            if n == 0:
                # Nodes that alternated earlier may have found their states since.
                self.undecided = disputed
                self.violation = worst if disputed.any() else 0.0
                return states, w, reaction
            self.node = int(np.flatnonzero(changed)[-1])
            if n < best:
                best, patience = n, _PATIENCE
            else:
                patience -= 1
            if patience <= 0:
                if not single:
                    return None
                one = True
            if one:
                been.append(states)
                if self._turns(been):
                    been.clear()
                    continue
                keep = np.zeros(len(changed), bool)
                keep[np.flatnonzero(changed)[-1]] = True
                new = FaceStates(
                    np.where(keep, new.closed, states.closed),
                    np.where(keep, new.way, states.way),
                    np.where(keep, new.pulled, states.pulled),
                )
            states = new

    def _turns(self, been: list[FaceStates]) -> bool:
        """Whether single changes have returned to earlier states (``been``) or take too many steps; the nodes that
        alternate are undecided from then on. (Where a blade of rock is thinner than its elements no consistent state
        may exist.)"""
        last = been[-1]
        first = next((k for k, state in enumerate(been[:-1]) if state.key == last.key), None)
        if first is None:
            if len(been) < _ONE_BY_ONE * len(last.closed):
                return False
            first = max(0, len(been) - len(last.closed) // 4)
        for state in been[first:]:
            self.undecided |= (state.closed != last.closed) | (state.way != last.way)
        return True

    def settle(self, states: FaceStates):
        """(states, w, λ) with the cement that is still intact."""
        self.violation = 0.0
        found = self.newton(states)
        if found is not None:
            return found
        limit = np.zeros(len(states.closed))
        for freeze in range(1, _FREEZES + 1):
            states, _, reaction = self.newton(states, limit, single=True)
            now = self.laws.limit(reaction[self.laws.across], self.broken)
            # Close enough: Newton's method replaces many more updates.
            if (
                freeze % 4 == 0
                or np.abs(now - limit)[np.isfinite(now)].max(initial=0.0) < _FROZEN_TOLERANCE * self.stress
            ):
                found = self.newton(states)
                if found is not None:
                    return found
            limit = now
        raise NotConverged(f"crack faces did not settle under friction{self.report}", self.node)


def settle_rough(
    equations: FaceEquations, right: np.ndarray, memory: FaceMemory, guess: FaceStates | None = None
) -> tuple[np.ndarray, np.ndarray, FaceMemory, int, Missed]:
    """Contact of faces with friction, cement or filling.

    ``right`` (n,): traction of fluid in the cracks minus that of the loads on closed faces; ``memory`` of the last
    load; ``guess``: initial states, by default those of isolated faces. Returns slip and opening (times 2μ), λ = right
    − S w, the new memory, the number of solves, and the remaining violations. Raises NotConverged.
    """
    laws = equations.laws
    contact = _Contact(equations, right, memory)
    states = contact.first_guess() if guess is None else contact.admissible(guess)
    while True:
        states, w, reaction = contact.settle(states)
        cemented = laws.cemented(contact.broken)
        if not cemented.any():
            break
        drive = -reaction[laws.across] / np.where(cemented, laws.strength, np.inf)
        if not drive.max() > 1 + TOLERANCE:
            break
        # The most stressed nodes break first, and the others are judged after that.
        contact.broken |= cemented & (drive > max(1.0, 0.9 * drive.max()))
        states = contact.admissible(FaceStates(states.closed & ~contact.broken, states.way, states.pulled))
    slip = w[laws.along]
    holds = states.closed & laws.rough
    rest = np.where(holds, slip - contact._offset(states, reaction), slip)
    sticks = holds & (states.way == 0)
    rest[sticks] = memory.rest[sticks]
    # Shear limit during the step: mean of the limits before and after (0 before faces have closed). Second order in the
    # load step, and exact for a constant limit.
    pressure = np.where(states.closed, reaction[laws.across], 0.0)
    slides = states.way != 0  # nodes that cannot slip have an infinite limit
    before = np.where(slides, laws.limit(memory.pressure, contact.broken), 0.0)
    lost = np.where(slides, 0.5 * (states.way * before - reaction[laws.along]) * (rest - memory.rest), 0.0)
    shear = np.where(states.closed, -reaction[laws.along], 0.0)
    weights = laws.elements.quadrature.ravel() / laws.twice_mu
    work = memory.work + float(weights @ lost)
    # Faces that stuck at the beginning of the step, and slip at its end, were below their limit before.
    untouched = not memory.states.closed.any() and not memory.rest.any()
    stuck = memory.states.closed & (memory.states.way == 0) | laws.cemented(memory.broken)
    stuck |= untouched & laws.closes & (laws.aperture == 0)
    slips = np.where(stuck & slides, lost - 0.5 * (memory.shear - reaction[laws.along]) * (rest - memory.rest), 0.0)
    breaks = contact.broken & ~memory.broken
    bond, ahead = _breaking(laws, memory, w, pressure, shear, lost) if breaks.any() else np.zeros((2, len(lost)))
    new = float(weights[breaks] @ bond[breaks]), float(weights @ np.where(breaks, 0.0, slips))
    released = Released(*(a + b for a, b in zip(memory.released, (*new, float(weights[breaks] @ ahead[breaks])))))
    now = FaceMemory(laws.elements, rest, contact.broken, work, states, pressure, shear, released)
    return w, reaction, now, contact.solves, Missed(contact.undecided, contact.violation)


def _breaking(
    laws: FaceLaws, memory: FaceMemory, w: np.ndarray, pressure: np.ndarray, shear: np.ndarray, lost: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n_nodes,) energy released by cement that has broken since the load of ``memory``, and the amount by which it and
    the friction loss (``lost``) exceed the mean of the tractions at both loads (times 2μ, J/m²)."""
    pull_a, pull_b = -memory.pressure, -pressure
    strength = np.maximum(laws.strength, pull_a)
    parted = w[laws.across] + laws.aperture
    wide_a, wide_s = pull_a / laws.normal, strength / laws.normal
    slid_a = memory.shear / laws.shear
    moved = w[laws.along] - memory.rest - slid_a
    stored_a, stored_s = 0.5 * pull_a * wide_a, 0.5 * strength * wide_s
    stored_b = stored_by_fillings(laws, pressure, np.zeros_like(shear))
    released = 0.5 * (strength + pull_b) * (parted - wide_s)
    by_pull = released + stored_s - stored_b
    sheared = 0.5 * (memory.shear + shear) * moved + 0.5 * memory.shear * slid_a - 0.5 * shear * shear / laws.shear
    by_shear = np.maximum(sheared - lost, 0.0)
    ahead = released + stored_s - stored_a - 0.5 * (pull_a + pull_b) * (parted - wide_a)
    return by_pull + by_shear, ahead + lost + by_shear - sheared


def stored_by_fillings(laws: FaceLaws, pressure: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """(n_nodes,) energy (times 2μ, J/m²) stored in fillings under ``pressure`` and ``shear``, Pa; 0 where faces are
    open."""
    return 0.5 * (shear * shear / laws.shear + pressure * pressure / laws.normal)
