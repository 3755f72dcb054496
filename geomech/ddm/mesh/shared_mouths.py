"""Separates the mouths of cracks that leave the boundary at one point and enclose a piece of rock.

The surrounding rock would be connected only through that point, which no elastic body can be. One of the two cracks at
the mouth is therefore moved a small distance along the boundary, away from the piece: the piece then has an edge there,
and the surrounding rock two ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ..growth.crack_network import Network, Obstacle, Point, Row

#: A mouth lies on an edge if its distance is below this part of the edge's length, as in `elements`.
_ON_EDGE = 1e-7
#: Distances are compared with a relative margin of a thousandth, so that round-off does not decide.
_LESS = 1 - 1e-3


def chain_between(network: Network, tip: int, ends: tuple[int, ...]) -> list[int]:
    """The nodes from ``tip`` along its cracks to the first of ``ends``; [] where the cracks do not lead there."""
    before = {tip: tip}
    front = [tip]
    while front:
        at = front.pop(0)
        if at in ends:
            chain = [at]
            while chain[-1] != tip:
                chain.append(before[chain[-1]])
            return chain[::-1]
        for row in network.rows_at(at):
            far = row.end if row.start == at else row.start
            if far not in before:
                before[far] = at
                front.append(far)
    return []


def part_mouths(
    network: Network,
    block: int,
    chain: list[int],
    joined: int,
    distance: float,
    free: Callable[[int, Point, Obstacle, Row], bool],
) -> None:
    """Give each of the two cracks at a mouth, through which a ``chain`` of nodes closed at ``joined`` passes, its own
    mouth.

    The crack on the outside of the ring continues from a point ``distance`` (m) along the boundary. ``free(node, at,
    edge, row)`` says whether ``row`` may run from ``node`` to ``at`` on ``edge``. Where there is no room nothing
    changes.
    """
    ring = [*chain, joined] if chain[-1] != joined else chain
    for before, mouth, after in zip(ring, ring[1:], ring[2:]):
        if network.surface[mouth]:
            _part(network, block, mouth, (before, after), distance, free)


def _part(network: Network, block: int, mouth: int, neighbours: tuple[int, int], distance: float, free) -> None:
    point = network.nodes[mouth]
    rows = network.rows_at(mouth)
    ways = [
        (edge, end)
        for edge in network.edges_at(block, point, _ON_EDGE)
        for end in (edge.b, edge.a)
        if math.dist(end, point) > 2 * distance
    ]
    # Rock is on the left of an edge: counter-clockwise from the edge that leaves to the edge that arrives.
    onward = [way for way in ways if way[1] == way[0].b]
    back = [way for way in ways if way[1] == way[0].a]
    if not onward or not back:
        return
    zero = _heading(point, onward[0][1])

    def turned(row: Row) -> float:
        far = row.end if row.start == mouth else row.start
        return (_heading(point, network.nodes[far]) - zero) % (2 * math.pi)

    order = sorted(rows, key=turned)
    own = [k for k, row in enumerate(order) if {row.start, row.end} & set(neighbours)]
    if len(own) != 2:
        return
    for k, outermost, (edge, end) in ((own[0], 0, onward[0]), (own[1], len(order) - 1, back[0])):
        if k != outermost:
            continue  # another crack leaves between it and the boundary
        share = distance / math.dist(point, end)
        at = (point[0] + share * (end[0] - point[0]), point[1] + share * (end[1] - point[1]))
        far = order[k].end if order[k].start == mouth else order[k].start
        others = [node for node, _ in network.nodes_on(edge, block) if node != mouth]
        taken = any(math.dist(network.nodes[node], at) < _LESS * distance for node in others)
        if not taken and free(far, at, edge, order[k]):
            network.detach(order[k], mouth, network.add_node(at, surface=True))
            return


def own_mouth_at(
    network: Network, tip: int, obstacle: Obstacle, node: int | None, at: Point, distance: float
) -> Point | None:
    """The mouth that the crack of ``tip`` has come from, if it is nearer than ``distance`` to ``at`` on the boundary,
    where a step would end on an ``obstacle``, or at its ``node``."""
    if not (obstacle.row is None if node is None else network.surface[node]):
        return None
    for row in network.within(tip, math.inf):
        for end in (row.start, row.end):
            if network.surface[end] and math.dist(network.nodes[end], at) < _LESS * distance:
                return network.nodes[end]
    return None


def point_along_edge(mouth: Point, edge: Obstacle, start: Point, distance: float) -> Point:
    """The point of ``edge`` at ``distance`` from the ``mouth`` on it: on the side towards ``start``, or in the edge's
    direction where ``start`` lies opposite the mouth or there is no room on its side."""
    length = math.dist(edge.a, edge.b)
    x, y = ((edge.b[0] - edge.a[0]) / length, (edge.b[1] - edge.a[1]) / length)
    place, wanted = ((p[0] - edge.a[0]) * x + (p[1] - edge.a[1]) * y for p in (mouth, start))
    onward = place < distance or (wanted > place - (1 - _LESS) * distance and length - place > distance)
    place = min(max(place + (distance if onward else -distance), 0.0), length)
    return (edge.a[0] + place * x, edge.a[1] + place * y)


def _heading(a: Point, b: Point) -> float:
    return math.atan2(b[1] - a[1], b[0] - a[0])
