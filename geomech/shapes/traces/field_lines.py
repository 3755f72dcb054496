"""Mapped lines from any file: their kinds according to their names, and the drawing that they make."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..curves import Chords, ended_on
from ..parts import EdgeLine, Joint, Mark, Trace, Zone, extent_of

#: Metres per unit, for every unit that a file may have.
METRES = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048, "in": 0.0254}
#: Ends of outline pieces closer than this part of the drawing's largest side are one corner.
CLOSING = 1e-6

# CAD programs do not allow a colon in the name of a layer: "bolt-roof" and "bolt_roof" are "bolt:roof".
_ROLE = re.compile(
    r"(?P<role>joint|crack|zone|hole|edge|load|fixed|guided|bolt|water|monitor|probe)(?:[:_\- ]+(?P<own>.+))?",
    re.IGNORECASE,
)
#: Words that need a name after them as the name of a layer.
UNFINISHED = ("joint", "crack", "edge", "load", "guided")
#: Roles that are complete without a name. A set may itself be called "joint" or "crack".
_ALONE = ("zone", "hole", "fixed", "water", "bolt", "monitor", "probe")
#: Name of a plain layer of outlines.
_OUTLINE = re.compile(r"zones|outlines?|boundary|domain", re.IGNORECASE)


class FieldFileError(ValueError):
    """A file of traces that cannot be read."""

    def __init__(self, message: str, way_out: str) -> None:
        super().__init__(f"{message}: {way_out}")
        self.message, self.way_out = message, way_out


@dataclass(frozen=True, eq=False)
class FieldLine:
    """One line of a file.

    points   (n, 2), a single one for a point
    layer    layer or set that contains it; ``label``: a name of its own (of a monitor) or ""
    place    its place in the file
    shape    "line", "closed" (without repetition of its first point), "area" (a closed line meant as an area) or "hole"
             (of the preceding area)
    away     of a curve, its largest distance from the piece after each point, (n,) m
    """

    layer: str
    points: np.ndarray
    place: str
    shape: str = "line"
    label: str = ""
    away: np.ndarray | None = None

    def chords(self) -> Chords:
        """The pieces that approximate curves."""
        if self.away is None:
            return Chords.none()
        points = self.points if self.shape == "line" else np.concatenate([self.points, self.points[:1]])
        return Chords.of([points], [self.away[: len(points) - 1]])


@dataclass(frozen=True, eq=False)
class FieldFile:
    """``lines`` of a file in m, and the parts that were left out, as (message, way out); ``crs`` is the member of a
    GeoJSON file with its coordinate reference system, or None."""

    lines: tuple[FieldLine, ...]
    warnings: tuple[tuple[str, str], ...] = ()
    crs: dict | None = None


class Named(NamedTuple):
    """A line and its ``role``: "joint", "crack", "zone", "hole", "edge" or "mark", with the full name, such as
    "joint:bedding" or "bolt:roof" (for an edge its own)."""

    role: str
    name: str
    line: FieldLine


@dataclass(frozen=True, eq=False)
class FieldDrawing:
    """The drawing made of lines. ``places`` gives the place in its file for ("zones" | "cracks" | "joints" | "edges" |
    "marks", index); ``chords`` approximate the curves of outlines, joints and cracks."""

    zones: tuple[Zone, ...] = ()
    traces: tuple[Trace, ...] = ()
    joints: tuple[Joint, ...] = ()
    edges: tuple[EdgeLine, ...] = ()
    marks: tuple[Mark, ...] = ()
    warnings: tuple[tuple[str, str], ...] = ()
    places: Mapping[tuple[str, int], str] = field(default_factory=dict)
    chords: Chords = field(default_factory=Chords.none)


def role_of(name: str) -> tuple[str, str] | None:
    """Role according to the name of a layer, and the full name; None for the plain name of a set.

    "joint:J1" is ("joint", "joint:J1"), "BOLT-roof" ("mark", "bolt:roof"), "outline" ("zone", "zone:rock").
    """
    name = name.strip()
    if _OUTLINE.fullmatch(name):
        return "zone", "zone:rock"
    found = _ROLE.fullmatch(name)
    if found is None:
        return None
    role, own = found["role"].lower(), (found["own"] or "").strip()
    if not own and role not in _ALONE:
        return None
    if role in ("joint", "crack", "zone"):
        return role, f"{role}:{own or 'rock'}"
    if role == "hole":
        return "hole", "hole"
    if role in ("edge", "load", "fixed", "guided"):
        return "edge", own if role == "edge" else f"{role}:{own}" if own else role
    role = "monitor" if role == "probe" else role
    return "mark", f"{role}:{own}" if own else role


def named_lines(
    file: FieldFile, layers: Mapping[str, str] | None = None, name: str | None = None, kind: str = "joint"
) -> tuple[list[Named], list[str], dict[str, int]]:
    """The role of each line of ``file``.

    ``layers`` maps layers (with wildcards) to names, such as {"J1*": "joint:bedding", "*": ""}; "" keeps the layer's
    own name, and lines in layers that match no pattern are left out. A plain name is a set of ``kind`` "joint" or
    "crack"; ``name`` replaces the plain names of all layers. Areas with plain names are zones. Also returned: the
    patterns that match no layer, and the number of lines left out by layer.
    """
    found: list[Named] = []
    idle = set(layers or ())
    out: dict[str, Any] = {}
    meant: dict[str, str | None] = {}
    for line in file.lines:
        if line.layer not in meant:
            hits = [p for p in layers or () if fnmatch.fnmatch(line.layer.lower(), p.lower())]
            idle.difference_update(hits[:1])
            meant[line.layer] = (layers[hits[0]] or line.layer) if layers and hits else None if layers else line.layer
        meaning = meant[line.layer]
        if meaning is None:
            out[line.layer] = out.get(line.layer, 0) + 1
            continue
        known = ("hole", "hole") if line.shape == "hole" else role_of(meaning)
        if known is None:
            own = name if name is not None and meaning == line.layer else meaning
            role = "zone" if line.shape == "area" else kind
            known = role, f"{role}:{own}"
        found.append(Named(*known, line))
    return found, [pattern for pattern in layers or () if pattern in idle], out


def drawing_of_lines(lines: Sequence[Named]) -> FieldDrawing:
    """Zones, cracks, joints, named edges and marks made of ``lines``.

    Closed lines of zones, and open ones that close each other, are outlines; one inside another is cut out of it, and
    so are holes. Ends of joints and cracks on a curve are moved onto its chords. Every line of a set of cracks is a
    crack, "NAME 1", "NAME 2", … if there are several. Raises FieldFileError for outlines that do not close.
    """
    warnings: list[tuple[str, str]] = []
    places: dict[tuple[str, int], str] = {}
    joints: dict[str, list[np.ndarray]] = {}
    marks: dict[str, list[np.ndarray]] = {}
    cracks: dict[str, list[FieldLine]] = {}
    edges: list[EdgeLine] = []
    outlines: list[Named] = []
    unnamed: dict[str, list[FieldLine]] = {}
    for named in lines:
        role, name, line = named
        points = line.points
        is_point = len(points) == 1
        if is_point and name.startswith("load:"):
            role = "mark"
        elif is_point and not name.startswith("monitor"):
            unnamed.setdefault(name, []).append(line)
            continue
        is_closed = role != "mark" and line.shape != "line"
        closed = np.concatenate([points, points[:1]]) if is_closed else points
        if role in ("zone", "hole"):
            outlines.append(named)
        elif role == "joint":
            places.setdefault(("joints", list(joints).index(name) if name in joints else len(joints)), line.place)
            joints.setdefault(name, []).append(closed)
        elif role == "crack":
            cracks.setdefault(name.removeprefix("crack:"), []).append(replace(line, points=closed))
        elif role == "edge":
            for a, b in pairwise(closed):
                places["edges", len(edges)] = line.place
                edges.append(EdgeLine(name, tuple(a.tolist()), tuple(b.tolist())))
        else:
            full = f"{name}:{line.label}" if line.label and name == "monitor" else name
            if is_point != name.startswith(("monitor", "load:")):
                warnings.append((f"{line.place}: {full!r} is not a point, and is left out", "a monitor is a point"))
                continue
            places.setdefault(("marks", list(marks).index(full) if full in marks else len(marks)), line.place)
            marks.setdefault(full, []).append(points)
    for name, own in unnamed.items():
        what = f"{len(own)} points" if len(own) > 1 else "a point"
        warnings.append(
            (f"{own[0].place}: {what} called {name!r}, left out", 'points are monitors: call them "monitor:NAME"')
        )
    traces: list[Trace] = []
    for name, own in cracks.items():
        for k, line in enumerate(own, 1):
            places["cracks", len(traces)] = line.place
            traces.append(Trace(name if len(own) == 1 else f"{name} {k}", (line.points,)))
    zones = _zones(outlines, places)
    chords = Chords.joined([item.line.chords() for item in lines if item.role in ("zone", "hole", "joint", "crack")])
    return FieldDrawing(
        zones=tuple(zones),
        traces=tuple(ended_on(traces, chords)),
        joints=tuple(ended_on([Joint(name, tuple(own)) for name, own in joints.items()], chords)),
        edges=tuple(edges),
        marks=tuple(Mark(name, tuple(own)) for name, own in marks.items()),
        warnings=tuple(warnings),
        places=places,
        chords=chords,
    )


def _zones(outlines: Sequence[Named], places: dict[tuple[str, int], str]) -> list[Zone]:
    """Outlines as zones; outlines inside them are cut out."""
    if not outlines:
        return []
    import shapely

    tolerance = CLOSING * extent_of([named.line.points for named in outlines])
    shapes: list[tuple[str, str, shapely.Polygon]] = []  # zone's name ("" for a hole), place, polygon
    open_ones: dict[str, list[FieldLine]] = {}
    for role, name, line in outlines:
        name = "" if role == "hole" else name.removeprefix("zone:")
        ends_meet = len(line.points) > 3 and np.hypot(*(line.points[0] - line.points[-1])) <= tolerance
        if line.shape == "line" and not ends_meet:
            open_ones.setdefault(name, []).append(line)
            continue
        points = line.points[:-1] if line.shape == "line" else line.points
        if len(points) < 3:
            raise FieldFileError(
                f"{line.place}: an outline of {len(points)} corners", "a polygon needs at least three different corners"
            )
        shapes.append((name, line.place, shapely.Polygon(points)))
    for name, pieces in open_ones.items():
        shapes += [(name, pieces[0].place, polygon) for polygon in _closed(pieces, name, tolerance)]
    rings = [shapely.Polygon(shape.exterior) for _, _, shape in shapes]
    tree = shapely.STRtree(rings)
    zones: list[Zone] = []
    for k, (name, place, shape) in enumerate(shapes):
        if not name:
            continue
        if not shape.is_valid:
            # `assemble` reports where an outline crosses itself.
            places["zones", len(zones)] = place
            zones.append(Zone(name, (shapely.get_coordinates(shape)[:-1],)))
            continue
        inside = [j for j in tree.query(shape, predicate="covers") if j != k and rings[j].area < shape.area]
        rest = shape.difference(shapely.union_all([rings[j] for j in inside])) if inside else shape
        for part in shapely.get_parts(rest):
            loops = [shapely.get_coordinates(ring)[:-1] for ring in (part.exterior, *part.interiors)]
            places["zones", len(zones)] = place
            zones.append(Zone(name, tuple(loops)))
    return zones


def _closed(pieces: Sequence[FieldLine], name: str, tolerance: float) -> list:
    """Polygons enclosed by open ``pieces``; ends within ``tolerance`` (m) are one corner."""
    import shapely
    from scipy.spatial import cKDTree

    lines = [piece.points.copy() for piece in pieces]
    ends = np.array([line[k] for line in lines for k in (0, -1)])
    for a, b in sorted(cKDTree(ends).query_pairs(tolerance)):
        ends[b] = ends[a]
    for k, line in enumerate(lines):
        line[0], line[-1] = ends[2 * k], ends[2 * k + 1]
    polygons, cuts, dangles, invalid = shapely.polygonize_full(
        [shapely.union_all([shapely.LineString(line) for line in lines])]
    )
    loose = [*shapely.get_parts(dangles), *shapely.get_parts(cuts), *shapely.get_parts(invalid)]
    if loose or not len(shapely.get_parts(polygons)):
        x, y = (shapely.get_coordinates(loose[0]) if loose else ends)[-1]
        raise FieldFileError(
            f"{pieces[0].place}: the outline of zone {name!r} does not close: a line ends at ({x:.10g}, {y:.10g})",
            "join the ends of the lines of an outline, or put lines that are not outlines into another layer",
        )
    return list(shapely.get_parts(polygons))
