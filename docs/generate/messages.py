"""The page of all messages: the messages of checks of a scene and the warnings of a run, read from the sources.

A message is the text of the source; what stands in braces there is shown as an ellipsis.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "geomech"

OPENING = """# All messages

Every error and warning of a scene with its remedy, and every warning that a run can write to the terminal and `run.log`. The
list is read from the sources, so that none is missing. An ellipsis stands for names and numbers.
[Messages, and what to do](../reference/messages.md) explains those that need more words.
"""

#: Title → calls that make such a message, and where they may stand.
SCENE_ERRORS = ("Errors in a scene", ("refuse", "Fault"), ("scene", "sweep", "shapes", "pipeline.py", "study.py"))
SCENE_WARNINGS = ("Warnings of a scene", ("warn", "_warn"), ("scene",))
RUN_WARNINGS = ("Warnings of a run", ("warning",), ("dda", "ddm", "coupling", "output", "compiled.py", "resumption.py"))


def page() -> str:
    """The page as MyST Markdown."""
    lines = [OPENING]
    for title, calls, places in (SCENE_ERRORS, SCENE_WARNINGS, RUN_WARNINGS):
        lines.append(f"## {title}\n")
        for message, way_out in sorted(set(messages(calls, places)), key=lambda pair: pair[0].strip("… '").lower()):
            empty = "" if calls == RUN_WARNINGS[1] else "the remedy depends on the scene and is given with the message"
            lines += (
                [f"- {_escaped(message)}\\", f"  → *{_escaped(way_out or empty)}*"]
                if way_out or empty
                else [f"- {_escaped(message)}"]
            )
        lines.append("")
    return "\n".join(lines) + "\n"


def messages(calls: tuple[str, ...], places: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """(message, way out) of all calls by these names in these folders and files of the package."""
    for place in places:
        root = PACKAGE / place
        for path in sorted(root.rglob("*.py")) if root.is_dir() else [root]:
            for node in _calls(path):
                if _name(node.func) not in calls:
                    continue
                # `refuse(path, message, way out)` or without a path; `log.warning(message, …)`.
                texts = [*map(_text, node.args), None, None, None]
                first = 0 if _name(node.func) == "warning" or " " in (texts[0] or "") else 1
                message, way_out = texts[first : first + 2]
                if message and re.search(r"\w \w", message):
                    yield message, (way_out or "") if _name(node.func) != "warning" else ""


@cache
def _calls(path: Path) -> list[ast.Call]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)]


def _name(function: ast.expr) -> str:
    return getattr(function, "attr", getattr(function, "id", ""))


def _text(node: ast.expr) -> str | None:
    """The text of an expression, with an ellipsis for what is only known at run time; None where all of it is."""
    match node:
        case ast.Constant(value=str(text)):
            return re.sub(r"%\.?\d*[sdrgefx]|%%", lambda found: "%" if found[0] == "%%" else "…", text)
        case ast.JoinedStr(values=values):
            parts = (_text(part) if isinstance(part, ast.Constant) else "…" for part in values)
            return re.sub(r"(… ?)+", lambda found: "… " if found[0].endswith(" ") else "…", "".join(map(str, parts)))
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            both = _text(left), _text(right)
            return None if both == (None, None) else "".join(text or "…" for text in both)
        case ast.IfExp(body=body):
            return _text(body)
    return None


def _escaped(text: str) -> str:
    """As Markdown: keys in backticks stay code, everything else is plain."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    return "".join(
        part if part.startswith("`") else re.sub(r"([\\*_\[\]<>#|$~{}])", r"\\\1", part) for part in parts
    ).replace(":", r"\:", 1 if text.startswith(":") else 0)
