"""Open–close iterations: contact states that agree with the motion they produce.

A set of states makes the step linear; its solution is checked against them. A closed contact must not pull beyond its
tensile strength, an open one must not penetrate, a sticking one must hold less than its strength μN + cℓ, and a sliding
one would carry more than it does if it stuck (the return mapping of an elastic-plastic spring, under which exactly one of the
states fits a given motion; the sign of the sliding, which Shi 1988 asks for, leaves cases in which none does). Every contact that fails is switched and the step solved again. If a combination of
states returns, the sliding contacts stick again and only the worst contact of each block is switched, and if one still
returns, only the first (the least-index rule, which cannot cycle where the problem has one solution; Murty 1974).
Laws that are curved are lines within an iteration, and the iteration goes on until lines and laws agree on the forces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ..model import OPEN, SLIP, STICK
from . import assembly
from .contact_springs import Springs
from .contacts import ContactSet
from .curved_joints import CurvedJoints

#: After this many iterations only the worst contacts of each block are switched: opened all at once, the contacts of a block
#: let it fly, to be closed all at once in the next iteration.
_ALL_AT_ONCE = 4


@dataclass(frozen=True, eq=False)
class Settled:
    """A consistent set of contact states and what goes with it; ``unknowns`` (n_free, 6) scaled as in `assembly`.

    ``gap`` is counted from where the faces meet, ``slip`` is what the shear spring did not take up of the motion along the
    edge, ``lifted`` what it added to the lift (all m); ``springs`` those of the final iteration.
    """

    unknowns: np.ndarray
    state: np.ndarray
    direction: np.ndarray
    bonded: np.ndarray
    normal_force: np.ndarray
    shear_force: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    lifted: np.ndarray
    springs: Springs
    iterations: int


class Unsettled(Exception):
    """The open–close iterations found no consistent states; ``contact`` is the row that still disagrees (or −1)."""

    def __init__(self, reason: str, contact: int = -1) -> None:
        super().__init__(reason)
        self.contact = contact


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True)
def _move(unknowns, block, other, order, vectors, c, k):
    total = 0.0
    i, j = order[block[c]], order[other[c]]
    if i >= 0:
        for a in range(6):
            total += vectors[c, k, a] * unknowns[6 * i + a]
    if j >= 0:
        for a in range(6):
            total += vectors[c, k, 6 + a] * unknowns[6 * j + a]
    return total


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True)
def contact_forces(
    unknowns, block, other, order, vectors, state, direction, gap0, normal, shear, friction, sliding, lift, shear0
):
    """(n, 4): normal force, shear force, new gap and motion along the edge in the step, in the present states."""
    n = block.shape[0]
    forces = np.zeros((n, 4))
    for c in range(n):
        forces[c, 3] = _move(unknowns, block, other, order, vectors, c, 1)
        forces[c, 2] = gap0[c] + _move(unknowns, block, other, order, vectors, c, 0) - lift[c] * forces[c, 3]
        if state[c] != OPEN:
            forces[c, 0] = -normal[c] * forces[c, 2]
            if state[c] == STICK:
                forces[c, 1] = shear0[c] - shear[c] * forces[c, 3]
            else:
                forces[c, 1] = direction[c] * (friction[c] * forces[c, 0] + sliding[c])
    return forces


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True)
def check_states(
    forces,
    partner,
    state,
    direction,
    bonded,
    normal,
    shear,
    friction,
    sliding,
    peak,
    hold,
    cohesion,
    tension,
    keeps,
    shear0,
    slack,
):
    """The states that the ``forces`` (n, 4) of `contact_forces` call for.

    Returns (new state; new direction; new bonded; violation (n,) N, 0 where the state stands). ``slack`` (m) is the
    round-off of coordinates: gaps below it decide nothing; slip, which is counted from the step's start, is known a thousand
    times better.
    """
    n = state.shape[0]
    new_state, new_direction, new_bonded = state.copy(), direction.copy(), bonded.copy()
    violation = np.zeros(n)
    for c in range(n):
        gap, slide = forces[c, 2], forces[c, 3]
        if state[c] == OPEN:
            if gap >= -slack:
                continue
            inside = True
            for k in range(2):
                p = partner[c, k]
                # Corners overlap only where both lines are crossed; the lesser penetration, or the first of equals, acts.
                if p >= 0 and (
                    forces[p, 2] >= -slack or state[p] != OPEN or forces[p, 2] > gap or (forces[p, 2] == gap and p < c)
                ):
                    inside = False
            if inside:
                violation[c] = -normal[c] * gap
                # The state to try is that of the springs under the motion at hand: sticking where it would have to slide,
                # a contact may pull, open, close again and never come to sliding.
                trial = shear0[c] - shear[c] * slide
                if abs(trial) > violation[c] * friction[c] + sliding[c] and bonded[c] == 0:
                    new_state[c], new_direction[c] = SLIP, np.sign(trial)
                else:
                    new_state[c] = STICK
            continue
        pull = tension[c] if bonded[c] == 1 else 0.0
        out = False
        for k in range(2):
            p = partner[c, k]
            out = out or (p >= 0 and forces[p, 2] > slack and gap < 0.0)
        if -forces[c, 0] > pull * (1.0 + 1e-9) + normal[c] * slack or out:
            new_state[c], new_bonded[c] = OPEN, 0
            violation[c] = normal[c] * abs(gap)
        elif state[c] == STICK:
            strength = max(0.0, peak[c] * forces[c, 0] + hold[c] + (cohesion[c] if bonded[c] else 0.0))
            excess = abs(forces[c, 1]) - strength
            if excess > 1e-9 * strength + 1e-3 * shear[c] * slack:
                new_state[c], new_bonded[c] = SLIP, (2 if keeps[c] and bonded[c] else 0)
                new_direction[c] = np.sign(forces[c, 1])
                violation[c] = excess
        elif friction[c] > 0.0 or sliding[c] > 0.0:
            strength = max(0.0, friction[c] * forces[c, 0] + sliding[c])
            trial = direction[c] * (shear0[c] - shear[c] * slide)
            if strength - trial > 1e-9 * strength + 1e-3 * shear[c] * slack:
                # By way of sticking even if it would slide back: turned about at once, two solutions may alternate.
                new_state[c] = STICK
                violation[c] = strength - trial
    return new_state, new_direction, new_bonded, violation


def _plastic(forces: np.ndarray, state: np.ndarray, shear_force: np.ndarray, springs: Springs) -> np.ndarray:
    """(n,) m of slip in the step: the motion of sliding contacts without what their shear springs took up."""
    return np.where(state == SLIP, forces[:, 3] - (shear_force - forces[:, 1]) / springs.shear, 0.0)


def _worst_of_their_blocks(
    violation: np.ndarray, block: np.ndarray, other: np.ndarray, order: np.ndarray, share: float
) -> np.ndarray:
    """(n,) True for contacts at least ``share`` times as violated as any other contact of either of their free blocks."""
    worst = np.zeros(len(order))
    np.maximum.at(worst, block, violation)
    np.maximum.at(worst, other, violation)
    worst[order < 0] = 0.0
    return violation >= share * np.maximum(worst[block], worst[other])


def settle(
    pattern: assembly.Pattern,
    matrix: np.ndarray,
    right: np.ndarray,
    found: ContactSet,
    vectors: np.ndarray,
    springs: Springs,
    gap: np.ndarray,
    slack: float,
    max_iterations: int,
    curved: CurvedJoints | None = None,
) -> Settled:
    """Iterate from the states of ``found`` to consistent ones; ``matrix`` (n, 6, 6) and ``right`` (n, 6) are the blocks' own
    part, ``springs`` and ``gap`` those of this step (dashpots included). ``curved`` joints bend them from iteration to
    iteration.

    Raises `Unsettled` when ``max_iterations`` do not suffice.
    """
    block, other, partner, shear_force = found.block, found.other, found.partner, found.shear
    state, direction, bonded = found.state, found.direction, found.bonded
    straight, straight_gap = springs, gap
    normal_force, slip = found.normal, np.zeros(len(found))
    data = np.empty(pattern.size)
    side = np.empty(6 * pattern.n)
    seen: set[bytes] = set()
    patience = 0
    worst = -1
    for iteration in range(1, max_iterations + 1):
        if curved is not None:
            springs, gap = curved.lines(
                straight,
                straight_gap,
                found,
                state,
                direction,
                bonded,
                normal_force,
                np.where(state == SLIP, slip, 0.0),
            )
        symmetric = assembly.assemble_contacts(
            data, side, matrix, right, pattern.stride, pattern.diagonal, pattern.upper, pattern.lower, block, other,
            pattern.order, vectors, state, direction, gap, springs.normal, springs.shear, springs.friction,
            springs.sliding, springs.lift, shear_force,
        )  # fmt: skip
        try:
            unknowns = assembly.solve(pattern, data, side, symmetric)
        except np.linalg.LinAlgError as error:
            raise Unsettled(str(error)) from error
        if not np.isfinite(unknowns).all():
            raise Unsettled("the step's matrix is singular")
        forces = contact_forces(
            unknowns, block, other, pattern.order, vectors, state, direction, gap, springs.normal, springs.shear,
            springs.friction, springs.sliding, springs.lift, shear_force,
        )  # fmt: skip
        normal_force = forces[:, 0]
        known, missed = springs, None
        if curved is not None:
            slip = _plastic(forces, state, shear_force, springs)
            known, known_gap = curved.lines(straight, straight_gap, found, state, direction, bonded, normal_force, slip)
            missed = curved.misfit(springs, gap, known, known_gap, state, forces)
        new_state, new_direction, new_bonded, violation = check_states(
            forces, partner, state, direction, bonded, known.normal, known.shear, known.friction, known.sliding,
            known.peak, known.hold, known.cohesion, known.tension, known.keeps, shear_force, slack,
        )  # fmt: skip
        wrong = violation > 0
        agreed = missed is None or not missed.any()
        if agreed and not wrong.any():
            slip = _plastic(forces, state, shear_force, springs)
            lifted = np.zeros(len(found))
            if curved is not None:
                lifted = springs.lift * np.where(springs.lift * direction < 0, slip, forces[:, 3])
            return Settled(
                unknowns=unknowns.reshape(-1, 6),
                state=state,
                direction=direction,
                bonded=bonded,
                normal_force=normal_force,
                shear_force=forces[:, 1],
                gap=forces[:, 2] + springs.lift * forces[:, 3] - lifted - (gap - found.gap),
                slip=slip,
                lifted=lifted,
                springs=springs,
                iterations=iteration,
            )
        if not wrong.any():
            worst = int(missed.argmax())
            continue
        worst = int(violation.argmax())
        mark = state.tobytes() + direction.tobytes() + bonded.tobytes()
        if mark in seen and patience < 2:
            patience += 1
            seen.clear()
            if patience == 1:
                # A body held by sliding contacts alone has nothing but its inertia against the least imbalance: begin
                # again from sticking, and let only the contact that is worst off slide.
                state = np.where((state == SLIP) & (springs.friction > 0), STICK, state)
                continue
        seen.add(mark)
        if patience == 0 and iteration > _ALL_AT_ONCE:
            wrong &= _worst_of_their_blocks(violation, block, other, pattern.order, 0.5)
        if patience == 1:
            wrong &= _worst_of_their_blocks(violation, block, other, pattern.order, 1.0)
        elif patience == 2:
            wrong[int(wrong.argmax()) + 1 :] = False
        state = np.where(wrong, new_state, state)
        direction = np.where(wrong, new_direction, direction)
        bonded = np.where(wrong, new_bonded, bonded)
    name = ("open", "sticking", "sliding")
    raise Unsettled(
        f"contact states did not settle in {max_iterations} open-close iterations; a contact that was {name[state[worst]]} "
        "still disagrees with its motion",
        worst,
    )
