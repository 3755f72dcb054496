"""Bolts, water tables and monitor points of the drawing, entered into the scene's tables with their properties."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...shapes.parts import Mark, extent_of
from ..drawing import Drawing
from ..errors import Fault
from ..locator import Path
from ..tables import SceneTables
from ..tables.loads import BoltTable, ForceTable, WaterTableTable
from ..tables.output import MonitorTable
from ..validation import nearest

#: A bolt must be straight to this part of its length; others are reported.
_STRAIGHT = 1e-3
#: Pieces of one bolt, and of a water table, are joined if their distance is below this part of the drawing's largest
#: side.
_MEETING = 1e-6

Place = Callable[[Path], str]


def with_marks(
    tables: SceneTables, drawing: Drawing, place: Place, faults: list[Fault], warnings: list[Fault]
) -> tuple[SceneTables, Place]:
    """``tables`` with every bolt, the water table and every monitor of the drawing, and ``place`` for the added
    entries.

    Tables that refer to nothing drawn are faults; drawn marks without a table cause warnings.
    """
    marks = {mark.name: mark for mark in drawing.marks}
    work = _Matching(marks, drawing, place, faults, warnings)
    came_from: dict[Path, Path] = {}
    changes: dict[str, Any] = {}
    if tables.loads is not None:
        bolts = work.bolts(tables.loads.bolts, came_from)
        water = work.water(tables.loads.water)
        forces = work.forces(tables.loads.forces, came_from)
        changes["loads"] = tables.loads.model_copy(update={"bolts": bolts, "water": water, "forces": forces})
    if tables.monitors is not None:
        changes["monitors"] = work.monitors(tables.monitors, came_from)
    work.warn_of_idle(tables)

    def placed(path: Path) -> str:
        # Longest first: an end of a drawn bolt has the place of its line.
        for n in range(len(path), 0, -1):
            if path[:n] in came_from:
                origin = came_from[path[:n]]
                return place(origin if origin[-1] == "lines" or origin[0] == "geometry" else origin + path[n:])
        return place(path)

    return tables.model_copy(update=changes), placed if came_from else place


class _Matching:
    """Marks by name, and the tables that have claimed them."""

    def __init__(
        self, marks: dict[str, Mark], drawing: Drawing, place: Place, faults: list[Fault], warnings: list[Fault]
    ) -> None:
        self.marks, self.drawing, self.place = marks, drawing, place
        self.faults, self.warnings = faults, warnings
        self.claimed: dict[str, int] = {}
        points = [line for mark in marks.values() for line in mark.lines]
        self.near = _MEETING * extent_of(points + ([] if drawing.blocks is None else [drawing.blocks.vertices]))

    def _of(self, kind: str) -> list[str]:
        return [name for name in self.marks if name.partition(":")[0] == kind]

    def _missing(self, path: Path, message: str, kind: str, name: str, hint: str) -> None:
        known = self._of(kind)
        self.faults.append(Fault(self.place(path), message, nearest(name, known) if known else hint))

    def _warn(self, name: str, message: str, way_out: str) -> None:
        path, at = self.drawing.mark_places[name]
        self.warnings.append(Fault(self.place(path), f"{at}: {message}", way_out))

    def bolts(self, tables: Sequence[BoltTable], came_from: dict[Path, Path]) -> tuple[BoltTable, ...]:
        found: list[BoltTable] = []
        for k, table in enumerate(tables):
            if not table.lines:
                came_from["loads", "bolts", len(found)] = ("loads", "bolts", k)
                found.append(table)
                continue
            for n, pattern in enumerate(table.lines):
                path: Path = ("loads", "bolts", k, "lines", n)
                names = [name for name in self._of("bolt") if fnmatch.fnmatchcase(name, pattern)]
                if not names:
                    self._missing(
                        path, f"no drawn line is called {pattern!r}", "bolt", pattern,
                        'the drawing has no bolts: lines called "bolt:NAME"',
                    )  # fmt: skip
                for name in names:
                    first = self.claimed.setdefault(name, k)
                    if first != k:
                        self.faults.append(
                            Fault(
                                self.place(path), f"bolts {name!r} have two tables", "name them in only one of the two"
                            )
                        )
                        continue
                    ends = self._straight(self.marks[name])
                    own = name.partition(":")[2] or table.name
                    for m, (start, end) in enumerate(ends, 1):
                        came_from["loads", "bolts", len(found)] = ("loads", "bolts", k, "lines")
                        called = own if len(ends) == 1 else f"{own} {m}"
                        found.append(
                            table.model_copy(update={"lines": (name,), "start": start, "end": end, "name": called})
                        )
        return tuple(found)

    def _straight(self, mark: Mark) -> list[tuple[tuple[float, float], tuple[float, float]]]:
        """The ends of each bolt: pieces in one direction are one bolt."""
        ends = []
        for line in _joined(mark.lines, self.near, straight_on=True):
            along = line[-1] - line[0]
            length = float(np.hypot(*along))
            off = np.abs((line[:, 0] - line[0, 0]) * along[1] - (line[:, 1] - line[0, 1]) * along[0])
            if length <= self.near or off.max() > _STRAIGHT * length**2:
                self._warn(
                    mark.name,
                    f"{mark.name!r} is not straight",
                    "a bolt is a straight line from its first end to its last",
                )
            if length > self.near:
                ends.append((_pair(line[0]), _pair(line[-1])))
        return ends

    def water(self, table: WaterTableTable | None) -> WaterTableTable | None:
        if table is None or table.points is not None:
            return table
        name = "water" if table.line is None else table.line
        if name not in self.marks:
            path: Path = ("loads", "water", "line") if table.line is not None else ("loads", "water")
            self._missing(
                path, f"the drawing has no water table {name!r}", "water", name,
                'give `points`, or draw a line called "water"',
            )  # fmt: skip
            return None
        self.claimed[name] = 0
        lines = _joined(self.marks[name].lines, self.near, straight_on=False)
        lines = sorted(
            (line if line[0, 0] <= line[-1, 0] else line[::-1] for line in lines), key=lambda line: line[0, 0]
        )
        points = np.concatenate(lines)
        if (np.diff(points[:, 0]) <= 0).any():
            k = int(np.argmax(np.diff(points[:, 0]) <= 0))
            source, at = self.drawing.mark_places[name]
            x, y = points[k + 1] + self.drawing.origin
            self.faults.append(
                Fault(
                    self.place(source),
                    f"{at}: the water table {name!r} turns back at ({x:.10g}, {y:.10g})",
                    "draw it once from left to right, without overhangs",
                )
            )
            return None
        return table.model_copy(update={"points": tuple(map(tuple, points.tolist())), "line": None})

    def forces(self, tables: Sequence[ForceTable], came_from: dict[Path, Path]) -> tuple[ForceTable, ...]:
        found: list[ForceTable] = []
        for k, table in enumerate(tables):
            known = table.point in self.marks and all(len(line) == 1 for line in self.marks[table.point].lines)
            if table.point is not None and not known:
                self._missing(
                    ("loads", "forces", k, "point"), f"the drawing has no point {table.point!r}", "load", table.point,
                    'give `at`, or draw a point called "load:NAME"',
                )  # fmt: skip
                continue
            points = [table.at] if table.point is None else [_pair(line[0]) for line in self.marks[table.point].lines]
            if table.point is not None:
                self.claimed[table.point] = k
            for at in points:
                came_from["loads", "forces", len(found)] = ("loads", "forces", k)
                found.append(table.model_copy(update={"at": at, "point": None}))
        return tuple(found)

    def monitors(self, tables: Sequence[MonitorTable], came_from: dict[Path, Path]) -> tuple[MonitorTable, ...]:
        drawn: dict[str, tuple[str, tuple[float, float]]] = {}
        for kind in ("monitor", "probe"):
            for name in self._of(kind):
                own, points = name.partition(":")[2] or kind, self.marks[name].lines
                self.claimed[name] = 0
                for k, point in enumerate(points, 1):
                    drawn[own if len(points) == 1 else f"{own} {k}"] = name, _pair(point[0])
        found: list[MonitorTable] = []
        for k, table in enumerate(tables):
            name, at = drawn.pop(table.name, ("", None))
            if table.at is None and at is None:
                self.faults.append(
                    Fault(
                        self.place(("monitors", k)),
                        f"monitor {table.name!r} has no `at`, and the drawing no point called 'monitor:{table.name}'",
                        nearest(table.name, list(drawn)) if drawn else "add at = [x, y]",
                    )
                )
                continue
            came_from["monitors", len(found)] = ("monitors", k)
            found.append(table if table.at is not None else table.model_copy(update={"at": at}))
        for own, (name, at) in drawn.items():
            came_from["monitors", len(found)] = self.drawing.mark_places[name][0]
            found.append(MonitorTable(name=own, at=at))
        return tuple(found)

    def warn_of_idle(self, tables: SceneTables) -> None:
        """Warn of drawn marks without effect."""
        for name in self.marks:
            kind = name.partition(":")[0]
            if name in self.claimed:
                continue
            if kind == "bolt" and tables.loads is not None:
                self._warn(
                    name, f"no bolt uses the line {name!r}", f'give it properties: [[loads.bolts]] lines = ["{name}"]'
                )
            elif kind == "water" and tables.loads is not None:
                other = tables.loads.water is not None
                self._warn(
                    name,
                    f"the water table {name!r} is drawn and not used",
                    f'[loads.water] line = "{name}"' if other or name != "water" else "add [loads.water]",
                )
            elif kind == "load" and tables.loads is not None:
                self._warn(name, f"no force acts on the point {name!r}", f'[[loads.forces]] point = "{name}"')
            elif kind not in ("bolt", "water", "load"):
                self._warn(
                    name, f"the point {name!r} has no effect",
                    'measuring points are called "monitor:NAME", points of forces "load:NAME"',
                )  # fmt: skip


def _pair(point: np.ndarray) -> tuple[float, float]:
    x, y = point.tolist()
    return x, y


def _joined(lines: Sequence[np.ndarray], near: float, straight_on: bool) -> list[np.ndarray]:
    """Lines joined where their ends meet; ``straight_on``: only where they continue in one direction."""
    waiting, joined = [np.asarray(line) for line in lines], []
    while waiting:
        line = waiting.pop(0)
        k = 0
        while k < len(waiting):
            other = waiting[k]
            pairs = [(a, b) for a in (line, line[::-1]) for b in (other, other[::-1])]
            fitting = [
                (a, b)
                for a, b in pairs
                if np.hypot(*(a[-1] - b[0])) <= near and (not straight_on or _is_straight_on(a[-2], a[-1], b[1]))
            ]
            if fitting:
                a, b = fitting[0]
                # The direction is that of the piece that was drawn first.
                line = np.concatenate([a, b[1:]]) if a is line else np.concatenate([a, b[1:]])[::-1]
                del waiting[k]
                k = 0
            else:
                k += 1
        joined.append(line)
    return joined


def _is_straight_on(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> bool:
    first, then = b - a, c - b
    turn = first[0] * then[1] - first[1] * then[0]
    return bool(first @ then > 0 and abs(turn) <= _STRAIGHT * np.hypot(*first) * np.hypot(*then))
