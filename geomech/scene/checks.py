"""Checks across the sections of a scene: names that must exist, points that must be in rock, loads that must hold."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model import Blocks
from ..shapes import cutting_cracks
from .drawing import Drawing
from .errors import Fault
from .locator import Path
from .tables import SceneTables
from .validation import nearest


@dataclass(frozen=True, eq=False)
class Check:
    """What the checks see: tables (a section is None where it is faulty), the names in the file, the drawing."""

    tables: SceneTables
    data: dict[str, Any]
    drawing: Drawing | None
    place: Callable[[Path], str]
    faults: list[Fault]
    warnings: list[Fault]

    def refuse(self, path: Path, message: str, way_out: str) -> None:
        self.faults.append(Fault(self.place(path), message, way_out))

    def warn(self, path: Path, message: str, way_out: str) -> None:
        self.warnings.append(Fault(self.place(path), message, way_out))


def check(tables, data, drawing, place, faults, warnings) -> None:
    """Run every check that the sections at hand allow; add to ``faults`` and ``warnings``."""
    c = Check(tables, data, drawing, place, faults, warnings)
    _times(c)
    _growth_lengths(c)
    _names_once(c)
    _material_names_exist(c)
    if drawing is not None:
        _zones(c)
        _cracks(c)
    if drawing is not None and drawing.blocks is not None:
        _whole(c)
        _edges(c)
        _joints(c)
        _points(c)
        _toughness(c)
        _held(c)


def _times(c: Check) -> None:
    if c.tables.run is not None and c.tables.dda is not None and c.tables.dda.time_step_s > c.tables.run.end_time_s:
        # A time step that is not in the file cannot be pointed at.
        given = "time_step_s" in c.data.get("dda", {})
        c.refuse(
            ("dda", "time_step_s") if given else ("run", "end_time_s"),
            f"the time step ({c.tables.dda.time_step_s:g} s) is longer than the whole run "
            f"({c.tables.run.end_time_s:g} s)",
            "shorten dda.time_step_s, or raise run.end_time_s",
        )


def _growth_lengths(c: Check) -> None:
    growth = c.tables.growth
    if growth is None or growth.increment_m is None or growth.min_increment_m is None:
        return
    if growth.min_increment_m > growth.increment_m:
        c.refuse(
            ("growth", "min_increment_m"),
            f"the shortest advance ({growth.min_increment_m:g} m) is longer than the longest, {growth.increment_m:g} m",
            "make it at most growth.increment_m",
        )


def _names_once(c: Check) -> None:
    seen: set[str] = set()
    for k, monitor in enumerate(c.tables.monitors or ()):
        if monitor.name in seen:
            c.refuse(
                ("monitors", k, "name"), f"there are two monitors called {monitor.name!r}", "give each its own name"
            )
        seen.add(monitor.name)


def _material_names(c: Check) -> list[str]:
    materials = c.data.get("materials")
    return list(materials) if isinstance(materials, dict) else []


def _material_names_exist(c: Check) -> None:
    known = _material_names(c)
    for name, zone in (c.tables.zones or {}).items():
        if zone.material is not None and zone.material not in known:
            c.refuse(
                ("zones", name, "material"), f"there is no material {zone.material!r}", nearest(zone.material, known)
            )


def _zones(c: Check) -> None:
    known, materials = list(dict.fromkeys(c.drawing.zones)), _material_names(c)
    given = c.tables.zones
    if given is None:
        return
    for name in given:
        if name not in known:
            c.refuse(("zones", name), f"the geometry has no zone {name!r}", nearest(name, known))
    if len(materials) > 1:
        for name in known:
            if name not in given or given[name].material is None:
                c.refuse(
                    ("zones", name),
                    f"zone {name!r} has no material",
                    f'add [zones.{name}] with material = "…": {", ".join(materials)}',
                )
    used = {zone.material for zone in given.values()}
    for name in materials if len(materials) > 1 else ():
        if name not in used:
            c.warn(("materials", name), f"no zone is made of {name!r}", "remove it, or name it in [zones]")


def _cracks(c: Check) -> None:
    for name in c.tables.cracks or ():
        if name != "default" and name not in c.drawing.cracks_drawn:
            c.refuse(
                ("cracks", name), f"the geometry has no crack {name!r}", nearest(name, list(c.drawing.cracks_drawn))
            )


def _whole(c: Check) -> None:
    """What drawn cracks enclose is a block of its own, and must be drawn as one."""
    for crack, block in cutting_cracks(c.drawing.blocks, c.drawing.cracks):
        c.refuse(
            ("geometry", "cracks", crack) if c.tables.geometry.model is None else ("geometry", "model"),
            f"crack {c.drawing.cracks.names[crack]!r} cuts a piece off zone {c.drawing.zones[block]!r}, alone or with "
            "the cracks before it",
            "draw the pieces as zones of their own: blocks part along their outlines",
        )


def _edge_names(c: Check) -> list[str]:
    return [name for name in c.drawing.blocks.edge_names if name]


def _edges(c: Check) -> None:
    if c.tables.loads is None:
        return
    known = _edge_names(c)
    way = (
        "name edges by physical curves in the model" if c.tables.geometry.model else "name edges by [[geometry.edges]]"
    )
    for k, traction in enumerate(c.tables.loads.tractions):
        if traction.edge not in known:
            c.refuse(
                ("loads", "tractions", k, "edge"),
                f"the geometry has no edge {traction.edge!r}",
                nearest(traction.edge, known) + f"; {way}",
            )
    leading = c.tables.loads.leading_edge
    loaded = [traction.edge for traction in c.tables.loads.tractions]
    if leading is not None and leading not in loaded:
        c.refuse(
            ("loads", "leading_edge"),
            f"no traction acts on the leading edge {leading!r}",
            nearest(leading, loaded) + "; it must be the edge of one of [[loads.tractions]]",
        )


def joint_names(patterns: tuple[str, ...], known: list[str]) -> list[str]:
    """The names of ``known`` that ``patterns`` mean, in order."""
    return [name for name in known if any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)]


def contact_names(drawing: Drawing) -> list[str]:
    """Names that faces in contact may have: edges as drawn, and the faces that a crack leaves when it cuts through."""
    names = [name for name in drawing.blocks.edge_names if name]
    return names + [f"crack:{name}" for name in drawing.cracks_drawn]


def _joints(c: Check) -> None:
    if c.tables.joints is None:
        return
    known = contact_names(c.drawing)
    owner: dict[tuple[str, str], str] = {}

    def claim(pair: tuple[str, str], law: str, path: Path) -> None:
        first = owner.setdefault(pair, law)
        if first != law:
            what = f"edges {pair[1]!r}" if not pair[0] else f"edges {pair[0]!r} and {pair[1]!r}"
            c.refuse(
                path, f"joints {first!r} and {law!r} both claim contacts of {what}", "leave them to one of the two"
            )

    for name, joint in c.tables.joints.items():
        if name == "default":
            if joint.edges or joint.between:
                c.refuse(
                    ("joints", name), "the default joint names edges", "it rules all contacts that no other joint names"
                )
            continue
        if not (joint.edges or joint.between):
            c.refuse(("joints", name), f"joint {name!r} names no edges", 'add edges = ["…"], or call it `default`')
        for k, pattern in enumerate(joint.edges):
            names = joint_names((pattern,), known)
            if not names:
                c.refuse(("joints", name, "edges", k), f"no edge is called {pattern!r}", nearest(pattern, known))
            for found in names:
                claim(("", found), name, ("joints", name, "edges", k))
        for k, pair in enumerate(joint.between):
            for n, edge in enumerate(pair):
                if edge not in known:
                    c.refuse(("joints", name, "between", k, n), f"no edge is called {edge!r}", nearest(edge, known))
            claim(tuple(sorted(pair)), name, ("joints", name, "between", k))
    if c.drawing.blocks.n_blocks > 1 and "default" not in c.tables.joints:
        c.warn(
            ("joints",),
            "there is no default joint: contacts that no joint names have neither friction nor cohesion",
            "add [joints.default]",
        )


def blocks_at(blocks: Blocks, point: tuple[float, float]) -> list[int]:
    """The blocks that hold ``point``, those whose outline it touches included (to 1e-6 of the drawing's size)."""
    import shapely

    slack = 1e-6 * np.ptp(blocks.vertices, axis=0).max()
    shapes = [shapely.Polygon(blocks.loops(b)[0], blocks.loops(b)[1:]) for b in range(blocks.n_blocks)]
    return np.flatnonzero(shapely.distance(shapely.Point(point), np.array(shapes)) <= slack).tolist()


def carrier(c: Check, path: Path, what: str, point, zone: str | None, among: list[int] | None = None) -> int:
    """The block that carries ``point``; −1 after saying why there is none."""
    known = list(dict.fromkeys(c.drawing.zones))
    if zone is not None and zone not in known:
        c.refuse(path[:-1] + ("zone",), f"the geometry has no zone {zone!r}", nearest(zone, known))
        return -1
    at = blocks_at(c.drawing.blocks, point)
    if zone is not None:
        inside, at = at, [b for b in at if c.drawing.zones[b] == zone]
        if inside and not at:
            c.refuse(
                path, f"{what} ({point[0]:g}, {point[1]:g}) is not in zone {zone!r}", "move it, or name its own zone"
            )
            return -1
    if among is not None and len(at) > 1:
        at = [b for b in at if b in among] or at
    if not at:
        low, high = c.drawing.blocks.vertices.min(axis=0), c.drawing.blocks.vertices.max(axis=0)
        c.refuse(
            path,
            f"{what} ({point[0]:g}, {point[1]:g}) is outside all blocks",
            f"the blocks span x from {low[0]:g} to {high[0]:g} m and y from {low[1]:g} to {high[1]:g} m",
        )
        return -1
    if len(at) > 1:
        names = [c.drawing.blocks.names[b] for b in at]
        way = 'add zone = "…"' if len({c.drawing.zones[b] for b in at}) > 1 else "move it into one of them"
        c.refuse(path, f"{what} ({point[0]:g}, {point[1]:g}) lies where blocks {', '.join(names)} touch", way)
        return -1
    return at[0]


def gauge_carriers(c: Check) -> tuple[int, int] | None:
    """The blocks that carry the gauge's ends; where an end lies between two blocks, the one that holds the other."""
    gauge = c.tables.gauge
    if gauge is None:
        return None
    if gauge.start == gauge.to:
        c.refuse(("gauge", "to"), "both ends of the gauge are the same point", "give two different points")
        return None
    both = [set(blocks_at(c.drawing.blocks, p)) for p in (gauge.start, gauge.to)]
    common = sorted(both[0] & both[1])
    return (
        carrier(c, ("gauge", "from"), "the gauge's end", gauge.start, gauge.zone, common),
        carrier(c, ("gauge", "to"), "the gauge's end", gauge.to, gauge.zone, common),
    )


def _points(c: Check) -> None:
    gauge_carriers(c)
    for k, monitor in enumerate(c.tables.monitors or ()):
        carrier(c, ("monitors", k, "at"), f"monitor {monitor.name!r}", monitor.at, monitor.zone)
    if c.tables.loads is not None:
        for k, force in enumerate(c.tables.loads.forces):
            carrier(c, ("loads", "forces", k, "at"), "the point of a force", force.at, force.zone)


def material_of(tables: SceneTables, zone: str) -> str:
    """The name of the material that ``zone`` is made of."""
    entry = tables.zones.get(zone)
    return entry.material if entry is not None and entry.material is not None else next(iter(tables.materials))


def _toughness(c: Check) -> None:
    t, cracks = c.tables, c.drawing.cracks
    if t.growth is None or t.materials is None or t.zones is None:
        return
    needy: dict[str, str] = {}
    for k, b in zip(cracks.crack, cracks.block):
        zone = c.drawing.zones[b]
        name = material_of(t, zone)
        if name in t.materials and t.materials[name].k_ic_pa_sqrt_m is None:
            needy.setdefault(name, cracks.names[k])
        if zone in t.zones and t.zones[zone].fixed:
            c.warn(
                ("zones", zone, "fixed"),
                f"crack {cracks.names[k]!r} lies in the fixed zone {zone!r}, which is not strained",
                "let the zone move, or leave the crack out",
            )
    for name, crack in needy.items() if t.growth.enabled else ():
        c.refuse(
            ("materials", name, "k_ic_pa_sqrt_m"),
            f"material {name!r} has no fracture toughness, and crack {crack!r} in it may grow",
            "add k_ic_pa_sqrt_m, or set growth.enabled = false",
        )


def _held(c: Check) -> None:
    """Loads on blocks that nothing fixes must balance; blocks that may move must have a mass."""
    t, blocks = c.tables, c.drawing.blocks
    if t.zones is None or t.materials is None:
        return
    fixed = np.array([zone in t.zones and t.zones[zone].fixed for zone in c.drawing.zones])
    if fixed.all():
        c.warn(("zones",), "all blocks are fixed: nothing moves", "let a zone move")
        return
    for zone in dict.fromkeys(z for z, f in zip(c.drawing.zones, fixed) if not f):
        name = material_of(t, zone)
        if name in t.materials and t.materials[name].density_kg_m3 == 0:
            c.refuse(
                ("materials", name, "density_kg_m3"),
                f"zone {zone!r} may move but its material {name!r} has no density",
                "give the density; blocks without mass have no equation of motion",
            )
    if fixed.any() or t.loads is None or t.run is None or t.dda is None or t.dda.dynamic_factor > 0:
        return
    if any(t.loads.gravity_m_s2):
        c.refuse(
            ("loads", "gravity_m_s2"),
            "gravity acts and nothing is fixed: all blocks would fall",
            "fix a zone ([zones.NAME] fixed = true), or set dda.dynamic_factor = 1 if they are to fall",
        )
        return
    if any(traction.edge not in blocks.edge_names for traction in t.loads.tractions):
        return
    force, moment, size = _resultant(t, blocks)
    reach = np.ptp(blocks.vertices, axis=0).max()
    if np.hypot(*force) > 1e-9 * size or abs(moment) > 1e-9 * size * reach:
        c.refuse(
            ("loads",),
            f"the loads do not balance and nothing is fixed: at {t.run.end_time_s:g} s they leave a force of "
            f"({force[0]:.4g}, {force[1]:.4g}) N/m and a moment of {moment:.4g} N",
            "fix a zone ([zones.NAME] fixed = true), or add the loads that hold the rock",
        )


def _resultant(t: SceneTables, blocks: Blocks) -> tuple[np.ndarray, float, float]:
    """Force, moment about the centre, and the sum of magnitudes of all loads at the end of the run."""
    from .build import force_history, traction_history

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
