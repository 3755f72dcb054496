"""Traction on one side of a block from the contacts of one joint face, with the same resultant and moment.

With the push P, its moment M about the start of the side and the shear T of the contacts, the traction is p(s)(n +
(T/P) t) with ∫ p ds = P and ∫ s p ds = M: p linear, or a triangle where a linear pressure would be tensile
(`no_tension_pressure`). Compiled; `boundary_tractions` has the kernel that calls these functions.
"""

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
    allocating,
    first_on_base,
    jit,
    line_of,
    on_grid,
    pieces_on_base,
    place_along,
)


class _Spread(NamedTuple):
    """Resultant of a face on a side: push N/m (``total``), its ``moment`` about the start of the side, ``shear`` along
    the side; (wx, wy) traction per unit pressure; ``holds``: may be tensile; ``even``: uniform shear instead."""

    total: float
    moment: float
    shear: float
    wx: float
    wy: float
    holds: bool
    even: bool


@allocating
def add_face(found, of, start, touches, face, number, piece):
    """Add the traction of the contacts with this face ``number`` to ``found``, on the straight side that begins with
    the edge ``start``.

    ``piece`` (m), if not 0: the face lies on a rigid base, and the distribution of its pressure on pieces of about this length is
    found later by `geomech.ddm.loads.rigid_bases`; the rows of its pieces and the traction per unit pressure are added, too.

    Returns two moments, N: Σ r ⊗ f along the side that the tractions do not reproduce (opposed shears of two contacts
    have neither resultant nor moment), and the couple lost by forces that act beyond the end of their edge."""
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
        # The shear of a contact with overlap or gap acts off the side.
        turned -= along * (ax * (touches.py[k] - sy) - ay * (touches.px[k] - sx))
        size += abs(x) + abs(y)
        holds = holds and touches.holds[k]
    # Traction per unit pressure: shear is proportional to pressure. On bonds, and where the pressure gives no scale, it
    # is uniform. On a bond with tensile strength the pressure is linear wherever its resultant lies, so that the
    # traction is continuous as the resultant leaves the face.
    inside = total > 0 and least <= moment / total <= most
    moment += turned
    if inside and not holds:
        # Contacts in compression cannot have their resultant outside the face.
        moment = min(max(moment, total * least), total * most)
    even = holds or abs(total) <= 1e-9 * size or not inside
    slope = 0.0 if even else shear / total
    wx, wy = slope * ax - ay, slope * ay + ax
    if piece > 0 and not even:
        near, far = on_grid(min(max(near, 0.0), length), length), on_grid(min(max(far, 0.0), length), length)
        arm = moment / total
        pieces = pieces_on_base(far - near, piece)
        # Within a third of the first piece no pressure of these pieces has the resultant: a triangle at the end has it.
        if min(arm - near, far - arm) > first_on_base(pieces) * (far - near) / 3.0:
            _, _, p_near, p_far = linear(far - near, total, moment - near * total)
            begins = found.count[0]
            add_base(found, of, start, near, far, p_near, p_far, wx, wy, pieces)
            add_row(found.count, found.bases, 2, begins, found.count[0], wx, wy)
            return stretched - slope * moment, 0.0
    spread = _Spread(total, moment, shear, wx, wy, holds, even)
    couple, stretched = _add_spread(found, of, start, touches, face, number, spread, stretched)
    return stretched - slope * moment, couple


@jit
def _add_spread(found, of, start, touches, face, number, spread, stretched):
    """Add the tractions of a face to ``found``, linear or without tension. Returns the couple lost at the ends of
    edges, and what remains of ``stretched`` after uniform shear."""
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
    """Where the pressure of a face may end on one side (``way`` −1 or 1): two places with weights that add up to 1.

    They are the outermost contact that carries force and the next open one. The weight of the open one falls with its
    gap, in proportion to the overlap of the closed one, so that the traction is continuous as contacts open and
    close."""
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
    """Add a force at ``place`` on a straight side, where its pressure ends. Moments are taken about this point of the
    grid, not about the contact beside it. Returns the remaining couple."""
    sx, sy, ax, ay, _ = line_of(of, start)
    edge = start
    for k in range(of.chain_first[start] + 1, of.chain_last[start] - 1):
        vertex = of.chain[k]
        if place_along(of.vertices[vertex, 0], of.vertices[vertex, 1], sx, sy, ax, ay) <= place:
            edge = vertex
    return add_edge_force(found, of, edge, sx + place * ax, sy + place * ay, fx, fy)


@jit
def add_lone(found, of, touches, k):
    """Add the force of a single contact: on the block's own corner, or on the edge that the other block's corner
    touches. Returns the remaining couple."""
    if touches.own[k]:
        add_corner_force(found, of, touches.vertex[k], touches.fx[k], touches.fy[k])
        return 0.0
    return add_edge_force(found, of, touches.edge[k], touches.px[k], touches.py[k], touches.fx[k], touches.fy[k])
