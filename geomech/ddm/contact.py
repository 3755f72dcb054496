"""The contact of a body's crack faces under one load, by the solver that their laws need."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .face_laws import FaceMemory, FaceStates, carried_over
from .faces import settle
from .friction import settle_rough

if TYPE_CHECKING:
    from .body import Body
    from .solution import Solution


@dataclass(frozen=True, eq=False)
class FaceAnswer:
    """``jumps`` slip and opening (times 2μ) and ``traction`` on the faces, (n_unknowns,); ``closed`` (n_unknowns,) bool,
    the openings that are used up; ``solves`` it took; of faces that have one, ``memory``
    after this load, and ``began`` before."""

    jumps: np.ndarray
    traction: np.ndarray
    closed: np.ndarray
    solves: int
    memory: FaceMemory | None = None
    began: FaceMemory | None = None


def settle_faces(
    body: Body,
    load_traction: np.ndarray,
    opened: np.ndarray,
    pressure: np.ndarray | float,
    warm: Solution | None,
    history: Solution | FaceMemory | None = None,
) -> FaceAnswer:
    """The faces of ``body``; ``load_traction`` (n_unknowns,) is what loads do to closed faces, ``opened`` S⁻¹ of it,
    ``pressure`` (n_elements, p+1) that of a fluid at the nodes. ``warm`` and ``history`` as in `Body.solve`."""
    c = body.faces
    n = c.n_unknowns
    if n == 0:
        return FaceAnswer(np.zeros(0), np.zeros(0), np.zeros(0, bool), 0)
    applied = np.zeros((c.n, 2, c.per))
    applied[:, 1] = -pressure
    applied = applied.ravel()
    right = applied - load_traction
    if body.rough:
        return _rough(body, right, applied, warm, history)
    opened = body.crack_system.opened(applied) - opened if applied.any() else -opened
    aperture, can_close, fixed = body.closing
    stress_scale = max(float(np.abs(right).max()), np.finfo(float).tiny)
    gap_scale = stress_scale * float(c.length.max())
    state: dict[str, np.ndarray] = {}

    def respond(closed):
        w, reaction = body.crack_system.constrained(right, closed, fixed, opened)
        state["w"], state["traction"] = w, applied - reaction
        return (w + aperture) / gap_scale, reaction / stress_scale

    closed = np.zeros(n, bool)
    if not can_close.any():
        respond(closed)
        return FaceAnswer(state["w"], state["traction"], closed, 1)
    warm = history if warm is None and not isinstance(history, FaceMemory) else warm
    if warm is not None:
        at = c.found_in(warm.body.faces)
        rows = np.zeros((c.n, 2 * c.per), bool)
        rows[at >= 0] = warm.closed.reshape(-1, 2 * c.per)[at[at >= 0]]
        closed = rows.ravel()
    closed, solves = settle(respond, can_close, closed)
    return FaceAnswer(state["w"], state["traction"], closed, solves)


def _rough(
    body: Body,
    right: np.ndarray,
    applied: np.ndarray,
    warm: Solution | None,
    history: Solution | FaceMemory | None,
) -> FaceAnswer:
    laws = body.laws
    began = body.never_loaded if history is None else _memory(history, body)
    first = history if warm is None else warm
    guess: FaceStates | None = None if first is None else _memory(first, body).states
    w, reaction, memory, solves = settle_rough(body.face_equations, right, began, guess)
    closed = np.zeros(len(right), bool)
    closed[laws.across] = memory.states.closed
    return FaceAnswer(w, applied - reaction, closed, solves, memory, began)


def _memory(of: Solution | FaceMemory, body: Body) -> FaceMemory:
    """What the faces of ``of`` remember, on the elements of ``body``."""
    if isinstance(of, FaceMemory):
        return carried_over(of, body.faces)
    memory = of.memory
    if memory is None:
        c = of.body.faces
        slip = of.jumps.reshape(c.n, 2, c.per)[:, 0].ravel()
        memory = FaceMemory(c, slip, np.zeros(slip.size, bool), 0.0, of.face_states)
    return carried_over(memory, body.faces)
