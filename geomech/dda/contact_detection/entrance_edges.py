"""Entrance edges: which vertices may contact which edges of two neighbouring blocks (Shi 1988).

A vertex contacts the interior of an edge when its corner points away from the edge. Where two corners meet, the
entrance lines are the edges that have the other corner entirely on their outer side (Shi 1988). Parallel entrance lines
(flush faces with coincident corners) count as one. Such a line is represented by the vertex that lies within the
other's edge or, where the faces are inclined to each other, by the corner whose own face leans away. Where each corner
lies within the other's edge, both are ends of a short common face, and both represent the line. Two corners meet only
if neither is nearer to a neighbour of the other: on outlines with edges shorter than the window, as cracks leave them,
all corners are within reach of each other, and lines of distant ones are crossed by blocks that do not touch.

Where two entrance lines remain, the corners are rounded (`rounded_corners`), and one contact represents both: at the
point and with the normal at which the rounded corners first meet in the step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ..kinematics.tolerances import NOTABLE, NOTHING, ONE_FACE_COS, ONE_FACE_SIN, SAME
from .neighbour_search import boxes
from .rounded_corners import EASED, meeting, rounding_length

# A corner outside an edge may also touch it first, though its neighbour is nearer, if their face is inclined to the
# edge by less than this (sine): a block that hits with one end of a face rotates flat in the same step.
_TURN = 0.25
# Entrance lines whose directions differ by less than this are the same line.
_PARALLEL = 0.0025
# Corners that lie within each other's edges by more than this part of the edges are the two ends of a common face.
_ENDS = 1e-4
#: Kinds: a vertex and a face; two corners; two corners whose small overlap rounding smooths.
FACE, CORNERS, SMOOTHED = 0, 1, 2
# Corners whose lines may come within the window of both are at most this many windows apart.
_CORNERS = 1.5
# Least search distance in rounding lengths.
_ZONE = 2.0
# Corners may approach by this many times their expected motion.
_HASTE = 2.0


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _dot_to(vertices, origin, target, nx, ny):
    """Component along (nx, ny) of the unit vector from vertex ``origin`` to vertex ``target``."""
    dx, dy = vertices[target, 0] - vertices[origin, 0], vertices[target, 1] - vertices[origin, 1]
    return (dx * nx + dy * ny) / np.sqrt(dx * dx + dy * dy)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _against(vertices, next_vertex, previous_vertex, vertex, edge):
    """Vertex against edge: (sine by which its neighbours point away from the edge, outward normal x, y, gap, distance
    along, length)."""
    a, b = edge, next_vertex[edge]
    dx, dy = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1]
    length = np.sqrt(dx * dx + dy * dy)
    tx, ty = dx / length, dy / length
    px, py = vertices[vertex, 0] - vertices[a, 0], vertices[vertex, 1] - vertices[a, 1]
    away = min(
        _dot_to(vertices, vertex, next_vertex[vertex], ty, -tx),
        _dot_to(vertices, vertex, previous_vertex[vertex], ty, -tx),
    )
    return away, ty, -tx, px * ty - py * tx, px * tx + py * ty, length


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _lies_behind(vertices, next_vertex, previous_vertex, vertex, nx, ny):
    """Whether the rock at corner ``vertex`` lies behind an edge with the outward normal (nx, ny), not in front of it.

    A flat corner on the tip of a needle leans by the needle's angle into the edge on the needle's other side, which may be
    less than `ONE_FACE_SIN`; its rock is behind that edge.
    """
    a, b = previous_vertex[vertex], next_vertex[vertex]
    ax, ay = vertices[a, 0] - vertices[vertex, 0], vertices[a, 1] - vertices[vertex, 1]
    bx, by = vertices[b, 0] - vertices[vertex, 0], vertices[b, 1] - vertices[vertex, 1]
    first, second = np.sqrt(ax * ax + ay * ay), np.sqrt(bx * bx + by * by)
    tx, ty = bx / second - ax / first, by / second - ay / first
    # The rock is to the left of the outline.
    return tx * ny - ty * nx < 0.0


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _may_turn_to(vertices, next_vertex, previous_vertex, vertex, nx, ny, gap, window):
    """Whether ``vertex`` may rotate against an edge in a step although a neighbour is nearer to it.

    The vertex and its neighbours are outside the edge with the normal (nx, ny), the vertex by ``gap``; corners approach
    by at most ``window`` in the step.
    """
    for neighbour in (next_vertex[vertex], previous_vertex[vertex]):
        dx, dy = vertices[neighbour, 0] - vertices[vertex, 0], vertices[neighbour, 1] - vertices[vertex, 1]
        length, rise = np.sqrt(dx * dx + dy * dy), dx * nx + dy * ny
        if rise < -min(window, _TURN * length) or gap + rise < -ONE_FACE_SIN * length:
            return False
    return True


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _nearer(vertices, here, one, other):
    """Whether vertex ``here`` is nearer to vertex ``one`` than to ``other``."""
    ax, ay = vertices[here, 0] - vertices[one, 0], vertices[here, 1] - vertices[one, 1]
    bx, by = vertices[here, 0] - vertices[other, 0], vertices[here, 1] - vertices[other, 1]
    return ax * ax + ay * ay < (bx * bx + by * by) * (1.0 - NOTABLE)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _by(vertices, v, w, window):
    """Whether two corners are so near that their lines may come within the ``window`` of both."""
    dx, dy = vertices[v, 0] - vertices[w, 0], vertices[v, 1] - vertices[w, 1]
    return dx * dx + dy * dy <= (_CORNERS * window) ** 2


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _meet(vertices, next_vertex, previous_vertex, v, w):
    """Whether corners ``v`` and ``w`` meet: neither is nearer to a neighbour of the other along its outline."""
    return not (
        _nearer(vertices, v, next_vertex[w], w)
        or _nearer(vertices, v, previous_vertex[w], w)
        or _nearer(vertices, w, next_vertex[v], v)
        or _nearer(vertices, w, previous_vertex[v], v)
    )


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _shallower(vertices, next_vertex, previous_vertex, vertex, gap, other):
    """Whether ``vertex`` meets the edge with this ``gap`` at a corner, rather than the corner's ``other`` edge."""
    away, _, _, other_gap, _, _ = _against(vertices, next_vertex, previous_vertex, vertex, other)
    return away < -ONE_FACE_SIN or gap >= other_gap


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _place(keys, key):
    """Index of ``key`` in the sorted ``keys``, −1 if absent."""
    low, high = 0, keys.shape[0]
    while low < high:
        mid = (low + high) // 2
        if keys[mid] < key:
            low = mid + 1
        else:
            high = mid
    return low if low < keys.shape[0] and keys[low] == key else -1


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _add(table, count, first, vertex, edge):
    """Number of the row (vertex, edge) among the rows from ``first`` on, appended if new; ``table`` must have room."""
    for row in range(first, count):
        if table[row, 0] == vertex and table[row, 1] == edge:
            return row
    table[count, 0] = vertex
    table[count, 1] = edge
    table[count, 2] = -1
    table[count, 3] = 0
    return count


class Corners(NamedTuple):
    """Corner data of the contact search.

    convex    (n_vertices,)    bool
    rounding  (n_vertices,)    m, their rounding lengths
    longest   (n_vertices,)    m, largest admissible rounding lengths
    size      (n_blocks,)      m² of each block
    pressed   (n_blocks,)      m, penetration of each block's faces
    motion    (n_vertices, 2)  m, expected motion of each vertex in the step
    margin                     m, further approach that is allowed for: pairs that then stay apart are left out
    """

    convex: np.ndarray
    rounding: np.ndarray
    longest: np.ndarray
    size: np.ndarray
    pressed: np.ndarray
    motion: np.ndarray
    margin: float


def find_contacts(
    outlines: Outlines, pairs: np.ndarray, window: float | np.ndarray, old_keys: np.ndarray, corners: Corners
) -> tuple[np.ndarray, np.ndarray]:
    """All contacts of ``pairs`` (k, 2) of blocks (lower number first) nearer than ``window``, pair by pair.

    ``window`` is one distance, m, or (k,) of each pair; ``corners`` is a `Corners`. Returns

    table (n, 4)  vertex; edge; the corner of the edge's block that the vertex meets where two rounded corners meet (−1:
                  the vertex meets a line); and the kind: `FACE`, `CORNERS`, or `SMOOTHED` where rounding smooths a small
                  overlap of corners
    met (n, 3)    the normal that pushes the vertex's block, and the gap (m) of rounded corners

    ``old_keys`` (sorted vertex·n_vertices + edge of the last step's contacts) settles which of two equivalent
    representations of a corner on a corner is kept, so that contacts do not change names with round-off.
    """
    box = boxes(outlines.vertices, outlines.vertex_start[:-1])
    room, windows = 32 + 8 * len(box), _each(window, len(pairs))
    lines = _Lines(np.empty(4, np.int64), np.empty(4, np.int64), np.empty(4, np.int64), np.empty((4, 7)), np.empty(5))
    while True:
        table, met = np.empty((room, 4), np.int64), np.zeros((room, 3))
        count = _look_at(_Rows(table, met), lines, box, pairs, windows, outlines, old_keys, corners)
        if count >= 0:
            return table[:count], met[:count]
        room *= 2


@kept(fastmath=False, error_model="numpy", nogil=True)
def convex_corners(vertices, next_vertex, previous_vertex):
    """(n_vertices,) bool: a flat vertex counts as convex, because faces divided at a node still touch there."""
    convex = np.empty(vertices.shape[0], np.bool_)
    for i in range(vertices.shape[0]):
        k, j = previous_vertex[i], next_vertex[i]
        ax, ay = vertices[i, 0] - vertices[k, 0], vertices[i, 1] - vertices[k, 1]
        bx, by = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1]
        # Flat as in `Blocks.in_side`: the noise of the vertices of an edge of centimetres turns it by 1e-9, and must not
        # decide whether a face touches there.
        convex[i] = ax * by - ay * bx >= -NOTHING * np.sqrt((ax * ax + ay * ay) * (bx * bx + by * by))
    return convex


class Outlines(NamedTuple):
    """Outlines of blocks.

    vertices        (n_vertices, 2) m
    next_vertex, previous_vertex   (n_vertices,) numbers
    vertex_start    (n_blocks + 1,) first vertex of each block
    """

    vertices: np.ndarray
    next_vertex: np.ndarray
    previous_vertex: np.ndarray
    vertex_start: np.ndarray


class _Rows(NamedTuple):
    """Storage for the rows of `find_contacts`."""

    table: np.ndarray
    met: np.ndarray


class _Lines(NamedTuple):
    """The entrance lines of two corners, at most four.

    vertex, edge  representative of each
    twin          line of the other end of the same face, −1 for none
    shape         (4, 7): normal that pushes the first block (2), gap, distance outside the edge, edge length, distance
                  inside, sine away from it
    places        (5,) working space of `meeting`
    """

    vertex: np.ndarray
    edge: np.ndarray
    twin: np.ndarray
    shape: np.ndarray
    places: np.ndarray


class _Near(NamedTuple):
    """Two blocks ``a`` and ``b``, the search distance ``window`` (m), and the strip in which both may be reached: the
    intersection of their boxes, widened."""

    a: int
    b: int
    window: float
    x_lo: float
    x_hi: float
    y_lo: float
    y_hi: float


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _look_at(rows, lines, box, pairs, windows, outlines, old_keys, corners):
    """Fill ``rows`` with the contacts of ``pairs`` within ``windows`` (k,).

    Returns their number, or −1 if the storage is too small. ``box`` (n_blocks, 4): least x, y and greatest x, y of
    blocks.
    """
    count, start = 0, outlines.vertex_start
    for pair in range(pairs.shape[0]):
        a, b = pairs[pair, 0], pairs[pair, 1]
        # In exact ties vertices of the later block represent a contact: of the smaller one, whatever the blocks' numbers.
        if corners.size[a] < (1.0 - SAME) * corners.size[b]:
            a, b = b, a
        # Lines of rounded corners do not act separately.
        zone = rounding_length(
            min(corners.rounding[start[a]], corners.rounding[start[b]]), np.inf,
            max(corners.pressed[a], corners.pressed[b]),
        )  # fmt: skip
        window = max(windows[pair], _ZONE * zone)
        if box[a, 0] > box[b, 2] + window or box[b, 0] > box[a, 2] + window:
            continue
        if box[a, 1] > box[b, 3] + window or box[b, 1] > box[a, 3] + window:
            continue
        wide = _CORNERS * window
        near = _Near(
            a, b, window, max(box[a, 0], box[b, 0]) - wide, min(box[a, 2], box[b, 2]) + wide,
            max(box[a, 1], box[b, 1]) - wide, min(box[a, 3], box[b, 3]) + wide,
        )  # fmt: skip
        first = count
        count = _corners_on_corners(rows, lines, first, near, outlines, old_keys, corners)
        if count >= 0:
            count = _corners_on_edges(rows, first, count, near, outlines, corners.convex)
        if count < 0:
            return -1
    return count


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _corners_on_corners(rows, lines, first, near, outlines, old_keys, corners):
    """Append contacts of corners with corners to the rows that end at ``first``.

    Returns the new number of rows, or −1 if the storage is too small.
    """
    vertices, start, count = outlines.vertices, outlines.vertex_start, first
    for v in range(start[near.a], start[near.a + 1]):
        if not corners.convex[v] or not _in_strip(near, vertices[v, 0], vertices[v, 1]):
            continue
        for w in range(start[near.b], start[near.b + 1]):
            if not corners.convex[w] or not _by(vertices, v, w, near.window):
                continue
            if not _meet(vertices, outlines.next_vertex, outlines.previous_vertex, v, w):
                continue
            n_lines = _entrance_lines(lines, outlines, old_keys, v, w)
            if n_lines == 0:
                continue
            if count + 4 > rows.table.shape[0]:
                return -1
            count = _add_corners(rows, first, count, lines, n_lines, near, vertices, v, w, corners)
    return count


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _in_strip(near, x, y):
    """Whether (x, y) may be within reach of both blocks."""
    return near.x_lo <= x <= near.x_hi and near.y_lo <= y <= near.y_hi


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _entrance_lines(lines, outlines, old_keys, v, w):
    """Find the ``lines`` through which corner ``v`` can enter corner ``w``; returns their number."""
    vertices, next_vertex, previous_vertex = outlines.vertices, outlines.next_vertex, outlines.previous_vertex
    n_lines, shape = 0, lines.shape
    for c in range(4):
        # Vertices of the later block come first: in an exact tie they represent the contact.
        if c < 2:
            vertex, edge, sign = w, (v if c == 0 else previous_vertex[v]), -1.0
        else:
            vertex, edge, sign = v, (w if c == 2 else previous_vertex[w]), 1.0
        away, nx, ny, gap, along, length = _against(vertices, next_vertex, previous_vertex, vertex, edge)
        if away < -ONE_FACE_SIN or (
            away < 0.0 and _lies_behind(vertices, next_vertex, previous_vertex, vertex, nx, ny)
        ):
            continue
        nx, ny = sign * nx, sign * ny
        outside = max(0.0, -along, along - length)
        inside = min(along, length - along)
        same = -1
        for k in range(n_lines):
            if shape[k, 0] * nx + shape[k, 1] * ny > 1.0 - _PARALLEL:
                same = k
        if same >= 0 and lines.twin[same] >= 0:
            continue
        if same >= 0 and min(inside, shape[same, 5]) > _ENDS * max(length, shape[same, 4]):
            k = n_lines
            n_lines += 1
            lines.twin[k], lines.twin[same] = same, k
        elif same >= 0:
            if not _stands_better(lines, same, old_keys, vertices.shape[0], vertex, edge, away, outside, length):
                continue
            k = same
        else:
            k = n_lines
            n_lines += 1
            lines.twin[k] = -1
        lines.vertex[k], lines.edge[k] = vertex, edge
        shape[k, 0], shape[k, 1], shape[k, 2], shape[k, 3], shape[k, 4] = nx, ny, gap, outside, length
        shape[k, 5], shape[k, 6] = inside, away
    return n_lines


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _stands_better(lines, same, old_keys, n_vertices, vertex, edge, away, outside, length):
    """Whether ``vertex`` and ``edge`` represent the line ``same`` better than its present representative."""
    shape = lines.shape
    near = 1e-9 * max(length, shape[same, 4])
    # Of two corners on one line, the one represents it past which the other's face does not lean by more.
    if abs(away - shape[same, 6]) > NOTABLE:
        return away > shape[same, 6]
    if abs(outside - shape[same, 3]) <= near:
        return (
            _place(old_keys, vertex * n_vertices + edge) >= 0
            and _place(old_keys, lines.vertex[same] * n_vertices + lines.edge[same]) < 0
        )
    return outside < shape[same, 3] - near


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _least_crossed(lines, n_lines):
    """The line with the least penetration, and the one with the least of those in other directions; −1 for none."""
    one, two, shape = -1, -1, lines.shape
    for k in range(n_lines):
        if one < 0 or shape[k, 2] > shape[one, 2]:
            one = k
    for k in range(n_lines):
        if k != one and lines.twin[k] != one and (two < 0 or shape[k, 2] > shape[two, 2]):
            two = k
    return one, two


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _add_corners(rows, first, count, lines, n_lines, near, vertices, v, w, corners):
    """Append the contacts of corners ``v`` and ``w`` to ``rows``; those of the pair of blocks begin at ``first``.

    Returns the new number of rows.
    """
    table, met, window, shape = rows.table, rows.met, near.window, lines.shape
    one, two = _least_crossed(lines, n_lines)
    line, length, reach = 1, 0.0, window
    if two >= 0:
        length = rounding_length(
            min(corners.rounding[v], corners.rounding[w]), min(corners.longest[v], corners.longest[w]),
            max(corners.pressed[near.a], corners.pressed[near.b]),
        )  # fmt: skip
        dx, dy = vertices[v, 0] - vertices[w, 0], vertices[v, 1] - vertices[w, 1]
        ux, uy = corners.motion[v, 0] - corners.motion[w, 0], corners.motion[v, 1] - corners.motion[w, 1]
        mx, my, gap, line = meeting(
            dx, dy, ux, uy, shape[one, 0], shape[one, 1], shape[one, 2], shape[two, 0], shape[two, 1], shape[two, 2],
            length, lines.places,
        )  # fmt: skip
        reach = min(window, _HASTE * np.sqrt(ux * ux + uy * uy) + corners.margin)
        if line == 0:
            if gap > reach or gap < -window:
                return count
            # The contact is named after the line whose normal is nearer to its own.
            k = one
            if mx * shape[two, 0] + my * shape[two, 1] > mx * shape[one, 0] + my * shape[one, 1]:
                k = two
            row = _add(table, count, first, lines.vertex[k], lines.edge[k])
            if row < count:
                return count
            sign = 1.0 if lines.vertex[k] == v else -1.0
            table[row, 2], table[row, 3] = w if lines.vertex[k] == v else v, CORNERS
            met[row, 0], met[row, 1], met[row, 2] = sign * mx, sign * my, gap
            return count + 1
    met_on = one if line == 1 else two
    kind = SMOOTHED if two >= 0 and shape[met_on, 2] > -EASED * length else CORNERS
    for k in range(n_lines):
        if k != met_on and lines.twin[k] != met_on:
            continue
        if shape[k, 2] > reach or shape[k, 2] < -window:
            continue
        row = _add(table, count, first, lines.vertex[k], lines.edge[k])
        if row == count:
            table[row, 3] = kind
            count += 1
    return count


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _corners_on_edges(rows, first, count, near, outlines, convex):
    """Append contacts of corners with edges, and in re-entrant corners, to ``rows``.

    Those of the pair begin at ``first``. Returns the new number of rows, or −1 if the storage is too small.
    """
    vertices, start = outlines.vertices, outlines.vertex_start
    for role in range(2):
        i, j = (near.a, near.b) if role == 0 else (near.b, near.a)
        for v in range(start[i], start[i + 1]):
            if not convex[v] or not _in_strip(near, vertices[v, 0], vertices[v, 1]):
                continue
            for edge in range(start[j], start[j + 1]):
                if not _meets_edge(outlines, convex, near.window, v, edge):
                    continue
                if count == rows.table.shape[0]:
                    return -1
                count = max(count, _add(rows.table, count, first, v, edge) + 1)
    return count


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _meets_edge(outlines, convex, window, v, edge):
    """Whether corner ``v`` meets the interior of this ``edge``."""
    vertices, next_vertex, previous_vertex = outlines.vertices, outlines.next_vertex, outlines.previous_vertex
    x, y, end = vertices[v, 0], vertices[v, 1], next_vertex[edge]
    if (
        min(vertices[edge, 0], vertices[end, 0]) > x + window
        or max(vertices[edge, 0], vertices[end, 0]) < x - window
        or min(vertices[edge, 1], vertices[end, 1]) > y + window
        or max(vertices[edge, 1], vertices[end, 1]) < y - window
    ):
        return False
    away, nx, ny, gap, along, length = _against(vertices, next_vertex, previous_vertex, v, edge)
    if abs(gap) > window or along < -window or along > length + window:
        return False
    if away < -ONE_FACE_SIN:
        if gap <= 0.0 or along < 0.0 or along > length:
            return False
        if not _may_turn_to(vertices, next_vertex, previous_vertex, v, nx, ny, gap, window):
            return False
    # In a re-entrant corner a vertex may be past an edge's end by its penetration, but not round the next corner.
    if along < 0.0 and not convex[edge] and _nearer(vertices, v, previous_vertex[edge], edge):
        return False
    if along > length and not convex[end] and _nearer(vertices, v, next_vertex[end], end):
        return False
    # Pairs of corners are treated separately; elsewhere the shallower edge is met within its ends.
    at_start = convex[edge] and (along <= window or _by(vertices, v, edge, window))
    if at_start and (along < 0.0 or not _met_next_to_corner(outlines, v, gap, edge, previous_vertex[edge])):
        return False
    at_end = convex[end] and (along >= length - window or _by(vertices, v, end, window))
    return not at_end or (not along > length and _met_next_to_corner(outlines, v, gap, end, end))


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _met_next_to_corner(outlines, v, gap, corner, other):
    """Whether ``v`` meets an edge with this ``gap`` next to its ``corner``: neither at the corner nor on the ``other``
    edge."""
    vertices, next_vertex, previous_vertex = outlines.vertices, outlines.next_vertex, outlines.previous_vertex
    if _meet(vertices, next_vertex, previous_vertex, v, corner):
        return False
    return _shallower(vertices, next_vertex, previous_vertex, v, gap, other)


def _each(window, n: int) -> np.ndarray:
    """(n,) m: the same ``window`` for all, or one of each."""
    return np.full(n, window, float)


class Known(NamedTuple):
    """Contacts of the last step (m,): ``vertex``, ``edge``, ``normal`` (m, 2), and the ``order`` (m,) that sorts their
    keys vertex·n_vertices + edge."""

    vertex: np.ndarray
    edge: np.ndarray
    normal: np.ndarray
    order: np.ndarray


def describe_contacts(
    table: np.ndarray, met: np.ndarray, outlines: Outlines, window: float | np.ndarray, known: Known
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Geometry and history of the rows ``table``, ``met`` of `find_contacts`.

    ``window`` (m) is one distance or (n,) of each; ``known`` are the last step's contacts. Returns (geometry, mate,
    parent):

    geometry (n, 7)  position, normal x, y, gap, tributary length, vertex x, y
    mate (n,)        edge of the vertex's own block that faces the touched edge
    parent (n,)      row of the last step's contact whose force and slip it continues, −1 if new

    The tributary length is half the overlap of the faces that meet there, 0 for a lone corner.
    """
    geometry, mate = _geometry(table, met, outlines)
    return geometry, mate, _parents(table, geometry, outlines, _each(window, len(table)), known)


@kept(fastmath=False, error_model="numpy", nogil=True)
def _geometry(table, met, outlines):
    """Geometry and mates of `describe_contacts`."""
    vertices, next_vertex, previous_vertex = outlines.vertices, outlines.next_vertex, outlines.previous_vertex
    n = table.shape[0]
    geometry = np.empty((n, 7))
    mate = np.empty(n, np.int64)
    for row in range(n):
        vertex, edge = table[row, 0], table[row, 1]
        _, nx, ny, gap, along, length = _against(vertices, next_vertex, previous_vertex, vertex, edge)
        geometry[row, 0] = along / length
        geometry[row, 1], geometry[row, 2], geometry[row, 3] = nx, ny, gap
        geometry[row, 5], geometry[row, 6] = vertices[vertex, 0], vertices[vertex, 1]
        before = _has_row(table, row, previous_vertex[edge])
        after = _has_row(table, row, next_vertex[edge])
        geometry[row, 4], mate[row] = _tributary(outlines, vertex, edge, nx, ny, along, length, before, after)
        if table[row, 2] >= 0:
            # Rounded corners have no common face.
            geometry[row, 4] = 0.0
            geometry[row, 1], geometry[row, 2], geometry[row, 3] = met[row, 0], met[row, 1], met[row, 2]
    return geometry, mate


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _has_row(table, row, edge):
    """Whether the vertex of this ``row`` of ``table`` also touches the line of another ``edge``; rows of one vertex are
    consecutive."""
    for step in (-1, 1):
        k = row + step
        while 0 <= k < table.shape[0] and table[k, 0] == table[row, 0]:
            if table[k, 1] == edge and table[k, 2] < 0:
                return True
            k += step
    return False


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _tributary(outlines, vertex, edge, nx, ny, along, length, before, after):
    """Half the overlap, m, of the faces that meet where ``vertex`` touches ``edge``, and the facing edge of its block.

    The edge has the outward normal (nx, ny) and this ``length``; the contact is at the distance ``along`` it.
    ``before`` and ``after``: whether the vertex also touches the edges before and after this one, whose faces are
    counted there.
    """
    vertices, next_vertex, previous_vertex = outlines.vertices, outlines.next_vertex, outlines.previous_vertex
    tributary, facing, mate = 0.0, np.inf, vertex
    for own in (vertex, previous_vertex[vertex]):
        head = next_vertex[own]
        sx, sy = vertices[head, 0] - vertices[own, 0], vertices[head, 1] - vertices[own, 1]
        own_length = np.sqrt(sx * sx + sy * sy)
        cosine = (sy * nx - sx * ny) / own_length
        if cosine < facing:
            facing = cosine
            mate = own
        # This near to an end, the corner represents the end too, and faces the edges on both sides of a flat node.
        ends = _ENDS * max(length, own_length)
        for turn in range(3):
            face = edge
            if turn == 1:
                if before or along > ends:
                    continue
                face = previous_vertex[edge]
            elif turn == 2:
                if after or along < length - ends:
                    continue
                face = next_vertex[edge]
            far = next_vertex[face]
            tx, ty = vertices[far, 0] - vertices[face, 0], vertices[far, 1] - vertices[face, 1]
            face_length = np.sqrt(tx * tx + ty * ty)
            tx, ty = tx / face_length, ty / face_length
            if (sx * tx + sy * ty) / own_length > -ONE_FACE_COS or -ny * tx + nx * ty < ONE_FACE_COS:
                continue
            s0 = (vertices[own, 0] - vertices[face, 0]) * tx + (vertices[own, 1] - vertices[face, 1]) * ty
            s1 = (vertices[head, 0] - vertices[face, 0]) * tx + (vertices[head, 1] - vertices[face, 1]) * ty
            tributary += 0.5 * max(0.0, min(face_length, max(s0, s1)) - max(0.0, min(s0, s1)))
    return tributary, mate


@kept(fastmath=False, error_model="numpy", nogil=True)
def _parents(table, geometry, outlines, window, known):
    """Parents of `describe_contacts`; each row has its own ``window`` (n,)."""
    vertices, next_vertex = outlines.vertices, outlines.next_vertex
    n, n_vertices = table.shape[0], vertices.shape[0]
    parent = np.full(n, -1, np.int64)
    taken = np.zeros(known.vertex.shape[0], np.bool_)
    keys = np.empty(known.vertex.shape[0], np.int64)
    for k in range(keys.shape[0]):
        keys[k] = known.vertex[known.order[k]] * n_vertices + known.edge[known.order[k]]
    for row in range(n):
        at = _place(keys, table[row, 0] * n_vertices + table[row, 1])
        if at >= 0:
            parent[row] = known.order[at]
            taken[known.order[at]] = True
    for row in range(n):
        if parent[row] >= 0 or keys.shape[0] == 0:
            continue
        vertex, edge = table[row, 0], table[row, 1]
        for corner in (edge, next_vertex[edge]):
            dx, dy = vertices[vertex, 0] - vertices[corner, 0], vertices[vertex, 1] - vertices[corner, 1]
            if dx * dx + dy * dy <= (_CORNERS * window[row]) ** 2 and parent[row] < 0:
                nx, ny = geometry[row, 1], geometry[row, 2]
                parent[row] = _renamed(keys, taken, known, outlines.previous_vertex, vertex, corner, nx, ny)
    return parent


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _renamed(keys, taken, known, previous_vertex, vertex, corner, nx, ny):
    """Number of the last step's contact that continues under another name: the next edge round the ``corner``, or with
    vertex and edge exchanged.

    Its normal is (nx, ny). Returns −1 for none; marks it as ``taken``.
    """
    n_vertices = previous_vertex.shape[0]
    for c in range(4):
        if c == 0:
            key, sign = vertex * n_vertices + corner, 1.0
        elif c == 1:
            key, sign = vertex * n_vertices + previous_vertex[corner], 1.0
        elif c == 2:
            key, sign = corner * n_vertices + vertex, -1.0
        else:
            key, sign = corner * n_vertices + previous_vertex[vertex], -1.0
        at = _place(keys, key)
        if at < 0:
            continue
        old = known.order[at]
        if not taken[old] and sign * (known.normal[old, 0] * nx + known.normal[old, 1] * ny) > 0.99:
            taken[old] = True
            return old
    return -1
