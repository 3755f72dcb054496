"""Crack growth as pure geometry: each driven tip advances by one segment, or joins what it meets.

A step is straight, from the tip by its increment along its growth angle. In this order, it

1. meets another driven tip that approaches it, halfway (both end at a common node);
2. is cut where it would cross a crack face or a boundary, and joins it there;
3. goes to a crack or a boundary ahead of it instead, if its end comes close to that, closer than its start, and nothing
   is in between;
4. otherwise ends in the rock as a tip.

The network stays a planar graph: segments meet at common nodes only. A distance equal to the join distance does not
count as close (`tie_tolerance`): with 9 mm left and increments of 6 mm that join within 3 mm a tip ends in the rock.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...model import Cracks, GrowthSettings
from ..mesh.shared_mouths import chain_between, own_mouth_at, part_mouths, point_along_edge
from .approach_limit import longest_advance
from .crack_network import Network, Obstacle, Point, Row, nearest_on, passage
from .tie_tolerance import ONE_WAY, TIED, in_order, reached

#: Shortest segment, as a fraction of the shortest increment: ends snap to what they nearly touch.
SLIVER = 0.1
#: Clearance between paths, as a fraction of that length; also the tolerance of lengths.
CLEARANCE = 1e-3
#: A tip (first number) or another node (second) is preferred to a point on a face if its distance times this number is
#: smaller.
PREFER_TIP, PREFER_NODE = 0.6, 0.9
#: A face crossed within this fraction of the join distance from one of its nodes is joined at that node.
SNAP_TO_TIP, SNAP_TO_NODE = 0.5, 0.1
#: Points at a larger angle to the growth direction than this are not ahead.
AHEAD = math.cos(math.radians(60.0) + ONE_WAY)
#: Two tips meet halfway when each lies within this angle of the other's growth direction.
FACING = math.cos(math.radians(45.0) + ONE_WAY)
#: A path that would meet a boundary or a crack at a smaller angle goes to it at a right angle instead. The mouth would
#: be too sharp to resolve, also after a block is split there (bodies with angles below 3° are refused), and the rock in
#: between carries hardly any load.
GRAZES = math.sin(math.radians(5.0) - ONE_WAY)
#: A tip that would turn back along its own crack more sharply than this does not grow.
TURN_BACK = math.radians(170.0)


@dataclass(frozen=True)
class Join:
    """A tip that joined a crack or the boundary. ``tip_node``: number before growth; ``other_crack``: −1 for the
    boundary; ``kind``: "coalescence" (with another crack), "self" (with its own) or "daylighting"."""

    kind: str
    tip_node: int
    crack: int
    other_crack: int
    point: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Growth:
    """``cracks`` after growth, ``grown`` (n_tips,) m for each tip row, and the ``joins``.

    Nodes keep their numbers, except for a tip that was moved onto an existing node and is removed.
    """

    cracks: Cracks
    grown: np.ndarray
    joins: tuple[Join, ...]


#: A possible end of a step: obstacle, node on it (None: between its nodes), point.
_Way = tuple[Obstacle, int | None, Point]
#: The same, after its score, m.
_Scored = tuple[float, Obstacle, int | None, Point]


@dataclass(frozen=True)
class _Step:
    """Intended step of one tip: from ``start`` by ``length`` along the unit vector ``direction``."""

    row: int  # in the tips given
    node: int
    block: int
    start: Point
    direction: Point
    length: float

    @property
    def end(self) -> Point:
        return (self.start[0] + self.length * self.direction[0], self.start[1] + self.length * self.direction[1])


def advance(
    cracks: Cracks,
    loops_of: Callable[[int], Sequence[np.ndarray]],
    tips: np.ndarray,
    settings: GrowthSettings,
    k_ic: np.ndarray,
    cycle: int,
    longest: np.ndarray | float = math.inf,
) -> Growth:
    """Advance every tip whose ``k_eq`` has `reached` ``k_ic`` by one segment.

    ``loops_of(block)`` gives the block's outline and holes in reference coordinates ([] for an infinite plane);
    ``tips`` are TIP rows with ``k_eq`` and ``angle`` filled; ``k_ic`` (n_tips,) Pa √m; ``cycle`` is the birth cycle of
    new segments. The increment is settings.increment times (K_eq/K_Ic) over its largest value, but no less than
    settings.min_increment, and no more than ``longest`` (n_tips,) m; where that is 0 the tip stands. Near other cracks
    it is shorter (`approach_limit`). New segments carry aperture 0 and continue their crack's direction and place in
    the list. Where tips meet each other, the most highly driven one goes first, whatever the order in which they are given;
    of equally driven ones (`tie_tolerance`) the first given. Raises ValueError for a tip row that is no tip of the network, or
    whose angle is not finite.
    """
    k_ic = np.broadcast_to(np.asarray(k_ic, dtype=float), (len(tips),))
    grown = np.zeros(len(tips))
    longest = np.broadcast_to(np.asarray(longest, dtype=float), (len(tips),))
    growing = np.flatnonzero(reached(tips["k_eq"], k_ic) & (tips["k_eq"] > 0) & (longest > 0))
    if not len(growing):
        return Growth(cracks, grown, ())
    loose = set(cracks.tips.tolist())
    drive = tips["k_eq"][growing] / k_ic[growing]
    lengths = np.clip(settings.increment * drive / drive.max(), settings.min_increment, settings.increment)
    lengths = np.minimum(lengths, np.minimum(longest, longest_advance(cracks, tips, settings))[growing])
    steps = []
    for row, length in zip(growing, lengths):
        tip = tips[row]
        if int(tip["node"]) not in loose:
            raise ValueError(f"node {int(tip['node'])} of crack {int(tip['crack'])} is not a tip of the network")
        if not math.isfinite(tip["angle"]):
            raise ValueError(f"crack {int(tip['crack'])}: the growth angle at node {int(tip['node'])} is not finite")
        if abs(tip["angle"]) > TURN_BACK:
            continue
        heading = math.atan2(tip["direction"][1], tip["direction"][0]) + float(tip["angle"])
        steps.append(
            _Step(
                row=int(row),
                node=int(tip["node"]),
                block=int(tip["block"]),
                start=tuple(cracks.nodes[tip["node"]].tolist()),
                direction=(math.cos(heading), math.sin(heading)),
                length=float(length),
            )
        )
    work = _Work(Network(cracks, loops_of, cycle), settings)
    met = _join_approaching_tips(work, steps, grown)
    network, first = work.network, len(work.network.nodes)
    #: Row of the tip for which each node after ``first`` was added: nodes are numbered in the order of the tips.
    added: list[int] = []
    drives = dict(zip(growing.tolist(), drive.tolist()))
    for k in in_order([-drives[step.row] for step in steps], TIED * float(drive.max())):
        step = steps[k]
        # A tip that another one has joined is no longer a tip.
        if step.row not in met and network.is_tip(step.node):
            _advance_one(work, step, grown)
        added += [step.row] * (len(network.nodes) - first - len(added))
    order = [*range(first), *(first + k for k in sorted(range(len(added)), key=added.__getitem__))]
    return Growth(network.freeze(order), grown, tuple(work.joins))


class _Work:
    """The network during growth, its lengths, and the joins so far."""

    def __init__(self, network: Network, settings: GrowthSettings):
        self.network = network
        by_increment = settings.join_distance * settings.increment
        self.reach = by_increment if settings.join_length is None else settings.join_length
        self.sliver = SLIVER * settings.min_increment
        self.clearance = CLEARANCE * self.sliver
        self.joins: list[Join] = []

    def nearer(self, distance: float, than: float) -> bool:
        """Whether one length is less than another by more than the clearance."""
        return distance < than - self.clearance

    def log(self, node: int, crack: int, other: int, point: Point) -> None:
        kind = "daylighting" if other < 0 else "self" if other == crack else "coalescence"
        self.joins.append(Join(kind, node, crack, other, point))


def _join_approaching_tips(work: _Work, steps: list[_Step], grown: np.ndarray) -> set[int]:
    """Join pairs of tips that approach and meet each other in this step; returns their rows."""
    network, pairs, met = work.network, [], set()
    for i, a in enumerate(steps):
        for b in steps[i + 1 :]:
            if a.block != b.block:
                continue
            d = (b.start[0] - a.start[0], b.start[1] - a.start[1])
            gap = math.hypot(*d)
            # Below a few sliver lengths there is no room for two segments: one tip grows to the other.
            if not (work.nearer(4 * work.sliver, gap) and work.nearer(gap, a.length + b.length + work.reach)):
                continue
            d = (d[0] / gap, d[1] / gap)
            if _dot(a.direction, d) >= FACING and -_dot(b.direction, d) >= FACING:
                pairs.append((gap, a, b))
    for k in in_order([gap for gap, _, _ in pairs], work.clearance):
        _, a, b = pairs[k]
        if a.row in met or b.row in met or network.connected(a.node, b.node):
            continue
        t, u = _crossing(work, a, b)
        if 0 <= t <= 1 and 0 <= u <= 1:
            at = (a.start[0] + t * a.length * a.direction[0], a.start[1] + t * a.length * a.direction[1])
        else:
            share = a.length / (a.length + b.length)
            (x0, y0), (x1, y1) = a.start, b.start
            at = (x0 + share * (x1 - x0), y0 + share * (y1 - y0))
        if work.nearer(min(math.dist(a.start, at), math.dist(b.start, at)), work.sliver):
            continue
        if not (_clear(work, a, at, set(), None) and _clear(work, b, at, set(), None)):
            continue
        crack, other = network.crack_at(a.node), network.crack_at(b.node)
        chain = chain_between(network, a.node, (b.node,))
        node = network.add_node(at)
        network.extend(a.node, node)
        network.extend(b.node, node)
        _open_ring(work, a.block, chain, node)
        grown[a.row], grown[b.row] = math.dist(a.start, at), math.dist(b.start, at)
        work.log(a.node, crack, other, at)
        met |= {a.row, b.row}
    return met


def _crossing(work: _Work, a: _Step, b: _Step) -> tuple[float, float]:
    """(t, u): where two steps cross, as fractions of their lengths; nan if they do not, or if they are collinear, where
    rounding would decide."""
    if abs(a.direction[0] * b.direction[1] - a.direction[1] * b.direction[0]) < ONE_WAY:
        return math.nan, math.nan
    parts = []
    for part, step in zip(passage(a.start, a.end, b.start, b.end), (a, b)):
        spare = work.clearance / step.length
        parts.append(min(max(part, 0.0), 1.0) if -spare <= part <= 1 + spare else math.nan)
    return parts[0], parts[1]


def _advance_one(work: _Work, step: _Step, grown: np.ndarray) -> None:
    network = work.network
    ways = _blocked(work, step)
    if ways is None:
        ways = _attracted(work, step)
    crack = network.crack_at(step.node)
    for obstacle, node, at in ways:
        mouth = own_mouth_at(network, step.node, obstacle, node, at, work.sliver)
        if mouth is not None:
            if node is not None:
                continue
            at = point_along_edge(mouth, obstacle, step.start, work.sliver)
        if node is None and _grazes(step.start, at, obstacle):
            _, at = nearest_on(step.start, obstacle.a, obstacle.b)
            end = min(math.dist(at, obstacle.a), math.dist(at, obstacle.b))
            if obstacle.row is not None and work.nearer(end, work.sliver):
                continue  # past its end
        # If a segment would be a sliver, the tip itself is moved onto what it meets.
        drawn = work.nearer(math.dist(step.start, at), work.sliver)
        allowed = set() if node is None else {node}
        if not (_clear_when_drawn if drawn else _clear)(work, step, at, allowed, obstacle):
            continue
        other = _other_crack(network, obstacle, node, step.node)
        met = (node,) if node is not None else () if obstacle.row is None else (obstacle.row.start, obstacle.row.end)
        chain = chain_between(network, step.node, met)
        if drawn:
            joined = _draw(network, step.node, obstacle, node, at)
        else:
            joined = _anchor(network, obstacle, node, at)
            network.extend(step.node, joined)
        _open_ring(work, step.block, chain, joined)
        grown[step.row] = math.dist(step.start, at)
        work.log(step.node, crack, other, at)
        return
    if _clear(work, step, step.end, set(), None):
        network.extend(step.node, network.add_node(step.end))
        grown[step.row] = step.length


def _grazes(start: Point, at: Point, face: Obstacle) -> bool:
    """Whether the path from ``start`` to ``at`` on the ``face`` of a crack or a boundary runs nearly along it."""
    (x, y), (dx, dy) = (at[0] - start[0], at[1] - start[1]), (face.b[0] - face.a[0], face.b[1] - face.a[1])
    return abs(x * dy - y * dx) < GRAZES * math.hypot(x, y) * math.hypot(dx, dy)


def _blocked(work: _Work, step: _Step) -> list[_Way] | None:
    """Possible ends of a step at the first obstacle it would cross, best first; None when there is none."""
    network, met = work.network, []
    for obstacle in network.near(step.block, step.node, step.length + work.reach):
        t = network.first_contact(step.node, step.start, step.end, obstacle, work.clearance)
        if t is not None:
            met.append((t, obstacle))
    if not met:
        return None
    # At a corner, junction or mouth several obstacles are met at once: the boundary is taken first, as it includes
    # mouths.
    met.sort(key=lambda each: each[1].row is not None)
    t, obstacle = met[in_order([t for t, _ in met], work.clearance / step.length)[0]]
    hit = (step.start[0] + t * (step.end[0] - step.start[0]), step.start[1] + t * (step.end[1] - step.start[1]))
    _, at = nearest_on(hit, obstacle.a, obstacle.b)
    scored: list[_Scored] = []
    for node, point in network.nodes_on(obstacle, step.block):
        snap = SNAP_TO_TIP if network.is_tip(node) else SNAP_TO_NODE
        distance = math.dist(point, at)
        # The direct path must still be nearly that of the crack.
        ahead = _dot(_towards(step.start, point), step.direction) >= AHEAD or distance <= work.sliver
        near = work.nearer(distance, max(work.sliver, snap * work.reach))
        if ahead and near and not network.connected(step.node, node):
            scored.append((distance, obstacle, node, point))
    ways = _best_first(work, scored)
    if obstacle.row is None:
        corners = [corner for corner in (obstacle.a, obstacle.b) if work.nearer(math.dist(corner, at), work.sliver)]
        ways += [(obstacle, None, corner) for corner in corners]
    return [*ways, (obstacle, None, at)]


def _attracted(work: _Work, step: _Step) -> list[_Way]:
    """Possible joins of a step whose free end comes close to something, best first."""
    network, seen = work.network, set[int]()
    ways: list[_Scored] = []
    own = network.crack_at(step.node)
    # The crack's own neighbourhood is always close, and never joined.
    tail = network.within(step.node, 2 * (step.length + work.reach) + work.clearance)
    for obstacle in network.near(step.block, step.node, step.length + work.reach):
        if obstacle.row is not None and obstacle.row in tail:
            continue
        distance, at = nearest_on(step.end, obstacle.a, obstacle.b)
        # An obstacle that the step moves away from, such as a crack already passed, is not joined.
        if not work.nearer(distance, min(work.reach, nearest_on(step.start, obstacle.a, obstacle.b)[0])):
            continue
        is_own = obstacle.row is not None and obstacle.row.crack == own
        candidates: list[tuple[float, int | None, Point]] = [(distance, None, at)]
        for there, point in network.nodes_on(obstacle, step.block):
            away = math.dist(step.end, point)
            if there not in seen and work.nearer(away, work.reach):
                seen.add(there)
                candidates.append((away * (PREFER_TIP if network.is_tip(there) else PREFER_NODE), there, point))
        for score, node, point in candidates:
            origin = step.end if is_own else step.start
            if _dot(_towards(origin, point), step.direction) < AHEAD:
                continue
            ends = (obstacle.a, obstacle.b)
            if node is None and any(work.nearer(math.dist(point, end), work.sliver) for end in ends):
                if obstacle.row is not None:
                    continue  # the node itself is among the candidates
                point = min(ends, key=lambda end: math.dist(point, end))
            ways.append((score, obstacle, node, point))
    return _best_first(work, ways)


def _best_first(work: _Work, ways: list[_Scored]) -> list[_Way]:
    """``ways`` in order of their scores, m."""
    return [ways[k][1:] for k in in_order([way[0] for way in ways], work.clearance)]


def _clear(work: _Work, step: _Step, at: Point, allowed: set[int], target: Obstacle | None) -> bool:
    """Whether the segment from the tip to ``at`` touches nothing, except at its end the ``target`` or segments that end
    at an ``allowed`` node. Grazing the target (below about 5°) counts as touching it."""
    return _free_path(work, step.node, step.block, step.start, at, allowed, target)


def _clear_when_drawn(work: _Work, step: _Step, at: Point, allowed: set[int], target: Obstacle) -> bool:
    """`_clear` for the tip's last segment with its end moved to ``at``."""
    before = work.network.other_end(step.node)
    start = work.network.nodes[before]
    if work.nearer(math.dist(start, at), work.sliver) or any(work.network.connected(before, node) for node in allowed):
        return False
    own = work.network.rows_at(step.node)[0]
    return _free_path(work, before, step.block, start, at, allowed, target, own)


def _free_path(
    work: _Work,
    node: int,
    block: int,
    start: Point,
    at: Point,
    allowed: set[int],
    target: Obstacle | None,
    without: Row | None = None,
) -> bool:
    """`_clear` for any path from ``node`` at ``start``, ignoring the segment ``without``."""
    network = work.network
    length = math.dist(start, at)
    late = 1 - 12 * work.clearance / length
    for obstacle in network.near(block, node, length + 2 * work.clearance):
        if obstacle.row is not None and obstacle.row is without:
            continue
        t = network.first_contact(node, start, at, obstacle, work.clearance)
        if t is None:
            continue
        touches_end = obstacle.same_as(target) or obstacle.ends_at(allowed, at)
        if not (touches_end and t >= late):
            return False
    return True


def _open_ring(work: _Work, block: int, chain: list[int], joined: int) -> None:
    """Separate the cracks of a mouth through which a ``chain`` of nodes has closed at ``joined``."""

    def free(node: int, at: Point, edge: Obstacle, row: Row) -> bool:
        return _free_path(work, node, block, work.network.nodes[node], at, set(), edge, row)

    if chain:
        part_mouths(work.network, block, chain, joined, work.sliver, free)


def _draw(network: Network, tip: int, obstacle: Obstacle, node: int | None, at: Point) -> int:
    """Move ``tip`` onto the obstacle, or onto its ``node``; returns the node where it then is."""
    network.move(tip, at)
    if node is not None:
        network.merge(tip, node)
        return node
    if obstacle.row is None:
        network.surface[tip] = True
    else:
        network.split(obstacle.row, tip)
    return tip


def _anchor(network: Network, obstacle: Obstacle, node: int | None, at: Point) -> int:
    """The end node of a step: the given one, or a new one on the obstacle."""
    if node is not None:
        return node
    new = network.add_node(at, surface=obstacle.row is None)
    if obstacle.row is not None:
        network.split(obstacle.row, new)
    return new


def _other_crack(network: Network, obstacle: Obstacle, node: int | None, tip: int) -> int:
    """The crack that was joined; −1 for the boundary."""
    if obstacle.row is not None and (node is None or node in (obstacle.row.start, obstacle.row.end)):
        return obstacle.row.crack
    if node is None:
        return -1
    others = [row.crack for row in network.rows_at(node) if tip not in (row.start, row.end)]
    return others[0] if others else -1


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1]


def _towards(a: Point, b: Point) -> Point:
    length = math.dist(a, b) or 1.0
    return ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
