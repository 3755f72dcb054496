"""Outlines and joint traces made a planar graph: crossings become nodes, whatever is nearer than the tolerance meets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .parts import Flaw, Joint, ShapeError, Zone

#: Moving one near-miss may make another; more rounds than this mean that the tolerance is as large as the blocks.
_ROUNDS = 20
#: What moves by less than this part of the tolerance moves by round-off, which is nobody's mistake.
_TOLD = 1e-4
FREE, CORNER = -1, -2


class Mend(NamedTuple):
    """Something near that was made to meet: ``kind`` "near corners", "near miss", "duplicate", "dead end", "sliver" or
    "outside"; where, m; ``size`` m (m² of a sliver)."""

    kind: str
    x: float
    y: float
    size: float


@dataclass(frozen=True, eq=False)
class Drawn:
    """All segments as drawn: outlines first. ``source`` counts polylines; joints from ``n_outlines`` on."""

    start: np.ndarray
    end: np.ndarray
    source: np.ndarray
    names: np.ndarray  # (n_sources,) of edges on each source
    n_outlines: int

    @classmethod
    def of(cls, zones: Sequence[Zone], joints: Sequence[Joint], origin: np.ndarray, decimals: int) -> Drawn:
        starts, ends, source, names = [], [], [], []
        for zone in zones:
            for k, loop in enumerate(zone.loops):
                loop = np.round(np.asarray(loop, dtype=float) - origin, decimals) + 0.0
                if (loop[0] == loop[-1]).all():
                    loop = loop[:-1]
                starts.append(loop)
                ends.append(np.roll(loop, -1, axis=0))
                own = zone.edge_names[k][: len(loop)] if zone.edge_names is not None else [""] * len(loop)
                # Every edge of an outline is a source of its own: its name differs.
                source.append(len(names) + np.arange(len(loop)))
                names += own
        n_outlines = len(names)
        for joint in joints:
            for line in joint.lines:
                line = np.round(np.asarray(line, dtype=float) - origin, decimals) + 0.0
                starts.append(line[:-1])
                ends.append(line[1:])
                source.append(np.full(len(line) - 1, len(names)))
                names.append(joint.name)
        start, end, source = np.concatenate(starts), np.concatenate(ends), np.concatenate(source)
        joint = source >= n_outlines
        start[joint], end[joint] = _clipped(start[joint], end[joint], start[~joint], decimals)
        long = (start != end).any(axis=1)
        return cls(start[long], end[long], source[long], np.array(names, dtype=object), n_outlines)


def _clipped(start: np.ndarray, end: np.ndarray, corners: np.ndarray, decimals: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments cut to a box a little larger than the rock: what lies outside need not be crossed."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = 0.01 * float((high - low).max())
    low, high = low - room, high + room
    along = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - start) / along, (high - start) / along
    # Along an axis the other coordinate is inside for good or never.
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
    """Noded: edges meet at nodes only. ``source`` (n_edges,) as in `Drawn`, the first where several lie on one another;
    ``home`` (n_nodes,) the outline edge (a source) that each node lies on, `FREE` off outlines, `CORNER` where two meet."""

    nodes: np.ndarray
    edges: np.ndarray
    source: np.ndarray
    home: np.ndarray

    def only(self, keep: np.ndarray) -> Graph:
        edges = self.edges[keep]
        used, flat = np.unique(edges.ravel(), return_inverse=True)
        return Graph(self.nodes[used], flat.reshape(-1, 2), self.source[keep], self.home[used])


def noded(drawn: Drawn, tolerance: float, decimals: int, mends: list[Mend]) -> Graph:
    start, end, source = drawn.start, drawn.end, drawn.source
    for _ in range(_ROUNDS):
        graph = _crossed(start, end, source, drawn.n_outlines, decimals, mends)
        moved, start, end, source = _met(graph, drawn.n_outlines, tolerance, 10.0 ** (3 - decimals), mends)
        if not moved:
            return graph
    raise ShapeError(
        [
            Flaw(
                "joints",
                0,
                f"things within {tolerance:g} m of one another do not come to rest",
                "take a smaller tolerance",
            )
        ]
    )


def _crossed(start, end, source, n_outlines, decimals, mends) -> Graph:
    """All crossings made nodes. What merely touches meets in `_met`."""
    one, other, t, u = _crossings(start, end, source < n_outlines, 10.0 ** (3 - decimals))
    at = np.round(start[one] + t[:, None] * (end[one] - start[one]), decimals) + 0.0
    n = len(start)
    segment = np.concatenate([np.arange(n), one, other, np.arange(n)])
    order = np.lexsort((np.concatenate([np.full(n, -1.0), t, u, np.full(n, 2.0)]), segment))
    points = np.concatenate([start, at, at, end])[order]
    nodes, node = _distinct(points)
    same = (segment[order][1:] == segment[order][:-1]) & (node[1:] != node[:-1])
    edges = np.sort(np.stack([node[:-1], node[1:]], axis=1)[same], axis=1)
    of = source[segment[order][:-1][same]]
    # The first source stands for an edge that several share: outlines before joints, joints as they are listed.
    rank = np.lexsort((of, edges[:, 1], edges[:, 0]))
    edges, of = edges[rank], of[rank]
    first = np.ones(len(edges), bool)
    first[1:] = (edges[1:] != edges[:-1]).any(axis=1)
    # Two joints on one another, or one on an outline; zones share outlines by right.
    again = np.unique(edges[~first & (of >= n_outlines)], axis=0)
    for p, q in nodes[again]:
        mends.append(Mend("duplicate", *(0.5 * (p + q)).tolist(), float(np.hypot(*(q - p)))))
    edges, of = edges[first], of[first]
    rim = np.flatnonzero(of < n_outlines)
    least, most = np.full(len(nodes), n_outlines), np.full(len(nodes), FREE)
    for side in (0, 1):
        np.minimum.at(least, edges[rim, side], of[rim])
        np.maximum.at(most, edges[rim, side], of[rim])
    return Graph(nodes, edges, of, np.where((most != FREE) & (least != most), CORNER, most))


def _distinct(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distinct rows of ``points`` (n, 2), by x, then y, and which of them each row is."""
    order = np.lexsort((points[:, 1], points[:, 0]))
    ranked = points[order]
    new = np.ones(len(points), bool)
    new[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    number = np.empty(len(points), int)
    number[order] = np.cumsum(new) - 1
    return ranked[new], number


def _crossings(start: np.ndarray, end: np.ndarray, outline: np.ndarray, roundoff: float):
    """Pairs of segments that cross inside both, and where along each (0 to 1): (one, other, t, u). Outlines that lie on one
    another but for ``roundoff`` m do not cross."""
    one, other = _near_pairs(start, end)
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
    # Straight lines from one point meet nowhere else, whatever round-off says.
    for a in (start, end):
        for b in (start, end):
            cross &= (a[one] != b[other]).any(axis=1)
    return one[cross], other[cross], t[cross], u[cross]


def _near_pairs(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of segments whose boxes meet, piece by piece: the box of a long slanting joint would hold half the rock."""
    import shapely

    along = end - start
    length = np.hypot(*along.T)
    area = max(float(np.prod(np.ptp(np.concatenate([start, end]), axis=0))), 1e-300)
    # Pieces as long as joints are apart on average meet a handful of others each.
    count = np.maximum(1, np.ceil(length * length.sum() / (2 * area)).astype(int))
    count = np.minimum(count, 1000)
    owner = np.repeat(np.arange(len(start)), count)
    k = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    a = start[owner] + (k / count[owner])[:, None] * along[owner]
    b = start[owner] + ((k + 1) / count[owner])[:, None] * along[owner]
    low, high = np.minimum(a, b), np.maximum(a, b)
    boxes = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
    i, j = shapely.STRtree(boxes).query(boxes)
    i, j = owner[i], owner[j]
    pairs = np.unique(i[i < j] * len(start) + j[i < j])
    return pairs // len(start), pairs % len(start)


def _met(graph: Graph, n_outlines: int, tolerance: float, roundoff: float, mends: list[Mend]):
    """Whether anything within ``tolerance`` of something else was made to meet it, and the segments after that."""
    import shapely
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    nodes, edges, source, home = graph.nodes.copy(), graph.edges, graph.source, graph.home
    n = len(nodes)
    settled = np.zeros(n, bool)
    pairs = cKDTree(nodes).query_pairs(tolerance, output_type="ndarray").reshape(-1, 2)
    # Corners stand still, what lies on an outline moves along it only.
    one, other = home[pairs[:, 0]], home[pairs[:, 1]]
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
        rank = np.lexsort((np.arange(n), home == FREE, home != CORNER, cluster))
        chief = rank[np.searchsorted(cluster[rank], np.arange(cluster.max() + 1))][cluster]
        follows = (home == FREE) | ((home >= 0) & ((home[chief] == home) | (home[chief] == CORNER)))
        follows |= np.hypot(*(nodes - nodes[chief]).T) <= roundoff
        for k in np.flatnonzero((chief != np.arange(n)) & follows):
            away = float(np.hypot(*(nodes[k] - graph.nodes[chief[k]])))
            if away > _TOLD * tolerance:
                mends.append(Mend("near corners", *graph.nodes[chief[k]].tolist(), away))
            nodes[k] = graph.nodes[chief[k]]
            settled[k] = settled[chief[k]] = True
        alive = (nodes[edges[:, 0]] != nodes[edges[:, 1]]).any(axis=1)
        edges, source = edges[alive], source[alive]
    firm = home != FREE
    merged = settled.any()
    tree = shapely.STRtree(shapely.linestrings(nodes[edges]))
    node, edge = tree.query(shapely.points(nodes), predicate="dwithin", distance=tolerance)
    near = ~(nodes[edges[edge]] == nodes[node][:, None]).all(axis=2).any(axis=1)
    outline = source[edge] < n_outlines
    # A node on an outline divides it wherever round-off has put it; other outlines are led through it only where it lies on
    # them, as a brick's corner does on the course below.
    apart = shapely.distance(shapely.points(nodes[node]), tree.geometries[edge]) > roundoff
    near &= ~(outline & firm[node] & (home[node] != source[edge]) & apart) & ~settled[node]
    degree = np.bincount(edges.ravel(), minlength=n)
    through: dict[int, list[int]] = {}
    for k, e in zip(node[near].tolist(), edge[near].tolist()):
        a, b = nodes[edges[e]]
        along = b - a
        foot = a + float((nodes[k] - a) @ along / (along @ along)) * along
        away = float(np.hypot(*(foot - nodes[k])))
        # Beside an end it is a matter of corners, which have met where they may.
        beside = min(float((foot - a) @ along), float((b - foot) @ along)) <= tolerance * float(np.hypot(*along))
        if settled[k] or beside:
            continue
        if not firm[k] and (source[e] < n_outlines or degree[k] == 1):
            nodes[k] = foot
            settled[k] = True
        # The edge is led through the node; one that has been moved onto it lies on it but for round-off.
        through.setdefault(e, []).append(k)
        if away > _TOLD * tolerance:
            mends.append(Mend("near miss", *nodes[k].tolist(), away))
    if not merged and not through:
        return False, None, None, None
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
    long = (start != end).any(axis=1)
    return True, start[long], end[long], source[long]
