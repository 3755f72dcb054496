"""The search for a zero in few evaluations."""

import math

import pytest

from geomech.coupling.growth.root_finding import Crossing


def sought(function, start, slope, tolerance=1e-6, most=40):
    """Zero and number of evaluations."""
    search = Crossing(slope)
    search.add(start, function(start))
    for count in range(1, most):
        at = search.next
        value = function(at)
        if abs(value) <= tolerance:
            return at, count
        search.add(at, value)
    raise AssertionError("not found")


def test_a_line_takes_one_evaluation_with_its_slope_and_two_without():
    assert sought(lambda x: 3 * x - 1, 0.0, 3.0) == (pytest.approx(1 / 3), 1)
    assert sought(lambda x: 3 * x - 1, 0.0, 1.0) == (pytest.approx(1 / 3), 2)


@pytest.mark.parametrize("start", [0.1, 1.5])
@pytest.mark.parametrize(
    ("function", "zero"),
    [
        (lambda x: x**3 - 1, 1.0),
        (lambda x: math.expm1(2 * (x - 1)), 1.0),
        (lambda x: max(4 * (x - 1), 0.1 * (x - 1)), 1.0),
    ],
    ids=["cubic", "exponential", "kinked"],
)
def test_curves_are_enclosed_from_either_side(function, zero, start):
    at, count = sought(function, start, 4.0)
    assert at == pytest.approx(zero, abs=2e-5) and count < 25


def test_a_jump_is_closed_in_on():
    """No zero is there to be found: the interval closes in on the jump."""
    search = Crossing(1.0)
    for x in (0.0, 2.0):
        search.add(x, -1.0 if x < 1.3 else 3.0)
    for _ in range(50):
        x = search.next
        search.add(x, -1.0 if x < 1.3 else 3.0)
    assert search.width < 1e-9 and search.enclosed


def test_where_nothing_rises_there_is_no_zero_ahead():
    search = Crossing(0.0)
    search.add(1.0, -1.0)
    assert search.next == math.inf
    search.add(2.0, -1.5)
    assert search.next == math.inf and search.width == math.inf
