"""Boundary load of an elastic body from the contact forces on its block, with the same resultant and moment.

- The contacts of one joint face (two edges that face each other) become one traction distribution with the resultant
  and moment of the contact forces: linear, or without tension where the joint has no tensile strength
  (`no_tension_pressure`). Shear is proportional to pressure, so that Coulomb's law holds along the face wherever it
  holds for the resultant. The distribution ends where the faces part; its end moves continuously as contacts open and
  close.
- A single vertex on an edge loads a short piece of that edge. A single force on the block's own corner is resolved
  along the two edges of the corner and acts as shear, which preserves force and moment exactly.
- A force beyond the end of an edge acts at that end; its moment is applied to the whole outline.

With route "bases", the pressure of faces on fixed, guided or rigid blocks is that of a rigid base
(`geomech.ddm.loads.rigid_bases`) with the same resultant and moment. With route "auto" a specimen between two such platens
that is at least as tall as wide is an exception: in tests of rock platens are greased or made of brushes, so that the stress
on the ends is even whatever the cracks do, and its pressure is linear. Two other routes are for comparison: "springs"
applies each contact force as a point force on the boundary; "kelvin-springs" applies these through Kelvin's solution
for the infinite plane (Khanizadeh Bahabadi et al. 2023, eqs. 2-4).

All loads are in the reference frame of the block: points are mapped back by its affine motion, forces rotated back. The
resultant that remains is balanced by the block's inertia (d'Alembert), applied as a body force linear in x
(`inertia_forces`), so that the elastic problem is in equilibrium to round-off.

The forces' mean stress differs from the block's own by the inertia of its strain and by viscosity, which in DDA are
uniform stresses. They are applied as a uniform stress here, too, so that the mean stress of the load is the block's own
and does all the work on the crack strain. (As a body force the inertia of the strain would load a central crack by half
as much again, without an equal loss in the block: cracks running under waves gained 2 % of the work of the load.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...compiled import kept
from ...model import CONTACT, Blocks, Motion
from ..crack_compliance.added_compliance import stress_rotations, times
from .contact_gathering import faces_and_lone, on_outline, touches_of
from .face_traction import add_face, add_lone
from .inertia_forces import BlockInertia, BlockShape, balanced
from .piecewise_traction import (
    Found,
    add_couple,
    add_edge_piece,
    add_point_load,
    add_row,
    jit,
    line_of,
    outlines,
    place_along,
)

#: Ratio of the length of a side to the mean depth of its block, area / length, up to which a block between platens is a
#: specimen, tests of which want one at least as tall as wide. A square is as wide as deep, whatever round-off says.
WIDE = 1.0 + 1e-6

#: Two faces are those of platens if they are parallel (1 minus the cosine of the angle between them) and of the same extent to
#: this part of it.
PARALLEL, SAME_EXTENT = 1e-4, 0.01

#: Pieces of the pressure of a side on a rigid base that is as long as its block is deep (area over length, √area at most): pressure
#: below a wide block varies over a part of the face as long as its depth. Elements there, 6 of order 4 by default, have as many nodes.
ON_BASE = 24


@dataclass(frozen=True, eq=False)
class BoundaryLoad:
    """Load of the elastic body of one block, reference frame.

    - segments (m, 2, 2): pieces of the outline, directed along it; tractions (m, 2, 2): at their two ends, linear
      between, Pa
    - remote_stress (3,): additional uniform stress, Pa
    - points, forces (k, 2): point forces, None without; ``kelvin`` as in `ddm.BodyLoad`
    - body_force (2,), body_force_gradient (2, 2): b = body_force + gradient · (x − about), N/m³
    - imbalance: resultant that inertia has to balance beyond the solver's own acceleration, relative to the forces
    - bases: rows of segments whose pressure is still to be found, the traction (2,) per unit pressure, and the stiffness of
      the joint, Pa/m (infinite if it has none of its own)
    - crack_pressure (scalar or (n_segments,)), hole_pressure: fluid pressures in unbounded rock, Pa
    - single: CONTACT rows that act alone, on a corner or a short piece of an edge; of_single: begin and end of the rows
      of their segments
    """

    segments: np.ndarray
    tractions: np.ndarray
    body_force: np.ndarray
    body_force_gradient: np.ndarray
    about: np.ndarray
    imbalance: float
    remote_stress: np.ndarray | None = None
    points: np.ndarray | None = None
    forces: np.ndarray | None = None
    kelvin: bool = False
    bases: tuple[tuple[np.ndarray, np.ndarray, float], ...] = ()
    crack_pressure: np.ndarray | float = 0.0
    hole_pressure: float = 0.0
    single: np.ndarray | None = None
    of_single: tuple[int, int] = (0, 0)


@dataclass(frozen=True, eq=False)
class BoundaryForces:
    """External forces on blocks in the configuration in which they are in equilibrium.

    ``vertices`` (n_vertices, 2) and ``motion`` of that configuration; ``contacts`` CONTACT rows, ``edges`` EDGE_FORCE
    rows, ``points`` POINT_FORCE rows; ``route``: "auto", "contacts", "bases", "springs" or "kelvin-springs"; ``keep_straight``
    (n_blocks,) bool: blocks that act as rigid bases; ``tensile_strength`` of each joint law, Pa (None: all zero), and its
    ``normal_stiffness``, Pa/m (None: all infinite).
    """

    vertices: np.ndarray
    motion: Motion
    contacts: np.ndarray
    edges: np.ndarray
    points: np.ndarray
    route: str = "contacts"
    tensile_strength: Sequence[float] | None = None
    keep_straight: np.ndarray | None = None
    normal_stiffness: Sequence[float | None] | None = None

    def holding(self) -> np.ndarray:
        """(n_contacts,) bool: bonded contacts with tensile strength."""
        if self.tensile_strength is None:
            return np.zeros(len(self.contacts), bool)
        strength = np.asarray(self.tensile_strength, dtype=float)
        return (self.contacts["bonded"] == 1) & (strength[self.contacts["law"]] > 0)


def boundary_load(
    block: int, blocks: Blocks, forces: BoundaryForces, inertia: BlockInertia | None = None
) -> BoundaryLoad:
    """Load of one ``block`` (see `boundary_loads`); at rest and without weight if ``inertia`` is None."""
    inertia = BlockInertia(np.zeros(1), np.zeros(1), np.zeros(1)) if inertia is None else inertia
    return boundary_loads(np.array([block]), blocks, forces, inertia)[0]


def boundary_loads(
    numbers: np.ndarray, blocks: Blocks, forces: BoundaryForces, inertia: BlockInertia
) -> list[BoundaryLoad]:
    """Loads of the blocks ``numbers`` (n,), which have this ``inertia``."""
    numbers, n = np.asarray(numbers), len(numbers)
    moments = [blocks.area_moments(b) for b in numbers.tolist()]
    shape = BlockShape(*(np.array(each, dtype=float) for each in zip(*moments)))
    rotation, motion, contacts = inertia.rotation, forces.motion, forces.contacts
    based = np.zeros(blocks.n_blocks, bool)
    if forces.route in ("auto", "bases") and forces.keep_straight is not None:
        based = np.asarray(forces.keep_straight, dtype=bool)
    turn = np.stack([np.cos(rotation), np.sin(rotation)], axis=1)
    asked = _Asked(numbers, shape.area, motion.centre, motion.reference_centre, motion.gradient, turn)
    rows = np.ascontiguousarray(contacts).astype(CONTACT, copy=False)
    acting = _Acting(
        rows, forces.holding(), *_rows_of(np.stack([contacts["block"], contacts["other"]]), numbers),
        forces.edges, *_rows_of(forces.edges["block"][None], numbers),
        forces.points, *_rows_of(forces.points["block"][None], numbers),
        based, WIDE if forces.route == "auto" else 0.0,
    )  # fmt: skip
    pointed = forces.route in ("springs", "kelvin-springs")
    given = asked, outlines(blocks, forces.vertices), blocks.vertex_start, acting, pointed
    found, (ends, stretch, single, of_single) = _with_room(given, 16 * len(contacts) + 16 * n + len(forces.edges))
    strained = motion.gradient[numbers]
    body_force, gradient, even, imbalance = balanced(found, ends, shape, inertia, turn, stretch, strained)
    overstress = inertia.overstress
    remote = None if overstress is None else even - times(stress_rotations(-np.asarray(rotation)), overstress)
    pieces, inside, bases = found.pieces, found.inside, found.bases
    segments, tractions = pieces.reshape(-1, 4, 2)[:, :2], pieces.reshape(-1, 4, 2)[:, 2:]
    given_stiffness = forces.normal_stiffness or [None] * (1 + int(contacts["law"].max(initial=0)))
    stiffness = [math.inf if each is None else float(each) for each in given_stiffness]
    loads = []
    for k, ((a, i, j), (b, to_i, to_j)) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist())):
        on = tuple(
            (np.arange(int(m) - a, int(o) - a), np.array([x, y]), stiffness[int(law)])
            for m, o, x, y, law in bases[j:to_j].tolist()
        )
        at, pull = (inside[i:to_i, :2], inside[i:to_i, 2:]) if to_i > i else (None, None)
        begin, end = acting.contact_ends[k].tolist()
        alone = rows[acting.contact_rows[begin:end][single[begin:end]]]
        loads.append(
            BoundaryLoad(
                np.ascontiguousarray(segments[a:b]), np.ascontiguousarray(tractions[a:b]), body_force[k], gradient[k],
                shape.centroid[k], float(imbalance[k]), None if remote is None else remote[k], at, pull,
                forces.route == "kelvin-springs", on, single=alone,
                of_single=(int(of_single[k, 0]), int(of_single[k, 1])),
            )
        )  # fmt: skip
    return loads


def _with_room(given: tuple, room: int) -> tuple[Found, tuple[np.ndarray, ...]]:
    """Run `_pieces` with ``room`` for that many pieces, again with more if it does not suffice; returns `Found`, and what
    `_pieces` returns."""
    while True:
        found = Found(np.zeros(3, np.int64), np.empty((room, 8)), np.empty((room, 4)), np.empty((room, 5)))
        per_block = _pieces(found, *given)
        count = found.count.tolist()
        if max(count) <= room:
            rows = (each[:many] for each, many in zip((found.pieces, found.inside, found.bases), count))
            return Found(found.count, *rows), per_block
        room = 2 * max(count)


def _rows_of(owners: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns of ``owners`` (k, m) in which each of ``numbers`` (n,) occurs, one after the other, and the begin and end
    of those of each number (n, 2)."""
    column = np.broadcast_to(np.arange(owners.shape[1]), owners.shape).ravel()
    owner = owners.ravel()
    order = np.lexsort((column, owner))
    ends = np.stack([np.searchsorted(owner[order], numbers, side) for side in ("left", "right")], axis=1)
    return column[order], ends


class _Asked(NamedTuple):
    """Blocks whose loads are computed: ``numbers`` (n,), ``area`` (n,) m², ``turn`` (n, 2) cosine and sine of their
    rotation. Of all blocks: centres and gradient of their `Motion`."""

    numbers: np.ndarray
    area: np.ndarray
    centre: np.ndarray
    reference_centre: np.ndarray
    gradient: np.ndarray
    turn: np.ndarray


class _Acting(NamedTuple):
    """CONTACT rows with ``holding`` (may carry tension), EDGE_FORCE and POINT_FORCE rows. Of each kind: the row numbers
    for the selected blocks, one after the other, and begin and end of those of each block (n, 2). ``based``
    (n_blocks,): blocks that act as rigid bases; as platens, if they are two, of blocks that are less than ``wide`` times as
    wide as deep."""

    contacts: np.ndarray
    holding: np.ndarray
    contact_rows: np.ndarray
    contact_ends: np.ndarray
    edge_forces: np.ndarray
    edge_rows: np.ndarray
    edge_ends: np.ndarray
    point_forces: np.ndarray
    point_rows: np.ndarray
    point_ends: np.ndarray
    based: np.ndarray
    wide: float


@jit
def _reach(of, touches, sides, face, number):
    """Where the contacts with the face ``number`` begin and end along its side, and the other block (−1 without contacts);
    (x, y) start and direction of the side."""
    sx, sy, ax, ay, _ = line_of(of, sides[number, 0])
    low, high, against = 0.0, 0.0, -1
    for k in range(len(face)):
        if face[k] == number:
            place = place_along(touches.px[k], touches.py[k], sx, sy, ax, ay)
            low, high = (place, place) if against < 0 else (min(low, place), max(high, place))
            against = touches.against[k]
    return low, high, against, sx, sy, ax, ay


@jit
def _between_platens(of, touches, sides, face, number, based):
    """Whether an opposite face of the block, parallel and of the same extent, lies on a straight block, too."""
    low, high, _, sx, sy, ax, ay = _reach(of, touches, sides, face, number)
    for other in range(len(sides)):
        near, far, against, x, y, bx, by = _reach(of, touches, sides, face, other)
        if against < 0 or not based[against] or ax * bx + ay * by > -1.0 + PARALLEL:
            continue
        begins = place_along(x + far * bx, y + far * by, sx, sy, ax, ay)
        ends = place_along(x + near * bx, y + near * by, sx, sy, ax, ay)
        if max(abs(begins - low), abs(ends - high)) <= SAME_EXTENT * (high - low):
            return True
    return False


@kept(error_model="numpy", nogil=True)
def _pieces(found, asked, of, vertex_start, acting, pointed):
    """Append the loads of the ``asked`` blocks to ``found``. Returns the number of rows of each kind before each block
    (n + 1, 3), Σ r ⊗ f (n, 2, 2) that the pieces do not reproduce, which of ``acting.contact_rows`` act alone, and begin
    and end (n, 2) of their pieces among those of each block."""
    n = len(asked.numbers)
    ends, stretch = np.zeros((n + 1, 3), np.int64), np.zeros((n, 2, 2))
    single, of_single = np.zeros(len(acting.contact_rows), np.bool_), np.zeros((n, 2), np.int64)
    for b in range(n):
        block, couple = asked.numbers[b], 0.0
        c, s = asked.turn[b, 0], asked.turn[b, 1]
        rows = acting.contact_rows[acting.contact_ends[b, 0] : acting.contact_ends[b, 1]]
        touches = touches_of(
            block, acting.contacts, rows, acting.holding, asked.centre[block], asked.reference_centre[block],
            asked.gradient[block], c, s,
        )  # fmt: skip
        if pointed:
            for k in range(len(rows)):
                x, y = on_outline(of, touches, k)
                add_row(found.count, found.inside, 1, x, y, touches.fx[k], touches.fy[k])
        else:
            sides, face, lone = faces_and_lone(of, touches)
            for number in range(len(sides)):
                first = 0
                while first < len(rows) and face[first] != number:
                    first += 1
                if first == len(rows):
                    continue  # only single contacts
                start = sides[number, 0]
                _, _, ax, ay, length = line_of(of, start)
                on_base = acting.based[touches.against[first]] and (
                    length * length > acting.wide * asked.area[b]
                    or not _between_platens(of, touches, sides, face, number, acting.based)
                )
                piece = min(math.sqrt(asked.area[b]), asked.area[b] / length) / ON_BASE if on_base else 0.0
                base = found.count[2]
                amount, lost = add_face(found, of, start, touches, face, number, piece)
                if base < found.count[2] and base < len(found.bases):
                    found.bases[base, 4] = acting.contacts[rows[first]].law
                couple += lost
                stretch[b, 0, 0] += amount * ax * ax
                stretch[b, 0, 1] += amount * ax * ay
                stretch[b, 1, 0] += amount * ax * ay
                stretch[b, 1, 1] += amount * ay * ay
            of_single[b, 0] = found.count[0] - ends[b, 0]
            for k in lone:
                couple += add_lone(found, of, touches, k)
                single[acting.contact_ends[b, 0] + k] = True
            of_single[b, 1] = found.count[0] - ends[b, 0]
        for k in range(acting.edge_ends[b, 0], acting.edge_ends[b, 1]):
            add_edge_piece(found, of, acting.edge_forces[acting.edge_rows[k]], c, s)
        first, last = vertex_start[block], vertex_start[block + 1]
        for k in range(acting.point_ends[b, 0], acting.point_ends[b, 1]):
            row = acting.point_forces[acting.point_rows[k]]
            fx, fy = c * row.force[0] + s * row.force[1], c * row.force[1] - s * row.force[0]
            couple += add_point_load(found, of, first, last, row.at[0], row.at[1], fx, fy)
        add_couple(found, of, first, last, asked.area[b], couple)
        for k in range(3):
            ends[b + 1, k] = found.count[k]
    return ends, stretch, single, of_single
