"""Files with mapped traces, [[geometry.traces]], as parts of the drawing."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path as FilePath
from typing import Any

from ...shapes.assembly import TOLERANCE
from ...shapes.parts import extent_of
from ...shapes.traces.field_lines import (
    UNFINISHED,
    FieldDrawing,
    FieldFile,
    FieldFileError,
    Named,
    drawing_of_lines,
    named_lines,
)
from ...shapes.traces.simplification import simplified
from ...shapes.traces.trace_tables import read_field_file
from ..errors import Fault
from ..locator import Path
from ..tables.geometry import Geometry, TraceFile
from ..validation import nearest


def read_traces(
    geometry: Geometry,
    folder: FilePath,
    add: Callable,
    place: Callable[[Path], str],
    faults: list[Fault],
    warnings: list[Fault],
) -> tuple[bool, dict[str, Any] | None]:
    """Pass the content of all files to ``add``; returns False if one cannot be read, which is reported.

    ``add`` takes a `FieldDrawing`, a function from (part, index) to its path in the scene and its place in the file,
    and the names of zones that its joints cut. Also returns the coordinate reference system of the first file that has
    one, as in GeoJSON.
    """
    every: list[Named] = []
    by_file: dict[int, list[Named]] = {}
    path_of: dict[str, Path] = {}
    systems: dict[str, Any] = {}
    valid = True
    for k, entry in enumerate(geometry.traces):
        source: Path = ("geometry", "traces", k, "file")
        try:
            file = _read(
                folder / entry.file, entry.unit or geometry.unit, geometry.chord_tolerance_m, entry.set_property
            )
        except FieldFileError as error:
            faults.append(Fault(place(source), error.message, error.way_out))
            valid = False
            continue
        warnings += [Fault(place(source), message, way_out) for message, way_out in file.warnings]
        if file.crs is not None:
            systems[entry.file] = file.crs
            first = next(iter(systems))
            if file.crs != systems[first]:
                warnings.append(
                    Fault(
                        place(source),
                        f"{entry.file} has another coordinate reference system than {first}",
                        "export both in the same one: coordinates are not converted",
                    )
                )
        named = _named_lines(file, k, entry, place, faults, warnings)
        if entry.simplify_m is not None:
            named, removed = _simplified(named, entry.simplify_m, geometry.tolerance_m)
            warnings.append(Fault(place(source), f"{FilePath(entry.file).name}: {removed}", ""))
        every += named
        by_file[k] = [item for item in named if item.role == "joint"]
        path_of.update((item.line.place, source) for item in named)
    crs = next(iter(systems.values()), None)
    if not valid:
        return False, crs
    try:
        # Joints by file, because each may cut its own zones; outlines of all files together, because they may close one
        # another.
        joints = {k: drawing_of_lines(own) for k, own in by_file.items()}
        drawn = drawing_of_lines([item for item in every if item.role != "joint"])
    except FieldFileError as error:
        at = next(
            (path for text, path in path_of.items() if error.message.startswith(f"{text}:")), ("geometry", "traces")
        )
        faults.append(Fault(place(at), error.message, error.way_out))
        return False, crs

    for part, zones in ((drawn, ()), *((own, geometry.traces[k].zones) for k, own in joints.items())):
        for message, way_out in part.warnings:
            at = next(
                (path for text, path in path_of.items() if message.startswith(f"{text}:")), ("geometry", "traces")
            )
            warnings.append(Fault(place(at), message, way_out))
        add(part, partial(_source, part, path_of), zones)
    return True, crs


def _simplified(named: list[Named], tolerance: float, meets: float | None) -> tuple[list[Named], str]:
    """``named`` with joints and cracks simplified, and a report."""
    at = [
        k
        for k, item in enumerate(named)
        if item.role in ("joint", "crack") and item.line.shape == "line" and len(item.line.points) > 1
    ]
    lines = [named[k].line.points for k in at]
    if meets is None:
        meets = TOLERANCE * extent_of(lines) if lines else 0.0
    found, out = simplified(lines, tolerance, meets), list(named)
    for k, points in zip(at, found.lines):
        out[k] = named[k]._replace(line=replace(named[k].line, points=points, away=None))
    report = f"{found.before} sides of its joints and cracks are reduced to {found.after}, with deviations up to {found.off:.3g} m (simplify_m)"
    return out, report


def _named_lines(
    file: FieldFile,
    k: int,
    entry: TraceFile,
    place: Callable[[Path], str],
    faults: list[Fault],
    warnings: list[Fault],
) -> list[Named]:
    """Lines of ``file``, entry number ``k`` of the scene, with their kinds.

    Errors in its layers are added to ``faults``, lines that are left out to ``warnings``.
    """
    named, idle, left = named_lines(file, entry.layers, entry.name, entry.kind)
    present = list(dict.fromkeys(line.layer for line in file.lines))
    for pattern, meaning in entry.layers.items():
        if meaning.strip().lower() in UNFINISHED:
            faults.append(
                Fault(
                    place(("geometry", "traces", k, "layers", pattern)),
                    f"{meaning!r} needs a name after it",
                    f'write "{meaning}:{"x" if meaning == "guided" else "NAME"}", or "" to use the name of the layer',
                )
            )
    for pattern in idle:
        faults.append(
            Fault(
                place(("geometry", "traces", k, "layers", pattern)),
                f"{FilePath(entry.file).name} has no layer {pattern!r}, or an earlier entry matches them all",
                nearest(pattern, present),
            )
        )
    if not named:
        what = f"its layers are {', '.join(map(repr, left))}" if left else "it is empty"
        warnings.append(
            Fault(
                place(("geometry", "traces", k, "file")),
                f"{FilePath(entry.file).name} gives no lines: {what}",
                "name them in `layers`",
            )
        )
    return named


def _read(path: FilePath, unit: str | None, chord_tolerance: float | None, set_property: str) -> FieldFile:
    """The file; formats of CAD programs are read in a separate process."""
    arguments: dict[str, Any] = {"unit": unit, "chord_tolerance": chord_tolerance, "set_property": set_property}
    if path.suffix.lower() == ".dxf" and os.path.isfile(path):
        from ...shapes.gmsh_models.isolated_reader import field_file_apart

        return field_file_apart(path, arguments)
    return read_field_file(path, **arguments)


def _source(drawn: FieldDrawing, path_of: dict[str, Path], part: str, index: int) -> tuple[Path, str]:
    text = drawn.places.get((part, index), "")
    return path_of.get(text, ("geometry", "traces")), text
