"""Several runs side by side: a row a run."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any

from ..output.reading import Run

#: Header → how a number is written.
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
    """A row (header → value, None where a run has none) for each of ``runs``, from their summaries."""
    return [_row(run) for run in runs]


def _row(run: Run) -> dict[str, Any]:
    summary = run.summary
    first = summary.get("first", {})

    def of(kind: str, what: str, scale: float = 1.0) -> float | None:
        value = first.get(kind, {}).get(what)
        return None if value is None else value / scale

    def plain(what: str, scale: float = 1.0) -> float | None:
        value = summary.get(what)
        return None if value is None else value / scale

    return {
        "run": run.folder.name,
        "end": summary.get("end", "not ended"),
        "initiation MPa": of("initiation", "load_pa", 1e6),
        "coalescence MPa": of("coalescence", "load_pa", 1e6),
        "peak MPa": plain("peak_load_pa", 1e6),
        "initiation σ√(πb)/K_Ic": of("initiation", "load_normalised"),
        "coalescence σ√(πb)/K_Ic": of("coalescence", "load_normalised"),
        "growth mm": plain("crack_growth_m", 1e-3),
        "cycles": summary.get("cycles"),
        "wall s": plain("wall_s"),
    }


def as_text(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as an aligned table, columns that no run fills left out."""
    headers = [name for name in COLUMNS if any(row[name] is not None for row in rows)]
    lines = [headers] + [
        ["-" if row[name] is None else COLUMNS[name].format(row[name]) for name in headers] for row in rows
    ]
    widths = [max(len(line[k]) for line in lines) for k in range(len(headers))]

    def aligned(line: list[str]) -> str:
        # Names to the left, numbers to the right.
        cells = [text.ljust(w) if h in ("run", "end") else text.rjust(w) for h, text, w in zip(headers, line, widths)]
        return "  ".join(cells).rstrip()

    return "\n".join(aligned(line) for line in lines)


def as_csv(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as CSV with every column, numbers in full."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(COLUMNS), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: "" if value is None else value for key, value in row.items()} for row in rows)
    return text.getvalue().rstrip("\n")
