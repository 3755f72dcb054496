"""Joint laws in a scene: every key arrives, and what does not go together is refused at its key."""

from __future__ import annotations

import math

import pytest
from scene_texts import GOOD

from geomech.scene import load_scene

HEAD = "[joints.default]\n"


def test_every_key_of_a_joint_arrives(scene_file):
    text = HEAD + (
        "friction_angle_deg = 40\ncohesion_pa = 1e5\nresidual_friction_angle_deg = 30\nresidual_cohesion_pa = 1e4\n"
        "softening_slip_m = 2e-3\ndilation_angle_deg = 5\ndilation_slip_m = 8e-3\nnormal_stiffness_pa_per_m = 1e10\n"
        "max_closure_m = 1e-4\n[joints.rough]\nedges = ['load:top']\nfriction_angle_deg = 28\njrc = 10\njcs_pa = 5e7\n"
        "joint_length_m = 1.0\nsample_length_m = 0.2\nstiffness_from_peak_slip = true\n"
    )
    law, rough = load_scene(scene_file(GOOD + text)).problem().joints
    assert math.degrees(law.friction_angle) == pytest.approx(40)
    assert math.degrees(law.residual_friction_angle) == pytest.approx(30)
    assert (law.residual_cohesion, law.softening_slip, law.dilation_slip, law.max_closure) == (1e4, 2e-3, 8e-3, 1e-4)
    assert math.degrees(law.dilation_angle) == pytest.approx(5) and not law.straight
    r = rough.roughness
    assert (r.jrc, r.jcs, r.length, r.sample_length, r.from_peak_slip) == (10.0, 5e7, 1.0, 0.2, True)


def test_faces_that_crush(scene_file):
    (law,) = load_scene(scene_file(GOOD + HEAD + "crushing_strength_pa = 3e6\n")).problem().joints
    assert law.crushing_strength == 3e6 and law.straight


@pytest.mark.parametrize(
    ("text", "place", "message", "way_out"),
    [
        ("crushing_strength_pa = 0\n", "crushing_strength_pa", "", ""),
        ("crushing_strength_pa = 1e6\nfriction_angle_deg = 9\ndilation_angle_deg = 5\n", "crushing_strength_pa",
         "does not go with", "leave it out"),
        ("crushing_strength_pa = 1e6\n[joints.ball]\nedges = ['load:top']\nrestitution = 0.5\n", "crushing_strength_pa", "ball", "leave it out"),
        ("crushing_strength_pa = 1e6\n[dda]\nsprings = 'resolved'\n", "crushing_strength_pa", "stiff penalty", "leave"),
        ("crushing_strength_pa = 1e6\n[cracks.flaw]\njoint = 'default'\n", "cracks.flaw.joint", "do not crush", "without"),
        ("cohesion_pa = -1\n", "cohesion_pa", "", "cohesion"),
        ("jrc = 21\njcs_pa = 1e8\n", "jrc", "at most 20", "roughness"),
        ("jrc = 10\n", "jrc", "no jcs_pa", "add jcs_pa"),
        ("jcs_pa = 1e8\n", "jcs_pa", "no jrc", "add jrc"),
        ("joint_length_m = 1\n", "joint_length_m", "no roughness", "add jrc"),
        ("friction_angle_deg = 30\nresidual_friction_angle_deg = 31\n", "residual_friction_angle_deg", "above",
         "at most"),
        ("cohesion_pa = 1\nresidual_cohesion_pa = 2\n", "residual_cohesion_pa", "above the peak", "at most"),
        ("friction_angle_deg = 5\ndilation_angle_deg = 6\n", "dilation_angle_deg", "yield work", "at most"),
        ("max_closure_m = 1e-3\n", "max_closure_m", "needs a normal_stiffness", "normal_stiffness_pa_per_m"),
        ("jrc = 10\njcs_pa = 1e8\ncohesion_pa = 1\n", "cohesion_pa", "does not go with roughness", "leave"),
        (
            "jrc = 10\njcs_pa = 1e8\ndilation_angle_deg = 0.0\nsoftening_slip_m = 1\n",
            "softening_slip_m",
            "roughness",
            "",
        ),
        ("jrc = 10\njcs_pa = 1e8\nfriction_angle_deg = 70\n", "friction_angle_deg", "below 70°", "without roughness"),
        ("jrc = 10\njcs_pa = 1e8\njoint_length_m = 0.05\n", "joint_length_m", "at least", "leave it out"),
        (
            "jrc = 10\njcs_pa = 1e8\nstiffness_from_peak_slip = true\nshear_stiffness_pa_per_m = 1e9\n",
            "shear_stiffness_pa_per_m", "as well", "leave it out",
        ),
        ("jrc = 10\njcs_pa = 1e8\n[cracks.flaw]\njoint = 'default'\n", "cracks.flaw.joint", "cannot follow", "only"),
    ],
)  # fmt: skip
def test_joints_that_make_no_law(errors_of, text, place, message, way_out):
    (error,) = errors_of(add=HEAD + text)
    assert place in error.place and message in error.message and way_out in error.way_out, error
