"""Faces with friction under uniform stress, as long as all their nodes keep their states.

In given states (`face_equations`) jumps w and face tractions λ are affine in the stress σ (xx, yy, xy): w = J σ + w₀, λ =
L σ + λ₀. The slip at zero shear, `FaceMemory.rest`, enters at sticking nodes alone, which keep it: so the same w₀ and λ₀
hold in the next load steps. They follow from one solution in these states, J from the tangent that gives the compliance
too. A load then takes products with three columns. Where a node would leave its state, the equations are solved anew.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..loads.uniform_stress_response import UniformStressSolution, is_simple
from ..loads.unit_load_cache import on_elements
from .face_laws import FaceMemory, FaceStates, Released
from .frictional_contact import memory_in_states, stored_by_fillings

if TYPE_CHECKING:
    from ..interfaces import CrackedBody


class RoughResponse:
    """``jumps`` w and ``reaction`` λ (n, 4) of ``body`` under three unit stresses and under none, in the states of its
    solution ``of`` under the uniform ``stress`` (3,), Pa."""

    def __init__(self, body: CrackedBody, of: Any, stress: np.ndarray) -> None:
        self.states, self.closed = of.face_states, of.closed
        equations = body.face_equations
        right = -np.column_stack([on_elements(body.faces, unit) for unit in np.eye(3)])
        per_stress = equations.uniform_tangent(right, self.states)
        reaction = equations.tangent_reaction(right, per_stress, self.states)
        # (No fluid presses on the faces.)
        self.jumps = np.column_stack([per_stress, of.jumps - per_stress @ stress])
        self.reaction = np.column_stack([reaction, -of.face_traction - reaction @ stress])
        #: S w.
        self.moved = np.column_stack([right, np.zeros(len(right))]) - self.reaction


class RoughSolution(UniformStressSolution):
    """Solution of ``body`` under a uniform ``stress`` (3,), Pa, with the ``memory`` of its faces after it and before it
    (``began``)."""

    def __init__(
        self, body: CrackedBody, response: RoughResponse, stress: np.ndarray, memory: FaceMemory, began: FaceMemory
    ) -> None:
        super().__init__(body, response, stress)
        self.rough = response
        self.memory = self._after = memory
        self.began = self._before = began

    @property
    def face_traction(self) -> np.ndarray:
        """(n_unknowns,) as in a `Solution`."""
        return -(self.rough.reaction @ self._stress)

    @property
    def face_states(self) -> FaceStates:
        """The contact states of the faces."""
        return self.rough.states

    @property
    def frictional_work(self) -> float:
        """J/m, as in a `Solution`."""
        return self._after.work

    @property
    def dissipated_in_step(self) -> tuple[float, Released]:
        """J/m, as in a `Solution`."""
        released = (now - before for now, before in zip(self._after.released, self._before.released))
        return self._after.work - self._before.work, Released(*released)

    @property
    def filling_energy(self) -> float:
        """J/m, as in a `Solution`."""
        stored = stored_by_fillings(self.body.laws, self._after.pressure, self._after.shear)
        return float(self.body.faces.quadrature.ravel() @ stored) / (2 * self.body.material.shear_modulus)

    @property
    def _shut(self) -> np.ndarray:
        """(n_elements, p+1) bool: nodes that are closed without a compliant filling."""
        closed = super()._shut
        return closed & np.isinf(self.body.laws.normal).reshape(closed.shape)

    def _moved(self) -> np.ndarray:
        return self.rough.moved


def solved_in_states(body: CrackedBody, stress: np.ndarray, before: Any, memory: FaceMemory) -> RoughSolution | None:
    """Solution of a ``body`` with friction under a uniform ``stress`` (3,), Pa, whose faces begin with ``memory``, if they
    keep the states of ``before``, an earlier solution under uniform stress; otherwise None."""
    if before is None or before.body.crack_system is not body.crack_system:
        return None
    if not body.rough or not is_simple(body) or not _continues(body, before, memory):
        return None
    known = before.rough if isinstance(before, RoughSolution) else None
    if known is None:
        known = RoughResponse(body, before, np.asarray(before.load.remote_stress))
    w, right = np.array([*stress, 1.0]), -on_elements(body.faces, stress)
    found = known.jumps @ w, known.reaction @ w
    after = memory_in_states(body.face_equations, right, memory, known.states, found)
    if after is None:
        return None
    body.work.solutions_scaled += 1
    return RoughSolution(body, known, stress, after, memory)


def _continues(body: CrackedBody, before: Any, memory: FaceMemory) -> bool:
    """Whether the equations in the states of ``before`` are the same in a load step that begins with ``memory``: no cement,
    and the same slip left at sticking nodes."""
    began, states = before.began, before.face_states
    if began is None or memory.elements is not began.elements or not np.array_equal(memory.lost, began.lost):
        return False
    sticks = states.closed & body.laws.rough & (states.way == 0)
    return not body.laws.cemented(began.lost).any() and np.array_equal(memory.rest[sticks], began.rest[sticks])
