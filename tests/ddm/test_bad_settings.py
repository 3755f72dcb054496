"""Settings and cracks that mean nothing are refused by name, before anything is solved."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, GrowthSettings, Material

ROCK = Material("rock", 17e9, 0.21, k_ic=1e6)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("order", -1), ("order", 2.5), ("order", math.nan), ("elements_per_crack", 0), ("elements_per_crack", 2.5),
        ("elements_per_side", 0), ("elements_per_side", -1), ("grading_layers", -1), ("grading_ratio", 0.0),
        ("grading_ratio", 1.0), ("grading_ratio", math.nan), ("grading_error", 0.0), ("grading_error", math.nan),
    ],
)  # fmt: skip
def test_meshes_that_cannot_be(name, value):
    with pytest.raises(ValueError, match=f"{name} must "):
        DdmSettings(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("increment", 0.0), ("increment", -1e-3), ("increment", math.nan), ("increment", math.inf),
        ("min_increment", 0.0), ("min_increment", 2e-3), ("min_increment", math.nan), ("join_distance", -0.5),
        ("join_length", 0.0), ("initiation_distance", -1.0), ("initiation_spacing", math.nan),
    ],
)  # fmt: skip
def test_growth_that_cannot_be(name, value):
    with pytest.raises(ValueError, match=f"{name} must "):
        GrowthSettings(**{name: value})


def test_a_mouth_needs_a_boundary():
    """In the infinite plane it was an end without a tip, and the other one's K was 4e-5 off Griffith's."""
    crack = Cracks.from_polylines([np.array([[-0.3, 0.0], [0.3, 0.0]])], surface=[(True, False)], names=["fault"])
    with pytest.raises(ValueError, match="'fault': has a mouth, but in the infinite plane there is no boundary"):
        ddm.Body([], crack, ROCK)


def test_orders_beyond_the_highest_are_refused():
    crack = Cracks.from_polylines([np.array([[-0.3, 0.0], [0.3, 0.0]])])
    with pytest.raises(ValueError, match="from 0 to 12, got 13"):
        ddm.Body([], crack, ROCK, DdmSettings(order=13))
