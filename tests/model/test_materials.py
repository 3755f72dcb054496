"""Materials, joint laws and histories against textbook relations."""

import math

import numpy as np
import pytest

from geomech.model import History, JointLaw, Loads, Material

GOOD = {"name": "rock", "youngs_modulus": 17e9, "poissons_ratio": 0.21}


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_stiffness_follows_from_three_dimensional_elasticity(plane):
    """Reduce the 3-D compliance: ε = (σ − ν(...))/E with ε_zz = 0 or σ_zz = 0."""
    rock = Material(**GOOD, plane=plane)
    e, nu = rock.youngs_modulus, rock.poissons_ratio
    full = np.array([[1, -nu, -nu], [-nu, 1, -nu], [-nu, -nu, 1]]) / e
    across = np.outer(full[:2, 2], full[2, :2]) / full[2, 2]
    normal = full[:2, :2] - across if plane == "strain" else full[:2, :2]
    compliance = np.zeros((3, 3))
    compliance[:2, :2] = normal
    compliance[2, 2] = 2 * (1 + nu) / e
    np.testing.assert_allclose(rock.compliance(), compliance, rtol=1e-14, atol=1e-14 / e)
    np.testing.assert_allclose(rock.stiffness() @ compliance, np.eye(3), atol=1e-14)
    assert 1 / compliance[0, 0] == pytest.approx(rock.plane_modulus, rel=1e-14)


def test_out_of_plane_stress_keeps_the_plane_plane():
    stress = np.array([[3e6, -1e6, 5e5]])
    strained = Material(**GOOD)
    zz = strained.out_of_plane_stress(stress)
    assert (zz - 0.21 * (stress[:, 0] + stress[:, 1])) == pytest.approx(0)
    assert Material(**GOOD, plane="stress").out_of_plane_stress(stress) == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"youngs_modulus": 0.0},
        {"youngs_modulus": math.nan},
        {"poissons_ratio": 0.5},
        {"poissons_ratio": -1.0},
        {"density": -1.0},
        {"k_ic": 0.0},
        {"k_ic": math.nan},
        {"plane": "axial"},
        {"k_ic": 1e6, "k_iic": 0.0},
        {"k_iic": 1e6},
        {"tensile_strength": -1.0},
        {"cohesion": math.nan},
        {"friction_angle": 1.6},
    ],
)
def test_impossible_materials_are_refused(wrong):
    with pytest.raises(ValueError, match="material 'rock'"):
        Material(**{**GOOD, **wrong})


def test_joint_laws():
    assert JointLaw("j", math.radians(30)).friction == pytest.approx(1 / math.sqrt(3))
    for wrong in (
        {"friction_angle": math.pi / 2},
        {"friction_angle": -0.1},
        {"cohesion": -1.0},
        {"tensile_strength": math.nan},
        {"normal_stiffness": 0.0},
        {"shear_stiffness": -1.0},
    ):
        with pytest.raises(ValueError, match="joint 'j'"):
            JointLaw("j", **wrong)


def test_histories():
    ramp = History.ramp([0.0, -2e5], start=3.0)
    np.testing.assert_array_equal(ramp.at(2.0), [0, 0])
    np.testing.assert_array_equal(ramp.at(3.0), [0, 0])
    np.testing.assert_allclose(ramp.at(13.0), [0, -2e6])
    table = History(np.array([0.0, 1.0, 3.0]), np.array([[0.0], [2.0], [-2.0]]))
    np.testing.assert_allclose([table.at(t)[0] for t in (-1, 0.5, 2, 9)], [0, 1, 0, -2])
    np.testing.assert_array_equal(History.constant([1.0, 2.0]).at(1e9), [1, 2])
    np.testing.assert_array_equal(Loads().gravity.at(0.0), [0, 0])
