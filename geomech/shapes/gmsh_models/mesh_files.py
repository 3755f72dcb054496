"""Meshes of Gmsh (.msh) read as drawings: outlines are where triangles end, joints and cracks are lines of edges."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..parts import JOINT, Joint, Mark, Trace, Zone, is_mark
from .model_drawing import CRACK, GmshDrawing, GmshModelError

#: A node on a straight run is no corner: nodes leave the run by less than this part of its shorter neighbour edge.
_STRAIGHT = 1e-9


def drawing_of_mesh(gmsh, path: Path) -> GmshDrawing:
    """The `GmshDrawing` of the mesh in Gmsh's current model; the mesh itself is not kept.

    Every entity of a physical surface is a zone, or several where it falls apart. Raises GmshModelError for meshes
    without physical surfaces or with outlines that touch themselves.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    at = {int(tag): k for k, tag in enumerate(tags)}
    nodes = np.asarray(coordinates).reshape(-1, 3)
    warnings: list[tuple[str, str]] = []
    size = float(np.ptp(nodes, axis=0).max()) if len(nodes) else 0.0
    if len(nodes) and np.abs(nodes[:, 2]).max() > 1e-9 * size:
        worst = int(np.argmax(np.abs(nodes[:, 2])))
        warnings.append(
            (
                f"{path.name}: node {tags[worst]} has z = {nodes[worst, 2]:g} m",
                "the rock is plane and z is left away: draw in x and y, with z = 0",
            )
        )
    edge_name: dict[tuple[int, int], str] = {}
    lines: dict[str, list[tuple[int, int]]] = {}
    where: dict[str, list[int]] = {}
    for dim, group in gmsh.model.getPhysicalGroups(1):
        name = gmsh.model.getPhysicalName(dim, group)
        if not name:
            warnings.append((f"{path.name}: physical curve {group} has no name", "name it before meshing"))
            continue
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group):
            for a, b in _corners(gmsh, 1, int(entity), at):
                lines.setdefault(name, []).append((a, b))
            where.setdefault(name, []).append(int(entity))
    for name, pairs in lines.items():
        for pair in pairs if not is_mark(name) else ():
            edge = (min(pair), max(pair))
            if edge_name.setdefault(edge, name) != name:
                raise GmshModelError(
                    f"{path.name}: the edge from node {tags[pair[0]]} to node {tags[pair[1]]} is called both "
                    f"{edge_name[edge]!r} and {name!r}",
                    "give each edge one physical name",
                )
    zones, rim, places = [], set(), {}
    for dim, group in gmsh.model.getPhysicalGroups(2):
        name = gmsh.model.getPhysicalName(dim, group) or f"zone {group}"
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group):
            outline = _rim(_corners(gmsh, 2, int(entity), at), nodes)
            rim.update((min(pair), max(pair)) for pair in outline)
            loops = _loops(outline, path, int(entity), tags)
            for own in _nested(loops, nodes):
                places["zones", len(zones)] = f"surface {int(entity)}"
                kept = [_corners_of(loop, nodes, edge_name, closed=True) for loop in own]
                labels = []
                for loop, few in zip(own, kept):
                    label = {p[0]: edge_name.get((min(p), max(p)), "") for p in zip(loop, [*loop[1:], loop[0]])}
                    labels.append(tuple(label[node] for node in few))
                zones.append(Zone(name, tuple(nodes[few, :2] for few in kept), tuple(labels)))
    if not zones:
        raise GmshModelError(
            f"{path.name} has no physical surface",
            'name surfaces before meshing: Physical Surface("rock") = {1}; and save all physical groups',
        )
    traces, joints, marks = [], [], []
    for dim, group in gmsh.model.getPhysicalGroups(0):
        name = gmsh.model.getPhysicalName(dim, group)
        points = gmsh.model.mesh.getNodesForPhysicalGroup(dim, group)[0] if name else ()
        if len(points):
            places["marks", len(marks)] = f"node {', '.join(map(str, points))}"
            marks.append(Mark(name, tuple(nodes[[at[int(tag)]], :2] for tag in points)))
    for name, pairs in lines.items():
        if is_mark(name):
            places["marks", len(marks)] = f"curves {', '.join(map(str, where[name]))}"
            runs = tuple(nodes[_corners_of(run, nodes, {}, closed=False), :2] for run in chains(pairs))
            marks.append(Mark(name, runs))
            continue
        inner = [pair for pair in pairs if (min(pair), max(pair)) not in rim]
        if not inner:
            continue
        runs = tuple(nodes[_corners_of(run, nodes, {}, closed=False), :2] for run in chains(inner))
        if name.startswith(CRACK):
            places["cracks", len(traces)] = f"curves {', '.join(map(str, where[name]))}"
            traces.append(Trace(name[len(CRACK) :], runs))
        elif name.startswith(JOINT):
            places["joints", len(joints)] = f"curves {', '.join(map(str, where[name]))}"
            joints.append(Joint(name, runs))
        else:
            warnings.append(
                (f"{path.name}: physical curve {name!r} bounds no named surface", f'a crack is called "{CRACK}{name}"')
            )
    return GmshDrawing(tuple(zones), tuple(traces), {}, tuple(warnings), tuple(joints), places, tuple(marks))


def _corners(gmsh, dim: int, entity: int, at: dict[int, int]) -> np.ndarray:
    """(n, 2 | 3 | 4) corner nodes of the elements of an entity, -1 for a triangle's fourth."""
    rows = []
    kinds, _, connectivity = gmsh.model.mesh.getElements(dim, entity)
    for kind, flat in zip(kinds, connectivity):
        _, _, _, n_nodes, _, n_corners = gmsh.model.mesh.getElementProperties(int(kind))
        corners = np.asarray(flat).reshape(-1, n_nodes)[:, :n_corners]
        rows += [[at[int(tag)] for tag in row] for row in corners]
    width = max((len(row) for row in rows), default=dim + 1)
    return np.array([row + [-1] * (width - len(row)) for row in rows], dtype=int).reshape(-1, width)


def _rim(elements: np.ndarray, nodes: np.ndarray) -> list[tuple[int, int]]:
    """Edges that one element alone has, directed with the rock to their left."""
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
    """``run`` without the nodes that stand on a straight piece of one name."""
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
    runs = []
    for first in sorted(at, key=lambda k: (len(at[k]) == 2, k)):
        for edge in at[first]:
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
