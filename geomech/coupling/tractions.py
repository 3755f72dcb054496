"""Contact forces of a block made into one boundary load of its elastic body, with the same force and moment.

The contacts of one joint face (two edges that lie against each other) are one distribution with the resultant and moment of
its contact forces: linear, or, but for bonds with tensile strength, a triangle where that would pull although the resultant
pushes (`face_pressure`). It ends where
the faces do: a contact that opens takes the pressure back from its place the further the wider it gapes. Shear follows the
pressure, so that it breaks Coulomb's law nowhere unless it breaks it as a whole. A lone vertex pressed into an edge spreads
over a short piece of that edge; a lone force on a block's own corner is resolved along the corner's two edges and enters there
as shear, which keeps both force and moment exactly. Tractions change without a jump as contacts come and go.

Two other routes are there to be compared with: "springs" leaves each contact's force where its spring is, a point force on
the boundary; "kelvin-springs" takes these by Kelvin's solution for the infinite plane, as Khanizadeh Bahabadi et al. (2023,
eqs. 2-4) write.

All of it lives in the block's reference frame: points are mapped back by the block's affine motion, forces turned
back by its rotation. What the forces then leave out of balance is the block's inertia (d'Alembert): it is put on as
a body force, linear in x, so that the elastic problem is in equilibrium to round-off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..ddm.loads import resultants
from ..model import Blocks, Motion
from .face_pressure import linear, no_pull

#: Two edges belong to one joint face when their directions differ by less than this.
FACE_ANGLE = np.radians(10.0)

#: A face that ends within this part of its edge's length of the edge's end ends there.
SNAP = 1e-9

#: Pressures end at a multiple of this part of an edge's length. Force and moment are kept on whatever length; and the body,
#: which knows what segments that it has met before do to it, would meet new ones every step, for faces slide by strains.
GRID = 2.0**-12

#: Contacts nearer to each other than this part of a face's length are at one place.
SAME = 1e-6

#: A point load nearer to an edge than this part of its length stands on it.
ON_EDGE = 1e-6

#: A lone contact spreads over this part of its edge (of the corner's shorter edge).
LONE_SPREAD = 1.0 / 20.0


@dataclass(frozen=True, eq=False)
class BoundaryLoad:
    """Load of one block's elastic body, reference frame.

    segments (m, 2, 2) pieces of the outline, directed along it; tractions (m, 2, 2) at their two ends, linear between;
    points and forces (k, 2) what acts at points, None without, ``kelvin`` as in `ddm.BodyLoad`;
    body_force (2,) and body_force_gradient (2, 2): b = body_force + gradient · (x − about), N/m³; ``imbalance`` is the
    resultant that inertia had to balance beyond the solver's own acceleration, relative to the forces' size.
    """

    segments: np.ndarray
    tractions: np.ndarray
    body_force: np.ndarray
    body_force_gradient: np.ndarray
    about: np.ndarray
    imbalance: float
    points: np.ndarray | None = None
    forces: np.ndarray | None = None
    kelvin: bool = False


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
) -> BoundaryLoad:
    """The load of ``block``.

    ``vertices`` and ``motion`` are the geometry on which the forces are in equilibrium; ``contacts`` CONTACT rows on
    that geometry (any block's); ``edge_forces`` and ``point_forces`` EDGE_FORCE and POINT_FORCE rows of this block;
    ``acceleration`` (6,) and ``spin`` (rad/s) the block's own; ``reaction`` (6,) N, N m, what imposes its motion, which is
    spread over the block as its inertia is; ``route``: "contacts", "springs" or "kelvin-springs"; ``tensile_strength`` of the
    joint laws, Pa (None: none has any).
    """
    c, s = math.cos(rotation), math.sin(rotation)
    pieces = _Pieces()
    touches = _touches(block, motion, contacts, c, s, tensile_strength)
    pointed = route != "contacts"
    if pointed:
        pieces.points += [(_on_outline(blocks, touch), np.array(touch.force)) for touch in touches]
    faces, lone = ({}, []) if pointed else _faces_and_lone(blocks, vertices, touches)
    for (edge, _), touches in faces.items():
        _add_face(pieces, blocks, blocks.sides[edge], touches)
    for touch in lone:
        _add_lone(pieces, blocks, touch, touch.force)
    turn_back = np.array([[c, s], [-s, c]])
    for row in edge_forces:
        _add_edge_piece(pieces, blocks, vertices, row, turn_back)
    for row in point_forces:
        _add_point_load(pieces, blocks, block, row["at"].copy(), turn_back @ row["force"])
    segments, tractions = pieces.arrays()
    inside = pieces.inside()
    return _balanced(
        block, blocks, segments, tractions, inside, density, gravity, acceleration, spin, turn_back, reaction,
        route == "kelvin-springs",
    )  # fmt: skip


class _Pieces:
    """Loaded pieces of the outline as they are found: pairs of x and y at their two ends."""

    def __init__(self) -> None:
        self.segments: list[tuple] = []
        self.tractions: list[tuple] = []
        self.points: list[tuple[np.ndarray, np.ndarray]] = []

    def add(self, a, b, t_a, t_b) -> None:
        if any(t_a) or any(t_b):
            self.segments.append((a, b))
            self.tractions.append((t_a, t_b))

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.segments).reshape(-1, 2, 2), np.array(self.tractions).reshape(-1, 2, 2)

    def inside(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Points (k, 2) inside the rock and the forces (k, 2) on them; None without."""
        return tuple(np.array(part) for part in zip(*self.points)) if self.points else None


class _Touch(NamedTuple):
    """A contact as one of its blocks feels it. There are few, so they are plain numbers.

    ``own``: the block owns the vertex, not the edge; ``normal`` of the edge, current axes; ``point`` and the ``force`` on
    the block in its reference frame; ``acts``: it carries force; ``gap`` m; ``holds``: it may pull.
    """

    own: bool
    vertex: int
    edge: int
    normal: list[float]
    point: list[float]
    force: tuple[float, float]
    acts: bool
    gap: float
    holds: bool


def _touches(
    block: int, motion: Motion, contacts: np.ndarray, c: float, s: float, tensile_strength: Sequence[float] | None
) -> list[_Touch]:
    """What touches ``block``, which has turned by the angle of cosine ``c`` and sine ``s``."""
    rows = contacts[(contacts["block"] == block) | (contacts["other"] == block)]
    holding = np.zeros(len(rows), bool)
    if tensile_strength is not None:
        holding = (rows["bonded"] == 1) & (np.asarray(tensile_strength)[rows["law"]] > 0)
    names = ("block", "vertex", "edge", "normal", "normal_force", "shear_force", "gap")
    columns = (rows[name].tolist() for name in names)
    touches = []
    for owner, vertex, edge, normal, push, shear, gap, point, holds in zip(
        *columns, motion.reference(block, rows["point"]).tolist(), holding.tolist(), strict=True
    ):
        own = owner == block
        if not own:
            push, shear = -push, -shear
        # Shear acts along the edge's direction: its outward normal turned by +90°.
        x, y = push * normal[0] - shear * normal[1], push * normal[1] + shear * normal[0]
        acts = push != 0 or shear != 0
        touches.append(_Touch(own, vertex, edge, normal, point, (c * x + s * y, c * y - s * x), acts, gap, holds))
    return touches


def _on_outline(blocks: Blocks, touch: _Touch) -> np.ndarray:
    """Where a contact's spring stands on the block, reference frame: its vertex, or the foot of the other's on its edge."""
    start = blocks.vertices[touch.edge]
    if touch.own:
        return blocks.vertices[touch.vertex]
    side = blocks.vertices[blocks.next_vertex[touch.edge]] - start
    return start + float(np.clip((np.array(touch.point) - start) @ side / (side @ side), 0.0, 1.0)) * side


def _touching_edge(blocks: Blocks, vertices: np.ndarray, vertex: int, normal: list[float]) -> tuple[int, float]:
    """Which of the two edges at ``vertex`` lies against an edge with outward ``normal``, and the angle between."""
    best = (-1, math.inf)
    nx, ny = normal
    for edge in (vertex, int(blocks.previous_vertex[vertex])):
        (x0, y0), (x1, y1) = vertices[edge].tolist(), vertices[blocks.next_vertex[edge]].tolist()
        x, y = x1 - x0, y1 - y0
        # The outward normal of the edge is (y, −x) over its length.
        angle = math.atan2(abs(y * ny + x * nx), x * ny - y * nx)
        if angle < best[1]:
            best = (edge, angle)
    return best


def _faces_and_lone(
    blocks: Blocks, vertices: np.ndarray, touches: list[_Touch]
) -> tuple[dict[tuple[int, int], list[_Touch]], list[_Touch]]:
    """What touches a block as joint faces with at least two distinct points, (first edge of the own straight side, first
    edge of the other's) → contacts, and the contacts left alone. A vertex in a straight side, as the end of a named piece,
    does not part what touches it into faces of their own."""
    found: dict[tuple[int, int], list[_Touch]] = {}
    lone = []
    for touch in touches:
        touching, angle = _touching_edge(blocks, vertices, touch.vertex, touch.normal)
        if angle <= FACE_ANGLE:
            own, facing = (touching, touch.edge) if touch.own else (touch.edge, touching)
            found.setdefault((blocks.side_start[own], blocks.side_start[facing]), []).append(touch)
        elif touch.acts:
            lone.append(touch)
    faces = {}
    for face, members in found.items():
        start, _, along, length = _line(blocks, blocks.sides[face[0]])
        acting = [touch for touch in members if touch.acts]
        # A corner that has slid past an end of the side presses on that end.
        places = [min(max(_along(touch.point, start, along), 0.0), length) for touch in acting]
        # Points apart by no more than round-off are one.
        if acting and max(places) - min(places) > SAME * length:
            faces[face] = members
        else:
            lone += acting
    return faces, lone


def _line(blocks: Blocks, side: list[int]) -> tuple[list[float], list[float], tuple[float, float], float]:
    """Start, end, direction and length of a straight ``side``, reference frame."""
    start, end = blocks.vertices[side[0]].tolist(), blocks.vertices[side[-1]].tolist()
    x, y = end[0] - start[0], end[1] - start[1]
    length = math.hypot(x, y)
    return start, end, (x / length, y / length), length


def _along(point: Sequence[float], start: Sequence[float], direction: tuple[float, float]) -> float:
    return (point[0] - start[0]) * direction[0] + (point[1] - start[1]) * direction[1]


def _add_face(pieces: _Pieces, blocks: Blocks, side: list[int], touches: list[_Touch]) -> None:
    line = start, _, (ax, ay), length = _line(blocks, side)
    places = [_along(touch.point, start, (ax, ay)) for touch in touches]
    acting = [(place, touch) for place, touch in zip(places, touches) if touch.acts]
    total = moment = shear = size = 0.0
    for place, (x, y) in ((place, touch.force) for place, touch in acting):
        push = ax * y - ay * x  # inward: the direction turned by +90°
        total += push
        moment += push * place
        shear += ax * x + ay * y
        size += abs(x) + abs(y)
    # The force that goes with a unit of pressure: shear in proportion to it, evenly spread where faces are held together
    # besides and there is none to go by. Pressure on a bond that may pull is linear, and shear even, wherever its resultant
    # is: it goes on without a jump as that leaves the face.
    reach = [place for place, _ in acting]
    holds = all(touch.holds for _, touch in acting)
    even = holds or abs(total) <= 1e-9 * size or not min(reach) <= moment / total <= max(reach)
    slope = 0.0 if even else shear / total
    per_push = (slope * ax - ay, slope * ay + ax)
    gapes = [(place, touch) for place, touch in zip(places, touches) if not touch.acts]
    for low, low_share in _ends(acting, gapes, length, -1):
        for high, high_share in _ends(acting, gapes, length, 1):
            share = low_share * high_share
            first, last = (min(max(_on_grid(place, length), 0.0), length) for place in (low[0], high[0]))
            if first == last:
                first, last = max(low[0], 0.0), min(high[0], length)
            force_and_moment = last - first, share * total, share * (moment - first * total)
            found, at_first, at_last = ([linear(*force_and_moment)], 0.0, 0.0) if holds else no_pull(*force_and_moment)
            for a, b, p_a, p_b in found:
                t_a, t_b = ((p * per_push[0], p * per_push[1]) for p in (p_a, p_b))
                _add_on_side(pieces, blocks, side, line, (first + a, first + b), t_a, t_b)
            for force, (_, touch) in ((at_first, low), (at_last, high)):
                if force:
                    _add_lone(pieces, blocks, touch, (force * per_push[0], force * per_push[1]))
            if even:
                q = share * shear / (last - first)
                _add_on_side(pieces, blocks, side, line, (first, last), (q * ax, q * ay), (q * ax, q * ay))


def _on_grid(place: float, length: float) -> float:
    return round(place / (GRID * length)) * (GRID * length)


def _ends(acting: list, gapes: list, length: float, way: int) -> list[tuple[tuple[float, _Touch], float]]:
    """Where a face's pressure may end on one side (``way`` −1 or 1), as pairs of place and touch, and the share of each:
    the last contact that acts, and the next one that gapes, the less the wider it does beside how much the other one gives."""
    closed = max(acting, key=lambda of: (way * of[0], abs(of[1].force[0]) + abs(of[1].force[1])))
    beyond = [of for of in gapes if way * (of[0] - closed[0]) > SAME * length]
    if not beyond:
        return [(closed, 1.0)]
    nearest = min(beyond, key=lambda of: way * of[0])
    give, gap = max(-closed[1].gap, 0.0), max(nearest[1].gap, 0.0)
    share = give / (give + gap) if give > 0 else 0.0
    return [(of, part) for of, part in ((closed, 1.0 - share), (nearest, share)) if part > 0]


def _add_on_side(pieces: _Pieces, blocks: Blocks, side: list[int], line: tuple, span: tuple, t_a, t_b) -> None:
    """A traction from ``t_a`` to ``t_b`` over a ``span`` of a straight side: one piece an edge, for a load segment lies on
    one edge."""
    (start, end, (ax, ay), length), (a, b) = line, span
    corners = [start, *(blocks.vertices[k].tolist() for k in side[1:-1]), end]
    marks = [0.0, *(_along(corner, start, (ax, ay)) for corner in corners[1:-1]), length]

    def at(place: float, k: int) -> Sequence[float]:
        return corners[k] if place == marks[k] else (start[0] + place * ax, start[1] + place * ay)

    def traction(place: float) -> tuple[float, float]:
        part = (place - a) / (b - a)
        return t_a[0] + part * (t_b[0] - t_a[0]), t_a[1] + part * (t_b[1] - t_a[1])

    for k in range(len(side) - 1):
        low, high = max(a, marks[k]), min(b, marks[k + 1])
        if high - low > SNAP * length:
            pieces.add(at(low, k), at(high, k + 1), traction(low), traction(high))


def _add_lone(pieces: _Pieces, blocks: Blocks, touch: _Touch, force: tuple[float, float]) -> None:
    if touch.own:
        _add_corner_force(pieces, blocks, touch.vertex, force)
    else:
        _add_edge_force(pieces, blocks, touch.edge, touch.point, force)


def _add_corner_force(pieces: _Pieces, blocks: Blocks, vertex: int, force: Sequence[float]) -> None:
    (px, py), (x, y), (nx, ny) = (
        blocks.vertices[k].tolist() for k in (blocks.previous_vertex[vertex], vertex, blocks.next_vertex[vertex])
    )
    bx, by, ax, ay = x - px, y - py, nx - x, ny - y
    before, after = math.hypot(bx, by), math.hypot(ax, ay)
    reach = LONE_SPREAD * min(before, after)
    bx, by, ax, ay = bx / before, by / before, ax / after, ay / after
    turn = bx * ay - by * ax
    start, end = (x - reach * bx, y - reach * by), (x + reach * ax, y + reach * ay)
    fx, fy = (float(part) / reach for part in force)
    if abs(turn) < math.sin(FACE_ANGLE):
        # The corner is as good as flat: its two edges cannot resolve a force across them; treat it as one edge.
        t = (fx / 2, fy / 2)
        pieces.add(start, (x, y), t, t)
        pieces.add((x, y), end, t, t)
        return
    on_before, on_after = (fx * ay - fy * ax) / turn, (bx * fy - by * fx) / turn
    t = (on_before * bx, on_before * by)
    pieces.add(start, (x, y), t, t)
    t = (on_after * ax, on_after * ay)
    pieces.add((x, y), end, t, t)


def _add_edge_force(pieces: _Pieces, blocks: Blocks, edge: int, point: Sequence[float], force: Sequence[float]) -> None:
    (x, y), (ex, ey) = blocks.vertices[edge].tolist(), blocks.vertices[blocks.next_vertex[edge]].tolist()
    length = math.hypot(ex - x, ey - y)
    ax, ay = (ex - x) / length, (ey - y) / length
    place = min(max(_along(point, (x, y), (ax, ay)), 0.0), length)
    # About the point, hence narrower near an end of the edge; at the very end it is a corner force.
    if min(place, length - place) < SAME * length:
        _add_corner_force(pieces, blocks, edge if place < length / 2 else int(blocks.next_vertex[edge]), force)
        return
    middle = _on_grid(place, length)
    middle = place if middle <= 0.0 or middle >= length else middle
    half = min(LONE_SPREAD * length / 2, middle, length - middle)
    tx, ty = (float(part) / (2 * half) for part in force)
    # The push across the edge is where the point is, not in the middle.
    tilt = 3 * (place - middle) / half * (ax * ty - ay * tx)
    low, high = middle - half, middle + half
    pieces.add(
        (x + low * ax, y + low * ay),
        (x + high * ax, y + high * ay),
        (tx + tilt * ay, ty - tilt * ax),
        (tx - tilt * ay, ty + tilt * ax),
    )


def _add_edge_piece(pieces: _Pieces, blocks: Blocks, vertices: np.ndarray, row: np.void, turn_back: np.ndarray) -> None:
    """A piece of an edge (EDGE_FORCE row, on the current ``vertices``) with its traction, which is linear there too: the
    block's motion is affine. Its ends stay bit for bit at the edge's where they are there."""
    first, last = int(row["edge"]), int(blocks.next_vertex[row["edge"]])
    now = vertices[last] - vertices[first]
    a, b = blocks.vertices[first], blocks.vertices[last]
    length = np.hypot(*now)
    stretch = length / np.hypot(*(b - a))
    s0, s1 = ((row[end] - vertices[first]) @ now / length**2 for end in ("start", "end"))
    if abs(s1 - s0) <= SNAP:
        return  # as where a water table meets the edge's end: no force to speak of, and no length to put it on
    start = a if s0 < SNAP else a + s0 * (b - a)
    end = b if s1 > 1 - SNAP else a + s1 * (b - a)
    t_start, t_end = row["traction"] @ turn_back.T * stretch
    pieces.add(start, end, t_start, t_end)


def _add_point_load(pieces, blocks, block: int, point: np.ndarray, force: np.ndarray) -> None:
    """A point load on an edge is spread a little along it; one inside the rock stays one."""
    first, last = blocks.vertex_start[block], blocks.vertex_start[block + 1]
    edges = np.arange(first, last)
    start, end = blocks.vertices[edges], blocks.vertices[blocks.next_vertex[edges]]
    along = end - start
    place = np.clip(np.sum((point - start) * along, axis=1) / np.sum(along**2, axis=1), 0, 1)
    distance = np.hypot(*(start + place[:, None] * along - point).T)
    nearest = int(np.argmin(distance))
    if distance[nearest] <= ON_EDGE * np.hypot(*along[nearest]):
        _add_edge_force(pieces, blocks, int(edges[nearest]), point, force)
    elif np.any(force):
        pieces.points.append((point, force))


def _balanced(
    block, blocks, segments, tractions, inside, density, gravity, acceleration, spin, turn_back, reaction, kelvin
) -> BoundaryLoad:
    area, centroid, second = blocks.area_moments(block)
    (xx, xy), (_, yy) = second.tolist()
    (c, s), _ = turn_back.tolist()
    bxx = bxy = byy = 0.0  # the body force's gradient, still symmetric
    carried, angular = np.zeros(2), 0.0
    if density:
        g = np.zeros(2) if gravity is None else np.asarray(gravity, dtype=float)
        ax, ay, angular, exx, eyy, shear = (0.0,) * 6 if acceleration is None else acceleration.tolist()
        bxx = density * (spin**2 - c * c * exx - s * s * eyy - s * c * shear)
        byy = density * (spin**2 - s * s * exx - c * c * eyy + s * c * shear)
        bxy = -density * (s * c * (eyy - exx) + 0.5 * (c * c - s * s) * shear)
        carried, angular = turn_back @ (density * (g - (ax, ay))), density * angular
    if reaction is not None:
        carried = carried + turn_back @ reaction[:2] / area
        angular -= float(reaction[2]) / (xx + yy)
    force, moment, size = resultants(segments, tractions, centroid)
    if inside is not None:
        arm, (fx, fy) = (inside[0] - centroid).T, inside[1].T
        force = force + inside[1].sum(axis=0)
        moment += float(np.sum(arm[0] * fy - arm[1] * fx))
        size += float(np.abs(inside[1]).sum())
    # ∫ (x b_y − y b_x) dA of b = B x
    moment += bxy * xx + byy * xy - bxx * xy - bxy * yy
    body_force, torque = -force / area, moment / (xx + yy)
    gradient = np.array([[bxx, bxy + torque], [bxy - torque, byy]])
    imbalance = 0.0
    if size > 0:
        missed = math.hypot(*(body_force - carried)) * area + abs(torque - angular) * (xx + yy) / math.sqrt(area)
        imbalance = missed / size
    points, forces = inside or (None, None)
    return BoundaryLoad(segments, tractions, body_force, gradient, centroid, imbalance, points, forces, kelvin)
