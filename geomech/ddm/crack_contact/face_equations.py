"""Linear equations of crack faces in given contact states.

With λ = right − S w the pressure and shear between the faces (`schur_complement`; the traction on them is −λ), every
node satisfies one linear equation in each direction, according to its state:

    open         λ_n = 0,  λ_t = 0
    closed       w_n = −a                     or, filled,  λ_n = −κ_n (w_n + a)
    stick        w_t = rest                   or, filled,  λ_t = −κ_s (w_t − rest)
    slip (±)     λ_t = ∓(c + λ_n tan φ)

`rest` is the slip left by the last load: the result is one step, implicit in time, of a history-dependent process.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..counters import Work
from ..iterative.crack_gmres import Iterated, IterativeCrackSystem
from ..system.bordered_factor import BorderedFactor
from ..system.closed_face_factor import ClosedFaceFactor
from ..system.contact_rows import Rows
from ..system.dense_lu import Factor
from ..system.schur_complement import CrackSystem
from ..system.updated_factor import UpdatedFactor
from .face_laws import FaceLaws, FaceMemory, FaceStates

#: Solvers for the equations of given states.
AnyFactor = Factor | BorderedFactor | ClosedFaceFactor | UpdatedFactor | Iterated
#: Smallest load, Pa; strengths divided by it are still finite.
NO_STRESS = 1e-100
#: Number of states whose factors are kept.
_KEPT = 8
#: Fraction of changed prescribed jumps below which only the changes are multiplied.
FEW_CHANGED = 0.1


class FaceEquations:
    """The linear equations of nodes in given states: ``system`` with rows and columns changed according to ``laws``."""

    def __init__(self, system: CrackSystem | IterativeCrackSystem, laws: FaceLaws, work: Work):
        self.system, self.laws, self._work = system, laws, work
        #: Number of solutions since the beginning.
        self.solved = 0
        self._factors: dict[bytes, tuple[np.ndarray, AnyFactor]] = {}
        self._last: list[tuple[np.ndarray, np.ndarray]] = []
        self._pull: tuple[np.ndarray, np.ndarray] | None = None
        self._uniform: tuple[bytes, np.ndarray] | None = None

    def solve(
        self, right: np.ndarray, states: FaceStates, memory: FaceMemory, cohesion: np.ndarray | float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Jumps and λ, (n,) or (n, k), under ``right`` (n,) or (n, k). ``cohesion``, Pa, is added to that of the laws:
        one number, (n_nodes,) or (n_nodes, k)."""
        if right.ndim == 1:
            more = np.broadcast_to(cohesion, len(self.laws.along))
            w, reaction = self.solve(right[:, None], states, memory, more[:, None])
            return w[:, 0], reaction[:, 0]
        laws, s = self.laws, self.system.matrix
        self.solved += right.shape[1]
        prescribed, slides, spring = self.rows(states)
        a, t = laws.across, laws.along
        w, extra = np.zeros_like(right), np.zeros_like(right)
        given = np.zeros(len(right))
        given[a[states.closed]] = -laws.aperture[states.closed]
        given[t] = np.where(prescribed[t], memory.rest, 0.0)
        given[~prescribed] = 0.0
        slipping = states.way != 0
        bound = laws.cohesive_strength(memory.broken)[:, None] + cohesion
        # It may be infinite where nothing slips.
        shear = states.way[:, None] * np.where(slipping[:, None], bound, 0.0)
        free, factor = self._factor(states)
        if isinstance(factor, ClosedFaceFactor):
            extra[t] = shear
            reaction = np.empty_like(right)
            for k in range(right.shape[1]):
                w[:, k], reaction[:, k] = factor.respond(self._opened(right[:, k], factor), extra[:, k], given)
            reaction[t] = np.where(slipping[:, None], -(shear + slides[:, None] * reaction[a]), reaction[t])
            return w, reaction
        w[:] = given[:, None]
        extra[t] = shear + slides[:, None] * right[a]
        extra[a] += (spring[a] * laws.aperture)[:, None]
        extra[t] -= (spring[t] * memory.rest)[:, None]
        pull = self._pull_of(given)
        known = right + extra - pull[:, None]
        known[t] -= (slides * pull[a])[:, None]
        w[free] = factor.solve(np.asfortranarray(known[free]))
        self._work.back_substitutions += right.shape[1]
        reaction = np.zeros_like(right)
        # Products of compressed matrices take one column at a time.
        compressed = isinstance(self.system, IterativeCrackSystem)
        missing = right - (np.stack([s @ of for of in w.T], axis=1) if compressed else s @ w)
        closed = states.closed
        reaction[a[closed]] = missing[a[closed]]
        filled = spring[a] > 0
        reaction[a[filled]] = -(spring[a][:, None] * (w[a] + laws.aperture[:, None]))[filled]
        stuck = prescribed[t]
        reaction[t[stuck]] = missing[t[stuck]]
        springy = spring[t] > 0
        reaction[t[springy]] = -(spring[t][:, None] * (w[t] - memory.rest[:, None]))[springy]
        reaction[t[slipping]] = -(shear + slides[:, None] * reaction[a])[slipping]
        return w, reaction

    def keep_last(self) -> None:
        """Give up the factors of all states but the last two, those under the loads and under the mean stress of a block."""
        self._factors = dict(list(self._factors.items())[-2:])

    def forget(self) -> None:
        """Give up the factors of all states."""
        self._factors, self._last, self._pull, self._uniform = {}, [], None, None

    def _pull_of(self, w: np.ndarray) -> np.ndarray:
        """S ``w`` of prescribed jumps; updated incrementally, since few of them change between states."""
        if self._pull is not None and not isinstance(self.system, IterativeCrackSystem):
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

    def _opened(self, right: np.ndarray, factor: ClosedFaceFactor) -> np.ndarray:
        """S⁻¹ ``right``, computed once for each of the last two loads."""
        for known, opened in self._last:
            if np.array_equal(known, right):
                return opened
        self._work.back_substitutions += 1
        opened = factor.open.solve(right)
        self._last = [*self._last[-1:], (right, opened)]
        return opened

    def tangent(self, right: np.ndarray, states: FaceStates) -> np.ndarray:
        """(n, k) change of the jumps per change of ``right`` (n, k) at constant states."""
        w = np.zeros_like(right)
        free, factor = self._factor(states)
        w[free] = factor.solve(np.asfortranarray(self._mixed(right, states)[free]))
        self._work.back_substitutions += right.shape[1]
        return w

    def uniform_tangent(self, right: np.ndarray, states: FaceStates) -> np.ndarray:
        """`tangent` of the loads ``right`` (n, 3) of unit uniform stresses, which are always the same; the last one is
        kept."""
        if self._uniform is None or self._uniform[0] != states.key:
            self._uniform = states.key, self.tangent(right, states)
        return self._uniform[1]

    def tangent_reaction(self, right: np.ndarray, jumps: np.ndarray, states: FaceStates) -> np.ndarray:
        """(n, k) change of λ that goes with the change of the ``jumps`` (n, k), the `tangent` of ``right`` (n, k)."""
        laws, (prescribed, slides, spring) = self.laws, self.rows(states)
        a, t = laws.across, laws.along
        missing = right - self.system.matrix @ jumps
        reaction = np.where(prescribed[:, None], missing, -spring[:, None] * jumps)
        slipping = states.way != 0
        reaction[t[slipping]] = -(slides[:, None] * reaction[a])[slipping]
        return reaction

    def adjoint(self, weights: np.ndarray, states: FaceStates) -> np.ndarray:
        """(n, k) y with ``weights``ᵀ w = yᵀ ``right`` at constant states (adjoint solution)."""
        laws = self.laws
        free, factor = self._factor(states)
        out = np.zeros_like(weights)
        out[free] = factor.solve(weights[free], transposed=True)
        self._work.back_substitutions += weights.shape[1]
        out[laws.across] += self.rows(states)[1][:, None] * out[laws.along]
        return out

    def unit_responses(self, unknowns: np.ndarray, states: FaceStates) -> tuple[np.ndarray, np.ndarray]:
        """(n, k) jumps and λ at constant states for a unit on the right of the equations of ``unknowns`` (k,), one at a time: of
        its jump where it is prescribed, of λ otherwise. Of faces without fillings."""
        assert not isinstance(self.system, IterativeCrackSystem)
        laws, (prescribed, slides, _) = self.laws, self.rows(states)
        free, factor = self._factor(states)
        w = np.zeros((self.system.n, len(unknowns)), order="F")
        known = np.zeros_like(w)
        at, fixed = np.arange(len(unknowns)), prescribed[unknowns]
        w[unknowns[fixed], at[fixed]] = 1.0
        known[:, fixed] = -self.system.matrix.entries(np.arange(self.system.n), unknowns[fixed])
        known[laws.along] += slides[:, None] * known[laws.across]
        known[unknowns[~fixed], at[~fixed]] = -1.0
        w[free] = factor.solve(np.asfortranarray(known[free]))
        self._work.back_substitutions += len(unknowns)
        return w, -(self.system.matrix @ w)

    def rcond(self, states: FaceStates) -> float:
        return self._factor(states)[1].rcond

    def _mixed(self, right: np.ndarray, states: FaceStates) -> np.ndarray:
        out = right.copy()
        out[self.laws.along] += self.rows(states)[1][:, None] * right[self.laws.across]
        return out

    def rows(self, states: FaceStates) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Prescribed unknowns (n,) bool, ± tan φ of sliding nodes (n_nodes,), stiffness of springs (n,)."""
        laws = self.laws
        prescribed, spring = np.zeros(self.system.n, bool), np.zeros(self.system.n)
        filled = np.isfinite(laws.normal)
        prescribed[laws.across] = states.closed & ~filled
        spring[laws.across] = np.where(states.closed & filled, laws.normal, 0.0)
        sticks, soft = states.closed & laws.rough & (states.way == 0), np.isfinite(laws.shear)
        prescribed[laws.along] = sticks & ~soft
        spring[laws.along] = np.where(sticks & soft, laws.shear, 0.0)
        slides = states.way * np.where(states.pulled, 0.0, laws.friction)
        return prescribed, slides, spring

    def _factor(self, states: FaceStates) -> tuple[np.ndarray, AnyFactor]:
        key = states.key
        if key not in self._factors:
            if len(self._factors) >= _KEPT:
                self._factors.pop(next(iter(self._factors)))
            prescribed, slides, spring = self.rows(states)
            mixed = np.zeros(self.system.n)
            mixed[self.laws.along] = slides
            self._factors[key] = self.system.changed(Rows(prescribed, mixed, spring, self.laws.elements.per))
        else:
            self._factors[key] = self._factors.pop(key)  # the last
        return self._factors[key]


class FaceValues(NamedTuple):
    """Solution in given states: ``jumps`` and ``reaction`` λ (n,), and at the nodes (n_nodes,), relative to the stress
    and to the opening that goes with it: ``gap``, ``pressure``, ``shear`` and the ``slip`` since the last load."""

    jumps: np.ndarray
    reaction: np.ndarray
    gap: np.ndarray
    pressure: np.ndarray
    shear: np.ndarray
    slip: np.ndarray


@dataclass(frozen=True, eq=False)
class FaceProblem:
    """Faces under one load: their ``equations``, ``right`` (n,), the traction of fluid in the cracks minus that of the
    loads on closed faces, and the ``memory`` of the last load."""

    equations: FaceEquations
    right: np.ndarray
    memory: FaceMemory

    @property
    def laws(self) -> FaceLaws:
        return self.equations.laws

    @cached_property
    def length(self) -> float:
        """Length of the longest element, m."""
        return float(self.laws.elements.length.max())

    @cached_property
    def stress(self) -> float:
        """Largest load, Pa. Without load the slip left behind is the only scale."""
        left = 1e-8 * float(np.abs(self.memory.rest).max(initial=0.0)) / self.length
        return max(float(np.abs(self.right).max()), left, NO_STRESS)

    def solve(self, states: FaceStates) -> FaceValues:
        """Solution with the nodes in these ``states``."""
        return self.values(states, *self.equations.solve(self.right, states, self.memory))

    def values(self, states: FaceStates, w: np.ndarray, reaction: np.ndarray) -> FaceValues:
        """The solution with these jumps ``w`` and λ ``reaction`` (n,)."""
        laws = self.laws
        opening = self.stress * self.length
        return FaceValues(
            w, reaction,
            gap=(w[laws.across] + laws.aperture) / opening,
            pressure=reaction[laws.across] / self.stress,
            shear=-reaction[laws.along] / self.stress,
            slip=(w[laws.along] - self.spring_slip(states, reaction) - self.memory.rest) / opening,
        )  # fmt: skip

    def spring_slip(self, states: FaceStates, reaction: np.ndarray) -> np.ndarray:
        """(n_nodes,) slip carried by shear springs at slipping nodes (times 2μ)."""
        soft = np.isfinite(self.laws.shear) & (states.way != 0)
        stiffness = np.where(soft, self.laws.shear, 1.0)
        return np.where(soft, -reaction[self.laws.along] / stiffness, 0.0)
