"""Settings and cracks that mean nothing are refused by name, before anything is solved."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, GrowthSettings, Material
from geomech.reference.cracks.fracture import THREE_ARMED_STAR

ROCK = Material("rock", 17e9, 0.21, k_ic=1e6)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("order", -1), ("order", 13), ("order", 2.5), ("order", math.nan), ("elements_per_crack", 0), ("elements_per_crack", 2.5),
        ("elements_per_side", 0), ("elements_per_side", -1), ("grading_layers", -1), ("grading_ratio", 0.0),
        ("grading_ratio", 1.0), ("grading_ratio", math.nan), ("grading_error", 0.0), ("grading_error", math.nan), ("target_error", 1.0),
        ("target_error", math.nan), ("nodes", "foo"), ("solver", "fast"),
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


def test_orders_beyond_the_highest_are_refused_with_the_reason():
    with pytest.raises(ValueError, match=r"at most 12, got 13 .beyond, round-off grows faster"):
        DdmSettings(order=13)


@pytest.mark.parametrize("control", ["load", "toughness"])
def test_cracks_do_not_grow_in_a_material_without_toughness(control):
    """They came to rest, or the load was raised without end."""
    crack = Cracks.from_polylines([np.array([[-0.3, 0.0], [0.3, 0.0]])])
    with pytest.raises(ValueError, match=r"'rock' has no fracture toughness.*k_ic, Pa √m"):
        ddm.propagate([], crack, Material("rock", 17e9, 0.21), ddm.BodyLoad(remote_stress=[0, 1e6, 0]), control=control)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([[[0, 0], [1, 0]], [[0, 0], [0, 1]]], r"'crack 0' and 'crack 1' touch at \(0, 0\) .*node: make one .*join=True"),
        ([[[0, 0], [1, 0]], [[0.5, 0], [0.5, 1]]], r"'crack 1' and 'crack 0' touch at \(0.5, 0\) .*: give 'crack 0' a point"),
        ([[[0, 0], [1, 0], [1, 1], [0, 0]]], r"'crack 0': ends where it began, at \(0, 0\), .*join=True"),
        ([[[0, 0], [2, 0], [2, 1], [1, 0]]], r"'crack 0': comes back to itself, at \(1, 0\), .*give 'crack 0' a point"),
        ([[[0, 0], [1, 1]], [[0, 1], [1, 0]]], r"cross near .* without a shared node: draw a point of both .*join=True"),
    ],
)  # fmt: skip
def test_cracks_that_meet_without_a_node_are_told_how_to_share_one(lines, message):
    with pytest.raises(ValueError, match=message):
        ddm.Body([], Cracks.from_polylines([np.array(line, dtype=float) for line in lines]), ROCK)


def test_a_star_of_joined_lines_is_the_star():
    """Three arms under pressure: K_I of the closed form to what its junction leaves by default, 3e-5."""
    turn = np.radians([90, 210, 330])
    arms = [np.array([[0.0, 0.0], [np.cos(q), np.sin(q)]]) for q in turn]
    body = ddm.Body([], Cracks.from_polylines(arms, aperture=math.inf, join=True), ROCK, DdmSettings(order=6))
    k = body.solve(ddm.BodyLoad(crack_pressure=1.0)).tips["k_i"]
    assert k / math.sqrt(math.pi) == pytest.approx(np.full(3, THREE_ARMED_STAR), rel=3e-5)


def test_a_ring_cuts_its_inside_off():
    ring = np.array([[0.0, 0], [1, 0], [1, 1], [0, 0]])
    with pytest.raises(np.linalg.LinAlgError, match="separate a part from the body"):
        ddm.Body([], Cracks.from_polylines([ring], join=True), ROCK).solve(ddm.BodyLoad(remote_stress=[0, 1e6, 0]))
