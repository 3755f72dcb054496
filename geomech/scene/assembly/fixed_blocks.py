"""Fixed and guided blocks: by zone, or by the names of edges that they have after cutting."""

from __future__ import annotations

import numpy as np

from geomech.model import AUTO_ORDER, HIGHEST_ORDER

from ..checks.check import Check
from ..drawing import Drawing
from ..tables import SceneTables

#: Edges called "fixed" or "fixed:NAME" fix their blocks; with "guided:x" or "guided:x:NAME" these can move along x
#: only.
FIXED, GUIDED = "fixed", "guided"
#: Constrained unknowns of a block guided along an axis: translation across it, rotation and shear strain.
_CONSTRAINED = {"x": [1, 2, 5], "y": [0, 2, 5]}


def holds(name: str) -> bool:
    """Whether edges with this ``name`` fix or guide their blocks."""
    parts = name.split(":")
    return parts[0] == FIXED or (parts[0] == GUIDED and len(parts) > 1 and parts[1] in _CONSTRAINED)


def fixed_blocks(tables: SceneTables, drawing: Drawing) -> np.ndarray:
    """(n_blocks,) whether each block is fixed."""
    zones = tables.zones or {}
    # Unbounded rock does not move either; its cracks do.
    fixed = np.array(
        [zone in zones and (zones[zone].fixed or zones[zone].body != "block") for zone in drawing.zones], dtype=bool
    )
    blocks = drawing.blocks
    assert blocks is not None
    for name in blocks.edge_names:
        if name.partition(":")[0] == FIXED:
            fixed[blocks.vertex_block[blocks.edges_named(name)]] = True
    return fixed


def first_velocities(tables: SceneTables, drawing: Drawing) -> np.ndarray | None:
    """(n_blocks, 2) m/s at the start of the run; None if all are at rest."""
    zones = tables.zones or {}
    given = [zones[zone].velocity_m_s if zone in zones else None for zone in drawing.zones]
    found = np.array([(0.0, 0.0) if velocity is None else velocity for velocity in given], dtype=float).reshape(-1, 2)
    found[fixed_blocks(tables, drawing)] = 0.0
    return found if found.any() else None


def constrained_unknowns(tables: SceneTables, drawing: Drawing) -> np.ndarray | None:
    """(n_blocks, 6) which unknowns of guided blocks are constrained to zero; None if no block is guided."""
    constrained = np.zeros((len(drawing.zones), 6), bool)
    zones = tables.zones or {}
    for block, zone in enumerate(drawing.zones):
        axis = zones[zone].guided if zone in zones else None
        if axis is not None:
            constrained[block, _CONSTRAINED[axis]] = True
    assert drawing.blocks is not None
    for name in drawing.blocks.edge_names:
        if holds(name) and name.split(":")[0] == GUIDED:
            blocks = np.unique(drawing.blocks.vertex_block[drawing.blocks.edges_named(name)])
            constrained[np.ix_(blocks, np.array(_CONSTRAINED[name.split(":")[1]]))] = True
    return constrained if constrained.any() else None


def block_orders(tables: SceneTables, drawing: Drawing) -> np.ndarray | None:
    """(n_blocks,) order of each block's displacement, 1 if it is fixed, `AUTO_ORDER` if it is chosen during the run;
    None if all are of first order. Cells around cracks, which are larger than others, have the highest."""
    zones = tables.zones or {}
    given = [zones[zone].order if zone in zones else 1 for zone in drawing.zones]
    order = np.array([AUTO_ORDER if p == "auto" else p for p in given], dtype=int)
    if drawing.cracks is not None:
        cells = np.array([zone in zones and zones[zone].mesh_size_m is not None for zone in drawing.zones], bool)
        order[np.intersect1d(drawing.cracks.block, np.flatnonzero(cells))] = HIGHEST_ORDER
    order[fixed_blocks(tables, drawing)] = 1
    return order if (order != 1).any() else None


def check_holding(c: Check) -> None:
    """Names of guided edges must include an axis."""
    for name in c.blocks.edge_names:
        if name.partition(":")[0] == GUIDED and not holds(name):
            c.refuse(
                ("geometry",),
                f"edges are called {name!r}, without the axis along which their blocks are guided",
                'call them "guided:x" or "guided:y"',
            )


def check_borne(c: Check) -> None:
    """Weight needs a support: without one all blocks fall together, and nothing else happens."""
    t, blocks = c.tables, c.blocks
    if t.loads is None or t.zones is None or not any(t.loads.gravity_m_s2):
        return
    loads = t.loads
    pushed = (
        loads.tractions or loads.forces or loads.motions or loads.point_motions or loads.bolts
        or loads.viscous_boundaries or loads.water is not None
    )  # fmt: skip
    if pushed or fixed_blocks(t, c.drawn).any() or constrained_unknowns(t, c.drawn) is not None:
        return
    lowest = int(blocks.vertex_block[np.argmin(blocks.vertices @ -np.array(loads.gravity_m_s2))])
    others = blocks.n_blocks - 1
    falls = f" and {others} more blocks" if others > 1 else " and the other block" if others else ""
    c.refuse(
        ("loads", "gravity_m_s2"),
        f"nothing supports the weight of {blocks.names[lowest]!r}{falls}: no block is fixed or guided, and no load, "
        "motion, bolt or water holds them",
        "set `fixed = true` in the [zones.NAME] of their base, or draw a base and call its edges `fixed`",
    )
