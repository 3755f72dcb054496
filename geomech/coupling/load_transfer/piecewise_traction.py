"""Forces on the outline of a block as tractions on pieces of its edges, each linear and on one edge.

Compiled; `boundary_tractions` has the kernel that calls these functions. Points and vectors are pairs of numbers;
results are appended to ``found``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, part
from ...model import Blocks

#: For functions that only kernels call; for those of them that allocate arrays.
jit = part(error_model="numpy", nogil=True, **UNCOUNTED)
allocating = part(error_model="numpy", nogil=True)

#: Two edges belong to one joint face if their directions differ by less than this angle.
FACE_ANGLE = math.radians(10.0)
FLAT = math.sin(FACE_ANGLE)

#: A face that ends within this fraction of the edge length from the end of the edge ends there.
SNAP = 1e-9

#: Pressures end at multiples of this fraction of the edge length. Force and moment are preserved for any length. Faces
#: slide by as little as the strains, and without the grid each step would have load segments of its own, for which the
#: body would have to compute new responses.
GRID = 2.0**-12

#: Contacts closer together than this fraction of the face length act at one place.
SAME = 1e-6

#: A point load closer to an edge than this fraction of its length acts on it.
ON_EDGE = 1e-6

#: A single contact loads this fraction of its edge (of the shorter edge at a corner).
LONE_SPREAD = 1.0 / 20.0


class Outlines(NamedTuple):
    """Outlines of all blocks: reference ``vertices`` and current ones ``now`` (n, 2). For every vertex or edge: the
    ``following`` one, the one ``before``, the first edge of its straight side (`Blocks.side_start`), and begin and end
    in ``chain`` of the vertices along that side."""

    vertices: np.ndarray
    now: np.ndarray
    following: np.ndarray
    before: np.ndarray
    side_start: np.ndarray
    chain_first: np.ndarray
    chain_last: np.ndarray
    chain: np.ndarray


class Found(NamedTuple):
    """Output rows, with their ``count`` (3,): ``pieces`` (m, 8): (x, y) of start and end, traction (x, y) at both;
    ``inside`` (k, 4): points and the forces there; ``bases`` (j, 5): first and last row of pieces on a rigid base,
    traction per unit pressure, law of the joint. Rows beyond the room of the arrays are only counted."""

    count: np.ndarray  # type: ignore[assignment]  # hides tuple.count
    pieces: np.ndarray
    inside: np.ndarray
    bases: np.ndarray


def outlines(blocks: Blocks, now: np.ndarray) -> Outlines:
    """Outlines of ``blocks`` with the current vertices ``now`` (n, 2)."""
    return Outlines(
        blocks.vertices, np.ascontiguousarray(now), blocks.next_vertex, blocks.previous_vertex, *blocks.side_chains
    )


@jit
def line_of(of, start):
    """Start, direction and length of the straight side that begins with the edge ``start``, reference frame."""
    last = of.chain[of.chain_last[start] - 1]
    sx, sy = of.vertices[start, 0], of.vertices[start, 1]
    x, y = of.vertices[last, 0] - sx, of.vertices[last, 1] - sy
    length = math.hypot(x, y)
    return sx, sy, x / length, y / length, length


@jit
def pieces_on_base(length, piece):
    """Number of pieces of a face of this ``length`` (m), about as long as a ``piece`` (m)."""
    return max(1, int(length / piece + 0.5))


@jit
def first_on_base(pieces):
    """Length of the first of so many ``pieces`` relative to the face."""
    return math.sin(0.5 * math.pi / pieces) ** 2


@jit
def place_along(px, py, sx, sy, ax, ay):
    """Coordinate of the point (px, py) along the unit vector (ax, ay) from (sx, sy), m."""
    return (px - sx) * ax + (py - sy) * ay


@jit
def on_grid(place, length):
    """The multiple of GRID times ``length`` nearest to ``place``."""
    return round(place / (GRID * length)) * (GRID * length)


@jit
def add(found, ax, ay, bx, by, tax, tay, tbx, tby):
    """Add a piece from a to b, unless its traction is zero."""
    if tax != 0 or tay != 0 or tbx != 0 or tby != 0:
        add_always(found, ax, ay, bx, by, tax, tay, tbx, tby)


@jit
def add_always(found, ax, ay, bx, by, tax, tay, tbx, tby):
    """Add a piece from a to b."""
    k = found.count[0]
    found.count[0] += 1
    if k < len(found.pieces):
        row = found.pieces[k]
        row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7] = ax, ay, bx, by, tax, tay, tbx, tby


@jit
def add_row(count, rows, kind, a, b, c, d):
    """Add a row of four numbers to the array of this ``kind``."""
    k = count[kind]
    count[kind] += 1
    if k < len(rows):
        rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3] = a, b, c, d


@jit
def add_on_side(found, of, start, low, high, tax, tay, tbx, tby):
    """Add a traction, linear from a to b over [``low``, ``high``] of a straight side: one piece per edge, since a load
    segment lies on one edge."""
    sx, sy, ax, ay, length = line_of(of, start)
    first, last = of.chain_first[start], of.chain_last[start]
    for k in range(first, last - 1):
        here, there = of.chain[k], of.chain[k + 1]
        mark, far = 0.0, length
        if k > first:
            mark = place_along(of.vertices[here, 0], of.vertices[here, 1], sx, sy, ax, ay)
        if k + 1 < last - 1:
            far = place_along(of.vertices[there, 0], of.vertices[there, 1], sx, sy, ax, ay)
        a, b = max(low, mark), min(high, far)
        if b - a > SNAP * length:
            x0, y0, x1, y1 = sx + a * ax, sy + a * ay, sx + b * ax, sy + b * ay
            # At a corner of the block, exactly its coordinates.
            if a == mark:
                x0, y0 = of.vertices[here, 0], of.vertices[here, 1]
            if b == far:
                x1, y1 = of.vertices[there, 0], of.vertices[there, 1]
            p, q = (a - low) / (high - low), (b - low) / (high - low)
            add(
                found, x0, y0, x1, y1, tax + p * (tbx - tax), tay + p * (tby - tay), tax + q * (tbx - tax),
                tay + q * (tby - tay),
            )  # fmt: skip


@allocating
def add_base(found, of, start, low, high, p_low, p_high, wx, wy, pieces):
    """Add a pressure, linear from ``p_low`` to ``p_high`` over [``low``, ``high``] of a straight side, on so many ``pieces`` whose
    pressures can be changed later: short at the ends, where a rigid base presses most. (wx, wy): traction per unit
    pressure."""
    sx, sy, ax, ay, length = line_of(of, start)
    n = pieces + 1
    places, vertex = (
        np.empty(n + of.chain_last[start] - of.chain_first[start]),
        np.full(n + of.chain_last[start] - of.chain_first[start], -1),
    )
    for k in range(pieces):
        places[k] = low + math.sin(0.5 * math.pi * k / pieces) ** 2 * (high - low)
    places[pieces] = high
    for k in range(of.chain_first[start] + 1, of.chain_last[start] - 1):
        corner = of.chain[k]
        at = place_along(of.vertices[corner, 0], of.vertices[corner, 1], sx, sy, ax, ay)
        if low + SNAP * length < at < high - SNAP * length:
            j = n
            while places[j - 1] >= at:
                places[j], vertex[j] = places[j - 1], vertex[j - 1]
                j -= 1
            if places[j + 1] == at and j < n:
                # A corner of the block replaces a division point at the same place.
                vertex[j + 1] = corner
                for i in range(j, n):
                    places[i], vertex[i] = places[i + 1], vertex[i + 1]
            else:
                places[j], vertex[j] = at, corner
                n += 1
    if high == length:
        vertex[n - 1] = of.chain[of.chain_last[start] - 1]
    x0, y0 = sx + low * ax, sy + low * ay
    for k in range(1, n):
        x1, y1 = sx + places[k] * ax, sy + places[k] * ay
        if vertex[k] >= 0:
            x1, y1 = of.vertices[vertex[k], 0], of.vertices[vertex[k], 1]
        p = p_low + (places[k - 1] - low) / (high - low) * (p_high - p_low)
        q = p_low + (places[k] - low) / (high - low) * (p_high - p_low)
        add_always(found, x0, y0, x1, y1, p * wx, p * wy, q * wx, q * wy)
        x0, y0 = x1, y1


@jit
def add_corner_force(found, of, vertex, fx, fy):
    """Add a force on a corner, resolved along its two edges: shear on a short piece of each."""
    previous, following = of.before[vertex], of.following[vertex]
    x, y = of.vertices[vertex, 0], of.vertices[vertex, 1]
    bx, by = x - of.vertices[previous, 0], y - of.vertices[previous, 1]
    ax, ay = of.vertices[following, 0] - x, of.vertices[following, 1] - y
    before, after = math.hypot(bx, by), math.hypot(ax, ay)
    reach = LONE_SPREAD * min(before, after)
    bx, by, ax, ay = bx / before, by / before, ax / after, ay / after
    turn = bx * ay - by * ax
    x0, y0, x1, y1 = x - reach * bx, y - reach * by, x + reach * ax, y + reach * ay
    fx, fy = fx / reach, fy / reach
    if abs(turn) < FLAT:
        # The two edges of a flat corner cannot resolve a transverse force. Half of it acts on each edge; the centre of
        # the two halves is off the corner, and the pressure on one half is tilted to restore the moment.
        sx, sy = ax + bx, ay + by
        cross = ((ax - bx) * fy - (ay - by) * fx) / (2 * (sx * sx + sy * sy))
        ox, oy = -cross * sy, cross * sx
        tx, ty = fx / 2 + ox, fy / 2 + oy
        add(found, x0, y0, x, y, tx, ty, tx, ty)
        tx, ty = fx / 2 - ox, fy / 2 - oy
        add(found, x, y, x1, y1, tx, ty, tx, ty)
        return
    on_before, on_after = (fx * ay - fy * ax) / turn, (bx * fy - by * fx) / turn
    tx, ty = on_before * bx, on_before * by
    add(found, x0, y0, x, y, tx, ty, tx, ty)
    tx, ty = on_after * ax, on_after * ay
    add(found, x, y, x1, y1, tx, ty, tx, ty)


@jit
def add_edge_force(found, of, edge, px, py, fx, fy):
    """Add a force at a point of an edge, distributed over a short piece of it with the same moment. Beyond the end of
    the edge it acts at that end; returns the couple lost by that, N m per metre."""
    x, y = of.vertices[edge, 0], of.vertices[edge, 1]
    following = of.following[edge]
    ex, ey = of.vertices[following, 0], of.vertices[following, 1]
    length = math.hypot(ex - x, ey - y)
    ax, ay = (ex - x) / length, (ey - y) / length
    acts_at = place_along(px, py, x, y, ax, ay)
    place = min(max(acts_at, 0.0), length)
    couple = (acts_at - place) * (ax * fy - ay * fx)
    # Centred on the point, hence shorter near an end of the edge; at the end it is a force on the corner.
    if min(place, length - place) < SAME * length:
        add_corner_force(found, of, edge if place < length / 2 else following, fx, fy)
        return couple
    centre = on_grid(place, length)
    centre = place if centre <= 0.0 or centre >= length else centre
    half = min(LONE_SPREAD * length / 2, centre, length - centre)
    tx, ty = fx / (2 * half), fy / (2 * half)
    # Tilted, so that the normal component acts at the point rather than at the centre of the piece.
    tilt = 3 * (place - centre) / half * (ax * ty - ay * tx)
    low, high = centre - half, centre + half
    add(
        found, x + low * ax, y + low * ay, x + high * ax, y + high * ay, tx + tilt * ay, ty - tilt * ax,
        tx - tilt * ay, ty + tilt * ax,
    )  # fmt: skip
    return couple


@jit
def add_couple(found, of, first, last, area, couple):
    """Add a ``couple`` as uniform shear flow q along all edges, ``first`` to ``last``, of a block of this ``area``:
    Bredt's formula M = 2 A q. It has no resultant and no mean stress, and stays small however short the edge was from
    whose end the force has slid off."""
    if couple == 0:
        return
    for edge in range(first, last):
        x0, y0 = of.vertices[edge, 0], of.vertices[edge, 1]
        x1, y1 = of.vertices[of.following[edge], 0], of.vertices[of.following[edge], 1]
        flow = couple / (2 * area * math.hypot(x1 - x0, y1 - y0))
        tx, ty = flow * (x1 - x0), flow * (y1 - y0)
        add(found, x0, y0, x1, y1, tx, ty, tx, ty)


@jit
def add_edge_piece(found, of, row, c, s):
    """Add a loaded piece of an edge (EDGE_FORCE row, current coordinates). The traction stays linear, since the motion
    of the block is affine. Ends that coincide with ends of the edge keep its exact coordinates."""
    first, last = row.edge, of.following[row.edge]
    nx, ny = of.now[last, 0] - of.now[first, 0], of.now[last, 1] - of.now[first, 1]
    ax, ay, bx, by = of.vertices[first, 0], of.vertices[first, 1], of.vertices[last, 0], of.vertices[last, 1]
    length = math.hypot(nx, ny)
    stretch = length / math.hypot(bx - ax, by - ay)
    s0 = ((row.start[0] - of.now[first, 0]) * nx + (row.start[1] - of.now[first, 1]) * ny) / length**2
    s1 = ((row.end[0] - of.now[first, 0]) * nx + (row.end[1] - of.now[first, 1]) * ny) / length**2
    if abs(s1 - s0) <= SNAP:
        return  # as where a water table meets the end of an edge: negligible force, and no length to apply it to
    x0, y0, x1, y1 = ax + s0 * (bx - ax), ay + s0 * (by - ay), ax + s1 * (bx - ax), ay + s1 * (by - ay)
    if s0 < SNAP:
        x0, y0 = ax, ay
    if s1 > 1 - SNAP:
        x1, y1 = bx, by
    t = row.traction
    add(
        found, x0, y0, x1, y1, stretch * (c * t[0, 0] + s * t[0, 1]), stretch * (c * t[0, 1] - s * t[0, 0]),
        stretch * (c * t[1, 0] + s * t[1, 1]), stretch * (c * t[1, 1] - s * t[1, 0]),
    )  # fmt: skip


@jit
def add_point_load(found, of, first, last, px, py, fx, fy):
    """Add a point load of a block with the edges ``first`` to ``last``: distributed over a short piece of edge, or a
    point force if it acts ``inside`` the rock. Returns the remaining couple."""
    nearest, least, scale = first, np.inf, 0.0
    for edge in range(first, last):
        x, y = of.vertices[edge, 0], of.vertices[edge, 1]
        ax, ay = of.vertices[of.following[edge], 0] - x, of.vertices[of.following[edge], 1] - y
        place = min(max(((px - x) * ax + (py - y) * ay) / (ax * ax + ay * ay), 0.0), 1.0)
        distance = math.hypot(x + place * ax - px, y + place * ay - py)
        if distance < least:
            nearest, least, scale = edge, distance, math.hypot(ax, ay)
    if least <= ON_EDGE * scale:
        return add_edge_force(found, of, nearest, px, py, fx, fy)
    if fx != 0 or fy != 0:
        add_row(found.count, found.inside, 1, px, py, fx, fy)
    return 0.0
