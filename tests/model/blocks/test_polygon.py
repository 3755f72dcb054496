"""Area integrals against those of rectangles."""

import numpy as np
import pytest

from geomech.model.blocks.polygon import area_moments, winding_number


def test_area_moments_of_a_rectangle_with_a_hole_far_from_the_origin():
    """Against bh, bh³/12 and the hole's own, at 10⁶ m from the origin."""
    outline = np.array([[0, 0], [4, 0], [4, 2], [0, 2.0]])
    hole = np.array([[1, 0.5], [1, 1.5], [2, 1.5], [2, 0.5]])
    shift = np.array([1e6, -1e6])
    area, centroid, second = area_moments([outline + shift, hole + shift])
    assert area == pytest.approx(7.0, rel=1e-12)
    centre = (8 * np.array([2, 1]) - np.array([1.5, 1.0])) / 7
    assert centroid - shift == pytest.approx(centre, abs=1e-9)

    def about(b, h, at):
        own = np.diag([b**3 * h / 12, b * h**3 / 12])
        return own + b * h * np.outer(np.array(at) - centre, np.array(at) - centre)

    assert second == pytest.approx(about(4, 2, [2, 1]) - about(1, 1, [1.5, 1.0]), rel=1e-9, abs=1e-9)


def test_winding_number_tells_rock_from_hole():
    outline = np.array([[0, 0], [4, 0], [4, 2], [0, 2.0]])
    hole = np.array([[1, 0.5], [1, 1.5], [2, 1.5], [2, 0.5]])
    found = [winding_number([outline, hole], np.array(p)) for p in ([3.0, 1.0], [1.5, 1.0], [5.0, 1.0])]
    assert found == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
