"""Mapped traces from text files: CSV tables and GeoJSON. DXF is in `dxf`."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .field_lines import METRES, FieldFile, FieldFileError, FieldLine

#: Alternative names of the columns of a table.
_COLUMNS = {"layer": "set", "joint_set": "set", "trace": "id", "trace_id": "id", "fid": "id"}
_COMMENT = re.compile(r"(^|\s)#.*")
_ENDS, _VERTICES = ("x1", "y1", "x2", "y2"), ("x", "y")
#: Coordinate systems of GeoJSON in degrees.
_DEGREES = ("CRS84", "EPSG::4326", "EPSG:4326")


def read_field_file(
    path: str | Path, unit: str | None = None, chord_tolerance: float | None = None, set_property: str = "set"
) -> FieldFile:
    """The lines of a .csv (.txt, .tsv), .geojson (.json) or .dxf file, in m.

    ``unit`` is the file's unit, a key of `METRES` (default: that in a DXF file, else metres); ``chord_tolerance`` (m)
    is the largest distance of chords from curves of a DXF file; ``set_property`` is the property of GeoJSON features
    that names their set. Raises FieldFileError with file and line (or feature, entity) for content that cannot be read.
    """
    path = Path(path)
    if not os.path.isfile(path):  # False also for a name that is too long
        raise FieldFileError(f"there is no file {path}", "paths are relative to the scene file")
    kind = path.suffix.lower()
    if kind == ".dxf":
        from .dxf import read_dxf

        return read_dxf(path, unit, chord_tolerance)
    if kind in (".geojson", ".json"):
        found = _read_geojson(path, set_property)
    elif kind in (".csv", ".txt", ".tsv"):
        found = _read_csv(path)
    elif kind == ".dwg":
        raise FieldFileError(f"{path.name}: DWG files cannot be read", "save the drawing as DXF")
    else:
        raise FieldFileError(f"{path.name} is not a .dxf, .csv or .geojson file", "save the traces as one of these")
    factor = METRES[unit or "m"]
    if factor == 1.0:
        return found
    lines = [FieldLine(s.layer, factor * s.points, s.place, s.shape, s.label) for s in found.lines]
    return FieldFile(tuple(lines), found.warnings)


def _text(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FieldFileError(f"{path.name}: the file is not UTF-8 text ({error})", "save it as UTF-8") from error


def _read_csv(path: Path) -> FieldFile:
    """A table whose first row names its columns: x1, y1, x2, y2 (one trace per row), or id, x, y (one vertex per row,
    in order); optionally with a column "set".

    Other columns are ignored. Columns are separated by a tab, ";" or ","; with the first two, numbers may have decimal
    commas. "#" at the beginning or after a blank starts a comment.
    """
    rows = [(k, _COMMENT.sub("", row).strip(" \r")) for k, row in enumerate(_text(path).splitlines(), 1)]
    rows = [(k, row) for k, row in rows if row.strip()]
    if not rows:
        raise FieldFileError(f"{path.name} has no rows", "name the columns first: set,x1,y1,x2,y2 or id,x,y")
    first, header = rows[0]
    mark = next((m for m in ("\t", ";", ",") if m in header), ",")
    names = [name.strip().strip('"').lower() for name in header.split(mark)]
    names = [_COLUMNS.get(name, name) for name in names]
    if set(_ENDS) <= set(names):
        wanted: tuple[str, ...] = _ENDS
    elif set(_VERTICES) <= set(names) and "id" in names:
        wanted = _VERTICES
    else:
        raise FieldFileError(
            f"{path.name}:{first}: the columns are {', '.join(names)}",
            "the first row names them: x1, y1, x2, y2, or id, x, y, and optionally set",
        )
    twice = next((name for name in (*wanted, "set", "id") if names.count(name) > 1), None)
    if twice:
        raise FieldFileError(f"{path.name}:{first}: there are two columns {twice!r}", "remove one of them")
    column = [names.index(name) for name in wanted]
    set_at, id_at = (names.index(name) if name in names else None for name in ("set", "id"))
    values = np.empty((len(rows) - 1, len(column)))
    sets, ids = [], []
    for row, (line, text) in enumerate(rows[1:]):
        cells = [cell.strip().strip('"') for cell in text.split(mark)]
        if len(cells) != len(names):
            raise FieldFileError(
                f"{path.name}:{line}: {len(cells)} values under {len(names)} columns",
                f"each row has {', '.join(names)}",
            )
        try:
            values[row] = [float(cells[at]) for at in column]
        except ValueError:
            for k, at in enumerate(column):
                values[row, k] = _number(cells[at], mark, f"{path.name}:{line}: {wanted[k]}")
        sets.append((cells[set_at] if set_at is not None else "") or path.stem)
        ids.append(cells[id_at] if id_at is not None else "")
    numbers = [line for line, _ in rows[1:]]
    wrong = np.argwhere(~np.isfinite(values))
    if len(wrong):
        row, k = wrong[0]
        raise FieldFileError(f"{path.name}:{numbers[row]}: {wanted[k]} is {values[row, k]}", "give a finite number")
    return FieldFile(
        tuple((_traces_from_ends if wanted is _ENDS else _traces_from_vertices)(path, numbers, sets, ids, values))
    )


def _number(text: str, mark: str, what: str) -> float:
    try:
        return float(text.replace(",", ".") if mark != "," and text.count(",") == 1 else text)
    except ValueError:
        raise FieldFileError(f"{what} is {text!r}, not a number", "write metres, with a decimal point") from None


def _traces_from_ends(
    path: Path, numbers: Sequence[int], sets: Sequence[str], ids: Sequence[str], values: np.ndarray
) -> list[FieldLine]:
    """One trace per row; one with equal ends is a point."""
    same = (values[:, :2] == values[:, 2:]).all(axis=1).tolist()
    return [
        FieldLine(layer, points[:1] if one else points, f"{path.name}:{number}", label=label)
        for number, layer, label, points, one in zip(numbers, sets, ids, values.reshape(-1, 2, 2), same)
    ]


def _traces_from_vertices(
    path: Path, numbers: Sequence[int], sets: Sequence[str], ids: Sequence[str], values: np.ndarray
) -> list[FieldLine]:
    """One trace per id, its vertices in the order of the rows; it is closed if the last vertex is the first."""
    members: dict[str, list[int]] = {}
    for row, name in enumerate(ids):
        members.setdefault(name, []).append(row)
    lines = []
    for name, rows in members.items():
        other = next((row for row in rows if sets[row] != sets[rows[0]]), None)
        if other is not None:
            raise FieldFileError(
                f"{path.name}:{numbers[other]}: trace {name!r} is in set {sets[other]!r} and, at line "
                f"{numbers[rows[0]]}, in set {sets[rows[0]]!r}",
                "give each trace one set, and an id of its own",
            )
        points, shape = values[rows], "line"
        if len(points) > 3 and (points[0] == points[-1]).all():
            points, shape = points[:-1], "closed"
        lines.append(FieldLine(sets[rows[0]], points, f"{path.name}:{numbers[rows[0]]}", shape, name))
    return lines


def _read_geojson(path: Path, set_property: str) -> FieldFile:
    """Features with lines, polygons and points (RFC 7946); coordinates are in metres."""
    try:
        data = json.loads(_text(path))
    except json.JSONDecodeError as error:
        raise FieldFileError(f"{path.name}:{error.lineno}: not valid JSON: {error.msg}", "export it again") from error
    except RecursionError:
        raise FieldFileError(f"{path.name}: its arrays are nested too deep", "export it again") from None
    kind = data.get("type") if isinstance(data, dict) else None
    features = {"FeatureCollection": lambda: data.get("features"), "Feature": lambda: [data]}.get(str(kind))
    if features is None:
        raise FieldFileError(
            f"{path.name} is not a GeoJSON feature collection", 'its "type" must be "FeatureCollection"'
        )
    about_crs = data["crs"].get("properties") if isinstance(data.get("crs"), dict) else None
    crs = str(about_crs.get("name", "")) if isinstance(about_crs, dict) else ""
    if any(name in crs for name in _DEGREES):
        raise FieldFileError(
            f"{path.name}: its coordinates are degrees ({crs})", "export it in metres of the section, or of a UTM zone"
        )
    lines: list[FieldLine] = []
    left: dict[str, int] = {}
    if not isinstance(features() or [], list):
        raise FieldFileError(f'{path.name}: its "features" are not an array', "export it again")
    for k, feature in enumerate(features() or []):
        place = f"{path.name}: feature {k + 1}"
        if not isinstance(feature, dict) or not isinstance(feature.get("properties") or {}, dict):
            raise FieldFileError(f"{place} is not a GeoJSON feature", "export it again")
        about = feature.get("properties") or {}
        layer = str(about.get(set_property) or about.get("layer") or about.get("Layer") or path.stem)
        label = str(about.get("name") or "")
        try:
            _of_geometry(feature.get("geometry") or {}, layer, label, place, lines, left)
        except (TypeError, ValueError, LookupError, AttributeError, RecursionError, OverflowError) as error:
            raise FieldFileError(f"{place}: its coordinates cannot be read ({error})", "export it again") from error
    warnings = [
        (f"{path.name}: {number} × {kind or 'no geometry'}, left out", "traces are lines, zones polygons")
        for kind, number in left.items()
    ]
    return FieldFile(tuple(lines), tuple(warnings), data.get("crs"))


def _of_geometry(
    shape: dict[str, Any], layer: str, label: str, place: str, lines: list[FieldLine], left: dict[str, int]
) -> None:
    kind: str = shape.get("type") or ""
    given: Any = shape.get("coordinates")
    if kind == "GeometryCollection":
        for part in shape["geometries"]:
            _of_geometry(part, layer, label, place, lines, left)
    elif kind in ("LineString", "Point"):
        lines.append(FieldLine(layer, _points(given if kind == "LineString" else [given]), place, label=label))
    elif kind in ("MultiLineString", "MultiPoint", "MultiPolygon"):
        for part in given:
            _of_geometry({"type": kind.removeprefix("Multi"), "coordinates": part}, layer, label, place, lines, left)
    elif kind == "Polygon":
        for k, ring in enumerate(given):
            lines.append(FieldLine(layer, _points(ring)[:-1], place, "hole" if k else "area", label))
    else:
        left[kind] = left.get(kind, 0) + 1


def _points(given: Any) -> np.ndarray:
    points = np.array([pair[:2] for pair in given], dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ValueError("pairs of numbers are required")
    return points
