"""Gmsh models read as drawings: named surfaces are zones, named curves are joints, cracks and edges."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..curves import ended_on
from ..mesh_exchange import SUFFIXES as OTHER_MESHES
from ..mesh_exchange import as_gmsh_mesh
from ..parts import JOINT, Joint, Mark, Trace, Zone, is_mark
from ..traces.field_lines import METRES
from .mesh_files import drawing_of_mesh
from .model_curves import Curves
from .model_drawing import CRACK, GmshDrawing, GmshModelError, Parameter, scaled
from .parameters import open_with_parameters
from .script_commands import SCRIPTS, is_light, refuse_commands, trusted
from .session import gmsh_session
from .step_units import STEP, metres_in_step
from .unnamed_parts import lost_curves, out_of_plane

#: Curved edges become chords within this distance of the curve, relative to the model's largest side.
CHORD = 1e-4


def read_gmsh_model(
    path: str | Path,
    parameters: Mapping[str, float | str] | None = None,
    chord_tolerance: float | None = None,
    unit: str | None = None,
    folder: Path | None = None,
) -> GmshDrawing:
    """Read a model with ``parameters`` set: .geo, .geo_unrolled, .msh (any version, its mesh is not kept), .brep,
    .step, and meshes of other programs (`mesh_exchange.SUFFIXES`).

    A parameter is known by the last part of its name in the side panel ("Parameters/Cracks/phi_deg" is ``phi_deg``) or
    by its full name; if the model offers named choices the name may be given. Physical surfaces are zones, one block
    per surface; physical curves called "crack:NAME" are cracks; those called "joint:NAME" that bound no surface are
    joints; "bolt:NAME", "water" and "water:NAME" are lines that cut nothing, and physical points called "monitor:NAME"
    or "probe:NAME" monitor points; all other physical curves name the block edges on them. A .brep or .step without
    physical surfaces gives one zone per surface, and the names of its shapes are those of surfaces and curves. Curved
    edges become chords within ``chord_tolerance`` (m, default 1e-4 of the model's largest side), and ends of joints and
    cracks that are as near to a curve are moved onto its chords. ``unit`` (a key of
    `geomech.shapes.traces.field_lines.METRES`) is the model's unit of length, default m; for a .step, that in the file.

    A model may only draw; one that would run programs or write files is refused before Gmsh sees it, unless
    GEOMECH_TRUST_MODELS is set (`script_commands`). It may read files below ``folder`` (default: its own).

    Meshes and shapes, and scripts that read files, loop or make a mesh, are read in a separate process
    (`isolated_reader`): damaged ones can crash it, and a loop need not end.

    Raises GmshModelError for a missing or faulty file, unknown parameters and values out of range, models without named
    surfaces, and GmshUnavailable if Gmsh cannot be loaded.
    """
    path = Path(path)
    if not os.path.isfile(path):  # False also for a name that is too long
        near = [p.name for p in path.parent.glob("*" + path.suffix)] if path.parent.is_dir() else []
        close = difflib.get_close_matches(path.name, near, 1)
        raise GmshModelError(
            f"there is no file {path}",
            f"did you mean {close[0]}?" if close else "paths are relative to the scene file",
        )
    arguments: dict[str, Any] = {"parameters": dict(parameters or {}), "chord_tolerance": chord_tolerance, "unit": unit}
    files = [path] if trusted() else refuse_commands(path, folder)
    if all(file.suffix in (*SCRIPTS, ".opt") for file in files) and (trusted() or all(map(is_light, files))):
        return read_here(path, **arguments)
    from .isolated_reader import model_apart

    return model_apart(path, arguments)


def read_here(
    path: Path, parameters: Mapping[str, float | str], chord_tolerance: float | None, unit: str | None
) -> GmshDrawing:
    """`read_gmsh_model` without a check of the file, in this process: a damaged file may crash it."""
    metres = METRES[unit or "m"]
    if path.suffix.lower() in STEP:
        # All lengths of a STEP file arrive in millimetres, whatever its unit.
        metres = 1e-3 if unit is None else 1e-3 * metres / metres_in_step(path)
    try:
        with gmsh_session() as gmsh, TemporaryDirectory() as folder:
            opened = path if path.suffix.lower() not in OTHER_MESHES else as_gmsh_mesh(path, Path(folder))
            known = open_with_parameters(gmsh, opened, parameters)
            if opened.suffix == ".msh":
                found = drawing_of_mesh(gmsh, path)
            else:
                found = _drawing(gmsh, path, known, None if chord_tolerance is None else chord_tolerance / metres)
    except UnicodeDecodeError as error:
        raise _no_text(path, error) from error
    return found if metres == 1.0 else scaled(found, metres)


def _no_text(path: Path, error: UnicodeDecodeError) -> GmshModelError:
    """A name in the file is not UTF-8: its place, as far as the file's lines show it."""
    at = ""
    for number, line in enumerate(path.read_bytes().split(b"\n"), 1):
        try:
            line.decode("utf-8")
        except UnicodeDecodeError:
            at = f":{number}"
            if b'"' in line or b"'" in line:
                break
    byte = error.object[error.start]
    return GmshModelError(f"{path}{at}: a name with the byte 0x{byte:02x} is not UTF-8 text", "save the file as UTF-8")


def _drawing(gmsh, path: Path, parameters: dict[str, Parameter], chord: float | None) -> GmshDrawing:
    box = gmsh.model.getBoundingBox(-1, -1) if gmsh.model.getEntities(2) else (0.0,) * 6
    if not np.isfinite(box).all():
        raise GmshModelError(
            f"{path.name}: its surfaces have coordinates that are not finite", "draw it in metres, near the origin"
        )
    chord = CHORD * max(box[3] - box[0], box[4] - box[1]) if chord is None else chord
    curves = Curves(gmsh, chord)
    warnings: list[tuple[str, str]] = []
    if path.suffix in (".geo", ".geo_unrolled") and not path.read_bytes().endswith((b"\n", b"\r")):
        warnings.append(
            (f"{path.name}: its last line has no line end, so that Gmsh does not read it", "end it with a new line")
        )

    groups = _named_groups(gmsh, path, warnings)
    used = {abs(t) for _, _, tags in groups[2] for tag in tags for t in _outline(gmsh, tag)}
    edge_name: dict[int, str] = {}
    traced: set[int] = set()
    traces: list[Trace] = []
    joints: list[Joint] = []
    marks: list[Mark] = []
    places = {}
    for name, _, tags in groups[0]:
        places["marks", len(marks)] = _entities("point", tags)
        marks.append(Mark(name, tuple(np.array([gmsh.model.getValue(0, tag, [])[:2]]) for tag in tags)))
    for name, _, tags in groups[1]:
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
        inner = [tag for tag in tags if tag not in used]
        if name.startswith(JOINT) and inner:
            places["joints", len(joints)] = _entities("curve", inner)
            joints.append(Joint(name, tuple(curves.chained(inner))))
            traced.update(inner)
            tags = [tag for tag in tags if tag in used]
        _name_edges(path, name, tags, edge_name)

    zones: list[Zone] = []
    named = set()
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
    reported = _bound_nothing(path, edge_name, used, warnings)
    warnings += lost_curves(gmsh, path, curves, zones, used | traced | reported)
    warnings += out_of_plane(gmsh, path, max(box[3] - box[0], box[4] - box[1]))
    chords = curves.chords()
    return GmshDrawing(
        tuple(zones),
        tuple(ended_on(traces, chords)),
        parameters,
        tuple(warnings),
        tuple(ended_on(joints, chords)),
        places,
        tuple(marks),
        chords,
    )


def _name_edges(path: Path, name: str, tags: list[int], edge_name: dict[int, str]) -> None:
    """Assign ``name`` to the curves ``tags``; each curve has one name."""
    for tag in tags:
        if edge_name.setdefault(tag, name) != name:
            raise GmshModelError(
                f"{path.name}: curve {tag} is called both {edge_name[tag]!r} and {name!r}",
                "give each edge one physical name",
            )


def _bound_nothing(path: Path, edge_name: dict[int, str], used: set[int], warnings: list[tuple[str, str]]) -> set[int]:
    """A warning for each name of curves none of which is ``used`` by a surface."""
    reported: set[int] = set()
    for name in dict.fromkeys(edge_name.values()):
        tags = {tag for tag, its in edge_name.items() if its == name}
        if not used & tags:
            reported |= tags
            warnings.append(
                (f"{path.name}: physical curve {name!r} bounds no named surface", f'a crack is called "{CRACK}{name}"')
            )
    return reported


def _named_groups(gmsh, path: Path, warnings: list[tuple[str, str]]) -> dict[int, list[tuple[str, int, list[int]]]]:
    """(name, physical tag, entities) of all physical points (0), curves (1) and surfaces (2).

    A file of shapes has no physical groups: there every surface counts, and shapes have their names in the file. Points
    without a name only define an element size or a position.
    """
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
