"""Triangulation of the interior of a cracked block for fields: fine at crack tips, split along the cracks."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..model import Cracks
from ..model.blocks.polygon import signed_area
from .gmsh_models.session import gmsh_session
from .narrow_places import narrow_places

log = logging.getLogger(__name__)

#: Triangles with a smaller angle than this are reported, rad. Gmsh keeps 20° where nothing is narrow.
SLIVER = math.radians(1.0)
#: Sides of triangles between cracks, or a crack and the outline, relative to their distance: angles of 5° and more.
ACROSS = 10.0
#: Most places that are refined for that: faces that run closer to each other, over a longer way, get flat triangles.
MOST_PLACES = 1000


@dataclass(frozen=True, eq=False)
class InteriorMesh:
    """A conforming triangle mesh with separate nodes on both faces of cracks.

    points      (n, 2)   m
    triangles   (m, 3)   counter-clockwise
    side        (n, 2)   unit vector from a node on a crack face into its own side of the rock; zero elsewhere
    """

    points: np.ndarray
    triangles: np.ndarray
    side: np.ndarray

    def flattest(self) -> tuple[float, np.ndarray]:
        """(rad, (2,) m) smallest angle of any triangle, and its location.

        Between cracks that nearly touch it is as small as their distance relative to the triangles' sides, which follow
        the cracks (`mesh_interior`).
        """
        corner = self.points[self.triangles]
        least, at = np.inf, 0
        for k in range(3):
            a, b = corner[:, (k + 1) % 3] - corner[:, k], corner[:, (k + 2) % 3] - corner[:, k]
            angle = np.arctan2(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), (a * b).sum(axis=1))
            if angle.min() < least:
                least, at = float(angle.min()), int(angle.argmin())
        return least, corner[at].mean(axis=0)


def mesh_interior(
    loops: Sequence[np.ndarray],
    cracks: Cracks,
    size: float | None = None,
    tip_size: float | None = None,
    slope: float = 0.5,
) -> InteriorMesh:
    """Mesh the block bounded by ``loops`` ((n, 2) each, the outline first, then holes), split along ``cracks``.

    Nodes are shared where cracks meet. ``size`` is the side of a triangle away from cracks (default: two to four
    thousand triangles in all), ``tip_size`` that at crack tips (default a tenth of it), both in m; along cracks sides
    are half of ``size``, and all grow back to it by ``slope`` times the distance (a half: over two of its lengths).
    Nodes on cracks are doubled, at junctions one per sector, at mouths too; tips stay single. Between cracks, or a
    crack and the outline, that nearly touch, sides are `ACROSS` times their distance, so that no angle is below 1° but
    where they meet at less, or run beside each other at less than a four-thousandth of the way. Such triangles are
    reported in the log with their place: fields are evaluated at nodes and are unaffected, but finite elements of
    another program would be. Raises ValueError for sizes that are not positive, RuntimeError if Gmsh cannot mesh the
    block.
    """
    loops = [np.asarray(loop, dtype=float) for loop in loops]
    area = abs(sum(abs(signed_area(loop)) * (1 if k == 0 else -1) for k, loop in enumerate(loops)))
    # An equilateral triangle of side h covers 0.43 h².
    size = float(np.sqrt(area / 0.43 / 2000)) if size is None else size
    tip_size = 0.1 * size if tip_size is None else tip_size
    if not (size > 0 and tip_size > 0 and slope > 0):
        raise ValueError(
            f"mesh sizes must be positive, got size {size!r} and tip_size {tip_size!r} m, growing by {slope!r}"
        )
    points, triangles, crack_edges = _mesh(loops, cracks, size, min(tip_size, size), size / slope)
    mesh = _torn(points, triangles, crack_edges)
    angle, (x, y) = mesh.flattest()
    if angle < SLIVER:
        log.info(
            "the interior mesh has triangles of %.2g degrees, where cracks or the outline nearly touch, at (%.6g, %.6g) "
            "m",
            math.degrees(angle), x, y,
        )  # fmt: skip
    return mesh


def _with_mouths(loop: np.ndarray, mouths: list[tuple[int, np.ndarray]], tolerance: float):
    """Corners of ``loop`` and mouths on its edges in order: a list of (point, crack node or −1)."""
    following = np.roll(loop, -1, axis=0)
    along = following - loop
    square = np.einsum("nx,nx->n", along, along)
    on: list[list[tuple[float, int, np.ndarray]]] = [[] for _ in loop]
    at_corner: dict[int, int] = {}
    for node, point in mouths:
        corner = np.hypot(*(loop - point).T)
        if corner.min() <= tolerance:
            at_corner[int(np.argmin(corner))] = node
            continue
        t = np.clip(np.einsum("nx,nx->n", point - loop, along) / square, 0, 1)
        distance = np.hypot(*(loop + t[:, None] * along - point).T)
        edge = int(np.argmin(distance))
        if distance[edge] <= tolerance:
            on[edge].append((float(t[edge]), node, point))
    ring = []
    for k, corner in enumerate(loop):
        ring.append((corner, at_corner.get(k, -1)))
        ring += [(point, node) for _, node, point in sorted(on[k], key=lambda item: item[0])]
    return ring


def _mesh(loops, cracks: Cracks, size: float, tip_size: float, reach: float):
    """(points, triangles, crack edges) as made by Gmsh, with embedded crack lines, not yet split."""
    tolerance = 1e-9 * max(np.ptp(loop, axis=0).max() for loop in loops)
    mouths = [(int(n), cracks.nodes[n]) for n in np.flatnonzero(cracks.surface)]
    with gmsh_session("interior") as gmsh:
        geo, mesh, option = gmsh.model.geo, gmsh.model.mesh, gmsh.option.setNumber
        tag_of: dict[int, int] = {}
        rings, rings_of = [], [_with_mouths(loop, mouths, tolerance) for loop in loops]
        for ring in rings_of:
            tags = []
            for point, node in ring:
                tags.append(geo.addPoint(point[0], point[1], 0.0))
                if node >= 0:
                    tag_of[node] = tags[-1]
            rings.append(geo.addCurveLoop([geo.addLine(a, b) for a, b in zip(tags, tags[1:] + tags[:1])]))
        surface = geo.addPlaneSurface(rings)
        for node in np.unique(cracks.segments):
            if int(node) not in tag_of:
                tag_of[int(node)] = geo.addPoint(*cracks.nodes[node], 0.0)
        lines = [geo.addLine(tag_of[int(a)], tag_of[int(b)]) for a, b in cracks.segments]
        geo.synchronize()
        inside = [tag for node, tag in tag_of.items() if not cracks.surface[node]]
        if lines:
            mesh.embed(0, inside, 2, surface)
            mesh.embed(1, lines, 2, surface)
        for name in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
            option(f"Mesh.{name}", 0)
        option("Mesh.MeshSizeMax", size)
        # By default Gmsh spends half of its time on smoothing, for a smallest angle of 31° instead of 23°, and a sixth
        # on dividing lines to nine digits of their sizes. Fields are evaluated at the nodes: such a mesh shows them as
        # well.
        option("Mesh.Smoothing", 0)
        option("Mesh.LcIntegrationPrecision", 1e-3)
        tips = [tag_of[int(n)] for n in cracks.tips] if tip_size < size else []
        narrow = _narrow(rings_of, cracks, size)
        if tips or narrow:
            _refine(gmsh.model, tips, lines, narrow, size, tip_size, reach)
        if narrow:
            # Coarse division of lines misses short narrow places.
            option("Mesh.LcIntegrationPrecision", 1e-6)
        # Delaunay is the fastest algorithm that respects embedded lines; the others are for the rare block on which it
        # fails.
        for algorithm in (5, 6, 1):
            option("Mesh.Algorithm", algorithm)
            mesh.clear()
            try:
                mesh.generate(2)
            except Exception:
                continue
            nodes, coordinates, _ = mesh.getNodes()
            number = np.full(int(nodes.max()) + 1, -1)
            number[nodes] = np.arange(len(nodes))
            triangles = number[mesh.getElementsByType(2)[1]].reshape(-1, 3)
            on_lines = [number[mesh.getElementsByType(1, line)[1]].reshape(-1, 2) for line in lines]
            edges = np.concatenate(on_lines) if on_lines else np.empty((0, 2), int)
            if len(triangles) and _are_edges(edges, triangles, len(nodes)):
                break
        else:
            raise RuntimeError("Gmsh cannot mesh the block: its triangles do not follow the cracks")
    points = np.ascontiguousarray(coordinates.reshape(-1, 3)[:, :2])
    used = np.zeros(len(points), bool)
    used[triangles] = True
    renumber = np.cumsum(used) - 1
    return points[used], renumber[triangles], renumber[edges]


def _are_edges(pairs: np.ndarray, triangles: np.ndarray, n: int) -> bool:
    """Whether every one of ``pairs`` (k, 2) of the ``n`` nodes is an edge of a triangle."""
    sides = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    pairs = np.sort(pairs, axis=1)
    return bool(np.isin(pairs[:, 0] * n + pairs[:, 1], sides[:, 0] * n + sides[:, 1]).all())


def _narrow(rings, cracks: Cracks, size: float) -> list[tuple[float, np.ndarray]]:
    """Places where cracks, or a crack and the outline, nearly touch: (size of triangles there, points (n, 2)), in m, a
    few sizes for all; [] where nothing does."""
    nodes = cracks.nodes.copy()
    sides = []
    for ring in rings:
        corners = np.array([point for point, _ in ring])
        # Mouths lie on the outline to round-off; the outline is divided there.
        for point, node in ring:
            if node >= 0:
                nodes[node] = point
        sides.append(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))
    points, sizes = narrow_places(np.concatenate([*sides, nodes[cracks.segments]]), ACROSS, 0.5 * size, MOST_PLACES)
    level = np.floor(np.log2(sizes))
    return [(float(sizes[level == k].min()), points[level == k]) for k in np.unique(level)]


def _refine(model, tips, lines, narrow, size: float, tip_size: float, reach: float) -> None:
    """Side lengths: ``tip_size`` at tips, half of ``size`` along cracks where there are tips to refine, their own at
    ``narrow`` places, ``size`` at ``reach`` from all."""
    places = [(small, [model.geo.addPoint(x, y, 0.0) for x, y in points.tolist()]) for small, points in narrow]
    model.geo.synchronize()
    near = [("PointsList", items, small, small) for small, items in places]
    if tips:
        near += [("PointsList", tips, tip_size, tip_size), ("CurvesList", lines, 0.5 * size, 0.5 * size)]
    field, fields = model.mesh.field, []
    for what, items, smallest, start in near:
        distance = field.add("Distance")
        field.setNumbers(distance, what, items)
        if what == "CurvesList":
            field.setNumber(distance, "Sampling", 20)
        threshold = field.add("Threshold")
        for key, value in (
            ("InField", distance),
            ("SizeMin", smallest),
            ("SizeMax", size),
            ("DistMin", start),
            ("DistMax", reach),
        ):
            field.setNumber(threshold, key, value)
        fields.append(threshold)
    smaller = field.add("Min")
    field.setNumbers(smaller, "FieldsList", fields)
    field.setAsBackgroundMesh(smaller)


def _torn(points: np.ndarray, triangles: np.ndarray, crack_edges: np.ndarray) -> InteriorMesh:
    """Give every sector of triangles around a node on a crack its own node.

    Crack edges divide the triangles around a node into sectors: one at a tip, two at an interior point of a crack, as
    many as cracks at a junction.
    """
    corner = points[triangles]
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    flipped = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0
    triangles = np.where(flipped[:, None], triangles[:, ::-1], triangles)
    side = np.zeros_like(points)
    if not len(crack_edges):
        return InteriorMesh(points, triangles, side)

    cut = {(min(p, q), max(p, q)) for p, q in crack_edges.tolist()}
    on_crack = np.zeros(len(points), bool)
    on_crack[crack_edges] = True
    about: dict[int, list[tuple[int, int]]] = {}
    for t, k in zip(*np.nonzero(on_crack[triangles])):
        about.setdefault(int(triangles[t, k]), []).append((int(t), int(k)))

    triangles, old = triangles.copy(), triangles
    new_points: list[np.ndarray] = []
    new_sides: list[np.ndarray] = []
    for node, corners in about.items():
        sectors = _sectors(node, corners, old, cut)
        if len(sectors) < 2:
            continue
        for number, sector in enumerate(sectors):
            direction = _bisector(node, sector, old, points)
            if number == 0:
                side[node] = direction
                continue
            for t, k in sector:
                triangles[t, k] = len(points) + len(new_points)
            new_points.append(points[node])
            new_sides.append(direction)
    if new_points:
        points, side = np.concatenate([points, new_points]), np.concatenate([side, new_sides])
    return InteriorMesh(points, triangles, side)


def _sectors(node: int, corners: list[tuple[int, int]], triangles: np.ndarray, cut: set) -> list[list[tuple[int, int]]]:
    """The (triangle, corner) pairs around ``node``, grouped by traversal of edges that are not crack edges."""
    across: dict[int, list[int]] = {}
    for i, (t, k) in enumerate(corners):
        for other in (int(triangles[t, (k + 1) % 3]), int(triangles[t, (k + 2) % 3])):
            if (min(node, other), max(node, other)) not in cut:
                across.setdefault(other, []).append(i)
    group = list(range(len(corners)))

    def root(i: int) -> int:
        while group[i] != i:
            i = group[i]
        return i

    for shared in across.values():
        if len(shared) == 2:
            a, b = root(shared[0]), root(shared[1])
            group[max(a, b)] = min(a, b)
    sectors: dict[int, list[tuple[int, int]]] = {}
    for i, pair in enumerate(corners):
        sectors.setdefault(root(i), []).append(pair)
    return list(sectors.values())


def _bisector(node: int, sector: list[tuple[int, int]], triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Unit bisector of the ``sector``: ∫(cos θ, sin θ)dθ over it, which has the right direction also beyond 180°."""
    total = np.zeros(2)
    for t, k in sector:
        a = points[triangles[t, (k + 1) % 3]] - points[node]
        b = points[triangles[t, (k + 2) % 3]] - points[node]
        first, second = np.arctan2(a[1], a[0]), np.arctan2(b[1], b[0])
        second += 2 * np.pi * (second < first)
        total += np.sin(second) - np.sin(first), np.cos(first) - np.cos(second)
    return total / np.hypot(*total)
