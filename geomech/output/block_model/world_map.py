"""Export of blocks and cracks as GeoJSON in world coordinates, for GIS and CAD."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from geomech.model import Problem

from ..tables.summary import write_json


def write_world_map(
    problem: Problem, zones: tuple[str, ...], path: Path | str, crs: dict[str, Any] | None = None
) -> None:
    """Write the blocks and cracks of ``problem`` as the GeoJSON file ``path``.

    Blocks are polygons with "set" = "zone:NAME", block, material, fixed and area_m2; cracks are lines with "set" =
    "crack:NAME". ``zones`` names each block's zone, ``crs`` is the reference system of the files that were read. Read
    as traces of a scene, the file gives the same blocks.
    """
    blocks, cracks, origin = problem.blocks, problem.cracks, np.array(problem.origin)
    area = blocks.areas()

    def feature(kind: str, coordinates: Any, about: dict[str, Any]) -> dict[str, Any]:
        return {"type": "Feature", "properties": about, "geometry": {"type": kind, "coordinates": coordinates}}

    features = []
    for b, zone in enumerate(zones):
        rings = [(np.concatenate([loop, loop[:1]]) + origin).tolist() for loop in blocks.loops(b)]
        about = {
            "set": f"zone:{zone}",
            "block": b,
            "material": problem.materials[int(blocks.material[b])].name,
            "fixed": bool(blocks.fixed[b]),
            "area_m2": float(area[b]),
        }
        features.append(feature("Polygon", rings, about))
    for k, name in enumerate(cracks.names):
        for segment in cracks.segments[cracks.crack == k]:
            features.append(feature("LineString", (cracks.nodes[segment] + origin).tolist(), {"set": f"crack:{name}"}))
    system = {} if crs is None else {"crs": crs}
    write_json(Path(path), {"type": "FeatureCollection", **system, "features": features})
