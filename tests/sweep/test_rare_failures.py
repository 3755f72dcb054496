"""Rare failures against closed forms: linear limit states (exact P_f), and the planar slide with normal strengths."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from geomech.reference.slopes.random_strengths import LOW_BETA, PlanarSlope
from geomech.sweep.rare_failures import design_point, importance_sampling, subset_simulation
from geomech.sweep.sampling import correlation_matrix, to_values
from geomech.sweep.variables import variable

COHESION, TANGENT, CORRELATION = (60e3, 9e3), (0.65, 0.05), -0.3
SLOPE = PlanarSlope()


def planar(points: np.ndarray) -> np.ndarray:
    """Factor of safety less 1 of the planar slide at standard normal points (n, 2)."""
    variables = (variable("c", f"normal{COHESION}"), variable("t", f"normal{TANGENT}"))
    matrix = correlation_matrix(["c", "t"], [("c", "t", CORRELATION)])
    return np.array([SLOPE.factor(c, math.atan(t)) - 1.0 for c, t in to_values(variables, points, matrix)])


@pytest.mark.parametrize("beta", [2.5, 3.5, 4.5])
def test_subset_simulation_is_right_in_the_mean_and_says_how_sure_it_is(beta):
    """Twenty seeds: their mean within three of its standard errors of the exact one, but for a bias of the order of
    the square of the coefficient of variation (Au & Beck 2001); intervals of 95 % hold it at least seventeen times
    (of twenty, less than that once in sixty times)."""
    exact = norm.sf(beta)
    found = [subset_simulation(lambda u: beta - 0.6 * u[:, 0] - 0.8 * u[:, 1], 2, 1000, seed) for seed in range(20)]
    values = np.array([each.value for each in found])
    variation = values.std(ddof=1) / exact
    assert values.mean() == pytest.approx(exact, rel=3 * variation / math.sqrt(20) + variation**2)
    assert sum(low <= exact <= high for low, high in (each.interval for each in found)) >= 17
    assert np.mean([each.variation for each in found]) == pytest.approx(variation, rel=0.5)
    # Plain Monte Carlo of the same variation takes (1 − P_f)/(P_f δ²) runs.
    assert np.mean([each.runs for each in found]) < (1 - exact) / (exact * variation**2)


def test_importance_sampling_finds_the_planar_slide():
    exact = SLOPE.probability(COHESION, TANGENT, CORRELATION)
    assert exact < 1e-3
    found = importance_sampling(planar, 2, 400, seed=2)
    assert found.beta == pytest.approx(norm.isf(exact), rel=1e-6)  # the margin is linear: β is exact
    assert found.value == pytest.approx(exact, rel=3.3 * found.variation)
    assert found.variation < 0.12 and found.runs < 450


def test_subset_simulation_finds_the_planar_slide_and_so_does_monte_carlo():
    exact = SLOPE.probability(COHESION, TANGENT, CORRELATION)
    found = subset_simulation(planar, 2, 600, seed=5)
    assert found.value == pytest.approx(exact, rel=3.3 * found.variation)
    # Plain samples of the same margin, a million: known to 1/√(n P_f).
    rng, slope = np.random.default_rng(0), SLOPE
    z = rng.standard_normal((1_000_000, 2)) @ np.linalg.cholesky([[1, CORRELATION], [CORRELATION, 1]]).T
    margin = slope.length * (COHESION[0] + COHESION[1] * z[:, 0]) + slope.pressing * (TANGENT[0] + TANGENT[1] * z[:, 1])
    share = float(np.mean(margin < slope.driving))
    assert share == pytest.approx(exact, rel=3.3 / math.sqrt(1e6 * exact))


def test_the_design_point_of_the_sau_mau_ping_slope_is_the_published_one():
    """Low (2007): β = 1.556, to the digits printed."""
    names = ("c", "phi", "z", "filled", "shaking")
    laws = (
        "normal(98.1e3, 19.62e3)",
        "normal(35, 5)",
        "normal(14, 3)",
        "exponential(0.5, 0, 1)",
        "exponential(0.08, 0, 0.16)",
    )
    variables = [variable(name, law) for name, law in zip(names, laws, strict=True)]

    def margin(points: np.ndarray) -> np.ndarray:
        rows = to_values(variables, points)
        return np.array([
            PlanarSlope(crack=z, water=filled * z, shaking=shaking).factor(c, math.radians(phi)) - 1.0
            for c, phi, z, filled, shaking in rows
        ])  # fmt: skip

    point, _ = design_point(margin, 5)
    assert np.linalg.norm(point) == pytest.approx(LOW_BETA, abs=5e-4)


def test_runs_without_an_answer_are_counted_and_stand():
    def broken(u: np.ndarray) -> np.ndarray:
        found = 2.0 - u[:, 0]
        found[u[:, 1] > 0] = np.nan
        return found

    found = subset_simulation(broken, 2, 1000, seed=1)
    assert found.unanswered > 300
    assert found.value == pytest.approx(0.5 * norm.sf(2.0), rel=4 * found.variation)
    assert "without a result" in str(found)
    with pytest.raises(ValueError, match="without a result"):
        importance_sampling(lambda u: np.full(len(u), np.nan), 2, 10)
    with pytest.raises(ValueError, match="no variable changes"):
        importance_sampling(lambda u: np.ones(len(u)), 2, 10)


def test_what_never_fails_has_no_failures():
    found = subset_simulation(lambda u: np.ones(len(u)), 1, 50)
    assert found.value == 0.0 and found.interval == (0.0, 1.0)
