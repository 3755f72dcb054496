"""Correction of velocities at the end of a step: sliding that friction stops within the step, and contact vibrations
that the step does not resolve.

A step applies its forces over its whole length. Friction that stops a block within the step would keep acting until its
end and leave the block with a speed of the order of a dt, often backwards. The correction is an impulse. Sliding stops
at t*, the zero of the line from the sliding speed u₀ at the start to the speed at the end with full friction. Over the
rest r = dt − t* of the step, friction may have any value |S| ≤ μN + c (Coulomb); the value is taken that leaves no
sliding, or the nearest admissible one (Moreau 1988: Coulomb's law between velocities and impulses).

A closed contact whose spring is stiff compared with m/dt² hardly moves, and v' = 2 d/dt − v merely reverses its speed
from step to step, without damping. Forces then oscillate about equilibrium, and contacts near their strength change
their state in every step. Such a contact ends the step with its mean speed d/dt in the step.

The response of blocks is that of the step: 2M/dt² Δd + (springs) Δd = impulse/dt, Δv = 2 Δd/dt, with all contacts that
stay closed. Momentum is therefore transferred between blocks and not lost, and a spring that the step resolves keeps
its vibration. Kinetic energy never increases.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...compiled import UNCOUNTED, kept
from ...model import OPEN, SLIP, STICK
from ..contact_detection.contact_records import largest_of_blocks
from ..equation_records import BlockEquations, ContactMotion, SpringsInStates
from ..kinematics.tolerances import LITTLE
from ..linear_solver import assembly
from ..open_close.contact_set import ContactSet
from ..open_close.settled_states import Settled

#: Impulses beyond the friction limit are reduced to it at most this many times, or until no more than this fraction of
#: the stopping contacts exceed it.
_ROUNDS, _LEFT = 4, 0.1
#: Value of k dt²/m from which a spring k reverses the speed of a mass m in every step of Shi's scheme: both roots are
#: real, and one tends to −1.
_TURNS_ABOUT = 16.0
#: Vibrations that swing contact forces by less than this part of the largest on a block hardly bring contacts to their
#: strength. (With `NOTABLE`, a block on a shaken base is three times as far off Newmark's.)
_SWINGS = LITTLE
#: Displacement of blocks at rest per step due to rounding, in units of the rounding of one contact: 4 in a wall of 1
#: 000 bricks, 19 in one of 10 000. Slower sliding is not stopped, which would take three solutions in every step.
_PASSED_ON = 20.0


@dataclass(frozen=True, eq=False)
class Unresolved:
    """Speeds ``apart`` and ``along`` (n,) m/s of contacts minus their mean speeds in the step, for springs that the
    step does not resolve; 0 for others."""

    apart: np.ndarray
    along: np.ndarray

    @classmethod
    def of(
        cls, found: ContactSet, settled: Settled, slid: np.ndarray, speeds: np.ndarray, mass: np.ndarray, dt: float,
    ) -> Unresolved | None:  # fmt: skip
        """None if the vibrations are negligible. ``slid`` (n,) m: motion along the edge in the step; ``speeds`` (n, 2)
        m/s across and along the edge at its end; ``mass`` (n_blocks,) kg, infinite if fixed."""
        light = np.where(mass[found.block] <= mass[found.other], found.block, found.other)
        stiff, springs = _TURNS_ABOUT * mass[light] / (dt * dt), settled.springs
        holds = (found.state != OPEN) & (settled.state != OPEN) & (springs.normal > stiff)
        sticks = holds & (found.state == STICK) & (settled.state == STICK) & (springs.shear > stiff)
        apart = np.where(holds, speeds[:, 0] - (settled.gap - found.gap_before) / dt, 0.0)
        along = np.where(sticks, speeds[:, 1] - slid / dt, 0.0)
        rows = np.flatnonzero(holds)
        largest = np.maximum(np.abs(apart[rows]), np.abs(along[rows])) / dt
        if not _worth_it(found, rows, largest, light, mass, settled.normal_force, _SWINGS):
            return None
        return cls(apart, along)


@dataclass(frozen=True, eq=False)
class Stopped:
    """Contacts ``rows`` whose sliding stops in the step. ``sense``: ±1, direction of sliding along the edge; speeds
    (m/s) in that direction ``before`` and ``after`` the step."""

    rows: np.ndarray
    sense: np.ndarray
    before: np.ndarray
    after: np.ndarray

    @classmethod
    def of(
        cls, found: ContactSet, settled: Settled, slid: np.ndarray, along: np.ndarray, mass: np.ndarray, dt: float,
        slack: float,
    ) -> Stopped | None:  # fmt: skip
        """None if no sliding stops. ``slid`` (n,) m: motion along the edge in the step; ``along`` (n,) m/s: speed at
        its end; ``mass`` (n_blocks,) kg, infinite if fixed; ``slack`` m: round-off of a contact (see `_PASSED_ON`)."""
        stuck = (found.state == SLIP) & (settled.state == STICK) & (found.direction != 0.0)
        rows = np.flatnonzero(stuck | ((settled.state == SLIP) & (settled.direction != 0.0)))
        if not len(rows):
            return None
        after = along[rows]
        # Friction acts against the sliding.
        sense = -np.where(stuck[rows], found.direction[rows], settled.direction[rows])
        before = sense * (2.0 * slid[rows] / dt - after)
        keep = (np.abs(after) * dt > _PASSED_ON * slack) & (before > 0.0) & (sense * after < 0.0)
        light = np.where(mass[found.block] <= mass[found.other], found.block, found.other)
        # A brick that slides on a wall of 10 000 moves hundreds of contacts at their strength by 1e-11 m per step, 1e-12 J in
        # all: stopping these would take three more solutions of all equations.
        if not _worth_it(found, rows[keep], np.abs(after[keep]) / dt, light, mass, settled.normal_force, LITTLE):
            return None
        return cls(rows[keep], sense[keep], before[keep], sense[keep] * after[keep])


def _worth_it(
    found: ContactSet, rows: np.ndarray, deceleration: np.ndarray, light: np.ndarray, mass: np.ndarray,
    force: np.ndarray, worth: float,
) -> bool:  # fmt: skip
    """Whether the ``deceleration`` (m/s²) of any of the contacts ``rows`` takes more than the fraction ``worth`` of the
    largest force on its blocks. Of all contacts: ``light`` (n,), the lighter block, and normal ``force`` (n,) N;
    ``mass`` (n_blocks,) kg."""
    if not len(rows):
        return False
    largest = np.zeros(len(mass))
    largest_of_blocks(force, found.block, found.other, largest)
    return bool((deceleration * mass[light[rows]] > worth * largest[light[rows]]).any())


def contact_speeds(found: ContactSet, geometry: np.ndarray, velocity: np.ndarray, centroid: np.ndarray) -> np.ndarray:
    """(n, 2) m/s of the vertex relative to the edge, across the edge and along it; ``geometry`` (n, 7) of the contacts,
    ``velocity`` (n_blocks, 6), ``centroid`` (n_blocks, 2) m."""
    speed = np.empty((len(found), 2))
    _speeds(
        found.block, found.other, np.ascontiguousarray(geometry), np.ascontiguousarray(velocity),
        np.ascontiguousarray(centroid), speed,
    )  # fmt: skip
    return speed


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _speeds(block, other, geometry, velocity, centroid, speed):
    """Fill ``speed`` (n, 2) as `contact_speeds`."""
    for c in range(len(block)):
        across = along = 0.0
        for side in range(2):
            b, sign = (block[c], 1.0) if side == 0 else (other[c], -1.0)
            x, y = geometry[c, 5] - centroid[b, 0], geometry[c, 6] - centroid[b, 1]
            turn, half = velocity[b, 2], 0.5 * velocity[b, 5]
            across += sign * (velocity[b, 0] + (half - turn) * y + velocity[b, 3] * x)
            along += sign * (velocity[b, 1] + (half + turn) * x + velocity[b, 4] * y)
        nx, ny = geometry[c, 1], geometry[c, 2]
        speed[c, 0], speed[c, 1] = nx * across + ny * along, nx * along - ny * across


def stop(
    stopped: Stopped | None, unresolved: Unresolved | None, pattern: assembly.Pattern, matrix: np.ndarray,
    vectors: np.ndarray, found: ContactSet, settled: Settled, dt: float,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """(n_free, 6) m: Δd in the unknowns of `assembly`, velocities change by 2 Δd/dt; and the energy (J/m) dissipated by
    friction. ``matrix`` (n, 6, 6) and ``vectors`` (n_contacts, 2, 12) are those of the step. Raises
    numpy.linalg.LinAlgError."""
    springs, nothing = settled.springs, np.zeros(len(found))
    apart, along = (nothing, nothing) if unresolved is None else (unresolved.apart, unresolved.along)
    data, side = np.empty(pattern.size), np.empty(6 * pattern.n)
    own = BlockEquations(matrix, np.zeros((pattern.n, 6)))
    contacts = ContactMotion(found.block, found.other, pattern.order, vectors)
    sides = assembly.sides_of(pattern.n, pattern.order, found.block, found.other)

    def answer(state, direction, friction, push, pull) -> np.ndarray:
        # Other contacts keep their states: closed ones their gap, sticking ones their position, sliding ones their
        # friction.
        in_states = SpringsInStates(
            state, direction, 0.5 * dt * apart, springs.normal, springs.shear, friction, push, springs.lift, pull
        )
        assembly.assemble_contacts(pattern, own, contacts, in_states, data, side, sides)
        return assembly.solve(pattern, data, side, False).reshape(-1, 6)

    shear = -springs.shear * 0.5 * dt * along
    if stopped is None:
        return answer(settled.state, settled.direction, springs.friction, nothing, shear), 0.0
    rows, sense, u0, u1 = stopped.rows, stopped.sense, stopped.before, stopped.after
    resisted, pushed = -sense * settled.shear_force[rows], settled.normal_force[rows]
    slips = settled.state[rows] == SLIP
    strength = np.maximum(springs.friction[rows] * pushed + springs.sliding[rows], np.abs(resisted))
    # Full friction during the whole step, which sliding contacts had, leaves the speed ``full``.
    full, bound = np.where(slips, u1, np.nan), np.full(len(rows), np.nan)
    for _ in range(_ROUNDS):
        given = ~np.isnan(bound)
        state, push, pull = settled.state.copy(), nothing.copy(), shear.copy()
        direction, friction = settled.direction.copy(), springs.friction.copy()
        state[rows] = np.where(given, SLIP, STICK)
        direction[rows], friction[rows] = 1.0, 0.0
        push[rows] = np.where(given, -sense * (bound - resisted), 0.0)
        pull[rows] = np.where(given, 0.0, -springs.shear[rows] * sense * u1 * 0.5 * dt)
        change = answer(state, direction, friction, push, pull)
        moved = _moved(found, rows, pattern.order, vectors, change)
        force = np.where(given, push[rows], pull[rows] - springs.shear[rows] * moved)
        total = resisted - sense * force
        stuck = np.isnan(full)
        # Change of speed per newton of friction of contacts that stuck: effect of the impulse over the impulse.
        with np.errstate(invalid="ignore", divide="ignore"):
            slowed = np.abs(moved[stuck] * 2.0 / dt / force[stuck])
        full[stuck] = u1[stuck] - np.nan_to_num(slowed, posinf=0.0) * (strength[stuck] - resisted[stuck])
        slowing = u0 - full
        share = np.clip(np.where(slowing > 0.0, u0 / np.where(slowing > 0.0, slowing, 1.0), 1.0), 0.0, 1.0)
        least = strength * (2.0 * share - 1.0)
        beyond = ~given & ((total < least) | (total > strength))
        # Contacts that friction at its limit would reverse stick.
        speed = u1 + sense * moved * 2.0 / dt
        within = given & (np.where(bound < strength, speed, -speed) > 0.0)
        if np.count_nonzero(beyond | within) <= _LEFT * len(rows):
            break
        bound[beyond] = np.clip(total, least, strength)[beyond]
        bound[within] = np.nan
    return change, float(-(force * (dt * sense * u1 + moved)).sum())


def _moved(
    found: ContactSet, rows: np.ndarray, order: np.ndarray, vectors: np.ndarray, change: np.ndarray
) -> np.ndarray:
    """(n,) m along the edge of contacts ``rows`` under ``change`` (n_free, 6)."""
    out = np.zeros(len(rows))
    for k, owner in enumerate((found.block[rows], found.other[rows])):
        free = order[owner] >= 0
        part = vectors[rows[free], 1, 6 * k : 6 * k + 6]
        out[free] += np.einsum("na,na->n", part, change[order[owner[free]]])
    return out


def _product(u: np.ndarray, w: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """(n_blocks,) ∫ u·w of two first-order velocity fields (n_blocks, 6)."""
    area, xx, yy, xy = moments[:, 0], moments[:, 3], moments[:, 4], moments[:, 5]
    p, q, r, s = 0.5 * u[:, 5] - u[:, 2], 0.5 * u[:, 5] + u[:, 2], 0.5 * w[:, 5] - w[:, 2], 0.5 * w[:, 5] + w[:, 2]
    total = area * (u[:, 0] * w[:, 0] + u[:, 1] * w[:, 1])
    total += (u[:, 3] * w[:, 3] + q * s) * xx + (p * r + u[:, 4] * w[:, 4]) * yy
    return total + (u[:, 3] * r + p * w[:, 3] + q * w[:, 4] + u[:, 4] * s) * xy


def kinetic_energy(velocity: np.ndarray, moments: np.ndarray, system) -> float:
    """J/m of the blocks of ``system`` that move, with ``velocity`` (n_blocks, 6) and these `block_moments`."""
    density = np.where(system.fixed, 0.0, system.mass / moments[:, 0])
    return 0.5 * float(density @ _product(velocity, velocity, moments))


def dissipating(
    change: np.ndarray, velocity: np.ndarray, moments: np.ndarray, density: np.ndarray, fixed: np.ndarray
) -> tuple[np.ndarray, float]:
    """The largest fraction of ``change`` (n_blocks, 6) of ``velocity`` that does not increase the kinetic energy of
    blocks that are not ``fixed``, applied; and the energy it dissipates, J/m."""
    mass = np.where(fixed, 0.0, density)
    first = float((mass * _product(velocity, change, moments)).sum())
    second = float((mass * _product(change, change, moments)).sum())
    if first >= 0.0 or second == 0.0:
        return np.zeros_like(change), 0.0
    part = min(1.0, -2.0 * first / second)
    return part * change, -part * (first + 0.5 * part * second)
