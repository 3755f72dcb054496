"""DXF drawings as lines by layer: curves become chords, blocks are exploded, hidden layers are left out."""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

import numpy as np

from .field_lines import METRES, FieldFile, FieldFileError, FieldLine

#: Largest distance of chords from curves, relative to the drawing's largest side, if no tolerance is given.
CHORD = 1e-4
#: Values of $INSUNITS (DXF reference, "Drawing units"), m; 0 is "unitless".
_INSUNITS = {
    1: 0.0254, 2: 0.3048, 3: 1609.344, 4: 1e-3, 5: 1e-2, 6: 1.0, 7: 1e3, 8: 2.54e-8, 9: 2.54e-5, 10: 0.9144, 13: 1e-6,
    14: 0.1, 15: 10.0, 16: 100.0, 21: 1200 / 3937,
}  # fmt: skip
#: A closed curve has at least four chords, an arc of a third of a turn two.
_LEAST_TURN = math.pi / 2
#: Points of an entity, whether it is closed, and which pieces after a point approximate a curve (one value for all).
_Sampled = tuple[Any, bool, "bool | list[bool]"]
#: Exceptions of ezdxf for an invalid entity (DXFError is a plain Exception).
_DAMAGED = (AttributeError, LookupError, TypeError, ValueError, ArithmeticError, StopIteration, RecursionError)
_AGAIN = "delete or redraw it, or export the drawing again"
#: References nested deeper than this are circular.
_DEEPEST = 32


def read_dxf(path: Path, unit: str | None = None, chord_tolerance: float | None = None) -> FieldFile:
    """The lines of the model space of a DXF file, in m: LINE, LWPOLYLINE and POLYLINE with bulges, ARC, CIRCLE,
    ELLIPSE, SPLINE, POINT and those inserted by INSERT.

    ``unit`` (a key of `METRES`) overrides the file's $INSUNITS; ``chord_tolerance`` in m, default `CHORD` of the
    largest side. Layers that are off or frozen and other kinds of entities are left out and reported. Parts of a block
    on layer 0 are on the layer of its INSERT. Raises FieldFileError for a file that cannot be read, or if ezdxf is not
    installed.
    """
    try:
        import ezdxf
        from ezdxf import bbox, recover
    except ImportError as error:
        raise FieldFileError(
            f"{path.name}: DXF files are read by ezdxf, which is not installed ({error})", "`pip install ezdxf`"
        ) from error
    warnings: list[tuple[str, str]] = []
    try:
        try:
            document = ezdxf.readfile(path)
        except (ezdxf.DXFStructureError, *_DAMAGED) as error:
            # Some programs write files that violate the format; what can be recovered is read.
            with _Recoveries() as recoveries:
                document, _ = recover.readfile(path)
            warnings.append(recoveries.recovery_warnings(path, error))
    except (ezdxf.DXFError, OSError, *_DAMAGED) as error:
        raise FieldFileError(
            f"{path.name} cannot be read as DXF: {error or type(error).__name__}",
            "save it as DXF again (R2000 or later)",
        ) from error
    factor = _factor(document, path, unit, warnings)
    reader = _Reader(document, path)
    try:
        entities = list(reader.entities())
        box = bbox.extents((entity for _, entity in entities), fast=True)
    except _DAMAGED as error:
        raise FieldFileError(f"{path.name}: {reader.at}: {_error_text(error)}", _AGAIN) from error
    size = max(box.size.x, box.size.y) if box.has_data else 1.0
    chord = CHORD * size if chord_tolerance is None else chord_tolerance / factor
    lines, heights = [], []
    for layer, entity in entities:
        points, closed, bent = reader.points(entity, chord)
        if not len(points):
            reader.left[entity.dxftype() + " without points"] += 1
            continue
        heights.append(float(np.abs(points[:, 2]).max()))
        if len(points) > 1:
            apart = (np.diff(points[:, :2], axis=0) != 0).any(axis=1)
            # Of coinciding points the first stays, and the piece after the last.
            points, bent = points[np.append(True, apart)], bent[np.append(apart, True)]
        if closed and len(points) > 1 and np.hypot(*(points[0] - points[-1])[:2]) <= 1e-12 * size:
            points, bent = points[:-1], bent[:-1]
        if len(points) < 2 and entity.dxftype() != "POINT":
            reader.left[entity.dxftype() + " without length"] += 1
            continue
        place = f"{path.name}: layer {layer!r}, {entity.dxftype()}"
        place += f" #{entity.dxf.handle}" if entity.dxf.handle else " of a block"
        shape = "closed" if closed and len(points) > 2 else "line"
        away = np.where(bent, factor * chord, 0.0) if bent.any() else None
        lines.append(FieldLine(layer, factor * points[:, :2], place, shape, away=away))
    if heights and max(heights) > 1e-9 * size:
        warnings.append(
            (
                (
                    f"{path.name}: {sum(h > 1e-9 * size for h in heights)} entities have z ≠ 0 (up to "
                    f"{max(heights) * factor:g} m)"
                ),
                "the model is plane and z is ignored: draw the section in x and y",
            )
        )
    return FieldFile(tuple(lines), tuple(warnings + reader.recovery_warnings()))


def _factor(document: Any, path: Path, unit: str | None, warnings: list[tuple[str, str]]) -> float:
    """Metres in a unit of the drawing."""
    if unit is not None:
        return METRES[unit]
    code = int(document.header.get("$INSUNITS", 0))
    if code in _INSUNITS:
        return _INSUNITS[code]
    unit_text = "names no unit ($INSUNITS is 0)" if code == 0 else f"is in an unsuitable unit ($INSUNITS {code})"
    warnings.append((f"{path.name} {unit_text}: taken for metres", 'give its unit: unit = "m", "mm", …'))
    return 1.0


class _Recoveries(logging.Handler):
    """Context that collects ezdxf's log of its repairs of an invalid file."""

    def __enter__(self) -> Self:
        self.found: list[str] = []
        self._log = logging.getLogger("ezdxf")
        self._propagates, self._log.propagate = self._log.propagate, False
        self._log.addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        self._log.removeHandler(self)
        self._log.propagate = self._propagates

    def emit(self, record: logging.LogRecord) -> None:
        self.found.append(record.getMessage())

    def recovery_warnings(self, path: Path, error: Exception) -> tuple[str, str]:
        made = f"; {len(self.found)} guesses were made, the first: {self.found[0]}" if self.found else ""
        return (
            f"{path.name} is not a valid DXF file ({error or type(error).__name__}): the recoverable part is read{made}",
            "compare the picture of `geomech build` with the drawing, or save it as DXF again",
        )


class _Reader:
    """Visible entities of a document's model space, and those left out."""

    def __init__(self, document: Any, path: Path) -> None:
        self.document, self.path = document, path
        self.at = "its entities"  # the entity being read
        self.hidden: Counter[str] = Counter()
        self.left: Counter[str] = Counter()

    def entities(self) -> Iterator[tuple[str, Any]]:
        """(layer, entity) of all curves and points, with INSERTs exploded."""
        yield from self._of(self.document.modelspace(), "0", 0)

    def _of(self, entities: Any, host: str, depth: int) -> Iterator[tuple[str, Any]]:
        for entity in entities:
            self.at = _named(entity)
            layer = entity.dxf.get("layer", "0")
            # Layer 0 inside a block stands for the layer of the INSERT.
            layer = host if layer == "0" and depth else layer
            if self._is_hidden(layer) or entity.dxf.get("invisible", 0):
                self.hidden[layer] += 1
            elif entity.dxftype() == "INSERT":
                if depth >= _DEEPEST:
                    raise FieldFileError(
                        f"{self.path.name}: block {entity.dxf.name!r} contains itself",
                        "remove the circle of references",
                    )
                parts = [entity] if not entity.mcount > 1 else entity.multi_insert()
                for part in parts:
                    inner = part.virtual_entities(skipped_entity_callback=self._skipped)
                    yield from self._of(inner, layer, depth + 1)
            elif entity.dxftype() in _POINTS and not (entity.dxftype() == "POLYLINE" and not _is_line(entity)):
                yield layer, entity
            else:
                self.left[entity.dxftype()] += 1

    def _is_hidden(self, name: str) -> bool:
        if name not in self.document.layers:
            return False
        layer = self.document.layers.get(name)
        return layer.is_off() or layer.is_frozen()

    def _skipped(self, entity: Any, reason: str) -> None:
        self.left[f"{entity.dxftype()} in a block ({reason})"] += 1

    def points(self, entity: Any, chord: float) -> tuple[np.ndarray, bool, np.ndarray]:
        """(n, 3) points of an entity in the file's unit; whether it is closed; (n,) True if the piece after a point
        approximates a curve."""
        try:
            points, closed, bent = _POINTS[entity.dxftype()](entity, chord)
        except _DAMAGED as error:
            raise FieldFileError(f"{self.path.name}: {_named(entity)}: {_error_text(error)}", _AGAIN) from error
        points = np.array([tuple(point)[:3] for point in points], dtype=float).reshape(-1, 3)
        if not np.isfinite(points).all():
            raise FieldFileError(
                f"{self.path.name}: {entity.dxftype()} #{entity.dxf.handle} has a coordinate that is not a finite number",
                "delete or redraw it",
            )
        return points, closed, np.broadcast_to(np.asarray(bent, dtype=bool), len(points))

    def recovery_warnings(self) -> list[tuple[str, str]]:
        warnings = []
        if self.hidden:
            listed = ", ".join(f"{name!r} ({number})" for name, number in sorted(self.hidden.items()))
            warnings.append(
                (f"{self.path.name}: hidden layers are left out: {listed}", "turn them on and thaw them in the drawing")
            )
        if self.left:
            listed = ", ".join(f"{number} {kind}" for kind, number in sorted(self.left.items()))
            warnings.append(
                (f"{self.path.name}: no traces, left out: {listed}", "explode what should be lines in the drawing")
            )
        return warnings


def _named(entity: Any) -> str:
    handle = entity.dxf.get("handle") if entity.is_alive else None
    return f"{entity.dxftype()} #{handle}" if handle else f"{entity.dxftype()} of a block"


def _error_text(error: Exception) -> str:
    return f"data of it are missing or damaged ({error})"


def _is_line(polyline: Any) -> bool:
    return polyline.is_2d_polyline or polyline.is_3d_polyline


def _line(entity: Any, chord: float) -> _Sampled:
    return [entity.dxf.start, entity.dxf.end], False, False


def _arc(entity: Any, chord: float) -> _Sampled:
    radius, extrusion = abs(entity.dxf.radius), entity.ocs()
    first = math.radians(entity.dxf.start_angle)
    turn = math.radians((entity.dxf.end_angle - entity.dxf.start_angle) % 360.0) or 2 * math.pi
    centre = entity.dxf.center
    return extrusion.points_to_wcs(_turned(centre.x, centre.y, centre.z, radius, first, turn, chord)), False, True


def _circle(entity: Any, chord: float) -> _Sampled:
    centre = entity.dxf.center
    points = _turned(centre.x, centre.y, centre.z, abs(entity.dxf.radius), 0.0, 2 * math.pi, chord)
    return entity.ocs().points_to_wcs(points[:-1]), True, True


def _turned(
    x: float, y: float, z: float, radius: float, first: float, turn: float, chord: float
) -> list[tuple[float, float, float]]:
    angles = first + np.linspace(0.0, turn, _pieces(radius, turn, chord) + 1)
    return [(x + radius * math.cos(a), y + radius * math.sin(a), z) for a in angles]


def _pieces(radius: float, turn: float, chord: float) -> int:
    """Number of chords of an arc: a chord over the angle a deviates by r (1 - cos a/2)."""
    each = 2 * math.acos(1 - chord / radius) if chord < radius else math.pi
    return max(1, math.ceil(abs(turn) / min(each, _LEAST_TURN) - 1e-9))


def _lwpolyline(entity: Any, chord: float) -> _Sampled:
    rows = list(entity.get_points("xyb"))
    points, bent = _bulged(rows, entity.closed, chord)
    height = entity.dxf.elevation
    return entity.ocs().points_to_wcs([(x, y, height) for x, y in points]), entity.closed, bent


def _polyline(entity: Any, chord: float) -> _Sampled:
    closed = entity.is_closed
    if entity.is_3d_polyline:
        return list(entity.points()), closed, False
    # Control points of a fitted curve are not part of it.
    vertices = [v for v in entity.vertices if not v.dxf.flags & 16]
    rows = [(v.dxf.location.x, v.dxf.location.y, v.dxf.bulge) for v in vertices]
    height = vertices[0].dxf.location.z if vertices else 0.0
    points, bent = _bulged(rows, closed, chord)
    return entity.ocs().points_to_wcs([(x, y, height) for x, y in points]), closed, bent


def _bulged(
    rows: list[tuple[float, float, float]], closed: bool, chord: float
) -> tuple[list[tuple[float, float]], list[bool]]:
    """Vertices with the points of arcs between them, and which pieces are arcs.

    A bulge is the tangent of a quarter of the arc's angle, positive for arcs that turn counter-clockwise.
    """
    points: list[tuple[float, float]] = []
    bent: list[bool] = []
    for k, (x, y, bulge) in enumerate(rows):
        points.append((x, y))
        bent.append(False)
        if not bulge or (k + 1 == len(rows) and not closed):
            continue
        x1, y1, _ = rows[(k + 1) % len(rows)]
        dx, dy = x1 - x, y1 - y
        length = math.hypot(dx, dy)
        if length == 0.0:
            continue
        radius, turn = 0.25 * length * (1 / bulge + bulge), 4 * math.atan(bulge)
        # The centre is left of the chord for an arc of less than half a turn counter-clockwise.
        off = radius - 0.5 * length * bulge
        cx, cy = x + 0.5 * dx - off * dy / length, y + 0.5 * dy + off * dx / length
        first = math.atan2(y - cy, x - cx)
        n = _pieces(abs(radius), turn, chord)
        for angle in first + turn * np.arange(1, n) / n:
            points.append((cx + abs(radius) * math.cos(angle), cy + abs(radius) * math.sin(angle)))
        bent[-1:] = [True] * n
    return points, bent


def _ellipse(entity: Any, chord: float) -> _Sampled:
    points = list(entity.flattening(chord, segments=8))
    return points, len(points) > 2 and points[0].isclose(points[-1]), True


def _spline(entity: Any, chord: float) -> _Sampled:
    points = list(entity.flattening(chord, segments=4))
    return points, len(points) > 2 and points[0].isclose(points[-1]), True


def _point(entity: Any, chord: float) -> _Sampled:
    return [entity.dxf.location], False, False


_POINTS = {
    "LINE": _line,
    "ARC": _arc,
    "CIRCLE": _circle,
    "LWPOLYLINE": _lwpolyline,
    "POLYLINE": _polyline,
    "ELLIPSE": _ellipse,
    "SPLINE": _spline,
    "POINT": _point,
}
