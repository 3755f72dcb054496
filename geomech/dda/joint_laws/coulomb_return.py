"""Coulomb return: contact forces in given states, and the states that these forces require.

With gap g, motion n·Δu along the normal and t·Δu along the edge, N = −kₙ g and S = S₀ − kₛ t·Δu. A closed contact must
not exceed its tensile strength, an open one must not overlap, a sticking one needs |S| < μN + cℓ, and a sliding one
must have a trial force |S| > μN + cℓ. This is the return mapping of an elastic-plastic spring, under which exactly one
state fits a given motion. (The criterion of Shi 1988, the sign of the sliding, leaves cases that fit none.)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ...model import OPEN, SLIP, STICK
from ..kinematics.tolerances import LITTLE, SAME

#: Products may be fused into sums.
_jit = kept(fastmath={"contract"}, error_model="numpy", nogil=True)


@part(fastmath={"contract"}, error_model="numpy", nogil=True, inline="always", **UNCOUNTED)
def _move(unknowns, block, other, order, vectors, c):
    """Motion of contact ``c`` along the normal and along the edge. (Inlined: a call takes twice as long as the
    sums.)"""
    apart = along = 0.0
    i, j = order[block[c]], order[other[c]]
    if i >= 0:
        for a in range(6):
            apart += vectors[c, 0, a] * unknowns[6 * i + a]
            along += vectors[c, 1, a] * unknowns[6 * i + a]
    if j >= 0:
        for a in range(6):
            apart += vectors[c, 0, 6 + a] * unknowns[6 * j + a]
            along += vectors[c, 1, 6 + a] * unknowns[6 * j + a]
    return apart, along


@_jit
def moved(unknowns, block, other, order, vectors):
    """(n, 2): motion in the step along the normal and along the edge."""
    out = np.empty((block.shape[0], 2))
    for c in range(block.shape[0]):
        out[c, 0], out[c, 1] = _move(unknowns, block, other, order, vectors, c)
    return out


class ContactStates(NamedTuple):
    """State, sense of sliding and bond of each contact (n,)."""

    state: np.ndarray
    direction: np.ndarray
    bonded: np.ndarray

    @property
    def key(self) -> bytes:
        return self.state.tobytes() + self.direction.tobytes() + self.bonded.tobytes()

    def without_open_bonds(self) -> ContactStates:
        """These states, without the bonds that are open."""
        return ContactStates(self.state, self.direction, np.where(self.state == OPEN, 0, self.bonded))

    def switched(self, wrong: np.ndarray, to: ContactStates) -> ContactStates:
        """These states, replaced by those of ``to`` where ``wrong``."""
        return ContactStates(*(np.where(wrong, new, old) for old, new in zip(self, to, strict=True)))

    def sliding(self, which: np.ndarray, shear: np.ndarray) -> ContactStates:
        """These states, with the contacts ``which`` that have no bond sliding under ``shear`` (n,) N."""
        which = which & (self.bonded == 0) & (shear != 0)
        direction = np.where(which, np.sign(shear), self.direction)
        return ContactStates(np.where(which, SLIP, self.state), direction, self.bonded)


@_jit
def contact_forces(unknowns, contacts, springs):
    """(n, 4): normal force, shear force, new gap and motion along the edge in the step, of ``contacts`` (`ContactMotion`)
    with ``springs`` in the present states (`SpringsInStates`)."""
    block, other, order, vectors = contacts
    state, direction, gap0, normal, shear, friction, sliding, lift, shear0 = springs
    n = block.shape[0]
    forces = np.zeros((n, 4))
    for c in range(n):
        apart, along = _move(unknowns, block, other, order, vectors, c)
        gap = gap0[c] + apart - lift[c] * along
        forces[c, 2], forces[c, 3] = gap, along
        if state[c] != OPEN:
            forces[c, 0] = -normal[c] * gap
            if state[c] == STICK:
                forces[c, 1] = shear0[c] - shear[c] * along
            else:
                forces[c, 1] = direction[c] * (friction[c] * forces[c, 0] + sliding[c])
    return forces


@kept(fastmath=False, error_model="numpy", nogil=True)
def check_states(forces, states, springs, shear0, slack):
    """The states that the ``forces`` (n, 4) of `contact_forces` in the ``states`` (`ContactStates`) require.

    Returns (new state; direction; bonded; violation (n,) N, 0 where the state is right). ``springs`` (`Springs`), ``shear0``
    (n,) N as the step begins. Gaps below ``slack`` (n,) m, the round-off of coordinates, and their effect on friction
    do not change a state.
    """
    state, direction, bonded = states
    normal, shear, friction, sliding, peak, hold, cohesion, tension, _lift, keeps, _crushing = springs
    n = state.shape[0]
    new_state, new_direction, new_bonded = state.copy(), direction.copy(), bonded.copy()
    violation = np.zeros(n)
    for c in range(n):
        gap, slide = forces[c, 2], forces[c, 3]
        if state[c] == OPEN:
            if gap >= -slack[c]:
                continue
            violation[c] = -normal[c] * gap
            # The next state is that of the springs under the present motion. If it were to stick where it has to slide,
            # a contact could pull, open and close again, and never start to slide.
            trial = shear0[c] - shear[c] * slide
            if abs(trial) > violation[c] * friction[c] + sliding[c] and bonded[c] == 0:
                new_state[c], new_direction[c] = SLIP, np.sign(trial)
            else:
                new_state[c] = STICK
            continue
        pull = tension[c] if bonded[c] == 1 else 0.0
        if -forces[c, 0] > pull * (1.0 + SAME) + normal[c] * slack[c]:
            # Without tensile strength it opens without breaking, since it may close again during the iteration.
            new_state[c], new_bonded[c] = OPEN, (0 if pull > 0.0 else bonded[c])
            violation[c] = normal[c] * abs(gap)
        elif state[c] == STICK:
            strength = max(0.0, peak[c] * forces[c, 0] + hold[c] + (cohesion[c] if bonded[c] else 0.0))
            excess = abs(forces[c, 1]) - strength
            if excess > SAME * strength + (LITTLE * shear[c] + peak[c] * normal[c]) * slack[c]:
                new_state[c], new_bonded[c] = SLIP, (2 if keeps[c] and bonded[c] else 0)
                new_direction[c] = np.sign(forces[c, 1])
                violation[c] = excess
        elif friction[c] > 0.0 or sliding[c] > 0.0:
            strength = max(0.0, friction[c] * forces[c, 0] + sliding[c])
            trial = direction[c] * (shear0[c] - shear[c] * slide)
            if strength - trial > SAME * strength + (LITTLE * shear[c] + friction[c] * normal[c]) * slack[c]:
                # Through sticking, even if it would slide back: two solutions of opposite direction may alternate.
                new_state[c] = STICK
                violation[c] = strength - trial
    return new_state, new_direction, new_bonded, violation


def reserves(state, bonded, normal_force, shear_force, gap, springs, slack) -> np.ndarray:
    """(n,) N: distance of contacts from a change of state, linear in the load at constant states.

    Open contacts: the force of the spring if the gap closed; sticking ones: the remaining strength, or the normal
    force; sliding ones: the normal force. Zero where `check_states` changes the state, including the effect of the
    round-off ``slack`` (n,) m of coordinates."""
    rounding = springs.normal * slack
    pull = np.where(bonded == 1, springs.tension, 0.0)
    lifts = normal_force + pull * (1.0 + SAME) + rounding
    firm = springs.hold + np.where(bonded > 0, springs.cohesion, 0.0)
    strength = np.maximum(0.0, springs.peak * normal_force + firm)
    excess = SAME * strength + (LITTLE * springs.shear + springs.peak * springs.normal) * slack
    closed = np.where(state == STICK, np.minimum(lifts, strength + excess - np.abs(shear_force)), lifts)
    return np.where(state == OPEN, springs.normal * gap + rounding, closed)
