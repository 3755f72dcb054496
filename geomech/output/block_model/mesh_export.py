"""Export of the block system as a mesh, in every format that meshio writes, chosen by the suffix of the file."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import numpy as np

from geomech.model import Blocks, Problem
from geomech.shapes.mesh_exchange import BLOCK
from geomech.shapes.meshing import SLIVER, mesh_interior

from ..vtk.triangulate import Triangles

log = logging.getLogger(__name__)


def check_format(path: Path) -> None:
    """Raise ValueError for a file suffix that meshio does not write."""
    import meshio

    known = sorted(meshio.extension_to_filetypes)
    if path.suffix.lower() not in known:
        raise ValueError(f"{path.suffix or path.name!r} is not a mesh format that can be written: {', '.join(known)}")


def export_blocks(problem: Problem, zones: list[str], path: Path, size: float | None = None) -> str:
    """Write the blocks of ``problem`` and their cracks to ``path``; returns a line that says what was written.

    Every block is divided into triangles of its own nodes: as few as possible, or with sides of about ``size`` m by
    Gmsh, split along its cracks. Sets are the ``zones`` (by block), "block:NUMBER", the names of edges and
    "crack:NAME"; cells have ``block_id``, ``zone`` and ``material``. Raises ValueError for a suffix that meshio does
    not know and for what its writer refuses.
    """
    import meshio

    check_format(path)
    blocks, cracks = problem.blocks, problem.cracks
    points, triangles, owner = _coarse(problem) if size is None else _fine(problem, size)
    edges = np.stack([np.arange(blocks.n_vertices), blocks.next_vertex], axis=1)
    named = np.flatnonzero(np.array([bool(name) for name in blocks.edge_names])[blocks.edge_name])
    start = len(points)
    if size is not None:
        # Gmsh's mesh has nodes of its own: edges and cracks use them.
        points = np.concatenate([points, blocks.vertices])
        edges = edges + start
    first_crack = len(points)
    points = np.concatenate([points, cracks.nodes])
    lines = np.concatenate([edges[named], cracks.segments + first_crack]).astype(int)
    label = [blocks.edge_names[k] for k in blocks.edge_name[named]]
    label += [f"crack:{cracks.names[k]}" for k in cracks.crack]
    sets: dict[str, list[np.ndarray]] = {}
    nothing = np.zeros(0, int)
    for name in dict.fromkeys(label):
        sets[name] = [np.flatnonzero(np.array(label) == name), nothing]
    zone_of = np.array([list(dict.fromkeys(zones)).index(zone) for zone in zones])
    for number, zone in enumerate(dict.fromkeys(zones)):
        sets[zone] = [nothing, np.flatnonzero(zone_of[owner] == number)]
    for block in range(blocks.n_blocks):
        sets[f"{BLOCK}{block}"] = [nothing, np.flatnonzero(owner == block)]
    whole = np.full(len(lines), -1)
    cells = [("line", lines), ("triangle", triangles)]
    data = {
        "block_id": [whole, owner],
        "zone": [whole, zone_of[owner]],
        "material": [whole, np.asarray(blocks.material)[owner]],
    }
    if not len(lines):
        cells, data = cells[1:], {name: values[1:] for name, values in data.items()}
        sets = {name: values[1:] for name, values in sets.items()}
    nodes = np.column_stack([points, np.zeros(len(points))])
    try:
        meshio.Mesh(nodes, cells, cell_data=data, cell_sets=sets).write(path)
    except (Exception, SystemExit) as error:  # meshio's writers raise many kinds of exceptions
        raise ValueError(f"{path}: meshio cannot write this format here: {error}") from error
    if path.suffix.lower() == ".inp":
        # meshio names the last types of its table, rigid faces and hybrid beams in space.
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("TYPE=R3D3", "TYPE=CPS3").replace("TYPE=B31H", "TYPE=T2D2"), encoding="utf-8")
    return f"{len(triangles)} triangles of {blocks.n_blocks} blocks, {len(lines)} edges and crack segments in {path}"


def _coarse(problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    cells, owner = Triangles().of(problem.blocks)
    return problem.blocks.vertices, cells, owner


def _fine(problem: Problem, size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    blocks: Blocks = problem.blocks
    points, triangles, owner, n = [], [], [], 0
    for block in range(blocks.n_blocks):
        mesh = mesh_interior(blocks.loops(block), problem.cracks.in_block(block), size, size)
        angle, (x, y) = mesh.flattest()
        if angle < SLIVER:
            log.warning(
                "block %d: triangles of %.2g degrees where cracks or its outline nearly touch, at (%.6g, %.6g) m: finite "
                "elements need such cracks to be joined or moved apart",
                block, math.degrees(angle), x, y,
            )  # fmt: skip
        points.append(mesh.points)
        triangles.append(mesh.triangles + n)
        owner.append(np.full(len(mesh.triangles), block))
        n += len(mesh.points)
    return np.concatenate(points), np.concatenate(triangles), np.concatenate(owner)
