"""LU factors of dense matrices, as several threads share them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from geomech.ddm.system.dense_lu import Factor


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("transposed", [False, True])
def test_threads_that_share_factors_get_the_same_solutions(order, transposed):
    """The interior fields of a run are computed beside its next cycle, with the same factors of the boundary. SciPy's
    solver changes the pivots that it is given while it works: nine in ten solutions of two threads were wrong."""
    rng = np.random.default_rng(0)
    matrix = np.array(rng.normal(size=(200, 200)), order=order)
    factor, right = Factor(matrix, "singular"), np.asfortranarray(rng.normal(size=(200, 20)))
    alone = factor.solve(right, transposed)
    assert np.allclose((matrix.T if transposed else matrix) @ alone, right)
    with ThreadPoolExecutor(2) as threads:
        solutions = list(threads.map(lambda _: factor.solve(right, transposed), range(40)))
    assert all(np.array_equal(solution, alone) for solution in solutions)
