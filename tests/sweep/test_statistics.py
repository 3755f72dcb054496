"""Statistics against tables and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from geomech.sweep.sampling import Design, run_table
from geomech.sweep.statistics import convergence, distribution, picked, probability, sensitivities, tornado, wilson
from geomech.sweep.variables import variable


def row(k: int, fails: bool | None = False, **more):
    return {"run": k, "status": "failed" if fails is None else "done", "fails": fails, "reason": "", **more}


def test_wilson_interval_is_that_of_scipy():
    for successes, trials in ((0, 10), (3, 40), (32, 500), (10, 10)):
        found = stats.binomtest(successes, trials).proportion_ci(0.95, "wilson")
        assert wilson(successes, trials) == pytest.approx((found.low, found.high), abs=1e-12)
    assert wilson(0, 0) == (0.0, 1.0)


def test_runs_without_an_answer_are_no_successes():
    found = probability([row(0, True), row(1), row(2), row(3, None), row(4, None)])
    assert (found.failures, found.answered, found.runs) == (1, 3, 5)
    assert found.value == pytest.approx(1 / 3)
    assert (found.least, found.most) == (pytest.approx(0.2), pytest.approx(0.6))
    assert "2 runs without a result" in str(found) and "fewer than 10 failed" in str(found)
    assert "none of 1 runs has a result" in str(probability([row(0, None)]))


def test_convergence_ends_with_the_probability():
    rows = [row(k, k % 7 == 0) for k in range(50)]
    found = convergence(rows)
    assert found.shape == (50, 4)
    assert found[-1, 1:] == pytest.approx([probability(rows).value, *wilson(8, 50)])


def test_the_band_holds_the_distribution_as_often_as_it_says():
    """Of 400 samples of 50 the band of Dvoretzky, Kiefer & Wolfowitz leaves the true distribution in at most 5 %
    (and a binomial error, 3.3 standard deviations)."""
    rng, missed = np.random.default_rng(0), 0
    for _ in range(400):
        values, _, half = distribution(rng.standard_normal(50))
        true = stats.norm.cdf(values)
        ends = np.arange(51) / 50
        missed += bool(np.maximum(ends[1:] - true, true - ends[:-1]).max() > half)
    assert missed / 400 < 0.05 + 3.3 * math.sqrt(0.05 * 0.95 / 400)


def _table(sampling: str, runs: int):
    variables = tuple(variable(name, "uniform(0, 1)") for name in ("a", "b", "c"))
    table = run_table(variables, Design(sampling, runs, 1))
    return variables, [
        row(k, False, **values, y=4 * values["a"] + 2 * values["b"] + 0.0 * values["c"])
        for k, values in enumerate(table)
    ]


@pytest.mark.parametrize(("sampling", "runs", "within"), [("saltelli", 2560, 0.04), ("sobol", 1024, 0.05)])
def test_sensitivities_of_a_linear_response(sampling, runs, within):
    """Of y = 4 a + 2 b, a, b, c uniform, the shares of the variance are 16/20, 4/20, 0. SALib's estimates scatter as
    1/√n."""
    pytest.importorskip("SALib")
    variables, rows = _table(sampling, runs)
    found = sensitivities(rows, variables, "y", sampling)
    assert [each.first for each in found] == pytest.approx([0.8, 0.2, 0.0], abs=within)
    if sampling == "saltelli":
        assert [each.total for each in found] == pytest.approx([0.8, 0.2, 0.0], abs=within)


def test_tornado_orders_variables_by_their_swing():
    """The means of a uniform variable's lowest and highest fifth lie 0.8 apart: 4·0.8 and 2·0.8."""
    _, rows = _table("sobol", 1024)
    found = tornado(rows, ["b", "c", "a"], "y")
    assert [each.name for each in found] == ["a", "b", "c"]
    assert [each.size for each in found] == pytest.approx([3.2, 1.6, 0.0], abs=0.03)


def test_picked_runs():
    rows = [row(k, factor=float((7 * k) % 11), mechanism="toppling" if k % 3 else "sliding") for k in range(11)]
    found = picked(rows, "factor")
    by_run = {each["run"]: each for each in rows}
    assert by_run[found["worst"]]["factor"] == 0.0
    assert by_run[found["median"]]["factor"] == 5.0
    assert by_run[found["typical"]]["mechanism"] == "toppling"
    assert picked([row(0, None)], "factor") == {}
