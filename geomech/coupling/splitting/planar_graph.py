"""The planar graph of a block's outline, holes and cracks; its faces are the parts of a split block.

Nodes are already shared (mouths lie on edges, intersections have a node). A mouth that coincides with a vertex up to
round-off is that vertex; coordinates are kept exactly.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...model import Blocks, Cracks
from ...model.blocks.polygon import signed_area

_log = logging.getLogger(__name__)

#: Faces smaller than this fraction of the block's area are merged into a neighbour.
SLIVER_AREA = 1e-8
#: A mouth lies on an edge, or at a vertex, if its distance is less than this fraction of the block's size, as in
#: `ddm.mesh.elements`.
ON_EDGE = 1e-7


@dataclass(frozen=True, eq=False)
class BlockGraph:
    """Nodes of a block: its vertices first, then the crack nodes that are not vertices.

    points    (n, 2); where loops touch, the first of the vertices there represents all
    node      crack node → node of this graph
    vertex    (n,) old vertex, −1 for others
    edges     (m, 2) boundary pieces, rock on the left; ``edge`` (m,) the old edge, ``span`` (m, 2) the part of it
    segments  rows in the crack network; ``ends`` (k, 2) their nodes here
    loop      (n,) the loop that a node lies on, −1 inside the rock
    """

    block: int
    points: np.ndarray
    vertex: np.ndarray
    edges: np.ndarray
    edge: np.ndarray
    span: np.ndarray
    segments: np.ndarray
    ends: np.ndarray
    loop: np.ndarray

    @classmethod
    def of(cls, blocks: Blocks, block: int, cracks: Cracks) -> BlockGraph:
        first, last = blocks.vertex_start[block], blocks.vertex_start[block + 1]
        own = np.arange(first, last)
        a = blocks.vertices[own]
        b = blocks.vertices[blocks.next_vertex[own]]
        size = np.ptp(a, axis=0).max()
        loop_of = np.repeat(np.arange(len(blocks.loop_start) - 1), np.diff(blocks.loop_start))[own]
        segments = np.flatnonzero(cracks.block == block)

        points, vertex, loop = list(map(tuple, a.tolist())), own.tolist(), loop_of.tolist()
        known: dict[tuple, int] = {}
        own_node = [known.setdefault(p, k) for k, p in enumerate(points)]
        node: dict[int, int] = {}
        mouths: list[list[tuple[float, int]]] = [[] for _ in own]
        for n in dict.fromkeys(cracks.segments[segments].ravel().tolist()):
            p = tuple(cracks.nodes[n].tolist())
            if p in known:
                node[n] = known[p]
                continue
            if cracks.surface[n]:
                edge, along, distance = _on_boundary(a, b, np.array(p))
                if distance > ON_EDGE * size:
                    row = segments[(cracks.segments[segments] == n).any(axis=1)][0]
                    raise ValueError(
                        f"{cracks.names[cracks.crack[row]]}: its mouth ({p[0]:g}, {p[1]:g}) is {distance:.3g} m off "
                        f"the boundary of {blocks.names[block]}"
                    )
                onward = int(blocks.next_vertex[own[edge]] - first)
                nearest, at = (0.0, own_node[edge]) if along < 0.5 else (1.0, own_node[onward])
                if abs(along - nearest) * np.hypot(*(b[edge] - a[edge])) <= ON_EDGE * size:
                    node[n] = at
                    continue
                mouths[edge].append((along, len(points)))
            known[p] = node[n] = len(points)
            points.append(p)
            vertex.append(-1)
            loop.append(loop_of[edge] if cracks.surface[n] else -1)
        edges, old, span = [], [], []
        following = (blocks.next_vertex[own] - first).tolist()
        for k, on_edge in enumerate(mouths):
            stops = [(0.0, own_node[k]), *sorted(on_edge), (1.0, own_node[following[k]])]
            for (t0, n0), (t1, n1) in pairwise(stops):
                edges.append((n0, n1))
                old.append(own[k])
                span.append((t0, t1))
        ends = np.array([[node[n] for n in pair] for pair in cracks.segments[segments].tolist()], dtype=int)
        # Loops that touch count as one: a crack from one to the other divides the rock.
        loops = np.array(loop)
        for at, first_there in enumerate(own_node):
            if at != first_there:
                loops[loops == loops[at]] = loops[first_there]
        return cls(
            block,
            np.array(points),
            np.array(vertex),
            np.array(edges),
            np.array(old),
            np.array(span),
            segments,
            ends.reshape(-1, 2),
            loops,
        )

    def closes(self) -> bool:
        """Whether the cracks, with each boundary loop contracted to a point, contain a cycle: only then do they divide
        the rock."""
        root = list(range(len(self.points)))

        def find(n: int) -> int:
            while root[n] != n:
                root[n] = root[root[n]]
                n = root[n]
            return n

        on_loop: dict[int, int] = {}
        for n, loop in enumerate(self.loop.tolist()):
            if loop >= 0:
                root[find(n)] = find(on_loop.setdefault(loop, n))
        for a, b in self.ends.tolist():
            a, b = find(a), find(b)
            if a == b:
                return True
            root[a] = b
        return False


def _on_boundary(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> tuple[int, float, float]:
    """The edge (of those from ``a`` to ``b``) nearest to ``p``, the coordinate on it (0 to 1), and the distance."""
    d = b - a
    along = np.clip(np.sum((p - a) * d, axis=1) / np.sum(d * d, axis=1), 0.0, 1.0)
    distance = np.hypot(*(a + along[:, None] * d - p).T)
    k = int(distance.argmin())
    return k, float(along[k]), float(distance[k])


def _faces(graph: BlockGraph, kept: np.ndarray) -> list[list[np.ndarray]]:
    """The faces of the rock as rings of node numbers: outline counter-clockwise, then holes clockwise."""
    import shapely
    from shapely.geometry.polygon import orient

    pairs = np.concatenate([graph.edges, graph.ends[kept]])
    faces = shapely.get_parts(shapely.polygonize(shapely.linestrings(graph.points[pairs])))
    number: dict[tuple, int] = {}
    for n, point in enumerate(graph.points.tolist()):
        number.setdefault(tuple(point), n)
    # Around the void of a hole its edges run in the opposite direction.
    backwards = {(b, a) for a, b in graph.edges.tolist()}
    found = []
    for face in faces:
        face = orient(face)
        rings = [face.exterior, *face.interiors]
        rings = [np.array([number[p] for p in ring.coords[:-1]]) for ring in rings]
        if not any(step in backwards for ring in rings for step in steps(ring)):
            found.append(rings)
    return found


def steps(ring: np.ndarray) -> list[tuple[int, int]]:
    """The edges of a ``ring`` of nodes."""
    return list(zip(ring.tolist(), np.roll(ring, -1).tolist()))


def _area(graph: BlockGraph, rings: list[np.ndarray]) -> float:
    return sum(signed_area(graph.points[ring]) for ring in rings)


def faces_without_slivers(graph: BlockGraph, names: str) -> tuple[list[list[np.ndarray]], np.ndarray]:
    """Faces that are not slivers, and the crack segments kept. A sliver is merged with the neighbour with which it
    shares the longest side, by removing that side from the network."""
    kept = np.ones(len(graph.ends), bool)
    by_ends = {frozenset(pair): k for k, pair in enumerate(graph.ends.tolist())}
    while True:
        faces = _faces(graph, kept)
        areas = np.array([_area(graph, rings) for rings in faces])
        smallest = int(areas.argmin())
        if len(faces) == 1 or areas[smallest] >= SLIVER_AREA * areas.sum():
            return faces, kept
        owner = {}
        for f, rings in enumerate(faces):
            for ring in rings:
                owner.update(dict.fromkeys(steps(ring), f))
        shared: dict[int, float] = {}
        sides: dict[int, list[int]] = {}
        for ring in faces[smallest]:
            for a, b in steps(ring):
                if (b, a) in owner:
                    other = owner[b, a]
                    shared[other] = shared.get(other, 0.0) + float(np.hypot(*(graph.points[b] - graph.points[a])))
                    sides.setdefault(other, []).append(by_ends[frozenset((a, b))])
        into = max(shared, key=lambda face: shared[face])
        kept[sides[into]] = False
        _log.info("%s: a sliver of %.3g m² is merged into its neighbour", names, areas[smallest])
