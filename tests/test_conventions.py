"""The signs and frames that `geomech.conventions` states, each against an independent picture of it."""

import math

import numpy as np
import pytest

from geomech.conventions import VTK_STRESS, normal_of, outward_normal_of, rotate_stress, traction
from geomech.ddm.fracture.criteria import CRITERIA
from geomech.model import Blocks


def tensor(stress):
    xx, yy, xy = stress
    return np.array([[xx, xy], [xy, yy]])


def test_component_orders():
    assert VTK_STRESS == ("XX", "YY", "ZZ", "XY", "YZ", "XZ")


def test_crack_normal_is_the_tangent_turned_left():
    np.testing.assert_array_equal(normal_of([1.0, 0.0]), [0.0, 1.0])
    tangents = np.random.default_rng(0).normal(size=(5, 3, 2))
    normals = normal_of(tangents)
    np.testing.assert_allclose(np.sum(tangents * normals, axis=-1), 0, atol=1e-16)
    turned = tangents[..., 0] * normals[..., 1] - tangents[..., 1] * normals[..., 0]
    assert (turned > 0).all()


def test_outward_normal_points_out_of_the_rock():
    """Step off the middle of every edge of a block with a hole: a point-in-polygon count says where one is."""
    hole = np.array([[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]])
    blocks = Blocks.from_polygons([[np.array([[0.0, 0.0], [4.0, 0.0], [3.0, 4.0], [0.0, 3.0]]), hole]])
    a, b = blocks.vertices, blocks.vertices[blocks.next_vertex]
    tangent = (b - a) / np.hypot(*(b - a).T)[:, None]
    outside = (a + b) / 2 + 1e-6 * outward_normal_of(tangent)
    inside = (a + b) / 2 - 1e-6 * outward_normal_of(tangent)

    def crossings(p):
        up = (a[:, 1] > p[1]) != (b[:, 1] > p[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            x = a[:, 0] + (p[1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        return int((up & (x > p[0])).sum())

    assert all(crossings(p) % 2 == 0 for p in outside)
    assert all(crossings(p) % 2 == 1 for p in inside)


def test_traction_is_stress_times_normal_and_tension_pulls():
    rng = np.random.default_rng(1)
    stress, normal = rng.normal(size=(7, 3)), rng.normal(size=(7, 2))
    expected = [tensor(s) @ n for s, n in zip(stress, normal)]
    np.testing.assert_allclose(traction(stress, normal), expected, rtol=1e-14)
    # Tension (positive) pulls a block's right-hand face to the right.
    right_face = outward_normal_of(np.array([0.0, 1.0]))
    np.testing.assert_array_equal(traction([5.0, 0.0, 0.0], right_face), [5.0, 0.0])


@pytest.mark.parametrize("angle", [0.3, -2.0, math.pi / 2])
def test_rotated_stress_is_the_tensor_between_rotations(angle):
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    stress = np.random.default_rng(2).normal(size=(5, 3))
    for given, found in zip(stress, rotate_stress(stress, angle)):
        np.testing.assert_allclose(tensor(found), rotation @ tensor(given) @ rotation.T, atol=1e-14)


def test_rotation_carries_the_material_counter_clockwise():
    """A bar pulled along x and turned by +30° is pulled along 30°."""
    turned = rotate_stress([1.0, 0.0, 0.0], math.radians(30))
    axis = np.array([math.cos(math.radians(30)), math.sin(math.radians(30))])
    np.testing.assert_allclose(tensor(turned) @ axis, axis, atol=1e-15)
    angles = np.array([0.1, 0.2])
    np.testing.assert_array_equal(
        rotate_stress(np.ones((2, 3)), angles), [rotate_stress(np.ones(3), a) for a in angles]
    )


@pytest.mark.parametrize("name", CRITERIA)
def test_positive_mode_two_turns_a_crack_clockwise(name):
    """τ_xy > 0 ahead of a tip that looks along x: the largest principal tension points to +45°, so that the crack,
    which runs across it, turns to the other side."""
    angle, _ = CRITERIA[name](np.array([1.0]), np.array([0.5]), _rock())
    principal = np.linalg.eigh(tensor([0.0, 0.0, 1.0]))[1][:, 1]
    across = math.atan2(*normal_of(principal * np.sign(principal[0]))[::-1]) - math.pi  # the half that looks ahead
    assert across == pytest.approx(-math.pi / 4)
    assert -math.pi / 2 < angle[0] < 0 and np.sign(angle[0]) == np.sign(across)


def _rock():
    from geomech.model import Material

    return Material("rock", 1e10, 0.25)
