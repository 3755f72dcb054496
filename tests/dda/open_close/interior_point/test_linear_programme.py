"""Linear programmes by the interior-point method, beside those of a general solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, sparse

from geomech.dda.open_close.interior_point.linear_programme import _by_interior_points, smallest


@pytest.mark.parametrize("seed", range(4))
def test_optimum_and_derivatives_are_those_of_a_general_solver(seed):
    """Random programmes with slack on both sides of every equation, as in `AdmissibleForces`, some unknowns bounded."""
    rng = np.random.default_rng(seed)
    m, n = 30, 60
    rest = sparse.identity(m)
    matrix = sparse.hstack([sparse.random(m, n, 0.1, random_state=seed), rest, -rest], format="csc")
    cost = np.concatenate([rng.uniform(0.0, 0.3, n), np.ones(2 * m)])
    right, most = rng.normal(size=m), np.append(np.where(rng.random(n) < 0.5, 0.2, np.inf), np.full(2 * m, np.inf))
    found = _by_interior_points(cost, matrix, right, most)
    bounds = np.stack([np.zeros(len(cost)), most], axis=1)
    other = optimize.linprog(cost, A_eq=matrix, b_eq=right, bounds=bounds, method="highs")
    # Both solve it to about 1e-8.
    assert found.cost == pytest.approx(other.fun, rel=1e-6)
    assert found.of_equations == pytest.approx(other.eqlin.marginals, abs=1e-5)
    assert found.of_bounds == pytest.approx(other.upper.marginals, abs=1e-5)
    assert found.of_signs == pytest.approx(other.lower.marginals, abs=1e-5)
    assert np.abs(matrix @ found.unknowns - right).max() < 1e-6


def test_a_degenerate_programme_is_solved_as_well():
    """Two equal equations: without the increased diagonal the normal equations have no inverse."""
    matrix = sparse.csc_matrix([[1.0, 1.0], [1.0, 1.0]])
    found = smallest(np.array([1.0, 2.0]), matrix, np.ones(2), np.full(2, np.inf))
    assert found.cost == pytest.approx(1.0) and found.unknowns == pytest.approx([1.0, 0.0], abs=1e-6)
