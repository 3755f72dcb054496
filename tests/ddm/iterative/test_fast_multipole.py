"""The multipole operator against the dense matrix of the same elements."""

import numpy as np
import pytest

from geomech.ddm.iterative.fast_multipole import Compressed, Tree, pairs_of
from geomech.ddm.system.influence_matrix import ElementSet, influence

NU, TOL = 0.25, 1e-14


def scattered(n: int, order: int = 4, seed: int = 0, size: float = 1.0) -> ElementSet:
    """``n`` elements of every kind, of lengths 1 : 30, anywhere in a square."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(0, size, (n, 2))
    turn = rng.uniform(0, 2 * np.pi, n)
    length = 0.03 * size * 30 ** -rng.uniform(0, 1, n)
    end = start + length[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    return ElementSet(start, end, rng.integers(0, 4, n), np.arange(n), order, "chebyshev")


def far_error(operator: Compressed, x: np.ndarray) -> float:
    """Largest error of a traction of the far field, which near elements would hide, relative to the largest of it."""
    far = influence(operator.targets, operator.sources, NU, TOL)
    for rows, columns, _ in operator.blocks:
        far[np.ix_(rows, columns)] = 0.0
    exact = far @ x
    operator.blocks.clear()
    return float(np.abs(operator @ x - exact).max() / np.abs(exact).max())


def test_far_and_near_pairs_are_everything_once():
    targets, sources = scattered(150), scattered(90, seed=1)
    one, other = Tree.over(targets), Tree.over(sources)
    far, near = pairs_of(one, other)
    seen = np.zeros((targets.n, sources.n), int)
    for t, s in np.concatenate([far, near]):
        seen[np.ix_(one.elements(t), other.elements(s))] += 1
    assert len(far) and (seen == 1).all()


@pytest.mark.parametrize("order", [0, 4, 9])
def test_product_is_that_of_the_matrix(order):
    elements = scattered(220, order)
    operator = Compressed(elements, elements, NU, TOL)
    x = np.random.default_rng(2).standard_normal(elements.n_unknowns)
    exact = influence(elements, elements, NU, TOL) @ x
    np.testing.assert_allclose(operator @ x, exact, rtol=0, atol=1e-13 * np.abs(exact).max())
    # Stated of `Compressed`: 1e-10 of the far field; measured 3e-12 to 6e-12.
    assert far_error(operator, x) < 1e-11


def test_transposed_product_is_that_of_the_transposed_matrix():
    """Two sets of different orders; what is left is that of the product itself."""
    targets, sources = scattered(180, order=2), scattered(260, order=4, seed=1)
    operator = Compressed(targets, sources, NU, TOL)
    rng = np.random.default_rng(3)
    x, y = rng.standard_normal(sources.n_unknowns), rng.standard_normal(targets.n_unknowns)
    assert len(operator.far)
    exact = influence(targets, sources, NU, TOL).T @ y
    np.testing.assert_allclose(operator.transposed_times(y), exact, rtol=0, atol=1e-12 * np.abs(exact).max())
    size = np.linalg.norm(y) * np.linalg.norm(operator @ x)
    assert abs(y @ (operator @ x) - operator.transposed_times(y) @ x) < 1e-14 * size


def test_error_follows_what_is_asked():
    elements = scattered(300)
    x = np.random.default_rng(2).standard_normal(elements.n_unknowns)
    for error in (1e-3, 1e-6, 1e-9):
        assert far_error(Compressed(elements, elements, NU, TOL, error), x) < error


def test_targets_may_be_others_far_from_the_origin():
    """One set on another, of another order, at a million times their size."""
    there = 1e6
    sources, targets = scattered(200), scattered(120, order=1, seed=3)
    sources = ElementSet(sources.start + there, sources.end + there, sources.kind, sources.source, 4, "chebyshev")
    targets = ElementSet(targets.start + there, targets.end + there, targets.kind, targets.source, 1, "chebyshev")
    x = np.random.default_rng(2).standard_normal(sources.n_unknowns)
    # Coordinates are known to 1e-10 of the elements' distances.
    assert far_error(Compressed(targets, sources, NU, TOL), x) < 1e-9


def test_far_field_is_small_beside_the_matrix():
    elements = scattered(1200)
    operator = Compressed(elements, elements, NU, TOL)
    assert operator.stored < 0.25 * 8 * elements.n_unknowns**2
