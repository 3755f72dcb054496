"""Elements of outlines and cracks, a pure function of the geometry: unchanged parts get identical elements.

Edges are divided into nearly equal elements, graded towards corners and crack mouths. A straight initial crack has
``elements_per_crack`` elements; each growth increment is one element. Displacement has weak singularities at kinks,
junctions and mouths: element sizes shrink geometrically towards them. Finally, elements that are too long for their
distance to others are halved. A slight kink is no longer graded once the tip is three increments past it, where it does
not affect the stress intensity factors. A sharp kink stays graded: where a wing leaves a flaw, the wedge of rock at the
corner drives the wing at any length (without grading, K_I was 13 % low at a wing of 1.2 flaw lengths).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...model import Cracks, DdmSettings
from ...model.blocks.polygon import signed_area
from ..system.influence_matrix import ElementSet
from .crack_nodes import cut, ends_at, share_ends, straight_on
from .grading import KINK, NEAR_CORNER, Grading
from .half_plane import ON_SURFACE, HalfPlane
from .proximity import Pieces, keep_apart

#: Neighbouring segments are graded where the ratio of their element lengths exceeds this.
JUMP = 10.0 * (1 + 1e-9)
#: Number of increments between a slight kink and the tip beyond which the kink is not graded.
LEFT_BEHIND = 3
#: Edges that turn by less than this continue straight, rad; …
STRAIGHT = math.radians(0.1)
#: … their elements get one length when the ratio of the lengths is below this.
ALIKE = 1.2
#: Mouths and further points within this part of the extent of an edge, or of a vertex, lie on it.
ON_EDGE = 1e-7
#: A mouth nearer to an element's end than this part of its length moves that end; no shorter element is made.
SLIVER = 0.08


@dataclass(frozen=True, eq=False)
class Mesh:
    """The elements of a body.

    boundary, cracks   elements; their source is the edge or the crack segment
    edges, edge_loop   (m, 2, 2) edges of all loops and (m,) the loop of each
    sides              what the boundary elements depend on, these elements before halving, and the straight runs of
                       edges
    """

    boundary: ElementSet
    cracks: ElementSet
    edges: np.ndarray
    edge_loop: np.ndarray
    sides: tuple[tuple, tuple[np.ndarray, ...], np.ndarray | None]


def outline_edges(loops: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """(m, 2, 2) edges of all loops and (m,) their loops."""
    if not loops:
        return np.empty((0, 2, 2)), np.empty(0, int)
    edges = np.concatenate([np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in loops])
    return edges, np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])


def mesh(
    loops: list[np.ndarray],
    cracks: Cracks,
    settings: DdmSettings,
    marks: Sequence[tuple[np.ndarray, int]] = (),
    known: Mesh | None = None,
    half_plane: HalfPlane | None = None,
) -> Mesh:
    """Elements of a body with outline ``loops``, counter-clockwise; holes run clockwise.

    ``loops`` may hold holes alone, or be [] for the infinite plane. ``marks``: further points (2,) of the boundary that
    must be nodes, with the number of graded layers at each. ``known``: a mesh of the same body with other cracks.
    ``half_plane``: the half-plane that the rock fills; its surface needs no elements.
    """
    edges, edge_loop = outline_edges(loops) if known is None else (known.edges, known.edge_loop)
    points = np.concatenate([edges.reshape(-1, 2), cracks.nodes])
    extent = np.ptp(points, axis=0).max() if len(points) else 0.0
    cracks = _with_mouths_on(edges, cracks, ON_EDGE * extent)
    grading = Grading.of(settings)
    sides_of_rock = edges if half_plane is None else np.concatenate([edges, half_plane.edge(points)])
    mouths = [
        (cracks.nodes[k], _layers_at(cracks, k, sides_of_rock, grading))
        for k in (np.flatnonzero(cracks.surface & (cracks.valence > 0)).tolist() if len(edges) else ())
    ]
    corners = _corners_near_cracks(cracks, loops, sides_of_rock, settings, grading)
    key: tuple = float(extent), tuple((*point, deep) for point, deep in [*mouths, *corners])
    if known is not None and known.sides[0] == key:
        sides = known.sides
    else:
        sides = key, _boundary(loops, edges, mouths, settings, grading, extent, [*marks, *corners]), _straight_on(loops)
    boundary = sides[1]
    crack = _cracks(cracks, settings, grading, extent, sides_of_rock)
    start, end, kind, source = (np.concatenate(pair) for pair in zip(boundary, crack))
    source[len(boundary[0]) :] += len(edges)
    pieces = np.concatenate([edges, cracks.nodes[cracks.segments]])
    touching, n_pieces = _touching(sides[2], pieces, len(edges), cracks, extent), len(pieces)
    if half_plane is not None:
        (start, end, pieces), kind, source, touching = _with_images(
            half_plane, (start, end, pieces), kind, source, touching, ON_SURFACE * extent
        )
    start, end, kind, source = keep_apart(
        start, end, kind, source, Pieces(pieces, touching, len(edges), n_pieces), settings.grading_ratio, extent,
        # Images have no unknowns.
        (2 if half_plane is None else 1) * (settings.order + 1),
    )  # fmt: skip
    if half_plane is not None:
        own = source < n_pieces
        start, end, kind, source = start[own], end[own], kind[own], source[own]
    on_crack = source >= len(edges)
    rest = ~on_crack
    # The boundary elements must represent a rigid rotation, which otherwise would cause stress.
    order = max(settings.order, 1)
    sides_now = ElementSet(start[rest], end[rest], kind[rest], source[rest], order, settings.nodes, half_plane)
    if known is not None and _alike(known.boundary, sides_now):
        sides_now = known.boundary
    return Mesh(
        sides_now,
        ElementSet(
            start[on_crack],
            end[on_crack],
            kind[on_crack],
            source[on_crack] - len(edges),
            settings.order,
            settings.nodes,
            half_plane,
        ),
        edges,
        edge_loop,
        sides,
    )  # fmt: skip


def _with_mouths_on(edges: np.ndarray, cracks: Cracks, near: float) -> Cracks:
    """``cracks`` with their mouths moved onto the nearest of ``edges`` (m, 2, 2), or to its end where that is within
    ``near``, m.

    A mouth drawn 1e-14 of the extent beside its edge would bend the boundary there, and the nodes of its elements
    would lie off the edge, to which loads are applied: seen from within the rock, they would miss the traction on it.
    """
    mouths = np.flatnonzero(cracks.surface & (cracks.valence > 0))
    if not len(edges) or not len(mouths):
        return cracks
    a, d = edges[:, 0], edges[:, 1] - edges[:, 0]
    length = np.hypot(*d.T)
    t = d / length[:, None]
    nodes = cracks.nodes.copy()
    for mouth in mouths.tolist():
        rel = nodes[mouth] - a
        along, across = np.sum(rel * t, axis=1), rel[:, 1] * t[:, 0] - rel[:, 0] * t[:, 1]
        beyond = along - np.clip(along, 0.0, length)
        k = int(np.argmin(np.hypot(across, beyond)))
        if np.hypot(across[k], beyond[k]) > near:
            continue
        if along[k] <= near or along[k] >= length[k] - near:
            nodes[mouth] = edges[k, 0 if along[k] <= near else 1]
        else:
            nodes[mouth] -= across[k] * np.array([-t[k, 1], t[k, 0]])
    return cracks if np.array_equal(nodes, cracks.nodes) else replace(cracks, nodes=nodes)


def _with_images(half_plane: HalfPlane, ends, kind, source, touching, near: float):
    """Add the images behind the free surface, from which elements below it must keep their distance as well.

    ``ends`` are the starts, the ends and the pieces, (n, 2) or (n, 2, 2); kinds, sources and the table of touching
    pieces are extended in the same way.
    """
    ends = tuple(np.concatenate([x, half_plane.images(x, near)]) for x in ends)
    n = len(touching)
    both = np.zeros((2 * n, 2 * n), bool)
    both[:n, :n] = both[n:, n:] = touching
    pieces = ends[2][:n]
    # A piece that begins at the surface touches its own image there, and the images of its neighbours.
    above = np.abs(half_plane.frame(pieces)[..., 1]) <= near
    meets = np.diag(above.any(axis=1)) | (touching & above.any(axis=1) & above.any(axis=1)[:, None])
    both[:n, n:], both[n:, :n] = meets, meets.T
    return ends, np.concatenate([kind, kind]), np.concatenate([source, source + n]), both


def _corners_near_cracks(
    cracks: Cracks, loops: list[np.ndarray], edges: np.ndarray, settings: DdmSettings, grading: Grading
):
    """Re-entrant corners of the outline near which cracks run: (point (2,), graded layers) of each. At a corner where
    cracks begin, the widest wedge of rock between faces is graded, if it is re-entrant."""
    if grading.target is not None or not cracks.n_segments:
        return []
    found = []
    ends, tips = cracks.nodes[cracks.segments], cracks.nodes[cracks.tips]
    for loop, span in zip(loops, _spans(loops)):
        angles, size = interior_angles(loop), span / settings.elements_per_side
        sides = np.hypot(*(np.roll(loop, -1, axis=0) - loop).T)
        lengths = sides / np.maximum(1.0, np.ceil(sides / size - 1e-9))
        for k in np.flatnonzero(angles > np.pi + KINK).tolist():
            angle, off = float(angles[k]), float(distance_to_segments(loop[k], ends).min())
            if off <= ON_EDGE * span:
                at = np.hypot(*(cracks.nodes - loop[k]).T) <= ON_EDGE * span
                begins = np.flatnonzero(at & cracks.surface & (cracks.valence > 0)).tolist()
                angle = max((float(wedges(cracks, node, edges).max()) for node in begins), default=0.0)
                off = float(np.hypot(*(tips - loop[k]).T).min(initial=np.inf))
            if angle > np.pi + KINK and off < NEAR_CORNER * size:
                element, reach = float(max(lengths[k - 1], lengths[k])), float(np.abs(loop[k]).max())
                found.append((loop[k], grading.near_crack(angle, off / element, reach / element)))
    return found


def distance_to_segments(point: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(n,) distance, m, from ``point`` (2,) to segments with the ends ``ends`` (n, 2, 2)."""
    along, to = ends[:, 1] - ends[:, 0], point - ends[:, 0]
    part = np.clip((to * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300), 0.0, 1.0)
    return np.hypot(*(to - part[:, None] * along).T)


def _spans(loops: list[np.ndarray]) -> list[float]:
    """Length, m, to which a loop's element size is relative: √area of the outline; of the infinite plane, each hole's
    own."""
    spans = [math.sqrt(abs(signed_area(loop))) for loop in loops]
    return spans[:1] * len(loops) if loops and signed_area(loops[0]) > 0 else spans


def _boundary(loops, edges, mouths, settings, grading, extent, marks):
    if not len(edges):
        return np.empty((0, 2)), np.empty((0, 2)), np.empty(0, np.int64), np.empty(0, np.int64)
    length = np.hypot(*(edges[:, 1] - edges[:, 0]).T)
    spans = _spans(loops)
    angles = np.concatenate([interior_angles(loop) for loop in loops])
    corner = [grading.at_corner(angle) for angle in angles]
    if grading.target is not None:
        for point, deep in [*mouths, *marks]:
            for k in np.flatnonzero(np.hypot(*(edges[:, 0] - point).T) <= 1e-7 * max(spans)):
                corner[k] = deep
    for point, deep in marks:
        for k in np.flatnonzero(np.hypot(*(edges[:, 0] - point).T) <= 1e-7 * max(spans)):
            corner[k] = max(corner[k], deep)
    first = np.cumsum([0] + [len(loop) for loop in loops])
    lines: list[np.ndarray] = []
    for k in range(len(loops)):
        n_edges, span = len(loops[k]), spans[k]
        for i in range(n_edges):
            edge = first[k] + i
            fractions = _side(
                edges[edge],
                length[edge],
                span / settings.elements_per_side,
                corner[edge],
                corner[first[k] + (i + 1) % n_edges],
                grading,
                extent,
            )
            lines.append(_with_mouths(edges[edge], fractions, [*mouths, *marks], grading, span, extent))
        for i in np.flatnonzero(np.abs(angles[first[k] : first[k + 1]] - np.pi) < STRAIGHT):
            before, after = first[k] + (i - 1) % n_edges, first[k] + i
            lines[before], lines[after] = _equalised(lines[before], lines[after], grading.ratio)
    nodes = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
    source = [np.full(len(line) - 1, edge) for edge, line in enumerate(lines)]
    pairs = np.concatenate(nodes)
    return pairs[:, 0], pairs[:, 1], np.zeros(len(pairs), np.int64), np.concatenate(source)


def interior_angles(loop: np.ndarray) -> np.ndarray:
    """(n,) angle of rock at each vertex, rad, in (0, 2π)."""
    out = np.roll(loop, -1, axis=0) - loop
    back = np.roll(loop, 1, axis=0) - loop
    turn = np.arctan2(out[:, 0] * back[:, 1] - out[:, 1] * back[:, 0], np.sum(out * back, axis=1))
    return np.mod(turn, 2 * np.pi)


def _side(edge, length: float, size: float, at_start: int, at_end: int, grading: Grading, extent: float) -> np.ndarray:
    """(n + 1,) fractions from 0 to 1 that divide an edge."""
    n = max(1, math.ceil(length / size - 1e-9))
    if n == 1 and at_start and at_end:
        n = 2
    inner = list(range(1, n))
    least = [grading.finest(end, length, extent) * n / length for end in edge]
    fine = grading.fractions(at_start, least[0]) + inner + [n - f for f in grading.fractions(at_end, least[1])][::-1]
    return np.array([0.0, *(f / n for f in fine), 1.0])


def _equalised(before: np.ndarray, after: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) of two edges that continue straight, with elements of equal length where they meet.

    Loads mostly end at such points. Tractions jump there, and the resulting singularities at the nodes cancel between
    elements that are mirror images (next to a longer neighbour a short load lost 0.3 % of its force, with equal ones
    1e-6).
    """
    ends = [np.hypot(*(before[-1] - before[-2])), np.hypot(*(after[1] - after[0]))]
    short, long = min(ends), max(ends)
    if long < ALIKE * short:
        return before, after
    steps = [short]
    while steps[-1] / ratio < long / ALIKE:
        steps.append(steps[-1] / ratio)
    f = np.array(steps)[:, None] / long
    if ends[0] > ends[1]:
        more = before[-1] + f[::-1] * (before[-2] - before[-1])
        return np.concatenate([before[:-1], more, before[-1:]]), after
    more = after[0] + f * (after[1] - after[0])
    return before, np.concatenate([after[:1], more, after[1:]])


def _with_mouths(edge, fractions, mouths, grading, span, extent) -> np.ndarray:
    """(n, 2) points along an ``edge`` with ``mouths`` (point, layers) as graded nodes."""
    a, b = edge
    along = b - a
    length = math.hypot(*along)
    points = [((1 - f) * a + f * b) for f in fractions]
    points[0], points[-1] = a, b
    fractions = list(fractions)
    here: list[tuple[float, np.ndarray, int]] = []
    for mouth, layers in mouths:
        rel = mouth - a
        f = float(rel @ along) / length**2
        off = abs(rel[0] * along[1] - rel[1] * along[0]) / length
        # At a corner there is no element to divide.
        if off <= 1e-7 * span and 1e-7 * span < f * length < length - 1e-7 * span:
            same = [k for k, (other, _, _) in enumerate(here) if abs(other - f) * length <= 1e-7 * span]
            layers = max([layers, *(here.pop(k)[2] for k in same)])
            here.append((f, mouth, layers))
    if not here:
        return np.array(points)
    at = np.array([f for f, _, _ in here])
    kept = [0, *(k for k in range(1, len(fractions) - 1) if not _beside_mouth(fractions, k, at)), len(fractions) - 1]
    # All mouths are placed before the elements beside them are divided: the elements do not depend on the sense of the edge.
    nodes = sorted([*((fractions[k], points[k], 0) for k in kept), *here], key=lambda node: node[0])
    out = [points[0]]
    for (low, start, first), (high, end, last) in pairwise(nodes):
        middle = [0.5 * (low + high)] if first and last else []
        way = (middle[0] if middle else high) - low
        least = [grading.finest(point, length, extent) / (way * length) for point in (start, end)]
        inner = [low + way * g for g in grading.fractions(first, least[0])]
        inner += [*middle, *([high - way * g for g in grading.fractions(last, least[1])][::-1])]
        out += [*((1 - q) * a + q * b for q in inner), end]
    return np.array(out)


def _beside_mouth(fractions: list[float], k: int, mouths: np.ndarray) -> bool:
    """Whether node ``k`` of an edge is so close to one of the ``mouths`` (n,) that the element between would be a sliver."""
    for cell in (k, k + 1):
        low, high = fractions[cell - 1], fractions[cell]
        inside = mouths[(mouths > low) & (mouths < high)]
        if (np.abs(fractions[k] - inside) < SLIVER * (high - low)).any():
            return True
    return bool((mouths == fractions[k]).any())


def _cracks(cracks: Cracks, settings: DdmSettings, grading: Grading, extent: float, edges: np.ndarray):
    n = cracks.n_segments
    if n == 0:
        return np.empty((0, 2)), np.empty((0, 2)), np.empty(0, np.int64), np.empty(0, np.int64)
    length = cracks.lengths
    drawn = cracks.birth_cycle == 0
    total = np.bincount(cracks.crack, weights=np.where(drawn, length, 0.0), minlength=cracks.crack.max() + 1)
    share = np.where(drawn, length / np.maximum(total[cracks.crack], 1e-300), 0.0)
    # Rounded to nine digits first: both halves of a crack drawn in two, with 2½ of five elements each, get the same
    # number.
    count = np.maximum(1, np.rint(np.round(settings.elements_per_crack * share, 9)).astype(int))
    layers = _node_layers(cracks, length / count, grading, edges)
    inner: list[float] = []
    pieces = np.ones(n, np.int64)
    for s in np.flatnonzero((count > 1) | layers.any(axis=1)).tolist():
        m, (at_start, at_end) = int(count[s]), layers[s].tolist()
        if m == 1 and at_start and at_end:
            m = 2
        a, b = cracks.nodes[cracks.segments[s]].tolist()
        long = float(length[s])
        part = m / long
        fine: list[float] = list(range(1, m))
        if at_start:
            fine = grading.fractions(at_start, grading.finest(a, long, extent) * part) + fine
        if at_end:
            fine += [m - f for f in grading.fractions(at_end, grading.finest(b, long, extent) * part)][::-1]
        inner += [q / m for q in fine]
        pieces[s] += len(fine)
    tip = np.zeros(len(cracks.nodes), bool)
    tip[cracks.tips] = True
    nodes, segments = np.ascontiguousarray(cracks.nodes), np.ascontiguousarray(cracks.segments, dtype=np.int64)
    return cut(nodes, segments, tip, pieces, np.array(inner, dtype=float))


def _node_layers(cracks: Cracks, size: np.ndarray, grading: Grading, edges: np.ndarray) -> np.ndarray:
    """(n_segments, 2) graded layers at the start and end of every segment; ``size`` is its element length."""
    layers = np.zeros((cracks.n_segments, 2), int)
    closed, surface = _closed(cracks), cracks.surface
    first, ends = ends_at(cracks)
    plain = (cracks.valence == 0) | ((cracks.valence == 1) & ~surface)
    if grading.target is None:
        nodes, segments = np.ascontiguousarray(cracks.nodes), np.ascontiguousarray(cracks.segments, dtype=np.int64)
        # Well below the lengths that matter, so that round-off does not decide.
        plain |= straight_on(nodes, segments, surface, size, closed, first, ends, 0.9 * KINK, 0.9 * JUMP)
    for node in np.flatnonzero(~plain).tolist():
        here = [divmod(end, 2) for end in ends[first[node] : first[node + 1]].tolist()]
        if len(here) != 2 or surface[node]:
            deep = _layers_at(cracks, node, edges, grading)
            for at in here:
                layers[at] = deep
            if grading.target is None:
                continue
        else:
            (s, e), (r, f) = here
            # Straight on: one segment arrives in the direction in which the other leaves.
            turn = _heading(cracks, s) - _heading(cracks, r) + (math.pi if e == f else 0.0)
            turn = abs(math.remainder(turn, 2 * math.pi))
            if closed[s] and closed[r]:
                deep = grading.at_closed_kink(turn)
            else:
                deep = grading.at_kink(turn, turn > KINK and _left_behind(cracks, first, ends, here))
            if deep:
                layers[s, e] = layers[r, f] = deep
        least = min(float(size[s]) for s, _ in here)
        for at in here:
            if size[at[0]] > JUMP * least:
                needed = round(math.log(least / float(size[at[0]])) / math.log(grading.ratio))
                layers[at] = max(layers[at], needed) if grading.target is None else layers[at] + needed
    return layers


def _heading(cracks: Cracks, segment: int) -> float:
    """Direction of a segment, rad."""
    (ax, ay), (bx, by) = cracks.nodes[cracks.segments[segment]].tolist()
    return math.atan2(by - ay, bx - ax)


def _closed(cracks: Cracks) -> np.ndarray:
    """(n_segments,) bool: segments drawn without an aperture; kinks between them are graded however slight."""
    return (cracks.aperture == 0) & (cracks.birth_cycle == 0)


def _layers_at(cracks: Cracks, node: int, edges: np.ndarray, grading: Grading) -> int:
    """Graded layers at a junction or a mouth."""
    return grading.at_node(wedges(cracks, node, edges), "mouth" if cracks.surface[node] else "crack")


def wedges(cracks: Cracks, node: int, edges: np.ndarray) -> np.ndarray:
    """(n,) angles, rad, of the wedges of rock between the faces that meet at ``node``, which may be on the boundary."""
    here = np.argwhere(cracks.segments == node)
    to = cracks.nodes[cracks.segments[here[:, 0], 1 - here[:, 1]]] - cracks.nodes[node]
    rays = np.arctan2(to[:, 1], to[:, 0])
    if not cracks.surface[node] or not len(edges):
        rays = np.sort(rays)
        return np.diff(np.r_[rays, rays[0] + 2 * np.pi])
    # On the boundary rock lies counter-clockwise from the edge that leaves to the edge that arrives.
    a, d = edges[:, 0], edges[:, 1] - edges[:, 0]
    rel, length = cracks.nodes[node] - a, np.hypot(*d.T)
    along = np.sum(rel * d, axis=1) / length
    off = np.hypot(*(rel - np.clip(along, 0.0, length)[:, None] * d / length[:, None]).T)
    near = 1e-7 * np.ptp(edges.reshape(-1, 2), axis=0).max()
    at = np.flatnonzero(off <= max(near, 1.001 * off.min()))
    onward = at[along[at] < length[at] - near][-1:] if len(at) > 1 else at
    back = at[along[at] > near][:1] if len(at) > 1 else at
    first = math.atan2(d[onward[0], 1], d[onward[0], 0])
    last = math.atan2(-d[back[0], 1], -d[back[0], 0])
    turn = np.mod(rays - first, 2 * np.pi)
    return np.diff(np.sort(np.r_[0.0, turn, np.mod(last - first, 2 * np.pi)]))


def _left_behind(cracks: Cracks, first: np.ndarray, ends: np.ndarray, here) -> bool:
    """Whether the chain grown from a kink has at least ``LEFT_BEHIND`` increments; ``first`` and ``ends`` as in
    `ends_at`."""
    s, e = max(here, key=lambda at: cracks.birth_cycle[at[0]])
    if cracks.birth_cycle[s] == 0:
        return False
    for _ in range(LEFT_BEHIND - 1):
        node = cracks.segments[s, 1 - e]
        if first[node + 1] - first[node] != 2:
            return False
        s, e = next(divmod(int(at), 2) for at in ends[first[node] : first[node + 1]] if at // 2 != s)
    return True


def _alike(one: ElementSet, other: ElementSet) -> bool:
    return one.n == other.n and all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ("start", "end", "kind", "source")
    )


def _straight_on(loops: list[np.ndarray]) -> np.ndarray | None:
    """(m,) for each edge the number of its straight run between bends; None where every vertex is a bend."""
    bends = [np.abs(interior_angles(loop) - np.pi) >= STRAIGHT for loop in loops]
    if all(bend.all() for bend in bends):
        return None
    # A loop that begins within a straight run: its last edges belong to its first run.
    n_edges = sum(len(bend) for bend in bends)
    return np.concatenate([np.cumsum(bend) % max(bend.sum(), 1) + n_edges * k for k, bend in enumerate(bends)])


def _touching(side: np.ndarray | None, pieces: np.ndarray, n_edges: int, cracks: Cracks, extent: float) -> np.ndarray:
    """(m, m) which of ``pieces`` (m, 2, 2), edges and segments, share a node; edges of one straight run ``side``
    (`_straight_on`) count as one."""
    # Nodes are compared by coordinates, so that corners, junctions and drawn end points that coincide are one.
    out = share_ends(pieces)
    if side is not None:
        out[:n_edges, :n_edges] |= side[:, None] == side
    if n_edges and cracks.surface.any():
        a, d = pieces[:n_edges, 0], pieces[:n_edges, 1] - pieces[:n_edges, 0]
        length = np.hypot(*d.T)
        for s, at in zip(*np.nonzero(cracks.surface[cracks.segments])):
            rel = cracks.nodes[cracks.segments[s, at]] - a
            off = np.abs(rel[:, 0] * d[:, 1] - rel[:, 1] * d[:, 0]) / length
            f = np.sum(rel * d, axis=1) / length**2
            met = (off <= 1e-7 * extent) & (f > -1e-7) & (f < 1 + 1e-7)
            out[n_edges + s, :n_edges] |= met
            out[:n_edges, n_edges + s] |= met
    return out
