"""Solutions in contact states that differ from given ones at a few nodes, without factors of their own.

In the states of a base, with jumps and tractions x₀ = (w, λ) under a load, let r_j be the response to a unit on the right of
the equation of unknown j (`face_equations`). In other states some unknowns J have other equations, e_i(x) = h_i. What stands
on the right of their equations in the base is unknown then:

    x = x₀ + Σ_J r_j y_j,        Σ_J e_i(r_j) y_j = h_i − e_i(x₀),   i ∈ J        (block elimination; Golub & Van Loan §3.2).

e_i is w_i of a prescribed jump, λ_i of a free one, and with the pressure of a sliding node λ_t + λ_n tan φ. Responses are
kept: states that follow each other, as on a path, take a system of the size of J, and sometimes a solution with the base's
factors, where a factor of every state, and products with S, take several times as long.
"""

from __future__ import annotations

import numpy as np

from ..iterative.crack_gmres import IterativeCrackSystem
from ..system.dense_lu import Factor
from ..system.updated_factor import TRUSTED, most_changed
from .face_equations import FaceProblem
from .face_laws import FaceStates

#: Error text for a singular system, which is not shown.
_SINGULAR = "the states have no solution"


class StateResponses:
    """Solutions of ``problem`` under two or more loads, the columns of ``right`` (n, k), with the further ``cohesion``
    (n_nodes, k), Pa. The states first asked for are the base, and others where they differ too much from the base."""

    def __init__(self, problem: FaceProblem, right: np.ndarray, cohesion: np.ndarray):
        self._problem, self._right, self._cohesion = problem, right, cohesion
        equations = problem.equations
        filled = np.isfinite(problem.laws.normal).any() or np.isfinite(problem.laws.shear).any()
        #: Whether each solution is found on its own: products of compressed matrices take one column at a time.
        self._each = bool(filled) or isinstance(equations.system, IterativeCrackSystem)
        self._base: _Base | None = None

    def solve(self, states: FaceStates) -> tuple[np.ndarray, np.ndarray]:
        """Jumps w and λ, (n, k) each, in these ``states``. Raises LinAlgError where they have none."""
        equations = self._problem.equations
        found = None if self._base is None else self._base.solve(states)
        if found is None:
            found = equations.solve(self._right, states, self._problem.memory, self._cohesion)
            self._base = None if self._each else _Base(self._problem, states, self._cohesion, found)
        else:
            equations.solved += self._right.shape[1]
        return found


class _Equations:
    """Which equation each unknown has in the ``states``: whether its jump is ``prescribed`` (n,) bool; otherwise the factor by
    which the pressure of its node is added (``mixed``), and the ``way`` (n,) in which its cohesion acts."""

    def __init__(self, problem: FaceProblem, states: FaceStates):
        laws, n = problem.laws, problem.equations.system.n
        self.prescribed, slides, _ = problem.equations.rows(states)
        self.mixed, self.way = np.zeros(n), np.zeros(n, np.int8)
        self.mixed[laws.along], self.way[laws.along] = slides, states.way

    def differ(self, other: _Equations) -> np.ndarray:
        """Unknowns with another equation in ``other``."""
        free = (self.mixed != other.mixed) | (self.way != other.way)
        return np.flatnonzero((self.prescribed != other.prescribed) | ~self.prescribed & free)


class _Base:
    """The ``states`` in which jumps and λ are ``found``, (n, k) each, and the responses in them."""

    def __init__(
        self, problem: FaceProblem, states: FaceStates, cohesion: np.ndarray, found: tuple[np.ndarray, np.ndarray]
    ):
        self._problem, self._states, self._found = problem, states, found
        self._equations = _Equations(problem, states)
        laws, n = problem.laws, problem.equations.system.n
        self._per = laws.elements.per
        # Values on the right: given jumps, and friction limits without pressure.
        self._given = np.zeros(n)
        self._given[laws.across], self._given[laws.along] = -laws.aperture, problem.memory.rest
        self._strength = np.zeros((n, found[0].shape[1]))
        strength = laws.cohesive_strength(problem.memory.broken)[:, None] + cohesion
        self._strength[laws.along] = np.where(np.isfinite(strength), strength, 0.0)
        self._row = np.full(n, -1)
        self._jumps, self._tractions, self._kept = np.empty((0, n)), np.empty((0, n)), 0

    def solve(self, states: FaceStates) -> tuple[np.ndarray, np.ndarray] | None:
        """Jumps and λ (n, k) in the ``states``; None if they are too different from the base or too close to singular."""
        own = _Equations(self._problem, states)
        items = self._equations.differ(own)
        (w, reaction), k = self._found, len(items)
        if not k:
            return self._found
        if k > most_changed(len(self._row)):
            return None
        self._respond(items)
        rows = self._row[items]
        fixed, mixed = own.prescribed[items], own.mixed[items]
        pressure = items + np.where(mixed != 0, self._per, 0)
        jumps, tractions = self._jumps[rows], self._tractions[rows]
        # (item, response): the equations of the items applied to the responses, and to the solution in the base.
        of = np.where(fixed, jumps[:, items], tractions[:, items] + mixed * tractions[:, pressure]).T
        now = np.where(fixed[:, None], w[items], reaction[items] + mixed[:, None] * reaction[pressure])
        bound = -own.way[items, None] * self._strength[items]
        size = np.abs(of).max(axis=0)
        scale = np.ldexp(1.0, -np.frexp(np.where(size > 0, size, 1.0))[1])
        try:
            factor = Factor(of * scale, _SINGULAR)
        except np.linalg.LinAlgError:
            return None
        if not factor.rcond > TRUSTED:
            return None
        wanted = np.where(fixed[:, None], self._given[items, None], bound)
        y = scale[:, None] * factor.solve(wanted - now)
        return w + jumps.T @ y, reaction + tractions.T @ y

    def _respond(self, items: np.ndarray) -> None:
        """Compute the responses of the unknowns ``items`` that are not known, with those of their elements: several take hardly
        longer than one, and states change from node to node."""
        missing = items[self._row[items] < 0]
        if not len(missing):
            return
        width = 2 * self._per
        missing = (np.unique(missing // width)[:, None] * width + np.arange(width)).ravel()
        missing = missing[self._row[missing] < 0]
        jumps, tractions = self._problem.equations.unit_responses(missing, self._states)
        first, self._kept = self._kept, self._kept + len(missing)
        if self._kept > len(self._jumps):
            self._jumps, self._tractions = (
                np.concatenate([known, np.empty((2 * self._kept - len(known), known.shape[1]))])
                for known in (self._jumps, self._tractions)
            )
        self._jumps[first : self._kept], self._tractions[first : self._kept] = jumps.T, tractions.T
        self._row[missing] = np.arange(first, self._kept)
