"""Cutting of rock into blocks by joint traces: cleaned, noded, faces determined, dead ends kept as cracks.

Points closer than the tolerance are joined: ends stop on what they nearly reach, near corners become one, a trace that
nearly passes through a corner passes through it. Outlines stay in place; joints are moved. Repairs are reported with
their places. Cuts are exact otherwise: the blocks tile their zones.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...model import Blocks, Cracks
from ..assembly import TOLERANCE, block_names
from ..parts import JOINT, NOT_FINITE, Flaw, Joint, ShapeError, Zone, extent_of, finite, grid_decimals
from .noding import FREE, Drawn, Graph, Repair, noded
from .partings import Parting, partings, trace_lengths, trimmed_away
from .planar_arrangement import Arrangement, arrange, following_in, gathered

#: Two edges at a node continue straight if they turn by less than 5° (its cosine), allowing for hand-drawn traces.
_STRAIGHT_ON = 0.9962
#: Sides that turn by less than this, rad, are straight if rounding explains the turn.
_NO_TURN = 1e-5
#: A corner this many steps of the grid beside a side is on it. In turned models up to 40 were found; but where lines are
#: drawn at the finest angles, 56 steps are a bend.
_BESIDE = 20


@dataclass(frozen=True, eq=False)
class Cutting:
    """Result of cutting.

    zone      (n_blocks,)  zone of each block
    repairs                what was moved, joined or left out
    nodes                  {"I": n, "Y": n, "X": n}: ends in rock, junctions of three (T or Y), crossings of four joints
    partings               for the joints of every name, in their order
    """

    blocks: Blocks
    cracks: Cracks
    zone: np.ndarray
    repairs: tuple[Repair, ...]
    nodes: dict[str, int]
    partings: tuple[Parting, ...] = ()

    @property
    def mends(self) -> tuple[Repair, ...]:
        """Former name of ``repairs``."""
        warnings.warn("Cutting.mends is now Cutting.repairs", DeprecationWarning, stacklevel=2)
        return self.repairs


class _Rules(NamedTuple):
    """Arguments of `cut` that decide which edges are left out."""

    tolerance: float
    dead_ends: str
    shortest_crack: float
    smallest_area: float
    smallest_share: float
    lasting: int


def cut(
    zones: Sequence[Zone],
    joints: Sequence[Joint],
    *,
    tolerance: float | None = None,
    dead_ends: str = "cracks",
    shortest_crack: float = 0.0,
    smallest_area: float = 0.0,
    smallest_share: float = 0.0,
    lasting: int = 0,
) -> Cutting:
    """Cut ``zones`` along ``joints``.

    Joint ends in rock become cracks ("cracks") or are removed ("trim"); those shorter than ``shortest_crack`` (m) are
    always removed. Blocks smaller than ``smallest_area`` (m²), or than the ``smallest_share`` of the median block, are
    merged with a neighbour: of those with at least half the longest common side, the one across the least important
    joint; ``joints`` are listed by importance, and the first ``lasting`` ones are never removed for a small block. Only pieces thinner than the tolerance are merged across
    any of them. ``tolerance`` in m, default `TOLERANCE` of the largest side. Block edges have their zone's edge names
    and the joints' names. Raises ShapeError if a joint or zone has no length or area or is not finite, or if no
    position satisfies ``tolerance``.
    """
    _refuse_bad(zones, joints)
    every = [np.asarray(loop, dtype=float) for zone in zones for loop in zone.loops]
    origin = _origin(every)
    every = [loop - origin for loop in every]
    decimals = grid_decimals(every)
    tolerance = TOLERANCE * extent_of(every) if tolerance is None else float(tolerance)
    drawn = Drawn.of(zones, joints, origin, decimals)
    # Crossings have two digits more than the drawing: corners of blocks stay on the lines of their neighbours.
    decimals += 2
    repairs: list[Repair] = []
    rules = _Rules(tolerance, dead_ends, shortest_crack, smallest_area, smallest_share, lasting)
    grid = 10.0**-decimals
    graph = noded(drawn, tolerance, decimals, repairs)
    reach = None
    while True:
        arrangement = arrange(graph.nodes, graph.edges)
        zone = _zones_of(arrangement, graph.source >= drawn.n_outlines, zones, origin)
        if reach is None:
            reach = trace_lengths(graph, drawn, ~_outside(arrangement, zone))
        keep, stay = _kept(arrangement, graph, drawn, zone, rules, repairs)
        # Faces do not change, except those between which an edge is removed.
        bounds = (arrangement.left != arrangement.right) & ~_outside(arrangement, zone)
        if keep[bounds].all():
            break
        graph = graph.only(keep)
    repairs += stay
    if not keep.all():
        arrangement, graph = arrangement.only(keep), graph.only(keep)
    inside = np.flatnonzero(zone >= 0)
    if dead_ends == "trim":
        repairs += trimmed_away(drawn, reach, trace_lengths(graph, drawn, np.ones(len(graph.edges), bool)))
    cutting = trace_lengths(graph, drawn, ~arrangement.dead)
    cracks = _cracks(arrangement, graph, drawn, inside)
    blocks = _blocks(arrangement, drawn, graph.source, inside, [zones[z].name for z in zone[inside]], grid)
    if origin.any():
        blocks = blocks.with_vertices(blocks.vertices + origin)
        cracks = replace(cracks, nodes=cracks.nodes + origin)
        repairs = [repair._replace(x=repair.x + origin[0], y=repair.y + origin[1]) for repair in repairs]
    kind = _junctions(graph, drawn)
    repairs = _with_junctions(repairs, graph.nodes + origin, kind, tolerance)
    nodes = {name: int(np.isin(kind, kinds).sum()) for name, kinds in (("I", "I"), ("Y", ("T", "Y")), ("X", "X"))}
    return Cutting(
        blocks, cracks, zone[inside], tuple(repairs), nodes, partings(drawn, [j.name for j in joints], reach, cutting)
    )


def _origin(loops: Sequence[np.ndarray]) -> np.ndarray:
    """(2,) local origin: the drawing's own, or a round point in the rock if that is far away."""
    low, high = (
        np.min([loop.min(axis=0) for loop in loops], axis=0),
        np.max([loop.max(axis=0) for loop in loops], axis=0),
    )
    size = float((high - low).max())
    if np.abs([low, high]).max() <= 10 * size:
        return np.zeros(2)
    unit = 10.0 ** np.floor(np.log10(size))
    return np.round(0.5 * (low + high) / unit) * unit


def _refuse_bad(zones: Sequence[Zone], joints: Sequence[Joint]) -> None:
    flaws = []
    for k, zone in enumerate(zones):
        if not all(finite(loop).all() for loop in zone.loops):
            flaws.append(Flaw("zones", k, f"zone {zone.name!r} {NOT_FINITE}", "mend it"))
        elif any(len(loop) < 3 for loop in zone.loops):
            flaws.append(Flaw("zones", k, f"zone {zone.name!r} has a loop of fewer than three corners", "add corners"))
    for k, joint in enumerate(joints):
        if not joint.lines:
            continue
        points, count = np.concatenate(joint.lines), np.array([len(line) for line in joint.lines])
        first = np.cumsum(count) - count
        sound = np.logical_and.reduceat(finite(points), first)
        still = (np.maximum.reduceat(points, first, axis=0) == np.minimum.reduceat(points, first, axis=0)).all(axis=1)
        flaws += [Flaw("joints", k, f"joint {joint.name!r} {NOT_FINITE}", "mend it")] * int((~sound).sum())
        flaws += [
            Flaw("joints", k, f"joint {joint.name!r} has a trace without length", "give two different points")
        ] * int((sound & ((count < 2) | still)).sum())
    if flaws:
        raise ShapeError(flaws)


def _zones_of(arrangement: Arrangement, joint: np.ndarray, zones: Sequence[Zone], origin: np.ndarray) -> np.ndarray:
    """(n_faces,) zone of each face, −1 for none.

    Faces on either side of a ``joint`` edge (a mask) are in one zone: the largest face of each such cluster is
    examined.
    """
    import shapely
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = arrangement.n_faces
    if not n:
        return np.full(0, -1)
    left, right = arrangement.left, arrangement.right
    link = joint & (left >= 0) & (right >= 0) & (left != right)
    links = coo_array((np.ones(int(link.sum()), np.int8), (left[link], right[link])), shape=(n, n))
    n_clusters, cluster = connected_components(links, directed=False)
    order = np.lexsort((arrangement.areas_and_rims()[0], cluster))
    largest = order[np.searchsorted(cluster[order], np.arange(n_clusters), side="right") - 1]
    drawn = [[np.asarray(loop) - origin for loop in zone.loops] for zone in zones]
    shapes = [shapely.Polygon(loops[0], loops[1:]) for loops in drawn]
    out = np.full(n_clusters, -1)
    inside = shapely.point_on_surface(arrangement.polygons(largest))
    hit, zone = shapely.STRtree(shapes).query(inside, predicate="within")
    out[hit] = zone
    return out[cluster]


def _outside(arrangement: Arrangement, zone: np.ndarray) -> np.ndarray:
    """(n_edges,) True for edges without rock on either side."""
    side = np.append(zone, -1)  # face −1 is outside
    return (side[arrangement.left] < 0) & (side[arrangement.right] < 0)


def _kept(
    arrangement: Arrangement, graph: Graph, drawn: Drawn, zone: np.ndarray, rules: _Rules, repairs: list[Repair]
) -> tuple[np.ndarray, list[Repair]]:
    """(n_edges,) False for edges to be left out; and the small blocks that are kept.

    Left out are edges outside the rock, dead ends that are too short or unwanted, and a joint of blocks that are too
    small.
    """
    joint = graph.source >= drawn.n_outlines
    keep = ~(joint & _outside(arrangement, zone))
    dead = arrangement.dead & keep & joint
    if dead.any():
        shortest, reported = np.inf, []
        if rules.dead_ends != "trim":
            shortest, reported = max(rules.shortest_crack, rules.tolerance), repairs
        keep[_short_dead_ends(arrangement, dead, shortest, reported)] = False
    area, rim = arrangement.areas_and_rims()
    thin = 2 * area < rules.tolerance * rim
    rock = zone >= 0
    smallest = max(rules.smallest_area, rules.smallest_share * float(np.median(area[rock])) if rock.any() else 0.0)
    small = np.flatnonzero(rock & ((area < smallest) | thin))
    if not len(small):
        return keep, []
    return keep, _join_small(
        arrangement,
        graph,
        zone,
        keep,
        drawn.rank[graph.source],
        small,
        np.where(thin[small], 0, rules.lasting),
        repairs,
    )


def _join_small(arrangement: Arrangement, graph: Graph, zone, keep, rank, small, lasting, repairs) -> list[Repair]:
    """Remove the edges between each of the ``small`` faces and one neighbour from ``keep``; returns the faces that
    stay."""
    import shapely

    side = np.append(zone, -1)
    left, right = arrangement.left, arrangement.right
    span = np.hypot(*(graph.nodes[graph.edges[:, 1]] - graph.nodes[graph.edges[:, 0]]).T)
    inner = keep & (rank >= 0) & (side[left] == side[right]) & (left != right)
    # Edges of each small face, in order.
    number = np.full(arrangement.n_faces + 1, -1)
    number[small] = np.arange(len(small))
    edge = np.flatnonzero(inner & ((number[left] >= 0) | (number[right] >= 0)))
    owner = np.concatenate([number[left[edge]], number[right[edge]]])
    edge = np.concatenate([edge, edge])[owner >= 0]
    owner = owner[owner >= 0]
    order = np.lexsort((edge, owner))
    begin = np.searchsorted(owner[order], np.arange(len(small) + 1))
    edge = edge[order]
    shapes = arrangement.polygons(small)
    area = shapely.area(shapes)
    stay: list[Repair] = []
    for k in np.argsort(area).tolist():
        own = edge[begin[k] : begin[k + 1]]
        own = own[inner[own]]
        other = left[own] + right[own] - small[k]
        neighbours, which = np.unique(other, return_inverse=True)
        # The rank of a neighbour is that of the most important joint in between.
        between = np.full(len(neighbours), rank.max() + 1)
        np.minimum.at(between, which, rank[own])
        length = np.bincount(which, weights=span[own], minlength=len(neighbours))
        at = shapely.point_on_surface(shapes[k])
        may = between >= lasting[k]
        if not may.any():
            # A block that a neighbour has joined in this round is examined again in the next.
            stay += [Repair("small block kept", at.x, at.y, float(area[k]))]
            continue
        # Joined across a short side, a thin block would be a needle on its neighbour.
        may &= length >= 0.5 * length[may].max()
        best = neighbours[np.lexsort((length, between, may))[-1]]
        keep[own[other == best]] = inner[own[other == best]] = False
        repairs.append(Repair("sliver", at.x, at.y, float(area[k])))
    return stay


def _short_dead_ends(arrangement: Arrangement, dead: np.ndarray, shortest: float, repairs: list[Repair]) -> np.ndarray:
    """Indices of ``dead`` edges that are connected over less than ``shortest``."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    index = np.flatnonzero(dead)
    edges, nodes = arrangement.edges[index], arrangement.nodes
    ring = np.zeros(len(nodes), bool)
    ring[arrangement.edges[~arrangement.dead].ravel()] = True
    # Dead ends on either side of a block edge are not connected: a node on a ring counts once for each of its edges.
    rows, side = np.nonzero(~ring[edges])
    columns = edges[rows, side]
    incidence = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(index), len(nodes))).tocsr()
    label = connected_components(incidence @ incidence.T, directed=False)[1]
    ends = nodes[edges]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    total = np.bincount(label, weights=length)
    for part in np.flatnonzero(total < shortest):
        at = ends[label == part].mean(axis=(0, 1))
        repairs.append(Repair("dead end", float(at[0]), float(at[1]), float(total[part])))
    return index[total[label] < shortest]


def _cracks(arrangement: Arrangement, graph: Graph, drawn: Drawn, inside: np.ndarray) -> Cracks:
    """Dead ends as cracks: one per run of edges of one joint between ends, junctions and mouths."""
    block_of = np.full(arrangement.n_faces + 1, -1)
    block_of[inside] = np.arange(len(inside))
    dead = np.flatnonzero(arrangement.dead & (block_of[arrangement.left] >= 0))
    ring = np.zeros(len(graph.nodes), bool)
    ring[graph.edges[~arrangement.dead].ravel()] = True
    chains: list[tuple[int, list[int], int]] = []
    # Plain lists: traversed edge by edge, arrays would take most of the time.
    through, owner = (~ring).tolist(), block_of[arrangement.left].tolist()
    dead = dead[np.argsort(graph.source[dead], kind="stable")]
    for own in np.split(dead, np.flatnonzero(np.diff(graph.source[dead])) + 1) if len(dead) else ():
        source = int(graph.source[own[0]])
        ends = dict(zip(own.tolist(), graph.edges[own].tolist(), strict=True))
        at: dict[int, list[int]] = {}
        for e, pair in ends.items():
            for node in pair:
                at.setdefault(node, []).append(e)
        left = set(ends)
        # Ends first, so that every chain is traversed from one end to the other.
        for node in sorted(at, key=lambda k: (len(at[k]) == 2 and through[k], k)):
            for first in at[node]:
                if first not in left:
                    continue
                chain, e, here = [node], first, node
                while e is not None:
                    left.discard(e)
                    a, b = ends[e]
                    here = b if a == here else a
                    chain.append(here)
                    onward = [o for o in at[here] if o in left]
                    e = onward[0] if len(onward) == 1 and through[here] and len(at[here]) == 2 else None
                chains.append((source, chain, owner[first]))
    if not chains:
        return Cracks.from_polylines([], names=())
    count: Counter[str] = Counter()
    names = []
    for source, _, _ in chains:
        name = drawn.names[source].removeprefix(JOINT)
        count[name] += 1
        names.append(f"{name} {count[name]}")
    segments = np.array([pair for _, chain, _ in chains for pair in pairwise(chain)])
    used, flat = np.unique(segments.ravel(), return_inverse=True)
    lengths = [len(chain) - 1 for _, chain, _ in chains]
    crack = np.repeat(np.arange(len(chains)), lengths)
    return Cracks(
        nodes=graph.nodes[used],
        segments=flat.reshape(-1, 2),
        crack=crack,
        block=np.array([block for _, _, block in chains])[crack],
        birth_cycle=np.zeros(len(crack), int),
        aperture=np.zeros(len(crack)),
        surface=ring[used],
        names=tuple(names),
    )


def _within_sides(flat: np.ndarray, points: np.ndarray, start: np.ndarray, within: float) -> np.ndarray:
    """Of the corners ``flat`` (n,) of loops, those ``within`` m of the side that is left without them. A row of them, each of
    which hardly turns, may be a bend together: of each such row the farthest is kept, until none is farther."""
    flat, index, n = flat.copy(), np.arange(len(points)), len(points)
    loop = np.repeat(np.arange(len(start) - 1), np.diff(start))
    while flat.any():
        before, after = np.where(flat, -1, index), np.where(flat, n, index)
        last, first = np.maximum.reduceat(before, start[:-1]), np.minimum.reduceat(after, start[:-1])
        before, after = np.maximum.accumulate(before), np.minimum.accumulate(after[::-1])[::-1]
        before = np.where(before < start[loop], last[loop], before)[flat]
        after = np.where(after >= start[loop + 1], first[loop], after)[flat]
        side, way = points[after] - points[before], points[flat] - points[before]
        off = np.abs(side[:, 0] * way[:, 1] - side[:, 1] * way[:, 0]) / np.hypot(*side.T)
        beyond = np.flatnonzero(off > within)
        if not len(beyond):
            break
        farthest = beyond[np.lexsort((off[beyond], before[beyond]))]
        ends = np.append(before[farthest][1:] != before[farthest][:-1], True)
        flat[np.flatnonzero(flat)[farthest[ends]]] = False
    return flat


def _blocks(
    arrangement: Arrangement, drawn: Drawn, source: np.ndarray, inside: np.ndarray, zone_names: list[str], grid: float
) -> Blocks:
    block_loop, loops = gathered(arrangement.face_loop, inside)
    start, whole = gathered(arrangement.loop_start, loops)
    count = np.diff(start)
    known = sorted(set(drawn.names) | {""})
    number = {name: k for k, name in enumerate(known)}
    label = np.array([number[name] for name in drawn.names], dtype=int)[source[arrangement.loop_edge[whole]]]
    node = arrangement.loop_node[whole]
    points = arrangement.nodes[node]
    following = following_in(start)
    before = np.empty(len(points), int)
    before[following] = np.arange(len(points))
    a, b = points - points[before], points[following] - points
    off = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    short, long = np.sort([np.hypot(*a.T), np.hypot(*b.T)], axis=0)
    # A neighbour's corner on a straight side is not a corner of this block: it lies beside the side by what rounding of
    # ends, sides and crossings adds up to, and the side turns there by no more than that makes it turn.
    flat = (off <= np.minimum(_BESIDE * grid, _NO_TURN * short) * long) & (label == label[before])
    flat &= np.einsum("ij,ij->i", a, b) > 0
    # Where a hole touches the outline, both have the corner: beside the side that is left it might lie on either.
    of_block = np.repeat(np.repeat(np.arange(len(inside)), np.diff(block_loop)), count)
    _, corner, times = np.unique(of_block * len(arrangement.nodes) + node, return_inverse=True, return_counts=True)
    flat &= times[corner] == 1
    kept = np.flatnonzero(~_within_sides(flat, points, start, _BESIDE * grid))
    owner = np.repeat(np.arange(len(loops)), count)[kept]
    count = np.bincount(owner, minlength=len(loops))
    start = np.concatenate([[0], np.cumsum(count)])
    # From the lowest, then leftmost vertex on, independent of the order of the joints.
    lowest = np.lexsort((points[kept, 0], points[kept, 1], owner))[start[:-1]]
    place = np.arange(len(kept)) - start[owner] + (lowest - start[:-1])[owner]
    kept = kept[start[owner] + place % count[owner]]
    used, edge_name = np.unique(np.append(0, label[kept]), return_inverse=True)
    n_blocks = len(inside)
    return Blocks(
        vertices=points[kept],
        loop_start=start,
        block_loop=block_loop,
        material=np.zeros(n_blocks, int),
        fixed=np.zeros(n_blocks, bool),
        edge_name=edge_name[1:],
        edge_names=tuple(known[k] for k in used),
        names=tuple(block_names(zone_names)),
    )


def _junctions(graph: Graph, drawn: Drawn) -> np.ndarray:
    """(n_nodes,) junction of joints at each node off the outlines.

    "I" end, "V" bend or meeting of two ends, "T" one abuts another, "Y" three meet, "X" crossing; "E" for nodes on
    outlines.
    """
    joint = graph.source >= drawn.n_outlines
    edges = graph.edges[joint]
    n = len(graph.nodes)
    degree = np.bincount(edges.ravel(), minlength=n)
    kind = np.array(["", "I", "V", "Y", "X"])[np.minimum(degree, 4)]
    # If two of three edges form a line, the third abuts on it.
    node = np.concatenate([edges[:, 0], edges[:, 1]])
    away = graph.nodes[np.concatenate([edges[:, 1], edges[:, 0]])] - graph.nodes[node]
    away /= np.hypot(*away.T)[:, None]
    at = np.flatnonzero(degree[node] == 3)
    three = at[np.argsort(node[at], kind="stable")].reshape(-1, 3)
    a, b, c = away[three[:, 0]], away[three[:, 1]], away[three[:, 2]]
    straight = np.min([np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a))], axis=0)
    kind[node[three[:, 0]][straight < -_STRAIGHT_ON]] = "T"
    kind[graph.outline_of != FREE] = "E"
    return kind


def _with_junctions(repairs: list[Repair], nodes: np.ndarray, kind: np.ndarray, tolerance: float) -> list[Repair]:
    """``repairs`` with the junction at each place after the repair."""
    met = [k for k, repair in enumerate(repairs) if repair.kind in ("near miss", "near corners")]
    if met:
        from scipy.spatial import cKDTree

        away, node = cKDTree(nodes).query([(repairs[k].x, repairs[k].y) for k in met])
        for k, distance, there in zip(met, away.tolist(), node.tolist(), strict=True):
            if distance <= tolerance:
                repairs[k] = repairs[k]._replace(junction=str(kind[there]))
    return repairs
