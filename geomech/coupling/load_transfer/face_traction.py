"""The forces of a joint face's contacts as one traction along the side of the block that it covers. Compiled (`boundary_tractions`
has the kernel)."""

from __future__ import annotations

from typing import NamedTuple

from .no_tension_pressure import NOTHING, linear, no_pull
from .piecewise_traction import (
    SAME,
    add_base,
    add_corner_force,
    add_edge_force,
    add_on_side,
    add_row,
    jit,
    line_of,
    on_grid,
    place_along,
)

#: A resultant nearer to an end of a face than this part of it presses there and nowhere else.
AT_AN_END = 1e-2


class _Spread(NamedTuple):
    """Push N, its moment about the start of a side N m, and shear N along that, to be spread over it; (wx, wy) is the
    traction with a unit of pressure; whether it may pull (``holds``), and shear is ``even``."""

    total: float
    moment: float
    shear: float
    wx: float
    wy: float
    holds: bool
    even: bool


@jit
def add_face(found, of, start, touches, face, number, based):
    """All ``touches`` of the ``face`` (n,) with this ``number``, which cover the straight side that begins with the edge
    ``start``, as one distribution with the resultant and moment of their forces; where it is ``based`` on what keeps
    straight, it is yet to be found how they are spread (rows of pieces and the traction with a unit of pressure are
    added, too).

    Returned are the moment (N m) by which shears along the side stretch the block beyond what the tractions do, for those
    of two contacts that oppose each other have neither resultant nor moment; and the couple (N m) that forces lose which
    act beyond the end of the edge that bears them."""
    sx, sy, ax, ay, length = line_of(of, start)
    total, moment, shear, size, turned, stretched = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    least, most, near, far, holds = length, 0.0, length, 0.0, True
    first = True
    for k in range(len(face)):
        if face[k] != number:
            continue
        place = place_along(touches.px[k], touches.py[k], sx, sy, ax, ay)
        near, far = (place, place) if first else (min(near, place), max(far, place))
        first = False
    first = True
    for k in range(len(face)):
        if face[k] != number or not touches.acts[k]:
            continue
        place = place_along(touches.px[k], touches.py[k], sx, sy, ax, ay)
        least, most = (place, place) if first else (min(least, place), max(most, place))
        first = False
        x, y = touches.fx[k], touches.fy[k]
        push = ax * y - ay * x  # inward: the direction turned by +90°
        along = ax * x + ay * y
        total += push
        moment += push * place
        shear += along
        stretched += along * place
        # A contact that is pressed in, or gapes, has its shear off the side.
        turned -= along * (ax * (touches.py[k] - sy) - ay * (touches.px[k] - sx))
        size += abs(x) + abs(y)
        holds = holds and touches.holds[k]
    # The force that goes with a unit of pressure: shear in proportion to it, evenly spread where faces are held
    # together besides and there is none to go by. Pressure on a bond that may pull is linear, and shear even, wherever
    # its resultant is: it goes on without a jump as that leaves the face.
    inside = total > 0 and least <= moment / total <= most
    moment += turned
    if inside and not holds:
        # What only pushes cannot do so beyond its ends.
        moment = min(max(moment, total * least), total * most)
    even = holds or abs(total) <= 1e-9 * size or not inside
    slope = 0.0 if even else shear / total
    wx, wy = slope * ax - ay, slope * ay + ax
    if based and not even:
        near, far = on_grid(min(max(near, 0.0), length), length), on_grid(min(max(far, 0.0), length), length)
        arm = moment / total
        if min(arm - near, far - arm) > AT_AN_END * (far - near):
            _, _, p_near, p_far = linear(far - near, total, moment - near * total)
            begins = found.count[0]
            add_base(found, of, start, near, far, p_near, p_far, wx, wy)
            add_row(found.count, found.bases, 2, begins, found.count[0], wx, wy)
            return stretched - slope * moment, 0.0
    spread = _Spread(total, moment, shear, wx, wy, holds, even)
    couple, stretched = _add_spread(found, of, start, touches, face, number, spread, stretched)
    return stretched - slope * moment, couple


@jit
def _add_spread(found, of, start, touches, face, number, spread, stretched):
    """Add the tractions of a face to what is ``found``: linear, or a triangle where that would pull. Returned are the
    couple that forces lose beyond the end of an edge, and what is left to be ``stretched`` by beside even shear."""
    sx, sy, ax, ay, length = line_of(of, start)
    wx, wy, couple = spread.wx, spread.wy, 0.0
    lows = _ends(touches, face, number, sx, sy, ax, ay, length, -1)
    highs = _ends(touches, face, number, sx, sy, ax, ay, length, 1)
    for low, low_share in lows:
        for high, high_share in highs:
            share = low_share * high_share
            if share <= 0:
                continue
            begins = min(max(on_grid(low, length), 0.0), length)
            ends = min(max(on_grid(high, length), 0.0), length)
            if begins == ends:
                begins, ends = max(low, 0.0), min(high, length)
            over, force, about = ends - begins, share * spread.total, share * (spread.moment - begins * spread.total)
            pressure, at_begin, at_end = (linear(over, force, about), NOTHING), 0.0, 0.0
            if not spread.holds:
                pressure, at_begin, at_end = no_pull(over, force, about)
            for a, b, p_a, p_b in pressure:
                if b > a:
                    add_on_side(found, of, start, begins + a, begins + b, p_a * wx, p_a * wy, p_b * wx, p_b * wy)
            if at_begin != 0:
                couple += _add_at_end(found, of, start, begins, at_begin * wx, at_begin * wy)
            if at_end != 0:
                couple += _add_at_end(found, of, start, ends, at_end * wx, at_end * wy)
            if spread.even:
                q = share * spread.shear / over
                add_on_side(found, of, start, begins, ends, q * ax, q * ay, q * ax, q * ay)
                stretched -= share * 0.5 * (begins + ends) * spread.shear
    return couple, stretched


@jit
def _ends(touches, face, number, sx, sy, ax, ay, length, way):
    """Two places where a face's pressure may end on one side (``way`` −1 or 1), and the share of each: the last contact that acts,
    and the next one that gapes, the less the wider it does beside how much the other one gives."""
    closed, closed_at, strength = -1, 0.0, 0.0
    for k in range(len(face)):
        if face[k] == number and touches.acts[k]:
            place = place_along(touches.px[k], touches.py[k], sx, sy, ax, ay)
            size = abs(touches.fx[k]) + abs(touches.fy[k])
            further = way * (place - closed_at)
            if closed < 0 or further > 0 or (further == 0 and size > strength):
                closed, closed_at, strength = k, place, size
    nearest, nearest_at = -1, 0.0
    for k in range(len(face)):
        if face[k] == number and not touches.acts[k]:
            place = place_along(touches.px[k], touches.py[k], sx, sy, ax, ay)
            if way * (place - closed_at) > SAME * length and (nearest < 0 or way * (place - nearest_at) < 0):
                nearest, nearest_at = k, place
    if nearest < 0:
        return (closed_at, 1.0), (closed_at, 0.0)
    give, gap = max(-touches.gap[closed], 0.0), max(touches.gap[nearest], 0.0)
    share = give / (give + gap) if give > 0 else 0.0
    return (closed_at, 1.0 - share), (nearest_at, share)


@jit
def _add_at_end(found, of, start, place, fx, fy):
    """A force at a ``place`` of a straight side where its pressure ends: that on the grid, from which moments are
    taken, and not that of the contact, which is off it. Returned is the couple that is left."""
    sx, sy, ax, ay, _ = line_of(of, start)
    edge = start
    for k in range(of.chain_first[start] + 1, of.chain_last[start] - 1):
        vertex = of.chain[k]
        if place_along(of.vertices[vertex, 0], of.vertices[vertex, 1], sx, sy, ax, ay) <= place:
            edge = vertex
    return add_edge_force(found, of, edge, sx + place * ax, sy + place * ay, fx, fy)


@jit
def add_lone(found, of, touches, k):
    """The force of one contact where it is: on the block's own corner, or on the edge that another's corner meets.
    Returned is the couple that is left."""
    if touches.own[k]:
        add_corner_force(found, of, touches.vertex[k], touches.fx[k], touches.fy[k])
        return 0.0
    return add_edge_force(found, of, touches.edge[k], touches.px[k], touches.py[k], touches.fx[k], touches.fy[k])
