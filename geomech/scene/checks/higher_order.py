"""Features that blocks of higher order ([zones.NAME] order), and faces that crush, do not support yet; each is refused with
a message that names it."""

from __future__ import annotations

import numpy as np

from ...model.blocks.polygon import signed_area
from ..validation import nearest
from .check import Check

#: Part of a block's area in holes above which blocks of higher order are reported. Polynomials take up little of what a hole
#: softens, about three times its part of the area: they leave 4 % in tension at 0.016, 8 % at 0.035, 14 to 31 % at 0.06 to 0.14,
#: of which order 8 corrects a quarter (`tests/dda/higher_order/test_cells_against_elasticity.py`).
LARGE_HOLES = 0.02


def quoted(order: int | str) -> str:
    """As written in a scene."""
    return f'"{order}"' if isinstance(order, str) else str(order)


def check_orders(c: Check) -> None:
    """Refuse features that blocks of order 2 and more do not support."""
    t = c.tables
    zones = {name: zone for name, zone in (t.zones or {}).items() if zone.order != 1}
    for name, zone in zones.items():
        path = ("zones", name, "order")

        def refuse(why: str, way_out: str, path=path, zone=zone) -> None:
            c.refuse(path, f"order = {quoted(zone.order)}: {why}", way_out)

        if zone.fixed or zone.guided is not None or zone.body != "block":
            refuse("rock that is fixed, guided or unbounded does not bend", "leave `order` out")
        material = (t.materials or {}).get(zone.material or next(iter(t.materials or {}), ""))
        if material is not None and material.rigid:
            refuse("a rigid material does not bend", "leave `order` out, or `rigid`")
        _check_cell_joint(c, name, zone.cell_joint)
        _check_cracks(c, zone, refuse)
        _check_joints(c, refuse)
        _check_solver(c, refuse)
        if t.loads is not None and t.loads.in_situ is not None and zone.order == "auto":
            refuse(
                'in-situ stress ([loads] in_situ) with order = "auto" is not supported yet',
                "give the order as a number, 2 to 8",
            )


def check_holes(c: Check) -> None:
    """Warn of blocks of higher order with large holes, which polynomials leave too stiff."""
    t, blocks, found = c.tables, c.blocks, []
    bends = [zone in (t.zones or {}) and t.zones[zone].order != 1 for zone in c.drawn.zones]
    for b in np.flatnonzero(bends).tolist():
        areas = np.abs([signed_area(np.concatenate([loop, loop[:1]])) for loop in blocks.loops(b)])
        share = float(areas[1:].sum() / (areas[0] - areas[1:].sum()))
        if share > LARGE_HOLES:
            found.append((share, b))
    if found:
        share, b = max(found)
        others = f", and {len(found) - 1} more blocks" if len(found) > 1 else ""
        c.warn(
            ("zones", c.drawn.zones[b], "order"),
            f"{blocks.names[b]!r} has holes of {100 * share:.2g} % of its area{others}: one polynomial hardly bends around them, and "
            f"it is too stiff by some {200 * share:.1g} %, whatever its order (K of its cracks is not affected)",
            f"divide it into cells: zones.{c.drawn.zones[b]}.mesh_size_m, with an order of 3",
        )


def check_crushing(c: Check) -> None:
    """Refuse features that faces with a crushing strength do not support."""
    for name, joint in (c.tables.joints or {}).items():
        if joint.crushing_strength_pa is None:
            continue

        def refuse(why: str, way_out: str, name=name) -> None:
            c.refuse(("joints", name, "crushing_strength_pa"), f"crushing_strength_pa: {why}", way_out)

        _check_joints(c, refuse, name)
        _check_solver(c, refuse)


def _check_cell_joint(c: Check, zone: str, joint: str | None) -> None:
    """The joint along which the cells of ``zone`` separate must exist and have a strength."""
    if joint is None:
        return
    path, joints = ("zones", zone, "cell_joint"), c.tables.joints or {}
    if joint not in joints:
        c.refuse(path, f"there is no [joints.{joint}]", nearest(joint, list(joints)))
    elif not joints[joint].tensile_strength_pa > 0:
        c.refuse(
            path, f"[joints.{joint}] has no tensile strength", "give its tensile_strength_pa, or leave `cell_joint` out"
        )


def _check_cracks(c: Check, zone, refuse) -> None:
    """Refuse cracks that begin in the cells of a ``zone``."""
    if zone.mesh_size_m is not None and c.tables.growth is not None and c.tables.growth.initiation:
        refuse(
            "cracks that begin (growth.initiation) are not supported in cells, which they would have to cut",
            "leave `mesh_size_m` out, for one block of this order, or let cells separate at the strength of a `cell_joint`",
        )


def _check_joints(c: Check, refuse, besides: str = "") -> None:
    """Refuse joints with laws that faces of higher order, and faces that crush, do not support, ``besides`` one."""
    for name, joint in (c.tables.joints or {}).items():
        if name == besides:
            continue
        dilates = joint.dilation_angle_deg > 0
        curved = joint.jrc is not None or joint.max_closure_m is not None or (dilates and bool(besides))
        softens = joint.residual_friction_angle_deg is not None or joint.residual_cohesion_pa or joint.softening_slip_m
        if curved or softens:
            refuse(
                f"faces of higher order, and faces that crush, support linear Coulomb laws only, and [joints.{name}] softens, dilates or "
                "closes nonlinearly",
                "leave these keys out",
            )
        elif dilates and None in (joint.normal_stiffness_pa_per_m, joint.shear_stiffness_pa_per_m):
            refuse(
                f"[joints.{name}] dilates, and has no stiffness: with penalty springs points of a face lose contact as it "
                "slides, and rise by different amounts",
                "give its normal_stiffness_pa_per_m and shear_stiffness_pa_per_m",
            )
        if joint.restitution is not None:
            refuse(f"[joints.{name}] restitution is not supported yet", "leave it out")


def _check_solver(c: Check, refuse) -> None:
    dda = c.tables.dda
    if dda is None:
        return
    beta, gamma = dda.newmark or (0.5, 1.0)  # unset: one of the two allowed schemes
    if dda.dynamic_factor > 0 and (dda.spectral_radius is not None or abs(gamma - 2 * beta) > 1e-12):
        refuse("it supports Newmark's scheme with gamma = 2 beta only", "set newmark = [0.5, 1.0] or [0.25, 0.5]")
    if dda.contact != "penalty" or dda.springs != "stiff":
        refuse(
            'faces need stiff penalty springs or the stiffness of their joint, dda.contact = "penalty" and '
            'dda.springs = "stiff"',
            "leave these keys out",
        )
