"""Errors of a scene, reported all at once."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple


class Fault(NamedTuple):
    """``place``: file, line and dotted key; ``message``: the error; ``way_out``: the remedy."""

    place: str
    message: str
    way_out: str

    def __str__(self) -> str:
        return f"{self.place}\n    {self.message}" + (f"\n    → {self.way_out}" if self.way_out else "")


#: Names in quotes and numbers, in which two warnings of one cause differ.
_OWN = re.compile(r"'[^']*'|[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
#: Number of other names given.
_NAMED = 3


def one_a_cause(warnings: Sequence[Fault]) -> list[Fault]:
    """``warnings`` with the same place and remedy that differ only in names and numbers, merged into the first one,
    with the number of the others and some of their names."""
    kinds: dict[tuple[str, str, str], list[Fault]] = {}
    for warning in dict.fromkeys(warnings):
        kinds.setdefault((warning.place, _OWN.sub("#", warning.message), warning.way_out), []).append(warning)
    out = []
    for first, *others in kinds.values():
        if others:
            names = [found for other in others if (found := _first_name(other.message)) != _first_name(first.message)]
            shown = ", ".join(dict.fromkeys(filter(None, names[:_NAMED])))
            more = f": {shown}{', …' if len(names) > _NAMED else ''}" if shown else ""
            first = first._replace(message=f"{first.message} (and {len(others)} more like it{more})")
        out.append(first)
    return out


def _first_name(message: str) -> str:
    found = re.search(r"'[^']*'", message)
    return found[0] if found else ""


class SceneError(ValueError):
    """A scene that cannot be run: ``errors`` is a list of `Fault` (place, message, way out), in file order."""

    def __init__(self, errors: list[Fault]) -> None:
        self.errors = list(errors)
        super().__init__("\n".join(str(error) for error in self.errors))
