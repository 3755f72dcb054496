"""Factors of safety by operator splitting with cohesion, joint stiffness and bolts, against the linear programme of rigid blocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import two_set_slope

from geomech import dda
from geomech.bench.safety.factor_cost import slope_of
from geomech.bench.safety.slope_limits import admissible_factor
from geomech.bench.slopes.drawn_slopes import Isometry, drawn, moved, problem_of
from geomech.dda.open_close.operator_splitting import contact_turn
from geomech.dda.open_close.plastic_splitting import is_plastic
from geomech.dda.statics.stability_trial import TrialLoads
from geomech.model import GROUND, SLIP, Blocks, Bolt, ContactSolver, DdaSettings, History, JointLaw, Loads, Material

#: Two joint sets behind a face, some seventy blocks.
SCENE = (
    two_set_slope("angle_deg = -35\nspacing_m = 5.0", "spacing_m = 6.0", "smallest_block_m2 = 0.2").replace(
        "[joints.beds]", "MORE\n[joints.beds]"
    )
    + """
MORE
[loads]
gravity_m_s2 = [0, -9.81]
[dda]
time_step_s = 0.005
[run]
end_time_s = 2.0
"""
)

#: Without operator splitting.
NEWTON = ContactSolver(plastic_splitting=10**6)


def factor_of(problem, solver: ContactSolver | None = None, **search) -> dda.FactorOfSafety:
    settings = replace(problem.dda, dynamic_factor=0.0, contact_solver=solver or ContactSolver())
    return dda.factor_of_safety(
        problem.blocks, problem.materials, problem.joints, problem.loads, settings, joint_index=problem.joint_index,
        load_time=problem.run.end_time, search=dda.FactorSearch(follow=False, **search),
    )  # fmt: skip


def fails_at_its_bound(problem) -> None:
    found, bound = factor_of(problem), admissible_factor(problem, tolerance=1e-3)
    print(f"{found.factor:.4f}, rigid blocks {bound:.4f}")
    assert found.factor == pytest.approx(bound, rel=1e-2)
    assert found.lower <= bound * 1.003 and found.moving and found.upper <= found.lower * 1.0021


COHESIVE = SCENE.replace("MORE", "cohesion_pa = 20e3")


def test_a_slope_with_cohesion_fails_within_a_per_cent_of_its_bound():
    fails_at_its_bound(problem_of(drawn(COHESIVE)))


@pytest.mark.slow  # 5 s
@pytest.mark.parametrize("move", [Isometry.mirrored(), Isometry.rotated(0.3)], ids=["mirrored", "rotated"])
def test_it_fails_there_mirrored_and_rotated(move):
    fails_at_its_bound(problem_of(moved(drawn(COHESIVE), move)))


@pytest.mark.parametrize("stiffness", [1e9, pytest.param(5e10, marks=pytest.mark.slow)])
def test_a_slope_with_joint_stiffness_fails_within_a_per_cent_of_its_bound(stiffness):
    """Whatever part of a soft face is pressed, its contact force may act anywhere on it: 3.5 % lower with springs inside faces."""
    law = f"normal_stiffness_pa_per_m = {stiffness}\nshear_stiffness_pa_per_m = {0.4 * stiffness}"
    fails_at_its_bound(problem_of(drawn(SCENE.replace("MORE", law))))


@pytest.mark.slow  # 6 s
def test_a_slope_with_joint_stiffness_fails_as_with_newtons_method():
    law = "normal_stiffness_pa_per_m = 5e9\nshear_stiffness_pa_per_m = 2e9"
    problem = problem_of(drawn(SCENE.replace("MORE", law)))
    one, other = factor_of(problem), factor_of(problem, NEWTON)
    assert one.factor == pytest.approx(other.factor, rel=1e-2)
    assert one.factor <= admissible_factor(problem, tolerance=1e-3) * 1.003


def test_tensile_strength_and_dilation_of_many_blocks_are_left_out_with_a_warning():
    more = "cohesion_pa = 20e3\ntensile_strength_pa = 10e3\ndilation_angle_deg = 5"
    found, other = (
        factor_of(problem_of(drawn(SCENE.replace("MORE", text))), compare=False, tolerance=0.03)
        for text in (more, "cohesion_pa = 20e3")
    )
    assert found.factor == other.factor and not other.warnings
    (warning,) = found.warnings
    assert "the tensile strength of 'default', 'beds' and the dilation of 'default', 'beds' are not counted" in warning


def test_blocks_that_hang_on_tensile_strength_have_their_factor():
    """A block of 1 m x 1 m below a roof, 25 kN/m, with 40 kPa: 1.6, also where many blocks have the factor without it."""
    roof, square = np.array([[-1, 0], [2, 0], [2, 1], [-1, 1]]), np.array([[0, -1], [1, -1], [1, 0], [0, 0]])
    blocks = Blocks.from_polygons([roof, square], fixed=[True, False])
    rock, joint = Material("rock", 10e9, 0.25, density=2500.0), JointLaw("joint", 0.5, 1e5, 4e4)
    settings = DdaSettings(contact_solver=ContactSolver(plastic_splitting=1))
    found = dda.factor_of_safety(
        blocks,
        [rock],
        [joint],
        Loads(gravity=History.constant([0.0, -10.0])),
        settings,
        search=dda.FactorSearch(follow=False),
    )
    assert found.factor == pytest.approx(1.6, rel=2e-3) and not any("not counted" in line for line in found.warnings)


@pytest.mark.parametrize("stiffness", [1e7, *(pytest.param(k, marks=pytest.mark.slow) for k in (3e6, 1e8))])
def test_bolts_count_with_their_yield_force(stiffness):
    """However far blocks have to move for it, 33 to 1 mm: three bolts raise the bound from 0.520 to 0.750."""
    problem, bolts = problem_of(drawn(SCENE.replace("MORE", ""))), []
    for block in (43, 50, 57):
        x, y = problem.blocks.vertices[problem.blocks.vertex_block == block].mean(axis=0)
        bolts.append(Bolt(block, (x, y), GROUND, (x - 8.0, y - 4.0), stiffness, yield_force=1e5))
    problem = replace(problem, loads=replace(problem.loads, bolts=tuple(bolts)))
    found, bound = factor_of(problem, tolerance=0.02, compare=False), admissible_factor(problem, tolerance=1e-3)
    rows = found.state.bolts
    print(found.factor, found.lower, bound, rows["force"], rows["plastic"])
    assert bound == pytest.approx(0.7497, rel=1e-3) and found.factor == pytest.approx(bound, rel=5e-3)
    assert found.lower > 0.98 * bound and rows["force"].max() <= 1e5 * (1.0 + 1e-9)
    assert (rows["force"] > 0.9e5).sum() == 2


def test_strength_that_fades_is_left_to_the_open_close_iteration():
    lasting = JointLaw("lasting", 0.5, 2e4, residual_cohesion=2e4)
    assert is_plastic(lasting) and is_plastic(JointLaw("smooth", 0.5))
    for name, value in (
        ("tensile_strength", 1e3),
        ("dilation_angle", 0.1),
        ("residual_friction_angle", 0.3),
        ("residual_cohesion", 0.0),
    ):
        assert not is_plastic(replace(lasting, **{name: value})), name


def test_what_is_solved_in_this_way():
    """Cohesion, bolts and joint stiffness from 50 blocks on; friction alone where there are very many, without dilation."""
    problem, under = slope_of(60), TrialLoads(Loads(), 0.0, 1e-5, 200, None)
    assert not under.plastic(problem.blocks, problem.joints, problem.dda)
    bolted = replace(under, loads=Loads(bolts=(Bolt(1, (0.0, 0.0), GROUND, (1.0, 0.0), 1e8),)))
    assert bolted.plastic(problem.blocks, problem.joints, problem.dda)
    for more in ({"cohesion": 1e4}, {"normal_stiffness": 1e10}):
        laws = [replace(law, **more) for law in problem.joints]
        assert under.plastic(problem.blocks, laws, problem.dda)
        assert not under.plastic(problem.blocks, laws, replace(problem.dda, contact_solver=NEWTON))
    dilating = [replace(law, dilation_angle=0.1) for law in problem.joints]
    assert under.simpler(problem.blocks, dilating, problem.dda) is dilating
    fewer = replace(problem.dda, contact_solver=ContactSolver(plastic_splitting_alone=50))
    assert under.plastic(problem.blocks, problem.joints, fewer)
    assert [law.dilation_angle for law in under.simpler(problem.blocks, dilating, fewer)] == [0.0] * len(dilating)


def test_many_blocks_with_friction_alone_fail_at_their_bound():
    problem = problem_of(drawn(SCENE.replace("MORE", "")))
    solver = ContactSolver(plastic_splitting_alone=50)
    found, bound = factor_of(problem, solver), admissible_factor(problem, tolerance=1e-3)
    assert found.factor == pytest.approx(bound, rel=1e-2) and found.lower <= bound * 1.003


def test_a_face_open_by_a_hairline_holds_part_of_its_cohesion():
    """A contact that its blocks hold 0.4 µm apart: cohesion that falls to zero over 1 µm."""
    law = np.array([[4e-7, 1e12, 1e12, 0.0, 0.5, 1000.0, 1e-6]])
    order, vectors = np.array([-1, -1]), np.zeros((1, 2, 12))
    at_hand, states = np.array([[0.0, 1e-3, 0.0, 0.0, 0.0, 0.0]]), (np.zeros(1, np.int64), np.zeros(1))
    contacts = (np.array([0]), np.array([1]), order, vectors)
    contact_turn(np.zeros(6), contacts, law, np.full((2, 1), 1e9), np.zeros(1, bool), 1.0, at_hand, states)
    normal, shear = 1e9 * (at_hand[0, 2:4] - at_hand[0, :2])
    assert normal == 0.0 and shear == pytest.approx(-600.0) and states[0][0] == SLIP
