"""Bonds of whole faces: strength of a bond between two faces, and its failure.

Two bonded edges are joined by contacts at the ends of their overlap ℓ. The tensile forces Tᵢ of these, at distances aᵢ
from the midpoint, have the resultants T = Σ Tᵢ and M = Σ Tᵢ aᵢ of the stress along the face, which is linear between
blocks of uniform strain. The stress in the extreme fibre is

    σ = T/ℓ + 6 |M|/ℓ²      (Navier; for two corners 2 (2 T₁ − T₀)/ℓ at the end 1),

When it reaches the tensile strength, a brittle bond fails over its whole length, unless the resultant is compressive
and within the face: then the crack from the edge stops before the other end, and the rest of the face keeps friction
and cohesion but no tensile strength. In shear the face carries Σ |Sᵢ| ≤ c ℓ + tan φ Σ Nᵢ wherever Σ Nᵢ acts: either end
can carry the other's share. Corners considered one by one would carry three times the moment, and half the cohesion if
one end slips before the other.

A contact without tensile strength opens without breaking: it may close again, with its cohesion, during the open–close
iteration, and loses it only if it is open at the end. Bonds break one after the other, in the order in which a load
that grows linearly during the step would break them: with f(t) = f₀ + t (f₁ − f₀) the load of a face minus its
strength, the face that reaches f = 0 first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ...model import OPEN, SLIP, STICK
from ..kinematics.tolerances import NOTABLE, ONE_FACE_COS, ONE_FACE_SIN
from .coulomb_return import ContactStates
from .penalty_springs import Springs

#: Bond states of a CONTACT row: intact, and cracked from its edge (cohesion only under compression).
WHOLE, CRACKED = 1, 3
#: Relative difference between a face's length and the sum of its tributary lengths above which it has gaps.
WITHOUT_GAPS = NOTABLE


class BondedFaces(NamedTuple):
    """Faces (m,) with at least two bonds at the start of a step.

    start   (m + 1,)  first position of each face's contacts in ``rows``
    rows    (k,)      contacts, rows of the step's `ContactSet`
    arm     (k,) m    from the midpoint of the face
    length  (m,) m
    """

    start: np.ndarray
    rows: np.ndarray
    arm: np.ndarray
    length: np.ndarray

    @classmethod
    def none(cls) -> BondedFaces:
        """No faces."""
        nothing = np.zeros(0)
        return cls(np.zeros(1, np.int64), np.zeros(0, np.int64), nothing, nothing)

    @classmethod
    def of(cls, block: np.ndarray, other: np.ndarray, geometry: np.ndarray, bonded: np.ndarray) -> BondedFaces | None:
        """Faces among the contacts (n,) of a `ContactSet`; None if there are none."""
        some = np.flatnonzero(((bonded == WHOLE) | (bonded == CRACKED)) & (geometry[:, 4] > 0))
        if len(some) < 2:
            return None
        some, start, along = on_lines(block, other, geometry, some)
        low, high = np.minimum.reduceat(along, start[:-1]), np.maximum.reduceat(along, start[:-1])
        length, tributary = high - low, np.add.reduceat(geometry[some, 4], start[:-1])
        keep = (np.diff(start) > 1) & (np.abs(tributary - length) <= WITHOUT_GAPS * length)
        if not keep.any():
            return None
        members = np.repeat(keep, np.diff(start))
        arm = along - np.repeat(0.5 * (low + high), np.diff(start))
        return cls(np.append(0, np.cumsum(np.diff(start)[keep])), some[members], arm[members], length[keep])


def on_lines(
    block: np.ndarray, other: np.ndarray, geometry: np.ndarray, some: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The contacts ``some`` (k,) of a `ContactSet` grouped by face: their rows, the begin and end of each face among
    these, and their coordinates along it (m)."""
    first, last = np.minimum(block[some], other[some]), np.maximum(block[some], other[some])
    order = np.lexsort((last, first))
    some = some[order]
    swapped = block[some] > other[some]
    face, along = _on_one_line(first[order], last[order], swapped, np.ascontiguousarray(geometry[some]))
    by_face = np.argsort(face, kind="stable")
    face = face[by_face]
    start = np.append(np.flatnonzero(np.diff(face, prepend=-1)), len(face))
    return some[by_face], start, along[by_face]


@kept(fastmath=False, error_model="numpy", nogil=True)
def _on_one_line(first, last, swapped, geometry):
    """Face number of each contact (n,) and its coordinate along the face (m); contacts are ordered by pairs of
    blocks."""
    n = first.shape[0]
    face, lead, along = np.empty(n, np.int64), np.empty(n, np.int64), np.zeros(n)
    pair, faces = 0, 0
    for c in range(n):
        if first[c] != first[pair] or last[c] != last[pair]:
            pair = c
        face[c] = -1
        sense = -1.0 if swapped[c] else 1.0
        for k in range(pair, c):
            if lead[k] != k:
                continue
            turn = sense * (-1.0 if swapped[k] else 1.0)
            nx, ny = geometry[k, 1], geometry[k, 2]
            dx, dy = geometry[c, 5] - geometry[k, 5], geometry[c, 6] - geometry[k, 6]
            straight = turn * (nx * geometry[c, 1] + ny * geometry[c, 2]) > ONE_FACE_COS
            if straight and abs(nx * dx + ny * dy) <= ONE_FACE_SIN * np.sqrt(dx * dx + dy * dy):
                face[c], lead[c], along[c] = face[k], k, nx * dy - ny * dx
                break
        if face[c] < 0:
            face[c], lead[c] = faces, c
            faces += 1
    return face, along


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _when(before, after, strength):
    """Fraction of the step at which the ``strength`` (N) is reached, with load minus strength ``before`` at the start
    of the step and ``after`` at its end; negative if it is exceeded from the start."""
    if before > 0.0:
        return -before / (before + strength)
    return -before / max(after - before, 1e-300)


class ForcesBefore(NamedTuple):
    """Normal and shear forces of contacts (n,) at the start of the step, N."""

    normal: np.ndarray
    shear: np.ndarray


class _FaceLoads(NamedTuple):
    """Loads of a face (N; ``fibre``: stress in the extreme fibre times length) and strengths (N): tensile, and
    ``capacity`` in shear, of which ``firm`` does not depend on pressure."""

    fibre: float
    drawn: float
    strength: float
    capacity: float
    firm: float


@kept(fastmath=False, error_model="numpy", nogil=True)
def first_to_break(faces, forces, before, states, new_bonded, strengths):
    """(n,) fraction of the step at which each bond that is broken in ``new_bonded`` reaches its strength; inf for
    others. Arguments as for `check_faces`; there may be no faces."""
    state, bonded = states.state, states.bonded
    n = state.shape[0]
    out, done = np.full(n, np.inf), np.zeros(n, np.bool_)
    for f in range(faces.length.shape[0]):
        some, intact = False, True
        for k in range(faces.start[f], faces.start[f + 1]):
            c = faces.rows[k]
            intact &= (bonded[c] == WHOLE or bonded[c] == CRACKED) and state[c] == STICK
            some |= new_bonded[c] != bonded[c]
        if not (intact and some):
            continue
        parts, slides = _times_of_face(f, faces, forces, before, bonded, strengths)
        for k in range(faces.start[f], faces.start[f + 1]):
            out[faces.rows[k]], done[faces.rows[k]] = min(parts, slides), True
    for c in range(n):
        if done[c] or new_bonded[c] == bonded[c]:
            continue
        pull = strengths.tension[c] if bonded[c] == WHOLE else 0.0
        if -forces[c, 0] > pull:
            out[c] = _when(-before.normal[c] - pull, -forces[c, 0] - pull, pull)
        firm, peak = strengths.hold[c] + strengths.cohesion[c], strengths.peak[c]
        was = abs(before.shear[c]) - max(0.0, peak * before.normal[c] + firm)
        now = abs(forces[c, 1]) - max(0.0, peak * forces[c, 0] + firm)
        if now > 0.0:
            out[c] = min(out[c], _when(was, now, max(0.0, peak * before.normal[c] + firm)))
    return out


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _times_of_face(f, faces, forces, before, bonded, strengths):
    """Fractions of the step at which the whole face ``f`` reaches its tensile and shear strength; inf if it does
    not."""
    pull = moment = pull0 = moment0 = strength = drawn = drawn0 = capacity = capacity0 = 0.0
    for k in range(faces.start[f], faces.start[f + 1]):
        c, arm = faces.rows[k], faces.arm[k]
        pull, pull0 = pull - forces[c, 0], pull0 - before.normal[c]
        moment, moment0 = moment - forces[c, 0] * arm, moment0 - before.normal[c] * arm
        drawn, drawn0 = drawn + abs(forces[c, 1]), drawn0 + abs(before.shear[c])
        capacity += strengths.peak[c] * forces[c, 0] + strengths.hold[c] + strengths.cohesion[c]
        capacity0 += strengths.peak[c] * before.normal[c] + strengths.hold[c] + strengths.cohesion[c]
        strength += strengths.tension[c] if bonded[c] == WHOLE else 0.0
    length = faces.length[f]
    fibre, fibre0 = pull + 6.0 * abs(moment) / length, pull0 + 6.0 * abs(moment0) / length
    capacity, capacity0 = max(0.0, capacity), max(0.0, capacity0)
    parts = slides = np.inf
    if strength > 0.0 and fibre > strength:
        parts = _when(fibre0 - strength, fibre - strength, strength)
    if drawn > capacity:
        slides = _when(drawn0 - capacity0, drawn - capacity, capacity0)
    return parts, slides


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _loads_of_face(f, faces, forces, bonded, strengths):
    """The `_FaceLoads` of the face ``f``."""
    pull = moment = strength = drawn = capacity = firm = 0.0
    for k in range(faces.start[f], faces.start[f + 1]):
        c = faces.rows[k]
        pull -= forces[c, 0]
        moment -= forces[c, 0] * faces.arm[k]
        drawn += abs(forces[c, 1])
        capacity += strengths.peak[c] * forces[c, 0] + strengths.hold[c] + strengths.cohesion[c]
        firm += strengths.cohesion[c] + strengths.hold[c]
        strength += strengths.tension[c] if bonded[c] == WHOLE else 0.0
    fibre = pull + 6.0 * abs(moment) / faces.length[f]
    return _FaceLoads(fibre, drawn, strength, max(0.0, capacity), firm)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _bond_of_face(f, faces, states):
    """Whether all contacts of the face ``f`` are bonded, whether any of them is open, and whether any does not stick."""
    opened = loose = False
    for k in range(faces.start[f], faces.start[f + 1]):
        c = faces.rows[k]
        if states.bonded[c] != WHOLE and states.bonded[c] != CRACKED:
            return False, False, False
        opened = opened or states.state[c] == OPEN
        loose = loose or states.state[c] != STICK
    return True, opened, loose


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _stick_again(f, faces, forces, states, strengths, called, violation):
    """Request that all contacts of the face ``f`` stick: a method of the open–close iteration that treats contacts one
    by one has released contacts that the face holds."""
    for k in range(faces.start[f], faces.start[f + 1]):
        c = faces.rows[k]
        called.state[c], called.bonded[c] = STICK, states.bonded[c]
        violation[c] = (
            strengths.normal[c] * abs(forces[c, 2]) + strengths.shear[c] * abs(forces[c, 3])
            if states.state[c] != STICK
            else 0.0
        )


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def check_faces(face_bonds, forces, forces_before, tried, strength, slack, new, violation):
    """Correct, in place, the states ``new`` and the ``violation`` of `check_states` for contacts of bonded faces. Plain
    tuples: ``face_bonds`` (`BondedFaces`), ``forces_before`` (`ForcesBefore`), the states ``tried`` (`ContactStates`) and
    their ``strength`` (`Springs`); other arguments as there."""
    faces, before, states = BondedFaces(*face_bonds), ForcesBefore(*forces_before), ContactStates(*tried)
    strengths, called = Springs(*strength), ContactStates(*new)
    for f in range(faces.length.shape[0]):
        intact, opened, loose = _bond_of_face(f, faces, states)
        if not intact:
            continue
        loads = _loads_of_face(f, faces, forces, states.bonded, strengths)
        if opened and loads.strength == 0.0:
            continue
        if loose:
            _stick_again(f, faces, forces, states, strengths, called, violation)
            continue
        pulls, least, least_shear = False, 0.0, 0.0
        for k in range(faces.start[f], faces.start[f + 1]):
            c = faces.rows[k]
            least = max(least, strengths.normal[c] * slack[c])
            least_shear = max(least_shear, 1e-3 * strengths.shear[c] * slack[c])
            pulls = pulls or -forces[c, 0] > strengths.normal[c] * slack[c]
        parts = loads.strength > 0.0 and loads.fibre - loads.strength > 1e-9 * loads.strength + 6.0 * least
        slides = loads.drawn - loads.capacity > 1e-9 * loads.capacity + least_shear
        when = 1.0
        if slides:
            in_tension, in_shear = _times_of_face(f, faces, forces, before, states.bonded, strengths)
            parts = parts and in_tension <= in_shear
            when = min(max(in_shear, 0.0), 1.0)
            opens = False
            for k in range(faces.start[f], faces.start[f + 1]):
                c = faces.rows[k]
                opens = opens or before.normal[c] + when * (forces[c, 0] - before.normal[c]) <= 0.0
            # It may slide before its corners would open; then they do not open.
            pulls = pulls and (loads.strength > 0.0 or opens)
        for k in range(faces.start[f], faces.start[f + 1]):
            c = faces.rows[k]
            if loads.strength == 0.0 and pulls:
                # Corners that press wait for those that open.
                if -forces[c, 0] <= strengths.normal[c] * slack[c]:
                    called.state[c], called.bonded[c], violation[c] = STICK, states.bonded[c], 0.0
                continue
            _break_bond(c, forces, before, states, strengths, called, violation, loads, (parts, slides, pulls, when))


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _break_bond(c, forces, before, states, strengths, called, violation, loads, breaks):
    """Set the state required of contact ``c`` of a bonded face with these ``loads``; ``breaks``: whether the face
    parts, slides and is in tension, and the fraction of the step at which it slides."""
    parts, slides, pulls, when = breaks
    called.state[c], called.bonded[c], violation[c] = STICK, states.bonded[c], 0.0
    if parts:
        violation[c] = loads.fibre - loads.strength
        called.bonded[c] = 0 if pulls or loads.firm == 0.0 else CRACKED
    elif slides:
        violation[c] = loads.drawn - loads.capacity
        called.bonded[c] = 2 if strengths.keeps[c] else 0
    if called.bonded[c] == 0 or called.bonded[c] == 2:
        if parts:
            when = 1.0
        pressed = before.normal[c] + when * (forces[c, 0] - before.normal[c])
        if pressed < 0.0:
            called.state[c], called.bonded[c] = OPEN, (0 if parts else called.bonded[c])
        elif slides and (strengths.keeps[c] or abs(forces[c, 1]) > strengths.friction[c] * pressed):
            called.state[c], called.direction[c] = SLIP, np.sign(forces[c, 1])
