"""Overrides of a scene: ``section.key=value`` on the command line, and the scene's own variants."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

from .locator import Path, dotted, path_of


class OverrideError(ValueError):
    """An override that cannot be applied: message and way out."""

    def __init__(self, message: str, way_out: str) -> None:
        super().__init__(f"{message}: {way_out}")
        self.message, self.way_out = message, way_out


def parse_override(text: str) -> tuple[Path, Any]:
    """Path and value of "section.key=value".

    A value that is not valid TOML is a text, except True and False. Raises OverrideError without "=".
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise OverrideError(
            f"{text!r} is not a change to a scene", "write section.key=value, as in dda.time_step_s=0.5"
        )
    value = value.strip()
    try:
        return path_of(key.strip()), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return path_of(key.strip()), {"True": True, "False": False}.get(value, value)


def change_of(one: str | tuple[str, Any]) -> tuple[Path, Any]:
    """Path and value of an override: "section.key=value" (`parse_override`), or a "section.key" and a Python value.

    NumPy numbers, paths and tuples are converted to TOML types. Raises OverrideError for anything else.
    """
    if isinstance(one, str):
        return parse_override(one)
    key, value = one
    return path_of(key), _as_toml(value, key)


def _as_toml(value: Any, key: str) -> Any:
    """``value`` in the types of parsed TOML."""
    if hasattr(value, "tolist") and not isinstance(value, (list, tuple)):
        value = value.tolist()
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return {str(name): _as_toml(inner, key) for name, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_as_toml(inner, key) for inner in value]
    raise OverrideError(f"{key}: {value!r} is not possible in a scene", "give a number, a text, a list or a table")


def flattened(changes: dict[str, Any]) -> list[tuple[Path, Path, Any]]:
    """The overrides of a variant: (path in the variant's table, path in the scene, value).

    A key may be a quoted dotted path or an unquoted one; whole tables are overridden key by key.
    """
    found: list[tuple[Path, Path, Any]] = []

    def walk(node: dict[str, Any], own: Path, target: Path) -> None:
        for key, value in node.items():
            where, path = own + (key,), target + path_of(key)
            if isinstance(value, dict) and value:
                walk(value, where, path)
            else:
                found.append((where, path, value))

    walk(changes, (), ())
    return found


def assign(data: dict[str, Any], path: Path, value: Any) -> Path:
    """Set ``path`` of the parsed scene ``data`` to ``value``, in place, creating tables as needed.

    Numbers index arrays. Returns the path with those numbers as int. Raises OverrideError if there is no such path.
    """
    node: Any = data
    taken: Path = ()
    for n, part in enumerate(path):
        last = n == len(path) - 1
        if isinstance(node, list):
            try:
                index = int(part)
                node[index]
                if index < 0:
                    raise IndexError
            except (ValueError, IndexError):
                raise OverrideError(
                    f"{dotted(taken)} has no item {part!r}",
                    f"it is an array of {len(node)}: use 0 to {len(node) - 1}" if node else "it is empty",
                ) from None
            taken += (index,)
            if last:
                node[index] = value
            else:
                node = node[index]
        elif isinstance(node, dict):
            taken += (part,)
            if last:
                node[part] = value
            else:
                node = node.setdefault(part, {})
        else:
            raise OverrideError(f"{dotted(taken)} is a value and has no key {part!r}", "change the value itself")
    return taken
