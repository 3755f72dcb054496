"""The forces of a joint face's contacts as one traction along the side of the block that it covers."""

from __future__ import annotations

from bisect import bisect_right

from ..model import Blocks
from .face_pressure import linear, no_pull
from .load_pieces import (
    SAME,
    Pieces,
    add_base,
    add_corner_force,
    add_edge_force,
    add_on_side,
    line_of,
    on_grid,
    place_along,
)
from .touches import Touch

#: A resultant nearer to an end of a face than this part of it presses there and nowhere else.
AT_AN_END = 1e-2


def add_face(pieces: Pieces, blocks: Blocks, side: list[int], touches: list[Touch], based: bool = False) -> None:
    """All that touches a straight ``side`` as one distribution with the resultant and moment of its forces; where it is
    ``based`` on what keeps straight, it is yet to be found how they are spread."""
    line = start, _, (ax, ay), length = line_of(blocks, side)
    places = [place_along(touch.point, start, (ax, ay)) for touch in touches]
    acting = [(place, touch) for place, touch in zip(places, touches) if touch.acts]
    total = moment = shear = size = turned = stretched = 0.0
    for place, touch in acting:
        (x, y), (px, py) = touch.force, touch.point
        push = ax * y - ay * x  # inward: the direction turned by +90°
        along = ax * x + ay * y
        total += push
        moment += push * place
        shear += along
        stretched += along * place
        # A contact that is pressed in, or gapes, has its shear off the side.
        turned -= along * (ax * (py - start[1]) - ay * (px - start[0]))
        size += abs(x) + abs(y)
    # The force that goes with a unit of pressure: shear in proportion to it, evenly spread where faces are held
    # together besides and there is none to go by. Pressure on a bond that may pull is linear, and shear even, wherever
    # its resultant is: it goes on without a jump as that leaves the face.
    reach = [place for place, _ in acting]
    holds = all(touch.holds for _, touch in acting)
    inside = total > 0 and min(reach) <= moment / total <= max(reach)
    moment += turned
    if inside and not holds:
        # What only pushes cannot do so beyond its ends.
        moment = min(max(moment, total * min(reach)), total * max(reach))
    even = holds or abs(total) <= 1e-9 * size or not inside
    slope = 0.0 if even else shear / total
    per_push = (slope * ax - ay, slope * ay + ax)
    if based and not even:
        near, far = (on_grid(min(max(place, 0.0), length), length) for place in (min(places), max(places)))
        arm = moment / total
        if min(arm - near, far - arm) > AT_AN_END * (far - near):
            _, _, p_near, p_far = linear(far - near, total, moment - near * total)
            add_base(pieces, blocks, side, line, (near, far), p_near, p_far, per_push)
            pieces.left_out.append(((ax, ay), stretched - slope * moment))
            return
    gapes = [(place, touch) for place, touch in zip(places, touches) if not touch.acts]
    for low, low_share in _ends(acting, gapes, length, -1):
        for high, high_share in _ends(acting, gapes, length, 1):
            share = low_share * high_share
            first, last = (min(max(on_grid(place, length), 0.0), length) for place in (low[0], high[0]))
            if first == last:
                first, last = max(low[0], 0.0), min(high[0], length)
            force_and_moment = last - first, share * total, share * (moment - first * total)
            found, at_first, at_last = ([linear(*force_and_moment)], 0.0, 0.0) if holds else no_pull(*force_and_moment)
            for a, b, p_a, p_b in found:
                t_a, t_b = ((p * per_push[0], p * per_push[1]) for p in (p_a, p_b))
                add_on_side(pieces, blocks, side, line, (first + a, first + b), t_a, t_b)
            for force, place in ((at_first, first), (at_last, last)):
                if force:
                    add_at_end(pieces, blocks, side, line, place, (force * per_push[0], force * per_push[1]))
            if even:
                q = share * shear / (last - first)
                add_on_side(pieces, blocks, side, line, (first, last), (q * ax, q * ay), (q * ax, q * ay))
                stretched -= share * 0.5 * (first + last) * shear
    pieces.left_out.append(((ax, ay), stretched - slope * moment))


def _ends(acting: list, gapes: list, length: float, way: int) -> list[tuple[tuple[float, Touch], float]]:
    """Where a face's pressure may end on one side (``way`` −1 or 1), as pairs of place and touch, and the share of
    each: the last contact that acts, and the next one that gapes, the less the wider it does beside how much the other
    one gives."""
    closed = max(acting, key=lambda of: (way * of[0], abs(of[1].force[0]) + abs(of[1].force[1])))
    beyond = [of for of in gapes if way * (of[0] - closed[0]) > SAME * length]
    if not beyond:
        return [(closed, 1.0)]
    nearest = min(beyond, key=lambda of: way * of[0])
    give, gap = max(-closed[1].gap, 0.0), max(nearest[1].gap, 0.0)
    share = give / (give + gap) if give > 0 else 0.0
    return [(of, part) for of, part in ((closed, 1.0 - share), (nearest, share)) if part > 0]


def add_at_end(
    pieces: Pieces, blocks: Blocks, side: list[int], line: tuple, place: float, force: tuple[float, float]
) -> None:
    """A ``force`` at a ``place`` of a straight side where its pressure ends: that on the grid, from which moments are
    taken, and not that of the contact, which is off it."""
    start, _, (ax, ay), _ = line
    marks = [place_along(blocks.vertices[k].tolist(), start, (ax, ay)) for k in side[1:-1]]
    edge = side[bisect_right(marks, place)]
    add_edge_force(pieces, blocks, edge, (start[0] + place * ax, start[1] + place * ay), force)


def add_lone(pieces: Pieces, blocks: Blocks, touch: Touch, force: tuple[float, float]) -> None:
    """A ``force`` where one contact is: on the block's own corner, or on the edge that another's corner meets."""
    if touch.own:
        add_corner_force(pieces, blocks, touch.vertex, force)
    else:
        add_edge_force(pieces, blocks, touch.edge, touch.point, force)
