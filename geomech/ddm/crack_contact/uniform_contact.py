"""Contact of smooth crack faces under uniform stress, condensed to the nodes that can close.

Under the stress σ the gaps y of these nodes and the crack strain e are linear in σ and in the pressures λ at the nodes:

    y = M λ + B σ,    e = C λ + F σ,    y ≥ 0,  λ ≥ 0,  λᵀ y = 0,

a linear complementarity problem in three parameters. Its matrix is kept in the form that is solved for λ of the closed
and y of the open nodes (principal pivot transform, Cottle, Pang & Stone 1992, §2.3). In this form it follows from one
factorisation of the equations in some states. Nodes that change their states then exchange rows and columns by a product
of low rank; a stress in the same states takes a product with three columns; the last three rows are the compliance of
the cracks. States are found by block principal pivoting (`frictionless_contact`). Exchanges lose digits where a blade of
rock opens or closes: the solution is compared with the form first computed, which is computed again in the present
states if they differ.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..loads.uniform_stress_response import UniformStressSolution, kept_response, scales
from ..loads.unit_load_cache import on_elements
from ..system.bordered_factor import SINGULAR
from ..system.dense_lu import Factor
from .frictionless_contact import TOLERANCE

if TYPE_CHECKING:
    from ..interfaces import CrackedBody

#: Difference from the equations, relative to the scales of gaps and pressures, above which the matrix is computed again.
_EXACT = 1e-9
#: Most states tried.
_MOST = 50


class UniformContact:
    """The condensed contact of a ``body`` that `condenses`, first computed with the unknowns ``closed`` (n,) bool. Raises
    LinAlgError where cracks cut off a part that these do not hold."""

    def __init__(self, body: CrackedBody, closed: np.ndarray) -> None:
        self._body = body
        self._nodes = np.flatnonzero(body.closing[1])
        self._units = np.column_stack([-on_elements(body.faces, unit) for unit in np.eye(3)])
        self._length = float(body.faces.length.max())
        self._begin(closed[self._nodes])

    def _begin(self, closed: np.ndarray) -> None:
        """Compute the matrix with the nodes ``closed`` (k,) bool."""
        body, k = self._body, len(closed)
        shut, s = np.zeros(body.faces.n_unknowns, bool), body.crack_system.matrix
        shut[self._nodes] = closed
        f, c = np.flatnonzero(~shut), np.flatnonzero(shut)
        at = np.full(len(shut), -1)
        at[f] = np.arange(len(f))
        open_at = at[self._nodes[~closed]]
        # Columns: pressure at open nodes, gap of closed ones, stress.
        right = np.zeros((len(f), k + 3), order="F")
        right[open_at, np.flatnonzero(~closed)] = -1.0
        right[:, np.flatnonzero(closed)] = -s.entries(f, c)
        right[:, k:] = self._units[f]
        jumps = Factor(s.entries(f, f), SINGULAR, in_place=True).solve(right)
        body.work.crack_factorisations += 1
        body.work.back_substitutions += k + 3
        table = np.empty((k + 3, k + 3), order="F")
        table[np.flatnonzero(~closed)] = jumps[open_at]
        pressures = -(s.entries(c, f) @ jumps)
        pressures[:, np.flatnonzero(closed)] -= s.entries(c, c)
        pressures[:, k:] += self._units[c]
        table[np.flatnonzero(closed)] = pressures
        table[k:] = body.strain_weights[:, f] @ jumps
        table[k:, np.flatnonzero(closed)] += body.strain_weights[:, c]
        self._first, self._began = table, closed.copy()
        self._now, self._closed = table.copy(order="F"), closed.copy()

    def solve(self, stress: np.ndarray) -> UniformStressSolution | None:
        """Solution under ``stress`` (3,), Pa; None where changing all violated nodes at once cycles."""
        scale = max(float(np.abs(self._units @ stress).max()), np.finfo(float).tiny)
        visited: set[bytes] = set()
        k, changed = len(self._nodes), False
        while True:
            found = self._now[:k, k:] @ stress
            wrong = found < -TOLERANCE * self._scales(self._closed, scale)
            if not wrong.any():
                if not changed or self._exact(found, stress, scale):
                    break
                self._begin(self._closed)
                changed = False
                continue
            key = self._closed.tobytes()
            if key in visited or len(visited) > _MOST:
                return None
            visited.add(key)
            self._exchange(np.flatnonzero(wrong))
            changed = True
        self._body.work.solutions += 1
        self._body.work.contact_solves += len(visited) + 1
        return UniformStressSolution(self._body, kept_response(self._body, self._all_closed(), self._response), stress)

    def _scales(self, pressed: np.ndarray, scale: float) -> np.ndarray:
        """(k,) scales of pressures, Pa, where ``pressed``, and of gaps, times 2μ, elsewhere."""
        return np.where(pressed, scale, scale * self._length)

    def response(self, closed: np.ndarray) -> CondensedResponse:
        """Response with the unknowns ``closed`` (n,) bool."""
        self._exchange(np.flatnonzero(closed[self._nodes] != self._closed))
        return self._response(closed)

    def _exact(self, found: np.ndarray, stress: np.ndarray, scale: float) -> bool:
        """Whether ``found`` (k,), pressures of closed and gaps of open nodes, satisfy the equations as first computed."""
        k, began = len(self._nodes), self._began
        pressure, gap = np.where(self._closed, found, 0.0), np.where(self._closed, 0.0, found)
        by_first = self._first[:k] @ np.concatenate([np.where(began, gap, pressure), stress])
        left = np.abs(by_first - np.where(began, pressure, gap))
        return bool((left <= _EXACT * self._scales(began, scale)).all())

    def _exchange(self, nodes: np.ndarray) -> None:
        """Let ``nodes`` change from open to closed or back."""
        from scipy.linalg.blas import dgemm

        if not len(nodes):
            return
        own = np.ix_(nodes, nodes)
        inverse = np.linalg.inv(self._now[own])
        rows = self._now[nodes]
        left = self._now[:, nodes] @ inverse
        self._now = dgemm(-1.0, left, rows, 1.0, self._now, overwrite_c=True)
        self._now[:, nodes], self._now[nodes], self._now[own] = left, -inverse @ rows, inverse
        self._closed[nodes] ^= True

    def _all_closed(self) -> np.ndarray:
        """(n,) bool, the unknowns closed at present."""
        closed = np.zeros(self._body.faces.n_unknowns, bool)
        closed[self._nodes] = self._closed
        return closed

    def _response(self, closed: np.ndarray) -> CondensedResponse:
        """The response in the present states."""
        k = len(self._nodes)
        return CondensedResponse(self._body, closed, self._units, self._now[:, k:].copy(), self._closed.copy())


class CondensedResponse:
    """`UniformStressResponse` of a ``body`` with the faces ``closed`` (n,) bool, from its condensed contact: ``rows``
    (k + 3, 3) are pressures or gaps of the nodes that can close, ``shut`` (k,) or not, and the crack strain under unit
    stresses. Jumps are computed when they are asked for."""

    def __init__(
        self, body: CrackedBody, closed: np.ndarray, units: np.ndarray, rows: np.ndarray, shut: np.ndarray
    ) -> None:
        self._body, self.closed, self._units = body, closed, units
        self._rows, self._shut = rows[:-3], shut
        self._length = float(body.faces.length.max())
        self.strain = np.column_stack([rows[-3:], np.zeros(3)])
        # Closed faces have no opening, open ones no pressure: the work of σ is twice the energy.
        form = 0.25 * body.area * (rows[-3:] + rows[-3:].T)
        self.energy = np.zeros((4, 4))
        self.energy[:3, :3] = form

    @cached_property
    def jumps(self) -> np.ndarray:
        """(n, 4) as in `UniformStressResponse`."""
        jumps, _ = self._body.crack_system.constrained(self._units, self.closed, np.zeros_like(self._units))
        return np.column_stack([jumps, np.zeros(len(jumps))])

    def holds(self, stress: np.ndarray) -> bool:
        """Whether faces keep these states under ``stress`` (3,), Pa, to the tolerance of contact."""
        scale = TOLERANCE * max(float(np.abs(self._units @ stress).max()), np.finfo(float).tiny)
        return bool((self._rows @ stress >= -np.where(self._shut, scale, scale * self._length)).all())

    def compliance(self) -> np.ndarray:
        """(3, 3) as in `UniformStressResponse`."""
        return self.strain[:, :3]


def condenses(body: CrackedBody) -> bool:
    """Whether the contact of the faces of ``body`` can be condensed: they scale, can close, and touch without load."""
    aperture, can_close, _ = body.closing
    return scales(body) and bool(can_close.any()) and not aperture.any()
