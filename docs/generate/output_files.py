"""The page of output files: every array and column, from the tables to which writers adhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from geomech.output import fields

OPENING = """# Output files

This page is made from the tables to which writers adhere (`geomech/output/fields.py`). A writer refuses an array that
is not declared, so that the list is complete. [Results](../start/results.md) explains what the files are for.
"""

CSV = {
    "history.csv": fields.HISTORY,
    "tips.csv": fields.TIPS,
    "events.csv": fields.EVENTS,
    "joints.csv": fields.JOINTS,
    "reactions.csv": fields.REACTIONS,
}
ROWS = {
    "history.csv": "One row per cycle. These columns are followed by the statistics of the step (`dt`, `open_close_iterations`, "
    "energies, `budget_residual`, `worst_penetration` …; `remaining_motion`, in statics: displacement until the blocks rest, over that so far), displacements of monitors (`NAME_ux`, `NAME_uy`, m) and "
    "forces in bolts.",
    "tips.csv": "One row per tip and cycle.",
    "events.csv": "One row per event.",
    "joints.csv": "One row per joint and cycle. A joint has the name of its edges, or else that of its law.",
    "reactions.csv": "One row per fixed or guided block and cycle: the forces of contacts on it.",
}


def page() -> str:
    """The page as MyST Markdown."""
    lines = [OPENING]
    for name, columns in CSV.items():
        lines += [f"## {name}\n", ROWS[name] + "\n", "| column | unit, meaning |", "|---|---|"]
        lines += [f"| `{column}` | {_cell(unit)} |" for column, unit in columns.items()]
        lines.append("")
    for name, arrays in fields.SERIES.items():
        lines += [f"## {name}.pvd\n", *_arrays(arrays), ""]
    lines.append("Files of `geomech build`:\n")
    for name, arrays in fields.PREPARED.items():
        lines += [f"## {name}.vtu\n", *_arrays(arrays), ""]
    return "\n".join(lines) + "\n"


def _arrays(arrays: Iterable[fields.Field]) -> Iterator[str]:
    yield "| array | at | components | unit | meaning |"
    yield "|---|---|---|---|---|"
    for field in arrays:
        components = " ".join(field.components) or "1"
        yield f"| `{field.name}` | {field.place} | {components} | {_cell(field.unit)} | {_cell(field.doc)} |"


def _cell(text: str) -> str:
    return text.replace("|", r"\|").replace("*", r"\*")
