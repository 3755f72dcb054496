"""CSV files that grow with the run: ``history.csv`` a row a cycle, ``tips.csv`` a row a tip, ``events.csv``."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from geomech.model import OPEN, Cycle, Problem

from .fields import EVENTS, HISTORY, TIPS


class Histories:
    """Observer that appends to the three files and flushes after every cycle, so that a crash loses nothing."""

    def on_start(self, problem: Problem, folder: Path) -> None:
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self._history = Table(folder / "history.csv", HISTORY)
        self._tips = Table(folder / "tips.csv", TIPS)
        self._events = Table(folder / "events.csv", EVENTS)

    def on_cycle(self, cycle: Cycle) -> None:
        self._history.add([history_row(cycle)])
        self._tips.add(tip_rows(cycle))
        self._events.add(
            {
                "kind": event.kind,
                "cycle": event.cycle,
                "time": event.time,
                "load": event.load,
                "x": event.point[0],
                "y": event.point[1],
                "detail": event.detail,
            }
            for event in cycle.events
        )

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        for table in (self._history, self._tips, self._events):
            table.close()


class Table:
    """A CSV file that grows row by row. A column not seen before (a monitor's, a step's statistic that only comes
    with contact) is added at the right, with the rows so far rewritten; that happens a few times in a run."""

    def __init__(self, path: Path, columns: Iterable[str]) -> None:
        self.path, self.columns = Path(path), list(columns)
        self._known = set(self.columns)
        self._file = open(self.path, "w", newline="", encoding="utf-8")  # noqa: SIM115 (open as long as the run)
        csv.writer(self._file).writerow(self.columns)
        self._file.flush()

    def add(self, rows: Iterable[dict[str, Any]]) -> None:
        """Append ``rows`` (column → value; a column left out stays empty) and flush."""
        rows = list(rows)
        if not rows:
            return
        fresh = list(dict.fromkeys(name for row in rows for name in row if name not in self._known))
        if fresh:
            self._widen(fresh)
        text = io.StringIO()
        csv.writer(text).writerows([[_written(row.get(name)) for name in self.columns] for row in rows])
        self._file.write(text.getvalue())
        self._file.flush()

    def close(self) -> None:
        self._file.close()

    def _widen(self, fresh: list[str]) -> None:
        self._file.close()
        with open(self.path, newline="", encoding="utf-8") as file:
            _, *rows = csv.reader(file)
        self.columns += fresh
        self._known |= set(fresh)
        beside = self.path.with_name(self.path.name + ".part")
        with open(beside, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(self.columns)
            writer.writerows([*row, *[""] * len(fresh)] for row in rows)
        os.replace(beside, self.path)
        self._file = open(self.path, "a", newline="", encoding="utf-8")  # noqa: SIM115


def history_row(cycle: Cycle) -> dict[str, Any]:
    """The row of ``history.csv`` for ``cycle``: `fields.HISTORY`, then its statistics and monitors."""
    tips, contacts = cycle.tips, cycle.state.contacts
    row: dict[str, Any] = {
        "cycle": cycle.number,
        "time": cycle.state.time,
        "load_step": cycle.load_step,
        "growth_pass": cycle.growth_pass,
        "load": cycle.load,
        "strain": cycle.strain,
        "crack_length": float(cycle.cracks.lengths.sum()),
        "tips": len(tips),
        "growing": int(np.count_nonzero(tips["grown"] > 0)),
        "max_k_eq": float(tips["k_eq"].max()) if len(tips) else math.nan,
        "closed_contacts": int(np.count_nonzero(contacts["state"] != OPEN)),
    }
    row.update(cycle.statistics)
    for name, displacement in cycle.monitors.items():
        row[f"{name}_ux"], row[f"{name}_uy"] = displacement
    return row


def tip_rows(cycle: Cycle) -> list[dict[str, Any]]:
    """The rows of ``tips.csv`` for ``cycle``."""
    tips = cycle.tips
    same = {"cycle": cycle.number, "time": cycle.state.time, "load": cycle.load}
    columns = {
        "crack": tips["crack"],
        "end": tips["end"],
        "tip": tips["node"],
        "x": tips["point"][:, 0],
        "y": tips["point"][:, 1],
        "K_I": tips["k_i"],
        "K_II": tips["k_ii"],
        "K_eq": tips["k_eq"],
        "angle_deg": np.degrees(tips["angle"]),
        "grown_m": tips["grown"],
    }
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [same | dict(zip(columns, row, strict=True)) for row in rows]


def _written(value: Any) -> Any:
    """Floats in the shortest form that reads back as the same number; nan as an empty cell."""
    if isinstance(value, (float, np.floating)):
        return "" if math.isnan(value) else repr(float(value))
    return value
