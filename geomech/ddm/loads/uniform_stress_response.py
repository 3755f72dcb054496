"""A body under a uniform stress: while its crack faces keep their states, three solutions determine all others.

With smooth faces of which some are closed, jumps w and face pressures are affine in the stress σ (xx, yy,
xy): w = J σ + w₀, the same for the reaction, and so the strain of the cracks and K; the energy around them is quadratic.
The answer is the solution as long as no closed face is pulled and none of the open ones overlap.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..crack_contact.face_laws import FaceStates, Released
from .unit_load_cache import on_elements

if TYPE_CHECKING:
    from ..interfaces import CrackedBody, SolvedBody

#: Responses for so many sets of closed faces are kept.
KEPT = 4


class EvenResponse:
    """The jumps (n, 4), times 2μ, of ``body`` under unit stresses, last column without any, while the openings that are
    ``closed`` (n,) bool stay used up. Raises LinAlgError when cracks cut a part off and closed faces do not hold it."""

    def __init__(self, body: CrackedBody, closed: np.ndarray) -> None:
        c = body.faces
        right = np.column_stack([-on_elements(c, unit) for unit in np.eye(3)])
        per_stress, reaction = body.crack_system.constrained(right, closed, np.zeros_like(right))
        self.closed = closed
        self.jumps = np.column_stack([per_stress, np.zeros(c.n_unknowns)])
        aperture, can_close, fixed = body.closing
        pressed = np.column_stack([reaction, np.zeros(c.n_unknowns)])
        if fixed[closed].any():
            self.jumps[:, 3], pressed[:, 3] = body.crack_system.constrained(np.zeros(c.n_unknowns), closed, fixed)
        gap = self.jumps.copy()
        gap[:, 3] += aperture
        # What must not be negative, row by row: gaps of open faces that can meet, pressures of closed ones.
        self._holds = np.where(closed[:, None], pressed, gap)[can_close]

    def holds(self, stress: np.ndarray) -> bool:
        """Whether faces stay in these states under ``stress`` (3,), Pa."""
        return not len(self._holds) or bool((self._holds[:, :3] @ stress + self._holds[:, 3]).min() >= 0.0)


class EvenSolution:
    """``body`` under an even ``stress`` (3,), Pa, by its ``response``: what a `Solution` knows of its cracks."""

    memory = None
    began = None
    frictional_work = filling_energy = 0.0
    given_way = 0.0, Released()

    def __init__(self, body: CrackedBody, response: EvenResponse, stress: np.ndarray) -> None:
        self.body, self.closed, self._response = body, response.closed, response
        self._stress = np.array([*stress, 1.0])

    @property
    def jumps(self) -> np.ndarray:
        """(n_unknowns,) slip and opening at the nodes, times 2μ."""
        return self._response.jumps @ self._stress

    @cached_property
    def crack_strain(self) -> np.ndarray:
        """(3,) as of a `Solution`."""
        return self._of("strain", lambda: self.body.strain_weights @ self._response.jumps) @ self._stress

    @cached_property
    def crack_energy(self) -> float:
        """J/m, as of a `Solution`: ½ ∫ (t₀ − t)·[u] ds, of which t₀ − t = −S w."""
        return float(self._stress @ self._of("energy", self._energy) @ self._stress)

    @cached_property
    def face_states(self) -> FaceStates:
        """The states of contact, as the equations of the faces have them."""
        c = self.body.faces
        closed = self.closed.reshape(c.n, 2, c.per)[:, 1].ravel()
        return FaceStates(closed, np.zeros(closed.size, np.int8), np.zeros(closed.size, bool))

    @cached_property
    def tips(self) -> np.ndarray:
        """TIP rows, as of a `Solution`."""
        known, element, last, _, touching = self.body.tip_elements
        rows, c = known.copy(), self.body.faces
        if not len(rows):
            return rows
        opening, slip = (self._of("factors", self._factors) @ self._stress).reshape(2, -1)
        shut = touching & ((opening < 0) | self.closed.reshape(c.n, 2, c.per)[element, 1, last])
        rows["k_i"], rows["k_ii"] = np.where(shut, 0.0, opening), slip
        return rows

    def _energy(self) -> np.ndarray:
        body, c, jumps = self.body, self.body.faces, self._response.jumps
        weights = np.repeat(c.quadrature[:, None], 2, axis=1).ravel()  # along and normal
        form = (
            -0.25
            / body.material.shear_modulus
            * (jumps.T * weights)
            @ np.column_stack([body.crack_system.matrix @ column for column in jumps.T])
        )
        return 0.5 * (form + form.T)

    def _factors(self) -> np.ndarray:
        """(2 n_tips, 4) K_I of all tips, then K_II, before faces that touch are asked."""
        body, c = self.body, self.body.faces
        _, element, _, lead, _ = body.tip_elements
        each = self._response.jumps.reshape(c.n, 2, c.per, 4)[element]
        factor = np.sqrt(2 * np.pi) / (8 * (1 - body.nu))
        slip, opening = factor * np.einsum("tcns,tn->cts", each, lead)
        return np.concatenate([opening, slip])

    def _of(self, name: str, found) -> np.ndarray:
        """What the response comes to, found once."""
        known = vars(self._response)
        if name not in known:
            known[name] = found()
        return known[name]


def scales(body: CrackedBody) -> bool:
    """Whether solutions of ``body`` under an even stress are scaled from those under unit ones while its faces keep
    their states: where these have no memory of their own, without holes, which bear an even stress otherwise, and with
    factors."""
    return body.outlined and len(body.loops) == 1 and not (body.rough or body.supports or body.compressed)


def even_response(body: CrackedBody, closed: np.ndarray) -> EvenResponse:
    """How the cracks of a ``body`` that `scales` answer to an even stress while these openings, (n_crack_unknowns,)
    bool, are ``closed``; kept with it."""
    key = np.packbits(closed).tobytes()
    if key not in body.even:
        if len(body.even) >= KEPT:
            body.even.pop(next(iter(body.even)))
        body.even[key] = EvenResponse(body, closed)
    return body.even[key]


def scaled(body: CrackedBody, stress: np.ndarray, warm: SolvedBody | EvenSolution | None = None) -> EvenSolution | None:
    """The solution of ``body`` under an even ``stress`` (3,), Pa, where its faces keep the states of ``warm``, an earlier
    solution of this geometry (None: all are open); None where they do not, or where that takes a solution to know."""
    if not scales(body) or not body.faces.n:
        return None
    closed = np.zeros(body.faces.n_unknowns, bool)
    if warm is not None:
        if warm.body.crack_system is not body.crack_system:
            return None
        closed = warm.closed
    response = body.even.get(np.packbits(closed).tobytes())
    if response is None and not closed.any():
        response = even_response(body, closed)
    if response is None or not response.holds(stress):
        return None
    body.work.solutions_scaled += 1
    return EvenSolution(body, response, stress)
