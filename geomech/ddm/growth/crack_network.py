"""The crack network during changes, and the geometry of segments that keeps it planar."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...model import Cracks

Point = tuple[float, float]


@dataclass(eq=False)
class Row:
    """One segment: its ``start`` and ``end`` nodes and its data in the network."""

    start: int
    end: int
    crack: int
    block: int
    birth_cycle: int
    aperture: float
    law: int


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A straight piece from ``a`` to ``b`` that cracks cannot cross: a segment (``row``) or a boundary edge (None)."""

    a: Point
    b: Point
    row: Row | None

    def same_as(self, other: Obstacle | None) -> bool:
        if other is None:
            return False
        return (
            self is other
            or (self.row is not None and self.row is other.row)
            or (self.row is None and other.row is None and self.a == other.a and self.b == other.b)
        )

    def ends_at(self, nodes: set[int], at: Point) -> bool:
        """Whether it may touch the end ``at`` of a path: a segment of one of ``nodes``, or an edge that contains the
        point."""
        if self.row is not None:
            return self.row.start in nodes or self.row.end in nodes
        distance, _ = nearest_on(at, self.a, self.b)
        return distance <= 1e-9 * math.dist(self.a, self.b)


class Network:
    """Editable `Cracks`: nodes and segments can be added, split, moved and merged; `freeze` returns the result."""

    def __init__(self, cracks: Cracks, loops_of: Callable[[int], Sequence[np.ndarray]], cycle: int):
        self.names = cracks.names
        self.cycle = cycle
        self.nodes: list[Point] = [tuple(p) for p in cracks.nodes.tolist()]
        self.surface: list[bool] = cracks.surface.tolist()
        self.rows = [
            Row(start, end, crack, block, birth, aperture, law)
            for (start, end), crack, block, birth, aperture, law in zip(
                cracks.segments.tolist(),
                cracks.crack.tolist(),
                cracks.block.tolist(),
                cracks.birth_cycle.tolist(),
                cracks.aperture.tolist(),
                cracks.law.tolist(),
            )
        ]
        self._at: list[list[Row]] = [[] for _ in self.nodes]
        for row in self.rows:
            self._at[row.start].append(row)
            self._at[row.end].append(row)
        self._loops_of = loops_of
        self._edges: dict[int, tuple[np.ndarray, list[Obstacle]]] = {}
        # Bounding boxes of the original segments; changed ones are tested one by one.
        ends = cracks.nodes[cracks.segments]
        self._low, self._high = ends.min(axis=1), ends.max(axis=1)
        self._original = list(self.rows)
        self._changed: list[Row] = []
        self._gone: set[Row] = set()

    # -- reading ---------------------------------------------------------------------------------------------------

    def rows_at(self, node: int) -> list[Row]:
        return self._at[node]

    def is_tip(self, node: int) -> bool:
        return len(self._at[node]) == 1 and not self.surface[node]

    def crack_at(self, node: int) -> int:
        """The crack that ends at a tip."""
        return self._at[node][0].crack

    def other_end(self, node: int) -> int:
        """The node before a tip."""
        row = self._at[node][0]
        return row.end if row.start == node else row.start

    def connected(self, a: int, b: int) -> bool:
        """Whether one segment joins nodes ``a`` and ``b``."""
        return any(b in (row.start, row.end) for row in self._at[a])

    def within(self, node: int, path: float) -> set[Row]:
        """Segments that start within ``path`` m of ``node``, measured along the cracks."""
        found: set[Row] = set()
        best = {node: 0.0}
        front = [(0.0, node)]
        while front:
            length, at = front.pop()
            for row in self._at[at]:
                found.add(row)
                far = row.end if row.start == at else row.start
                total = length + math.dist(self.nodes[row.start], self.nodes[row.end])
                if total <= path and total < best.get(far, math.inf):
                    best[far] = total
                    front.append((total, far))
        return found

    def near(self, block: int, node: int, radius: float) -> list[Obstacle]:
        """Segments and edges of ``block`` whose boxes are within ``radius`` of ``node``, except those of the node."""
        x, y = self.nodes[node]
        low, high = np.array([x - radius, y - radius]), np.array([x + radius, y + radius])
        found = []
        for k in np.flatnonzero(((self._low <= high) & (self._high >= low)).all(axis=1)).tolist():
            row = self._original[k]
            if row.block == block and row not in self._gone:
                found.append(row)
        found += [row for row in self._changed if row.block == block and row not in self._gone]
        obstacles = [
            Obstacle(self.nodes[row.start], self.nodes[row.end], row)
            for row in found
            if node != row.start and node != row.end
        ]
        boxes, edges = self._edges_of(block)
        if edges:
            at = np.flatnonzero(((boxes[:, 0] <= high) & (boxes[:, 1] >= low)).all(axis=1))
            obstacles += [edges[k] for k in at.tolist()]
        return obstacles

    def _edges_of(self, block: int) -> tuple[np.ndarray, list[Obstacle]]:
        if block not in self._edges:
            starts, ends = [np.empty((0, 2))], [np.empty((0, 2))]
            for loop in self._loops_of(block):
                loop = np.asarray(loop, dtype=float)
                starts.append(loop)
                ends.append(np.roll(loop, -1, axis=0))
            a, b = np.concatenate(starts), np.concatenate(ends)
            boxes = np.stack([np.minimum(a, b), np.maximum(a, b)], axis=1)
            self._edges[block] = boxes, [Obstacle(tuple(p), tuple(q), None) for p, q in zip(a.tolist(), b.tolist())]
        return self._edges[block]

    def edges_at(self, block: int, point: Point, part: float) -> list[Obstacle]:
        """The edges of ``block`` closer to ``point`` than the fraction ``part`` of their length."""
        _, edges = self._edges_of(block)
        return [edge for edge in edges if nearest_on(point, edge.a, edge.b)[0] <= part * math.dist(edge.a, edge.b)]

    def nodes_on(self, obstacle: Obstacle, block: int) -> list[tuple[int, Point]]:
        """Nodes on ``obstacle`` that a step can join: the ends of a segment, the crack mouths on an edge."""
        if obstacle.row is not None:
            return [(n, self.nodes[n]) for n in (obstacle.row.start, obstacle.row.end)]
        mouths = []
        for n, on_surface in enumerate(self.surface):
            if on_surface and self._at[n] and self._at[n][0].block == block:
                distance, _ = nearest_on(self.nodes[n], obstacle.a, obstacle.b)
                if distance <= 1e-9 * math.dist(obstacle.a, obstacle.b):
                    mouths.append((n, self.nodes[n]))
        return mouths

    def first_contact(self, node: int, start: Point, end: Point, obstacle: Obstacle, clearance: float) -> float | None:
        """Coordinate (0 to 1) along the path from ``node`` at which it comes within ``clearance`` of an obstacle; None:
        never.

        A path may leave the boundary it starts from. A tip that merely touches an obstacle may leave to the side of the
        rest of its crack."""
        t = _contact(start, end, obstacle.a, obstacle.b, clearance)
        if t is None:
            return None
        distance, _ = nearest_on(start, obstacle.a, obstacle.b)
        if distance <= clearance and self.surface[node]:
            return None if obstacle.row is None else t
        if distance <= clearance and len(self._at[node]) == 1:
            side = _cross_of(obstacle.a, obstacle.b, self.nodes[self.other_end(node)])
            leaves = _cross_of(obstacle.a, obstacle.b, end)
            far, _ = nearest_on(end, obstacle.a, obstacle.b)
            if side * leaves > 0 and far > clearance:
                return None
        return t

    # -- changing --------------------------------------------------------------------------------------------------

    def add_node(self, at: Point, surface: bool = False) -> int:
        self.nodes.append(at)
        self.surface.append(surface)
        self._at.append([])
        return len(self.nodes) - 1

    def extend(self, tip: int, node: int) -> None:
        """Add a segment of the tip's crack from ``tip`` to ``node``, next to its neighbour in the list and in the
        direction of the crack."""
        last = self._at[tip][0]
        onward = last.end == tip
        ends = (tip, node) if onward else (node, tip)
        row = Row(*ends, last.crack, last.block, self.cycle, 0.0, last.law)
        self._insert(self.rows.index(last) + onward, row)

    def begin(self, name: str, block: int, start: int, end: int) -> None:
        """Add a crack of one segment between two nodes, last in the list; its faces have the first law."""
        self.names = (*self.names, name)
        self._insert(len(self.rows), Row(start, end, len(self.names) - 1, block, self.cycle, 0.0, 0))

    def split(self, row: Row, node: int) -> None:
        """Divide ``row`` at ``node``; both halves keep its data."""
        at = self.rows.index(row)
        self._remove(row)
        kept = (row.crack, row.block, row.birth_cycle, row.aperture, row.law)
        self._insert(at, Row(row.start, node, *kept))
        self._insert(at + 1, Row(node, row.end, *kept))

    def move(self, node: int, at: Point) -> None:
        self.nodes[node] = at
        self._changed += [row for row in self._at[node] if row not in self._changed]

    def detach(self, row: Row, node: int, other: int) -> None:
        """Let ``row`` end at the unused node ``other`` instead of ``node``."""
        row.start, row.end = (other if n == node else n for n in (row.start, row.end))
        self._at[node].remove(row)
        self._at[other].append(row)
        if row not in self._changed:
            self._changed.append(row)

    def merge(self, node: int, into: int) -> None:
        """Let the segments of ``node`` end at ``into`` instead; ``node`` is left unused."""
        for row in self._at[node]:
            row.start, row.end = (into if n == node else n for n in (row.start, row.end))
            self._at[into].append(row)
        self._changed += [row for row in self._at[node] if row not in self._changed]
        self._at[node] = []

    def _insert(self, at: int, row: Row) -> None:
        self.rows.insert(at, row)
        self._at[row.start].append(row)
        self._at[row.end].append(row)
        self._changed.append(row)

    def _remove(self, row: Row) -> None:
        self.rows.remove(row)
        self._at[row.start].remove(row)
        self._at[row.end].remove(row)
        self._gone.add(row)

    def freeze(self, order: Sequence[int] | None = None) -> Cracks:
        """The present network without unused nodes; ``order``: all nodes in the order in which they are numbered, if that
        is not the order in which they were added."""
        segments = np.array([(row.start, row.end) for row in self.rows], dtype=int).reshape(-1, 2)
        used = [node for node in (range(len(self.nodes)) if order is None else order) if self._at[node]]
        renumbered = np.zeros(len(self.nodes), dtype=int)
        renumbered[used] = np.arange(len(used))
        return Cracks(
            nodes=np.array(self.nodes, dtype=float).reshape(-1, 2)[used],
            segments=renumbered[segments],
            crack=np.array([row.crack for row in self.rows], dtype=int),
            block=np.array([row.block for row in self.rows], dtype=int),
            birth_cycle=np.array([row.birth_cycle for row in self.rows], dtype=int),
            aperture=np.array([row.aperture for row in self.rows], dtype=float),
            surface=np.array(self.surface, dtype=bool)[used],
            names=self.names,
            law=np.array([row.law for row in self.rows], dtype=int),
        )


def nearest_on(p: Point, a: Point, b: Point) -> tuple[float, Point]:
    """Distance from ``p`` to the segment ab, and the nearest point of it (its ends exactly)."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    t = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy)
    at = a if t <= 0 else b if t >= 1 else (a[0] + t * dx, a[1] + t * dy)
    return math.dist(p, at), at


def passage(p: Point, q: Point, a: Point, b: Point) -> tuple[float, float]:
    """(t, u) with p + t (q − p) = a + u (b − a): where the two lines cross; nan when they are parallel."""
    dx, dy, ex, ey = q[0] - p[0], q[1] - p[1], b[0] - a[0], b[1] - a[1]
    wx, wy = a[0] - p[0], a[1] - p[1]
    turn = dx * ey - dy * ex
    if turn * turn <= 1e-28 * (dx * dx + dy * dy) * (ex * ex + ey * ey):
        return math.nan, math.nan
    return (wx * ey - wy * ex) / turn, (wx * dy - wy * dx) / turn


def _contact(p: Point, q: Point, a: Point, b: Point, clearance: float) -> float | None:
    """The least t in [0, 1] at which p + t (q − p) crosses ab or passes within ``clearance`` of one of its ends, or 1
    when q ends within ``clearance`` of it; None when they stay apart."""
    if (
        max(p[0], q[0]) + clearance < min(a[0], b[0])
        or max(a[0], b[0]) + clearance < min(p[0], q[0])
        or max(p[1], q[1]) + clearance < min(a[1], b[1])
        or max(a[1], b[1]) + clearance < min(p[1], q[1])
    ):
        return None
    t, u = passage(p, q, a, b)
    found = [t] if 0 <= t <= 1 and 0 <= u <= 1 else []
    dx, dy = q[0] - p[0], q[1] - p[1]
    for end in (a, b):
        if nearest_on(end, p, q)[0] <= clearance:
            along = ((end[0] - p[0]) * dx + (end[1] - p[1]) * dy) / (dx * dx + dy * dy)
            found.append(min(max(along, 0.0), 1.0))
    if nearest_on(p, a, b)[0] <= clearance:
        found.append(0.0)
    if nearest_on(q, a, b)[0] <= clearance:
        found.append(1.0)
    return min(found) if found else None


def _cross_of(a: Point, b: Point, p: Point) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
