"""Contact forces of a block made into one boundary load of its elastic body, with the same force and moment.

The contacts of one joint face (two edges that lie against each other) are one distribution: the linear pressure with
the resultant and moment of its contact forces; where that would pull although the resultant pushes, the triangle on
the shorter, fully compressed length. Shear follows the pressure, so that it breaks Coulomb's law nowhere unless it
breaks it as a whole. A lone vertex pressed into an edge spreads over a short piece of that edge; a lone force on a
block's own corner is resolved along the corner's two edges and enters there as shear, which keeps both force and
moment exactly.

All of it lives in the block's reference frame: points are mapped back by the block's affine motion, forces turned
back by its rotation. What the forces then leave out of balance is the block's inertia (d'Alembert): it is put on as
a body force, linear in x, so that the elastic problem is in equilibrium to round-off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..conventions import normal_of
from ..ddm.loads import resultants
from ..model import Blocks, Motion

#: Two edges belong to one joint face when their directions differ by less than this.
FACE_ANGLE = np.radians(10.0)

#: Edges lie in one line when the tangent of their angle is below this: straight sides stay straight as blocks strain.
STRAIGHT = 1e-6

#: A face that ends within this part of its edge's length of the edge's end ends there.
SNAP = 1e-9

#: A lone contact spreads over this part of its edge (of the corner's shorter edge).
LONE_SPREAD = 1.0 / 20.0


@dataclass(frozen=True, eq=False)
class BoundaryLoad:
    """Load of one block's elastic body, reference frame.

    segments (m, 2, 2) pieces of the outline, directed along it; tractions (m, 2, 2) at their two ends, linear between;
    body_force (2,) and body_force_gradient (2, 2): b = body_force + gradient · (x − about), N/m³; ``imbalance`` is the
    resultant that inertia had to balance beyond the solver's own acceleration, relative to the forces' size.
    """

    segments: np.ndarray
    tractions: np.ndarray
    body_force: np.ndarray
    body_force_gradient: np.ndarray
    about: np.ndarray
    imbalance: float


def linear_pressure(length: float, force: float, moment: float) -> tuple[float, float, float, float]:
    """(start, end, p_start, p_end) of the distribution on [0, length] with resultant ``force`` and ``moment`` about 0.

    Linear over the whole length; where a pushing resultant (force > 0) would need a pull at one end, the triangle with
    the same resultant on the shorter length. A resultant outside [0, length] cannot be carried without pull: it stays
    linear, pull and all, since force and moment come first.
    """
    p_start = (4 * force * length - 6 * moment) / length**2
    p_end = (6 * moment - 2 * force * length) / length**2
    if force > 0 and min(p_start, p_end) < 0:
        arm = moment / force
        if 0 < arm < length / 3:
            return 0.0, 3 * arm, 2 * force / (3 * arm), 0.0
        if 0 < length - arm < length / 3:
            reach = 3 * (length - arm)
            return length - reach, length, 0.0, 2 * force / reach
    return 0.0, length, p_start, p_end


def boundary_load(
    block: int,
    blocks: Blocks,
    vertices: np.ndarray,
    motion: Motion,
    rotation: float,
    contacts: np.ndarray,
    edge_tractions: list[tuple[int, np.ndarray]],
    point_loads: list[tuple[np.ndarray, np.ndarray]],
    density: float = 0.0,
    gravity: np.ndarray | None = None,
    acceleration: np.ndarray | None = None,
    spin: float = 0.0,
) -> BoundaryLoad:
    """The load of ``block``.

    ``vertices`` and ``motion`` are the geometry on which the forces are in equilibrium; ``contacts`` CONTACT rows on
    that geometry (any block's); ``edge_tractions`` (edge, traction per reference length) of this block;
    ``point_loads`` (reference point, force); ``acceleration`` (6,) and ``spin`` (rad/s) the block's own.
    """
    turn_back = _rotation(-rotation)
    pieces = _Pieces()
    faces, lone = _faces_and_lone(block, blocks, vertices, contacts)
    for (edge, _), rows in faces.items():
        _add_face(pieces, blocks, motion, block, _side(blocks, vertices, edge), rows, turn_back)
    for row in lone:
        _add_lone(pieces, blocks, motion, block, row, turn_back)
    for edge, traction in edge_tractions:
        a, b = blocks.vertices[edge], blocks.vertices[blocks.next_vertex[edge]]
        pieces.add(a, b, turn_back @ traction, turn_back @ traction)
    for point, force in point_loads:
        _add_point_load(
            pieces, blocks, block, np.asarray(point, dtype=float), turn_back @ np.asarray(force, dtype=float)
        )
    segments, tractions = pieces.arrays()
    return _balanced(block, blocks, segments, tractions, density, gravity, acceleration, spin, turn_back)


class _Pieces:
    """Loaded pieces of the outline as they are found."""

    def __init__(self) -> None:
        self.segments: list[tuple[np.ndarray, np.ndarray]] = []
        self.tractions: list[tuple[np.ndarray, np.ndarray]] = []

    def add(self, a: np.ndarray, b: np.ndarray, t_a: np.ndarray, t_b: np.ndarray) -> None:
        if t_a.any() or t_b.any():
            self.segments.append((a, b))
            self.tractions.append((t_a, t_b))

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.segments).reshape(-1, 2, 2), np.array(self.tractions).reshape(-1, 2, 2)


def _rotation(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def _touching_edge(blocks: Blocks, vertices: np.ndarray, vertex: int, normal: np.ndarray) -> tuple[int, float]:
    """Which of the two edges at ``vertex`` lies against an edge with outward ``normal``, and the angle between."""
    best = (-1, math.inf)
    nx, ny = normal.tolist()
    for edge in (vertex, int(blocks.previous_vertex[vertex])):
        x, y = (vertices[blocks.next_vertex[edge]] - vertices[edge]).tolist()
        # The outward normal of the edge is (y, −x) over its length.
        angle = math.atan2(abs(y * ny + x * nx), x * ny - y * nx)
        if angle < best[1]:
            best = (edge, angle)
    return best


def _line_start(blocks: Blocks, vertices: np.ndarray, edge: int) -> int:
    """The first of the edges that lie in one straight line with ``edge``: a vertex in a straight side, as the end of a
    named piece, must not part what touches it into faces of their own."""
    first = edge
    start, end = vertices[edge].tolist(), vertices[blocks.next_vertex[edge]].tolist()
    ax, ay = end[0] - start[0], end[1] - start[1]
    while True:
        before = int(blocks.previous_vertex[first])
        x, y = vertices[before].tolist()
        bx, by = start[0] - x, start[1] - y
        along = ax * bx + ay * by
        if along <= 0 or abs(ax * by - ay * bx) > STRAIGHT * along or before == edge:
            return first
        first, start = before, (x, y)


def _side(blocks: Blocks, vertices: np.ndarray, first: int) -> list[int]:
    """The vertices along the straight side that begins with edge ``first``, its two ends included."""
    side = [first, int(blocks.next_vertex[first])]
    while side[-1] != first and _line_start(blocks, vertices, side[-1]) == first:
        side.append(int(blocks.next_vertex[side[-1]]))
    return side


def _faces_and_lone(
    block: int, blocks: Blocks, vertices: np.ndarray, contacts: np.ndarray
) -> tuple[dict[tuple[int, int], np.ndarray], np.ndarray]:
    """The acting contacts of ``block``: joint faces with at least two distinct points, (first edge of the own straight
    side, first edge of the other's) → rows, and the rows left alone."""
    acting = contacts[(contacts["normal_force"] != 0) | (contacts["shear_force"] != 0)]
    rows = acting[(acting["block"] == block) | (acting["other"] == block)]
    found: dict[tuple[int, int], list[int]] = {}
    lone = []
    columns = (rows[name].tolist() for name in ("vertex", "edge", "block"))
    for k, (vertex, edge, owner) in enumerate(zip(*columns, strict=True)):
        touching, angle = _touching_edge(blocks, vertices, vertex, rows["normal"][k])
        if angle > FACE_ANGLE:
            lone.append(k)
        else:
            own, facing = (touching, edge) if owner == block else (edge, touching)
            face = _line_start(blocks, vertices, own), _line_start(blocks, vertices, facing)
            found.setdefault(face, []).append(k)
    faces = {}
    for face, members in found.items():
        if _spread(rows["point"][members], vertices, blocks, face[0]):
            faces[face] = rows[members]
        else:
            lone += members
    return faces, rows[lone]


def _spread(points: np.ndarray, vertices: np.ndarray, blocks: Blocks, edge: int) -> float:
    """Distance between the outermost contact ``points`` along ``edge``, 0 when it is round-off of the edge's length."""
    along = vertices[blocks.next_vertex[edge]] - vertices[edge]
    length = np.hypot(*along)
    reach = float(np.ptp((points - vertices[edge]) @ along / length))
    return reach if reach > 1e-6 * length else 0.0


def _force_on(block: int, rows: np.ndarray) -> np.ndarray:
    """(..., 2) N/m of CONTACT ``rows`` on ``block``."""
    normal = rows["normal"]
    along = normal_of(normal)  # the edge's direction: its outward normal turned by +90°
    force = rows["normal_force"][..., None] * normal + rows["shear_force"][..., None] * along
    return np.where((rows["block"] == block)[..., None], force, -force)


def _add_face(pieces, blocks, motion, block, side, rows, turn_back) -> None:
    corners = blocks.vertices[side]
    start, end = corners[0], corners[-1]
    length = np.hypot(*(end - start))
    along = (end - start) / length
    inward = np.array([-along[1], along[0]])
    places = (motion.reference(block, rows["point"]) - start) @ along
    forces = _force_on(block, rows) @ turn_back.T
    first, last = max(places.min(), 0.0), min(places.max(), length)
    # Round-off of the mapping must not make a new load segment every step: the body keeps what it knows of a segment.
    # The pressure below has the force and moment of the contacts on whatever length it is given.
    first = 0.0 if first < SNAP * length else first
    last = length if last > (1 - SNAP) * length else last
    push, shear = forces @ inward, forces @ along
    total, moment = push.sum(), push @ (places - first)
    a, b, p_a, p_b = linear_pressure(last - first, total, moment)
    # Shear in proportion to the pressure, or evenly where there is none to go by.
    if abs(total) > 1e-9 * np.abs(forces).sum():
        q_a, q_b = shear.sum() / total * p_a, shear.sum() / total * p_b
    else:
        q_a = q_b = shear.sum() / (b - a)
    t_a, t_b = p_a * inward + q_a * along, p_b * inward + q_b * along
    # One piece an edge of the side: a load segment lies on one edge.
    a, b = first + a, first + b
    marks = (corners - start) @ along
    marks[-1] = length
    for k in range(len(side) - 1):
        low, high = max(a, marks[k]), min(b, marks[k + 1])
        if high - low > SNAP * length:
            pieces.add(
                corners[k] if low == marks[k] else start + low * along,
                corners[k + 1] if high == marks[k + 1] else start + high * along,
                t_a + (low - a) / (b - a) * (t_b - t_a),
                t_a + (high - a) / (b - a) * (t_b - t_a),
            )


def _add_lone(pieces, blocks, motion, block, row, turn_back) -> None:
    force = turn_back @ _force_on(block, row)
    if row["block"] == block:
        _add_corner_force(pieces, blocks, int(row["vertex"]), force)
    else:
        _add_edge_force(pieces, blocks, int(row["edge"]), motion.reference(block, row["point"]), force)


def _add_corner_force(pieces, blocks, vertex: int, force: np.ndarray) -> None:
    corner = blocks.vertices[vertex]
    after = blocks.vertices[blocks.next_vertex[vertex]] - corner
    before = corner - blocks.vertices[blocks.previous_vertex[vertex]]
    reach = LONE_SPREAD * min(np.hypot(*after), np.hypot(*before))
    after, before = after / np.hypot(*after), before / np.hypot(*before)
    turn = before[0] * after[1] - before[1] * after[0]
    if abs(turn) < np.sin(FACE_ANGLE):
        # The corner is as good as flat: its two edges cannot resolve a force across them; treat it as one edge.
        t = force / (2 * reach)
        pieces.add(corner - reach * before, corner, t, t)
        pieces.add(corner, corner + reach * after, t, t)
        return
    along_before, along_after = np.linalg.solve(np.column_stack([before, after]), force) / reach
    pieces.add(corner - reach * before, corner, along_before * before, along_before * before)
    pieces.add(corner, corner + reach * after, along_after * after, along_after * after)


def _add_edge_force(pieces, blocks, edge: int, point: np.ndarray, force: np.ndarray) -> None:
    start, end = blocks.vertices[edge], blocks.vertices[blocks.next_vertex[edge]]
    length = np.hypot(*(end - start))
    along = (end - start) / length
    place = float(np.clip((point - start) @ along, 0.0, length))
    # Centred on the point, hence narrower near an end of the edge; at the very end it is a corner force.
    half = min(LONE_SPREAD * length / 2, place, length - place)
    if half < 1e-6 * length:
        corner = edge if place < length / 2 else int(blocks.next_vertex[edge])
        _add_corner_force(pieces, blocks, corner, force)
        return
    t = force / (2 * half)
    pieces.add(start + (place - half) * along, start + (place + half) * along, t, t)


def _add_point_load(pieces, blocks, block: int, point: np.ndarray, force: np.ndarray) -> None:
    """A point load enters on the edge nearest to it, where the scene puts such loads."""
    first, last = blocks.vertex_start[block], blocks.vertex_start[block + 1]
    edges = np.arange(first, last)
    start, end = blocks.vertices[edges], blocks.vertices[blocks.next_vertex[edges]]
    along = end - start
    place = np.clip(np.sum((point - start) * along, axis=1) / np.sum(along**2, axis=1), 0, 1)
    nearest = int(np.argmin(np.hypot(*(start + place[:, None] * along - point).T)))
    _add_edge_force(pieces, blocks, int(edges[nearest]), point, force)


def _balanced(block, blocks, segments, tractions, density, gravity, acceleration, spin, turn_back) -> BoundaryLoad:
    area, centroid, second = blocks.area_moments(block)
    gradient = np.zeros((2, 2))
    if density and acceleration is not None:
        strain_rate = np.array([[acceleration[3], acceleration[5] / 2], [acceleration[5] / 2, acceleration[4]]])
        gradient -= density * (turn_back @ strain_rate @ turn_back.T)
    if density and spin:
        gradient += density * spin**2 * np.eye(2)
    force, moment, size = resultants(segments, tractions, centroid)
    # ∫ (x b_y − y b_x) dA of b = B x, second = [[∫x², ∫xy], [∫xy, ∫y²]]
    moment += (gradient @ second)[1, 0] - (gradient @ second)[0, 1]
    polar = second[0, 0] + second[1, 1]
    body_force, torque = -force / area, moment / polar
    gradient = gradient + torque * np.array([[0.0, 1.0], [-1.0, 0.0]])
    imbalance = 0.0
    if size > 0:
        carried = np.zeros(2)
        angular = 0.0
        if density:
            g = np.zeros(2) if gravity is None else np.asarray(gravity, dtype=float)
            a = np.zeros(6) if acceleration is None else acceleration
            carried, angular = turn_back @ (density * (g - a[:2])), density * a[2]
        missed = np.hypot(*(body_force - carried)) * area + abs(torque - angular) * polar / np.sqrt(area)
        imbalance = float(missed / size)
    return BoundaryLoad(segments, tractions, body_force, gradient, centroid, imbalance)
