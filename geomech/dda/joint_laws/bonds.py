"""Bonds of whole faces: what two corners of a face hold together, and when the bond between them fails.

An edge on an edge is held by contacts at the ends of the overlap ℓ. Their pulls Tᵢ at the distances aᵢ from its middle
are the resultants T = Σ Tᵢ and M = Σ Tᵢ aᵢ of the stress along the face, which between blocks that deform evenly is a
straight line. Its extreme fibre is at

    σ = T/ℓ + 6 |M|/ℓ²      (Navier; for two corners 2 (2 T₁ − T₀)/ℓ at the end 1),

and where that reaches the tensile strength a brittle bond fails from end to end, unless the resultant presses within
the face: then the crack from its edge ends before the other, and what is left holds by friction and cohesion but no
pull. Sheared, the face holds Σ |Sᵢ| ≤ c ℓ + tan φ Σ Nᵢ wherever along it Σ Nᵢ acts, for what one end does not hold the
other does. The corners one by one would hold three times the moment, and half the cohesion where one end slips before
the other.

What has no tensile strength opens without breaking anything: it may close again, with its cohesion, while states are
sought, and has lost that only if it is open in the end. Bonds break one after the other as a load that grows evenly
from the step's start would break them: where f(t) = f₀ + t (f₁ − f₀) is by how much a face is loaded beyond its
strength, the one that comes first to f = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...compiled import kept, part
from ...model import OPEN, SLIP, STICK

#: Bonds of a CONTACT row: whole, and cracked from its edge, so that it holds only while it is pressed.
WHOLE, CRACKED = 1, 3
#: Contacts whose normals are nearer in direction than this (cosine) may lie on one face …
ALIGNED = 0.9986
#: … if they are off its line by less than this part of their distance (sine of the same angle, about 3°).
OFF_LINE = 0.053
#: The tributary lengths of a face's contacts add up to its length but for this part: otherwise it has gaps.
WITHOUT_GAPS = 1e-2


@dataclass(frozen=True, eq=False)
class BondedFaces:
    """Faces (m,) that at least two bonds hold, as a step begins.

    start   (m + 1,)  where the contacts of each begin in ``rows``
    rows    (k,)      contacts, rows of the step's `ContactSet`
    arm     (k,) m    from the middle of the face
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
        """Faces among the contacts (n,) of a `ContactSet`; None without any."""
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
    """The contacts ``some`` (k,) of a `ContactSet`, face by face: their rows, where each face begins among them and
    ends, and where they lie along it (m)."""
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
    """Number of the face of each contact (n,), and where it lies along it (m), the contacts ordered by pairs of
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
            straight = turn * (nx * geometry[c, 1] + ny * geometry[c, 2]) > ALIGNED
            if straight and abs(nx * dx + ny * dy) <= OFF_LINE * np.sqrt(dx * dx + dy * dy):
                face[c], lead[c], along[c] = face[k], k, nx * dy - ny * dx
                break
        if face[c] < 0:
            face[c], lead[c] = faces, c
            faces += 1
    return face, along


@part(fastmath=False, error_model="numpy", nogil=True)
def _when(before, after, strength):
    """At which part of the step something is loaded to its ``strength`` (N) that is beyond it by ``before`` as the step
    begins and ``after`` at its end; below zero where it is beyond it already."""
    if before > 0.0:
        return -before / (before + strength)
    return -before / max(after - before, 1e-300)


@kept(fastmath=False, error_model="numpy", nogil=True)
def first_to_break(
    start, rows, arm, length, forces, normal0, shear0, state, bonded, new_bonded, peak, hold, cohesion, tension
):  # fmt: skip
    """(n,) at which part of the step each bond that ``new_bonded`` calls broken has come to its strength; inf for others.
    Arguments as for `check_faces`; without faces ``length`` is empty."""
    n = state.shape[0]
    out, done = np.full(n, np.inf), np.zeros(n, np.bool_)
    for f in range(length.shape[0]):
        some, intact = False, True
        for k in range(start[f], start[f + 1]):
            intact &= (bonded[rows[k]] == WHOLE or bonded[rows[k]] == CRACKED) and state[rows[k]] == STICK
            some |= new_bonded[rows[k]] != bonded[rows[k]]
        if not (intact and some):
            continue
        parts, slides = _times_of_face(
            f, start, rows, arm, length, forces, normal0, shear0, bonded, peak, hold, cohesion, tension
        )
        for k in range(start[f], start[f + 1]):
            out[rows[k]], done[rows[k]] = min(parts, slides), True
    for c in range(n):
        if done[c] or new_bonded[c] == bonded[c]:
            continue
        pull = tension[c] if bonded[c] == WHOLE else 0.0
        if -forces[c, 0] > pull:
            out[c] = _when(-normal0[c] - pull, -forces[c, 0] - pull, pull)
        firm = hold[c] + cohesion[c]
        was = abs(shear0[c]) - max(0.0, peak[c] * normal0[c] + firm)
        now = abs(forces[c, 1]) - max(0.0, peak[c] * forces[c, 0] + firm)
        if now > 0.0:
            out[c] = min(out[c], _when(was, now, max(0.0, peak[c] * normal0[c] + firm)))
    return out


@part(fastmath=False, error_model="numpy", nogil=True)
def _times_of_face(f, start, rows, arm, length, forces, normal0, shear0, bonded, peak, hold, cohesion, tension):
    """At which parts of the step the whole face ``f`` comes to its strength in tension and in shear; inf where it does
    not."""
    pull = moment = pull0 = moment0 = strength = drawn = drawn0 = capacity = capacity0 = 0.0
    for k in range(start[f], start[f + 1]):
        c = rows[k]
        pull, pull0 = pull - forces[c, 0], pull0 - normal0[c]
        moment, moment0 = moment - forces[c, 0] * arm[k], moment0 - normal0[c] * arm[k]
        drawn, drawn0 = drawn + abs(forces[c, 1]), drawn0 + abs(shear0[c])
        capacity += peak[c] * forces[c, 0] + hold[c] + cohesion[c]
        capacity0 += peak[c] * normal0[c] + hold[c] + cohesion[c]
        strength += tension[c] if bonded[c] == WHOLE else 0.0
    fibre, fibre0 = pull + 6.0 * abs(moment) / length[f], pull0 + 6.0 * abs(moment0) / length[f]
    capacity, capacity0 = max(0.0, capacity), max(0.0, capacity0)
    parts = slides = np.inf
    if strength > 0.0 and fibre > strength:
        parts = _when(fibre0 - strength, fibre - strength, strength)
    if drawn > capacity:
        slides = _when(drawn0 - capacity0, drawn - capacity, capacity0)
    return parts, slides


@kept(fastmath=False, error_model="numpy", nogil=True)
def check_faces(
    start,
    rows,
    arm,
    length,
    forces,
    normal0,
    shear0,
    state,
    bonded,
    normal,
    shear,
    friction,
    peak,
    hold,
    cohesion,
    tension,
    keeps,
    slack,
    new_state,
    new_direction,
    new_bonded,
    violation,
):
    """Put right, in place, what `check_states` calls for contacts whose whole face is bonded; ``normal0`` and ``shear0``
    (n,) N as the step begins, other arguments as there."""
    for f in range(length.shape[0]):
        intact, out, pulls, opened = True, False, False, False
        pull = moment = strength = drawn = sheared = capacity = firm = least = 0.0
        for k in range(start[f], start[f + 1]):
            c = rows[k]
            if bonded[c] != WHOLE and bonded[c] != CRACKED:
                intact = False
                break
            force = forces[c, 0]
            pull -= force
            moment -= force * arm[k]
            drawn += abs(forces[c, 1])
            capacity += peak[c] * force + hold[c] + cohesion[c]
            firm += cohesion[c] + hold[c]
            strength += tension[c] if bonded[c] == WHOLE else 0.0
            least = max(least, normal[c] * slack[c])
            sheared = max(sheared, 1e-3 * shear[c] * slack[c])
            pulls = pulls or -force > normal[c] * slack[c]
            opened = opened or state[c] == OPEN
            out = out or state[c] != STICK
        if not intact or (opened and strength == 0.0):
            continue
        if out:
            # A way of iterating that knows nothing of faces has let go of what they hold.
            for k in range(start[f], start[f + 1]):
                c = rows[k]
                new_state[c], new_bonded[c] = STICK, bonded[c]
                violation[c] = (
                    normal[c] * abs(forces[c, 2]) + shear[c] * abs(forces[c, 3]) if state[c] != STICK else 0.0
                )
            continue
        fibre = pull + 6.0 * abs(moment) / length[f] - strength
        parts = strength > 0.0 and fibre > 1e-9 * strength + 6.0 * least
        capacity = max(0.0, capacity)
        slides = drawn - capacity > 1e-9 * capacity + sheared
        when = 1.0
        if slides:
            in_tension, in_shear = _times_of_face(
                f, start, rows, arm, length, forces, normal0, shear0, bonded, peak, hold, cohesion, tension
            )
            parts = parts and in_tension <= in_shear
            when = min(max(in_shear, 0.0), 1.0)
            opens = False
            for k in range(start[f], start[f + 1]):
                c = rows[k]
                opens = opens or normal0[c] + when * (forces[c, 0] - normal0[c]) <= 0.0
            # Before its corners would open it may slide, and then they need not.
            pulls = pulls and (strength > 0.0 or opens)
        for k in range(start[f], start[f + 1]):
            c = rows[k]
            if strength == 0.0 and pulls:
                # Corners that press wait for those that open.
                if -forces[c, 0] <= normal[c] * slack[c]:
                    new_state[c], new_bonded[c], violation[c] = STICK, bonded[c], 0.0
                continue
            new_state[c], new_bonded[c], violation[c] = STICK, bonded[c], 0.0
            if parts:
                violation[c] = fibre
                new_bonded[c] = 0 if pulls or firm == 0.0 else CRACKED
            elif slides:
                violation[c] = drawn - capacity
                new_bonded[c] = 2 if keeps[c] else 0
            if new_bonded[c] == 0 or new_bonded[c] == 2:
                if parts:
                    when = 1.0
                pressed = normal0[c] + when * (forces[c, 0] - normal0[c])
                if pressed < 0.0:
                    new_state[c], new_bonded[c] = OPEN, (0 if parts else new_bonded[c])
                elif slides and (keeps[c] or abs(forces[c, 1]) > friction[c] * pressed):
                    new_state[c], new_direction[c] = SLIP, np.sign(forces[c, 1])
