"""What the benchmark times beside the direct solver must solve the same equations."""

import numpy as np

from geomech.bench import block_cost, block_scenes
from geomech.bench.block_iteration import block_jacobi, two_levels


def test_iterative_solutions_are_those_of_the_direct_solver(monkeypatch):
    monkeypatch.setattr("geomech.bench.block_iteration.DOMAIN", 60)
    _, watch, result, _ = block_cost.run(block_scenes.wall(100), 0.0)
    solver, data, right = watch.last
    expected = solver.solve(data, right)
    centroid, area = result.forces.centroid[1:], result.forces.area[1:]
    for found in (block_jacobi(solver, data, right), two_levels(solver, centroid, np.sqrt(area), data, right)):
        assert found.residual <= 2e-10
        # Condition 1e6 or so.
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
