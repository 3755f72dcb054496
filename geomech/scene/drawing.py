"""Geometry of a scene as blocks and cracks: from a Gmsh model, from files of traces, or from the scene itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model import Blocks, Cracks
from ..shapes import EdgeLine, Flaw, Joint, Mark, ShapeError, Trace, Zone, assemble, rectangle, straight_crack
from ..shapes.curves import Chords, ended_on
from ..shapes.parts import JOINT
from .assembly.field_files import read_traces
from .errors import Fault
from .locator import Path
from .tables.entries import given
from .tables.geometry import CrackShape, Geometry, ZoneShape
from .validation import nearest
from .world import local_origin, moved_section

if TYPE_CHECKING:
    from .assembly.jointing import Jointed

#: Prefix of warnings about repaired joints.
MENDED = "repaired while cutting"


@dataclass(frozen=True, eq=False)
class Drawing:
    """Blocks and cracks before materials and apertures are assigned.

    zones           (n_blocks,) zone of each block
    cracks_drawn    names of the cracks
    parameters      of a Gmsh model, as used; ``choices``: names of their values, if any; ``model``: its file
    joints          names of edges along joints, with or without block edges; ``jointed``: how they cut the rock
    blocks          None if the drawing cannot be assembled
    marks           lines and points that cut nothing; ``mark_places``: (path in the scene, place in the file) by name
    crack_paths     paths of the drawn cracks
    origin          m, world coordinates of the origin of all these; ``crs``: their reference system as in GeoJSON
    folder          of the scene
    """

    zones: tuple[str, ...]
    cracks_drawn: tuple[str, ...]
    blocks: Blocks | None
    cracks: Cracks | None
    parameters: dict[str, float | str] = field(default_factory=dict)
    choices: dict[str, Mapping[str, float]] = field(default_factory=dict)
    model: FilePath | None = None
    joints: tuple[str, ...] = ()
    jointed: Jointed | None = None
    marks: tuple[Mark, ...] = ()
    mark_places: dict[str, tuple[Path, str]] = field(default_factory=dict)
    origin: tuple[float, float] = (0.0, 0.0)
    crack_paths: dict[str, Path] = field(default_factory=dict)
    crs: dict[str, Any] | None = None
    folder: FilePath | None = None

    def assembled(self) -> tuple[Blocks, Cracks]:
        """Blocks and cracks. Raises ValueError if the drawing cannot be assembled."""
        if self.blocks is None or self.cracks is None:
            raise ValueError("the drawing could not be assembled")
        return self.blocks, self.cracks

    def path_of_crack(self, name: str) -> Path:
        """Where in the scene the crack ``name`` is drawn, or what created it."""
        whole = ("geometry",) if self.model is None else ("geometry", "model")
        return self.crack_paths.get(name) or self.crack_paths.get(name.rpartition(" ")[0], whole)

    def choices_with_edge(self, name: str) -> str:
        """Choices of one parameter with which the model has edges called ``name``, as written in a scene; empty if
        there are none. The model is read again for each choice: for messages only."""
        if self.model is None:
            return ""
        from ..shapes import GmshModelError, read_gmsh_model

        for parameter, choices in self.choices.items():
            found = []
            for choice in choices:
                try:
                    other = read_gmsh_model(self.model, {**self.parameters, parameter: choice}, folder=self.folder)
                except GmshModelError:
                    continue
                labels = [zone.edge_names or () for zone in other.zones]
                if any(name in loop for loops in labels for loop in loops):
                    found.append(f'"{choice}"')
            if found:
                return f"{parameter} = {' or '.join(found)}"
        return ""


@dataclass(eq=False)
class _Parts:
    """Parts drawn so far, in world coordinates.

    ``sources`` gives for (part, index), or (part, name) of joints and marks, its path in the scene and, for other
    files, its place there.
    """

    zones: list[Zone] = field(default_factory=list)
    traces: list[Trace] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    edges: list[EdgeLine] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    sources: dict[tuple[str, int | str], tuple[Path, str]] = field(default_factory=dict)
    only_in: dict[int, Sequence[str]] = field(default_factory=dict)  # names of zones that a joint cuts
    chords: Chords = field(default_factory=Chords.none)  # of curves of models and files

    def add(self, read, source: Callable[[str, int], tuple[Path, str]], zones: Sequence[str] = ()) -> None:
        """Add the content of a file: zones, traces, joints (which cut only the named ``zones``), marks, and edges if
        any."""
        if zones:
            self.only_in.update((len(self.joints) + k, zones) for k in range(len(read.joints)))
        for part, present, added in (
            ("zones", self.zones, read.zones),
            ("cracks", self.traces, read.traces),
            ("edges", self.edges, getattr(read, "edges", ())),
        ):
            for k, item in enumerate(added):
                self.sources[part, len(present)] = source(part, k)
                present.append(item)
        self.chords = Chords.joined([self.chords, read.chords])
        for part, present, added in (("joints", self.joints, read.joints), ("marks", self.marks, read.marks)):
            for k, item in enumerate(added):
                self.sources.setdefault((part, item.name), source(part, k))
                present.append(item)

    def arrays(self) -> list[np.ndarray]:
        """All points of the rock and of the lines that cut it."""
        return [loop for zone in self.zones for loop in zone.loops] + [
            line for item in (*self.traces, *self.joints) for line in item.lines
        ]

    def move(self, origin: np.ndarray) -> None:
        """Make coordinates relative to ``origin`` (2,), m."""

        def lines(items):
            return [replace(item, lines=tuple(line - origin for line in item.lines)) for item in items]

        self.zones = [replace(zone, loops=tuple(loop - origin for loop in zone.loops)) for zone in self.zones]
        self.traces, self.joints, self.marks = lines(self.traces), lines(self.joints), lines(self.marks)
        self.chords = self.chords.moved(origin)
        x, y = origin.tolist()
        self.edges = [
            replace(e, start=(e.start[0] - x, e.start[1] - y), end=(e.end[0] - x, e.end[1] - y)) for e in self.edges
        ]


def draw(
    geometry: Geometry,
    folder: FilePath,
    place: Callable[[Path], str],
    faults: list[Fault],
    warnings: list[Fault],
) -> Drawing | None:
    """Read or make the drawing; errors are added to ``faults``. None if not even its names are known."""
    parts, parameters, choices = _Parts(), {}, {}
    model = None if geometry.model is None else folder / geometry.model
    if model is not None:
        read = _read_model(geometry, model, folder, place, faults)
        if read is None:
            return None
        warnings += [Fault(place(("geometry", "model")), message, way_out) for message, way_out in read.warnings]
        parameters = {name: entry.value for name, entry in read.parameters.items()}
        choices = {name: entry.choices for name, entry in read.parameters.items() if entry.choices}

        def in_model(part: str, index: int) -> tuple[Path, str]:
            entity = read.places.get((part, index))
            return ("geometry", "model"), f"{model.name}: {entity}" if entity else model.name

        parts.add(read, in_model)
    else:
        _draw_here(geometry, parts)
    valid, crs = read_traces(geometry, folder, parts.add, place, faults, warnings)
    if not valid:
        return None
    if not parts.zones:
        layers = ", ".join(repr(joint.name.removeprefix(JOINT)) for joint in parts.joints[:8])
        faults.append(
            Fault(
                place(("geometry", "traces")),
                f"no rock: none of the layers is a zone; they are sets of joints ({layers})",
                'state which layer holds the outline: layers = { "NAME" = "zone:rock", "*" = "" }, or add '
                "[[geometry.zones]]",
            )
        )
        return None
    parts.traces = ended_on(parts.traces, parts.chords)
    _refuse_two_of_a_name(parts, place, faults)
    known = list(dict.fromkeys(zone.name for zone in parts.zones))
    for k, entry in enumerate(geometry.traces):
        for n, name in enumerate(entry.zones):
            if name not in known:
                at = ("geometry", "traces", k, "zones", n)
                faults.append(Fault(place(at), f"there is no zone {name!r}", nearest(name, known)))
    for k, joint in enumerate(geometry.joints):
        for n, name in enumerate(joint.zones):
            if name not in known:
                at = ("geometry", "joints", k, "zones", n)
                faults.append(Fault(place(at), f"there is no zone {name!r}", nearest(name, known)))
    origin = local_origin(geometry.origin, parts.arrays())
    if origin.any():
        parts.move(origin)
        geometry = moved_section(geometry, "geometry", origin)
    return _assembled(
        geometry, parts, Drawing((), (), None, None, parameters, choices, model, crs=crs, folder=folder), origin, place,
        faults, warnings,
    )  # fmt: skip


def _draw_here(geometry: Geometry, parts: _Parts) -> None:
    """The parts drawn in the scene itself."""
    parts.zones += [Zone(z.name, _loops(z)) for z in geometry.zones]
    parts.traces += [Trace(c.name, (_line(c),)) for c in geometry.cracks]
    parts.edges += [EdgeLine(e.name, *e.line, e.zone) for e in geometry.edges]


def _refuse_two_of_a_name(parts: _Parts, place: Callable[[Path], str], faults: list[Fault]) -> None:
    seen: set[str] = set()
    for k, trace in enumerate(parts.traces):
        if trace.name in seen:
            path, at = parts.sources.get(("cracks", k), (("geometry", "cracks", k, "name"), ""))
            faults.append(
                Fault(
                    place(path),
                    f"{at}: there are two cracks called {trace.name!r}".removeprefix(": "),
                    "give each crack a name of its own",
                )
            )
        seen.add(trace.name)


def _read_model(
    geometry: Geometry, model: FilePath, folder: FilePath, place: Callable[[Path], str], faults: list[Fault]
):
    """The `GmshDrawing` of the model, without faulty parameters; None if it cannot be read."""
    # Imported here: a scene drawn in TOML needs no Gmsh.
    from ..shapes import GmshModelError, GmshUnavailable, read_gmsh_model

    source = ("geometry", "model")
    wanted = dict(geometry.parameters)
    while True:
        try:
            return read_gmsh_model(model, wanted, geometry.chord_tolerance_m, geometry.unit, folder)
        except GmshModelError as error:
            at = ("geometry", "parameters", error.parameter) if error.parameter is not None else source
            faults.append(Fault(place(at), error.message, error.way_out))
            if error.parameter not in wanted:
                return None
            # Without the faulty parameter the names of zones, edges and cracks can still be checked.
            del wanted[error.parameter]
        except GmshUnavailable as error:
            faults.append(Fault(place(source), str(error), "or draw the geometry in the scene, [[geometry.zones]]"))
            return None


def _assembled(
    geometry: Geometry,
    parts: _Parts,
    drawing: Drawing,
    origin: np.ndarray,
    place: Callable[[Path], str],
    faults: list[Fault],
    warnings: list[Fault],
) -> Drawing:
    """``drawing`` with the blocks and cracks of ``parts``, or without them if they cannot be assembled."""
    names = tuple(zone.name for zone in parts.zones)
    drawing = replace(
        drawing,
        zones=names,
        cracks_drawn=tuple(trace.name for trace in parts.traces),
        marks=tuple(parts.marks),
        mark_places={str(name): source for (part, name), source in parts.sources.items() if part == "marks"},
        origin=tuple(origin.tolist()),
        crack_paths={
            trace.name: parts.sources.get(("cracks", k), (("geometry", "cracks", k), ""))[0]
            for k, trace in enumerate(parts.traces)
        },
    )
    drawn = drawing.cracks_drawn
    try:
        if not (geometry.joints or geometry.joint_sets or parts.joints):
            blocks, cracks = assemble(parts.zones, parts.traces, parts.edges, geometry.tolerance_m)
            return replace(drawing, blocks=blocks, cracks=cracks)
        from .assembly.jointing import jointed, within

        blocks, _ = assemble(parts.zones, (), parts.edges, geometry.tolerance_m)
        for k, only in parts.only_in.items():
            parts.joints[k] = within(parts.joints[k], [zone for zone in parts.zones if zone.name in only])
        _warn_outside(geometry, parts, place, warnings)
        cut = jointed(geometry, parts.zones, blocks, parts.traces, parts.joints, parts.chords)
    except ShapeError as error:
        counted_from = f"; coordinates are relative to ({origin[0]:.10g}, {origin[1]:.10g})" if origin.any() else ""
        # Joints are counted by name: the scene's own, then those of files.
        own = [JOINT + joint.name for joint in geometry.joints]
        ordered = list(dict.fromkeys([*own, *(joint.name for joint in parts.joints)]))
        for flaw in error.flaws:
            path, at = _source(flaw, parts, ordered, own)
            message = f"{at}: {flaw.message}" if at else flaw.message
            faults.append(Fault(place(path), message, flaw.way_out + counted_from))
        return drawing
    repairs = cut.repair_lines("listed by geomech build")
    warnings += [Fault(place(("geometry",)), f"{MENDED}: {text}", "") for text in repairs]
    joints = tuple(joint.name for joint in cut.joints)
    return replace(
        drawing,
        zones=tuple(names[zone] for zone in cut.cutting.zone),
        cracks_drawn=(*drawn, *(name.removeprefix(JOINT) for name in joints)),
        blocks=cut.cutting.blocks,
        cracks=cut.cracks,
        joints=joints,
        jointed=cut,
    )


def _source(flaw: Flaw, parts: _Parts, joints: Sequence[str], own: Sequence[str]) -> tuple[Path, str]:
    """Path in the scene, and place in another file, of the part with a flaw."""
    key: int | str = flaw.index
    index = flaw.index
    if flaw.part == "joints" and flaw.index < len(joints):
        key = joints[flaw.index]
        index = own.index(key) if key in own else index
    return parts.sources.get((flaw.part, key), (("geometry", flaw.part, index), ""))


def _warn_outside(geometry: Geometry, parts: _Parts, place: Callable[[Path], str], warnings: list[Fault]) -> None:
    """Warn of joints, drawn in the scene or from files, that lie outside the rock: wrong units or origin."""
    import shapely

    found: list[tuple[str, Sequence[np.ndarray], Path, str]] = [
        (JOINT + joint.name, [np.array(joint.points, dtype=float).reshape(-1, 2)], ("geometry", "joints", k), "")
        for k, joint in enumerate(geometry.joints)
    ]
    found += [(joint.name, joint.lines, *parts.sources["joints", joint.name]) for joint in parts.joints]
    found = [joint for joint in found if joint[2] != ("geometry", "model")]
    if not found:
        return
    rock = [shapely.Polygon(zone.loops[0], zone.loops[1:]) for zone in parts.zones]
    shapely.prepare(rock)
    for name, drawn, path, at in found:
        lines = np.array([shapely.LineString(line) for line in drawn], dtype=object)
        if not any(shapely.intersects(polygon, lines).any() for polygon in rock):
            what = "none of its traces lies" if at else "no part of it lies"
            message = f"{name!r} cuts nothing: {what} in the rock"
            warnings.append(Fault(place(path), f"{at}: {message}" if at else message, "is its unit or place wrong?"))


def _loops(zone: ZoneShape) -> tuple[np.ndarray, ...]:
    outline = rectangle(*zone.rectangle) if zone.rectangle is not None else np.array(given(zone.polygon), dtype=float)
    return tuple(loop.reshape(-1, 2) for loop in (outline, *(np.array(hole, dtype=float) for hole in zone.holes)))


def _line(crack: CrackShape) -> np.ndarray:
    if crack.points is not None:
        return np.array(crack.points, dtype=float).reshape(-1, 2)
    return straight_crack(given(crack.centre), given(crack.length_m), math.radians(given(crack.angle_deg)))
