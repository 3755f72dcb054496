"""The multipole operator of a free surface against the dense matrix of the same elements."""

import numpy as np
import pytest

from geomech.ddm.iterative.image_multipole import BelowSurface, Mirrored
from geomech.ddm.mesh.half_plane import HalfPlane
from geomech.ddm.system.influence_matrix import ElementSet, image_influence, influence

NU, TOL = 0.25, 1e-14


def scattered(n: int, order: int, height: float, way: tuple[float, float]) -> ElementSet:
    """``n`` elements of every kind, of lengths 1 : 30, in a unit square whose uppermost is ``height`` below the
    surface."""
    rng = np.random.default_rng(0)
    turn, length = rng.uniform(0, 2 * np.pi, n), 0.03 * 30 ** -rng.uniform(0, 1, n)
    start = rng.uniform(0, 1, (n, 2))
    end = start + length[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    rock = HalfPlane((0.0, 0.0), way)
    top = rock.frame(np.concatenate([start, end]))[:, 1].max() + height
    rock = HalfPlane(tuple(top * np.asarray(rock.outward)), way)
    return ElementSet(start, end, rng.integers(0, 4, n), np.arange(n), order, "chebyshev", rock)


@pytest.mark.parametrize(("height", "way"), [(0.01, (0.0, 1.0)), (0.01, (0.28, 0.96)), (3.0, (0.0, 1.0))])
def test_product_is_that_of_the_matrix(height, way):
    """Both ways round: 1e-10 of what the surface adds, and round-off of the whole."""
    elements = scattered(260, 4, height, way)
    x = np.random.default_rng(2).standard_normal(elements.n_unknowns)
    exact = image_influence(elements, elements, NU, TOL)
    added = Mirrored(elements, elements, NU, TOL)
    assert len(added.far)
    for got, want in ((added @ x, exact @ x), (added.transposed_times(x), exact.T @ x)):
        assert np.abs(got - want).max() < 1e-10 * np.abs(want).max()
    whole, operator = influence(elements, elements, NU, TOL), BelowSurface(elements, NU, TOL)
    for got, want in ((operator @ x, whole @ x), (operator.transposed_times(x), whole.T @ x)):
        assert np.abs(got - want).max() < 1e-12 * np.abs(want).max()
