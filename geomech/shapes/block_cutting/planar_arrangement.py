"""Faces of a planar graph: half-edges, cycles, dead ends; with arrays throughout, for hundreds of thousands of
edges."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A planar straight-line graph and its faces.

    nodes      (n_nodes, 2)   m
    edges      (n_edges, 2)   node indices; edges meet at nodes only
    left, right (n_edges,)    face on either side of each edge, −1 outside all; equal on both sides of a dead end
    loop_node  (n,)           nodes of all loops, loop after loop, face after face: of each face the outline
                              (counter-clockwise), then its holes (clockwise)
    loop_edge  (n,)           the edge that leaves each of them along the loop
    loop_start (n_loops + 1,) start of each loop
    face_loop  (n_faces + 1,) first loop of each face
    """

    nodes: np.ndarray
    edges: np.ndarray
    left: np.ndarray
    right: np.ndarray
    loop_node: np.ndarray
    loop_edge: np.ndarray
    loop_start: np.ndarray
    face_loop: np.ndarray

    @property
    def n_faces(self) -> int:
        return len(self.face_loop) - 1

    @property
    def dead(self) -> np.ndarray:
        """(n_edges,) True for edges with the same face on both sides: dead ends, lone traces, bridges between loops."""
        return self.left == self.right

    def areas_and_rims(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_faces,) m² area; (n_faces,) m length of all loops of each face."""
        if not self.n_faces:
            return np.empty(0), np.empty(0)
        first = self.loop_start[self.face_loop[:-1]]
        step = self.nodes[self.loop_node[following_in(self.loop_start)]] - self.nodes[self.loop_node]
        rim = np.add.reduceat(np.hypot(step[:, 0], step[:, 1]), first)
        return np.add.reduceat(_areas(self.nodes, self.loop_node, self.loop_start), self.face_loop[:-1]), rim

    def polygons(self, faces: np.ndarray | None = None) -> np.ndarray:
        """(n_faces,) Shapely polygons; only of ``faces`` if given."""
        if faces is None:
            return _polygons(self.nodes, self.loop_node, self.loop_start, self.face_loop)
        loop_start, loops = gathered(self.face_loop, faces)
        start, flat = gathered(self.loop_start, loops)
        return _polygons(self.nodes, self.loop_node[flat], start, loop_start)

    def only(self, keep: np.ndarray) -> Arrangement:
        """Without the edges outside ``keep`` (a mask), and without isolated nodes.

        The removed edges must be dead ends, or bound faces that are no longer used: the other faces do not change.
        """
        used, flat = np.unique(self.edges[keep].ravel(), return_inverse=True)
        node, edge = np.full(len(self.nodes), -1), np.cumsum(keep) - 1
        node[used] = np.arange(len(used))
        return replace(
            self,
            nodes=self.nodes[used],
            edges=flat.reshape(-1, 2),
            left=self.left[keep],
            right=self.right[keep],
            loop_node=node[self.loop_node],
            loop_edge=edge[self.loop_edge],
        )


def dead_ends(edges: np.ndarray, n_nodes: int) -> np.ndarray:
    """(n_edges,) True for edges at nodes of degree one, removed repeatedly."""
    dead = np.zeros(len(edges), bool)
    degree = np.bincount(edges.ravel(), minlength=n_nodes)
    while True:
        loose = ~dead & (degree[edges] == 1).any(axis=1)
        if not loose.any():
            return dead
        dead |= loose
        degree -= np.bincount(edges[loose].ravel(), minlength=n_nodes)


def arrange(nodes: np.ndarray, edges: np.ndarray) -> Arrangement:
    """Faces of the graph with ``edges`` (n, 2) between ``nodes`` (n, 2); edges must neither cross nor coincide."""
    ring = ~dead_ends(edges, len(nodes))
    origin, following, first = _traced(nodes, edges[ring])
    # An edge with the same cycle on both sides is a bridge between rings.
    bridge = first[0::2] == first[1::2]
    if bridge.any():
        ring[ring] = ~bridge
        origin, following, first = _traced(nodes, edges[ring])
    numbers = np.flatnonzero(ring)
    halves, start, cycle = _cycles(following, first)
    node, edge = origin[halves], numbers[halves >> 1]
    area = _areas(nodes, node, start)
    outer, inner = np.flatnonzero(area > 0), np.flatnonzero(area < 0)
    face_of_cycle = np.full(len(area), -1)
    face_of_cycle[outer] = np.arange(len(outer))
    if len(inner):
        # An outer rim not inside any face bounds a cluster.
        small = inner[-area[inner] < area[outer].max()]
        if len(small):
            face_of_cycle[small] = _faces_around(nodes, node, start, area, outer, small)
    loop_node, loop_edge, loop_start, face_loop = _loops(nodes, node, edge, start, face_of_cycle, outer, inner)
    left, right = np.full(len(edges), -1), np.full(len(edges), -1)
    half = face_of_cycle[cycle]
    left[numbers], right[numbers] = half[0::2], half[1::2]
    rest = np.flatnonzero(~ring)
    if len(rest) and len(outer):
        faces = _polygons(nodes, loop_node, loop_start, face_loop)
        left[rest] = right[rest] = _faces_at(faces, nodes[edges[rest]].mean(axis=1))
    return Arrangement(nodes, edges, left, right, loop_node, loop_edge, loop_start, face_loop)


def _loops(nodes, node, edge, start, face_of_cycle, outer, inner):
    """The cycles of each face combined: (loop_node, loop_edge, loop_start, face_loop) of an `Arrangement`."""
    holes = inner[face_of_cycle[inner] >= 0]
    pinched = _pinched(node, start)
    pinched = pinched[face_of_cycle[pinched] >= 0]
    order = np.concatenate([outer, holes])
    order = order[np.argsort(face_of_cycle[order], kind="stable")]
    if len(pinched):
        # The few faces with a loop that touches itself are assembled one by one.
        special = np.unique(face_of_cycle[pinched])
        is_special = np.isin(face_of_cycle[order], special)
        loops: dict[int, list[np.ndarray]] = {int(face): [] for face in special}
        for c in order[is_special].tolist():
            loops[int(face_of_cycle[c])].append(_pairs(node, edge, start, c))
        for c in pinched.tolist():
            _unpinch(nodes, loops[int(face_of_cycle[c])], _pairs(node, edge, start, c))
        order = order[~is_special]
        begin, flat = gathered(start, order)
        extra = [(face, loop) for face, own in loops.items() for loop in own]
        pairs = np.concatenate([np.stack([node[flat], edge[flat]], axis=1), *(loop for _, loop in extra)])
        begin = np.concatenate([begin, begin[-1] + np.cumsum([len(loop) for _, loop in extra])])
        face = np.concatenate([face_of_cycle[order], [face for face, _ in extra]]).astype(int)
        node, edge, start = pairs[:, 0], pairs[:, 1], begin
        order = np.argsort(face, kind="stable")
        face = face[order]
    else:
        face = face_of_cycle[order]
    loop_start, flat = gathered(start, order)
    face_loop = np.searchsorted(face, np.arange(len(outer) + 1))
    return node[flat], edge[flat], loop_start, face_loop


def _pairs(node: np.ndarray, edge: np.ndarray, start: np.ndarray, cycle: int) -> np.ndarray:
    own = slice(start[cycle], start[cycle + 1])
    return np.stack([node[own], edge[own]], axis=1)


def _faces_at(faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) the one of ``faces`` that contains each of ``points`` (n, 2), −1 for none."""
    import shapely

    out = np.full(len(points), -1)
    hit, face = shapely.STRtree(faces).query(shapely.points(points), predicate="within")
    out[hit] = face
    return out


def gathered(start: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For runs that begin at ``start`` (n + 1,): the ``chosen`` (m,) ones one after the other.

    Returns their starts (m + 1,) and the former position of each member.
    """
    count = np.diff(start)[chosen]
    begin = np.concatenate([[0], np.cumsum(count)])
    return begin, np.arange(begin[-1]) + np.repeat(start[chosen] - begin[:-1], count)


def following_in(start: np.ndarray) -> np.ndarray:
    """Position after each position of the closed runs that begin at ``start`` (n + 1,)."""
    following = np.arange(1, start[-1] + 1)
    following[start[1:] - 1] = start[:-1]
    return following


def _polygons(nodes: np.ndarray, node: np.ndarray, start: np.ndarray, face_loop: np.ndarray) -> np.ndarray:
    """(n_faces,) Shapely polygons."""
    import shapely

    if len(face_loop) < 2:
        return np.empty(0, object)
    rings = shapely.linearrings(nodes[node], indices=np.repeat(np.arange(len(start) - 1), np.diff(start)))
    return shapely.polygons(rings, indices=np.repeat(np.arange(len(face_loop) - 1), np.diff(face_loop)))


def _areas(nodes: np.ndarray, node: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Signed area of every closed run of nodes, m², relative to its first node."""
    if len(start) < 2:
        return np.empty(0)
    points = nodes[node]
    own = points - np.repeat(points[start[:-1]], np.diff(start), axis=0)
    to = own[following_in(start)]
    return 0.5 * np.add.reduceat(own[:, 0] * to[:, 1] - to[:, 0] * own[:, 1], start[:-1])


def _half_edges(nodes: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(origin of each half-edge, the next half-edge around the face on its left); halves 2k and 2k + 1 are edge k
    forwards and backwards."""
    origin = edges.ravel()
    target = edges[:, ::-1].ravel()
    along = nodes[target] - nodes[origin]
    angle = np.arctan2(along[:, 1], along[:, 0])
    order = np.lexsort((angle, origin))
    place = np.empty(len(order), int)
    place[order] = np.arange(len(order))
    start = np.searchsorted(origin[order], np.arange(len(nodes) + 1))
    # Clockwise from the reverse direction: the neighbour before the twin in the fan around the target.
    twin = np.arange(len(origin)) ^ 1
    before = place[twin] - 1
    before = np.where(before < start[target], start[target + 1] - 1, before)
    return origin, order[before]


def _first_of_cycle(following: np.ndarray) -> np.ndarray:
    """(n,) smallest member of the cycle of each half-edge, by pointer doubling."""
    least, leap = np.arange(len(following)), following
    while True:
        lower = np.minimum(least, least[leap])
        # A step that shows no smaller member has been all the way round.
        if (lower == least).all():
            return least
        least, leap = lower, leap[leap]


def _traced(nodes: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each half-edge: its origin, the next one, and the smallest one of its cycle."""
    if not len(edges):
        return np.empty(0, int), np.empty(0, int), np.empty(0, int)
    origin, following = _half_edges(nodes, edges)
    return origin, following, _first_of_cycle(following)


def _cycles(following: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All cycles of half-edges, ordered by their ``first`` ones, at which they begin.

    Returns the half-edges, cycle after cycle; the start of each cycle; the cycle of each half-edge.
    """
    n = len(following)
    # Number of half-edges after each one until its cycle closes, again by pointer doubling (Wyllie 1979).
    last = following == first
    leap, after = np.where(last, np.arange(n), following), (~last).astype(int)
    while True:
        ahead = after[leap]
        if not ahead.any():
            break
        after, leap = after + ahead, leap[leap]
    halves = np.lexsort((-after, first))
    start = np.flatnonzero(np.append(np.diff(first[halves], prepend=-1) > 0, True))
    cycle = np.empty(n, int)
    cycle[halves] = np.repeat(np.arange(len(start) - 1), np.diff(start))
    return halves, start, cycle


def _pinched(node: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Which cycles pass through a node twice."""
    owner = np.repeat(np.arange(len(start) - 1), np.diff(start))
    order = np.lexsort((node, owner))
    owner, node = owner[order], node[order]
    return np.unique(owner[1:][(owner[1:] == owner[:-1]) & (node[1:] == node[:-1])])


def _unpinch(nodes: np.ndarray, loops: list[np.ndarray], cycle: np.ndarray) -> None:
    """Split the one of ``loops`` that is ``cycle`` (n, 2), nodes and edges, at the node through which it passes twice:
    a hole may touch its outline or another hole at a corner, but is a loop of its own."""
    loops.pop(next(k for k, loop in enumerate(loops) if np.array_equal(loop, cycle)))
    chain: list[list[int]] = []
    parts: list[list[list[int]]] = []
    where: dict[int, int] = {}
    for node, edge in cycle.tolist():
        if node in where:
            parts.append(chain[where[node] :])
            for gone, _ in parts[-1]:
                where.pop(gone, None)
            del chain[len(chain) - len(parts[-1]) :]
        where[node] = len(chain)
        chain.append([node, edge])
    parts.append(chain)
    pieces = [np.array(part) for part in parts]
    start = np.concatenate([[0], np.cumsum([len(piece) for piece in pieces])])
    area = _areas(nodes, np.concatenate(pieces)[:, 0], start)
    # The outline first: it alone of all loops of a face turns counter-clockwise.
    for k in np.argsort(-area):
        loops.insert(0 if area[k] > 0 else len(loops), pieces[k])


def _faces_around(nodes, node, start, area, outer, inner) -> np.ndarray:
    """(n_inner,) the smallest ``outer`` cycle that contains each of the ``inner`` ones (outer rims of clusters of
    faces), −1 for none."""
    import shapely

    def rings(cycles: np.ndarray) -> np.ndarray:
        begin, flat = gathered(start, cycles)
        return _polygons(nodes, node[flat], begin, np.arange(len(cycles) + 1))

    out = np.full(len(inner), -1)
    # The rim and the faces within it touch: another face contains the rim if it covers the rim's hull but not its
    # faces.
    rims, areas = rings(inner), area[outer]
    hit, face = shapely.STRtree(rings(outer)).query(rims, predicate="within")
    rim_area = shapely.area(rims)
    for k, f in zip(hit, face):
        if areas[f] > rim_area[k] * (1 + 1e-9) and (out[k] < 0 or areas[f] < areas[out[k]]):
            out[k] = f
    return out
