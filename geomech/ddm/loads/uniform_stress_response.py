"""Response of a cracked body to uniform stress: while crack faces keep their states, four solutions give all others.

With smooth faces of which some are closed, jumps w and face pressures are affine in the stress σ (xx, yy, xy): w = J σ
+ w₀. The same holds for the reactions, hence for crack strain and K; the energy is quadratic. The result is the
solution as long as no closed face is in tension and no open faces overlap.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..crack_contact.face_laws import FaceMemory, FaceStates, Released
from .unit_load_cache import on_elements

if TYPE_CHECKING:
    from ..interfaces import CrackedBody, SolvedBody

#: Number of sets of closed faces for which responses are cached.
KEPT = 4


class AffineResponse(Protocol):
    """Response of a body to uniform stress with some faces ``closed`` (n,) bool; ``jumps`` (n, 4) under three unit
    stresses and under none."""

    closed: np.ndarray

    @property
    def jumps(self) -> np.ndarray: ...


class Response(AffineResponse, Protocol):
    """An `AffineResponse` that knows where it ends."""

    def compliance(self) -> np.ndarray:
        """(3, 3) crack strain per unit stress, 1/Pa."""

    def holds(self, stress: np.ndarray) -> bool:
        """Whether faces keep these states under ``stress`` (3,), Pa."""


class UniformStressResponse:
    """Jumps (n, 4), times 2μ, of ``body`` under three unit stresses and under none (last column).

    The faces ``closed`` (n,) bool have no opening left. Raises LinAlgError if cracks separate a part that the closed
    faces do not hold in place.
    """

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
        # Quantities that must not be negative, row by row: gaps of open faces that can meet, pressures of closed ones.
        self._holds = np.where(closed[:, None], pressed, gap)[can_close]

        self._weights = body.strain_weights

    def compliance(self) -> np.ndarray:
        """(3, 3) crack strain per unit stress, 1/Pa."""
        return self._weights @ self.jumps[:, :3]

    def holds(self, stress: np.ndarray) -> bool:
        """Whether faces keep these states under ``stress`` (3,), Pa."""
        return not len(self._holds) or bool((self._holds[:, :3] @ stress + self._holds[:, 3]).min() >= 0.0)


class UniformStressSolution:
    """Solution of ``body`` under a uniform ``stress`` (3,), Pa, from its ``response``: the crack part of a
    `Solution`."""

    memory: FaceMemory | None = None
    began: FaceMemory | None = None

    def __init__(self, body: CrackedBody, response: AffineResponse, stress: np.ndarray) -> None:
        self.body, self.closed, self._response = body, response.closed, response
        self._stress = np.array([*stress, 1.0])

    @property
    def jumps(self) -> np.ndarray:
        """(n_unknowns,) slip and opening at the nodes, times 2μ."""
        return self._response.jumps @ self._stress

    @property
    def face_traction(self) -> np.ndarray:
        """(n_unknowns,) as in a `Solution`."""
        if not self.closed.any():
            return np.zeros(len(self.closed))
        traction = on_elements(self.body.faces, self._stress[:3]) + self.body.crack_system.matrix @ self.jumps
        return np.where(self.closed, traction, 0.0)

    @property
    def frictional_work(self) -> float:
        """J/m, as in a `Solution`."""
        return 0.0

    @property
    def filling_energy(self) -> float:
        """J/m, as in a `Solution`."""
        return 0.0

    @property
    def dissipated_in_step(self) -> tuple[float, Released]:
        """J/m, as in a `Solution`."""
        return 0.0, Released()

    def work_at_cracks(self, closed: np.ndarray) -> float:
        """J/m, as in a `Solution`."""
        return work_at_cracks(self.body, closed, self.jumps)

    @cached_property
    def crack_strain(self) -> np.ndarray:
        """(3,) as in a `Solution`."""
        return self._of("strain", lambda: self.body.strain_weights @ self._response.jumps) @ self._stress

    @cached_property
    def crack_energy(self) -> float:
        """J/m, as in a `Solution`: ½ ∫ (t₀ − t)·[u] ds, with t₀ − t = −S w."""
        return float(self._stress @ self._of("energy", self._energy) @ self._stress)

    @cached_property
    def face_states(self) -> FaceStates:
        """The contact states of the faces, as in the face equations."""
        c = self.body.faces
        closed = self.closed.reshape(c.n, 2, c.per)[:, 1].ravel()
        return FaceStates(closed, np.zeros(closed.size, np.int8), np.zeros(closed.size, bool))

    @cached_property
    def tips(self) -> np.ndarray:
        """TIP rows, as in a `Solution`."""
        known, element, last, _, touching = self.body.tip_elements
        rows = known.copy()
        if not len(rows):
            return rows
        opening, slip = (self._of("factors", self._factors) @ self._stress).reshape(2, -1)
        shut = touching & ((opening < 0) | self._shut[element, last])
        rows["k_i"], rows["k_ii"] = np.where(shut, 0.0, opening), slip
        return rows

    @property
    def _shut(self) -> np.ndarray:
        """(n_elements, p+1) bool: closed nodes."""
        c = self.body.faces
        return self.closed.reshape(c.n, 2, c.per)[:, 1]

    def _energy(self) -> np.ndarray:
        body, c, jumps = self.body, self.body.faces, self._response.jumps
        weights = np.repeat(c.quadrature[:, None], 2, axis=1).ravel()  # along and normal
        form = -0.25 / body.material.shear_modulus * (jumps.T * weights) @ self._moved()
        return 0.5 * (form + form.T)

    def _moved(self) -> np.ndarray:
        """(n_unknowns, 4) S w of the response, Pa."""
        return np.column_stack([self.body.crack_system.matrix @ column for column in self._response.jumps.T])

    def _factors(self) -> np.ndarray:
        """(2 n_tips, 4) K_I of all tips, then K_II, before the contact of faces at the tips is taken into account."""
        body, c = self.body, self.body.faces
        _, element, _, lead, _ = body.tip_elements
        each = self._response.jumps.reshape(c.n, 2, c.per, 4)[element]
        factor = np.sqrt(2 * np.pi) / (8 * (1 - body.nu))
        slip, opening = factor * np.einsum("tcns,tn->cts", each, lead)
        return np.concatenate([opening, slip])

    def _of(self, name: str, found) -> np.ndarray:
        """The response combined for this stress; computed once."""
        known = vars(self._response)
        if name not in known:
            known[name] = found()
        return known[name]


def work_at_cracks(body: CrackedBody, closed: np.ndarray, jumps: np.ndarray) -> float:
    """J/m, ∫ t₀·[u] ds of the traction ``closed`` (n_unknowns,), Pa, on the ``jumps`` (n_unknowns,), times 2μ."""
    c = body.faces
    done = (closed * jumps).reshape(c.n, 2, c.per).sum(axis=1)
    return float(np.sum(c.quadrature * done)) / (2 * body.material.shear_modulus)


def scales(body: CrackedBody) -> bool:
    """Whether solutions of ``body`` under uniform stress may be scaled from those under unit stresses.

    This holds while faces keep their states, if faces have no memory, there are no holes, which disturb a uniform
    stress, and the equations are factored.
    """
    return is_simple(body) and not body.rough


def is_simple(body: CrackedBody) -> bool:
    """Whether uniform stress loads the cracks of ``body`` alone and their equations are factored: no holes, no supports."""
    return body.outlined and len(body.loops) == 1 and not (body.supports or body.compressed)


def uniform_stress_response_of(body: CrackedBody, closed: np.ndarray) -> Response:
    """Response of a ``body`` that `scales` to uniform stress with the openings ``closed``, (n_crack_unknowns,) bool;
    cached with the body."""

    def made(closed: np.ndarray) -> Response:
        condensed = body.condensed_contact()
        return UniformStressResponse(body, closed) if condensed is None else condensed.response(closed)

    return kept_response(body, closed, made)


def kept_response(body: CrackedBody, closed: np.ndarray, made: Callable[[np.ndarray], Response]) -> Response:
    """The response cached for ``closed``, or the one ``made`` from it, which is cached."""
    key = np.packbits(closed).tobytes()
    if key not in body.uniform_responses:
        if len(body.uniform_responses) >= KEPT:
            body.uniform_responses.pop(next(iter(body.uniform_responses)))
        body.uniform_responses[key] = made(closed)
    return body.uniform_responses[key]


def scaled(
    body: CrackedBody, stress: np.ndarray, warm: SolvedBody | UniformStressSolution | None = None
) -> UniformStressSolution | None:
    """Solution of ``body`` under a uniform ``stress`` (3,), Pa, if its faces keep the states of ``warm``.

    ``warm`` is an earlier solution of this geometry (None: all faces are open). Returns None if they do not keep them,
    or if that cannot be known without solving.
    """
    if not scales(body) or not body.faces.n:
        return None
    closed = np.zeros(body.faces.n_unknowns, bool)
    if warm is not None:
        if warm.body.crack_system is not body.crack_system:
            return None
        closed = warm.closed
    response = body.uniform_responses.get(np.packbits(closed).tobytes())
    if response is None and not closed.any():
        response = uniform_stress_response_of(body, closed)
    if response is None or not response.holds(stress):
        return None
    body.work.solutions_scaled += 1
    return UniformStressSolution(body, response, stress)
