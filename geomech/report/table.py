"""Table of several runs, one row each."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any

from ..output.reading import Run
from ..output.units import stress_unit

_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")

_MPA = " MPa"

#: Header → format of its numbers.
COLUMNS = {
    "run": "{}",
    "end": "{}",
    "initiation MPa": "{:.2f}",
    "coalescence MPa": "{:.2f}",
    "peak MPa": "{:.2f}",
    "initiation σ√(πb)/K_Ic": "{:.3f}",
    "coalescence σ√(πb)/K_Ic": "{:.3f}",
    "growth mm": "{:.1f}",
    "cycles": "{}",
    "wall s": "{:.2f}",
}


def table(runs: Sequence[Run]) -> list[dict[str, Any]]:
    """One row (header → value, None if missing) for each of ``runs``, from their summaries."""
    return [_row(run) for run in runs]


def _row(run: Run) -> dict[str, Any]:
    summary = run.summary
    first = summary.get("first", {})

    def of(kind: str, what: str, scale: float = 1.0) -> float | None:
        value = first.get(kind, {}).get(what)
        return None if value is None else value / scale

    def load(kind: str, what: str, scale: float = 1.0) -> float | None:
        # Without a leading edge the load is 0.
        return of(kind, what, scale) if run.led else None

    def plain(what: str, scale: float = 1.0) -> float | None:
        value = summary.get(what)
        return None if value is None else value / scale

    return {
        "run": run.folder.name,
        "end": summary.get("end", "not ended"),
        "initiation MPa": load("initiation", "load_pa", 1e6),
        "coalescence MPa": load("coalescence", "load_pa", 1e6),
        "peak MPa": plain("peak_load_pa", 1e6) if run.led else None,
        "initiation σ√(πb)/K_Ic": load("initiation", "load_normalised"),
        "coalescence σ√(πb)/K_Ic": load("coalescence", "load_normalised"),
        "growth mm": plain("crack_growth_m", 1e-3),
        "cycles": summary.get("cycles"),
        "wall s": plain("wall_s"),
    }


def shown(rows: Sequence[dict[str, Any]]) -> list[Sequence[str | None]]:
    """Headers and formatted cells of the rows, without empty columns, with loads in the unit of the largest."""
    headers = [name for name in COLUMNS if any(row[name] is not None for row in rows)]
    loads = [name for name in headers if name.endswith(_MPA)]
    largest = max((abs(row[name]) for row in rows for name in loads if row[name] is not None), default=0.0)
    unit, size = stress_unit(1e6 * largest)

    def cell(row: dict[str, Any], name: str) -> str | None:
        value = row[name]
        return None if value is None else COLUMNS[name].format(value * (1e6 / size) if name in loads else value)

    names = [f"{name.removesuffix(_MPA)} {unit}" if name in loads else name for name in headers]
    return [names, *([cell(row, name) for name in headers] for row in rows)]


def as_text(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as an aligned table, formatted by `shown`."""
    return aligned([["-" if cell is None else cell for cell in line] for line in shown(rows)])


def aligned(lines: Sequence[Sequence[str]]) -> str:
    """Cells of ``lines`` (the first are headers) in columns: text left-aligned, numbers right-aligned."""
    widths = [max(map(len, column)) for column in zip(*lines)]
    words = [any(not is_number(cell) for cell in column[1:]) for column in zip(*lines)]

    def line(cells: Sequence[str]) -> str:
        set_ = [cell.ljust(w) if left else cell.rjust(w) for cell, w, left in zip(cells, widths, words)]
        return "  ".join(set_).rstrip()

    return "\n".join(map(line, lines))


def is_number(text: str) -> bool:
    """Whether a cell is a number, or the dash of a missing one."""
    try:
        float(text.replace("−", "-").replace("\u202f", "").replace("·10", "e").translate(_LOWERED))
    except ValueError:
        return text in ("", "-", "–")
    return True


def as_csv(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as CSV with every column, numbers in full precision."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(COLUMNS), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: "" if value is None else value for key, value in row.items()} for row in rows)
    return text.getvalue().rstrip("\n")
