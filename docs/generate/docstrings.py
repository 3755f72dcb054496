"""Docstrings of the project as reStructuredText: attributes in columns become lists, indented equations stay as they
are written."""

from __future__ import annotations

import re

#: "name(s)      what it is", as records list their attributes.
_COLUMNS = re.compile(r"^([A-Za-z_][\w, /.*]*?)\s{2,}(\S.*)$")


def as_rst(lines: list[str]) -> list[str]:
    """The lines of a docstring, without its common indentation, in reStructuredText."""
    out: list[str] = []
    for paragraph in _paragraphs(lines):
        if paragraph[0].startswith(">>>"):
            out += [*paragraph, ""]
        elif all(line.startswith("  ") for line in paragraph):
            literal = any(line.endswith("::") for line in out[-2:])
            out += [*([] if literal else ["", ".. code-block:: text", ""]), *("   " + line for line in paragraph), ""]
        else:
            out += [*_listed(paragraph), ""]
    return out


def _paragraphs(lines: list[str]) -> list[list[str]]:
    found: list[list[str]] = [[]]
    for line in lines:
        if line.strip():
            found[-1].append(line)
        elif found[-1]:
            found.append([])
    return [paragraph for paragraph in found if paragraph]


def _listed(paragraph: list[str]) -> list[str]:
    """A paragraph whose lines stand in columns, as a list; any other as it is."""
    out: list[str] = []
    listing = False
    for line in paragraph:
        columns = _COLUMNS.match(line)
        if columns and not columns[1].endswith("."):
            if out and not listing:
                out.append("")
            listing = True
            names = ", ".join(f"``{name.strip()}``" for name in columns[1].split(","))
            description = _plain(re.sub(r"\s{2,}", " ", columns[2]))
            out.append(f"- {names}: {description}")
        elif listing and line.startswith(" "):
            out.append("  " + _plain(line.strip()))
        else:
            if listing:
                out.append("")
            listing = False
            out.append(_plain(line))
    return out


def _plain(text: str) -> str:
    """Signs that stand for themselves: bars of sizes, stars of products."""
    if "``" in text or "`" in text:
        return (
            re.sub(r"(?<!\\)\|", r"\\|", text)
            if text.count("`") % 2 == 0 and "|`" not in text and "`|" not in text
            else text
        )
    return re.sub(r"(?<!\\)([|*])", r"\\\1", text)
