"""What the benchmark times beside the direct solver must solve the same equations."""

import numpy as np
import pytest

from geomech.bench.cost import block_cost, block_scenes
from geomech.bench.peers import block_iteration
from geomech.bench.peers.block_iteration import block_jacobi, refactored, two_levels


@pytest.fixture(scope="module")
def equations():
    """The last of a wall's first step: solver, matrix, right side; centroids and areas of what moves."""
    _, watch, result, _ = block_cost.run(block_scenes.wall(100), 0.0)
    return *watch.last, result.forces.centroid[1:], result.forces.area[1:]


def test_other_solutions_are_those_of_the_direct_solver(monkeypatch, equations):
    monkeypatch.setattr("geomech.bench.peers.block_iteration.DOMAIN", 60)
    solver, data, right, centroid, area = equations
    expected = solver.solve(data, right)
    for found in (
        block_jacobi(solver, data, right),
        two_levels(solver, centroid, np.sqrt(area), data, right),
        refactored(solver, centroid, data, right),
    ):
        assert found.residual <= 2e-10
        # Condition 1e6 or so.
        assert np.abs(found.solution - expected).max() <= 1e-4 * np.abs(expected).max()


@pytest.mark.skipif(not block_iteration.pardiso_available(), reason="pypardiso is not installed")
def test_the_solution_by_pardiso_is_that_of_the_direct_solver(equations):
    solver, data, right, *_ = equations
    found, expected = block_iteration.pardiso(solver, data, right), solver.solve(data, right)
    assert found.residual <= 1e-9
    assert np.abs(found.solution - expected).max() <= 1e-4 * np.abs(expected).max()


def test_scenes_have_about_the_blocks_asked_for():
    for make in (block_scenes.wall, block_scenes.slope):
        for n in (100, 1000):
            blocks = make(n)
            assert abs((~np.asarray(blocks.fixed, bool)).sum() / n - 1) < 0.3
            assert (blocks.areas() > 0).all()


def test_settled_steps_are_of_blocks_at_rest():
    # From rest the same wall takes 20 iterations.
    seconds, iterations = block_cost.settled(block_scenes.wall(100))
    assert seconds > 0 and iterations <= 4
