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
    if drawing.blocks is None or not meshed:
        return drawing
    # Imported here: a scene without cells needs no Gmsh.
    from ...shapes.cells import CannotMesh, divided
    from ...shapes.crack_cells import divided_around
    from ...shapes.gmsh_models.session import GmshUnavailable

    size = np.array([meshed[zone].mesh_size_m if zone in meshed else np.nan for zone in drawing.zones], float)
    shape = np.array([meshed[zone].cells if zone in meshed else "" for zone in drawing.zones])
    between = [cells_of(zone) if zone in meshed and meshed[zone].cell_joint else "" for zone in drawing.zones]
    cracks = drawing.cracks
    try:
        if cracks is not None and cracks.n_segments:
            wide = [meshed[zone].crack_margin_m if zone in meshed else None for zone in drawing.zones]
            margin = np.array([np.nan if width is None else width for width in wide])
            blocks, of, cracks = divided_around(drawing.blocks, cracks, size, shape, between, margin)
        else:
            blocks, of = divided(drawing.blocks, size, shape, between)
    except (CannotMesh, GmshUnavailable) as error:
        name = next(iter(meshed))
        faults.append(Fault(place(("zones", name, "mesh_size_m")), str(error), "try another size"))
        return drawing
    if cracks is not None:
        _refuse_enclosed(blocks, cracks, drawing, of, lambda zone: place(("zones", zone, "crack_margin_m")), faults)
    return replace(drawing, blocks=blocks, cracks=cracks, zones=tuple(drawing.zones[b] for b in of.tolist()))


def _refuse_enclosed(blocks, cracks, drawing: Drawing, of: np.ndarray, where, faults: list[Fault]) -> None:
    """A cell around a crack must not enclose a hole."""
    for block in np.unique(cracks.block).tolist():
        if np.count_nonzero(of == of[block]) > 1 and len(blocks.loops(block)) > 1:
            name = cracks.names[cracks.crack[cracks.block == block][0]]
            why = f"the cell around the crack {name!r} encloses a hole, around which one cell bends too little"
            faults.append(Fault(where(drawing.zones[of[block]]), why, "set a smaller crack_margin_m"))
