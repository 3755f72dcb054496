"""Contact of the crack faces of a body under one load: chooses the solver that the face laws need."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..growth.crack_network import nearest_on
from ..kernels import shape_functions
from .confinement_path import confinement_path
from .face_equations import FaceProblem
from .face_laws import FaceMemory, FaceStates, carried_over
from .frictional_contact import settle_rough
from .frictionless_contact import NotConverged, Settled, settle

if TYPE_CHECKING:
    from ..interfaces import CrackedBody, SolvedBody

#: Largest fraction of a crack whose nodes may violate the contact conditions, as in a thin blade of rock that has no
#: influence on distant crack tips.
UNDECIDED = 0.03
#: Thickness of rock between a tip and the outline, relative to the body's extent, below which the message for faces
#: that do not converge mentions it.
BY_A_THREAD = 1e-2
_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class FaceSolution:
    """Result: slip and opening ``jumps`` (times 2μ) and ``traction`` on the faces (n_unknowns,); ``closed``
    (n_unknowns,) bool: openings at −aperture; number of ``solves``; face ``memory`` after this load and before it
    (``began``)."""

    jumps: np.ndarray
    traction: np.ndarray
    closed: np.ndarray
    solves: int
    memory: FaceMemory | None = None
    began: FaceMemory | None = None


def settle_faces(
    body: CrackedBody,
    load_traction: np.ndarray,
    opened: np.ndarray,
    pressure: np.ndarray | float,
    warm: SolvedBody | None,
    history: SolvedBody | FaceMemory | None = None,
) -> FaceSolution:
    """Contact state of the faces of ``body``. ``load_traction`` (n_unknowns,): of the loads on closed faces;
    ``opened``: S⁻¹ of it, if the body `opens`; ``pressure`` (n_elements, p+1): of fluid at the nodes. ``warm`` and
    ``history`` as in `Body.solve`."""
    c = body.faces
    n = c.n_unknowns
    if n == 0:
        return FaceSolution(np.zeros(0), np.zeros(0), np.zeros(0, bool), 0)
    on_faces = np.zeros((c.n, 2, c.per))
    on_faces[:, 1] = -pressure
    applied = on_faces.ravel()
    right = applied - load_traction
    if body.rough:
        return _rough(body, right, applied, warm, history)
    start: np.ndarray | None = None
    if body.opens:
        start = body.crack_system.opened(applied) - opened if applied.any() else -opened
    aperture, can_close, fixed = body.closing
    stress_scale = max(float(np.abs(right).max()), np.finfo(float).tiny)
    gap_scale = stress_scale * float(c.length.max())
    state: dict[str, np.ndarray] = {}

    def respond(closed):
        w, reaction = body.crack_system.constrained(right, closed, fixed, start)
        state["w"], state["traction"] = w, applied - reaction
        return (w + aperture) / gap_scale, reaction / stress_scale

    closed = np.zeros(n, bool)
    if not can_close.any():
        respond(closed)
        return FaceSolution(state["w"], state["traction"], closed, 1)
    warm = history if warm is None and not isinstance(history, FaceMemory) else warm
    if warm is not None and warm.body.faces.per == c.per:  # a first guess: nodes of another order have none
        at = c.found_in(warm.body.faces)
        rows = np.zeros((c.n, 2 * c.per), bool)
        rows[at >= 0] = warm.closed.reshape(-1, 2 * c.per)[at[at >= 0]]
        closed = rows.ravel()
    settled = settle(respond, can_close, closed, lambda shut, disputed: _by_path(body, right, shut, disputed))
    if settled.undecided.any():
        _judge(body, settled)
    return FaceSolution(state["w"], state["traction"], settled.closed, settled.solves)


def _by_path(body: CrackedBody, right: np.ndarray, closed: np.ndarray, disputed: np.ndarray) -> np.ndarray:
    """(n_unknowns,) bool: closed nodes of faces without friction, by `confinement_path` from ``closed``."""
    problem = FaceProblem(body.face_equations, right, body.initial_memory)
    at = problem.laws.across
    n = len(at)
    states = FaceStates(closed[at], np.zeros(n, np.int8), np.zeros(n, bool))
    out = np.zeros(len(closed), bool)
    out[at] = confinement_path(problem, states, disputed[at]).states.closed
    # Nothing else asks for these equations of smooth faces, and paths hardly ever come to the same states.
    body.face_equations.forget()
    return out


def _thin_bridge(body: CrackedBody) -> str:
    """Text for messages: the tip with hardly any rock between it and the outline; "" if there is none."""
    cracks, edges = body.cracks, body.mesh.edges
    if not (len(edges) and len(cracks.tips)):
        return ""
    left = np.min(
        [[nearest_on(tuple(cracks.nodes[tip]), tuple(a), tuple(b))[0] for a, b in edges] for tip in cracks.tips],
        axis=1,
    )
    tip = int(np.argmin(left))
    if left[tip] >= BY_A_THREAD * body._extent:
        return ""
    (x, y), crack = cracks.nodes[cracks.tips[tip]], body.tip_elements[0]["crack"][tip]
    return (
        f"; from the tip of {cracks.names[crack]!r} at ({x:.6g}, {y:.6g}) only {left[tip]:.2g} m of rock are left to a "
        "side"
    )


def _judge(body: CrackedBody, settled: Settled) -> None:
    """Log the nodes without a consistent contact state. Raises NotConverged, naming the crack, if they extend over more
    than the last part of a crack at a mouth or junction."""
    c, cracks = body.faces, body.cracks
    at = np.flatnonzero(settled.undecided.reshape(c.n, -1).any(axis=1))
    crack = cracks.crack[c.source]
    for number in np.unique(crack[at]):
        here = at[crack[at] == number]
        length, own = float(c.length[here].sum()), float(c.length[crack == number].sum())
        x, y = c.start[here[0]]
        where = (
            f"faces of {cracks.names[number]!r} near ({x:.6g}, {y:.6g}) have no contact state that satisfies the "
            "conditions at all points"
        )
        if length > UNDECIDED * own or (c.kind[here] != shape_functions.ORDINARY).any():
            raise NotConverged(
                f"{where}, over {length:.3g} m (violation {settled.violation:.1e} of the largest stress): give it an "
                f"aperture, friction, or a finer mesh{_thin_bridge(body)}"
            )
        _log.warning(
            "%s, over %.3g m; the remaining violation is %.1e of the largest stress",
            where,
            length,
            settled.violation,
        )


def _rough(
    body: CrackedBody,
    right: np.ndarray,
    applied: np.ndarray,
    warm: SolvedBody | None,
    history: SolvedBody | FaceMemory | None,
) -> FaceSolution:
    laws = body.laws
    began = body.initial_memory if history is None else _memory(history, body)
    first = history if warm is None else warm
    guess: FaceStates | None = None if first is None else _memory(first, body).states
    w, reaction, memory, solves, missed = settle_rough(body.face_equations, right, began, guess)
    if missed.undecided.any():
        _judge(body, Settled(memory.states.closed, solves, missed.undecided, missed.violation))
    closed = np.zeros(len(right), bool)
    closed[laws.across] = memory.states.closed
    return FaceSolution(w, applied - reaction, closed, solves, memory, began)


def _memory(of: SolvedBody | FaceMemory, body: CrackedBody) -> FaceMemory:
    """Face memory of ``of``, on the elements of ``body``."""
    if isinstance(of, FaceMemory):
        return carried_over(of, body.faces)
    memory = of.memory
    if memory is None:
        c = of.body.faces
        slip = of.jumps.reshape(c.n, 2, c.per)[:, 0].ravel()
        memory = FaceMemory(c, slip, np.zeros(slip.size, bool), 0.0, of.face_states, *np.zeros((2, slip.size)))
    return carried_over(memory, body.faces)
