"""Checks across the sections of a scene: names must exist, points must be in rock; times and lengths must be
consistent."""

from __future__ import annotations

from functools import partial

import numpy as np

from ...model import CHANGES, Blocks
from ...shapes import cutting_cracks
from ...shapes.cells import rock_of
from ..assembly.fixed_blocks import check_borne, check_holding, fixed_blocks
from ..assembly.joint_laws import check_joints, joint_law
from ..locator import Path
from ..tables import SceneTables
from ..validation import nearest
from .check import Check
from .edges import check_edges, dead_end_laws
from .higher_order import check_crushing, check_orders

#: Least advance of a tip relative to the rock's largest side: coordinates of a drawing have twelve digits.
SHORTEST_ADVANCE = 1e-9


def check(c: Check) -> None:
    """Run all checks for which the sections are available."""
    _times(c)
    _growth_lengths(c)
    _names_once(c)
    _material_names_exist(c)
    if c.drawing is not None:
        _zones(c)
        _cracks(c)
    _crack_joints(c)
    check_joints(c)
    if c.drawing is not None and c.drawing.blocks is not None:
        _whole(c)
        check_holding(c)
        check_borne(c)
        check_edges(c)
        _dead_ends(c)
        check_orders(c)
        check_crushing(c)
        _points(c)
        _toughness(c)
        _strength(c)
        _rigid(c)
    _statics(c)
    _stepping(c)
    _warned(c)


def _times(c: Check) -> None:
    if c.tables.run is not None and c.tables.dda is not None and c.tables.dda.time_step_s > c.tables.run.end_time_s:
        # A time step that is missing in the file cannot be located.
        given = "time_step_s" in c.data.get("dda", {})
        c.refuse(
            ("dda", "time_step_s") if given else ("run", "end_time_s"),
            f"the time step ({c.tables.dda.time_step_s:g} s) is longer than the whole run "
            f"({c.tables.run.end_time_s:g} s)",
            "shorten dda.time_step_s, or raise run.end_time_s",
        )


def _statics(c: Check) -> None:
    """Settings for static or dynamic runs only."""
    dda, loads = c.tables.dda, c.tables.loads
    if dda is None:
        return
    if dda.equilibrium == "loads" and dda.dynamic_factor > 0:
        c.refuse(
            ("dda", "equilibrium"),
            "equilibrium at every load is for static runs, and dda.dynamic_factor is not 0",
            'set equilibrium = "start" to begin at rest, or dynamic_factor = 0',
        )
    if loads is not None and loads.viscous_boundaries and dda.dynamic_factor == 0:
        c.warn(
            ("loads", "viscous_boundaries"),
            "viscous boundaries have no effect in a static run",
            "set dda.dynamic_factor = 1, or leave them out",
        )
    for name, joint in (c.tables.joints or {}).items() if dda.dynamic_factor == 0 else ():
        if joint.restitution is not None:
            c.warn(
                ("joints", name, "restitution"),
                "statics have no velocities and therefore no impacts: restitution has no effect",
                "set dda.dynamic_factor = 1, or leave it out",
            )


def _stepping(c: Check) -> None:
    """Settings for steps from event to event only."""
    run, dda = c.tables.run, c.tables.dda
    if run is None or dda is None:
        return
    if "mechanism" in run.stop_at and dda.dynamic_factor > 0:
        c.refuse(
            ("run", "stop_at"),
            '"mechanism" is reported in static runs only, and dda.dynamic_factor is not 0: in dynamics blocks simply move',
            "leave it out, or set dda.dynamic_factor = 0",
        )
    if run.stepping == "events":
        for key, conflicts, way_out in (
            ("dynamic_factor", dda.dynamic_factor > 0, "set dda.dynamic_factor = 0"),
            ("equilibrium", dda.equilibrium == "loads", 'set dda.equilibrium = "start", or ""'),
            (
                "automatic_time_step",
                dda.automatic_time_step,
                "leave out dda.automatic_time_step: steps adapt anyway",
            ),
        ):
            if conflicts:
                value = getattr(dda, key)
                c.refuse(
                    ("run", "stepping"),
                    f"steps to the next event are for static runs, and dda.{key} is {str(value).lower()}",
                    f'{way_out}, or stepping = "fixed"',
                )
        return
    for key, belongs in (
        ("control", run.control != "load"),
        ("longest_step_s", run.longest_step_s is not None),
    ):
        if belongs:
            c.refuse(("run", key), f'run.{key} requires stepping "events"', 'set run.stepping = "events"')


def _warned(c: Check) -> None:
    """Events that end a run must be reported ones."""
    run = c.tables.run
    if run is None or (run.events is None and run.stepping == "events") or set(run.events or ()) - {"tips"}:
        return
    for kind in sorted(set(run.stop_at) & set(CHANGES)):
        if run.events is None:
            what, way_out = (
                "fixed steps report these where run.events names them",
                'set run.events = ["contacts", "faces"]',
            )
        else:
            what, way_out = "run.events names neither", 'add "contacts" or "faces" to run.events'
        c.refuse(("run", "stop_at"), f'"{kind}" concerns contacts and crack faces, and {what}', way_out)


def _growth_lengths(c: Check) -> None:
    growth = c.tables.growth
    if growth is not None and growth.trial_kink_m and growth.criterion != "f":
        c.refuse(
            ("growth", "trial_kink_m"),
            f'trial kinks are used by the criterion "f" only, not by "{growth.criterion}"',
            'leave it out, or set growth.criterion = "f"',
        )
    if growth is not None and c.drawing is not None and c.drawing.blocks is not None:
        size = float(np.ptp(c.blocks.vertices, axis=0).max())
        for key in ("increment_m", "min_increment_m"):
            value = getattr(growth, key)
            if value is not None and value < SHORTEST_ADVANCE * size:
                c.refuse(
                    ("growth", key),
                    f"an advance of {value:g} m is lost in the round-off of coordinates of {size:g} m",
                    f"make it at least {SHORTEST_ADVANCE * size:.1g} m; a tenth of the shortest crack is usual",
                )
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
                ("monitors", k, "name"),
                f"there are two monitors called {monitor.name!r}",
                "give each a name of its own",
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
    known, materials = list(dict.fromkeys(c.drawn.zones)), _material_names(c)
    given = c.tables.zones
    if given is None:
        return
    for name in given:
        if name not in known:
            # A zone that has a table already is not the one meant.
            free = [zone for zone in known if zone not in given]
            c.refuse(
                ("zones", name),
                f"the geometry has no zone {name!r}",
                next((hint for hint in map(partial(nearest, name), (free, known)) if "did you" in hint), _are(known)),
            )
    if len(materials) > 1:
        for name in known:
            if name not in given or given[name].material is None:
                c.refuse(
                    ("zones", name),
                    f"zone {name!r} has no material",
                    f'add [zones.{name}] with material = "…": {", ".join(materials)}',
                )
    if c.tables.dda is not None and c.tables.dda.dynamic_factor == 0:
        for name in (name for name, zone in given.items() if zone.velocity_m_s is not None):
            c.refuse(
                ("zones", name, "velocity_m_s"),
                "a static run has no velocities",
                "leave it out, or set dda.dynamic_factor = 1",
            )
    used = {zone.material for zone in given.values()}
    for name in materials if len(materials) > 1 else ():
        if name not in used:
            c.warn(("materials", name), f"no zone is made of {name!r}", "remove it, or name it in [zones]")


def _cracks(c: Check) -> None:
    given = c.tables.cracks or {}
    for name in given:
        if name != "default" and name not in c.drawn.cracks_drawn:
            known = list(c.drawn.cracks_drawn)
            free = [crack for crack in known if crack not in given]
            c.refuse(
                ("cracks", name), f"the geometry has no crack {name!r}", nearest(name, free) if free else _are(known)
            )


def _crack_joints(c: Check) -> None:
    """The laws of crack faces must exist, and cemented faces must touch."""
    for name, crack in (c.tables.cracks or {}).items():
        if crack.joint is None or c.tables.joints is None:
            continue
        joint = c.tables.joints.get(crack.joint)
        if joint is None:
            c.refuse(
                ("cracks", name, "joint"),
                f"there is no joint {crack.joint!r}",
                nearest(crack.joint, list(c.tables.joints)),
            )
        elif joint.tensile_strength_pa > 0 and crack.aperture not in ("closed", 0):
            c.refuse(
                ("cracks", name, "joint"),
                f"faces with an aperture cannot have the tensile strength of joint {crack.joint!r}",
                'set aperture = "closed", or name a joint without tensile strength',
            )


def _dead_ends(c: Check) -> None:
    """Joints that end in rock need a law that crack faces can have."""
    for name, key in dead_end_laws(c).items():
        joint = (c.tables.joints or {}).get(key or "")
        if key is None or joint is None:
            continue
        try:
            law = joint_law(key, joint)
        except ValueError:
            continue  # refused by `check_joints`
        if law.straight and law.crushing_strength is None:
            continue
        c.refuse(
            ("joints", key),
            f"the joints {name!r} end in rock, and the faces of these cracks cannot follow joint {key!r}: they support neither "
            "residual friction, softening, dilation, roughness, hyperbolic closure nor crushing",
            f'name a joint with friction, cohesion and stiffnesses only as cracks."{name}".joint, or set geometry.dead_ends = "trim"',
        )


def _are(known: list[str]) -> str:
    return f"there is {', '.join(known)}" if known else "there is none"


def _whole(c: Check) -> None:
    """A piece enclosed by drawn cracks is a block of its own, and must be drawn as one."""
    for crack, block in cutting_cracks(c.blocks, c.cracks):
        c.refuse(
            c.drawn.path_of_crack(c.cracks.names[crack]),
            f"crack {c.cracks.names[crack]!r} cuts a piece off zone {c.drawn.zones[block]!r}, alone or with "
            "the cracks before it",
            "draw the pieces as zones of their own: blocks separate along their outlines",
        )


def blocks_at(blocks: Blocks, point: tuple[float, float]) -> list[int]:
    """The blocks that contain ``point``, including those whose outline it touches (to 1e-6 of the drawing's size)."""
    import shapely

    slack = 1e-6 * np.ptp(blocks.vertices, axis=0).max()
    shapes = [shapely.Polygon(blocks.loops(b)[0], blocks.loops(b)[1:]) for b in range(blocks.n_blocks)]
    return np.flatnonzero(shapely.distance(shapely.Point(point), np.array(shapes)) <= slack).tolist()


def carrier(c: Check, path: Path, what: str, point, zone: str | None, among: list[int] | None = None) -> int:
    """The block that contains ``point``; −1, with an error, if there is none."""
    known = list(dict.fromkeys(c.drawn.zones))
    if zone is not None and zone not in known:
        c.refuse(path[:-1] + ("zone",), f"the geometry has no zone {zone!r}", nearest(zone, known))
        return -1
    at = blocks_at(c.blocks, point)
    origin = np.array(c.drawn.origin)
    x, y = np.add(point, origin)
    here = f"({x:.10g}, {y:.10g})" if origin.any() else f"({x:g}, {y:g})"
    if zone is not None:
        inside, at = at, [b for b in at if c.drawn.zones[b] == zone]
        if inside and not at:
            c.refuse(path, f"{what} {here} is not in zone {zone!r}", "move it, or name the zone that contains it")
            return -1
    if among is not None and len(at) > 1:
        at = [b for b in at if b in among] or at
    if not at:
        low, high = (end(c.blocks.vertices, axis=0) + origin for end in (np.min, np.max))
        digits = ".10g" if origin.any() else "g"
        c.refuse(
            path,
            f"{what} {here} is outside all blocks",
            f"the blocks span x from {low[0]:{digits}} to {high[0]:{digits}} m and y from {low[1]:{digits}} to "
            f"{high[1]:{digits}} m",
        )
        return -1
    if len(at) > 1 and len({rock_of(c.blocks.names[b]) for b in at}) == 1:
        # Cells of one rock: either moves like the point.
        at = at[:1]
    if len(at) > 1:
        names = [c.blocks.names[b] for b in at]
        way = 'add zone = "…"' if len({c.drawn.zones[b] for b in at}) > 1 else "move it into one of them"
        c.refuse(path, f"{what} {here} lies where blocks {', '.join(names)} touch", way)
        return -1
    return at[0]


def gauge_carriers(c: Check) -> tuple[int, int] | None:
    """The blocks at the gauge's ends; an end between two blocks belongs to the one with the other end."""
    gauge = c.tables.gauge
    if gauge is None:
        return None
    if gauge.start == gauge.to:
        c.refuse(("gauge", "to"), "both ends of the gauge are the same point", "give two different points")
        return None
    both = [set(blocks_at(c.blocks, p)) for p in (gauge.start, gauge.to)]
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
    """Name of the material of ``zone``."""
    entry = tables.zones.get(zone)
    return entry.material if entry is not None and entry.material is not None else next(iter(tables.materials))


def _strength(c: Check) -> None:
    t = c.tables
    if t.growth is None or t.materials is None:
        return
    strong = [m for m in t.materials.values() if m.tensile_strength_pa is not None or m.cohesion_pa is not None]
    if t.growth.enabled and t.growth.initiation and not strong:
        c.refuse(
            ("growth", "initiation"),
            "cracks are to initiate, but no material has a strength",
            "add tensile_strength_pa or cohesion_pa to a material",
        )
    for name, m in t.materials.items() if t.growth.enabled and t.growth.initiation else ():
        if m in strong and m.k_ic_pa_sqrt_m is None:
            c.refuse(
                ("materials", name, "k_ic_pa_sqrt_m"),
                f"material {name!r} has no fracture toughness, and cracks that initiate in it may grow",
                f"add k_ic_pa_sqrt_m to [materials.{name}], Pa √m (1e6 to 2.5e6 for most rocks)",
            )


def _rigid(c: Check) -> None:
    """Cracks need rock that strains."""
    t = c.tables
    if t.materials is None or t.zones is None:
        return
    for block in dict.fromkeys(c.cracks.block.tolist()):
        name = material_of(t, c.drawn.zones[block])
        if name in t.materials and t.materials[name].rigid:
            c.refuse(
                ("materials", name, "rigid"),
                f"zone {c.drawn.zones[block]!r} contains a crack, but its material {name!r} is rigid",
                "remove rigid = true, or give the zone another material",
            )


def _block_or_zone(t: SceneTables, zone: str) -> str:
    return f"zone {zone!r}" if zone in t.zones and t.zones[zone].fixed else f"block of zone {zone!r}"


def _toughness(c: Check) -> None:
    t, cracks = c.tables, c.cracks
    if t.growth is None or t.materials is None or t.zones is None:
        return
    bodies_without_toughness: dict[str, str] = {}
    fixed = fixed_blocks(t, c.drawn)
    # One warning per crack of several segments.
    for k, b in dict.fromkeys(zip(cracks.crack.tolist(), cracks.block.tolist())):
        zone = c.drawn.zones[b]
        name = material_of(t, zone)
        if name in t.materials and t.materials[name].k_ic_pa_sqrt_m is None:
            bodies_without_toughness.setdefault(name, cracks.names[k])
        if fixed[b] and not (zone in t.zones and t.zones[zone].body != "block"):
            by_key = zone in t.zones and t.zones[zone].fixed
            c.warn(
                ("zones", zone, "fixed") if by_key else ("geometry",),
                f"crack {cracks.names[k]!r} lies in the fixed {_block_or_zone(t, zone)}, which does not strain",
                "let it move, or leave the crack out"
                + ("" if by_key else ': edges called "fixed" fix the block')
                + (
                    '; joints that end in rock are trimmed with geometry.dead_ends = "trim"'
                    if t.geometry.joint_sets
                    else ""
                ),
            )
    geometry, joints = t.geometry, set[str]()
    if geometry is not None:
        joints = {joint.name for joint in geometry.joints} | {joint_set.name for joint_set in geometry.joint_sets}
    for name, crack in bodies_without_toughness.items() if t.growth.enabled else ():
        dead_end = crack.rpartition(" ")[0] in joints
        c.refuse(
            ("materials", name, "k_ic_pa_sqrt_m"),
            f"material {name!r} has no fracture toughness, and crack {crack!r} in it may grow"
            + (' (joints that end in rock are cracks: geometry.dead_ends = "cracks")' if dead_end else ""),
            f"add k_ic_pa_sqrt_m to [materials.{name}], Pa √m (1e6 to 2.5e6 for most rocks), or set growth.enabled = "
            "false" + (', or geometry.dead_ends = "trim"' if dead_end else ""),
        )
