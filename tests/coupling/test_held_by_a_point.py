"""Rock that holds by a single point after a split: named and refused, not a fault of the outline."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.coupling.load_transfer.elastic_bodies import _check_pinches
from geomech.model import Blocks

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])


def with_hole(hole: list) -> Blocks:
    return Blocks.from_polygons([[SQUARE, np.array(hole)]], names=("rock",))


def test_a_hole_inside_is_no_such_point():
    _check_pinches(with_hole([[1.0, 1.0], [1.0, 2.0], [2.0, 1.0]]), 0)
    _check_pinches(Blocks.from_polygons([SQUARE]), 0)


def test_a_splinter_that_touches_the_surface_is_named_with_the_place():
    with pytest.raises(dda.NotConverged, match=r"rock: cracks leave rock that holds by a single point at \(4, 4\)"):
        _check_pinches(with_hole([[4.0, 4.0], [3.0, 2.0], [2.0, 3.0]]), 0)
