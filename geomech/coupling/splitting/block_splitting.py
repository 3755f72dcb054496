"""Splits a block along the cracks that cut through it.

Outline, holes and cracks of a block form a planar graph whose nodes are already shared (mouths lie on the edges,
intersections have a node). The parts are the faces of this graph; no point is moved, and all coordinates are kept
exactly.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...model import CONTACT, Blocks, Cracks, Motion, State
from .planar_graph import BlockGraph, faces_without_slivers, steps

_log = logging.getLogger(__name__)

# Fate of a crack segment: still a crack; an edge of two parts; removed with a sliver.
CRACK, WALL, MERGED = 0, 1, 2

#: A point lies on an edge at less than this part of the edge's length from it.
_ON_EDGE = 1e-6

#: Loops of a polygon in reference coordinates → mean stress in it (3,), Pa, current axes.
MeanStress = Callable[[list[np.ndarray]], np.ndarray]


@dataclass(frozen=True, eq=False)
class Split:
    """The scene after a split.

    blocks     the parts in place of their parents, the other blocks unchanged
    state      velocity, stress, rotation and crack strain inherited, contacts renumbered
    cracks     segments that are not block edges now, each with the part that contains it
    parent     (n_blocks,) number of each block's parent before the split
    vertex_origin, edge_origin   (n_vertices,) the vertex before the split, and the edge before the split that the edge
               leaving it is (part of); −1 for a new vertex and for a former crack face
    edge_span  (n_vertices, 2) begin and end of the edge on that former edge, 0 to 1
    """

    blocks: Blocks
    state: State
    cracks: Cracks
    parent: np.ndarray
    vertex_origin: np.ndarray
    edge_origin: np.ndarray
    edge_span: np.ndarray


@dataclass(frozen=True, eq=False)
class _Piece:
    """A future block: loops of (vertices, current coordinates, edge names), and their origin."""

    loops: list[tuple[np.ndarray, np.ndarray, list[str]]]
    origin: list[np.ndarray]  # per loop: old vertex, −1 for a new one
    edge_origin: list[np.ndarray]  # per loop: old edge that the edge is (part of), −1 for a crack face
    edge_span: list[np.ndarray]  # per loop, (n, 2): begin and end on the old edge, 0 to 1
    parent: int
    name: str


def divided(blocks: Blocks, cracks: Cracks) -> np.ndarray:
    """Numbers of the blocks that ``cracks`` cut in two. Raises ValueError as `split_blocks`."""
    return np.array([b for b in np.unique(cracks.block).tolist() if BlockGraph.of(blocks, b, cracks).closes()], int)


def on_edges(point: np.ndarray, blocks: Blocks, edges: np.ndarray) -> np.ndarray:
    """Those of the ``edges`` (n,) of undeformed ``blocks`` on which ``point`` (2,) lies."""
    start = blocks.vertices[edges]
    along, arm = blocks.vertices[blocks.next_vertex[edges]] - start, point - start
    square = np.sum(along * along, axis=1)
    share = np.clip(np.sum(arm * along, axis=1) / square, 0.0, 1.0)
    return edges[np.hypot(*(arm - share[:, None] * along).T) <= _ON_EDGE * np.sqrt(square)]


def split_blocks(
    blocks: Blocks, state: State, cracks: Cracks, mean_stress: Mapping[int, MeanStress] | None = None
) -> Split | None:
    """Split every block that its cracks, with its boundary, divide; None if there is none.

    Parts inherit material, fixity and the names of their edges. New edges are called "crack:<name>", parts
    "<parent>/1", "<parent>/2" … Vertices of the parent keep reference and current coordinates exactly; new ones follow
    its affine motion. The velocity field of the parent is written about the centroid of each part, so that mass,
    momentum and angular momentum are conserved. Stress is the parent's, or what ``mean_stress[block]`` gives for the
    loops of the part. A part that still contains cracks keeps the parent's crack strain; an intact one has none.

    Contacts follow their vertices and edges. A contact whose vertex now belongs to two blocks is dropped (and logged);
    the next contact search finds it on both. Raises ValueError for a crack mouth that is not on the boundary of its
    block.
    """
    cut: dict[int, BlockGraph] = {}
    for block in np.unique(cracks.block) if cracks.n_segments else ():
        graph = BlockGraph.of(blocks, int(block), cracks)
        if graph.closes():
            cut[int(block)] = graph
    if not cut:
        return None
    motion = Motion.of(blocks, state.vertices)
    pieces: list[_Piece] = []
    role = np.full(cracks.n_segments, CRACK)
    holder = np.full(cracks.n_segments, -1)
    for block in range(blocks.n_blocks):
        if block in cut:
            own = cut[block].segments
            children, role[own], holder[own] = _divide(blocks, state, cracks, cut[block], motion)
            holder[own] += len(pieces)
            pieces += children
        else:
            holder[cracks.block == block] = len(pieces)
            pieces.append(_whole(blocks, state, block))
    parent = np.array([piece.parent for piece in pieces])
    children_blocks = _assemble(blocks, pieces)
    vertices = np.concatenate([now for piece in pieces for _, now, _ in piece.loops])

    rest = _remaining(cracks, role, holder)
    cracked = np.isin(np.arange(len(parent)), rest.block)
    divided = np.bincount(parent, minlength=blocks.n_blocks)[parent] > 1

    stress = state.stress[parent].copy()
    if mean_stress is not None:
        for child in np.flatnonzero(divided):
            if int(parent[child]) in mean_stress:
                stress[child] = mean_stress[int(parent[child])](children_blocks.loops(int(child)))
    crack_strain = np.where((cracked | ~divided)[:, None], state.crack_strain[parent], 0.0)
    after = replace(
        state,
        vertices=vertices,
        velocity=_velocity(blocks, state, children_blocks, vertices, parent),
        stress=stress,
        rotation=state.rotation[parent].copy(),
        crack_strain=crack_strain,
        contacts=_contacts(state.contacts, pieces),
        acceleration=None,
        removed=None if state.removed is None else state.removed[parent],
        order=None if state.order is None else np.asarray(state.order)[parent],
    )
    origin, edge_origin, span = (
        np.concatenate([part for piece in pieces for part in getattr(piece, name)])
        for name in ("origin", "edge_origin", "edge_span")
    )
    return Split(children_blocks, after, rest, parent, origin, edge_origin, span)


def _divide(
    blocks: Blocks, state: State, cracks: Cracks, graph: BlockGraph, motion: Motion
) -> tuple[list[_Piece], np.ndarray, np.ndarray]:
    """The parts of one block; the fate of each of its crack segments; and the part (from 0) that contains it."""
    import shapely

    parent = graph.block
    faces, kept = faces_without_slivers(graph, blocks.names[parent])
    walls = {step for rings in faces for ring in rings for step in steps(ring)}
    is_wall = np.array([(a, b) in walls for a, b in graph.ends.tolist()], dtype=bool)
    wall_nodes = np.zeros(len(graph.points), bool)
    wall_nodes[graph.ends[is_wall]] = True
    needed = (graph.vertex >= 0) | wall_nodes  # the mouth of a crack that divides nothing is no vertex of a part

    boundary = {(a, b): k for k, (a, b) in enumerate(graph.edges.tolist())}
    face_name = {}
    for k in np.flatnonzero(is_wall).tolist():
        name = "crack:" + cracks.names[cracks.crack[graph.segments[k]]]
        face_name[tuple(graph.ends[k].tolist())] = face_name[tuple(graph.ends[k, ::-1].tolist())] = name

    current = motion.current(parent, graph.points)

    # Ordered by the lowest old vertex; parts without one (islands) last.
    def order(rings: list[np.ndarray]) -> tuple:
        vertices = [v for ring in rings for v in graph.vertex[ring].tolist() if v >= 0]
        return (min(vertices, default=blocks.n_vertices), tuple(graph.points[rings[0]].min(axis=0).tolist()))

    pieces, polygons = [], []
    for n, rings in enumerate(sorted(faces, key=order)):
        loops, origin, edge_origin, edge_span = [], [], [], []
        for ring in rings:
            ring = _from_first(graph, ring)
            names, edges, spans, corners, own = [], [], [], [], []
            came_by = boundary.get((int(ring[-1]), int(ring[0])), -1)
            for a, b in steps(ring):
                k = boundary.get((a, b), -1)
                if needed[a]:
                    corners.append(a)
                    own.append(_old_vertex(blocks, graph, a, came_by, k))
                    names.append(face_name[a, b] if k < 0 else blocks.edge_names[blocks.edge_name[graph.edge[k]]])
                    edges.append(-1 if k < 0 else int(graph.edge[k]))
                    spans.append([0.0, 1.0] if k < 0 else graph.span[k].tolist())
                else:
                    spans[-1][1] = graph.span[k, 1]  # the edge continues beyond the mouth
                came_by = k
            at, old = np.array(corners), np.array(own)
            now = np.where(old[:, None] >= 0, state.vertices[old], current[at])
            loops.append((graph.points[at], now, names))
            origin.append(old)
            edge_origin.append(np.array(edges))
            edge_span.append(np.array(spans))
        name = f"{blocks.names[parent]}/{n + 1}" if len(faces) > 1 else blocks.names[parent]
        pieces.append(_Piece(loops, origin, edge_origin, edge_span, parent, name))
        polygons.append(shapely.Polygon(loops[0][0], [loop[0] for loop in loops[1:]]))

    # Located by its midpoint, since its ends may be on the boundary of several parts.
    midpoints = shapely.points(graph.points[graph.ends].mean(axis=1))
    apart = np.array([shapely.distance(polygon, midpoints) for polygon in polygons])
    return pieces, np.where(is_wall, WALL, np.where(kept, CRACK, MERGED)), apart.argmin(axis=0)


def _old_vertex(blocks: Blocks, graph: BlockGraph, node: int, came_by: int, goes_by: int) -> int:
    """The old vertex at ``node``, −1 where it was none, between two boundary pieces of the ``graph`` (−1: a crack
    face). Loops that touch have a vertex each there: it is that of the piece's own loop."""
    if graph.vertex[node] < 0:
        return -1
    if goes_by >= 0 and graph.span[goes_by, 0] == 0.0:
        return int(graph.edge[goes_by])
    if came_by >= 0 and graph.span[came_by, 1] == 1.0:
        return int(blocks.next_vertex[graph.edge[came_by]])
    return int(graph.vertex[node])


def _from_first(graph: BlockGraph, ring: np.ndarray) -> np.ndarray:
    """``ring`` started at its lowest old vertex, or at its lowest leftmost point: the same on every machine."""
    vertex = graph.vertex[ring]
    if (vertex >= 0).any():
        at = int(np.where(vertex >= 0, vertex, vertex.max() + 1).argmin())
    else:
        at = int(np.lexsort(graph.points[ring].T)[0])
    return np.roll(ring, -at)


def _whole(blocks: Blocks, state: State, block: int) -> _Piece:
    """A block that is not split."""
    loops, origin = [], []
    for k in range(blocks.block_loop[block], blocks.block_loop[block + 1]):
        own = np.arange(blocks.loop_start[k], blocks.loop_start[k + 1])
        names = [blocks.edge_names[e] for e in blocks.edge_name[own]]
        loops.append((blocks.vertices[own], state.vertices[own], names))
        origin.append(own)
    spans = [np.tile([0.0, 1.0], (len(own), 1)) for own in origin]
    return _Piece(loops, origin, origin, spans, block, blocks.names[block])


# -- inheritance -----------------------------------------------------------------------------------------------------


def _assemble(blocks: Blocks, pieces: list[_Piece]) -> Blocks:
    """The new blocks, with the loops of ``pieces`` unchanged; known edge names keep their numbers."""
    loops = [loop for piece in pieces for loop in piece.loops]
    known = {name: k for k, name in enumerate(blocks.edge_names)}
    labels = [known.setdefault(name, len(known)) for _, _, names in loops for name in names]
    parent = np.array([piece.parent for piece in pieces])
    return Blocks(
        vertices=np.concatenate([points for points, _, _ in loops]),
        loop_start=np.cumsum([0, *(len(points) for points, _, _ in loops)]),
        block_loop=np.cumsum([0, *(len(piece.loops) for piece in pieces)]),
        material=blocks.material[parent],
        fixed=blocks.fixed[parent],
        constrained=None if blocks.constrained is None else blocks.constrained[parent],
        edge_name=np.array(labels, dtype=int),
        edge_names=tuple(known),
        names=tuple(piece.name for piece in pieces),
        order=None if blocks.order is None else np.asarray(blocks.order)[parent],
        glued=None if blocks.glued is None else _glued(np.asarray(blocks.glued), pieces),
    )


def _glued(glued: np.ndarray, pieces: list[_Piece]) -> np.ndarray:
    """(n_faces, 2) the ``glued`` edges by their new numbers; no crack ends at one."""
    origin = np.concatenate([edges for piece in pieces for edges in piece.edge_origin])
    number = np.full(max(int(glued.max()), int(origin.max())) + 1, -1)
    number[origin[origin >= 0]] = np.flatnonzero(origin >= 0)
    return number[glued]


def _velocity(blocks: Blocks, state: State, children: Blocks, vertices: np.ndarray, parent: np.ndarray) -> np.ndarray:
    """Velocity fields of the parents, written about the current centroids of their parts."""
    velocity = state.velocity[parent].copy()
    for child in np.flatnonzero(np.bincount(parent, minlength=blocks.n_blocks)[parent] > 1):
        whole = _centroid(blocks.loops(int(parent[child]), state.vertices))
        x, y = _centroid(children.loops(int(child), vertices)) - whole
        u0, v0, r, ex, ey, g = state.velocity[parent[child]]
        velocity[child, 0] = u0 - r * y + ex * x + g / 2 * y
        velocity[child, 1] = v0 + r * x + g / 2 * x + ey * y
    return velocity


def _centroid(loops: list[np.ndarray]) -> np.ndarray:
    base = loops[0][0]
    area, moment = 0.0, np.zeros(2)
    for loop in loops:
        p = loop - base
        q = np.roll(p, -1, axis=0)
        cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        area += cross.sum() / 2
        moment += cross @ (p + q) / 6
    return base + moment / area


def _remaining(cracks: Cracks, role: np.ndarray, holder: np.ndarray) -> Cracks:
    """The remaining crack segments, with the new numbers of their blocks. A node on a new boundary becomes a mouth; a
    node shared by cracks of two parts is duplicated."""
    rows = np.flatnonzero(role == CRACK)
    on_wall = np.zeros(len(cracks.nodes), bool)
    on_wall[cracks.segments[role == WALL]] = True
    pairs = np.column_stack([cracks.segments[rows].ravel(), np.repeat(holder[rows], 2)])
    unique, number = np.unique(pairs, axis=0, return_inverse=True)
    return Cracks(
        nodes=cracks.nodes[unique[:, 0]],
        segments=number.reshape(-1, 2),
        crack=cracks.crack[rows],
        block=holder[rows],
        birth_cycle=cracks.birth_cycle[rows],
        aperture=cracks.aperture[rows],
        surface=(cracks.surface | on_wall)[unique[:, 0]],
        names=cracks.names,
        law=cracks.law[rows],
    )


def _contacts(contacts: np.ndarray, pieces: list[_Piece]) -> np.ndarray:
    """The contacts with new numbers of vertices, edges and blocks."""
    vertices: dict[int, list[tuple[int, int]]] = {}
    edges: dict[int, list[tuple[int, int, float, float]]] = {}
    at = 0
    for number, piece in enumerate(pieces):
        for origin, edge_origin, span in zip(piece.origin, piece.edge_origin, piece.edge_span):
            for k in range(len(origin)):
                vertices.setdefault(int(origin[k]), []).append((at + k, number))
                edges.setdefault(int(edge_origin[k]), []).append((at + k, number, *span[k]))
            at += len(origin)
    kept = []
    for row in contacts:
        owners = vertices[int(row["vertex"])]
        if len(owners) > 1:
            _log.info("contact of vertex %d dropped: the vertex is split between two blocks", int(row["vertex"]))
            continue
        # The part of the old edge with the contact; the nearest part when the contact lies beyond the end of the edge.
        edge, other, start, end = min(
            edges[int(row["edge"])], key=lambda part: max(part[2] - row["position"], row["position"] - part[3], 0.0)
        )
        new = row.copy()
        new["vertex"], new["block"] = owners[0]
        new["edge"], new["other"] = edge, other
        new["position"] = (row["position"] - start) / (end - start)
        kept.append(new)
    return np.array(kept, dtype=CONTACT) if kept else np.empty(0, CONTACT)
