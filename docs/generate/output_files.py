"""The page of output files: every array and column, from the tables that writers are held to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from geomech.output import fields

OPENING = """# Output files

Made from the tables that writers are held to (`geomech/output/fields.py`): a writer refuses an array that is not
declared, so this is all there
is. What the files are for: [what comes out](../start/results.md).
"""

CSV = {
    "history.csv": fields.HISTORY,
    "tips.csv": fields.TIPS,
    "events.csv": fields.EVENTS,
    "joints.csv": fields.JOINTS,
    "reactions.csv": fields.REACTIONS,
}
ROWS = {
    "history.csv": "A row a cycle. After these columns come the statistics of the step (`dt`, `open_close_iterations`, "
    "energies, `budget_residual`, `worst_penetration` …), displacements of monitors (`NAME_ux`, `NAME_uy`, m) and "
    "forces in bolts.",
    "tips.csv": "A row a tip and cycle.",
    "events.csv": "A row an event.",
    "joints.csv": "A row a joint and cycle. A joint goes by the name of its edges, else by that of its law.",
    "reactions.csv": "A row a fixed or guided block and cycle: what contacts put on it.",
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
    lines.append("What `geomech build` writes:\n")
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
