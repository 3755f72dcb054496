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

import numpy as np

from ...compiled import kept
from ...model import CONTACT, Blocks, Motion
from ..crack_compliance.added_compliance import stress_rotations, times
from .contact_gathering import faces_and_lone, on_outline, touches_of
from .face_traction import add_face, add_lone
from .inertia_forces import balanced
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


def boundary_load(
    block: int,
    blocks: Blocks,
    vertices: np.ndarray,
    motion: Motion,
    rotation: float,
    contacts: np.ndarray,
    edge_forces: np.ndarray,
    point_forces: np.ndarray,
    density: float = 0.0,
    gravity: np.ndarray | None = None,
    acceleration: np.ndarray | None = None,
    spin: float = 0.0,
    reaction: np.ndarray | None = None,
    route: str = "contacts",
    tensile_strength: Sequence[float] | None = None,
    overstress: np.ndarray | None = None,
    keep_straight: np.ndarray | None = None,
) -> BoundaryLoad:
    """The load of one ``block``, as of `boundary_loads`."""
    one = (None if of is None else np.asarray(of, dtype=float)[None] for of in (acceleration, reaction, overstress))
    return boundary_loads(
        np.array([block]), blocks, vertices, motion, np.array([rotation]), contacts, edge_forces, point_forces,
        np.array([density]), gravity, next(one), np.array([spin]), next(one), route, tensile_strength, next(one),
        keep_straight,
    )[0]  # fmt: skip


def boundary_loads(
    numbers: np.ndarray,
    blocks: Blocks,
    vertices: np.ndarray,
    motion: Motion,
    rotation: np.ndarray,
    contacts: np.ndarray,
    edge_forces: np.ndarray,
    point_forces: np.ndarray,
    density: np.ndarray,
    gravity: np.ndarray | None,
    acceleration: np.ndarray | None,
    spin: np.ndarray,
    reaction: np.ndarray | None = None,
    route: str = "contacts",
    tensile_strength: Sequence[float] | None = None,
    overstress: np.ndarray | None = None,
    keep_straight: np.ndarray | None = None,
) -> list[BoundaryLoad]:
    """The loads of the blocks with these ``numbers`` (n,).

    ``vertices`` and ``motion`` are the geometry on which the forces are in equilibrium; ``contacts`` CONTACT rows on
    that geometry, ``edge_forces`` and ``point_forces`` EDGE_FORCE and POINT_FORCE rows (any block's); ``rotation`` (n,)
    rad, ``density`` (n,), ``acceleration`` (n, 6) and ``spin`` (n,) rad/s the blocks' own; ``reaction`` (n, 6) N, N m, what
    imposes their motion, which is spread over a block as its inertia is; ``route``: "contacts", "bases", "springs" or
    "kelvin-springs"; ``keep_straight`` (n_blocks,) bool which blocks are bases; ``tensile_strength`` of the joint laws,
    Pa (None: none has any); ``overstress`` (n, 3) what the forces balance beyond the stress of a block, Pa, current axes
    (None: at rest).
    """
    numbers, n = np.asarray(numbers), len(numbers)
    moments = [blocks.area_moments(b) for b in numbers.tolist()]
    area, centroid, second = (np.array(each, dtype=float) for each in zip(*moments))
    holding = np.zeros(len(contacts), bool)
    if tensile_strength is not None:
        holding = (contacts["bonded"] == 1) & (np.asarray(tensile_strength, dtype=float)[contacts["law"]] > 0)
    based = np.zeros(blocks.n_blocks, bool)
    if route == "bases" and keep_straight is not None:
        based = np.asarray(keep_straight, dtype=bool)
    pair = np.stack([contacts["block"], contacts["other"]])
    turn = np.stack([np.cos(rotation), np.sin(rotation)], axis=1)
    given = (
        numbers, outlines(blocks, vertices), blocks.vertex_start, area, motion.centre, motion.reference_centre,
        motion.gradient, turn, np.ascontiguousarray(contacts).astype(CONTACT, copy=False), holding,
        *_rows_of(pair, numbers), edge_forces, *_rows_of(edge_forces["block"][None], numbers), point_forces,
        *_rows_of(point_forces["block"][None], numbers), based, route in ("springs", "kelvin-springs"),
    )  # fmt: skip
    pieces, inside, bases, ends, stretch = _with_room(given, 16 * len(contacts) + 16 * n + len(edge_forces))
    zeros = np.zeros((n, 6))
    body_force, gradient, even, imbalance = balanced(
        pieces, inside, ends, area, centroid, second, np.asarray(density, dtype=float),
        np.zeros(2) if gravity is None else np.asarray(gravity, dtype=float),
        zeros if acceleration is None else acceleration, np.asarray(spin, dtype=float), turn,
        zeros if reaction is None else reaction, stretch, motion.gradient[numbers], overstress is not None,
    )  # fmt: skip
    remote = None if overstress is None else even - times(stress_rotations(-np.asarray(rotation)), overstress)
    segments, tractions = pieces.reshape(-1, 4, 2)[:, :2], pieces.reshape(-1, 4, 2)[:, 2:]
    found = []
    for k, ((a, i, j), (b, to_i, to_j)) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist())):
        rows = tuple((np.arange(int(m) - a, int(o) - a), np.array([x, y])) for m, o, x, y in bases[j:to_j].tolist())
        points, forces = (inside[i:to_i, :2], inside[i:to_i, 2:]) if to_i > i else (None, None)
        found.append(
            BoundaryLoad(
                np.ascontiguousarray(segments[a:b]), np.ascontiguousarray(tractions[a:b]), body_force[k], gradient[k],
                centroid[k], float(imbalance[k]), None if remote is None else remote[k], points, forces,
                route == "kelvin-springs", rows,
            )
        )  # fmt: skip
    return found


def _with_room(given: tuple, room: int) -> tuple[np.ndarray, ...]:
    """What is ``found`` of the ``given``, and of each block, where there is ``room`` for so many pieces, or as much as is
    needed."""
    while True:
        found = Found(np.zeros(3, np.int64), np.empty((room, 8)), np.empty((room, 4)), np.empty((room, 4)))
        ends, stretch = _pieces(found, *given)
        count = found.count.tolist()
        if max(count) <= room:
            rows = (each[:many] for each, many in zip((found.pieces, found.inside, found.bases), count))
            return (*rows, ends, stretch)
        room = 2 * max(count)


def _rows_of(owners: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The columns of ``owners`` (k, m) that each of the ``numbers`` (n,) is in, in order, one after the other, and where
    those of each begin and end, (n, 2)."""
    column = np.broadcast_to(np.arange(owners.shape[1]), owners.shape).ravel()
    owner = owners.ravel()
    order = np.lexsort((column, owner))
    ends = np.stack([np.searchsorted(owner[order], numbers, side) for side in ("left", "right")], axis=1)
    return column[order], ends


@kept(error_model="numpy", nogil=True)
def _pieces(
    found, numbers, of, vertex_start, area, centre, reference_centre, gradient, turn, contacts, holding, contact_rows,
    contact_ends, edge_forces, edge_rows, edge_ends, point_forces, point_rows, point_ends, based, pointed,
):  # fmt: skip
    """Add to what is ``found`` the loads of the blocks with these ``numbers`` (n,), one after the other. Returned is how
    much of each kind there is before each block, (n + 1, 3), and Σ r ⊗ f (n, 2, 2) of what shears stretch a block by
    beyond what the pieces do."""
    n = len(numbers)
    ends, stretch = np.zeros((n + 1, 3), np.int64), np.zeros((n, 2, 2))
    for b in range(n):
        block, couple = numbers[b], 0.0
        c, s = turn[b, 0], turn[b, 1]
        rows = contact_rows[contact_ends[b, 0] : contact_ends[b, 1]]
        touches = touches_of(
            block, contacts, rows, holding, centre[block], reference_centre[block], gradient[block], c, s
        )
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
                amount, lost = add_face(found, of, start, touches, face, number, based[touches.against[first]])
                couple += lost
                _, _, ax, ay, _ = line_of(of, start)
                stretch[b, 0, 0] += amount * ax * ax
                stretch[b, 0, 1] += amount * ax * ay
                stretch[b, 1, 0] += amount * ax * ay
                stretch[b, 1, 1] += amount * ay * ay
            for k in lone:
                couple += add_lone(found, of, touches, k)
        for k in range(edge_ends[b, 0], edge_ends[b, 1]):
            add_edge_piece(found, of, edge_forces[edge_rows[k]], c, s)
        first, last = vertex_start[block], vertex_start[block + 1]
        for k in range(point_ends[b, 0], point_ends[b, 1]):
            row = point_forces[point_rows[k]]
            fx, fy = c * row.force[0] + s * row.force[1], c * row.force[1] - s * row.force[0]
            couple += add_point_load(found, of, first, last, row.at[0], row.at[1], fx, fy)
        add_couple(found, of, first, last, area[b], couple)
        for k in range(3):
            ends[b + 1, k] = found.count[k]
    return ends, stretch
