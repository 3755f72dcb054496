"""Gmsh meshes (.msh) read as drawings: outlines are the boundaries of the triangles, joints and cracks are lines of
edges."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..parts import JOINT, Joint, Mark, Trace, Zone, is_mark
from .model_drawing import CRACK, GmshDrawing, GmshModelError

#: A node on a straight run is not a corner if its distance from the run is below this part of its shorter adjacent
#: edge.
_STRAIGHT = 1e-9


def drawing_of_mesh(gmsh, path: Path) -> GmshDrawing:
    """The `GmshDrawing` of the mesh in Gmsh's current model; the mesh itself is not kept.

    Every entity of a physical surface is a zone, or several if it consists of separate pieces. Raises GmshModelError
    for meshes without physical surfaces or with outlines that touch themselves.
    """
    mesh = _Mesh.of(gmsh, path)
    warnings = _out_of_plane(mesh)
    lines, where = _named_lines(mesh, warnings)
    places: dict[tuple[str, int], str] = {}
    zones, rim = _zones(mesh, _edge_names(mesh, lines), places)
    if not zones:
        raise GmshModelError(
            f"{path.name} has no physical surface",
            'name surfaces before meshing: Physical Surface("rock") = {1}; and save all physical groups',
        )
    traces: list[Trace] = []
    joints: list[Joint] = []
    marks = _marked_nodes(mesh, places)
    for name, pairs in lines.items():
        inner = pairs if is_mark(name) else [pair for pair in pairs if (min(pair), max(pair)) not in rim]
        if not inner:
            continue
        runs = tuple(mesh.nodes[_corners_of(run, mesh.nodes, {}, closed=False), :2] for run in chains(inner))
        source = f"curves {', '.join(map(str, where[name]))}"
        if is_mark(name):
            places["marks", len(marks)] = source
            marks.append(Mark(name, runs))
        elif name.startswith(CRACK):
            places["cracks", len(traces)] = source
            traces.append(Trace(name[len(CRACK) :], runs))
        elif name.startswith(JOINT):
            places["joints", len(joints)] = source
            joints.append(Joint(name, runs))
        else:
            warnings.append(
                (f"{path.name}: physical curve {name!r} bounds no named surface", f'a crack is called "{CRACK}{name}"')
            )
    return GmshDrawing(tuple(zones), tuple(traces), {}, tuple(warnings), tuple(joints), places, tuple(marks))


class _Mesh(NamedTuple):
    """The mesh in Gmsh's current model, from the file ``path``.

    nodes   (n, 3) m
    tags    (n,) numbers in the file
    at      index of each tag
    """

    gmsh: Any
    path: Path
    nodes: np.ndarray
    tags: np.ndarray
    at: dict[int, int]

    @classmethod
    def of(cls, gmsh: Any, path: Path) -> _Mesh:
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        at = {int(tag): k for k, tag in enumerate(tags)}
        return cls(gmsh, path, np.asarray(coordinates).reshape(-1, 3), tags, at)


def _out_of_plane(mesh: _Mesh) -> list[tuple[str, str]]:
    """A warning if nodes are off the plane z = 0."""
    nodes, tags = mesh.nodes, mesh.tags
    size = float(np.ptp(nodes, axis=0).max()) if len(nodes) else 0.0
    if not len(nodes) or not np.abs(nodes[:, 2]).max() > 1e-9 * size:
        return []
    worst = int(np.argmax(np.abs(nodes[:, 2])))
    message = f"{mesh.path.name}: node {tags[worst]} has z = {nodes[worst, 2]:g} m"
    return [(message, "the model is plane and z is ignored: draw in x and y, with z = 0")]


def _named_lines(
    mesh: _Mesh, warnings: list[tuple[str, str]]
) -> tuple[dict[str, list[tuple[int, int]]], dict[str, list[int]]]:
    """Edges of the physical curves of each name, and the entities on which they lie."""
    lines: dict[str, list[tuple[int, int]]] = {}
    where: dict[str, list[int]] = {}
    model = mesh.gmsh.model
    for dim, group in model.getPhysicalGroups(1):
        name = model.getPhysicalName(dim, group)
        if not name:
            warnings.append((f"{mesh.path.name}: physical curve {group} has no name", "name it before meshing"))
            continue
        for entity in model.getEntitiesForPhysicalGroup(dim, group):
            for a, b in _corners(mesh.gmsh, 1, int(entity), mesh.at):
                lines.setdefault(name, []).append((a, b))
            where.setdefault(name, []).append(int(entity))
    return lines, where


def _edge_names(mesh: _Mesh, lines: dict[str, list[tuple[int, int]]]) -> dict[tuple[int, int], str]:
    """Name of each edge on a physical curve that is not a mark."""
    edge_name: dict[tuple[int, int], str] = {}
    for name, pairs in lines.items():
        for pair in pairs if not is_mark(name) else ():
            edge = (min(pair), max(pair))
            if edge_name.setdefault(edge, name) != name:
                raise GmshModelError(
                    f"{mesh.path.name}: the edge from node {mesh.tags[pair[0]]} to node {mesh.tags[pair[1]]} is called both "
                    f"{edge_name[edge]!r} and {name!r}",
                    "give each edge one physical name",
                )
    return edge_name


def _zones(
    mesh: _Mesh, edge_name: dict[tuple[int, int], str], places: dict[tuple[str, int], str]
) -> tuple[list[Zone], set[tuple[int, int]]]:
    """Zones of all physical surfaces, and the edges around them; the place of each zone in the file is added to
    ``places``."""
    zones: list[Zone] = []
    rim: set[tuple[int, int]] = set()
    model, nodes = mesh.gmsh.model, mesh.nodes
    for dim, group in model.getPhysicalGroups(2):
        name = model.getPhysicalName(dim, group) or f"zone {group}"
        for entity in model.getEntitiesForPhysicalGroup(dim, group):
            outline = _rim(_corners(mesh.gmsh, 2, int(entity), mesh.at), nodes)
            rim.update((min(pair), max(pair)) for pair in outline)
            loops = _loops(outline, mesh.path, int(entity), mesh.tags)
            for own in _nested(loops, nodes):
                places["zones", len(zones)] = f"surface {int(entity)}"
                kept = [_corners_of(loop, nodes, edge_name, closed=True) for loop in own]
                labels = []
                for loop, few in zip(own, kept):
                    label = {p[0]: edge_name.get((min(p), max(p)), "") for p in zip(loop, [*loop[1:], loop[0]])}
                    labels.append(tuple(label[node] for node in few))
                zones.append(Zone(name, tuple(nodes[few, :2] for few in kept), tuple(labels)))
    return zones, rim


def _marked_nodes(mesh: _Mesh, places: dict[tuple[str, int], str]) -> list[Mark]:
    """Marks of all named physical points."""
    marks: list[Mark] = []
    model = mesh.gmsh.model
    for dim, group in model.getPhysicalGroups(0):
        name = model.getPhysicalName(dim, group)
        points = model.mesh.getNodesForPhysicalGroup(dim, group)[0] if name else ()
        if len(points):
            places["marks", len(marks)] = f"node {', '.join(map(str, points))}"
            marks.append(Mark(name, tuple(mesh.nodes[[mesh.at[int(tag)]], :2] for tag in points)))
    return marks


def _corners(gmsh, dim: int, entity: int, at: dict[int, int]) -> np.ndarray:
    """(n, 2 | 3 | 4) corner nodes of the elements of an entity, -1 for the fourth of a triangle."""
    rows = []
    kinds, _, connectivity = gmsh.model.mesh.getElements(dim, entity)
    for kind, flat in zip(kinds, connectivity):
        _, _, _, n_nodes, _, n_corners = gmsh.model.mesh.getElementProperties(int(kind))
        corners = np.asarray(flat).reshape(-1, n_nodes)[:, :n_corners]
        rows += [[at[int(tag)] for tag in row] for row in corners]
    width = max((len(row) for row in rows), default=dim + 1)
    return np.array([row + [-1] * (width - len(row)) for row in rows], dtype=int).reshape(-1, width)


def _rim(elements: np.ndarray, nodes: np.ndarray) -> list[tuple[int, int]]:
    """Edges that belong to one element only, directed with the rock on their left."""
    count: dict[tuple[int, int], int] = {}
    directed = []
    for element in elements.tolist():
        element = [k for k in element if k >= 0]
        x, y = nodes[element, 0], nodes[element, 1]
        if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0:
            element = element[::-1]
        for pair in zip(element, element[1:] + element[:1]):
            count[min(pair), max(pair)] = count.get((min(pair), max(pair)), 0) + 1
            directed.append(pair)
    return [pair for pair in directed if count[min(pair), max(pair)] == 1]


def _loops(edges: list[tuple[int, int]], path: Path, entity: int, tags: np.ndarray) -> list[list[int]]:
    following: dict[int, int] = {}
    for a, b in edges:
        if a in following:
            raise GmshModelError(
                f"{path.name}: the outline of surface {entity} touches itself at node {tags[a]}",
                "split the surface there, or move the outlines apart",
            )
        following[a] = b
    loops = []
    while following:
        first, here = next(iter(following.items()))
        del following[first]
        loop = [first]
        while here != first:
            loop.append(here)
            here = following.pop(here)
        loops.append(loop)
    return loops


def _nested(loops: list[list[int]], nodes: np.ndarray) -> list[list[list[int]]]:
    """Outlines, which turn left, each with the holes inside it."""
    import shapely

    turns = [_area(nodes[loop, :2]) for loop in loops]
    outer = [loop for loop, area in zip(loops, turns) if area > 0]
    shapes = [shapely.Polygon(nodes[loop, :2]) for loop in outer]
    out = [[loop] for loop in outer]
    for loop, area in zip(loops, turns):
        if area < 0:
            point = shapely.Point(nodes[loop[0], :2])
            holders = [k for k, shape in enumerate(shapes) if shape.covers(point)]
            out[min(holders, key=lambda k: shapes[k].area)].append(loop)
    return out


def _area(loop: np.ndarray) -> float:
    x, y = (loop - loop[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _corners_of(run: list[int], nodes: np.ndarray, edge_name: dict[tuple[int, int], str], closed: bool) -> list[int]:
    """``run`` without the nodes on straight pieces with one name."""
    xy = nodes[run, :2]
    before, after = xy - np.roll(xy, 1, axis=0), np.roll(xy, -1, axis=0) - xy
    off = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    length = np.hypot(*before.T) * np.hypot(*after.T)
    flat = (off <= _STRAIGHT * length) & (np.einsum("ij,ij->i", before, after) > 0)
    label = [edge_name.get((min(p), max(p)), "") for p in zip(run, [*run[1:], run[0]])]
    same = np.array([label[k] == label[k - 1] for k in range(len(run))])
    keep = ~(flat & same)
    if not closed:
        keep[[0, -1]] = True
    return [node for node, kept in zip(run, keep) if kept]


def chains(pairs: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Pairs of nodes joined into runs; a run ends where others meet it."""
    at: dict[int, list[tuple[int, int]]] = {}
    left = {(min(pair), max(pair)) for pair in pairs}
    for a, b in sorted(left):
        at.setdefault(a, []).append((a, b))
        at.setdefault(b, []).append((a, b))
    runs: list[list[int]] = []
    for first in sorted(at, key=lambda k: (len(at[k]) == 2, k)):
        for start in at[first]:
            edge: tuple[int, int] | None = start
            if edge not in left:
                continue
            run = [first]
            while edge is not None:
                left.discard(edge)
                run.append(edge[0] + edge[1] - run[-1])
                onward = [e for e in at[run[-1]] if e in left] if len(at[run[-1]]) == 2 else []
                edge = onward[0] if onward else None
            runs.append(run)
    return runs
