"""Forces put on the outline of a block as tractions on pieces of its edges, each piece linear and on one edge."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..model import Blocks

#: Two edges belong to one joint face when their directions differ by less than this.
FACE_ANGLE = np.radians(10.0)

#: A face that ends within this part of its edge's length of the edge's end ends there.
SNAP = 1e-9

#: Pressures end at a multiple of this part of an edge's length. Force and moment are kept on whatever length; and the
#: body, which knows what segments that it has met before do to it, would meet new ones every step, for faces slide by
#: strains.
GRID = 2.0**-12

#: Contacts nearer to each other than this part of a face's length are at one place.
SAME = 1e-6

#: A point load nearer to an edge than this part of its length stands on it.
ON_EDGE = 1e-6

#: A lone contact spreads over this part of its edge (of the corner's shorter edge).
LONE_SPREAD = 1.0 / 20.0


#: Pieces of a face on a rigid base. A slot in a block as wide as deep, twice and three times as wide: K to 6e-4, 1e-4
#: and 2e-3 with 24 of them, 7e-4, 2e-3 and 2 % with 16 (`tests/coupling/test_bases.py`).
ON_BASE = 24


class Pieces:
    """Loaded pieces of the outline as they are found: pairs of x and y at their two ends.

    ``left_out``: directions of faces, and by what moment (N m) shears along each of them stretch the block beyond what
    the tractions on it do: those of two contacts that oppose each other have neither resultant nor moment. ``couple``:
    the moment (N m) that forces lose which act beyond the end of the edge that bears them, see `add_couple`.
    ``bases``: rows of pieces, one after the other, that press on a rigid base, and the traction with a unit of
    pressure.
    """

    def __init__(self) -> None:
        self.segments: list[tuple] = []
        self.tractions: list[tuple] = []
        self.points: list[tuple[np.ndarray, np.ndarray]] = []
        self.left_out: list[tuple[tuple[float, float], float]] = []
        self.couple = 0.0
        self.bases: list[tuple[range, tuple[float, float]]] = []

    def add(self, a, b, t_a, t_b) -> None:
        if any(t_a) or any(t_b):
            self.segments.append((a, b))
            self.tractions.append((t_a, t_b))

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.segments).reshape(-1, 2, 2), np.array(self.tractions).reshape(-1, 2, 2)

    def stretch(self) -> np.ndarray:
        """Σ r ⊗ f (2, 2) of what is ``left_out``."""
        return sum((amount * np.outer(along, along) for along, amount in self.left_out), np.zeros((2, 2)))

    def inside(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Points (k, 2) inside the rock and the forces (k, 2) on them; None without."""
        return tuple(np.array(part) for part in zip(*self.points)) if self.points else None


def line_of(blocks: Blocks, side: list[int]) -> tuple[list[float], list[float], tuple[float, float], float]:
    """Start, end, direction and length of a straight ``side``, reference frame."""
    start, end = blocks.vertices[side[0]].tolist(), blocks.vertices[side[-1]].tolist()
    x, y = end[0] - start[0], end[1] - start[1]
    length = math.hypot(x, y)
    return start, end, (x / length, y / length), length


def place_along(point: Sequence[float], start: Sequence[float], direction: tuple[float, float]) -> float:
    """How far from ``start`` along a unit ``direction`` the ``point`` lies, m."""
    return (point[0] - start[0]) * direction[0] + (point[1] - start[1]) * direction[1]


def on_grid(place: float, length: float) -> float:
    """The multiple of GRID times ``length`` that is nearest to ``place``."""
    return round(place / (GRID * length)) * (GRID * length)


def add_on_side(pieces: Pieces, blocks: Blocks, side: list[int], line: tuple, span: tuple, t_a, t_b) -> None:
    """A traction from ``t_a`` to ``t_b`` over a ``span`` of a straight side: one piece an edge, for a load segment lies
    on one edge."""
    (start, end, (ax, ay), length), (a, b) = line, span
    corners = [start, *(blocks.vertices[k].tolist() for k in side[1:-1]), end]
    marks = [0.0, *(place_along(corner, start, (ax, ay)) for corner in corners[1:-1]), length]

    def at(place: float, k: int) -> Sequence[float]:
        return corners[k] if place == marks[k] else (start[0] + place * ax, start[1] + place * ay)

    def traction(place: float) -> tuple[float, float]:
        part = (place - a) / (b - a)
        return t_a[0] + part * (t_b[0] - t_a[0]), t_a[1] + part * (t_b[1] - t_a[1])

    for k in range(len(side) - 1):
        low, high = max(a, marks[k]), min(b, marks[k + 1])
        if high - low > SNAP * length:
            pieces.add(at(low, k), at(high, k + 1), traction(low), traction(high))


def add_base(pieces: Pieces, blocks: Blocks, side: list[int], line: tuple, span: tuple, p_a, p_b, per_push) -> None:
    """A pressure from ``p_a`` to ``p_b`` over a ``span`` of a straight side, on pieces that another one may take: short
    at the ends, where bases press most."""
    (start, end, (ax, ay), length), (a, b) = line, span
    corners = [(place_along(blocks.vertices[k].tolist(), start, (ax, ay)), k) for k in side[1:-1]]
    inner = [math.sin(0.5 * math.pi * k / ON_BASE) ** 2 for k in range(1, ON_BASE)]
    marks = {a: None, b: None} | {a + part * (b - a): None for part in inner}
    marks |= {place: k for place, k in corners if a + SNAP * length < place < b - SNAP * length}
    places = sorted(marks)
    points = [(start[0] + s * ax, start[1] + s * ay) if marks[s] is None else blocks.vertices[marks[s]] for s in places]
    if b == length:
        points[-1] = end
    tractions = [tuple((p_a + (s - a) / (b - a) * (p_b - p_a)) * way for way in per_push) for s in places]
    first = len(pieces.segments)
    pieces.segments += list(pairwise(points))
    pieces.tractions += list(pairwise(tractions))
    pieces.bases.append((range(first, len(pieces.segments)), per_push))


def add_corner_force(pieces: Pieces, blocks: Blocks, vertex: int, force: Sequence[float]) -> None:
    """A force on a corner, resolved along its two edges: shear on a short piece of each."""
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
        # The corner is as good as flat: its two edges cannot resolve a force across them. Half of it goes on each; the
        # middle of the two halves is off the corner, and what moment that makes one half, across, gives the other.
        sx, sy = ax + bx, ay + by
        cross = ((ax - bx) * fy - (ay - by) * fx) / (2 * (sx * sx + sy * sy))
        ox, oy = -cross * sy, cross * sx
        t = (fx / 2 + ox, fy / 2 + oy)
        pieces.add(start, (x, y), t, t)
        t = (fx / 2 - ox, fy / 2 - oy)
        pieces.add((x, y), end, t, t)
        return
    on_before, on_after = (fx * ay - fy * ax) / turn, (bx * fy - by * fx) / turn
    t = (on_before * bx, on_before * by)
    pieces.add(start, (x, y), t, t)
    t = (on_after * ax, on_after * ay)
    pieces.add((x, y), end, t, t)


def add_edge_force(pieces: Pieces, blocks: Blocks, edge: int, point: Sequence[float], force: Sequence[float]) -> None:
    """A force at a ``point`` of an edge, spread over a short piece of it with the same moment. One beyond its end acts
    at that end, and with the couple that is then left."""
    (x, y), (ex, ey) = blocks.vertices[edge].tolist(), blocks.vertices[blocks.next_vertex[edge]].tolist()
    length = math.hypot(ex - x, ey - y)
    ax, ay = (ex - x) / length, (ey - y) / length
    acts_at = place_along(point, (x, y), (ax, ay))
    place = min(max(acts_at, 0.0), length)
    pieces.couple += (acts_at - place) * float(ax * force[1] - ay * force[0])
    # About the point, hence narrower near an end of the edge; at the very end it is a corner force.
    if min(place, length - place) < SAME * length:
        add_corner_force(pieces, blocks, edge if place < length / 2 else int(blocks.next_vertex[edge]), force)
        return
    middle = on_grid(place, length)
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


def add_couple(pieces: Pieces, blocks: Blocks, block: int) -> None:
    """The ``couple`` as an even shear flow q along all edges of the ``block``: Bredt's M = 2 A q. It has no resultant,
    stretches nothing in the mean, and stays small however short the edge is that the forces have slid beyond."""
    if not pieces.couple:
        return
    area, _, _ = blocks.area_moments(block)
    for edge in range(blocks.vertex_start[block], blocks.vertex_start[block + 1]):
        a, b = blocks.vertices[edge].tolist(), blocks.vertices[blocks.next_vertex[edge]].tolist()
        flow = pieces.couple / (2 * area * math.dist(a, b))
        t = (flow * (b[0] - a[0]), flow * (b[1] - a[1]))
        pieces.add(a, b, t, t)


def add_edge_piece(pieces: Pieces, blocks: Blocks, vertices: np.ndarray, row: np.void, turn_back: np.ndarray) -> None:
    """A piece of an edge (EDGE_FORCE row, on the current ``vertices``) with its traction, which is linear there too:
    the block's motion is affine. Its ends stay bit for bit at the edge's where they are there."""
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


def add_point_load(pieces: Pieces, blocks: Blocks, block: int, point: np.ndarray, force: np.ndarray) -> None:
    """A point load on an edge is spread a little along it; one inside the rock stays one."""
    first, last = blocks.vertex_start[block], blocks.vertex_start[block + 1]
    edges = np.arange(first, last)
    start, end = blocks.vertices[edges], blocks.vertices[blocks.next_vertex[edges]]
    along = end - start
    place = np.clip(np.sum((point - start) * along, axis=1) / np.sum(along**2, axis=1), 0, 1)
    distance = np.hypot(*(start + place[:, None] * along - point).T)
    nearest = int(np.argmin(distance))
    if distance[nearest] <= ON_EDGE * np.hypot(*along[nearest]):
        add_edge_force(pieces, blocks, int(edges[nearest]), point, force)
    elif np.any(force):
        pieces.points.append((point, force))
