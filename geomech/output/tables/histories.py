"""CSV files that grow during a run: ``history.csv``, one row per cycle; ``tips.csv``, one per tip; ``events.csv``."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from geomech.model import OPEN, Cycle, Problem

from ..checkpoints.checkpoint_file import FilesChanged
from ..fields import EVENTS, HISTORY, TIPS


class Histories:
    """Observer that appends to the three files and flushes after every cycle, so that a crash loses nothing."""

    def on_start(self, problem: Problem, folder: Path) -> None:
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self._history = Table(folder / "history.csv", HISTORY)
        self._tips = Table(folder / "tips.csv", TIPS)
        self._events = Table(folder / "events.csv", EVENTS)

    def memory(self) -> list[TableEnd]:
        return [table.end for table in (self._history, self._tips, self._events)]

    def on_resume(self, problem: Problem, folder: Path, memory: list[TableEnd]) -> None:
        names = ("history.csv", "tips.csv", "events.csv")
        tables = [Table.cut_back(Path(folder) / name, end) for name, end in zip(names, memory, strict=True)]
        self._history, self._tips, self._events = tables

    def on_cycle(self, cycle: Cycle) -> None:
        self._history.add([history_row(cycle)])
        self._tips.add_columns(tip_columns(cycle))
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


class TableEnd(NamedTuple):
    """End of a `Table`: its columns, rows and bytes."""

    columns: tuple[str, ...]
    rows: int
    size: int


class Table:
    """A CSV file that grows row by row.

    A new column (of a monitor, or a step statistic that appears with the first contact) is added at the right, and the
    existing rows are rewritten; that happens a few times in a run.
    """

    def __init__(self, path: Path, columns: Iterable[str]) -> None:
        self.path, self.columns = Path(path), list(columns)
        self._known = set(self.columns)
        self._rows = 0
        self._file = open(self.path, "w", newline="", encoding="utf-8")  # noqa: SIM115 (open as long as the run)
        csv.writer(self._file).writerow(self.columns)
        self._file.flush()

    @property
    def end(self) -> TableEnd:
        return TableEnd(tuple(self.columns), self._rows, os.fstat(self._file.fileno()).st_size)

    @classmethod
    def cut_back(cls, path: Path, end: TableEnd) -> Table:
        """Continue the file ``path`` from ``end``; later columns and rows are dropped. Raises FilesChanged if it has
        less content than at that time."""
        table = cls.__new__(cls)
        table.path, table.columns, table._known, table._rows = path, list(end.columns), set(end.columns), end.rows
        if not path.is_file():
            raise FilesChanged(f"{path} is missing")
        with open(path, "r+b") as file:
            header: list[str] | None = next(csv.reader([file.readline().decode("utf-8")]), [])
            if header == table.columns and os.fstat(file.fileno()).st_size >= end.size:
                file.truncate(end.size)
                header = None
        if header is not None:
            table._narrow(header)
        table._file = open(path, "a", newline="", encoding="utf-8")  # noqa: SIM115
        if table.end != end:
            table.close()
            raise FilesChanged(f"{path} ends before its row {end.rows}, which it had at the checkpoint")
        return table

    def add(self, rows: Iterable[dict[str, Any]]) -> None:
        """Append ``rows`` (column → value; missing columns stay empty) and flush."""
        rows = list(rows)
        if not rows:
            return
        self._room_for(name for row in rows for name in row)
        self._append([[_written(row.get(name)) for name in self.columns] for row in rows])

    def add_columns(self, columns: dict[str, list[Any]]) -> None:
        """Append rows given by ``columns`` of one length and flush."""
        n = len(next(iter(columns.values())))
        if not n:
            return
        self._room_for(columns)
        written = (list(map(_written, columns[name])) if name in columns else [None] * n for name in self.columns)
        self._append(list(zip(*written, strict=True)))

    def _room_for(self, names: Iterable[str]) -> None:
        fresh = list(dict.fromkeys(name for name in names if name not in self._known))
        if fresh:
            self._widen(fresh)

    def _append(self, rows: Sequence[Sequence[Any]]) -> None:
        text = io.StringIO()
        csv.writer(text).writerows(rows)
        self._rows += len(rows)
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
        self._rewrite([*row, *[""] * len(fresh)] for row in rows)
        self._file = open(self.path, "a", newline="", encoding="utf-8")  # noqa: SIM115

    def _narrow(self, header: list[str]) -> None:
        """Remove columns and rows from the file that are not ours; its ``header`` has more columns."""
        if header[: len(self.columns)] != self.columns:
            raise FilesChanged(f"{self.path} has other columns than it had: {', '.join(header)}")
        with open(self.path, newline="", encoding="utf-8") as file:
            _, *rows = csv.reader(file)
        self._rewrite(row[: len(self.columns)] for row in rows[: self._rows])

    def _rewrite(self, rows: Iterable[list[str]]) -> None:
        unfinished = self.path.with_name(self.path.name + ".part")
        with open(unfinished, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(self.columns)
            writer.writerows(rows)
        os.replace(unfinished, self.path)


def history_row(cycle: Cycle) -> dict[str, Any]:
    """The row of ``history.csv`` for ``cycle``: `fields.HISTORY`, then its statistics and monitors."""
    tips, contacts = cycle.latest_tips, cycle.state.contacts
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


def tip_columns(cycle: Cycle) -> dict[str, list[Any]]:
    """The rows of ``tips.csv`` for ``cycle``, by column."""
    tips = cycle.latest_tips
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
        "crack_name": _names(cycle.cracks.names, tips["crack"]),
        "solved_cycle": cycle.solved_in,
    }
    whole = {name: [value] * len(tips) for name, value in same.items()}
    return whole | {name: column.tolist() for name, column in columns.items()}


def _names(names: tuple[str, ...], crack: np.ndarray) -> np.ndarray:
    return np.array([names[k] if k < len(names) else "" for k in crack.tolist()], dtype=object)


def _written(value: Any) -> Any:
    """Floats in the shortest form that reads back as the same number; nan as an empty cell."""
    if isinstance(value, (float, np.floating)):
        return "" if math.isnan(value) else repr(float(value))
    return value
