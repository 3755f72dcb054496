"""Partial factors on strengths, and strength reduced along chosen joints alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geomech import dda
from geomech.dda import NothingToReduce, PartialFactors, design_problem
from geomech.model import JointLaw, Roughness


def test_every_strength_has_its_own_factor():
    law = JointLaw("j", 0.6, 1e5, 2e4, residual_friction_angle=0.4, residual_cohesion=1e3, dilation_angle=0.55)
    design = PartialFactors.of(["cohesion=1.25", "friction=1.4", "tension=2"]).design(law)
    assert math.tan(design.friction_angle) == pytest.approx(math.tan(0.6) / 1.4)
    assert math.tan(design.residual_friction_angle) == pytest.approx(math.tan(0.4) / 1.4)
    assert (design.cohesion, design.residual_cohesion, design.tensile_strength) == (8e4, 800.0, 1e4)
    assert design.dilation_angle == design.friction_angle
    rough = PartialFactors(friction=1.4).design(JointLaw("r", 0.5, roughness=Roughness(8.0, 4e7)))
    assert rough.roughness.reduction == 1.4


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (["frction=1.2"], "no strength 'frction' to divide; there are cohesion, friction, tension"),
        (["cohesion"], "given as cohesion=1.25, not 'cohesion'"),
        (["cohesion=much"], "not 'cohesion=much'"),
        (["tension=0"], "partial factor on tension must be a positive number, got 0.0"),
        (["friction=inf"], "partial factor on friction must be"),
        (["friction=1.2", "friction=1.3"], "on friction is given twice"),
        ({"cohesion": "1.2"}, "on cohesion must be a positive number, got '1.2'"),
    ],
)
def test_partial_factors_that_cannot_be_are_refused_by_name(given, why):
    with pytest.raises(NothingToReduce, match=why.replace("(", r"\(")):
        PartialFactors.of(given)


SCENE = {
    "title": "Two slabs",
    "geometry": {
        "zones": [
            {"name": "base", "polygon": [[0, 0], [20, 0], [20, 10]]},
            {"name": "low", "polygon": [[4, 2], [6, 3], [6, 4], [4, 3]]},
            {"name": "high", "polygon": [[12, 6], [14, 7], [14, 8], [12, 7]]},
        ],
        "edges": [{"name": "joint:bed", "line": [[12.0, 6.0], [14.0, 7.0]]}],
    },
    "materials": {"rock": {"youngs_modulus_pa": 5e10, "poissons_ratio": 0.2, "density_kg_m3": 2600}},
    "zones": {"base": {"fixed": True}},
    "joints": {"default": {"friction_angle_deg": 35.0, "cohesion_pa": 2e3}},
    "loads": {"gravity_m_s2": [0.0, -9.81]},
    "dda": {"time_step_s": 0.01},
    "run": {"end_time_s": 1.0},
}  # fmt: skip


@pytest.fixture
def problem():
    from geomech.bench.slopes.drawn_slopes import problem_of

    return problem_of(SCENE)


def test_a_drawn_joint_has_a_law_of_its_own(problem):
    design, reduced = design_problem(problem, PartialFactors(), ["bed"])
    assert reduced == ["default along bed"]
    own, other = design.joint_index("joint:bed", "joint:bed"), design.joint_index("", "")
    assert design.joints[own].name == "default along bed" and design.joints[other].name == "default"
    assert design_problem(problem, PartialFactors(), ["joint:bed", "bed"])[1] == ["default along bed"]
    assert design_problem(problem, PartialFactors(), ["default"])[1] == ["default"]
    with pytest.raises(NothingToReduce, match=r"no joint 'bad' to reduce; .*laws 'default', .*drawn as 'bed'"):
        design_problem(problem, PartialFactors(), ["bad"])


def test_along_one_joint_that_slab_alone_goes(problem):
    """Both slabs are as strong; with tan φ of all divided by 1.1 beforehand the factor is as much less."""
    design, reduced = design_problem(problem, PartialFactors(cohesion=1.1, friction=1.1), ["bed"])
    found = dda.factor_of_safety(
        design.blocks, design.materials, design.joints, design.loads, design.dda, joint_index=design.joint_index,
        load_time=1.0, search=dda.FactorSearch(reduce=reduced),
    )  # fmt: skip
    assert [design.blocks.names[b] for b in found.moving] == ["high"]
    length, dip = math.hypot(2, 1), math.atan2(1, 2)
    weight = 2600 * 9.81 * 2.0
    plain = (2e3 * length + weight * math.cos(dip) * math.tan(math.radians(35))) / (weight * math.sin(dip))
    assert found.factor == pytest.approx(plain / 1.1, rel=2e-3)
    joints = dda.mobilised_joints(design.blocks, design.joints, found.state, found.lower, reduced)
    assert [each.joint for each in joints] == ["joint:bed", "base | low"]
    assert joints[0].share == pytest.approx(1.0, abs=3e-3) and joints[0].reduced
    assert not joints[1].reduced and joints[1].share == pytest.approx(1.1 / plain, rel=1e-3)
    assert joints[0].normal == pytest.approx(weight * math.cos(dip), rel=1e-4)
    assert np.isclose(joints[0].length, length, rtol=1e-4)
