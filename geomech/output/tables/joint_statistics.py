"""Statistics of joint sets, as specified and as generated, for block_system.json and as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from geomech.scene.assembly.jointing import asked
from geomech.shapes import Joint, Zone, cut
from geomech.shapes.assembly import TOLERANCE
from geomech.shapes.block_cutting.partings import Parting
from geomech.shapes.block_cutting.rock_outline import rock_of
from geomech.shapes.joint_networks.fracture_statistics import line_statistics, set_statistics
from geomech.shapes.joint_networks.interfaces import joints_between
from geomech.shapes.parts import JOINT, extent_of

#: Columns of the table: heading, key, key of the value after ±.
_COLUMNS = (
    ("P10 1/m", "p10_per_m", None),
    ("P20 1/m²", "p20_per_m2", None),
    ("P21 m/m²", "p21_per_m", None),
    ("length m", "mean_length_m", "length_deviation_m"),
    ("spacing m", "spacing_m", "spacing_deviation_m"),
    ("persist.", "persistence", None),
    ("angle °", "mean_angle_deg", "angle_deviation_deg"),
)


def given(value: float) -> float | None:
    """``value``, or None if it is missing."""
    return value if math.isfinite(value) else None


class Network(NamedTuple):
    """All ``joints`` of a scene: drawn, generated, and those that are outlines of its zones; its ``nodes`` by kind, and
    the fate of each name's traces."""

    joints: tuple[Joint, ...]
    nodes: dict[str, int]
    partings: tuple[Parting, ...]


#: Results of `network_of`, kept as long as their scene: tables, files and pictures use them.
_found: WeakKeyDictionary[Any, Network] = WeakKeyDictionary()


def network_of(scene: Any) -> Network:
    """The `Network` of a loaded scene."""
    if scene not in _found:
        _found[scene] = _network(scene)
    return _found[scene]


def _network(scene: Any) -> Network:
    drawing = scene.drawing
    blocks, jointed = drawing.blocks, drawing.jointed
    known = () if jointed is None else jointed.joints
    tolerance = _tolerance(scene)
    rock = rock_of(blocks)
    more = {joint.name: joint.lines for joint in joints_between(blocks, known, rock, tolerance)}
    if not more:
        if jointed is None:
            return Network((), {"I": 0, "Y": 0, "X": 0}, ())
        return Network(known, dict(jointed.cutting.nodes), jointed.cutting.partings)
    # Rock that was separated earlier is cut again as a whole.
    joints = [replace(joint, lines=(*joint.lines, *more.pop(joint.name, ()))) for joint in known]
    joints += [Joint(name, lines) for name, lines in more.items()]
    whole = [
        Zone("rock", tuple(np.array(ring.coords)[:-1] for ring in (part.exterior, *part.interiors)))
        for part in getattr(rock, "geoms", (rock,))
    ]
    cutting = cut(whole, joints, tolerance=tolerance)
    return Network(tuple(joints), cutting.nodes, cutting.partings)


def _tolerance(scene: Any) -> float:
    """Distance, m, below which drawn lines touch."""
    return scene.tables.geometry.tolerance_m or TOLERANCE * extent_of([scene.drawing.blocks.vertices])


def joint_statistics(scene: Any, problem: Any, free: np.ndarray) -> list[dict[str, Any]]:
    """One entry per joint set of a loaded scene: its statistics in the rock of the ``free`` blocks (a mask).

    "asked" holds the parameters of its distributions, by the same keys.
    """
    import shapely

    blocks, cracks, drawing, network = problem.blocks, problem.cracks, scene.drawing, network_of(scene)
    if not network.joints:
        return []
    geometry = scene.tables.geometry
    shapes = {shape.name: shape for shape in geometry.joint_sets}
    zone = np.array(drawing.zones)
    # A trace that the drawing counts as touching the rim ends there.
    tolerance = _tolerance(scene)
    rock = {(): rock_of(blocks, np.flatnonzero(free).tolist())}
    crack_set = np.array([name.rpartition(" ")[0] for name in cracks.names])
    partings = {parting.name: parting for parting in network.partings}
    entries = []
    for joint in network.joints:
        name = joint.name.removeprefix(JOINT)
        shape = shapes.get(name)
        zones = () if shape is None else tuple(shape.zones)
        if zones not in rock:
            rock[zones] = rock_of(blocks, np.flatnonzero(free & np.isin(zone, zones)).tolist())
        region = rock[zones]
        if shape is not None and shape.region is not None:
            region = shapely.intersection(region, shapely.Polygon(np.reshape(shape.region, (-1, 2)) - drawing.origin))
        own = crack_set == name
        entry = {
            "name": name,
            "kind": "drawn" if shape is None else shape.kind,
            **_got(joint, region, shape, tolerance),
            "cutting_traces": partings[joint.name].cutting,
            "cut_length_m": partings[joint.name].length,
            "cracks": int(own.sum()),
            "crack_length_m": float(cracks.lengths[own[cracks.crack]].sum()) if cracks.n_segments else 0.0,
        }
        if shape is not None:
            entry["asked"] = asked(shape, geometry)
            if entry["mean_angle_deg"] is not None and "mean_angle_deg" in entry["asked"]:
                # A trace has no direction sense: of its two angles, the one nearer to the specified one.
                off = entry["mean_angle_deg"] - entry["asked"]["mean_angle_deg"]
                entry["mean_angle_deg"] -= 180 * round(off / 180)
            entry["ends_on"] = list(shape.ends_on)
            entry["drawn_from"] = shape.model_dump(exclude_defaults=True, exclude={"name", "region"})
        entries.append(entry)
    return entries


def _got(joint: Any, region: Any, shape: Any, tolerance: float) -> dict[str, Any]:
    found = set_statistics(joint, region, tolerance=tolerance)
    out = {
        "traces": found.traces,
        "p10_per_m": found.p10,
        "p20_per_m2": found.p20,
        "p21_per_m": found.p21,
        "mean_length_m": found.mean_length,
        "mean_length_in_window_m": found.window_length,
        "length_deviation_m": found.seen_length_deviation,
        "spacing_m": found.mean_spacing,
        "spacing_deviation_m": found.spacing_deviation,
        "mean_angle_deg": math.degrees(found.mean_angle),
        "angle_deviation_deg": math.degrees(found.angle_deviation),
    }
    if shape is not None and shape.kind == "parallel":
        # Traces of a parallel set lie on lines whose spacing and persistence were specified.
        lines = line_statistics(joint, region)
        out |= {
            "lines": lines.lines,
            "spacing_m": lines.mean_spacing,
            "spacing_deviation_m": lines.spacing_deviation,
            "persistence": lines.persistence,
        }
    return {key: given(value) if isinstance(value, float) else value for key, value in out.items()}


def table(entries: Sequence[dict[str, Any]]) -> list[str]:
    """``entries`` next to the specified values, one per row: number of traces, how many separate blocks, and their
    length."""
    if not entries:
        return []
    wide = max(8, *(len(entry["name"]) for entry in entries))
    rows = [f"{'joints':{wide}}       " + "".join(f" {heading:>14}" for heading, *_ in _COLUMNS)]
    rows[0] += f"{'traces':>8}{'cutting':>9}{'cut m':>9}"
    for entry in entries:
        wanted = entry.get("asked")
        if wanted is not None:
            rows.append(f"{entry['name']:{wide}}  asked" + _row(wanted))
        rows.append(
            f"{'' if wanted is not None else entry['name']:{wide}}  got  "
            + _row(entry)
            + f"{entry['traces']:8d}{entry['cutting_traces']:9d}{entry['cut_length_m']:9.4g}"
        )
        if entry.get("ends_on"):
            rows[-1] += f"  (ends on {', '.join(entry['ends_on'])})"
    return [row.rstrip() for row in rows]


def _row(values: dict[str, Any]) -> str:
    cells = []
    for _, key, spread in _COLUMNS:
        value, off = values.get(key), values.get(spread) if spread else None
        text = "" if value is None else f"{value:.3g}"
        scattered = value is not None and off and off > 1e-6 * abs(value)
        cells.append(f"{text} ± {off:.2g}" if scattered else text)
    return "".join(f" {cell:>14}" for cell in cells)
