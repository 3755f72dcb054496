"""Contact forces of a block made into one boundary load of its elastic body, with the same force and moment.

The contacts of one joint face (two edges that lie against each other) are one distribution with the resultant and
moment of its contact forces: linear, or, but for bonds with tensile strength, a triangle where that would pull although
the resultant pushes (`no_tension_pressure`). It ends where
the faces do: a contact that opens takes the pressure back from its place the further the wider it gapes. Shear follows
the pressure, so that it breaks Coulomb's law nowhere unless it breaks it as a whole. A lone vertex pressed into an edge
spreads over a short piece of that edge; a lone force on a block's own corner is resolved along the corner's two edges
and enters there as shear, which keeps both force and moment exactly. What presses beyond the end of an edge acts at
that end, and its moment about it on the whole outline. Tractions change without a jump as contacts come and go.

By the route "bases" faces on blocks that are fixed or guided press as on a rigid base, as their own elasticity has it
(`geomech.ddm.loads.rigid_bases`), with the same force and moment; here it is said only where.

Two other routes are there to be compared with: "springs" leaves each contact's force where its spring is, a point force
on the boundary; "kelvin-springs" takes these by Kelvin's solution for the infinite plane, as Khanizadeh Bahabadi et al.
(2023, eqs. 2-4) write.

All of it lives in the block's reference frame: points are mapped back by the block's affine motion, forces turned
back by its rotation. What the forces then leave out of balance is the block's inertia (d'Alembert): it is put on as
a body force, linear in x, so that the elastic problem is in equilibrium to round-off.

What the forces leave out of the block's mean stress, its strain's inertia and viscosity take: in the block solver an
even stress, and an even stress it is here. The mean stress of the load is then the block's own, whose work on the
strain of the cracks is all that the block spends on them. (As a body force, the strain's inertia would load a crack in
the middle by half as much again, with nobody to do that work: cracks that run under waves gained 2 % of the load's
work, and viscous stress that opened them took as much.)
"""

from __future__ import annotations

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
from .piecewise_traction import Found, add_couple, add_edge_piece, add_point_load, add_row, line_of, outlines


@dataclass(frozen=True, eq=False)
class BoundaryLoad:
    """Load of one block's elastic body, reference frame.

    segments (m, 2, 2) pieces of the outline, directed along it; tractions (m, 2, 2) at their two ends, linear between;
    remote_stress (3,) the even stress besides, Pa;
    points and forces (k, 2) what acts at points, None without, ``kelvin`` as in `ddm.BodyLoad`;
    body_force (2,) and body_force_gradient (2, 2): b = body_force + gradient · (x − about), N/m³; ``imbalance`` is the
    resultant that inertia had to balance beyond the solver's own acceleration on the block as it is strained, relative
    to the forces' size; ``bases`` are rows of segments in which pressure is yet to be found, and the traction (2,) with
    a unit of it; ``crack_pressure`` (one for all, or (n_segments,)) and ``hole_pressure`` Pa, of fluids in endless
    rock.
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
    bases: tuple[tuple[np.ndarray, np.ndarray], ...] = ()
    crack_pressure: np.ndarray | float = 0.0
    hole_pressure: float = 0.0


@dataclass(frozen=True, eq=False)
class BoundaryForces:
    """What acts on blocks from outside, any of them, on the geometry on which it is in equilibrium.

    ``vertices`` (n_vertices, 2) and ``motion`` are that geometry; ``contacts`` CONTACT rows on it, ``edges`` EDGE_FORCE and
    ``points`` POINT_FORCE rows; ``route``: "contacts", "bases", "springs" or "kelvin-springs"; ``keep_straight``
    (n_blocks,) bool which blocks are bases; ``tensile_strength`` of the joint laws, Pa (None: none has any).
    """

    vertices: np.ndarray
    motion: Motion
    contacts: np.ndarray
    edges: np.ndarray
    points: np.ndarray
    route: str = "contacts"
    tensile_strength: Sequence[float] | None = None
    keep_straight: np.ndarray | None = None

    def holding(self) -> np.ndarray:
        """(n_contacts,) bonds that may pull."""
        if self.tensile_strength is None:
            return np.zeros(len(self.contacts), bool)
        strength = np.asarray(self.tensile_strength, dtype=float)
        return (self.contacts["bonded"] == 1) & (strength[self.contacts["law"]] > 0)


def boundary_load(
    block: int, blocks: Blocks, forces: BoundaryForces, inertia: BlockInertia | None = None
) -> BoundaryLoad:
    """The load of one ``block``, as of `boundary_loads`; at rest and without weight where no ``inertia`` is given."""
    inertia = BlockInertia(np.zeros(1), np.zeros(1), np.zeros(1)) if inertia is None else inertia
    return boundary_loads(np.array([block]), blocks, forces, inertia)[0]


def boundary_loads(
    numbers: np.ndarray, blocks: Blocks, forces: BoundaryForces, inertia: BlockInertia
) -> list[BoundaryLoad]:
    """The loads of the blocks with these ``numbers`` (n,), of which ``inertia`` is."""
    numbers, n = np.asarray(numbers), len(numbers)
    moments = [blocks.area_moments(b) for b in numbers.tolist()]
    shape = BlockShape(*(np.array(each, dtype=float) for each in zip(*moments)))
    rotation, motion, contacts = inertia.rotation, forces.motion, forces.contacts
    based = np.zeros(blocks.n_blocks, bool)
    if forces.route == "bases" and forces.keep_straight is not None:
        based = np.asarray(forces.keep_straight, dtype=bool)
    turn = np.stack([np.cos(rotation), np.sin(rotation)], axis=1)
    asked = _Asked(numbers, shape.area, motion.centre, motion.reference_centre, motion.gradient, turn)
    rows = np.ascontiguousarray(contacts).astype(CONTACT, copy=False)
    acting = _Acting(
        rows, forces.holding(), *_rows_of(np.stack([contacts["block"], contacts["other"]]), numbers),
        forces.edges, *_rows_of(forces.edges["block"][None], numbers),
        forces.points, *_rows_of(forces.points["block"][None], numbers),
        based,
    )  # fmt: skip
    pointed = forces.route in ("springs", "kelvin-springs")
    given = asked, outlines(blocks, forces.vertices), blocks.vertex_start, acting, pointed
    found, ends, stretch = _with_room(given, 16 * len(contacts) + 16 * n + len(forces.edges))
    strained = motion.gradient[numbers]
    body_force, gradient, even, imbalance = balanced(found, ends, shape, inertia, turn, stretch, strained)
    overstress = inertia.overstress
    remote = None if overstress is None else even - times(stress_rotations(-np.asarray(rotation)), overstress)
    pieces, inside, bases = found.pieces, found.inside, found.bases
    segments, tractions = pieces.reshape(-1, 4, 2)[:, :2], pieces.reshape(-1, 4, 2)[:, 2:]
    loads = []
    for k, ((a, i, j), (b, to_i, to_j)) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist())):
        on = tuple((np.arange(int(m) - a, int(o) - a), np.array([x, y])) for m, o, x, y in bases[j:to_j].tolist())
        at, pull = (inside[i:to_i, :2], inside[i:to_i, 2:]) if to_i > i else (None, None)
        loads.append(
            BoundaryLoad(
                np.ascontiguousarray(segments[a:b]), np.ascontiguousarray(tractions[a:b]), body_force[k], gradient[k],
                shape.centroid[k], float(imbalance[k]), None if remote is None else remote[k], at, pull,
                forces.route == "kelvin-springs", on,
            )
        )  # fmt: skip
    return loads


def _with_room(given: tuple, room: int) -> tuple[Found, np.ndarray, np.ndarray]:
    """What is `Found` of the ``given``, and of each block, where there is ``room`` for so many pieces, or as much as is
    needed."""
    while True:
        found = Found(np.zeros(3, np.int64), np.empty((room, 8)), np.empty((room, 4)), np.empty((room, 4)))
        ends, stretch = _pieces(found, *given)
        count = found.count.tolist()
        if max(count) <= room:
            rows = (each[:many] for each, many in zip((found.pieces, found.inside, found.bases), count))
            return Found(found.count, *rows), ends, stretch
        room = 2 * max(count)


def _rows_of(owners: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The columns of ``owners`` (k, m) that each of the ``numbers`` (n,) is in, in order, one after the other, and where
    those of each begin and end, (n, 2)."""
    column = np.broadcast_to(np.arange(owners.shape[1]), owners.shape).ravel()
    owner = owners.ravel()
    order = np.lexsort((column, owner))
    ends = np.stack([np.searchsorted(owner[order], numbers, side) for side in ("left", "right")], axis=1)
    return column[order], ends


class _Asked(NamedTuple):
    """The blocks whose loads are asked for: their ``numbers`` (n,), ``area`` (n,) m² and ``turn`` (n, 2), cosine and sine of
    their rotation; and of all blocks how they have moved, as `Motion` has it."""

    numbers: np.ndarray
    area: np.ndarray
    centre: np.ndarray
    reference_centre: np.ndarray
    gradient: np.ndarray
    turn: np.ndarray


class _Acting(NamedTuple):
    """CONTACT rows and which of them may pull (``holding``), EDGE_FORCE and POINT_FORCE rows; of each kind the numbers of
    those on the blocks asked for, one after the other, and where those of a block begin and end (n, 2); and which blocks
    are bases, ``based`` (n_blocks,)."""

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


@kept(error_model="numpy", nogil=True)
def _pieces(found, asked, of, vertex_start, acting, pointed):
    """Add to what is ``found`` the loads of the blocks that are ``asked`` for, one after the other. Returned is how much of
    each kind there is before each block, (n + 1, 3), and Σ r ⊗ f (n, 2, 2) of what shears stretch a block by beyond what
    the pieces do."""
    n = len(asked.numbers)
    ends, stretch = np.zeros((n + 1, 3), np.int64), np.zeros((n, 2, 2))
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
                    continue  # all of it stands alone
                start = sides[number, 0]
                based = acting.based[touches.against[first]]
                amount, lost = add_face(found, of, start, touches, face, number, based)
                couple += lost
                _, _, ax, ay, _ = line_of(of, start)
                stretch[b, 0, 0] += amount * ax * ax
                stretch[b, 0, 1] += amount * ax * ay
                stretch[b, 1, 0] += amount * ax * ay
                stretch[b, 1, 1] += amount * ay * ay
            for k in lone:
                couple += add_lone(found, of, touches, k)
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
    return ends, stretch
