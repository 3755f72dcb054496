"""Parameters of a Gmsh model: read from its side panel, checked against their ranges and choices, set."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from pathlib import Path

from .model_drawing import GmshModelError, Parameter
from .session import open_model


def open_with_parameters(gmsh, path: Path, wanted: Mapping[str, float | str]) -> dict[str, Parameter]:
    """Open the model with ``wanted`` set; returns all its parameters as used, by short name.

    Known parameters are set and the model is read again, until the others are known too: a parameter may appear with
    another's value.
    """
    known = _opened(gmsh, path)
    waiting = dict(wanted)
    while waiting:
        found = {name: _entry(name, known) for name in waiting}
        ready = {name: entry for name, entry in found.items() if entry is not None}
        if not ready:
            name = next(iter(waiting))
            close = difflib.get_close_matches(name, known, 1)
            listed = ", ".join(known) or "none"
            raise GmshModelError(
                f"{path.name} has no parameter {name!r}",
                (f"did you mean {close[0]!r}? " if close else "") + f"its parameters are {listed}",
                parameter=name,
            )
        for name, entry in ready.items():
            value = _value(path, name, waiting.pop(name), entry)
            if isinstance(value, str):
                gmsh.onelab.setString(entry.path, [value])
            else:
                gmsh.onelab.setNumber(entry.path, [value])
        known = _opened(gmsh, path)
    return known


def _opened(gmsh, path: Path) -> dict[str, Parameter]:
    """(Re)read the model; its parameters by short name (by the full one if another has the short one)."""
    open_model(gmsh, path)
    found = {}
    for name in gmsh.onelab.getNames():
        about = json.loads(gmsh.onelab.get(name))
        if about.get("readOnly") or name.split("/")[0] in ("Gmsh", "ONELAB") or not about.get("values"):
            continue
        low, high = about.get("min", -1e200), about.get("max", 1e200)
        entry = Parameter(
            path=name,
            value=about["values"][0],
            minimum=low if low > -1e199 else None,
            maximum=high if high < 1e199 else None,
            choices=about.get("valueLabels", {}),
        )
        short = name.rsplit("/", 1)[-1]
        found[name if short in found else short] = entry
    return found


def _entry(name: str, known: dict[str, Parameter]) -> Parameter | None:
    return known.get(name) or next((entry for entry in known.values() if entry.path == name), None)


def _value(path: Path, name: str, value: float | str, entry: Parameter) -> float | str:
    """``value`` as the model takes it: choices by name, the right type, inside the range."""

    def refuse(message: str, way_out: str):
        raise GmshModelError(f"parameter {name!r} of {path.name}: {message}", way_out, parameter=name)

    if isinstance(entry.value, str):
        return value if isinstance(value, str) else refuse(f"{value!r} is not a string", "put it in quotes")
    if isinstance(value, bool):
        value = float(value)
    if isinstance(value, str):
        if value in entry.choices:
            return float(entry.choices[value])
        listed = ", ".join(f'"{c}"' for c in entry.choices)
        return refuse(f"{value!r} is not a number", f"choose one of {listed}" if listed else "give a number")
    if entry.choices and value not in entry.choices.values():
        listed = ", ".join(f'{v:g} ("{c}")' for c, v in entry.choices.items())
        return refuse(f"{value:g} is not among its choices", f"choose one of {listed}")
    low, high = entry.minimum, entry.maximum
    if (low is not None and value < low) or (high is not None and value > high):
        span = f"[{'-inf' if low is None else format(low, 'g')}, {'inf' if high is None else format(high, 'g')}]"
        return refuse(f"{value:g} is outside its range {span}", "choose a value inside")
    return float(value)
