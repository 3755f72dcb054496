"""Checks of supports: moving blocks must have mass, and loads on unsupported blocks must balance."""

from __future__ import annotations

import numpy as np

from ...model import Blocks
from ..assembly.fixed_blocks import fixed_blocks
from ..assembly.load_functions import force_history, traction_history
from ..tables import SceneTables
from ..unbounded_rock import endless_zone
from .action_checks import records_are_sound
from .check import Check
from .cross_checks import blocks_at, material_of


def check_loads(c: Check) -> None:
    """Loads on blocks without supports must balance; blocks that can move must have mass."""
    if c.drawing is None or c.drawing.blocks is None:
        return
    t, blocks = c.tables, c.blocks
    if t.zones is None or t.materials is None or endless_zone(t) is not None:
        return
    fixed = fixed_blocks(t, c.drawn)
    if t.loads is not None and not records_are_sound(c):
        return
    acts = t.loads is not None and bool(
        t.loads.motions or t.loads.point_motions or t.loads.bolts or t.loads.base or t.loads.water or t.loads.in_situ
    )
    if t.loads is not None and not acts and _loads_are_lost(c, fixed):
        return
    if fixed.all():
        c.warn(("zones",), "all blocks are fixed: nothing moves", "let a zone move")
        return
    for zone in dict.fromkeys(z for z, f in zip(c.drawn.zones, fixed) if not f):
        name = material_of(t, zone)
        if name in t.materials and t.materials[name].density_kg_m3 == 0:
            c.refuse(
                ("materials", name, "density_kg_m3"),
                f"zone {zone!r} may move but its material {name!r} has no density",
                "give the density: blocks without mass have no equation of motion",
            )
    if acts or fixed.any() or t.loads is None or t.run is None or t.dda is None or t.dda.dynamic_factor > 0:
        return
    if any(t.loads.gravity_m_s2):
        c.refuse(
            ("loads", "gravity_m_s2"),
            "gravity acts and nothing is fixed: all blocks would fall",
            (
                "place it on a fixed zone of its own ([zones.NAME] fixed = true)"
                if blocks.n_blocks == 1
                else "fix the zone that supports the others ([zones.NAME] fixed = true)"
            )
            + ", or set dda.dynamic_factor = 1 if they are to fall",
        )
        return
    if any(traction.edge not in blocks.edge_names for traction in t.loads.tractions):
        return
    force, moment, size = _resultant(t, blocks)
    reach = np.ptp(blocks.vertices, axis=0).max()
    if np.hypot(*force) > 1e-9 * size or abs(moment) > 1e-9 * size * reach:
        c.refuse(
            ("loads",),
            f"the loads do not balance and nothing is fixed: at {t.run.end_time_s:g} s the resultants are a force of "
            f"({force[0]:.4g}, {force[1]:.4g}) N/m and a moment of {moment:.4g} N",
            _balance_hint(t, blocks),
        )


def _loads_are_lost(c: Check, fixed: np.ndarray) -> bool:
    """Refuse a scene in which all loads act on fixed blocks (then True); report tractions that act on fixed blocks or
    cancel."""
    t, blocks = c.tables, c.blocks
    if any(traction.edge not in blocks.edge_names for traction in t.loads.tractions):
        return False
    on = [np.unique(blocks.vertex_block[blocks.edges_named(traction.edge)]) for traction in t.loads.tractions]
    carried = [np.array(blocks_at(blocks, f.at), np.int64) for f in t.loads.forces if f.at is not None]
    loaded = [*on, *carried, *([np.arange(blocks.n_blocks)] if any(t.loads.gravity_m_s2) else [])]
    if loaded and all(len(at) and fixed[at].all() for at in loaded):
        zone = c.drawn.zones[int(loaded[0][0])]
        c.refuse(
            ("zones", zone, "fixed"),
            "every load acts on fixed blocks "
            f"({', '.join(sorted({c.drawn.zones[b] for at in loaded for b in at}))}): nothing would deform",
            "fix the base of the specimen, not the specimen itself; a single block stays in place under balanced loads",
        )
        return True
    totals: dict[str, list] = {}
    for k, (traction, at) in enumerate(zip(t.loads.tractions, on)):
        if t.run is not None:
            totals.setdefault(traction.edge, []).append(traction_history(traction).at(t.run.end_time_s))
            values = np.array(totals[traction.edge])
            if len(values) > 1 and np.abs(values.sum(axis=0)).max() <= 1e-9 * np.abs(values).max():
                c.warn(
                    ("loads", "tractions", k, "edge"),
                    f"the tractions on {traction.edge!r} cancel each other at {t.run.end_time_s:g} s",
                    "put the opposing load on the opposite edge",
                )
        if fixed[at].all():
            c.warn(
                ("loads", "tractions", k, "edge"),
                f"the edges {traction.edge!r} belong to fixed blocks: their traction has no effect",
                "leave it out, or let the zone move",
            )
    return False


def _balance_hint(t: SceneTables, blocks: Blocks) -> str:
    """How to balance the loads: the resultant on each edge.

    An edge as long as the opposite one needs its traction, one of another length that traction scaled.
    """
    edges = []
    for traction in t.loads.tractions:
        edge = blocks.edges_named(traction.edge)
        length = float(np.hypot(*(blocks.vertices[blocks.next_vertex[edge]] - blocks.vertices[edge]).T).sum())
        x, y = length * traction_history(traction).at(t.run.end_time_s)
        edges.append(f"{traction.edge!r} ({length:.4g} m) carries ({x:.4g}, {y:.4g}) N/m")
    hint = "balance the tractions, each times the length of its edges" + (f": {', '.join(edges)}" if edges else "")
    if blocks.n_blocks == 1:
        return hint + "; or place the block on a fixed zone of its own"
    return f"fix the zone that supports the others ([zones.NAME] fixed = true), or {hint}"


def _resultant(t: SceneTables, blocks: Blocks) -> tuple[np.ndarray, float, float]:
    """Force, moment about the centre, and sum of the magnitudes of all loads at the end of the run."""
    centre = 0.5 * (blocks.vertices.min(axis=0) + blocks.vertices.max(axis=0))
    loads = []
    for traction in t.loads.tractions:
        value = traction_history(traction).at(t.run.end_time_s)
        for edge in blocks.edges_named(traction.edge):
            a, b = blocks.vertices[edge], blocks.vertices[blocks.next_vertex[edge]]
            loads.append((0.5 * (a + b) - centre, value * np.hypot(*(b - a))))
    for force in t.loads.forces:
        loads.append((np.array(force.at) - centre, force_history(force).at(t.run.end_time_s)))
    total = sum((f for _, f in loads), np.zeros(2))
    moment = sum(p[0] * f[1] - p[1] * f[0] for p, f in loads)
    return total, float(moment), float(sum(np.hypot(*f) for _, f in loads))
