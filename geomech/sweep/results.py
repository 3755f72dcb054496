"""Files of a sweep: a journal, to which a row is appended when a run ends, and the tables made from it.

runs.jsonl     one line per run, in the order in which they ended, with times and hosts; a sweep is continued from it
runs.csv       the table, one row per run, by number; independent of the engine and of the order of the runs
runs.parquet   the same, if pyarrow is installed
times.csv      duration and host of each run
sweep.json     the plan and the results
"""

from __future__ import annotations

import csv
import json
import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from ..output.console.at_work import run_ended
from .measures import DONE, TIMES, kind_of_reason

JOURNAL, TABLE, PARQUET, TOOK, PLAN = "runs.jsonl", "runs.csv", "runs.parquet", "times.csv", "sweep.json"
#: Columns of the journal only.
_HIDDEN = ("first_warnings",)


class Journal:
    """The rows of a sweep in ``path``. Existing rows are read, and a last line that was cut off is dropped; every run
    occurs once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: dict[int, dict[str, Any]] = {}
        self._file: Any = None

    def __enter__(self) -> Self:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        if self.path.exists():
            self.rows, whole = _read(self.path)
            os.truncate(self.path, whole)
        self._file = open(self.path, "a", encoding="utf-8")
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            with suppress(OSError):
                self._file.flush()
                os.fsync(self._file.fileno())
            self._file.close()
            self._file = None

    def add(self, row: dict[str, Any]) -> bool:
        """Append the row of a run; returns False if the run is already present."""
        if row["run"] in self.rows:
            return False
        self._file.write(json.dumps(row, default=str) + "\n")
        self._file.flush()
        self.rows[row["run"]] = row
        run_ended()
        return True


def read_journal(path: Path) -> dict[int, dict[str, Any]]:
    """run → row of the complete lines in ``path``."""
    return _read(path)[0] if path.exists() else {}


def _read(path: Path) -> tuple[dict[int, dict[str, Any]], int]:
    """Rows, and the number of bytes of the file they occupy."""
    rows: dict[int, dict[str, Any]] = {}
    whole = 0
    with path.open("rb") as file:
        for line in file:
            if not line.endswith(b"\n"):
                break
            try:
                row = json.loads(line)
            except ValueError:
                break
            whole += len(line)
            rows.setdefault(row["run"], row)
    return rows, whole


def columns_of(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The columns of the table, in the order of their first appearance."""
    names = dict.fromkeys(name for row in rows for name in row)
    return [name for name in names if not name.startswith("_") and name not in TIMES and name not in _HIDDEN]


def write_tables(folder: Path, rows: Sequence[Mapping[str, Any]]) -> list[Path]:
    """Write the tables of ``rows`` (in the order of their runs), each one atomically."""
    names = columns_of(rows)
    written = [_write_csv(folder / TABLE, names, rows), _write_csv(folder / TOOK, ["run", *TIMES], rows)]
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        return written
    arrays = {name: _array(pyarrow, [_plain(row.get(name)) for row in rows]) for name in names}
    partial_file = folder / f"{PARQUET}.part"
    pyarrow.parquet.write_table(pyarrow.table(arrays), partial_file)
    os.replace(partial_file, folder / PARQUET)
    return [*written, folder / PARQUET]


def _array(pyarrow: Any, values: list[Any]) -> Any:
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int, float} and float in kinds:
        values = [None if value is None else float(value) for value in values]
    elif len(kinds) > 1:
        values = [None if value is None else str(value) for value in values]
    return pyarrow.array(values)


def _write_csv(path: Path, names: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> Path:
    partial_file = path.with_name(path.name + ".part")
    with open(partial_file, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([_cell(row.get(name)) for name in names] for row in rows)
    os.replace(partial_file, path)
    return path


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


def _cell(value: Any) -> Any:
    value = _plain(value)
    return "" if value is None else repr(value) if isinstance(value, float) else value


def counted_by_reason(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Runs without a result by status and reason (without numbers and names), the most frequent first: number of runs,
    and number and text of an example."""
    kinds = Counter((row["status"], kind_of_reason(row["reason"])) for row in rows if row["status"] != DONE)
    found = []
    for (status, kind), number in sorted(kinds.items(), key=lambda each: (-each[1], each[0])):
        one = next(row for row in rows if row["status"] == status and kind_of_reason(row["reason"]) == kind)
        found.append({"status": status, "kind": kind, "runs": number, "run": one["run"], "reason": one["reason"]})
    return found
