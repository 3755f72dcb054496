"""Gmsh models read as drawings: named surfaces are zones, named curves are joints, cracks and edges."""

from __future__ import annotations

import difflib
import json
import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from .field_lines import METRES
from .gmsh_session import gmsh_session
from .parts import JOINT, Joint, Mark, Trace, Zone, is_mark

#: Curved edges become chords that leave the curve by at most this, in units of the model's largest side.
CHORD = 1e-4

#: Physical curves whose name starts so are cracks; every other name belongs to edges of blocks.
CRACK = "crack:"

#: Words in the rest of a faulty line.
_LONGEST_REST = 1000

#: Files of shapes that say their unit.
STEP = (".step", ".stp")
_SI_LENGTH = re.compile(r"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.\s*\)")
_PREFIXES = {"": 1.0, "MILLI": 1e-3, "CENTI": 1e-2, "DECI": 0.1, "KILO": 1e3, "MICRO": 1e-6}
_OLD_LENGTHS = {"INCH": 0.0254, "FOOT": 0.3048}


class GmshModelError(ValueError):
    """A model that cannot be read. ``parameter`` is the name of the parameter at fault, or None."""

    def __init__(self, message: str, way_out: str, parameter: str | None = None) -> None:
        super().__init__(f"{message}: {way_out}")
        self.message, self.way_out, self.parameter = message, way_out, parameter


@dataclass(frozen=True)
class Parameter:
    """A DefineConstant that the model shows in Gmsh's side panel: its path there, value, range and choices."""

    path: str
    value: float | str
    minimum: float | None = None
    maximum: float | None = None
    choices: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GmshDrawing:
    """What a model holds: ``zones`` (with named edges), ``traces`` of cracks, its ``parameters`` by short name as used,
    ``warnings`` as (message, way out): whatever is drawn and left out; ``joints``; and where they stand in the model:
    ``places`` says, for ("zones" | "cracks" | "joints" | "marks", index), which entities they are; ``marks`` are bolts, water
    tables and measuring points."""

    zones: tuple[Zone, ...]
    traces: tuple[Trace, ...]
    parameters: dict[str, Parameter]
    warnings: tuple[tuple[str, str], ...] = ()
    joints: tuple[Joint, ...] = ()
    places: Mapping[tuple[str, int], str] = field(default_factory=dict)
    marks: tuple[Mark, ...] = ()


def read_gmsh_model(
    path: str | Path,
    parameters: Mapping[str, float | str] | None = None,
    chord_tolerance: float | None = None,
    unit: str | None = None,
) -> GmshDrawing:
    """Read a model with ``parameters`` set: .geo, .geo_unrolled, .msh (any version, its mesh is not kept), .brep, .step.

    A parameter is known by the last part of its name in the side panel ("Parameters/Cracks/phi_deg" is ``phi_deg``)
    or by the whole; where the model offers named choices the name may be given. Physical surfaces are zones, one
    block a surface; physical curves called "crack:NAME" are cracks; those called "joint:NAME" that bound no surface are
    joints; "bolt:NAME", "water" and "water:NAME" are lines that cut nothing, and physical points called "monitor:NAME" or
    "probe:NAME" measuring points; all other physical curves name the block edges on them. A .brep or .step without physical
    surfaces gives a zone a surface, and what its shapes are called there names surfaces and curves. Curved edges become
    chords within ``chord_tolerance`` m (default 1e-4 of the model's largest side). ``unit`` (a key of
    `geomech.shapes.field_lines.METRES`) is what the model is drawn in, default m; for a .step, what the file says.

    Raises GmshModelError for a missing or faulty file, unknown parameters and values out of range, models without
    named surfaces, and GmshUnavailable where Gmsh cannot be loaded.
    """
    path = Path(path)
    if not path.is_file():
        near = [p.name for p in path.parent.glob("*" + path.suffix)] if path.parent.is_dir() else []
        close = difflib.get_close_matches(path.name, near, 1)
        raise GmshModelError(
            f"there is no file {path}",
            f"did you mean {close[0]}?" if close else "paths are relative to the scene file",
        )
    metres = METRES[unit or "m"]
    if path.suffix.lower() in STEP:
        # Every length of a STEP file arrives in millimetres, whatever its unit.
        metres = 1e-3 if unit is None else 1e-3 * metres / _metres_in_step(path)
    with gmsh_session() as gmsh:
        known = _open(gmsh, path)
        if parameters:
            known = _with_parameters(gmsh, path, dict(parameters), known)
        if path.suffix == ".msh":
            from .gmsh_mesh import drawing_of_mesh

            found = drawing_of_mesh(gmsh, path)
        else:
            found = _drawing(gmsh, path, known, None if chord_tolerance is None else chord_tolerance / metres)
    return found if metres == 1.0 else _scaled(found, metres)


def _metres_in_step(path: Path) -> float:
    """The unit of length of a STEP file, m (ISO 10303-41: SI units with a prefix, or conversion-based ones)."""
    text = path.read_text(encoding="latin-1")
    for name, metres in _OLD_LENGTHS.items():
        if f"CONVERSION_BASED_UNIT('{name}'" in text.replace(" ", "").upper():
            return metres
    found = _SI_LENGTH.search(text)
    if found is None or (found[1] or "") not in _PREFIXES:
        raise GmshModelError(f"{path.name} says no unit of length", "export it again, in metres or millimetres")
    return _PREFIXES[found[1] or ""]


def _scaled(found: GmshDrawing, factor: float) -> GmshDrawing:
    def lines(item):
        return replace(item, lines=tuple(factor * line for line in item.lines))

    return replace(
        found,
        zones=tuple(replace(zone, loops=tuple(factor * loop for loop in zone.loops)) for zone in found.zones),
        traces=tuple(map(lines, found.traces)),
        joints=tuple(map(lines, found.joints)),
        marks=tuple(map(lines, found.marks)),
    )


def _open(gmsh, path: Path) -> dict[str, Parameter]:
    """(Re)read the file into the current model; its parameters by short name."""
    # Anew, and not gmsh.clear(): that would wipe other models of a session the caller has open.
    gmsh.model.remove()
    gmsh.model.add("geomech")
    gmsh.parser.clear()  # DefineConstant keeps what a variable of that name already holds
    gmsh.logger.start()
    unit = gmsh.option.getString("Geometry.OCCTargetUnit")
    # OpenCASCADE's own choice, but it keeps what a caller may have chosen before, and would keep another after.
    gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    try:
        gmsh.merge(str(path))
        gmsh.model.occ.synchronize()
        error = None
    except Exception as raised:  # noqa: BLE001 (Gmsh raises nothing narrower)
        error = str(raised)
    finally:
        gmsh.option.setString("Geometry.OCCTargetUnit", unit)
    errors = [line[len("Error: ") :] for line in gmsh.logger.get() if line.startswith("Error: ")]
    gmsh.logger.stop()
    if error or errors:
        text = (errors or [error])[0].replace(f"'{path}', ", "")
        _forget_rest(gmsh)
        raise GmshModelError(f"Gmsh cannot read {path}: {text}", "open it in Gmsh and correct it there")
    found = {}
    for name in gmsh.onelab.getNames():
        about = json.loads(gmsh.onelab.get(name))
        if about.get("readOnly") or name.split("/")[0] in ("Gmsh", "ONELAB") or not about.get("values"):
            continue
        low, high = about.get("min", -1e200), about.get("max", 1e200)
        entry = Parameter(
            path=name,
            value=about["values"][0],
            minimum=low if low > -1e199 else None,
            maximum=high if high < 1e199 else None,
            choices=about.get("valueLabels", {}),
        )
        short = name.rsplit("/", 1)[-1]
        found[name if short in found else short] = entry
    return found


def _forget_rest(gmsh) -> None:
    """Gmsh's parser keeps what follows a fault in its line, and reads that before the next file: give it empty ones, which
    take a word each, until nothing is left."""
    with tempfile.TemporaryDirectory() as folder:
        empty = Path(folder) / "empty.geo"
        empty.write_text("\n")
        for _ in range(_LONGEST_REST):
            gmsh.logger.start()
            try:
                gmsh.merge(str(empty))
                left = any(line.startswith("Error") for line in gmsh.logger.get())
            except Exception:  # noqa: BLE001 (Gmsh raises nothing narrower)
                left = True
            gmsh.logger.stop()
            if not left:
                return


def _with_parameters(
    gmsh, path: Path, wanted: dict[str, float | str], known: dict[str, Parameter]
) -> dict[str, Parameter]:
    """Set what is known and read again, until the rest is known too (a parameter may appear with another's value)."""
    waiting = dict(wanted)
    while waiting:
        ready = {name: _entry(name, known) for name in waiting if _entry(name, known) is not None}
        if not ready:
            name = next(iter(waiting))
            close = difflib.get_close_matches(name, known, 1)
            listed = ", ".join(known) or "none"
            raise GmshModelError(
                f"{path.name} has no parameter {name!r}",
                (f"did you mean {close[0]!r}? " if close else "") + f"its parameters are {listed}",
                parameter=name,
            )
        for name, entry in ready.items():
            value = _value(path, name, waiting.pop(name), entry)
            if isinstance(value, str):
                gmsh.onelab.setString(entry.path, [value])
            else:
                gmsh.onelab.setNumber(entry.path, [value])
        known = _open(gmsh, path)
    return known


def _entry(name: str, known: dict[str, Parameter]) -> Parameter | None:
    return known.get(name) or next((entry for entry in known.values() if entry.path == name), None)


def _value(path: Path, name: str, value: float | str, entry: Parameter) -> float | str:
    """``value`` as the model takes it: choices by name, the right type, inside the range."""

    def refuse(message: str, way_out: str):
        raise GmshModelError(f"parameter {name!r} of {path.name}: {message}", way_out, parameter=name)

    if isinstance(entry.value, str):
        return value if isinstance(value, str) else refuse(f"{value!r} is not a text", "put it in quotes")
    if isinstance(value, bool):
        value = float(value)
    if isinstance(value, str):
        if value in entry.choices:
            return float(entry.choices[value])
        listed = ", ".join(f'"{c}"' for c in entry.choices)
        return refuse(f"{value!r} is not a number", f"choose one of {listed}" if listed else "give a number")
    if entry.choices and value not in entry.choices.values():
        listed = ", ".join(f'{v:g} ("{c}")' for c, v in entry.choices.items())
        return refuse(f"{value:g} is not among its choices", f"choose one of {listed}")
    low, high = entry.minimum, entry.maximum
    if (low is not None and value < low) or (high is not None and value > high):
        span = f"[{'-inf' if low is None else format(low, 'g')}, {'inf' if high is None else format(high, 'g')}]"
        return refuse(f"{value:g} is outside its range {span}", "choose a value inside")
    return float(value)


def _drawing(gmsh, path: Path, parameters: dict[str, Parameter], chord: float | None) -> GmshDrawing:
    box = gmsh.model.getBoundingBox(-1, -1) if gmsh.model.getEntities(2) else (0.0,) * 6
    chord = CHORD * max(box[3] - box[0], box[4] - box[1]) if chord is None else chord
    curves = _Curves(gmsh, chord)
    warnings: list[tuple[str, str]] = []
    if path.suffix in (".geo", ".geo_unrolled") and not path.read_bytes().endswith((b"\n", b"\r")):
        warnings.append(
            (f"{path.name}: its last line does not end, and Gmsh does not read it", "end it with a new line")
        )

    groups = _named_groups(gmsh, path, warnings)
    used = {abs(t) for _, _, tags in groups[2] for tag in tags for t in _outline(gmsh, tag)}
    edge_name: dict[int, str] = {}
    traced: set[int] = set()
    traces, joints, marks, places = [], [], [], {}
    for name, _, tags in groups[0]:
        places["marks", len(marks)] = _entities("point", tags)
        marks.append(Mark(name, tuple(np.array([gmsh.model.getValue(0, tag, [])[:2]]) for tag in tags)))
    for name, _, tags in groups[1]:
        inner = [tag for tag in tags if tag not in used]
        if is_mark(name):
            places["marks", len(marks)] = _entities("curve", tags)
            marks.append(Mark(name, tuple(curves.polyline(tag)[0] for tag in tags)))
            traced.update(tags)
            continue
        if name.startswith(CRACK):
            places["cracks", len(traces)] = _entities("curve", tags)
            traces.append(Trace(name[len(CRACK) :], tuple(curves.chained(tags))))
            traced.update(tags)
            continue
        if name.startswith(JOINT) and inner:
            places["joints", len(joints)] = _entities("curve", inner)
            joints.append(Joint(name, tuple(curves.chained(inner))))
            traced.update(inner)
            tags = [tag for tag in tags if tag in used]
        for tag in tags:
            if edge_name.setdefault(tag, name) != name:
                raise GmshModelError(
                    f"{path.name}: curve {tag} is called both {edge_name[tag]!r} and {name!r}",
                    "give each edge one physical name",
                )

    zones, named = [], set()
    for name, _, tags in groups[2]:
        for tag in tags:
            places["zones", len(zones)] = _entities("surface", [tag])
            zones.append(curves.zone(name, path, tag, _outline(gmsh, tag), edge_name))
            named.add(tag)
    if not zones:
        raise GmshModelError(
            f"{path.name} has no physical surface",
            'name its surfaces: Physical Surface("rock") = {1}; they become zones',
        )
    for _, tag in gmsh.model.getEntities(2):
        if tag not in named:
            warnings.append(
                (f"{path.name}: surface {tag} has no physical name and is left out", "name it, or remove it")
            )
    told: set[int] = set()
    for name in dict.fromkeys(edge_name.values()):
        tags = {tag for tag, its in edge_name.items() if its == name}
        if not used & tags:
            told |= tags
            warnings.append(
                (f"{path.name}: physical curve {name!r} bounds no named surface", f'a crack is called "{CRACK}{name}"')
            )
    warnings += _lost_curves(gmsh, path, curves, zones, used | traced | told)
    warnings += _out_of_plane(gmsh, path, max(box[3] - box[0], box[4] - box[1]))
    return GmshDrawing(tuple(zones), tuple(traces), parameters, tuple(warnings), tuple(joints), places, tuple(marks))


def _named_groups(gmsh, path: Path, warnings: list[tuple[str, str]]) -> dict[int, list[tuple[str, int, list[int]]]]:
    """(name, physical tag, entities) of all physical points (0), curves (1) and surfaces (2). A file of shapes has no physical
    groups: there every surface counts, and shapes are called what the file calls them. Points without a name only held a
    size of elements, or a place."""
    groups: dict[int, list[tuple[str, int, list[int]]]] = {0: [], 1: [], 2: []}
    for dim in (0, 1, 2):
        for _, group in gmsh.model.getPhysicalGroups(dim):
            name = gmsh.model.getPhysicalName(dim, group)
            if not name and dim == 0:
                continue
            if not name and dim == 1:
                warnings.append(
                    (f"{path.name}: physical curve {group} has no name", 'name it: Physical Curve("NAME") = {…}')
                )
                continue
            tags = [int(tag) for tag in gmsh.model.getEntitiesForPhysicalGroup(dim, group)]
            groups[dim].append((name or f"zone {group}", group, tags))
    if path.suffix.lower() in (".brep", *STEP) and not groups[2]:
        for dim in (0, 1, 2):
            called: dict[str, list[int]] = {}
            for _, tag in gmsh.model.getEntities(dim):
                name = gmsh.model.getEntityName(dim, tag).rpartition("/")[2]
                if name or dim == 2:
                    called.setdefault(name or "rock", []).append(int(tag))
            groups[dim] += [(name, 0, tags) for name, tags in called.items()]
    return groups


def _outline(gmsh, surface: int) -> list[int]:
    return [int(t) for _, t in gmsh.model.getBoundary([(2, surface)], combined=False, oriented=True)]


def _entities(kind: str, tags: list[int]) -> str:
    return f"{kind}{'s' if len(tags) > 1 else ''} {', '.join(map(str, tags))}"


def _lost_curves(gmsh, path: Path, curves: _Curves, zones: list[Zone], known: set[int]) -> list[tuple[str, str]]:
    """A warning a zone for curves drawn inside it that are neither its boundary nor cracks: most likely cracks that
    were not named, of which the run would know nothing."""
    outlines = {abs(tag) for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(2), combined=False)}
    inside: dict[str, list[int]] = {}
    for _, tag in gmsh.model.getEntities(1):
        if tag in known or tag in outlines:
            continue
        points = curves.polyline(tag)[0]
        middles = 0.5 * (points[1:] + points[:-1])
        zone = next((zone for zone in zones if any(_holds(zone, middle) for middle in middles)), None)
        if zone is not None:
            inside.setdefault(zone.name, []).append(tag)
    warnings = []
    for name, tags in inside.items():
        listed = ", ".join(map(str, tags))
        what = f"curves {listed} lie" if len(tags) > 1 else f"curve {listed} lies"
        message = f"{path.name}: {what} inside zone {name!r} and {'are no cracks' if len(tags) > 1 else 'is no crack'}"
        way_out = f'name a crack Physical Curve("{CRACK}NAME") = {{{listed}}}, a joint "{JOINT}NAME"; delete what only helped to draw'
        warnings.append((message, way_out))
    return warnings


def _holds(zone: Zone, point: np.ndarray) -> bool:
    """Whether ``point`` is inside the outline and outside the holes: a ray from it crosses the loops an odd number of
    times."""
    crossings = 0
    for loop in zone.loops:
        a, b = loop, np.roll(loop, -1, axis=0)
        spans = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
        a, b = a[spans], b[spans]
        crossings += int((a[:, 0] + (point[1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]) > point[0]).sum())
    return crossings % 2 == 1


def _out_of_plane(gmsh, path: Path, size: float) -> list[tuple[str, str]]:
    """A warning where points stand off the plane z = 0 by more than round-off of a model of this ``size``, m."""
    z = {tag: gmsh.model.getValue(0, tag, [])[2] for _, tag in gmsh.model.getEntities(0)}
    off = [tag for tag, value in z.items() if abs(value) > 1e-9 * size]
    if not off:
        return []
    shown = ", ".join(map(str, off[:6])) + (", …" if len(off) > 6 else "")
    worst = max((z[tag] for tag in off), key=abs)
    return [
        (
            f"{path.name}: {f'points {shown} have' if len(off) > 1 else f'point {shown} has'} z ≠ 0 (up to {worst:g} m)",
            "the rock is plane and z is left away: draw in x and y, with z = 0",
        )
    ]


class _Curves:
    """Curves of the current model as polylines, each with the tags of the points it joins."""

    def __init__(self, gmsh, chord: float) -> None:
        self.gmsh, self.chord, self.known = gmsh, chord, {}

    def polyline(self, tag: int) -> tuple[np.ndarray, int, int]:
        """(n, 2) points along the curve ``tag``, reversed for a negative one, and the tags of its end points."""
        if abs(tag) not in self.known:
            points, ends = self._sampled(abs(tag)), self.gmsh.model.getBoundary([(1, abs(tag))], False, True)
            first, last = (ends[0][1], ends[-1][1]) if ends else (-abs(tag), -abs(tag))
            if len(ends) == 2 and len(points) == 2:
                at = [self.gmsh.model.getValue(0, t, [])[:2] for t in (first, last)]
                points = np.array(at)
            self.known[abs(tag)] = points, abs(first) if ends else first, abs(last) if ends else last
        points, first, last = self.known[abs(tag)]
        return (points, first, last) if tag > 0 else (points[::-1], last, first)

    def _sampled(self, tag: int) -> np.ndarray:
        model = self.gmsh.model
        (low,), (high,) = model.getParametrizationBounds(1, tag)
        if model.getType(1, tag) == "Line":
            return model.getValue(1, tag, [low, high]).reshape(-1, 3)[:, :2]
        # Halve the pieces until the curve's mid-points leave the chords by less than the tolerance; a closed curve
        # needs a few pieces before its chords mean anything.
        for pieces in (4, 8, 16, 32, 64, 128, 256, 512, 1024):
            t = np.linspace(low, high, 2 * pieces + 1)
            fine = model.getValue(1, tag, t.tolist()).reshape(-1, 3)[:, :2]
            points = fine[::2]
            if np.hypot(*(fine[1::2] - 0.5 * (points[1:] + points[:-1])).T).max() <= self.chord:
                break
        return points

    def chained(self, tags: list[int]) -> list[np.ndarray]:
        """Curves that follow one another joined into polylines; one starts anew where they branch."""
        pieces = [self.polyline(tag) for tag in tags]
        lines = []
        while pieces:
            points, first, last = pieces.pop(0)
            grown = True
            while grown:
                grown = False
                for end in (last, first):
                    meeting = [k for k, p in enumerate(pieces) if end in p[1:]]
                    if len(meeting) != 1 or first == last:
                        continue
                    other, a, b = pieces.pop(meeting[0])
                    if end == last:
                        other, b = (other, b) if a == end else (other[::-1], a)
                        points, last = np.concatenate([points, other[1:]]), b
                    else:
                        other, a = (other, a) if b == end else (other[::-1], b)
                        points, first = np.concatenate([other, points[1:]]), a
                    grown = True
                    break
            lines.append(points)
        return lines

    def zone(self, name: str, path: Path, surface: int, signed: list[int], edge_name: dict[int, str]) -> Zone:
        """The loops that the ``signed`` boundary curves of a ``surface`` form, the widest one first."""
        waiting = list(signed)
        loops = []
        while waiting:
            tag = waiting.pop(0)
            points, first, last = self.polyline(tag)
            loop, label = [points[:-1]], [edge_name.get(abs(tag), "")] * (len(points) - 1)
            while last != first:
                following = next((t for t in waiting if self.polyline(t)[1] == last), None)
                if following is None:
                    # A curve listed against the loop's sense.
                    following = next((t for t in waiting if self.polyline(t)[2] == last), None)
                    if following is None:
                        raise GmshModelError(
                            f"{path.name}: the outline of surface {surface}, zone {name!r}, is not closed after curve "
                            f"{abs(tag)}",
                            "close its Curve Loop",
                        )
                    waiting.remove(following)
                    points, _, last = self.polyline(-following)
                else:
                    waiting.remove(following)
                    points, _, last = self.polyline(following)
                loop.append(points[:-1])
                label += [edge_name.get(abs(following), "")] * (len(points) - 1)
            loops.append((np.concatenate(loop), tuple(label)))
        loops.sort(key=lambda pair: -np.prod(np.ptp(pair[0], axis=0)))
        return Zone(name, tuple(pair[0] for pair in loops), tuple(pair[1] for pair in loops))
