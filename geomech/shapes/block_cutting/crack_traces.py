"""Noded network from crack traces: each in its block, mouths on the outline, shared nodes at crossings."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ...model import Blocks, Cracks
from ..parts import Flaw


def crack_network(
    names: Sequence[str],
    lines: Sequence[Sequence[np.ndarray]],
    zone_names: Sequence[str],
    polygons: Sequence | np.ndarray,
    loops: Sequence[Sequence[np.ndarray]],
    tolerance: float,
    decimals: int,
    flaws: list[Flaw],
) -> Cracks:
    """The network of cracks ``lines[crack][branch]`` (n, 2) inside ``polygons`` (Shapely; ``loops`` their vertices).

    Each crack is assigned to the block that contains it; an end within ``tolerance`` of the outline is moved onto it
    and becomes a mouth; ends within ``tolerance`` of a crack join it; crossings become shared nodes. Cracks that cannot
    be placed are added to ``flaws`` under "cracks".
    """
    import shapely

    tree = shapely.STRtree(polygons)
    net = _Network(names, tolerance, decimals, flaws)
    placed: list[tuple[int, int, np.ndarray, np.ndarray]] = []
    for k, branches in enumerate(lines):
        for line in branches:
            line, ok = _cleaned(k, names[k], line, tolerance, flaws)
            if not ok:
                continue
            block = _block_of(k, names[k], line, zone_names, tree, tolerance, flaws)
            if block < 0:
                continue
            line, mouth, ok = _mouths(k, names[k], line, zone_names[block], loops[block], tolerance, flaws)
            if ok:
                placed.append((k, block, line, mouth))
    for k, block, line, mouth in placed:
        net.add(k, block, line, mouth)
    return net.noded()


def cutting_cracks(blocks: Blocks, cracks: Cracks) -> list[tuple[int, int]]:
    """(crack, block) for every crack that closes a ring with earlier ones and the outline, and thus cuts off a piece.

    Every loop of a block counts as one point; a segment that joins two points that are already connected closes a ring.
    """
    parent: dict[tuple, tuple] = {}

    def root(key: tuple) -> tuple:
        while parent.setdefault(key, key) != key:
            key = parent[key]
        return key

    def key_of(node: int, block: int) -> tuple:
        if not cracks.surface[node]:
            return ("node", node)
        ends = [(loop, np.roll(loop, -1, axis=0)) for loop in blocks.loops(block)]
        return ("loop", block, int(np.argmin([_nearest_on(cracks.nodes[node], a, b, 0.0)[1] for a, b in ends])))

    found: dict[int, int] = {}
    for (a, b), crack, block in zip(cracks.segments.tolist(), cracks.crack.tolist(), cracks.block.tolist()):
        first, second = root(key_of(a, block)), root(key_of(b, block))
        if first == second:
            found.setdefault(crack, block)
        parent[first] = second
    return list(found.items())


def _cleaned(k: int, name: str, line: np.ndarray, tolerance: float, flaws: list[Flaw]) -> tuple[np.ndarray, bool]:
    if len(line) < 2:
        flaws.append(Flaw("cracks", k, f"crack {name!r} has {len(line)} point(s)", "give at least two points"))
        return line, False
    step = np.hypot(*(line[1:] - line[:-1]).T)
    if (step <= tolerance).any():
        at = int(np.argmin(step))
        flaws.append(
            Flaw(
                "cracks",
                k,
                f"crack {name!r}: points {at} and {at + 1} coincide at ({line[at, 0]:g}, {line[at, 1]:g})",
                "remove one of them, or give the crack a length",
            )
        )
        return line, False
    return line, True


def _block_of(k, name, line, zone_names, tree, tolerance, flaws) -> int:
    """The block that contains all of ``line``; −1, with a message, if there is none."""
    import shapely

    # Segment by segment: the intersection with a whole line would count a part traversed twice only once.
    pieces = shapely.linestrings(np.stack([line[:-1], line[1:]], axis=1))
    length = float(shapely.length(pieces).sum())
    near = np.unique(tree.query(pieces, predicate="intersects")[1])
    polygons = tree.geometries[near]
    inside = shapely.length(shapely.intersection(pieces[:, None], polygons[None])).sum(axis=0)
    slack = 2.5 * tolerance  # an overshoot of one tolerance at each end
    # A crack on a common outline lies in two blocks and is wrong in both.
    holds = np.flatnonzero(inside >= length - slack)
    for nearby in holds:
        block = near[nearby]
        along = shapely.length(shapely.intersection(pieces, shapely.boundary(polygons[nearby]))).sum()
        if along > slack:
            flaws.append(
                Flaw(
                    "cracks",
                    k,
                    f"crack {name!r} runs along the outline of zone {zone_names[block]!r}",
                    "blocks are separate along their outlines anyway: move the crack inside, or leave it out",
                )
            )
            return -1
    if len(holds):
        return int(near[holds[0]])
    if inside.sum() <= slack:
        flaws.append(
            Flaw(
                "cracks",
                k,
                f"crack {name!r} from ({line[0, 0]:g}, {line[0, 1]:g}) to ({line[-1, 0]:g}, {line[-1, 1]:g}) lies "
                "outside the rock",
                "move it into a zone (coordinates are in m)",
            )
        )
        return -1
    best = int(np.argmax(inside))
    block = near[best]
    at = shapely.get_coordinates(shapely.intersection(pieces, shapely.boundary(polygons[best])))
    spot = f" at ({at[0, 0]:g}, {at[0, 1]:g})" if len(at) else ""
    flaws.append(
        Flaw(
            "cracks",
            k,
            f"crack {name!r} crosses the outline of zone {zone_names[block]!r}{spot}",
            "end it on the outline (it is open to the surface there), or draw one crack on each side",
        )
    )
    return -1


def _mouths(k, name, line, zone, loops, tolerance, flaws):
    """``line`` with ends near the outline moved onto it, the two flags that mark these, and whether the rest is
    clear."""
    line = line.copy()
    mouth = np.zeros(2, bool)
    starts = np.concatenate(loops)
    ends = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    for which in (0, -1):
        foot, distance = _nearest_on(line[which], starts, ends, tolerance)
        if distance <= tolerance:
            line[which], mouth[which] = foot, True
    inner = line[1:-1]
    touching = [p for p in inner if _nearest_on(p, starts, ends, tolerance)[1] <= tolerance]
    for a, b in pairwise(line):
        # A re-entrant corner may touch the crack between its points.
        t = np.clip((starts - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        off = np.hypot(*(a + t[:, None] * (b - a) - starts).T)
        free = np.hypot(*(starts - a).T) > 2 * tolerance
        free &= np.hypot(*(starts - b).T) > 2 * tolerance
        touching.extend(starts[(off <= tolerance) & free])
    if touching:
        at = touching[0]
        flaws.append(
            Flaw(
                "cracks",
                k,
                f"crack {name!r} touches the outline of zone {zone!r} between its ends, at ({at[0]:g}, {at[1]:g})",
                "divide it there into two cracks, or keep it clear of the outline",
            )
        )
        return line, mouth, False
    return line, mouth, True


def _nearest_on(point: np.ndarray, starts: np.ndarray, ends: np.ndarray, tolerance: float) -> tuple[np.ndarray, float]:
    """The nearest point of segments (n, 2), (n, 2), a vertex if one is within ``tolerance``, and its distance."""
    corner = np.hypot(*(starts - point).T)
    if corner.min() <= tolerance:
        return starts[np.argmin(corner)], float(corner.min())
    along = ends - starts
    t = np.clip(np.einsum("nx,nx->n", point - starts, along) / np.einsum("nx,nx->n", along, along), 0, 1)
    feet = starts + t[:, None] * along
    distance = np.hypot(*(feet - point).T)
    best = int(np.argmin(distance))
    foot = feet[best]
    # Exactly on edges that run along an axis.
    level = along[best] == 0
    return np.where(level, starts[best], foot), float(distance[best])


class _Network:
    """Nodes merged within the tolerance, and the segments between them, while crossings are determined."""

    def __init__(self, names: Sequence[str], tolerance: float, decimals: int, flaws: list[Flaw]) -> None:
        self.names, self.tolerance, self.decimals, self.flaws = tuple(names), tolerance, decimals, flaws
        self.points: list[np.ndarray] = []
        self.surface: list[bool] = []
        self.cells: dict[tuple[int, int, int], list[int]] = {}
        self.segments: list[tuple[int, int, int, int]] = []  # start, end, crack, block

    def node(self, point: np.ndarray, block: int, surface: bool = False) -> int:
        """The node at ``point`` in ``block``, an existing one or a new one."""
        size = 4 * self.tolerance
        i, j = (int(c) for c in np.floor(point / size))
        for di in (0, -1, 1):
            for dj in (0, -1, 1):
                for n in self.cells.get((block, i + di, j + dj), ()):
                    if np.hypot(*(self.points[n] - point)) <= self.tolerance:
                        if surface and not self.surface[n]:
                            self.points[n], self.surface[n] = point, True
                        return n
        self.points.append(np.asarray(point, dtype=float))
        self.surface.append(surface)
        self.cells.setdefault((block, i, j), []).append(len(self.points) - 1)
        return len(self.points) - 1

    def add(self, crack: int, block: int, line: np.ndarray, mouth: np.ndarray) -> None:
        flags = np.zeros(len(line), bool)
        flags[0], flags[-1] = mouth
        nodes = [self.node(point, block, bool(flag)) for point, flag in zip(line, flags)]
        self.segments += [(a, b, crack, block) for a, b in pairwise(nodes) if a != b]

    def noded(self) -> Cracks:
        if not self.segments:
            return Cracks.from_polylines([], names=())
        cuts: list[set[int]] = [set() for _ in self.segments]
        pairs = self._near_pairs()
        self._join_ends(pairs, cuts)
        self._cross(pairs, cuts)
        segments, crack, block = [], [], []
        seen: dict[tuple[int, int], int] = {}
        for (a, b, k, home), on in zip(self.segments, cuts):
            start, along = self.points[a], self.points[b] - self.points[a]
            chain = [a, *sorted(on - {a, b}, key=lambda n: float((self.points[n] - start) @ along)), b]
            for p, q in pairwise(chain):
                pair = (min(p, q), max(p, q))
                if pair in seen:
                    self._coincident(seen[pair], k)
                    continue
                seen[pair] = k
                segments.append((p, q))
                crack.append(k)
                block.append(home)
        flat = np.array(segments).ravel()
        used, first = np.unique(flat, return_index=True)
        order = used[np.argsort(first)]
        number = np.empty(len(self.points), int)
        number[order] = np.arange(len(order))
        return Cracks(
            nodes=np.array(self.points)[order],
            segments=number[np.array(segments)],
            crack=np.array(crack),
            block=np.array(block),
            birth_cycle=np.zeros(len(crack), int),
            aperture=np.zeros(len(crack)),
            surface=np.array(self.surface)[order],
            names=self.names,
        )

    def _near_pairs(self) -> list[tuple[int, int]]:
        """Pairs of segments of one block whose boxes come within the tolerance, lower index first."""
        import shapely

        at = np.array(self.points)
        index = np.array(self.segments)
        a, b = at[index[:, 0]], at[index[:, 1]]
        low, high = np.minimum(a, b) - self.tolerance, np.maximum(a, b) + self.tolerance
        boxes = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
        i, j = shapely.STRtree(boxes).query(boxes, predicate="intersects")
        keep = (i < j) & (index[i, 3] == index[j, 3])
        return sorted(zip(i[keep].tolist(), j[keep].tolist()))

    def _join_ends(self, pairs, cuts) -> None:
        """Nodes that lie on another segment divide it. A free end is moved onto the segment, so that it stays
        straight."""
        ends = np.bincount(np.array(self.segments)[:, :2].ravel(), minlength=len(self.points))
        for pair in pairs:
            for i, j in (pair, pair[::-1]):
                a, b = self.segments[j][:2]
                for n in self.segments[i][:2]:
                    if n in (a, b):
                        continue
                    start, along = self.points[a], self.points[b] - self.points[a]
                    t = float((self.points[n] - start) @ along / (along @ along))
                    foot = start + t * along
                    if 0 < t < 1 and np.hypot(*(self.points[n] - foot)) <= self.tolerance:
                        cuts[j].add(n)
                        if ends[n] == 1 and not self.surface[n]:
                            self.points[n] = np.round(foot, self.decimals) + 0.0

    def _cross(self, pairs, cuts) -> None:
        for i, j in pairs:
            (a, b, crack, block), (c, d, other, _) = self.segments[i], self.segments[j]
            p, r = self.points[a], self.points[b] - self.points[a]
            q, s = self.points[c], self.points[d] - self.points[c]
            turn = r[0] * s[1] - r[1] * s[0]
            sizes = np.hypot(*r), np.hypot(*s)
            if abs(turn) <= self.tolerance * min(sizes):
                self._refuse_overlap(i, j, crack, other)
                continue
            if {a, b} & {c, d}:
                continue
            gap = q - p
            t, u = (gap[0] * s[1] - gap[1] * s[0]) / turn, (gap[0] * r[1] - gap[1] * r[0]) / turn
            if not (0 < t < 1 and 0 < u < 1):
                continue
            if (cuts[i] & {c, d}) or (cuts[j] & {a, b}):
                continue  # they meet at a node already
            n = self.node(np.round(p + t * r, self.decimals) + 0.0, block)
            for cut, near in ((cuts[i], (a, b)), (cuts[j], (c, d))):
                if n not in near:
                    cut.add(n)

    def _refuse_overlap(self, i: int, j: int, crack: int, other: int) -> None:
        """Refuse nearly parallel segments that coincide over more than the tolerance."""
        a, b = (self.points[n] for n in self.segments[i][:2])
        c, d = (self.points[n] for n in self.segments[j][:2])
        along = b - a
        length = np.hypot(*along)
        along = along / length
        t = np.array([(c - a) @ along, (d - a) @ along])
        off = np.abs([(c - a)[0] * along[1] - (c - a)[1] * along[0], (d - a)[0] * along[1] - (d - a)[1] * along[0]])
        common = min(length, t.max()) - max(0.0, t.min())
        if common > 2 * self.tolerance and off.min() <= self.tolerance:
            self._coincident(crack, other)

    def _coincident(self, crack: int, other: int) -> None:
        first, second = sorted((crack, other))
        if first == second:
            message = f"crack {self.names[first]!r} coincides with itself over part of its length"
        else:
            message = f"cracks {self.names[first]!r} and {self.names[second]!r} coincide over part of their length"
        flaw = Flaw("cracks", second, message, "keep one of them, or move them apart")
        if flaw not in self.flaws:
            self.flaws.append(flaw)
