"""The index of equations, from ``docs/equations.toml``: each equation, the function that computes it, its source."""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

INDEX = Path(__file__).parents[1] / "equations.toml"
ROOT = Path(__file__).parents[2]

OPENING = """# Index of equations

For each equation: the function that computes it, its file and line in this version, and the paper or book from which
it is taken. The page is made from
`docs/equations.toml`. A test imports every function and checks that its docstring, or that of its module, contains the
equation.
"""


class Row(NamedTuple):
    """One equation: ``what`` it is, as ``tex``, ``at`` "module:function", its ``source``, and the words in the
    docstring that ``mark`` it."""

    what: str
    tex: str
    at: str
    source: str
    mark: str


def rows() -> dict[str, list[Row]]:
    """Chapter → its equations."""
    chapters = tomllib.loads(INDEX.read_text(encoding="utf-8"))["chapter"]
    return {chapter["title"]: [Row(**row) for row in chapter["equation"]] for chapter in chapters}


def found(row: Row) -> Any:
    """What ``row.at`` names. Raises ImportError or AttributeError where there is no such thing."""
    module, _, name = row.at.partition(":")
    at = import_module(module)
    for part in name.split("."):
        at = getattr(at, part)
    return inspect.unwrap(getattr(at, "py_func", at))


def docstring(row: Row) -> str:
    """The docstrings of the function and of its module."""
    module = import_module(row.at.partition(":")[0])
    return f"{inspect.getdoc(found(row)) or ''}\n{inspect.getdoc(module) or ''}"


def place(row: Row) -> str:
    """ "file:line" of the function."""
    what = found(row)
    what = what.fget if isinstance(what, property) else what
    lines = inspect.getsourcelines(what)[1]
    return f"{Path(inspect.getsourcefile(what)).resolve().relative_to(ROOT)}:{lines}"


def page() -> str:
    """The page as MyST Markdown."""
    return OPENING + "\n" + "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    for title, chapter in rows().items():
        yield f"\n## {title}\n"
        for row in chapter:
            yield f"**{row.what}**\n"
            yield f"$$\n{row.tex.strip()}\n$$\n"
            yield f"`{row.at.partition(':')[2]}` in `{place(row)}` · {row.source}\n"
