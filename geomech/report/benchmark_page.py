"""Page of a benchmark: its pictures, and the tables in its JSON files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .page import Page

#: Number of rows shown of a table; the rest is in the file.
LISTED = 200


def page_of_benchmark(folder: Path) -> Page:
    """Page of the JSON files and pictures in ``folder``. Raises ValueError naming a file that is not JSON."""
    page = Page("Benchmark " + folder.name.removeprefix("bench").lstrip("_"), f"from {folder}")
    if _pictures(folder):
        page.section("Plots")
        page.figures(_pictures(folder), whole=True)
    for path in sorted(folder.glob("*.json")):
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise ValueError(f"{path} is not valid JSON: {error}") from None
        if isinstance(found, Mapping) and isinstance(found.get("topics"), Mapping):
            _add_topics(page, found, folder)
        else:
            page.section(path.stem.replace("_", " "))
            _add(page, found, "")
    return page


def _pictures(folder: Path) -> list[tuple[Path, str]]:
    found = sorted(path for kind in ("*.png", "*.svg") for path in folder.glob(kind))
    return [(path, path.stem.replace("_", " ")) for path in found]


def _add_topics(page: Page, found: Mapping[str, Any], folder: Path) -> None:
    """Figures of `geomech bench`, topic by topic with the pictures of each, then the machine."""
    for topic, figures in found["topics"].items():
        page.section(topic)
        # The stability maps have a folder of their own.
        for subfolder in (f"bench_{topic}", topic):
            page.figures(_pictures(folder.parent / subfolder), whole=True)
        for kind, values in figures.items():
            if isinstance(values, Mapping) and values:
                page.table(["", kind], list(values.items()))
    page.section("Machine")
    for name, value in found.items():
        if name != "topics":
            _add(page, {name: value} if _plain(value) else value, "")


def _add(page: Page, value: Any, name: str) -> None:
    """``value`` as a table, as tiles, or, if it holds several, one after the other."""
    if isinstance(value, list) and value and all(isinstance(row, Mapping) for row in value):
        headers = list(dict.fromkeys(key for row in value for key in row if _plain(row[key])))
        page.table(
            [key.replace("_", " ") for key in headers], [[row.get(k) for k in headers] for row in value[:LISTED]], name
        )
        if len(value) > LISTED:
            page.text(f"{len(value) - LISTED} more rows in the file.")
    elif isinstance(value, Mapping):
        plain = {key.replace("_", " "): inner for key, inner in value.items() if _plain(inner)}
        if plain and name:
            page.table([name, ""], list(plain.items()))
        else:
            page.facts(plain)
        for key, inner in value.items():
            if not _plain(inner):
                _add(page, inner, " · ".join(filter(None, (name, key.replace("_", " ")))))
    elif isinstance(value, list) and value:
        page.text(f"{name}: " + ", ".join(map(str, value[:LISTED])))


def _plain(value: Any) -> bool:
    return value is None or isinstance(value, (str, int, float))
