"""The sampled mean against the mean of linear fields, in closed form."""

import numpy as np
import pytest

from geomech.coupling.splitting.part_mean_stress import rotated_mean_stress


class Linear:
    """A stress field σ = σ0 + G x."""

    base = np.array([1.0, -2.0, 0.5])
    gradient = np.array([[0.3, -1.0], [2.0, 0.1], [0.0, 0.7]])

    def stress(self, points):
        return self.base + points @ self.gradient.T


def test_linear_stress_is_averaged_exactly_also_with_a_hole():
    outline = np.array([[0, 0], [4, 0], [4, 2], [0, 2.0]])
    hole = np.array([[1, 0.5], [1, 1.5], [2, 1.5], [2, 0.5]])
    centroid = (8 * np.array([2.0, 1.0]) - np.array([1.5, 1.0])) / 7
    mean = rotated_mean_stress(Linear(), [outline, hole], 0.0)
    assert mean == pytest.approx(Linear.base + Linear.gradient @ centroid, rel=1e-12)


def test_a_quarter_turn_exchanges_the_axes():
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]])
    assert rotated_mean_stress(Linear(), [square], np.pi / 2) == pytest.approx([-2.0, 1.0, -0.5], abs=1e-12)
