"""Frictional contact of crack faces: which nodes are open, stick or slip, and the resulting jumps.

The equations of nodes in given states are linear (`face_equations`); the states satisfy the inequalities gap ≥ 0,
λ_n ≥ 0 (cemented: ≥ −strength), |λ_t| ≤ c + λ_n tan φ, with slip opposed to its shear. All nodes that violate one
change state at once: Newton's method for the semismooth equations (Alart & Curnier 1991), which needs a handful of
solutions however many cracks interact. Where it cycles, the states are found by removing a confining pressure
(`confinement_path`). The result satisfies all inequalities to the tolerance, except at the nodes listed in `Missed` (in
blades of rock thinner than the elements there may be no solution).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .confinement_path import confinement_path
from .face_equations import FaceEquations, FaceProblem, FaceValues
from .face_laws import FaceLaws, FaceMemory, FaceStates, Released

#: Allowed violation, relative to the largest stress (and the opening it causes).
TOLERANCE = 1e-10
#: Newton steps without a new minimum of violated nodes before the path is followed.
_PATIENCE = 12


class Missed(NamedTuple):
    """``undecided`` (n_nodes,) bool: nodes without a consistent state; ``violation``: largest violation, relative to
    the largest stress."""

    undecided: np.ndarray
    violation: float


class _Settled(NamedTuple):
    """Contact states, the solution in them, and its violations."""

    states: FaceStates
    values: FaceValues
    missed: Missed


def _required(problem: FaceProblem, states: FaceStates, values: FaceValues) -> tuple[FaceStates, np.ndarray, float]:
    """The states that ``values`` require, the nodes that change, and the largest violation."""
    laws, tol, broken = problem.laws, TOLERANCE, problem.memory.broken
    pressure, shear = values.pressure, values.shear
    cemented = laws.cemented(broken)
    lifts = states.closed & ~cemented & (pressure < -tol)
    meets = ~states.closed & laws.closes & (values.gap < -tol)
    closed = states.closed & ~lifts | meets
    # A limit cannot be negative: cement in tension has no friction, other faces open.
    pulled = closed & cemented & np.where(states.pulled, pressure < tol, pressure < -tol)
    over = np.abs(shear) - laws.limit(pressure * problem.stress, broken) / problem.stress
    way = states.way.copy()
    starts = states.closed & laws.rough & (way == 0) & (over > tol)
    way[starts] = np.sign(shear[starts])
    back = (states.way != 0) & (states.way * values.slip < -tol)
    way[back] = 0
    # Faces that close were free to slip, and are assumed to continue.
    way[meets & laws.rough] = np.sign(values.slip[meets & laws.rough])
    way[~closed] = 0
    worst = max(
        np.max(-pressure, where=lifts, initial=0.0),
        np.max(-values.gap, where=meets, initial=0.0),
        np.max(over, where=starts, initial=0.0),
        np.max(np.abs(values.slip), where=back, initial=0.0),
    )
    changed = (closed != states.closed) | (way != states.way) | (pulled != states.pulled)
    return FaceStates(closed, way, pulled), changed, float(worst)


def first_guess(problem: FaceProblem) -> FaceStates:
    """States of isolated faces: exact for a straight crack under uniform stress."""
    laws, right, broken = problem.laws, problem.right, problem.memory.broken
    pressure, shear = right[laws.across], -right[laws.along]
    cemented = laws.cemented(broken)
    closed = laws.closes & ((laws.aperture == 0) & (pressure > 0) | cemented)
    way = np.where(closed & laws.rough & (np.abs(shear) > laws.limit(pressure, broken)), np.sign(shear), 0)
    return FaceStates(closed, way.astype(np.int8), cemented & (pressure < 0))


def admissible(problem: FaceProblem, states: FaceStates) -> FaceStates:
    """``states`` restricted to those that the laws allow."""
    laws, cemented = problem.laws, problem.laws.cemented(problem.memory.broken)
    closed = states.closed & laws.closes | cemented
    way = np.where(closed & laws.rough, states.way, 0).astype(np.int8)
    return FaceStates(closed, way, states.pulled & cemented)


def newton(problem: FaceProblem, states: FaceStates) -> tuple[_Settled | None, FaceStates, np.ndarray]:
    """The states that satisfy all inequalities, or None if the iteration cycles; the states with the fewest violations;
    and the nodes (n_nodes,) bool that have changed since."""
    best, fewest, patience = states, len(states.closed) + 1, _PATIENCE
    disputed = np.zeros(len(states.closed), bool)
    while patience > 0:
        values = problem.solve(states)
        new, changed, _ = _required(problem, states, values)
        n = int(changed.sum())
        if n == 0:
            return _Settled(states, values, Missed(changed, 0.0)), states, disputed
        if n < fewest:
            best, fewest, patience, disputed = states, n, _PATIENCE, changed
        else:
            patience -= 1
            disputed = disputed | changed
        states = new
    return None, best, disputed


def settle(problem: FaceProblem, states: FaceStates) -> _Settled:
    """Contact states of ``problem`` with the cement that is still intact, beginning with ``states``."""
    found, states, disputed = newton(problem, states)
    if found is not None:
        return found
    states = confinement_path(problem, states, disputed).states
    values = problem.solve(states)
    _, changed, worst = _required(problem, states, values)
    return _Settled(states, values, Missed(changed, worst))


def settle_rough(
    equations: FaceEquations, right: np.ndarray, memory: FaceMemory, guess: FaceStates | None = None
) -> tuple[np.ndarray, np.ndarray, FaceMemory, int, Missed]:
    """Contact of faces with friction, cement or filling.

    ``right`` (n,): traction of fluid in the cracks minus that of the loads on closed faces; ``memory`` of the last
    load; ``guess``: initial states, by default those of isolated faces. Returns slip and opening (times 2μ), λ = right
    − S w, the new memory, the number of solves, and the remaining violations.
    """
    laws, solved = equations.laws, equations.solved
    problem = FaceProblem(equations, right, replace(memory, broken=memory.lost))
    states = first_guess(problem) if guess is None else admissible(problem, guess)
    while True:
        found = settle(problem, states)
        broken, cemented = problem.memory.broken, laws.cemented(problem.memory.broken)
        if not cemented.any():
            break
        drive = -found.values.reaction[laws.across] / np.where(cemented, laws.strength, np.inf)
        if not drive.max() > 1 + TOLERANCE:
            break
        # The most stressed nodes break first; the others are checked again afterwards.
        broken = broken | cemented & (drive > max(1.0, 0.5 * drive.max()))
        problem = FaceProblem(equations, right, replace(memory, broken=broken))
        was = found.states
        states = admissible(problem, FaceStates(was.closed & ~broken, was.way, was.pulled))
    now = _remembered(problem, memory, found)
    return found.values.jumps, found.values.reaction, now, equations.solved - solved, found.missed


def memory_in_states(
    equations: FaceEquations,
    right: np.ndarray,
    memory: FaceMemory,
    states: FaceStates,
    of: tuple[np.ndarray, np.ndarray],
) -> FaceMemory | None:
    """Memory of faces without cement after the load ``right`` (n,), if all nodes satisfy their laws in these ``states``;
    otherwise None. ``of``: jumps and λ (n,) in these states; ``memory``: before the load."""
    problem = FaceProblem(equations, right, replace(memory, broken=memory.lost))
    values = problem.values(states, *of)
    _, changed, worst = _required(problem, states, values)
    return None if changed.any() else _remembered(problem, memory, _Settled(states, values, Missed(changed, worst)))


def _remembered(problem: FaceProblem, memory: FaceMemory, found: _Settled) -> FaceMemory:
    """Face memory after the load of ``problem``, whose solution is ``found``; ``memory``: before it."""
    laws, broken, states = problem.laws, problem.memory.broken, found.states
    w, reaction = found.values.jumps, found.values.reaction
    slip = w[laws.along]
    holds = states.closed & laws.rough
    rest = np.where(holds, slip - problem.spring_slip(states, reaction), slip)
    sticks = holds & (states.way == 0)
    rest[sticks] = memory.rest[sticks]
    # Shear limit during the step: mean of the limits before and after (0 before faces have closed). Second order in the
    # load step, and exact for a constant limit.
    pressure = np.where(states.closed, reaction[laws.across], 0.0)
    slides = states.way != 0  # nodes that cannot slip have an infinite limit
    before = np.where(slides, laws.limit(memory.pressure, broken), 0.0)
    lost = np.where(slides, 0.5 * (states.way * before - reaction[laws.along]) * (rest - memory.rest), 0.0)
    shear = np.where(states.closed, -reaction[laws.along], 0.0)
    weights = laws.elements.quadrature.ravel() / laws.twice_mu
    work = memory.work + float(weights @ lost)
    # Faces that stuck at the beginning of the step, and slip at its end, were below their limit before.
    untouched = not memory.states.closed.any() and not memory.rest.any()
    stuck = memory.states.closed & (memory.states.way == 0) | laws.cemented(memory.broken)
    stuck |= untouched & laws.closes & (laws.aperture == 0)
    slips = np.where(stuck & slides, lost - 0.5 * (memory.shear - reaction[laws.along]) * (rest - memory.rest), 0.0)
    breaks = broken & ~memory.broken
    bond, ahead = _breaking(laws, memory, w, pressure, shear, lost) if breaks.any() else np.zeros((2, len(lost)))
    new = float(weights[breaks] @ bond[breaks]), float(weights @ np.where(breaks, 0.0, slips))
    released = Released(*(a + b for a, b in zip(memory.released, (*new, float(weights[breaks] @ ahead[breaks])))))
    return FaceMemory(laws.elements, rest, broken, work, states, pressure, shear, released)


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
