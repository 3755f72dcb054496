"""Expressions of a sweep: results from columns of a run, keys of a scene from variables.

The syntax is Python's, restricted to arithmetic, comparisons, conditions and a few functions: no attributes of objects,
no imports, and only the given names. ``first.initiation.load_pa`` is looked up through nested tables; missing entries
are nan. Whole numbers are treated as floats, so that no power takes long.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

_BINARY = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Pow: operator.pow,
}  # fmt: skip
_COMPARED = {
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}  # fmt: skip


def _reduced(function: Callable) -> Callable:
    """``function`` of one array without its nan, or of several numbers."""

    def reduce(*values: Any) -> float:
        found = np.concatenate([np.atleast_1d(np.asarray(value, dtype=float)) for value in values])
        found = found[~np.isnan(found)]
        return float(function(found)) if len(found) else math.nan

    return reduce


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "min": _reduced(np.min), "max": _reduced(np.max), "mean": _reduced(np.mean), "sum": _reduced(np.sum),
    "first": _reduced(lambda values: values[0]), "last": _reduced(lambda values: values[-1]),
    "abs": np.abs, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "log10": np.log10,
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "atan2": np.arctan2, "hypot": np.hypot, "degrees": np.degrees, "radians": np.radians,
}  # fmt: skip
CONSTANTS = {"pi": math.pi, "e": math.e, "inf": math.inf, "nan": math.nan, "true": True, "false": False}
_LONGEST, _DEEPEST = 2000, 40


class ExpressionError(ValueError):
    """An invalid expression, or one with operations that are not permitted."""


@lru_cache(maxsize=4096)
def parsed(text: str) -> ast.expr:
    """The expression ``text``. Raises ExpressionError that names what is not allowed."""
    if len(text) > _LONGEST:
        raise ExpressionError(f"the expression has {len(text)} characters; at most {_LONGEST} are permitted")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ExpressionError(f"{text!r} is not a valid expression: {getattr(error, 'msg', error)}") from error
    _check(tree, text, 0)
    return tree


def names_in(text: str) -> set[str]:
    """The names used in an expression, without functions and constants; dotted names are given in full."""
    found: set[str] = set()

    def walk(node: ast.AST) -> None:
        if isinstance(node, (ast.Attribute, ast.Name)):
            found.add(_dotted(node))
        elif isinstance(node, ast.Call):
            for argument in node.args:
                walk(argument)
        else:
            for child in ast.iter_child_nodes(node):
                walk(child)

    walk(parsed(text))
    return {name for name in found if name not in CONSTANTS}


def evaluate(text: str, names: Mapping[str, Any]) -> Any:
    """The value of the expression ``text`` with these ``names``, which may include tables: a float, True or False, or a
    string. Raises ExpressionError."""
    with np.errstate(all="ignore"):
        try:
            found = _value(parsed(text), names)
        except ExpressionError:
            raise
        except ZeroDivisionError:
            return math.nan
        except (ArithmeticError, TypeError, ValueError) as error:
            raise ExpressionError(f"{text!r}: {error}") from error
    if isinstance(found, np.ndarray) and found.ndim:
        raise ExpressionError(f"{text!r} is a series, not a number: take its max, min, mean, first or last")
    if isinstance(found, (str, bool, np.bool_)):
        return found if isinstance(found, str) else bool(found)
    if isinstance(found, Mapping):
        raise ExpressionError(
            f"{text!r} is a table, not a number: its entries are {', '.join(map(str, list(found)[:8]))}"
        )
    return float(found)


def margin_of(text: str) -> str:
    """The expression that is negative where the comparison ``text`` is true: "a < 1" gives "(a) - (1)". Raises
    ExpressionError if it is not a single comparison of two numbers."""
    node = parsed(text)
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        left, right = ast.unparse(node.left), ast.unparse(node.comparators[0])
        if isinstance(node.ops[0], (ast.Lt, ast.LtE)):
            return f"({left}) - ({right})"
        if isinstance(node.ops[0], (ast.Gt, ast.GtE)):
            return f"({right}) - ({left})"
    raise ExpressionError(f"{text!r} is not a comparison of two numbers, such as factor_of_safety < 1")


def _check(node: ast.AST, text: str, depth: int) -> None:
    if depth > _DEEPEST:
        raise ExpressionError(f"{text!r} is nested deeper than {_DEEPEST}")
    if isinstance(node, ast.Call):
        name = node.func.id if isinstance(node.func, ast.Name) else ast.unparse(node.func)
        if name not in FUNCTIONS or node.keywords or any(isinstance(each, ast.Starred) for each in node.args):
            raise ExpressionError(f"{text!r} calls {name}, which is not available; there are {', '.join(FUNCTIONS)}")
        if not node.args:
            raise ExpressionError(f"{text!r}: {name} needs an argument")
        children = node.args
    elif isinstance(node, ast.Attribute):
        _dotted(node)
        return
    elif isinstance(node, ast.Constant):
        if not isinstance(node.value, (int, float, str, bool)) or isinstance(node.value, complex):
            raise ExpressionError(f"{text!r}: {node.value!r} is neither a number nor a string")
        return
    elif isinstance(node, (ast.BinOp, ast.UnaryOp, ast.Compare, ast.BoolOp, ast.IfExp, ast.Name)):
        operators = [getattr(node, "op", None), *getattr(node, "ops", [])]
        known = (*_BINARY, *_COMPARED, ast.UAdd, ast.USub, ast.Not, ast.And, ast.Or)
        unknown = [each for each in operators if each is not None and not isinstance(each, known)]
        if unknown:
            raise ExpressionError(f"{text!r}: {type(unknown[0]).__name__} is not permitted")
        children = [each for each in ast.iter_child_nodes(node) if isinstance(each, ast.expr)]
    else:
        raise ExpressionError(f"{text!r}: {type(node).__name__} is not permitted, only arithmetic and comparisons are")
    for child in children:
        _check(child, text, depth + 1)


def _dotted(node: ast.AST) -> str:
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        return f"{_dotted(node.value)}.{node.attr}"
    raise ExpressionError(f"{ast.unparse(node)!r}: a name is required before a dot")


def _value(node: ast.AST, names: Mapping[str, Any]) -> Any:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, (str, bool)) else _number(node.value)
    if isinstance(node, (ast.Name, ast.Attribute)):
        return _looked_up(_dotted(node), names)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return FUNCTIONS[node.func.id](*(_value(each, names) for each in node.args))
    if isinstance(node, ast.BinOp):
        left, right = (_number(_value(each, names)) for each in (node.left, node.right))
        found = _BINARY[type(node.op)](left, right)
        return math.nan if isinstance(found, complex) else found
    if isinstance(node, ast.UnaryOp):
        found = _value(node.operand, names)
        return (
            not found if isinstance(node.op, ast.Not) else -_number(found) if isinstance(node.op, ast.USub) else found
        )
    if isinstance(node, ast.BoolOp):
        wanted = isinstance(node.op, ast.And)
        values = (bool(_value(each, names)) for each in node.values)
        return all(values) if wanted else any(values)
    if isinstance(node, ast.IfExp):
        return _value(node.body if _value(node.test, names) else node.orelse, names)
    assert isinstance(node, ast.Compare)  # nothing else has passed `_check`
    left = _value(node.left, names)
    for each, other in zip(node.ops, node.comparators, strict=True):
        right = _value(other, names)
        if not _COMPARED[type(each)](left, right):
            return False
        left = right
    return True


def _number(value: Any) -> Any:
    """A float or an array of floats: products of strings and of long integers are not computed."""
    if isinstance(value, (str, Mapping)):
        raise ExpressionError(f"{str(value)[:40]!r} is not a number")
    return value if isinstance(value, np.ndarray) else float(value)


def _looked_up(name: str, names: Mapping[str, Any]) -> Any:
    """The value of a name, which may be present as a whole or lead through tables; nan if it is missing or None."""
    if name in names:
        found = names[name]
        return math.nan if found is None else found
    if name in CONSTANTS:
        return CONSTANTS[name]
    head, *rest = name.split(".")
    if not rest and head not in names:
        raise ExpressionError(f"there is no {name!r}; there are {', '.join(list(names)[:30])}")
    node: Any = names.get(head)
    for part in rest:
        node = node.get(part) if isinstance(node, Mapping) else None
    return math.nan if node is None else node
