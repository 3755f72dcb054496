"""Contact states of a dynamic step by operator splitting: blocks and contacts are solved alternately, with one
factorisation for many iterations.

With the blocks' equations A d = f + Gᵀ F, the relative motions q = G d of contacts, and the contact law F(q), springs ρ
on all contacts split the step into two problems that are easy separately (Douglas & Rachford 1956; Lions & Mercier
1979; known as ADMM, Boyd et al. 2011):

    contacts   z:  ρ (z − ζ) = F(z)                     law of each contact, in closed form (Coulomb return)
    blocks     d:  (A + Gᵀ ρ G) d = f + Gᵀ ρ (2 z − ζ)  one substitution, as the matrix does not change
               ζ ← ζ + α (G d − z),  0 < α < 2          (α > 1: Eckstein & Bertsekas 1992)

Where z = G d, the forces F(z) balance the blocks. Unlike Newton's method on states it does not overshoot where hundreds
of contacts change at once, and stiff springs do not slow it down: the rate of convergence depends on the blocks, whose
response is between their inertia 2m/dt² and their stiffness E'. A motion that a contact prevents converges faster with
larger ρ, a free motion with smaller ρ. Along the edge of a sliding contact, ρ is the geometric mean of the two; at a
closed contact it is half way (logarithmically) between this mean and the stiffness, at an open one half way to the
inertia. The states are at first those at the start of the step, later those found, if many have changed. (With the mean
everywhere, twice the number of iterations leaves more inconsistent contacts; at the bounds, states keep changing.) The
contacts that remain inconsistent carry hardly any load, and Newton's method finds all states from there. One iteration
takes a tenth of the time of a Newton iteration.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, kept
from ...model import OPEN, SLIP, STICK, ContactSolver
from ..equation_records import ContactMotion, ContactStiffness
from ..joint_laws.coulomb_return import ContactStates
from ..linear_solver import assembly
from .equations import Equations
from .interior_point.central_path import SLIPPED
from .interior_point.contact_terms import balance

#: α, the over-relaxation.
_RELAXATION = 1.7
#: Number of iterations between checks of how many states have changed.
_LOOK = 10
#: Iterations after which ρ is adapted to the states, if more than this fraction of them has changed since.
_FOLLOWS, _MANY = (20, 40, 80), 0.05
#: Cost of an iteration and of a factorisation, in Newton iterations.
_TURN, _FACTORS = 0.1, 1.0


class Proposal(NamedTuple):
    """The ``states`` that contacts approach, and the cost in Newton iterations."""

    states: ContactStates
    spent: float


@kept(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def contact_turn(unknowns, contacts, law, rho, intact, relaxation, at_hand, states):
    """The contact part of one iteration, for the blocks' ``unknowns`` (6 n_free,) and ``contacts`` (`ContactMotion`).
    ``law`` (n, 7): gap, kₙ, kₛ, S₀, μ, c, and the gap over which c falls to 0; ``rho`` (2, n) normal and tangential;
    ``intact`` (n,): unbroken bonds. ``at_hand`` (n, 6): ζ, z and the forces ρ (2z − ζ − q), each normal and tangential; ``states``:
    state and direction (n,) of z."""
    state, direction = states
    block, other, order, vectors = contacts
    for c in range(len(law)):
        apart = along = 0.0
        for side in range(2):
            b, k = order[block[c] if side == 0 else other[c]], 6 * side
            if b < 0:
                continue
            for a in range(6):
                apart += vectors[c, 0, k + a] * unknowns[6 * b + a]
                along += vectors[c, 1, k + a] * unknowns[6 * b + a]
        gap, normal, shear, before, friction, cohesion, fades = (
            law[c, 0],
            law[c, 1],
            law[c, 2],
            law[c, 3],
            law[c, 4],
            law[c, 5],
            law[c, 6],
        )
        normal_rho, shear_rho = rho[0, c], rho[1, c]
        normal_motion = at_hand[c, 0] + relaxation * (apart - at_hand[c, 2])
        shear_motion = at_hand[c, 1] + relaxation * (along - at_hand[c, 3])
        z, s = normal_motion, shear_motion
        state[c], direction[c] = OPEN, 0.0
        if intact[c] or gap + normal_motion < fades:
            strength = cohesion
            if intact[c] or gap + normal_motion < 0.0:
                z = (normal_rho * normal_motion - normal * gap) / (normal_rho + normal)
                strength -= friction * normal * (gap + z)
            else:
                strength *= 1.0 - (gap + z) / fades
            s = (shear_rho * shear_motion + before) / (shear_rho + shear)
            force = before - shear * s
            state[c] = STICK
            if not intact[c] and abs(force) > strength:
                state[c], direction[c] = SLIP, (1.0 if force > 0.0 else -1.0)
                s = shear_motion + direction[c] * strength / shear_rho
        at_hand[c, 0], at_hand[c, 1], at_hand[c, 2], at_hand[c, 3] = normal_motion, shear_motion, z, s
        at_hand[c, 4], at_hand[c, 5] = (
            normal_rho * (2.0 * z - normal_motion - apart),
            shear_rho * (2.0 * s - shear_motion - along),
        )


def can_split(equations: Equations) -> bool:
    """Whether splitting applies: not in statics (no inertia), for blocks of higher order, nonlinear laws or small
    systems with a full matrix, nor without earlier contact forces to start from, as under sudden weight."""
    if equations.statics or equations.expected is None or not equations.first_order:
        return False
    if not equations.found.normal.any():
        return False
    return equations.curved is None and equations.pattern.solver is not None


class _Springs:
    """The springs ρ of all contacts: ``rho`` (2, n) N/m, normal and tangential, and ``correction``, the response of the
    blocks to unbalanced forces."""

    def __init__(self, equations: Equations, contacts: ContactMotion) -> None:
        self._equations, self._contacts = equations, contacts
        matrix, order, found = equations.matrix, equations.pattern.order, equations.found

        def of_softer(value: np.ndarray) -> np.ndarray:
            value = np.append(value, np.inf)
            softer = np.minimum(value[order[found.block]], value[order[found.other]])
            return np.where(np.isfinite(softer), softer, 1.0)

        inertia = np.minimum(matrix[:, 0, 0], matrix[:, 1, 1])
        soft, stiff = of_softer(inertia), of_softer(np.maximum(inertia, matrix[:, 3, 3]))
        self._mean = np.sqrt(soft * stiff)
        self._if_open, self._if_closed = np.sqrt(self._mean * soft), np.sqrt(self._mean * stiff)
        self._become(found.state if found.tried is None else found.tried[0])

    def _become(self, state: np.ndarray) -> None:
        """Set ρ according to the ``state`` (n,) of the contacts."""
        self._state = state.copy()
        across = np.where(state == OPEN, self._if_open, self._if_closed)
        self.rho = rho = np.stack([across, np.where(state == SLIP, self._mean, across)])
        equations, none = self._equations, np.zeros(rho.shape[1])
        pattern, data = equations.pattern, equations.room()
        stiffness = ContactStiffness(rho[0], rho[1], none, none)
        assembly.assemble(pattern, data, equations.matrix, self._contacts, stiffness, sides=equations.sides)
        pattern.add_links(data)
        assert pattern.solver is not None  # `split` is for large systems
        self.correction = pattern.solver.corrections(data)

    def follow(self, state: np.ndarray, at_hand: np.ndarray) -> bool:
        """Set ρ according to the ``state`` (n,) of the contacts if many have changed. ζ in ``at_hand`` (n, 6) is
        adapted so that the contact forces ρ (z − ζ) stay the same."""
        if np.count_nonzero(state != self._state) <= _MANY * len(state):
            return False
        forces = self.rho.T * (at_hand[:, 2:4] - at_hand[:, :2])
        self._become(state)
        at_hand[:, :2] = at_hand[:, 2:4] - forces / self.rho.T
        return True


def linear_laws(equations: Equations, bonded: np.ndarray) -> np.ndarray:
    """(n, 7) of the contacts with bonds ``bonded`` (n,), as for `contact_turn`: gap, kₙ, kₛ, S₀, μ, c, 0."""
    found, springs = equations.found, equations.springs
    slides = found.state == SLIP
    friction = np.where(slides, springs.friction, springs.peak)
    held = springs.hold + np.where(bonded == SLIPPED, springs.cohesion, 0.0)
    cohesion = np.where(slides, springs.sliding, held)
    none = np.zeros(len(found))
    return np.stack([equations.gap, springs.normal, springs.shear, found.shear, friction, cohesion, none], axis=1)


def split(equations: Equations, bonded: np.ndarray, solver: ContactSolver) -> Proposal:
    """Proposed contact states of the step with fixed bonds ``bonded`` (n,), starting from the motion at the present
    velocities and the forces carried over. Raises numpy.linalg.LinAlgError."""
    pattern, found = equations.pattern, equations.found
    order, vectors = pattern.order, np.ascontiguousarray(equations.vectors)
    contacts = ContactMotion(found.block, found.other, order, vectors)
    between = _Springs(equations, contacts)

    law = linear_laws(equations, bonded)
    intact, friction, cohesion = (bonded > 0) & (bonded != SLIPPED), law[:, 4], law[:, 5]

    # Before the first iteration z is unknown: ζ starts as q − F/ρ.
    assert equations.expected is not None  # `split` is for motion
    unknowns, at_hand = equations.expected.copy(), np.zeros((len(found), 6))
    strength = np.where(intact, np.inf, friction * np.maximum(found.normal, 0.0) + cohesion)
    forces = np.stack([found.normal, np.clip(found.shear, -strength, strength)], axis=1)
    at_hand[:, :2] = -forces / between.rho.T
    states = found.state.copy(), np.zeros(len(found))
    seen, relaxation, spent = states[0].copy(), 1.0, _FACTORS
    for taken in range(1, solver.splitting_iterations + 1):
        contact_turn(unknowns, tuple(contacts), law, between.rho, intact, relaxation, at_hand, states)
        relaxation, spent = _RELAXATION, spent + _TURN
        if taken % _LOOK == 0:
            changing = np.count_nonzero(states[0] != seen) / len(found)
            if taken > _FOLLOWS[0] and changing <= solver.splitting_settled:
                break
            seen[:] = states[0]
        rest = (equations.right - pattern.without_contacts(equations.matrix, unknowns)).ravel()
        balance(0, pattern.n, *equations.sides, vectors, at_hand, 4, 5, rest, rest)
        unknowns += between.correction(rest)
        if taken in _FOLLOWS and between.follow(states[0], at_hand):
            spent += _FACTORS
    return Proposal(ContactStates(*states, bonded), spent)
