"""What a joint law refuses."""

from __future__ import annotations

import math

import pytest

from geomech.ddm.crack_contact.face_laws import all_smooth
from geomech.model import JointLaw, Roughness


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"friction_angle": -0.1}, "friction angle must lie in"),
        ({"cohesion": -1.0}, "cohesion must not be negative"),
        ({"residual_friction_angle": 0.1}, "above the peak"),
        ({"residual_cohesion": 1.0}, "above the peak"),
        ({"dilation_angle": 0.1}, "yield work"),
        ({"softening_slip": math.inf}, "softening_slip"),
        ({"dilation_slip": 0.0}, "dilation_slip must be positive"),
        ({"max_closure": 1e-3}, "needs a normal_stiffness"),
        ({"max_closure": -1.0, "normal_stiffness": 1e9}, "max_closure must be positive"),
        ({"roughness": Roughness(10, 1e8), "tensile_strength": 1.0}, "does not go with roughness"),
    ],
)
def test_refusals_name_the_joint(values, message):
    with pytest.raises(ValueError, match=f"joint 'bed'.*{message}"):
        JointLaw("bed", **values)


@pytest.mark.parametrize("values", [(0.0, 1e8), (21.0, 1e8), (10.0, -1.0), (10.0, 1e8, 0.05), (10.0, 1e8, -1.0)])
def test_roughness_outside_its_range(values):
    with pytest.raises(ValueError, match="joint"):
        Roughness(*values)


def test_a_law_is_straight_until_something_bends_it():
    assert JointLaw("plain", 0.5, cohesion=1e4, tensile_strength=1e3, normal_stiffness=1e9).straight
    assert JointLaw("plain", 0.5, residual_friction_angle=0.5).straight
    assert not JointLaw("worn", 0.5, residual_friction_angle=0.4).straight


def test_crack_faces_refuse_laws_they_cannot_follow():
    with pytest.raises(ValueError, match=r"joint 'rough'.*without them"):
        all_smooth([JointLaw("plain", 0.5), JointLaw("rough", 0.5, roughness=Roughness(10.0, 1e8))])
