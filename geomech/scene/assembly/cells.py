"""Zones divided into cells that are bonded to each other: [zones.NAME] mesh_size_m."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..drawing import Drawing
from ..errors import Fault
from ..locator import Path
from ..tables import SceneTables

#: Prefix of the names of faces between cells.
CELLS = "cells:"


def cells_of(zone: str) -> str:
    """Name of the faces between the cells of ``zone``."""
    return CELLS + zone


def with_cells(tables: SceneTables, drawing: Drawing, place: Callable[[Path], str], faults: list[Fault]) -> Drawing:
    """``drawing`` with blocks of zones that have a mesh size divided into cells; errors are added to ``faults``."""
    meshed = {name: zone for name, zone in (tables.zones or {}).items() if zone.mesh_size_m is not None}
    if drawing.blocks is None or not meshed or (drawing.cracks is not None and drawing.cracks.n_segments):
        return drawing
    # Imported here: a scene without cells needs no Gmsh.
    from ...shapes.cells import CannotMesh, divided
    from ...shapes.gmsh_models.session import GmshUnavailable

    size = np.array([meshed[zone].mesh_size_m if zone in meshed else np.nan for zone in drawing.zones], float)
    shape = np.array([meshed[zone].cells if zone in meshed else "" for zone in drawing.zones])
    between = [cells_of(zone) if zone in meshed and meshed[zone].cell_joint else "" for zone in drawing.zones]
    try:
        blocks, of = divided(drawing.blocks, size, shape, between)
    except (CannotMesh, GmshUnavailable) as error:
        name = next(iter(meshed))
        faults.append(Fault(place(("zones", name, "mesh_size_m")), str(error), "try another size"))
        return drawing
    return replace(drawing, blocks=blocks, zones=tuple(drawing.zones[b] for b in of.tolist()))
