"""Planar graph of outlines and joint traces: crossings become nodes, and parts closer than the tolerance are joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..parts import Flaw, Joint, ShapeError, Zone

#: Moving one near miss may create another; more rounds than this mean that the tolerance is as large as the blocks.
_ROUNDS = 20
#: Movements below this part of the tolerance are round-off and not reported.
_REPORTED = 1e-4
FREE, CORNER = -1, -2
#: Number of cells along a side of the coarse grid used to find the surroundings of changes.
_CELLS = 256


class Repair(NamedTuple):
    """A repaired defect: its ``kind``, its location (m), its ``size`` (m; m² for blocks), and the ``junction`` there
    now.

    "near corners"      ends, bends or crossings closer than the tolerance: made one, at a corner of an outline if there
                        is one
    "near miss"         an end or a crossing closer than the tolerance to a trace: an end is moved onto it, the trace is
                        led through a crossing
    "duplicate"         traces on one another: the first of them stays
    "dead end"          a trace that extends beyond its last crossing by less than the shortest crack: removed
    "trimmed away"      a trace of which nothing is left when dead ends are trimmed
    "sliver"            a block that is too small: merged with a neighbour across its least important long joint
    "small block kept"  one that only a drawn joint, or an outline, separates from its neighbours: kept
    """

    kind: str
    x: float
    y: float
    size: float
    junction: str = ""


@dataclass(frozen=True, eq=False)
class Drawn:
    """All segments as drawn: outlines first. ``source`` numbers polylines; those from ``n_outlines`` on are joints."""

    start: np.ndarray
    end: np.ndarray
    source: np.ndarray
    names: np.ndarray  # (n_sources,) of edges on each source
    rank: np.ndarray  # (n_sources,) number of its joint, −1 for outlines
    n_outlines: int

    @classmethod
    def of(cls, zones: Sequence[Zone], joints: Sequence[Joint], origin: np.ndarray, decimals: int) -> Drawn:
        starts, ends, sources = [], [], []
        names: list[str] = []
        for zone in zones:
            for k, loop in enumerate(zone.loops):
                loop = np.round(np.asarray(loop, dtype=float) - origin, decimals) + 0.0
                if (loop[0] == loop[-1]).all():
                    loop = loop[:-1]
                starts.append(loop)
                ends.append(np.roll(loop, -1, axis=0))
                own = zone.edge_names[k][: len(loop)] if zone.edge_names is not None else [""] * len(loop)
                # Every edge of an outline is a source of its own, because names differ.
                sources.append(len(names) + np.arange(len(loop)))
                names += own
        n_outlines = len(names)
        rank = [-1] * n_outlines
        for place, joint in enumerate(joints):
            count = np.array([len(line) for line in joint.lines], dtype=int)
            if not len(count):
                continue
            points = np.round(np.concatenate(joint.lines) - origin, decimals) + 0.0
            line = np.repeat(np.arange(len(count)), count)
            inside = line[1:] == line[:-1]
            starts.append(points[:-1][inside])
            ends.append(points[1:][inside])
            sources.append(len(names) + line[:-1][inside])
            names += [joint.name] * len(count)
            rank += [place] * len(count)
        start, end, source = np.concatenate(starts), np.concatenate(ends), np.concatenate(sources)
        of_joint = source >= n_outlines
        start[of_joint], end[of_joint] = _clipped(start[of_joint], end[of_joint], start[~of_joint], decimals)
        long = (start != end).any(axis=1)
        return cls(
            start[long], end[long], source[long], np.array(names, dtype=object), np.array(rank, dtype=int), n_outlines
        )


def _clipped(start: np.ndarray, end: np.ndarray, corners: np.ndarray, decimals: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments clipped to a box slightly larger than the rock: crossings outside are not needed."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = 0.01 * float((high - low).max())
    low, high = low - room, high + room
    along = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - start) / along, (high - start) / along
    # Parallel to an axis, the other coordinate is always or never inside.
    level = along == 0
    outside = (level & ((start < low) | (start > high))).any(axis=1)
    enter = np.where(level, -np.inf, np.minimum(first, second)).max(axis=1).clip(0, 1)
    leave = np.where(level, np.inf, np.maximum(first, second)).min(axis=1).clip(0, 1)
    outside |= enter >= leave
    new_start = np.where((enter > 0)[:, None], np.round(start + enter[:, None] * along, decimals) + 0.0, start)
    new_end = np.where((leave < 1)[:, None], np.round(start + leave[:, None] * along, decimals) + 0.0, end)
    return np.where(outside[:, None], start, new_start), np.where(outside[:, None], start, new_end)


@dataclass(frozen=True, eq=False)
class Graph:
    """Noded graph: edges meet at nodes only.

    source   (n_edges,) as in `Drawn`, the first if several coincide
    home     (n_nodes,) outline edge (a source) on which each node lies, `FREE` off outlines, `CORNER` where two meet
    """

    nodes: np.ndarray
    edges: np.ndarray
    source: np.ndarray
    outline_of: np.ndarray

    def only(self, keep: np.ndarray) -> Graph:
        edges = self.edges[keep]
        used, flat = np.unique(edges.ravel(), return_inverse=True)
        return Graph(self.nodes[used], flat.reshape(-1, 2), self.source[keep], self.outline_of[used])


def noded(drawn: Drawn, tolerance: float, decimals: int, repairs: list[Repair]) -> Graph:
    """The graph of ``drawn`` with everything within ``tolerance`` (m) joined; repairs are added to ``repairs``."""
    start, end = _ends_on_outlines(drawn, decimals)
    source = drawn.source
    # Parts unchanged since the previous round are not examined again.
    fresh = np.ones(len(start), bool)
    for _ in range(_ROUNDS):
        graph, fresh = _crossed(start, end, source, fresh, drawn.n_outlines, decimals, repairs)
        moved = _met(graph, fresh, drawn.n_outlines, tolerance, 10.0 ** (3 - decimals), repairs)
        if moved is None:
            return graph
        start, end, source, fresh = moved
    raise ShapeError(
        [
            Flaw(
                "joints",
                0,
                f"joining everything within {tolerance:g} m does not converge",
                "take a smaller tolerance",
            )
        ]
    )


def _ends_on_outlines(drawn: Drawn, decimals: int) -> tuple[np.ndarray, np.ndarray]:
    """Start and end of all segments; the ends of joints that are no farther from an outline than the drawing is rounded
    to, two ``decimals`` less, are on it. Moved later, they would bend the joint at its crossings."""
    import shapely

    start, end = drawn.start.copy(), drawn.end.copy()
    of_joint = drawn.source >= drawn.n_outlines
    a, b = start[~of_joint], end[~of_joint]
    outlines = shapely.STRtree(shapely.linestrings(np.stack([a, b], axis=1)))
    for ends in (start, end):
        at = np.flatnonzero(of_joint)
        near, edge = outlines.query(shapely.points(ends[at]), predicate="dwithin", distance=10.0 ** (2 - decimals))
        at, one = np.unique(at[near], return_index=True)
        edge = edge[one]
        along = b[edge] - a[edge]
        t = np.sum((ends[at] - a[edge]) * along, axis=1) / np.sum(along * along, axis=1)
        inside = (t > 0) & (t < 1)
        ends[at[inside]] = np.round(a[edge] + t[:, None] * along, decimals)[inside] + 0.0
    return start, end


def _crossed(start, end, source, fresh, n_outlines, decimals, repairs) -> tuple[Graph, np.ndarray]:
    """All crossings made nodes, and which edges belong to ``fresh`` segments. Touching parts are joined in `_met`."""
    one, other, t, u = _crossings(start, end, source < n_outlines, fresh, 10.0 ** (3 - decimals))
    at = np.round(start[one] + t[:, None] * (end[one] - start[one]), decimals) + 0.0
    n = len(start)
    fresh = fresh.copy()
    fresh[one] = fresh[other] = True
    segment = np.concatenate([np.arange(n), one, other, np.arange(n)])
    order = np.lexsort((np.concatenate([np.full(n, -1.0), t, u, np.full(n, 2.0)]), segment))
    nodes, node = _distinct(np.concatenate([start, at, at, end])[order])
    segment = segment[order]
    same = (segment[1:] == segment[:-1]) & (node[1:] != node[:-1])
    edges = np.sort(np.stack([node[:-1], node[1:]], axis=1)[same], axis=1)
    segment = segment[:-1][same]
    of, new = source[segment], fresh[segment]
    # The first source represents an edge shared by several: outlines before joints, joints as listed.
    key = edges[:, 0] * len(nodes) + edges[:, 1]
    rank = np.lexsort((of, key))
    key, edges, of, new = key[rank], edges[rank], of[rank], new[rank]
    first = np.ones(len(edges), bool)
    first[1:] = key[1:] != key[:-1]
    # Two coinciding joints, or a joint on an outline; zones may share outlines.
    again = np.unique(edges[~first & (of >= n_outlines)], axis=0)
    for p, q in nodes[again]:
        x, y = (0.5 * (p + q)).tolist()
        repairs.append(Repair("duplicate", x, y, float(np.hypot(*(q - p)))))
    new = np.logical_or.reduceat(new, np.flatnonzero(first))
    edges, of = edges[first], of[first]
    rim = np.flatnonzero(of < n_outlines)
    least, most = np.full(len(nodes), n_outlines), np.full(len(nodes), FREE)
    for side in (0, 1):
        np.minimum.at(least, edges[rim, side], of[rim])
        np.maximum.at(most, edges[rim, side], of[rim])
    return Graph(nodes, edges, of, np.where((most != FREE) & (least != most), CORNER, most)), new


def _distinct(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distinct rows of ``points`` (n, 2), sorted by x, then y, and the number of each row among them."""
    order = np.lexsort((points[:, 1], points[:, 0]))
    ranked = points[order]
    new = np.ones(len(points), bool)
    new[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    number = np.empty(len(points), int)
    number[order] = np.cumsum(new) - 1
    return ranked[new], number


def _crossings(start: np.ndarray, end: np.ndarray, outline: np.ndarray, fresh: np.ndarray, roundoff: float):
    """Pairs of segments, at least one of them ``fresh``, that cross inside both, and the position along each (0 to 1).

    Returns (one, other, t, u). Outlines that coincide to within ``roundoff`` (m) do not cross.
    """
    one, other = _near_pairs(start, end, fresh)
    p, r = start[one], end[one] - start[one]
    q, s = start[other], end[other] - start[other]
    turn = r[:, 0] * s[:, 1] - r[:, 1] * s[:, 0]
    gap = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (gap[:, 0] * s[:, 1] - gap[:, 1] * s[:, 0]) / turn
        u = (gap[:, 0] * r[:, 1] - gap[:, 1] * r[:, 0]) / turn
        # Comparisons with the nan of parallel lines are False.
        cross = (t > 0) & (t < 1) & (u > 0) & (u < 1)
        away = np.maximum(np.abs(gap[:, 0] * r[:, 1] - gap[:, 1] * r[:, 0]),
                          np.abs((gap + s)[:, 0] * r[:, 1] - (gap + s)[:, 1] * r[:, 0]))  # fmt: skip
        cross &= ~(outline[one] & outline[other] & (away <= roundoff * np.hypot(*r.T)))
    # Straight lines from one point meet nowhere else, despite round-off.
    for a in (start, end):
        for b in (start, end):
            cross &= (a[one] != b[other]).any(axis=1)
    return one[cross], other[cross], t[cross], u[cross]


def _near_pairs(start: np.ndarray, end: np.ndarray, fresh: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of segments, one of them ``fresh``, whose boxes intersect, piece by piece: the box of a long inclined joint
    would contain half the rock."""
    import shapely

    along = end - start
    length = np.hypot(*along.T)
    area = max(float(np.prod(np.ptp(np.concatenate([start, end]), axis=0))), 1e-300)
    # Pieces as long as the mean spacing of joints intersect a few others each.
    count = np.maximum(1, np.ceil(length * length.sum() / (2 * area)).astype(int))
    count = np.minimum(count, 1000)
    owner = np.repeat(np.arange(len(start)), count)
    k = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    a = start[owner] + (k / count[owner])[:, None] * along[owner]
    b = start[owner] + ((k + 1) / count[owner])[:, None] * along[owner]
    low, high = np.minimum(a, b), np.maximum(a, b)
    near = _vicinity(low, high, fresh[owner], 0.0)
    low, high, owner = low[near], high[near], owner[near]
    boxes = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
    new = np.flatnonzero(fresh[owner])
    i, j = shapely.STRtree(boxes[new]).query(boxes)
    i, j = owner[i], owner[new[j]]
    pairs = np.sort((np.minimum(i, j) * len(start) + np.maximum(i, j))[i != j])
    pairs = pairs[np.diff(pairs, prepend=-1) > 0]
    return pairs // len(start), pairs % len(start)


def _vicinity(low: np.ndarray, high: np.ndarray, fresh: np.ndarray, margin: float) -> np.ndarray:
    """Indices of the boxes from ``low`` to ``high`` (n, 2) that may be within ``margin`` of a ``fresh`` one: those that
    share a cell of a coarse grid with one."""
    if fresh.all() or not fresh.any():
        return np.flatnonzero(fresh)
    corner = low.min(axis=0)
    cell = max(float((high - corner).max()) / _CELLS, 1e-300)
    first, last = ((low - margin - corner) / cell).astype(int), ((high + margin - corner) / cell).astype(int)
    first, last = first.clip(0, _CELLS), last.clip(0, _CELLS)
    # Every box adds one to its cells: at its corners first, everywhere after summing along both axes.
    marks = np.zeros((_CELLS + 2, _CELLS + 2), int)
    (a, b), (c, d) = first[fresh].T, last[fresh].T + 1
    for rows, columns, sign in ((a, b, 1), (c, d, 1), (a, d, -1), (c, b, -1)):
        np.add.at(marks, (rows, columns), sign)
    marked = np.cumsum(np.cumsum(marks, axis=0), axis=1) > 0
    total = np.zeros((_CELLS + 3, _CELLS + 3), int)
    total[1:, 1:] = np.cumsum(np.cumsum(marked, axis=0), axis=1)
    (a, b), (c, d) = first.T, last.T + 1
    return np.flatnonzero(total[c, d] - total[a, d] - total[c, b] + total[a, b])


def _met(graph: Graph, fresh: np.ndarray, n_outlines: int, tolerance: float, roundoff: float, repairs: list[Repair]):
    """Segments (start, end, source, fresh) after joining everything within ``tolerance``; None if nothing was joined.

    Edges that are not ``fresh`` have been examined before.
    """
    import shapely
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    nodes, edges, source, outline_of = graph.nodes.copy(), graph.edges, graph.source, graph.outline_of
    n = len(nodes)
    settled = np.zeros(n, bool)
    pairs = cKDTree(nodes).query_pairs(tolerance, output_type="ndarray").reshape(-1, 2)
    # Corners do not move; points on an outline move along it only.
    one, other = outline_of[pairs[:, 0]], outline_of[pairs[:, 1]]
    pairs = pairs[
        (one == FREE)
        | (other == FREE)
        | ((one != other) & ((one == CORNER) | (other == CORNER)))
        | ((one == other) & (one >= 0))
        # One corner, crossed by another outline a digit away.
        | (np.hypot(*(nodes[pairs[:, 1]] - nodes[pairs[:, 0]]).T) <= roundoff)
    ]
    if len(pairs):
        links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
        cluster = connected_components(links, directed=False)[1]
        rank = np.lexsort((np.arange(n), outline_of == FREE, outline_of != CORNER, cluster))
        representative = rank[np.searchsorted(cluster[rank], np.arange(cluster.max() + 1))][cluster]
        follows = (outline_of == FREE) | (
            (outline_of >= 0) & ((outline_of[representative] == outline_of) | (outline_of[representative] == CORNER))
        )
        follows |= np.hypot(*(nodes - nodes[representative]).T) <= roundoff
        for k in np.flatnonzero((representative != np.arange(n)) & follows):
            away = float(np.hypot(*(nodes[k] - graph.nodes[representative[k]])))
            if away > _REPORTED * tolerance:
                x, y = graph.nodes[representative[k]].tolist()
                repairs.append(Repair("near corners", x, y, away))
            nodes[k] = graph.nodes[representative[k]]
            settled[k] = settled[representative[k]] = True
        alive = (nodes[edges[:, 0]] != nodes[edges[:, 1]]).any(axis=1)
        edges, source, fresh = edges[alive], source[alive], fresh[alive]
    on_outline = outline_of != FREE
    merged = settled.any()
    fresh = fresh | settled[edges].any(axis=1)
    node, edge = _near_edges(nodes, edges, np.flatnonzero(~settled), fresh, tolerance)
    near = ~(nodes[edges[edge]] == nodes[node][:, None]).all(axis=2).any(axis=1)
    # A node on an outline divides it wherever round-off has put it; other outlines are led through it only if it lies
    # on them, as a brick's corner does on the course below.
    foreign = np.flatnonzero((source[edge] < n_outlines) & on_outline[node] & (outline_of[node] != source[edge]))
    lines = shapely.linestrings(nodes[edges[edge[foreign]]])
    near[foreign] &= shapely.distance(shapely.points(nodes[node[foreign]]), lines) <= roundoff
    degree = np.bincount(edges.ravel(), minlength=n)
    through: dict[int, list[int]] = {}
    for k, e in zip(node[near].tolist(), edge[near].tolist()):
        a, b = nodes[edges[e]]
        along = b - a
        foot = a + float((nodes[k] - a) @ along / (along @ along)) * along
        away = float(np.hypot(*(foot - nodes[k])))
        # Near an end, corners are concerned, which have been joined where possible.
        near_end = min(float((foot - a) @ along), float((b - foot) @ along)) <= tolerance * float(np.hypot(*along))
        if settled[k] or near_end:
            continue
        if not on_outline[k] and (source[e] < n_outlines or degree[k] == 1):
            nodes[k] = foot
            settled[k] = True
        # The edge is led through the node; a node that has been moved onto it lies on it to round-off.
        through.setdefault(e, []).append(k)
        if away > _REPORTED * tolerance:
            x, y = nodes[k].tolist()
            repairs.append(Repair("near miss", x, y, away))
    if not merged and not through:
        return None
    return _led_through(nodes, edges, source, settled, through)


def _led_through(
    nodes: np.ndarray, edges: np.ndarray, source: np.ndarray, settled: np.ndarray, through: dict[int, list[int]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Segments (start, end, source, fresh) of ``edges``, some led ``through`` nodes (edge → nodes).

    Those with a ``settled`` node are fresh.
    """
    starts, ends, sources = [], [], []
    whole = np.ones(len(edges), bool)
    whole[list(through)] = False
    for e, on in through.items():
        a, b = edges[e]
        along = nodes[b] - nodes[a]
        chain = [a, *sorted(set(on), key=lambda k: float((nodes[k] - nodes[a]) @ along)), b]
        starts += [nodes[k] for k in chain[:-1]]
        ends += [nodes[k] for k in chain[1:]]
        sources += [source[e]] * (len(chain) - 1)
    start = np.concatenate([nodes[edges[whole, 0]], np.reshape(starts, (-1, 2))])
    end = np.concatenate([nodes[edges[whole, 1]], np.reshape(ends, (-1, 2))])
    source = np.concatenate([source[whole], np.array(sources, dtype=int)])
    fresh = np.concatenate([settled[edges[whole]].any(axis=1), np.ones(len(sources), bool)])
    long = (start != end).any(axis=1)
    return start[long], end[long], source[long], fresh[long]


def _near_edges(
    nodes: np.ndarray, edges: np.ndarray, wanted: np.ndarray, fresh: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """``wanted`` nodes and edges within ``tolerance`` that do not end there: (node, edge).

    At least one of them belongs to ``fresh``, a mask of edges.
    """
    import shapely

    ends = nodes[edges]
    # A node near a fresh edge may have another edge near it.
    local = _vicinity(ends.min(axis=1), ends.max(axis=1), fresh, 2 * tolerance)
    around = np.zeros(len(nodes), bool)
    around[edges[local].ravel()] = True
    wanted = wanted[around[wanted]]
    node, edge = shapely.STRtree(shapely.linestrings(ends[local])).query(
        shapely.points(nodes[wanted]), predicate="dwithin", distance=tolerance
    )
    node, edge = wanted[node], local[edge]
    other = (edges[edge] != node[:, None]).all(axis=1)
    return node[other], edge[other]
