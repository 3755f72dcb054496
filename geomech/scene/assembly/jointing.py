"""Joints of a scene, drawn ones and statistical sets, and the rock cut along them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...model import Blocks, Cracks
from ...shapes import Cutting, Joint, Repair, Trace, Zone, cut
from ...shapes.assembly import TOLERANCE
from ...shapes.block_cutting.crack_traces import crack_network
from ...shapes.curves import Chords, ended_on
from ...shapes.joint_networks.joint_sets import (
    FisherAngle,
    Law,
    Poles,
    apparent_dip,
    discs,
    parallel_set,
    poisson_lines,
    poisson_traces,
    terminated,
    voronoi,
)
from ...shapes.parts import JOINT, Flaw, ShapeError, extent_of, grid_decimals
from ..tables.entries import given
from ..tables.geometry import Geometry, JointSetShape

#: Blocks below this share of the median one are slivers that joint sets leave at crossings: merged unless
#: `smallest_block_m2` says otherwise. (Of 1 005 blocks of a slope seven are below it. With them contacts of a step settle
#: after 1.9 times as many iterations, without them after 1.3 times as many as without blocks below a twentieth, and its
#: factor of safety is found.)
SLIVER_SHARE = 1e-3
#: Number of listed places of each kind of defect.
_LISTED = 4
#: Joints with more pieces between crossings are not cut: 100 000 blocks have 250 000 and take seconds; ten times as
#: many take a minute and 10 GB, and are beyond the solvers. The same limit holds for pairs of joints that lie side by
#: side.
MOST_PIECES, MOST_PAIRS = 2_000_000, 20_000_000


@dataclass(frozen=True, eq=False)
class Jointed:
    """Zones cut along ``joints``. ``cutting`` has the blocks; ``cracks`` are its dead ends and the drawn cracks, with
    common nodes."""

    joints: tuple[Joint, ...]
    cutting: Cutting
    cracks: Cracks

    def repair_lines(self, others: str) -> list[str]:
        """Defects found and repaired, one line per kind, with the first places and their junctions; ``others`` says
        where the rest are listed."""
        kinds: dict[str, list[Repair]] = {}
        for repair in self.cutting.repairs:
            kinds.setdefault(repair.kind, []).append(repair)
        lines = []
        for kind, own in kinds.items():
            unit = "m²" if kind in ("sliver", "small block kept") else "m"
            places = [
                f"({repair.x:.6g}, {repair.y:.6g}){f' {repair.junction}' * bool(repair.junction)}"
                for repair in own[:_LISTED]
            ]
            more = f" and {len(own) - _LISTED} more, {others}" if len(own) > _LISTED else ""
            size = max(repair.size for repair in own)
            lines.append(f"{len(own)} × {kind}, up to {size:.3g} {unit}, at {', '.join(places)}{more}")
        return lines


def jointed(
    geometry: Geometry,
    zones: list[Zone],
    blocks: Blocks,
    traces: list[Trace],
    drawn: Sequence[Joint] = (),
    chords: Chords | None = None,
) -> Jointed:
    """Rock of ``zones``, drawn as ``blocks``, cut along the scene's joints and those ``drawn`` elsewhere.

    Joints that end on a curve end on its ``chords``. Raises ShapeError for faulty joints or cracks.
    """
    named = [Zone(zone.name, tuple(blocks.loops(k)), _names(blocks, k)) for k, zone in enumerate(zones)]
    joints = make_joints(geometry, named, drawn, chords)
    cutting = cut(
        named,
        joints,
        tolerance=geometry.tolerance_m,
        dead_ends=geometry.dead_ends,
        shortest_crack=geometry.shortest_crack_m,
        smallest_area=geometry.smallest_block_m2 or 0.0,
        smallest_share=SLIVER_SHARE if geometry.smallest_block_m2 is None else 0.0,
        # Drawn joints come first, then sets in order: a small block never removes part of a drawn fault.
        lasting=len(joints) - len(geometry.joint_sets),
    )
    return Jointed(tuple(joints), cutting, _cracks(geometry, named, cutting, traces))


def make_joints(
    geometry: Geometry, zones: Sequence[Zone], drawn: Sequence[Joint] = (), chords: Chords | None = None
) -> list[Joint]:
    """Joints drawn in the scene and elsewhere, one per name, and the scene's sets over the rock of ``zones``.

    Drawn joints that end on a curve end on its ``chords``.
    """
    outlines = [zone.loops[0] for zone in zones]
    lines: dict[str, list[np.ndarray]] = {}
    for joint in geometry.joints:
        own = Joint(JOINT + joint.name, (np.array(joint.points, dtype=float).reshape(-1, 2),))
        if joint.zones:
            own = within(own, [zone for zone in zones if zone.name in joint.zones])
        lines.setdefault(own.name, []).extend(own.lines)
    for joint in drawn:
        lines.setdefault(joint.name, []).extend(joint.lines)
    joints = ended_on([Joint(name, tuple(own)) for name, own in lines.items()], chords or Chords.none())
    low, high = np.min([o.min(axis=0) for o in outlines], axis=0), np.max([o.max(axis=0) for o in outlines], axis=0)
    box = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    flaws = _too_fine(geometry, box)
    for k, shape in enumerate(geometry.joint_sets if not flaws else ()):
        # Each set has its own random stream: adding one does not change the others.
        rng = np.random.default_rng([geometry.seed, k])
        unknown = [name for name in shape.ends_on if JOINT + name not in {joint.name for joint in joints}]
        if unknown:
            known = ", ".join(repr(joint.name.removeprefix(JOINT)) for joint in joints) or "none"
            flaws.append(
                Flaw("joint_sets", k, f"no joints {unknown[0]!r} are defined before this set", f"there are {known}")
            )
            continue
        try:
            joint = _set(shape, geometry, box, rng)
        except ValueError as error:
            flaws.append(Flaw("joint_sets", k, str(error), "check its means and deviations"))
            continue
        unknown_zones = [name for name in shape.zones if name not in {zone.name for zone in zones}]
        if unknown_zones:
            known = ", ".join(repr(name) for name in dict.fromkeys(zone.name for zone in zones))
            flaws.append(Flaw("joint_sets", k, f"there is no zone {unknown_zones[0]!r}", f"there are {known}"))
            continue
        if shape.zones:
            joint = within(joint, [zone for zone in zones if zone.name in shape.zones])
        walls = [other for other in joints if other.name.removeprefix(JOINT) in shape.ends_on]
        joints.append(terminated(joint, walls, shape.ends_share, rng) if walls else joint)
    if flaws:
        raise ShapeError(flaws)
    return joints


def within(joint: Joint, zones: Sequence[Zone]) -> Joint:
    """The part of ``joint`` inside ``zones``."""
    import shapely

    rock = shapely.union_all([shapely.Polygon(zone.loops[0], zone.loops[1:]) for zone in zones])
    inside = shapely.get_parts(
        shapely.intersection(np.array([shapely.LineString(line) for line in joint.lines], object), rock)
    )
    return Joint(joint.name, tuple(shapely.get_coordinates(line) for line in inside if shapely.length(line) > 0))


def _too_fine(geometry: Geometry, box: np.ndarray) -> list[Flaw]:
    """A flaw if the specified sets would have too many pieces, or too many joints side by side; it names the finest
    set."""
    finest, pieces, pairs, lengths = (0.0, 0, 0.0), 0.0, 0.0, 0.0
    for k, shape in enumerate(geometry.joint_sets):
        try:
            wanted = asked(shape, geometry)
        except ValueError:
            continue  # reported when it is generated
        region = box if shape.region is None else np.array(shape.region, dtype=float).reshape(-1, 2)
        x, y = (region - region[0]).T
        area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
        if not area:
            continue
        length = wanted["p21_per_m"] * area
        # Without a length, traces extend right through.
        each = min(wanted.get("mean_length_m", math.inf), math.sqrt(area))
        number = length / each
        # Boxes around inclined joints overlap, however nearly parallel they are.
        neighbours = min(
            number, number / area * 2 * each**2 * abs(math.sin(2 * math.radians(wanted.get("mean_angle_deg", 45.0))))
        )
        pairs += number * neighbours
        # Two sets in one region cross about as often as lines with random directions (Miles 1964).
        pieces += number + 4 / math.pi * length * lengths / area
        lengths += length
        finest = max(finest, (wanted["p21_per_m"], k, number))
    if pieces <= MOST_PIECES and pairs <= MOST_PAIRS:
        return []
    density, k, number = finest
    return [
        Flaw(
            "joint_sets", k,
            f"this set would have about {number:.1g} joints, {density:.3g} m per m², and all sets {pieces:.1g} pieces "
            "between crossings: more than can be cut",
            "are its spacing and lengths in metres? Increase the spacing, or reduce its `region`",
        )
    ]  # fmt: skip


def _set(shape: JointSetShape, geometry: Geometry, box: np.ndarray, rng: np.random.Generator) -> Joint:
    name = JOINT + shape.name
    region = box if shape.region is None else np.array(shape.region, dtype=float).reshape(-1, 2)
    turn, spacing, length, gap = _laws(shape, geometry)
    if shape.kind == "lines":
        return poisson_lines(name, region, turn, given(shape.p21_per_m), rng)
    if shape.kind == "voronoi":
        return voronoi(name, region, given(shape.cell_area_m2), rng)
    if shape.kind == "discs":
        return discs(name, region, _poles(shape, geometry), given(length), given(shape.p32_per_m), rng)
    assert turn is not None  # `JointSetShape`
    if shape.kind == "parallel":
        return parallel_set(name, region, turn, given(spacing), length, gap, rng)
    return poisson_traces(name, region, turn, given(length), given(shape.p20_per_m2), rng)


def asked(shape: JointSetShape, geometry: Geometry) -> dict[str, float]:
    """Expected statistics of a set of the scene, as from `geomech.shapes.joint_networks.expected_statistics`."""
    from ...shapes.joint_networks import expected_statistics as expected

    turn, spacing, length, gap = _laws(shape, geometry)
    if shape.kind == "lines":
        return expected.of_poisson_lines(turn, given(shape.p21_per_m))
    if shape.kind == "voronoi":
        return expected.of_voronoi(given(shape.cell_area_m2))
    if shape.kind == "discs":
        return expected.of_discs(_poles(shape, geometry), given(length), given(shape.p32_per_m))
    assert turn is not None  # `JointSetShape`
    if shape.kind == "parallel":
        return expected.of_parallel(turn, given(spacing), length, gap)
    return expected.of_poisson_traces(turn, given(length), given(shape.p20_per_m2))


def _laws(
    shape: JointSetShape, geometry: Geometry
) -> tuple[Law | FisherAngle | None, Law | None, Law | None, Law | None]:
    """Distributions of angle in the section (rad), spacing, length and gap; None for those that the set does not
    have."""
    angle, section = shape.angle_deg, math.radians(geometry.section_azimuth_deg)
    if shape.dip_deg is not None:
        dip, direction = math.radians(shape.dip_deg), math.radians(given(shape.dip_direction_deg))
        angle = math.degrees(apparent_dip(dip, direction, section))
    turn: Law | FisherAngle | None = None
    if angle is not None:
        turn = Law(math.radians(angle), math.radians(shape.angle_deviation_deg), shape.angle_law)
    if shape.fisher > 0 and shape.dip_deg is not None:
        turn = FisherAngle(dip, direction, section, shape.fisher)
    spacing = None if shape.spacing_m is None else Law(shape.spacing_m, shape.spacing_deviation_m, shape.spacing_law)
    length = None if shape.length_m is None else Law(shape.length_m, shape.length_deviation_m, shape.length_law)
    gap = None if shape.gap_m == 0 else Law(shape.gap_m, shape.gap_deviation_m, shape.gap_law)
    return turn, spacing, length, gap


def _poles(shape: JointSetShape, geometry: Geometry) -> Poles:
    return Poles(
        math.radians(given(shape.dip_deg)),
        math.radians(given(shape.dip_direction_deg)),
        shape.fisher,
        math.radians(geometry.section_azimuth_deg),
    )


def _names(blocks: Blocks, block: int) -> tuple[tuple[str, ...], ...]:
    first, last = blocks.block_loop[block], blocks.block_loop[block + 1]
    return tuple(
        tuple(blocks.edge_names[k] for k in blocks.edge_name[blocks.loop_start[loop] : blocks.loop_start[loop + 1]])
        for loop in range(first, last)
    )


def _cracks(geometry: Geometry, zones: list[Zone], cutting: Cutting, traces: list[Trace]) -> Cracks:
    """Dead ends, and the drawn ``traces``, in the blocks that contain them now."""
    if not traces:
        return cutting.cracks
    import shapely

    every = [loop for zone in zones for loop in zone.loops]
    decimals = grid_decimals(every)
    tolerance = TOLERANCE * extent_of(every) if geometry.tolerance_m is None else geometry.tolerance_m
    loops = [cutting.blocks.loops(b) for b in range(cutting.blocks.n_blocks)]
    polygons = np.array([shapely.Polygon(own[0], own[1:]) for own in loops])
    ends = cutting.cracks
    chains = [
        ends.nodes[np.append(s[:, 0], s[-1, 1])] for s in (ends.segments[ends.crack == k] for k in range(ends.n_cracks))
    ]
    pieces = [piece for trace in traces for piece in _parted(trace, polygons, tolerance)]
    names = [trace.name for trace in pieces] + list(ends.names)
    lines = [[np.round(line, decimals) + 0.0 for line in trace.lines] for trace in pieces] + [
        [chain] for chain in chains
    ]
    flaws: list[Flaw] = []
    cracks = crack_network(names, lines, cutting.blocks.names, polygons, loops, tolerance, decimals, flaws)
    if flaws:
        raise ShapeError(flaws)
    return cracks


def _parted(trace: Trace, polygons: np.ndarray, tolerance: float) -> list[Trace]:
    """A drawn crack where joints cross it: one crack per block, "NAME 1", "NAME 2", …; otherwise unchanged.

    Pieces shorter than ``tolerance`` (m) are left out.
    """
    import shapely

    whole = shapely.multilinestrings(shapely.linestrings(trace.lines)) if len(trace.lines) > 1 else None
    whole = shapely.linestrings(trace.lines[0]) if whole is None else whole
    near = shapely.STRtree(polygons).query(whole, predicate="intersects")
    inside = shapely.intersection(polygons[near], whole)
    inside = inside[shapely.length(inside) > tolerance]
    if len(inside) < 2 or shapely.length(whole) - shapely.length(inside).sum() > tolerance:
        # In one block; or partly outside the rock, which the check of cracks reports.
        return [trace]
    runs = shapely.get_parts(shapely.line_merge(inside))
    runs = runs[shapely.length(runs) > tolerance]
    return [Trace(f"{trace.name} {k}", (shapely.get_coordinates(run),)) for k, run in enumerate(runs, 1)]
