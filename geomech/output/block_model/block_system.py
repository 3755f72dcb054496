"""Files of a scene's block system before a run: VTU, MSH, and its statistics as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from geomech.model import Blocks, Cracks, counted
from geomech.scene.assembly.load_functions import deepest_pond, pond_text
from geomech.shapes.joint_networks.fracture_statistics import Topology, block_sizes, passing_curve
from geomech.shapes.joint_networks.rock_bridges import rock_bridges
from geomech.shapes.mesh_exchange import PhysicalMesh, msh_text

from ..tables.joint_statistics import given, joint_statistics, network_of, table
from ..tables.summary import write_json
from ..vtk.triangulate import Triangles
from ..vtk.vtu import LINE, TRIANGLE, Grid, GridFiles, world_origin
from .world_map import write_world_map

#: Percentages of the rock, by area, at which the block-size curve is given.
_PASSING = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)


def write_block_system(scene: Any, folder: Path | str) -> dict[str, Any]:
    """Write the block system of a loaded scene into ``folder``; returns the content of the JSON file.

    The files are ``block_system.vtu``, ``joint_lines.vtu``, ``block_system.msh`` and ``block_system.json``; if the
    scene has mapped traces or an origin, also ``block_system.geojson`` in world coordinates.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    problem = scene.problem()
    blocks, cracks, zones = problem.blocks, problem.cracks, scene.drawing.zones
    names = list(dict.fromkeys(zones))
    zone = np.array([names.index(name) for name in zones])
    bridges = rock_bridges(blocks, cracks)
    origin = world_origin(problem)
    cells, owner = Triangles().of(blocks)
    area = blocks.areas()
    GridFiles("block_system").write(
        folder / "block_system.vtu",
        Grid(
            points=blocks.vertices,
            connectivity=cells.ravel(),
            offsets=np.arange(3, 3 * len(cells) + 1, 3),
            types=np.full(len(cells), TRIANGLE),
            cell_data={
                "block_id": owner,
                "zone": zone[owner],
                "material": blocks.material[owner],
                "fixed": blocks.fixed[owner],
                "area": area[owner],
            },
        ),
        origin,
    )
    edges = np.stack([blocks.vertices, blocks.vertices[blocks.next_vertex]], axis=1)
    lines = np.concatenate([edges, cracks.nodes[cracks.segments], bridges])
    n = len(lines)
    GridFiles("joint_lines").write(
        folder / "joint_lines.vtu",
        Grid(
            points=lines.reshape(-1, 2),
            connectivity=np.arange(2 * n),
            offsets=np.arange(2, 2 * n + 1, 2),
            types=np.full(n, LINE),
            cell_data={
                "name_id": np.concatenate([blocks.edge_name, cracks.crack, np.full(len(bridges), -1)]),
                "kind": np.repeat([0, 1, 2], [len(edges), cracks.n_segments, len(bridges)]),
            },
        ),
        origin,
    )
    _write_msh(folder / "block_system.msh", blocks, cracks, cells, owner, names, zone)
    if scene.tables.geometry.traces or any(problem.origin):
        write_world_map(problem, zones, folder / "block_system.geojson", scene.drawing.crs)
    statistics = _statistics(scene, problem, area, bridges, names, zone)
    write_json(folder / "block_system.json", statistics)
    return statistics


def _write_msh(
    path: Path, blocks: Blocks, cracks: Cracks, cells: np.ndarray, owner: np.ndarray, zones: list[str], zone: np.ndarray
) -> None:
    """Gmsh's format 2.2: one surface per block; zones, edge names and cracks as physical groups.

    Read as a model, it gives the same blocks.
    """
    curves = [name for name in blocks.edge_names if name] + [f"crack:{name}" for name in cracks.names]
    number = {name: k for k, name in enumerate(curves)}
    lines = []
    for edge, name in enumerate(blocks.edge_name.tolist()):
        label = blocks.edge_names[name]
        if label:
            lines.append((number[label], number[label] + 1, edge, int(blocks.next_vertex[edge])))
    first = blocks.n_vertices
    for (a, b), crack in zip(cracks.segments.tolist(), cracks.crack.tolist()):
        k = number[f"crack:{cracks.names[crack]}"]
        lines.append((k, k + 1, first + a, first + b))
    faces = [(int(zone[block]), block + 1, *nodes) for nodes, block in zip(cells.tolist(), owner.tolist())]
    points = np.concatenate([blocks.vertices, cracks.nodes])
    path.write_text(msh_text(PhysicalMesh(points, curves, zones, lines, faces)), encoding="utf-8")


def _statistics(
    scene: Any, problem: Any, area: np.ndarray, bridges: np.ndarray, zones: list[str], zone: np.ndarray
) -> dict[str, Any]:
    blocks, cracks, jointed = problem.blocks, problem.cracks, scene.drawing.jointed
    free = ~blocks.fixed if (~blocks.fixed).any() else np.ones(blocks.n_blocks, bool)
    spans = np.hypot(*(bridges[:, 1] - bridges[:, 0]).T) if len(bridges) else np.empty(0)
    sets = joint_statistics(scene, problem, free)
    nodes = network_of(scene).nodes
    topology = Topology.of(nodes)
    mends = [mend._asdict() for mend in jointed.cutting.repairs] if jointed else []
    low, high = blocks.vertices.min(axis=0), blocks.vertices.max(axis=0)
    sizes = block_sizes(area[free], _PASSING)
    pond = deepest_pond(scene.tables, blocks)
    statistics = {
        "title": problem.title,
        "summary": ", ".join(
            [
                problem.inventory,
                *([counted(len(bridges), "rock bridge")] if len(bridges) else []),
                *([] if pond is None else [f"water {pond_text(*pond, problem.origin)}"]),
            ]
        ),
        "ponded_water": None if pond is None else {**pond[0]._asdict(), "time_s": pond[1]},
        "box_m": [low.tolist(), high.tolist()],
        "world_origin_m": list(problem.origin),
        "area_m2": float(area.sum()),
        "blocks": {
            "number": blocks.n_blocks,
            "fixed": int(blocks.fixed.sum()),
            "zones": [
                {"name": name, "blocks": int((zone == k).sum()), "area_m2": float(area[zone == k].sum())}
                for k, name in enumerate(zones)
            ],
            "smallest_m2": float(area.min()),
            "largest_m2": float(area.max()),
            "size_m_by_part_passing": {f"{p:g}": size for p, size in sizes.items()},
            "d10_m": sizes[0.1],
            "d50_m": sizes[0.5],
            "d90_m": sizes[0.9],
            "percent_passing_by_size_m": passing_curve(area[free]).tolist(),
        },
        "sets": sets,
        "nodes": nodes,
        "topology": {
            "branches": topology.branches,
            "lines": topology.lines,
            "connections_per_branch": given(topology.per_branch),
            "connections_per_line": given(topology.per_line),
        },
        "cracks": {
            "number": cracks.n_cracks,
            "ends_in_rock": len(cracks.tips),
            "length_m": float(cracks.lengths.sum()) if cracks.n_segments else 0.0,
            "names": list(cracks.names),
        },
        "rock_bridges": {
            "number": len(spans),
            "shortest_m": float(spans.min()) if len(spans) else None,
            "mean_m": float(spans.mean()) if len(spans) else None,
        },
        "edge_names": list(blocks.edge_names),
        "mended": mends,
    }
    statistics["lines"] = _lines(statistics, jointed)
    return statistics


def _lines(statistics: dict[str, Any], jointed: Any) -> list[str]:
    """The statistics as lines of text."""
    size = statistics["blocks"]
    rows = [
        (
            f"  blocks    √area of 10, 50, 90 % of the rock at most {size['d10_m']:.3g}, {size['d50_m']:.3g}, "
            f"{size['d90_m']:.3g} m"
        )
    ]
    if statistics["sets"]:
        nodes, topology = statistics["nodes"], statistics["topology"]
        text = f"  nodes     I {nodes['I']}, Y {nodes['Y']}, X {nodes['X']}"
        if topology["connections_per_branch"] is not None:
            text += f"; {topology['connections_per_branch']:.2f} connections per branch"
        if topology["connections_per_line"] is not None:
            text += f", {topology['connections_per_line']:.3g} per line"
        rows.append(text)
        rows += [f"  {row}" for row in table(statistics["sets"])]
    x, y = statistics["world_origin_m"]
    if x or y:
        rows.insert(0, f"  origin    ({x:.10g}, {y:.10g}) m: add it to every written coordinate")
    if statistics["rock_bridges"]["number"]:
        bridges = statistics["rock_bridges"]
        rows.append(
            f"  bridges   {bridges['number']}, mean {bridges['mean_m']:.3g} m, least {bridges['shortest_m']:.3g} m"
        )
    return rows + [
        f"  repaired   {text}" for text in (jointed.repair_lines("listed in block_system.json") if jointed else ())
    ]
