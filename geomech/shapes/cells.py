"""Division of blocks into triangles or quadrilaterals by Gmsh, or into Voronoi cells of the size of such triangles: cells of
rock that is continuous across their faces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..model import Blocks
from .gmsh_models.session import gmsh_session
from .voronoi_cells import voronoi_mesh

#: Separator between the name of a block and the number of its cell.
CELL = "#"


#: A point is on an edge where its distance is below this part of the block's extent.
_ON_EDGE = 1e-9


class CannotMesh(RuntimeError):
    """Gmsh failed to divide a block."""


def rock_of(name: str) -> str:
    """Name of the block to which the cell ``name`` belongs; a block that is not a cell is its own."""
    return name.partition(CELL)[0]


def divided(
    blocks: Blocks, size: np.ndarray, shape: np.ndarray, between: Sequence[str] | None = None,
    along: Mapping[int, Sequence[np.ndarray]] | None = None,
) -> tuple[Blocks, np.ndarray]:  # fmt: skip
    """``blocks`` with those that have a ``size`` divided into cells; and the block (n_cells,) of each.

    ``size`` (n_blocks,) m is the approximate cell size, nan for undivided blocks; ``shape`` (n_blocks,) is "triangles",
    "quads" or "voronoi"; no cell crosses the lines (n, 2) ``along`` which blocks (block →) are divided. Sides of cells keep the names of the edges on which they lie, those between cells have the name
    ``between`` (n_blocks,), if any. Raises CannotMesh naming the block.
    """
    polygons, names, edge_names, parent, glued, n = [], [], [], [], [], 0
    start, labels = blocks.vertex_start, blocks.edge_names
    for b in range(blocks.n_blocks):
        loops = [
            np.arange(blocks.loop_start[k], blocks.loop_start[k + 1])
            for k in range(blocks.block_loop[b], blocks.block_loop[b + 1])
        ]
        if not np.isfinite(size[b]):
            polygons.append([blocks.vertices[loop] for loop in loops])
            edge_names.append([[labels[blocks.edge_name[v]] for v in loop] for loop in loops])
            names.append(blocks.names[b])
            parent.append(b)
            n += int(start[b + 1] - start[b])
            continue
        try:
            outlines = [blocks.vertices[loop] for loop in loops]
            points, cells, lines = _mesh(
                outlines, float(size[b]), str(shape[b]), () if along is None else along.get(b, ())
            )
        except Exception as error:
            raise CannotMesh(
                f"{blocks.names[b]!r} cannot be divided into cells ({shape[b]}) of {size[b]:g} m: {error}"
            ) from error
        edge_of, inner = dict(lines), "" if between is None else between[b]
        vertices = np.concatenate(loops)
        sides: dict[tuple[int, int], int] = {}
        for k, cell in enumerate(cells):
            ring = list(zip(cell, [*cell[1:], cell[0]], strict=True))
            own = []
            for side, (one, two) in enumerate(ring):
                if (two, one) in sides:
                    glued.append((sides.pop((two, one)), n + side))
                else:
                    sides[one, two] = n + side
                edge = edge_of.get((min(one, two), max(one, two)))
                own.append(inner if edge is None else labels[blocks.edge_name[vertices[edge]]])
            polygons.append([points[cell]])
            edge_names.append([own])
            names.append(f"{blocks.names[b]}{CELL}{k + 1}")
            n += len(cell)
        parent += [b] * len(cells)
    out = Blocks.from_polygons(polygons, edge_names=edge_names, names=names)
    of = np.array(parent)
    out = replace(
        out, material=blocks.material[of], fixed=blocks.fixed[of],
        constrained=None if blocks.constrained is None else blocks.constrained[of],
        order=None if blocks.order is None else blocks.order[of],
        glued=np.array(glued, np.int64).reshape(-1, 2) if glued else None,
    )  # fmt: skip
    return out, of


def _mesh(loops: list[np.ndarray], size: float, shape: str, along: Sequence[np.ndarray] = ()):
    """Points (n, 2), cells (lists of them, counter-clockwise), and ((a, b), edge), a < b, for all sides on
    the edges of ``loops``, numbered one after the other; cells do not cross the lines ``along``."""
    with gmsh_session("cells") as gmsh:
        geo, mesh, option = gmsh.model.geo, gmsh.model.mesh, gmsh.option.setNumber
        lines, rings, corners = [], [], []
        loops, of_edge = _with_ends(loops, along)
        tag_of: dict[bytes, int] = {}
        for loop in loops:
            tags = [geo.addPoint(x, y, 0.0) for x, y in loop.tolist()]
            tag_of |= zip((point.tobytes() for point in loop), tags, strict=True)
            corners.append(tags)
            own = [geo.addLine(a, b) for a, b in zip(tags, tags[1:] + tags[:1], strict=True)]
            lines += own
            rings.append(geo.addCurveLoop(own))
        surface = geo.addPlaneSurface(rings)
        inner = []
        for line in along:
            for point in line:
                if point.tobytes() not in tag_of:
                    tag_of[point.tobytes()] = geo.addPoint(*point.tolist(), 0.0)
            inner += [geo.addLine(tag_of[a.tobytes()], tag_of[b.tobytes()]) for a, b in pairwise(line)]
        geo.synchronize()
        if inner:
            mesh.embed(1, inner, 2, surface)
        option("Mesh.MeshSizeExtendFromBoundary", 1)
        option("Mesh.MeshSizeFromPoints", 0)
        option("Mesh.MeshSizeMax", size)
        option("Mesh.Algorithm", 6)
        if shape == "quads":
            option("Mesh.Algorithm", 8)
            option("Mesh.RecombinationAlgorithm", 1)
            mesh.setRecombine(2, surface)
            if len(loops) == 1 and len(lines) == 4 and not inner:
                length = np.hypot(*(np.roll(loops[0], -1, axis=0) - loops[0]).T)
                for k in range(4):
                    count = max(1, round(max(length[k], length[(k + 2) % 4]) / size))
                    mesh.setTransfiniteCurve(lines[k], count + 1)
                mesh.setTransfiniteSurface(surface, "Left", corners[0])
        mesh.generate(2)
        nodes, coordinates, _ = mesh.getNodes()
        number = np.full(int(nodes.max()) + 1, -1)
        number[nodes] = np.arange(len(nodes))
        points = np.ascontiguousarray(coordinates.reshape(-1, 3)[:, :2])
        cells = [cell for kind, width in ((2, 3), (3, 4)) for cell in _of_kind(mesh, number, kind, width, surface)]
        sides = [
            ((min(a, b), max(a, b)), edge)
            for edge, line in zip(of_edge, lines, strict=True)
            for a, b in number[mesh.getElementsByType(1, line)[1]].reshape(-1, 2).tolist()
        ]
    if not cells:
        raise CannotMesh("Gmsh has made no cells")
    if shape == "voronoi":
        mesh_of = voronoi_mesh(loops, points[np.array(cells)], along)
        return mesh_of.points, mesh_of.cells, [(side, of_edge[edge]) for side, edge in mesh_of.sides]
    for cell in cells:
        x, y = points[cell].T
        if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) < 0:
            cell.reverse()
    return points, cells, sides


def _with_ends(loops: list[np.ndarray], along: Sequence[np.ndarray]) -> tuple[list[np.ndarray], list[int]]:
    """``loops`` with the ends of the lines ``along`` on them as vertices, and the edge of before, numbered one after the
    other, on which each edge is."""
    ends = np.array([line[k] for line in along if (line[0] != line[-1]).any() for k in (0, -1)]).reshape(-1, 2)
    out, of_edge, edge, extent = [], [], 0, max(float(np.ptp(loop, axis=0).max()) for loop in loops)
    for loop in loops:
        points: list[np.ndarray] = []
        for start, end in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            way = end - start
            share = (ends - start) @ way / (way @ way)
            apart = np.hypot(*(ends - start - share[:, None] * way).T)
            on = np.flatnonzero((apart <= _ON_EDGE * extent) & (share > 0.0) & (share < 1.0))
            on = on[(ends[on] != start).any(axis=1) & (ends[on] != end).any(axis=1)]
            points += [start, *ends[on[np.argsort(share[on])]]]
            of_edge += [edge] * (len(on) + 1)
            edge += 1
        out.append(np.array(points))
    return out, of_edge


def _of_kind(mesh, number: np.ndarray, kind: int, width: int, surface: int) -> list[list[int]]:
    """Elements of Gmsh's type ``kind`` with ``width`` nodes."""
    return number[mesh.getElementsByType(kind, surface)[1]].reshape(-1, width).tolist()
