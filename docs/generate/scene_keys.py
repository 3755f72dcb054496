"""The page of all keys of a scene, from the tables that check scenes."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic_core import PydanticUndefined

from geomech.scene.keys import expected_of, kind_of, written
from geomech.scene.tables import SceneTables

OPENING = """# Keys of a scene

This page is made from the tables that check scenes and therefore lists all keys. `geomech check SCENE --keys`
prints
the same. A scene is a TOML file in SI units; angles are in degrees, and the unit is part of the key's name. Paths are
relative to
the scene file. TOML has no null: a key that is absent is unset. Unknown keys, missing values and values out of range
are
all reported before anything runs, each with its line and a remedy.

`[table]` contains keys. `[[table]]` may be repeated, once for each item. `NAME` is a name that you choose. Any key
can be
changed on the command line: `--set dda.time_step_s=0.01`, `--set materials.rock.density_kg_m3=2500`,
`--set geometry.cracks.0.angle_deg=30` (items count from 0).
"""


def page() -> str:
    """The page as MyST Markdown."""
    return OPENING + "\n" + "\n".join(_table(SceneTables, "", "The scene itself", "")) + "\n"


def _table(table, prefix: str, header: str, description: str) -> Iterator[str]:
    later = []
    level = "##" if header.count(".") == 0 else "###"
    yield f"{level} {header}\n"
    if description:
        yield description[0].upper() + description[1:] + ".\n"
    for name, field in table.model_fields.items():
        key = field.alias or name
        kind, what = kind_of(field.annotation)
        inner_kind, inner = kind_of(what) if kind in ("map", "list") else (kind, what)
        if inner_kind == "table":
            path = f"{prefix}{key}"
            shown = {"table": f"[{path}]", "list": f"[[{path}]]", "map": f"[{path}.NAME]"}[kind]
            later.append((inner, path + (".NAME." if kind == "map" else "."), f"`{shown}`", field.description))
            continue
        if field.is_required():
            default = "**required**"
        elif field.default is None or field.default is PydanticUndefined:
            default = "unset"
        else:
            default = f"default `{written(field.default)}`"
        expected = expected_of(field) if kind != "map" else "table"
        yield f"`{key}` = {_literal(expected)} · {default}\n:   {_escaped(field.description)}\n"
    for inner, path, shown, what in later:
        yield from _table(inner, path, shown, what)


def _literal(text: str) -> str:
    return f"`{text}`" if any(sign in text for sign in '"[{') else text.replace("<", r"\<").replace(">", r"\>")


def _escaped(text: str) -> str:
    """Signs that Markdown would read, outside code."""
    parts = text.split("`")
    outside = [
        part.replace("*", r"\*").replace("[", r"\[").replace("<", r"\<").replace("$", r"\$") for part in parts[::2]
    ]
    both = [outside[k // 2] if k % 2 == 0 else f"`{parts[k]}`" for k in range(len(parts))]
    return "".join(both)
