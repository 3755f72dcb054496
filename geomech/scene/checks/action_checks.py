"""Checks of actions other than forces: readable records, existing zones and edges, bolt ends in rock."""

from __future__ import annotations

import numpy as np

from ..assembly.fixed_blocks import fixed_blocks
from ..assembly.load_functions import bolts_of, history_of
from ..validation import nearest
from .check import Check
from .cross_checks import carrier


def check_actions(c: Check) -> None:
    """Motion, water, bolts and excavations, if the section of loads is valid."""
    if c.tables.loads is None:
        return
    _records(c)
    if c.drawing is None or c.drawing.blocks is None:
        return
    _zones(c)
    _points(c)
    _bolts(c)
    _water(c)
    _base(c)


def records_are_sound(c: Check) -> bool:
    """Whether every file of a load can be read."""
    return not any(_fault(load) for _, load in c.tables.loads.timed)


def _fault(load) -> str:
    if load.file is None:
        return ""
    try:
        history_of(load)
    except (OSError, UnicodeDecodeError) as error:
        return f"the record cannot be read: {error}"
    except ValueError as error:
        return str(error)
    return ""


def _records(c: Check) -> None:
    for place, load in c.tables.loads.timed:
        fault = _fault(load)
        if fault:
            c.refuse(
                ("loads", *place, "file"), fault,
                "every line of a record has a time and its values, x and y (or one value and a `direction`)",
            )  # fmt: skip


def _zones(c: Check) -> None:
    known = list(dict.fromkeys(c.drawn.zones))
    for k, motion in enumerate(c.tables.loads.motions):
        if motion.zone not in known:
            c.refuse(
                ("loads", "motions", k, "zone"),
                f"the geometry has no zone {motion.zone!r}",
                nearest(motion.zone, known),
            )
    for k, excavation in enumerate(c.tables.loads.excavations):
        for n, zone in enumerate(excavation.zones):
            if zone not in known:
                place = ("loads", "excavations", k, "zones", n)
                c.refuse(place, f"the geometry has no zone {zone!r}", nearest(zone, known))
        if excavation.polygon is not None and not excavation.zones:
            import shapely

            blocks = c.blocks
            centres = np.array([blocks.area_moments(b)[1] for b in range(blocks.n_blocks)])
            inside = shapely.contains_xy(shapely.Polygon(excavation.polygon), centres[:, 0], centres[:, 1])
            if not inside.any():
                c.refuse(
                    ("loads", "excavations", k, "polygon"), "no block's centroid lies in the polygon",
                    "whole blocks are excavated: draw it around their centroids",
                )  # fmt: skip
        if c.tables.run is not None and excavation.time_s >= c.tables.run.end_time_s:
            c.warn(
                ("loads", "excavations", k, "time_s"),
                f"the excavation at {excavation.time_s:g} s is after the end of the run ({c.tables.run.end_time_s:g} "
                "s)",
                "extend the run beyond it (run.end_time_s)",
            )


def _points(c: Check) -> None:
    fixed = fixed_blocks(c.tables, c.drawn)
    for k, motion in enumerate(c.tables.loads.point_motions):
        place = ("loads", "point_motions", k, "at")
        block = carrier(c, place, "the point with prescribed motion", motion.at, motion.zone)
        if block >= 0 and fixed[block]:
            c.refuse(
                place, f"the point lies in the fixed zone {c.drawn.zones[block]!r}",
                "prescribe the motion of the zone by [[loads.motions]], or let it move freely",
            )  # fmt: skip


def _bolts(c: Check) -> None:
    fixed = fixed_blocks(c.tables, c.drawn)
    for k, table in enumerate(c.tables.loads.bolts):
        try:
            bolts = bolts_of(c, k, table)
        except ValueError as error:
            c.refuse(("loads", "bolts", k), str(error), "a bolt goes from one block to another, or to the ground")
            continue
        for bolt in bolts:
            ends = [b for b in (bolt.block, bolt.other) if b >= 0]
            if all(fixed[b] for b in ends):
                c.refuse(
                    ("loads", "bolts", k), f"bolt {bolt.name!r} has no effect: both its ends are in fixed blocks",
                    "put one end into a block that may move",
                )  # fmt: skip


def _water(c: Check) -> None:
    water = c.tables.loads.water
    known = [name for name in c.blocks.edge_names if name]
    for k, edge in enumerate(() if water is None else water.dry_edges):
        if edge not in known:
            c.refuse(("loads", "water", "dry_edges", k), f"no edge is called {edge!r}", nearest(edge, known))


def _base(c: Check) -> None:
    base = c.tables.loads.base
    if base is None:
        return
    if c.tables.dda is not None and c.tables.dda.dynamic_factor == 0 and base.frame == "ground":
        c.warn(
            ("loads", "base"), "the base shakes, but the run is static, without inertia",
            "set dda.dynamic_factor = 1",
        )  # fmt: skip
    if not fixed_blocks(c.tables, c.drawn).any():
        c.refuse(
            ("loads", "base"), "no block is fixed, so there is no base to shake",
            "fix the zone on which the others rest ([zones.NAME] fixed = true)",
        )  # fmt: skip
