"""Scenes of unbounded rock: the infinite plane or a half-plane, of which one zone is the displayed part."""

from __future__ import annotations

from fnmatch import fnmatchcase

import numpy as np

from ..conventions import outward_normal_of, traction
from ..model import EndlessRock, Fluid, History
from ..model.blocks.polygon import distance_to_edges
from ..model.unbounded_rock import connected_cracks
from .checks.check import Check
from .drawing import Drawing
from .tables import SceneTables
from .tables.entries import given
from .tables.loads import FluidTable, RemoteTable
from .validation import nearest

#: Edges lie on the free surface to within this part of the drawing's size; a stress counts as parallel to it to within
#: this part of its magnitude.
_STRAIGHT, _FREE = 1e-9, 1e-9
#: Loads on unbounded rock; all other loads act on blocks.
_ACTS = ("remote", "fluids")


def endless_zone(tables: SceneTables) -> str | None:
    """The zone that stands for unbounded rock; None in a scene of blocks."""
    return next((name for name, zone in (tables.zones or {}).items() if zone.body != "block"), None)


def endless_of(tables: SceneTables, drawing: Drawing) -> EndlessRock | None:
    """The unbounded rock of a scene without faults."""
    name = endless_zone(tables)
    if name is None:
        return None
    loads = tables.loads
    surface = tables.zones[name].surface
    return EndlessRock(
        None if surface is None else _surface(drawing, surface),
        tuple(rising_history(table) for table in loads.remote),
        tuple(_fluid(table, drawing) for table in loads.fluids),
    )


def _fluid(table: FluidTable, drawing: Drawing) -> Fluid:
    connected = bool(table.cracks) if table.connected is None else table.connected
    names = tuple(
        name for pattern in table.cracks for name in drawing.assembled()[1].names if fnmatchcase(name, pattern)
    )
    return Fluid(rising_history(table), "cracks" in table.fills, "holes" in table.fills, names, connected)


def rising_history(table: RemoteTable | FluidTable) -> History:
    """The history of ``table``, (3,) for a stress or (1,) for a pressure."""
    if table.value_pa is not None:
        return History.constant(np.atleast_1d(table.value_pa))
    if table.rate_pa_per_s is not None:
        return History.ramp(np.atleast_1d(table.rate_pa_per_s), table.start_s)
    values = np.array(given(table.values_pa), dtype=float)
    return History(np.array(given(table.times_s), dtype=float), values.reshape(len(values), -1))


def _surface(drawing: Drawing, name: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """A point of the free surface, the edges called ``name``, and its outward normal."""
    blocks, _ = drawing.assembled()
    first = int(blocks.edges_named(name)[0])
    a, b = blocks.vertices[first], blocks.vertices[blocks.next_vertex[first]]
    outward = outward_normal_of((b - a) / np.hypot(*(b - a))) + 0.0
    return (float(a[0]), float(a[1])), (float(outward[0]), float(outward[1]))


def check_endless(c: Check) -> None:
    """Unbounded rock must be the only block, loaded by remote stress or fluids."""
    t = c.tables
    if t.zones is None or t.loads is None:
        return
    name = endless_zone(t)
    if name is None:
        for key in _ACTS:
            if getattr(t.loads, key):
                c.refuse(
                    ("loads", key, 0),
                    f"loads.{key} act on unbounded rock, and there are blocks only",
                    'set body = "plane" or "half-plane" in the zone\'s table, or load edges by [[loads.tractions]]',
                )
        return
    body = t.zones[name].body
    for key, field in type(t.loads).model_fields.items():
        if key not in _ACTS and getattr(t.loads, key) != field.get_default():
            c.refuse(
                ("loads", key), f"loads.{key} is for blocks, and zone {name!r} is unbounded rock",
                "load it by [[loads.remote]] and [[loads.fluids]]",
            )  # fmt: skip
    if t.dda is not None and (t.dda.dynamic_factor > 0 or t.dda.equilibrium):
        key = "dynamic_factor" if t.dda.dynamic_factor > 0 else "equilibrium"
        c.refuse(("dda", key), f'cracks in unbounded rock (body = "{body}") grow in statics only', "leave it out")
    for key in ("gauge", "monitors"):
        if getattr(t, key):
            c.refuse((key,), f"points move with a block, and zone {name!r} is unbounded rock", "leave it out")
    if c.drawing is None or c.drawing.blocks is None or name not in c.drawing.zones:
        return
    _alone(c, name)
    if _surface_is_straight(c, name):
        _surface_is_free(c, name)
        _ends(c, name)
    _fluids(c)


def _fluids(c: Check) -> None:
    """Cracks into which a fluid is pumped must exist; a fluid in unconnected cracks is reported."""
    cracks = c.cracks
    for k, table in enumerate(c.tables.loads.fluids):
        for n, pattern in enumerate(table.cracks):
            if not any(fnmatchcase(name, pattern) for name in cracks.names):
                c.refuse(
                    ("loads", "fluids", k, "cracks", n), f"there is no crack {pattern!r}",
                    nearest(pattern, list(cracks.names)),
                )  # fmt: skip
        if "cracks" not in table.fills or table.cracks or not cracks.n_segments:
            continue
        group = connected_cracks(cracks)
        parts = [cracks.names[int(cracks.crack[np.argmax(group == part)])] for part in np.unique(group)]
        if len(parts) > 1:
            shown = ", ".join(map(repr, parts[:4])) + (", …" if len(parts) > 4 else "")
            c.warn(
                ("loads", "fluids", k),
                f"it fills {len(parts)} unconnected cracks or groups of cracks ({shown})",
                'name those into which it is pumped: cracks = ["NAME"]',
            )


def _alone(c: Check, name: str) -> None:
    n = c.blocks.n_blocks
    if n > 1:
        c.refuse(
            ("zones", name, "body"), f"unbounded rock contains cracks and holes only, and there are {n} blocks",
            "draw one zone, without joints that cut it; draw cavities as holes in it",
        )  # fmt: skip


def _surface_is_straight(c: Check, zone: str) -> bool:
    name, blocks = c.tables.zones[zone].surface, c.blocks
    if name is None:
        return True
    place = ("zones", zone, "surface")
    edges = blocks.edges_named(name)
    if not len(edges):
        known = [known for known in blocks.edge_names if known]
        c.refuse(place, f"the geometry has no edge {name!r}", nearest(name, known))
        return False
    point, outward = _surface(c.drawn, name)
    height = (blocks.vertices - point) @ outward
    off = _STRAIGHT * np.ptp(blocks.vertices, axis=0).max()
    on = np.concatenate([height[edges], height[blocks.next_vertex[edges]]])
    if np.abs(on).max() > off or height.max() > off:
        c.refuse(
            place, f"the edges {name!r} do not form a straight line with all of zone {zone!r} on one side of it",
            "a half-plane has one straight surface; model a notch or a slope as a block",
        )  # fmt: skip
        return False
    return True


def _surface_is_free(c: Check, zone: str) -> None:
    """Remote stress must leave the free surface free of traction."""
    surface = c.tables.zones[zone].surface
    if surface is None:
        return
    _, outward = _surface(c.drawn, surface)
    histories = [rising_history(table) for table in c.tables.loads.remote]
    end = c.tables.run.end_time_s if c.tables.run is not None else 1.0
    for k, table in enumerate(c.tables.loads.remote):
        values = [history.at(time) for history in histories[k : k + 1] for time in (*history.times.tolist(), end)]
        worst = max(values, key=lambda stress: np.hypot(*traction(stress, np.array(outward))))
        pulled = traction(worst, np.array(outward))
        if np.hypot(*pulled) > _FREE * np.abs(worst).max():
            key = next(key for key in ("value_pa", "rate_pa_per_s", "values_pa") if getattr(table, key) is not None)
            c.refuse(
                ("loads", "remote", k, key),
                f"this stress has a traction of ({pulled[0]:g}, {pulled[1]:g}) Pa at the free surface",
                "only a stress along the surface is possible in a half-plane: [σ, 0, 0] below a level one",
            )


def _ends(c: Check, zone: str) -> None:
    """Cracks must end in the rock, at a hole or at the free surface: the outline of the displayed part is not a
    boundary."""
    blocks, cracks, name = c.blocks, c.cracks, c.tables.zones[zone].surface
    outline = np.arange(blocks.loop_start[0], blocks.loop_start[1])
    if name is not None:
        outline = np.setdiff1d(outline, blocks.edges_named(name))
    a, b = blocks.vertices[outline], blocks.vertices[blocks.next_vertex[outline]]
    for node in np.flatnonzero(cracks.surface).tolist():
        at = cracks.nodes[node]
        if distance_to_edges(at, a, b) <= _STRAIGHT * np.ptp(blocks.vertices, axis=0).max():
            crack = cracks.names[cracks.crack[np.argmax((cracks.segments == node).any(axis=1))]]
            c.refuse(
                c.drawn.path_of_crack(crack),
                f"crack {crack!r} ends at ({at[0]:g}, {at[1]:g}) on the outline of zone {zone!r}, beyond which the rock continues",
                "enlarge the zone, or end the crack inside it",
            )
