"""The faces of a planar graph: half-edges, cycles, dead ends; arrays all the way, for hundreds of thousands of edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A planar straight-line graph and its faces.

    nodes      (n_nodes, 2)   m
    edges      (n_edges, 2)   node indices; edges meet at nodes only
    left, right (n_edges,)    the face on either side of each edge, −1 outside all; the same on both sides of a dead end
    loops      per face: the node indices of its outline (counter-clockwise), then of its holes (clockwise)
    loop_edges per face and loop: the edge that leaves each node along the loop
    faces      (n_faces,)      Shapely polygons
    """

    nodes: np.ndarray
    edges: np.ndarray
    left: np.ndarray
    right: np.ndarray
    loops: list[list[np.ndarray]]
    loop_edges: list[list[np.ndarray]]
    faces: np.ndarray

    @property
    def dead(self) -> np.ndarray:
        """(n_edges,) True for edges with one face on both sides: dead ends, lone traces, bridges between loops."""
        return self.left == self.right


def dead_ends(edges: np.ndarray, n_nodes: int) -> np.ndarray:
    """(n_edges,) True for edges that an end of degree one leads to, taken away again and again."""
    dead = np.zeros(len(edges), bool)
    degree = np.bincount(edges.ravel(), minlength=n_nodes)
    while True:
        loose = ~dead & (degree[edges] == 1).any(axis=1)
        if not loose.any():
            return dead
        dead |= loose
        degree -= np.bincount(edges[loose].ravel(), minlength=n_nodes)


def arrange(nodes: np.ndarray, edges: np.ndarray) -> Arrangement:
    """Faces of the graph with ``edges`` (n, 2) between ``nodes`` (n, 2), which must cross nowhere else and lie on one
    another nowhere."""
    ring = ~dead_ends(edges, len(nodes))
    ring[ring] = _in_rings(nodes, edges[ring])
    cycles, cycle_edges, of_half = _cycles(nodes, edges[ring])
    pinched = _pinched(cycles)
    numbers = np.flatnonzero(ring)
    area = _areas(nodes, cycles)
    outer = np.flatnonzero(area > 0)
    face_of_cycle = np.full(len(cycles), -1)
    face_of_cycle[outer] = np.arange(len(outer))
    loops = [[cycles[c]] for c in outer]
    loop_edges = [[numbers[cycle_edges[c]]] for c in outer]
    inner = np.flatnonzero(area < 0)
    if len(inner):
        # A rim larger than every face is the outer one of a cluster that lies in no face.
        small = inner[-area[inner] < area[outer].max()]
        around = np.full(len(inner), -1)
        if len(small):
            around[np.isin(inner, small)] = _faces_around(
                nodes, [loop[0] for loop in loops], area[outer], [cycles[c] for c in small]
            )
        face_of_cycle[inner] = around
        for c, face in zip(inner, around):
            if face >= 0:
                loops[face].append(cycles[c])
                loop_edges[face].append(numbers[cycle_edges[c]])
    for c in pinched:
        _unpinch(nodes, loops, loop_edges, face_of_cycle[c], cycles[c])
    left, right = np.full(len(edges), -1), np.full(len(edges), -1)
    half = face_of_cycle[of_half] if len(of_half) else np.empty(0, int)
    left[numbers], right[numbers] = half[0::2], half[1::2]
    faces = polygons(nodes, loops) if loops else np.empty(0, object)
    rest = np.flatnonzero(~ring)
    if len(rest):
        left[rest] = right[rest] = _faces_at(faces, nodes[edges[rest]].mean(axis=1))
    return Arrangement(nodes, edges, left, right, loops, loop_edges, faces)


def _faces_at(faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) the one of ``faces`` that holds each of ``points`` (n, 2), −1 for none."""
    import shapely

    out = np.full(len(points), -1)
    if len(faces):
        hit, face = shapely.STRtree(faces).query(shapely.points(points), predicate="within")
        out[hit] = face
    return out


def polygons(nodes: np.ndarray, loops: list[list[np.ndarray]]) -> np.ndarray:
    """(n_faces,) Shapely polygons."""
    import shapely

    flat = [loop for face in loops for loop in face]
    closed = np.concatenate([np.append(loop, loop[0]) for loop in flat])
    rings = shapely.linearrings(
        nodes[closed], indices=np.repeat(np.arange(len(flat)), [len(loop) + 1 for loop in flat])
    )
    return shapely.polygons(rings, indices=np.repeat(np.arange(len(loops)), [len(face) for face in loops]))


def _areas(nodes: np.ndarray, cycles: list[np.ndarray]) -> np.ndarray:
    """Signed area of every cycle, m², about its own first node."""
    if not cycles:
        return np.empty(0)
    count = np.array([len(c) for c in cycles])
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    points = nodes[np.concatenate(cycles)]
    own = points - np.repeat(points[start], count, axis=0)
    following = np.arange(1, len(own) + 1)
    following[start + count - 1] = start
    return 0.5 * np.add.reduceat(own[:, 0] * own[following, 1] - own[following, 0] * own[:, 1], start)


def _half_edges(nodes: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(origin of each half-edge, the half-edge that follows it round the face on its left); halves 2k and 2k + 1 are
    edge k forwards and backwards."""
    origin = edges.ravel()
    target = edges[:, ::-1].ravel()
    along = nodes[target] - nodes[origin]
    angle = np.arctan2(along[:, 1], along[:, 0])
    order = np.lexsort((angle, origin))
    place = np.empty(len(order), int)
    place[order] = np.arange(len(order))
    start = np.searchsorted(origin[order], np.arange(len(nodes) + 1))
    # Turning clockwise from the way back: the neighbour before the twin in the fan round the target.
    twin = np.arange(len(origin)) ^ 1
    before = place[twin] - 1
    before = np.where(before < start[target], start[target + 1] - 1, before)
    return origin, order[before]


def _labels(following: np.ndarray) -> np.ndarray:
    """The cycle that each half-edge belongs to."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    n = len(following)
    graph = csr_array((np.ones(n, np.int8), (np.arange(n), following)), shape=(n, n))
    return connected_components(graph, directed=False)[1]


def _in_rings(nodes: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(n,) False for edges that have the same cycle on both sides: bridges between rings."""
    if not len(edges):
        return np.zeros(0, bool)
    label = _labels(_half_edges(nodes, edges)[1])
    return label[0::2] != label[1::2]


def _cycles(nodes: np.ndarray, edges: np.ndarray):
    """Node indices and edges of every cycle of half-edges, and the cycle of each half-edge."""
    if not len(edges):
        return [], [], np.empty(0, int)
    origin, following = _half_edges(nodes, edges)
    step = following.tolist()
    label = [-1] * len(step)
    halves: list[list[int]] = []
    for first in range(len(step)):
        if label[first] >= 0:
            continue
        half, chain = first, []
        while label[half] < 0:
            label[half] = len(halves)
            chain.append(half)
            half = step[half]
        halves.append(chain)
    flat = np.concatenate(halves)
    ends = np.cumsum([len(chain) for chain in halves])[:-1]
    return np.split(origin[flat], ends), np.split(flat >> 1, ends), np.array(label)


def _pinched(cycles: list[np.ndarray]) -> np.ndarray:
    """Which cycles pass through a node twice."""
    if not cycles:
        return np.empty(0, int)
    owner = np.repeat(np.arange(len(cycles)), [len(c) for c in cycles])
    node = np.concatenate(cycles)
    order = np.lexsort((node, owner))
    owner, node = owner[order], node[order]
    return np.unique(owner[1:][(owner[1:] == owner[:-1]) & (node[1:] == node[:-1])])


def _unpinch(nodes, loops, loop_edges, face: int, cycle: np.ndarray) -> None:
    """Take the loop ``cycle`` of ``face``, which passes through a node twice, apart there: a hole may touch its outline or
    another hole at a corner, but is a loop of its own."""
    if face < 0:
        return
    at = next(k for k, loop in enumerate(loops[face]) if loop is cycle)
    own = loop_edges[face].pop(at)
    loops[face].pop(at)
    chain: list[tuple[int, int]] = []
    parts: list[list[tuple[int, int]]] = []
    where: dict[int, int] = {}
    for node, edge in zip(cycle.tolist(), own.tolist()):
        if node in where:
            parts.append(chain[where[node] :])
            for gone, _ in parts[-1]:
                where.pop(gone, None)
            del chain[len(chain) - len(parts[-1]) :]
        where[node] = len(chain)
        chain.append((node, edge))
    parts.append(chain)
    pieces = [np.array(part) for part in parts]
    area = _areas(nodes, [piece[:, 0] for piece in pieces])
    # The outline first: of all loops of a face it alone turns counter-clockwise.
    for k in np.argsort(-area):
        place = 0 if area[k] > 0 else len(loops[face])
        loops[face].insert(place, pieces[k][:, 0])
        loop_edges[face].insert(place, pieces[k][:, 1])


def _faces_around(nodes, outlines, areas, inner) -> np.ndarray:
    """(n_inner,) the smallest face whose outline holds each inner cycle (which is the outer rim of a cluster of faces), −1
    for none."""
    import shapely

    rings = polygons(nodes, [[outline] for outline in outlines])
    out = np.full(len(inner), -1)
    # The rim and the faces within it touch: another face holds the rim when it covers the rim's hull but not its faces.
    rims = polygons(nodes, [[cycle] for cycle in inner])
    hit, face = shapely.STRtree(rings).query(rims, predicate="within")
    rim_area = shapely.area(rims)
    for k, f in zip(hit, face):
        if areas[f] > rim_area[k] * (1 + 1e-9) and (out[k] < 0 or areas[f] < areas[out[k]]):
            out[k] = f
    return out
