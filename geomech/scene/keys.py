"""Keys of a scene: their types and descriptions, for listings and error messages."""

from __future__ import annotations

import types
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from .tables import SceneTables
from .tables.entries import Finite, Four, NotNegative, Pair, Points, Positive

_SHAPES = {
    Pair: "[x, y]",
    Four: "[x0, y0, x1, y1]",
    Points: "[[x, y], …]",
    Positive: "number > 0",
    NotNegative: "number ≥ 0",
    Finite: "number",
}
_SIMPLE = {float: "number", int: "whole number", str: "text", bool: "true or false", Any: "any value"}


def bare(annotation: Any) -> Any:
    """``annotation`` without Annotated and without "or None"."""
    while True:
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
        elif get_origin(annotation) in (Union, types.UnionType) and type(None) in get_args(annotation):
            (annotation,) = [a for a in get_args(annotation) if a is not type(None)][:1]
        else:
            return annotation


def kind_of(annotation: Any) -> tuple[str, Any]:
    """("table", its class), ("map", type of its values), ("list", type of its items) or ("value", the type)."""
    inner = bare(annotation)
    if isinstance(inner, type) and issubclass(inner, BaseModel):
        return "table", inner
    if get_origin(inner) is dict:
        return "map", get_args(inner)[1]
    if get_origin(inner) is tuple and get_args(inner)[-1] is Ellipsis:
        return "list", get_args(inner)[0]
    return "value", inner


def table_at(path: tuple[str | int, ...]) -> type[BaseModel] | None:
    """The table class at ``path`` of a scene; None if there is a value or nothing."""
    kind, what = "table", SceneTables
    for part in path:
        if kind == "table":
            field = field_of(what, part)
            if field is None:
                return None
            kind, what = kind_of(field.annotation)
        elif kind in ("map", "list"):
            kind, what = kind_of(what)
        else:
            return None
    return what if kind == "table" else None


def keys_of(table: type[BaseModel]) -> list[str]:
    """The keys of ``table`` as written in a scene."""
    return [field.alias or name for name, field in table.model_fields.items()]


def field_of(table: type[BaseModel], key: str | int) -> FieldInfo | None:
    """The field of ``table`` with this key; None if it has none."""
    return next((f for name, f in table.model_fields.items() if key in (name, f.alias)), None)


def places_of_keys() -> dict[str, list[str]]:
    """Key → its dotted places, such as "run.end_time_s", "materials.NAME.density_kg_m3" or "loads.tractions[].edge";
    without variants, which may hold any of them."""
    found: dict[str, list[str]] = {}

    def walk(table: type[BaseModel], prefix: str) -> None:
        for name, field in table.model_fields.items():
            key = field.alias or name
            found.setdefault(key, []).append(prefix + key)
            kind, what = kind_of(field.annotation)
            inner_kind, inner = kind_of(what) if kind in ("map", "list") else (kind, what)
            if inner_kind == "table" and key != "variants":
                walk(inner, prefix + key + {"table": ".", "map": ".NAME.", "list": "[]."}[kind])

    walk(SceneTables, "")
    return found


def description_at(path: tuple[str | int, ...]) -> str:
    """Description of the key at ``path``, or of the nearest one above it that has one."""
    for n in range(len(path), 0, -1):
        table = table_at(path[: n - 1])
        field = field_of(table, path[n - 1]) if table else None
        if field is not None and field.description:
            return field.description
    return ""


def expected(annotation: Any) -> str:
    """Admissible values of a key of this type."""
    if get_origin(annotation) in (Union, types.UnionType):
        left = [a for a in get_args(annotation) if a is not type(None)]
        return " or ".join(expected(a) for a in left)
    for known, text in _SHAPES.items():
        if annotation == known:
            return text
    inner = bare(annotation)
    if isinstance(inner, type) and issubclass(inner, BaseModel):
        needed = [field.alias or name for name, field in inner.model_fields.items() if field.is_required()]
        return f"{{ {', '.join([*(f'{key} = …' for key in needed), '…'])} }}"
    for known, text in _SHAPES.items():
        # Field keeps the metadata of an Annotated type apart, so that the rest is compared as well.
        if inner == bare(known) and inner not in _SIMPLE:
            return text
    if get_origin(inner) is Literal:
        return " | ".join(f'"{choice}"' for choice in get_args(inner))
    if get_origin(inner) is tuple:
        items = get_args(inner)
        if items[-1] is Ellipsis:
            return f"[{expected(items[0])}, …]"
        return f"[{', '.join(expected(item) for item in items)}]"
    return _SIMPLE.get(inner, getattr(inner, "__name__", str(inner)))


def expected_of(field: FieldInfo) -> str:
    """Admissible values of ``field``, including its bounds."""
    text = expected(field.annotation)
    if text in ("number", "whole number"):
        bounds = [
            f" {sign} {getattr(entry, bound):g}"
            for bound, sign in (("gt", ">"), ("ge", "≥"), ("lt", "<"), ("le", "≤"))
            for entry in field.metadata
            if getattr(entry, bound, None) is not None
        ]
        text += " and".join(bounds)
    return text


def describe_keys() -> str:
    """Every key of a scene, one per line: name, admissible values, default, description."""
    lines: list[str] = []
    _describe(SceneTables, "", lines)
    return "\n".join(lines).strip() + "\n"


def schema() -> dict[str, Any]:
    """JSON schema (2020-12) of a scene: keys, types, bounds, defaults and descriptions. TOML has no null."""
    whole = _without_null(SceneTables.model_json_schema(by_alias=True))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A scene of geomech",
        **{key: value for key, value in whole.items() if key != "title"},
    }


def _without_null(node: Any, names: bool = False) -> Any:
    """``node`` of a schema without nulls and without pydantic's titles; ``names``: its keys are names from the
    scene."""
    if isinstance(node, list):
        return [_without_null(entry) for entry in node if entry != {"type": "null"}]
    if not isinstance(node, dict):
        return node
    out = {
        key: _without_null(value, key in ("properties", "$defs") and not names)
        for key, value in node.items()
        if names or not (key == "title" or (key == "default" and value is None))
    }
    if not names and len(out.get("anyOf", ())) == 1:
        (only,) = out.pop("anyOf")
        out = {**only, **out}
    return out


def _describe(table: type[BaseModel], prefix: str, lines: list[str]) -> None:
    later = []
    for name, field in table.model_fields.items():
        key = field.alias or name
        kind, what = kind_of(field.annotation)
        inner_kind, inner = kind_of(what) if kind in ("map", "list") else (kind, what)
        if inner_kind == "table":
            path = f"{prefix}{key}"
            shown = {"table": f"[{path}]", "list": f"[[{path}]]", "map": f"[{path}.NAME]"}[kind]
            later.append((inner, path + (".NAME." if kind == "map" else "."), shown, field.description))
            continue
        if field.is_required():
            default = "required"
        elif field.default is None or field.default is PydanticUndefined:
            default = "unset"
        else:
            default = f"default {written(field.default)}"
        what = expected_of(field) if kind != "map" else "table"
        lines.append(f"  {key} = {what}  ({default})\n      {field.description}")
    for inner, path, shown, description in later:
        lines.append(f"\n{shown}  {description}")
        _describe(inner, path, lines)


def written(value: Any) -> str:
    """``value`` in TOML syntax."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(written(v) for v in value)}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{k} = {written(v)}' for k, v in value.items())} }}" if value else "{}"
    return f"{value:g}" if isinstance(value, float) else str(value)
