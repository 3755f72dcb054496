"""The block system of a scene as files, before anything runs: VTU, MSH, and its statistics as JSON."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from geomech.model import Blocks, Cracks, counted
from geomech.shapes.fracture_statistics import block_sizes, set_statistics
from geomech.shapes.parts import JOINT
from geomech.shapes.rock_bridges import rock_bridges

from .summary import write_json
from .triangulate import Triangles
from .vtu import LINE, TRIANGLE, Grid, GridFiles, world_origin

#: Parts of the rock, by area, that the block-size curve is given at.
_PASSING = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)


def write_block_system(scene: Any, folder: Path | str) -> dict[str, Any]:
    """Write ``block_system.vtu``, ``joint_lines.vtu``, ``block_system.msh`` and ``block_system.json`` of a loaded scene into
    ``folder``; what the JSON holds."""
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
    told = _statistics(scene, problem, area, bridges, names, zone)
    write_json(folder / "block_system.json", told)
    return told


def _write_msh(
    path: Path, blocks: Blocks, cracks: Cracks, cells: np.ndarray, owner: np.ndarray, zones: list[str], zone: np.ndarray
) -> None:
    """Gmsh's format 2.2: a surface a block, zones, edge names and cracks as physical groups. Read as a model it gives the
    same blocks."""
    curves = [name for name in blocks.edge_names if name] + [f"crack:{name}" for name in cracks.names]
    number = {name: k for k, name in enumerate(curves, 1)}
    groups = [f'1 {k} "{name}"' for name, k in number.items()]
    groups += [f'2 {len(curves) + k} "{name}"' for k, name in enumerate(zones, 1)]
    points = np.concatenate([blocks.vertices, cracks.nodes])
    rows = [f"{k} {x!r} {y!r} 0" for k, (x, y) in enumerate(points.tolist(), 1)]
    elements = []
    for edge, name in enumerate(blocks.edge_name.tolist()):
        label = blocks.edge_names[name]
        if label:
            elements.append(f"1 2 {number[label]} {number[label]} {edge + 1} {blocks.next_vertex[edge] + 1}")
    first = blocks.n_vertices + 1
    for (a, b), crack in zip(cracks.segments.tolist(), cracks.crack.tolist()):
        k = number[f"crack:{cracks.names[crack]}"]
        elements.append(f"1 2 {k} {k} {first + a} {first + b}")
    for (a, b, c), block in zip((cells + 1).tolist(), owner.tolist()):
        elements.append(f"2 2 {len(curves) + 1 + zone[block]} {block + 1} {a} {b} {c}")
    text = [
        "$MeshFormat",
        "2.2 0 8",
        "$EndMeshFormat",
        "$PhysicalNames",
        str(len(groups)),
        *groups,
        "$EndPhysicalNames",
    ]
    text += ["$Nodes", str(len(rows)), *rows, "$EndNodes", "$Elements", str(len(elements))]
    text += [f"{k} {element}" for k, element in enumerate(elements, 1)]
    path.write_text("\n".join([*text, "$EndElements", ""]), encoding="utf-8")


def _statistics(
    scene: Any, problem: Any, area: np.ndarray, bridges: np.ndarray, zones: list[str], zone: np.ndarray
) -> dict[str, Any]:
    import shapely

    blocks, cracks, jointed = problem.blocks, problem.cracks, scene.drawing.jointed
    free = ~blocks.fixed if (~blocks.fixed).any() else np.ones(blocks.n_blocks, bool)
    spans = np.hypot(*(bridges[:, 1] - bridges[:, 0]).T) if len(bridges) else np.empty(0)
    rock = shapely.union_all([shapely.Polygon(blocks.loops(b)[0], blocks.loops(b)[1:]) for b in np.flatnonzero(free)])
    asked = {shape.name: shape for shape in scene.tables.geometry.joint_sets}
    sets = []
    for joint in jointed.joints if jointed else ():
        shape = asked.get(joint.name.removeprefix(JOINT))
        region = rock
        if shape is not None and shape.region is not None:
            region = shapely.intersection(rock, shapely.Polygon(np.array(shape.region, dtype=float).reshape(-1, 2)))
        found = set_statistics(joint, region)
        own = np.array([name.rpartition(" ")[0] == joint.name.removeprefix(JOINT) for name in cracks.names], bool)
        dead = float(cracks.lengths[own[cracks.crack]].sum()) if cracks.n_segments else 0.0
        entry = {
            "name": joint.name.removeprefix(JOINT),
            "traces": found.traces,
            "p10_per_m": found.p10,
            "p20_per_m2": found.p20,
            "p21_per_m": found.p21,
            "mean_length_m": found.mean_length,
            "mean_angle_deg": math.degrees(found.mean_angle),
            "angle_deviation_deg": math.degrees(found.angle_deviation),
            "cracks": int(own.sum()),
            "crack_length_m": dead,
        }
        if shape is not None:
            entry["asked"] = shape.model_dump(exclude_defaults=True, exclude={"name", "region"})
        sets.append(entry)
    nodes = dict(jointed.cutting.nodes) if jointed else {"I": 0, "Y": 0, "X": 0}
    mends = [mend._asdict() for mend in jointed.cutting.mends] if jointed else []
    low, high = blocks.vertices.min(axis=0), blocks.vertices.max(axis=0)
    sizes = block_sizes(area[free], _PASSING)
    told = {
        "title": problem.title,
        "summary": f"{problem.inventory}, {counted(len(bridges), 'rock bridge')}",
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
        },
        "sets": sets,
        "nodes": nodes,
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
    told["lines"] = _lines(told, jointed)
    return told


def _lines(told: dict[str, Any], jointed: Any) -> list[str]:
    """The statistics for people."""
    size = told["blocks"]["size_m_by_part_passing"]
    rows = [
        f"  blocks    √area of 25, 50, 75 % of the rock at most {size['0.25']:.3g}, {size['0.5']:.3g}, {size['0.75']:.3g} m"
    ]
    if told["sets"]:
        rows[0] += f"; nodes I {told['nodes']['I']}, Y {told['nodes']['Y']}, X {told['nodes']['X']}"
    x, y = told["world_origin_m"]
    if x or y:
        rows.insert(0, f"  origin    ({x:.10g}, {y:.10g}) m: add it to every coordinate that is written")
    for entry in told["sets"]:
        text = f"{entry['name']}: {counted(entry['traces'], 'trace')} at {entry['mean_angle_deg']:.3g}°, "
        text += f"P10 {entry['p10_per_m']:.3g}/m, P20 {entry['p20_per_m2']:.3g}/m², P21 {entry['p21_per_m']:.3g} m/m²"
        rows.append(f"  joints    {text}")
    if told["rock_bridges"]["number"]:
        bridges = told["rock_bridges"]
        rows.append(
            f"  bridges   {bridges['number']}, mean {bridges['mean_m']:.3g} m, least {bridges['shortest_m']:.3g} m"
        )
    return rows + [f"  mended    {text}" for text in (jointed.told() if jointed else ())]
