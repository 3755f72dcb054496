"""Variables as they are written, their distributions against closed forms and SciPy, and tables of runs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from geomech.sweep.sampling import Design, correlation_matrix, run_table, samples
from geomech.sweep.variables import Listed, Random, VariableError, variable


@pytest.mark.parametrize(
    ("written", "values"),
    [
        ("20:40:5", (20, 25, 30, 35, 40)),
        ("40:20:-10", (40, 30, 20)),
        ("1:3", (1, 2, 3)),
        ("0.1:0.5:0.1", (0.1, 0.2, 0.3, 0.4, 0.5)),
        ("log(1e3, 1e6, 4)", (1e3, 1e4, 1e5, 1e6)),
        ("10, 20.5", (10, 20.5)),
        ([3, 1], (3, 1)),
        (["penalty", "augmented"], ("penalty", "augmented")),
        ("true,false", (True, False)),
        (7.5, (7.5,)),
    ],
)
def test_lists_and_ranges(written, values):
    found = variable("a.b", written)
    assert found == Listed("a.b", values)
    assert [type(each) for each in found.values] == [type(each) for each in values]


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("40:20:5", "is empty"), ("20:40:0", "is empty"), ("", "no values"), ([], "no values"), ("3, 3", "twice"),
        ("normal(3)", "1 numbers"), ("normal(3", "not a distribution"), ("gauss(3, 1)", "no distribution"),
        ("normal(3, 0)", "not > 0"), ("uniform(3, 3)", "no value lies"), ("triangular(1, 5, 3)", "most likely"),
        ("normal(0, 1, 60, 70)", "is zero"), ("lognormal(-1, 2)", "numbers > 0"), ("log(0, 3, 2)",
        "not a logarithmic"),
        ({"law": "normal", "mean": 3}, "'deviation'"), ({"law": "normal", "mean": 3, "sd": 1}, "'sd'"),
        ({"law": "beta", "low": 0, "high": 1, "alpha": "x", "beta": 1}, "numbers"), ("normal(nan, 1)", "numbers"),
    ],
)  # fmt: skip
def test_what_is_no_variable_is_refused(written, said):
    with pytest.raises(VariableError, match=said):
        variable("a.b", written)


LAWS = {
    "normal(35, 5)": stats.norm(35, 5),
    "normal(35, 5, 30, 60)": stats.truncnorm(-1, 5, 35, 5),
    "uniform(20, 40)": stats.uniform(20, 20),
    "triangular(20, 25, 40)": stats.triang(0.25, 20, 20),
    "beta(1, 3, 2, 5)": stats.beta(2, 5, 1, 2),
    "exponential(0.5)": stats.expon(scale=0.5),
    "exponential(0.5, 0, 1)": stats.truncexpon(2.0, scale=0.5),
}


@pytest.mark.parametrize("written", LAWS)
def test_quantiles_are_those_of_the_distribution(written):
    shares = np.array([1e-9, 1e-3, 0.2, 0.5, 0.9, 1 - 1e-6])
    assert variable("a", written).quantile(shares) == pytest.approx(LAWS[written].ppf(shares), rel=1e-9)


def test_lognormal_has_the_mean_and_deviation_asked_for():
    found = variable("a", "lognormal(1e5, 3e4)").quantile((np.arange(100_000) + 0.5) / 100_000)
    # The midpoints of 1e5 slices leave out 1e-4 of the variance, in the upper tail.
    assert found.mean() == pytest.approx(1e5, rel=1e-4)
    assert found.std() == pytest.approx(3e4, rel=2e-3)


def test_a_table_is_the_same_as_a_text():
    table = {"law": "normal", "mean": 35, "deviation": 5, "low": 15, "high": 60}
    assert variable("a", table) == variable("a", "normal(35, 5, 15, 60)")
    assert isinstance(variable("a", table), Random)


def test_probability_outside_bounds():
    assert variable("a", "normal(0, 1)").outside(-1.0, math.inf) == pytest.approx(stats.norm.cdf(-1))
    assert variable("a", "normal(0, 1, -1, 2)").outside(-1.0, 2.0) == 0.0
    cut = stats.truncnorm(-1, 2)
    assert variable("a", "normal(0, 1, -1, 2)").outside(0.0, 1.0) == pytest.approx(cut.cdf(0) + cut.sf(1))


@pytest.mark.parametrize("sampling", ["monte carlo", "latin hypercube", "sobol"])
def test_samples_have_the_distribution_and_follow_the_seed(sampling):
    variables = (variable("a", "normal(35, 5)"), variable("b", "uniform(0, 1)"))
    found = samples(variables, Design(sampling, 512, 3))
    assert found.shape == (512, 2)
    # Kolmogorov & Smirnov: a fixed seed, at the 0.1 % level.
    for column, law in zip(found.T, (stats.norm(35, 5), stats.uniform()), strict=True):
        assert stats.kstest(column, law.cdf).pvalue > 1e-3
    assert np.array_equal(found, samples(variables, Design(sampling, 512, 3)))
    assert not np.array_equal(found, samples(variables, Design(sampling, 512, 4)))


def test_latin_hypercube_has_one_sample_in_every_slice():
    found = Design("latin hypercube", 100, 0).unit_points(3)
    assert all(sorted((column * 100).astype(int)) == list(range(100)) for column in found.T)


def test_more_samples_of_monte_carlo_keep_the_first():
    short, long = (Design("monte carlo", n, 5).unit_points(3) for n in (10, 40))
    assert np.array_equal(short, long[:10])


def test_correlated_variables_keep_their_own_distributions():
    variables = (variable("a", "normal(35, 5)"), variable("b", "lognormal(1e5, 3e4)"))
    found = samples(variables, Design("monte carlo", 20_000, 1, (("a", "b", -0.5),)))
    # Of the underlying normal variables; a correlation of 20 000 samples is known to 1/√n.
    assert np.corrcoef(found[:, 0], np.log(found[:, 1]))[0, 1] == pytest.approx(-0.5, abs=3.3 / math.sqrt(20_000))
    assert stats.kstest(found[:, 0], stats.norm(35, 5).cdf).pvalue > 1e-3
    spread = math.sqrt(math.log(1.09))
    assert stats.kstest(found[:, 1], stats.lognorm(spread, scale=1e5 / math.sqrt(1.09)).cdf).pvalue > 1e-3


def test_correlations_that_contradict_one_another_are_refused():
    with pytest.raises(ValueError, match="contradict"):
        correlation_matrix(["a", "b", "c"], [("a", "b", 0.9), ("b", "c", 0.9), ("a", "c", -0.9)])


def test_the_table_has_all_combinations_and_seeds():
    variables = (variable("a", "1,2"), variable("b", "uniform(0, 1)"), variable("c", "5,6,7"))
    table = run_table(variables, Design(runs=4), [10, 11, 12, 13])
    assert len(table) == 2 * 3 * 4
    assert [tuple(row) for row in table[:1]] == [("a", "b", "c", "seed")]
    # Every combination of listed values sees the same samples, and each sample its own seed.
    assert {(row["a"], row["c"]) for row in table} == {(a, c) for a in (1, 2) for c in (5, 6, 7)}
    assert len({(row["b"], row["seed"]) for row in table}) == 4
    assert run_table((), Design(), [3, 4]) == [{"seed": 3}, {"seed": 4}]
    assert run_table(variables[:1], Design()) == [{"a": 1}, {"a": 2}]


def test_saltelli_design_changes_one_column_at_a_time():
    points = Design("saltelli", 50, 0).unit_points(3)
    assert len(points) == 50
    for group in points.reshape(10, 5, 3):
        first, *mixed, second = group
        for k, row in enumerate(mixed):
            assert row[k] == second[k]
            assert np.array_equal(np.delete(row, k), np.delete(first, k))
