"""Expressions: what they give, and that nothing but arithmetic is understood."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geomech.sweep.expressions import ExpressionError, evaluate, margin_of, names_in

NAMES = {
    "a": 2.0, "b": None, "mechanism": "toppling", "first": {"initiation": {"load_pa": 5e6}},
    "history": {"load": np.array([1.0, 4.0, np.nan, 3.0])},
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a * 3 - 1", 5.0), ("2 ** 3", 8.0), ("-a", -2.0), ("7 // 2 + 7 % 2", 4.0), ("a < 3", True),
        ("1 < a < 2", False),
        ("mechanism == 'toppling' and a > 1", True), ("1 if a > 5 else 2", 2.0),
        ("first.initiation.load_pa / 1e6", 5.0),
        ("max(history.load)", 4.0), ("last(history.load) - first(history.load)", 2.0), ("mean(history.load)", 8 / 3),
        ("degrees(atan(1))", 45.0), ("max(a, 7)", 7.0), ("not a > 3", True), ("pi", math.pi),
    ],
)  # fmt: skip
def test_values(text, value):
    found = evaluate(text, NAMES)
    assert found == (pytest.approx(value) if isinstance(value, float) else value)


def test_what_is_not_there_is_nan():
    assert all(
        math.isnan(evaluate(text, NAMES)) for text in ("b", "first.coalescence.load_pa", "b + 1", "1 / 0", "log(-1)")
    )
    assert evaluate("b < 1", NAMES) is False


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')", "().__class__", "open('x')", "a.__class__.__mro__[0]", "[x for x in (1,)]",
        "lambda: 1",
        "'x' * 10**9", "exec('1')", "f'{a}'", "a := 3", "history", "nothing", "1 +", "max()", "max(*history)", "{}",
        "a[0]",
        "first", "9j", "-" * 100 + "1", "+".join(["1"] * 1500),
    ],
)  # fmt: skip
def test_anything_else_is_refused(text):
    with pytest.raises(ExpressionError):
        evaluate(text, NAMES)


def test_long_powers_end_at_once():
    """Whole numbers are floats: this would not end otherwise."""
    with pytest.raises(ExpressionError):
        evaluate("9 ** 9 ** 9 ** 9", NAMES)


def test_names_and_margins():
    assert names_in("max(a.b, c) + pi * d") == {"a.b", "c", "d"}
    assert margin_of("factor_of_safety < 1.3") == "(factor_of_safety) - (1.3)"
    assert evaluate(margin_of("a > 1"), {"a": 3.0}) == -2.0
    for text in ("a", "a == 1", "0 < a < 1"):
        with pytest.raises(ExpressionError, match="not a comparison"):
            margin_of(text)
