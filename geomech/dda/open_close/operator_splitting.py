"""Contact states of a step in motion by operator splitting: blocks and contacts are solved by turns, with one
factorisation.

With the blocks' equations A d = f + Gᵀ F, the relative motions q = G d of contacts, and the contact law F(q), springs
of ρ on all contacts split the step into two problems that are easy alone (Douglas & Rachford 1956; Lions & Mercier
1979; known as ADMM, Boyd et al. 2011):

    contacts   z:  ρ (z − ζ) = F(z)                     the law of each by itself, in closed form (Coulomb return)
    blocks     d:  (A + Gᵀ ρ G) d = f + Gᵀ ρ (2 z − ζ)  one substitution, for the matrix stays what it is
               ζ ← ζ + α (G d − z),  0 < α < 2          (α > 1: Eckstein & Bertsekas 1992)

Where z = G d, the forces F(z) balance the blocks. Unlike Newton's method on states it does not overshoot where hundreds of
contacts change at once, and hard springs do not slow it down: how fast it converges depends on the blocks, whose answer
lies between their inertia 2m/dt² and their stiffness E'. ρ is the geometric mean of these two. After some tens of
substitutions what is left wrong are contacts that bear next to nothing, and Newton's method finds all states from there. A
substitution takes a twentieth of an iteration of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import kept
from ...model import OPEN, SLIP, STICK, ContactSolver
from ..equation_records import ContactMotion, ContactStiffness
from ..linear_solver import assembly
from .equations import Equations, States
from .interior_point.contact_terms import balance

#: The bond of a contact that has slipped and not lost all cohesion: it may slide.
_SLIPPED = 2
#: α, the over-relaxation.
_RELAXATION = 1.7
#: Substitutions between two looks at how many states have changed.
_LOOK = 10
#: … and after how many they tell whether it leads anywhere.
_SLOW = 60
#: What a substitution takes, in iterations of Newton's method.
_SUBSTITUTION = 0.05


class Proposal(NamedTuple):
    """The ``states`` that contacts approach, None where they do not, and what it took, in iterations of Newton's
    method."""

    states: States | None
    spent: float


@kept(fastmath={"contract"}, error_model="numpy", nogil=True)
def _turn(unknowns, ends, vectors, law, held, relaxation, at_hand, states):
    """One turn of the contacts about the blocks' ``unknowns`` (6 n_free,). ``ends``: both blocks' numbers (n,) each;
    ``law`` (n, 7): gap, kₙ, kₛ, S₀, μ, c, ρ; ``held`` (n,) by bonds. ``at_hand`` (n, 6) has ζ, z and the forces
    ρ (2z − ζ − q), each across and along; ``states``: state and direction (n,) of z."""
    state, direction = states
    for c in range(len(law)):
        apart = along = 0.0
        for side in range(2):
            b = ends[side][c]
            if b < 0:
                continue
            for a in range(6):
                apart += vectors[c, 0, 6 * side + a] * unknowns[6 * b + a]
                along += vectors[c, 1, 6 * side + a] * unknowns[6 * b + a]
        gap, normal, shear, before, friction, firm, rho = law[c]
        now = at_hand[c]
        across, slid = now[0] + relaxation * (apart - now[2]), now[1] + relaxation * (along - now[3])
        z, s = across, slid
        state[c], direction[c] = OPEN, 0.0
        if held[c] or gap + across < 0.0:
            z = (rho * across - normal * gap) / (rho + normal)
            s = (rho * slid + before) / (rho + shear)
            strength, force = firm - friction * normal * (gap + z), before - shear * s
            state[c] = STICK
            if not held[c] and abs(force) > strength:
                state[c], direction[c] = SLIP, (1.0 if force > 0.0 else -1.0)
                s = slid + direction[c] * strength / rho
        now[0], now[1], now[2], now[3] = across, slid, z, s
        now[4], now[5] = rho * (2.0 * z - across - apart), rho * (2.0 * s - slid - along)


def stiffness_between(equations: Equations) -> np.ndarray:
    """(n,) N/m: ρ of each contact, the geometric mean of inertia and stiffness of the softer of its two blocks."""
    matrix, order, found = equations.matrix, equations.pattern.order, equations.found
    inertia = np.append(np.minimum(matrix[:, 0, 0], matrix[:, 1, 1]), np.inf)
    both = np.append(np.sqrt(inertia[:-1] * np.maximum(inertia[:-1], matrix[:, 3, 3])), np.inf)
    rho = np.minimum(both[order[found.block]], both[order[found.other]])
    return np.where(np.isfinite(rho), rho, 1.0)


def can_split(equations: Equations) -> bool:
    """Not in statics, where no inertia holds blocks, nor for blocks of higher order or curved laws, nor where the system
    is so small that its matrix is full."""
    if equations.statics or equations.expected is None or not equations.first_order:
        return False
    return equations.curved is None and equations.pattern.solver is not None


def split(equations: Equations, bonded: np.ndarray, solver: ContactSolver) -> Proposal:
    """The states that the step's contacts come to, with the bonds ``bonded`` (n,) kept, from the motion of the
    velocities and the forces carried over; None for states where it converges too slowly to lead there. Raises
    numpy.linalg.LinAlgError."""
    pattern, found, springs = equations.pattern, equations.found, equations.springs
    order, vectors = pattern.order, np.ascontiguousarray(equations.vectors)
    rho, none = stiffness_between(equations), np.zeros(len(found))
    data = equations.room()
    assembly.assemble(
        pattern, data, equations.matrix, ContactMotion(found.block, found.other, order, vectors),
        ContactStiffness(rho, rho, none, none), sides=equations.sides,
    )  # fmt: skip
    pattern.add_links(data)
    correction = pattern.solver.corrections(data)

    slipped, slides = bonded == _SLIPPED, found.state == SLIP
    friction = np.where(slides, springs.friction, springs.peak)
    firm = np.where(slides, springs.sliding, springs.hold + np.where(slipped, springs.cohesion, 0.0))
    held = (bonded > 0) & ~slipped
    law = np.stack([equations.gap, springs.normal, springs.shear, found.shear, friction, firm, rho], axis=1)
    contacts = (order[found.block], order[found.other]), vectors, law, held

    # Before the first turn z is not known: ζ begins as q − F/ρ.
    unknowns, at_hand = equations.expected.copy(), np.zeros((len(found), 6))
    strength = np.where(held, np.inf, friction * np.maximum(found.normal, 0.0) + firm)
    at_hand[:, 0], at_hand[:, 1] = -found.normal / rho, -np.clip(found.shear, -strength, strength) / rho
    states = found.state.copy(), np.zeros(len(found))
    seen, relaxation = states[0].copy(), 1.0
    for taken in range(1, solver.splitting_iterations + 1):
        _turn(unknowns, *contacts, relaxation, at_hand, states)
        relaxation = _RELAXATION
        if taken % _LOOK == 0:
            changing = np.count_nonzero(states[0] != seen) / len(found)
            if changing <= solver.splitting_settled:
                break
            if taken == _SLOW and changing > solver.splitting_slow:
                return Proposal(None, 1.0 + _SUBSTITUTION * taken)
            seen[:] = states[0]
        rest = (equations.right - pattern.without_contacts(equations.matrix, unknowns)).ravel()
        balance(0, pattern.n, *equations.sides, vectors, at_hand, 4, 5, rest, rest)
        unknowns += correction(rest)
    return Proposal(States(*states, bonded), 1.0 + _SUBSTITUTION * taken)
