"""Validation of TOML data against the tables; pydantic's errors in the terms of a scene."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any

from pydantic import ConfigDict, TypeAdapter, ValidationError

from .errors import Fault
from .keys import description_at, expected_of, field_of, keys_of, kind_of, places_of_keys, table_at, written
from .locator import Path
from .tables import SceneTables
from .tables.sweep import SweepTable

_COMPARISON = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}

#: A number with a comma instead of a decimal point.
DECIMAL_COMMA = r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?"


def validate(data: dict[str, Any], place: Callable[[Path], str]) -> tuple[SceneTables, list[Fault]]:
    """The tables of a parsed scene, and all their errors.

    Valid sections are filled in and faulty ones are None, so that checks across sections can still run.
    """
    try:
        return SceneTables.model_validate(data), []
    except ValidationError as error:
        faults = [_fault(item, place) for item in error.errors(include_url=False)]
    sections: dict[str, Any] = {}
    for name, field in SceneTables.model_fields.items():
        if name not in data:
            sections[name] = None if field.is_required() else field.default
            continue
        kind: Any = Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation
        # A model brings its own configuration; only plain containers take it from here.
        config = None if table_at((name,)) else ConfigDict(strict=True)
        try:
            sections[name] = TypeAdapter(kind, config=config).validate_python(data[name])
        except ValidationError:
            sections[name] = None
    return SceneTables.model_construct(**sections), faults


def validate_sweep(data: dict[str, Any], place: Callable[[Path], str]) -> tuple[SweepTable | None, list[Fault]]:
    """The table [sweep] of ``data``, and all its errors; ``place`` gives the place of a path below "sweep"."""
    try:
        SceneTables.model_validate({"sweep": data})
    except ValidationError as error:
        found = [item for item in error.errors(include_url=False) if item["loc"][:1] == ("sweep",)]
        if found:
            return None, [_fault(item, place) for item in found]
    return SweepTable.model_validate(data), []


def nearest(name: str, known: list[str]) -> str:
    """ "did you mean …?" with the closest of ``known``, or a list of them."""
    close = difflib.get_close_matches(name, known, 1, cutoff=0.6)
    if close:
        return f"did you mean {close[0]!r}?"
    return f"there is {', '.join(known)}" if known else "there is none"


def _meant(key: str, known: list[str]) -> str:
    """ "did you mean …? ": one of the ``known`` keys of the table, or of another table, that is spelled like ``key``."""
    # A key of the scene itself is written as it begins in the file: [[monitors]], not monitors.
    everywhere = {
        name: [place if place != name else _header((name,)).strip("`") for place in places]
        for name, places in places_of_keys().items()
    }
    close = difflib.get_close_matches(key, known, 1, cutoff=0.8)
    close = close or everywhere.get(key, [])[:3]
    if not close:
        close = [
            place for near in difflib.get_close_matches(key, everywhere, 1, 0.85) for place in everywhere[near][:3]
        ]
    close = close or difflib.get_close_matches(key, known, 1, cutoff=0.65)
    return f"did you mean {' or '.join(map(repr, close))}? " if close else ""


def _fault(item: Mapping[str, Any], place: Callable[[Path], str]) -> Fault:
    path: Path = tuple(item["loc"])
    kind, given, context = item["type"], item.get("input"), item.get("ctx", {})
    # Members of a union and keys of a map add parts that do not exist in the file.
    while (path and path[-1] in ("float", "str", "[key]")) or (path and str(path[-1]).startswith("constrained-")):
        path = path[:-1]
    table = table_at(path[:-1]) if path else None
    field = field_of(table, path[-1]) if table else None
    what = expected_of(field) if field else ""
    meaning = description_at(path)

    if kind == "extra_forbidden":
        known = keys_of(table) if table else []
        return Fault(
            place(path), f"unknown key {path[-1]!r}", _meant(str(path[-1]), known) + f"keys here are {', '.join(known)}"
        )
    if kind == "missing" and isinstance(path[-1], str):
        return Fault(place(path), f"{path[-1]!r} is missing", f"add {_header(path)}: {meaning}")
    if kind in ("missing", "too_long", "too_short"):
        whole = path[:-1] if isinstance(path[-1], int) else path
        return Fault(place(whole), "the array has the wrong number of entries", description_at(whole))
    if kind == "value_error":
        return Fault(place(path), str(context.get("error", item["msg"])), meaning)
    if kind == "literal_error":
        choices = context["expected"].replace("'", '"')
        return Fault(place(path), f"{written(given)} is not one of {choices}", meaning)
    if kind in _COMPARISON:
        key, words = _COMPARISON[kind]
        return Fault(place(path), f"{written(given)} is out of range, it must be {words} {context[key]:g}", meaning)
    if kind == "finite_number":
        return Fault(place(path), f"{written(given)} is not a finite number", meaning)
    if kind.endswith(("_type", "_parsing")):
        wanted = {"model": "a table", "dict": "a table", "tuple": "an array"}
        if isinstance(path[-1], int) or table_at(path) or not what:
            what = {"float": "number", "string": "text", **wanted}.get(kind.split("_")[0], what)
        hint = _hint(given, what) if isinstance(given, str) else ""
        return Fault(place(path), f"{written(given)} given, expected {what or 'another type'}", hint + meaning)
    return Fault(place(path), item["msg"], meaning)


def _header(path: Path) -> str:
    """Beginning of an entry at ``path`` in the file: a table, a table with a name, one of several, or a value."""
    table = table_at(path[:-1])
    field = field_of(table, path[-1]) if table else None
    kind, inner = kind_of(field.annotation) if field else ("value", None)
    if kind in ("map", "list"):
        kind = kind if kind_of(inner)[0] == "table" else "value"
    dots = ".".join(map(str, path))
    return {"table": f"[{dots}]", "map": f"[{dots}.NAME]", "list": f"[[{dots}]]"}.get(kind, f"`{path[-1]} = …`")


def _hint(given: str, what: str) -> str:
    """Suggestion where a text is given instead of another type."""
    if what.startswith('["'):
        return f'write an array, ["{given}"]: '
    if "number" in what and re.fullmatch(DECIMAL_COMMA, given.strip()):
        return f"write a decimal point, {given.strip().replace(',', '.')}: "
    if ("number" in what and _is_number(given)) or (what == "true or false" and given.strip() in ("true", "false")):
        return "remove the quotes: "
    if what == "true or false" and given.strip().lower() in ("true", "false"):
        return f"write {given.strip().lower()}, in lower case and without quotes: "
    return ""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
