"""The upper bound by admissible contact forces, beside the factor that the deformation of the blocks brings about."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from geomech import dda
from geomech.bench.safety.factor_scenes import random_slope
from geomech.bench.slopes.drawn_slopes import problem_of
from geomech.dda.statics.admissible_forces import AdmissibleForces
from geomech.model import GROUND, Blocks, Bolt, History, JointLaw, Loads, Material, State

GRAVITY = 9.81
WEIGHT = Loads(gravity=History.constant([0.0, -GRAVITY]))
ROCK = Material("rock", 20e9, 0.25, density=2600.0)
DIP = math.radians(30)


def rectangle(x0: float, y0: float, x1: float, y1: float, turn: float) -> np.ndarray:
    points = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], float)
    return points @ np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])


def plane(cohesion: float = 0.0, **law) -> tuple[dda.BlockSystem, State, list[JointLaw]]:
    """A block of 2 × 1 m at rest on a plane at 30° with φ = 40°."""
    blocks = Blocks.from_polygons([rectangle(-6, -3, 8, 0, DIP), rectangle(0, 0, 2, 1, DIP)], fixed=[True, False])
    joints = [JointLaw("plane", math.radians(40), cohesion, **law)]
    system = dda.BlockSystem(blocks, [ROCK], joints)
    return system, dda.equilibrium(system, State.at_rest(blocks), WEIGHT).state, joints


@pytest.mark.parametrize("cohesion", [0.0, 5e3])
def test_the_bound_of_a_block_on_a_plane_is_limit_equilibrium(cohesion):
    system, state, joints = plane(cohesion)
    rest = State.at_rest(system.blocks)
    forces = AdmissibleForces.of(system, state, rest, joints, ["plane"])
    weight = 2600.0 * GRAVITY * 2.0
    expected = (cohesion * 2.0 + weight * math.cos(DIP) * math.tan(math.radians(40))) / (weight * math.sin(DIP))
    assert forces.balance(0.999 * expected) and not forces.balance(1.001 * expected)
    # From either side, near and far.
    for first in (0.01, 0.9, 1.0, 1.1, 20.0):
        assert forces.largest_factor(first * expected) == pytest.approx(expected, rel=2e-4)
    # The derivative of what is left out of balance.
    (left, slope), (farther, _) = (forces.unbalanced(factor * expected) for factor in (1.05, 1.05001))
    numerical = (farther - left) / (1.0 / 1.05001 - 1.0 / 1.05) * expected
    assert left > 0.0 and slope == pytest.approx(numerical, rel=1e-3)
    # What is not reduced holds at any factor.
    kept = AdmissibleForces.of(system, state, rest, joints, [])
    assert math.isinf(kept.largest_factor())


@pytest.mark.parametrize("first", [0.5, 1.0, 2.0, 20.0])
def test_a_sliver_that_nothing_holds_leaves_the_bound_of_the_other_blocks(first):
    """A further block without contacts, with a thousandth of the load; with a tenth, nothing bounds the factor."""
    system, state, joints = plane()
    forces = AdmissibleForces.of(system, state, State.at_rest(system.blocks), joints, ["plane"])
    expected = math.tan(math.radians(40)) / math.tan(DIP)

    def with_sliver(load: float) -> AdmissibleForces:
        none = [sparse.csc_matrix((3, each.shape[1])) for each in (forces.matrix, forces.bolts)]
        matrix, bolts = (
            sparse.vstack(pair, format="csc") for pair in zip((forces.matrix, forces.bolts), none, strict=True)
        )
        return replace(forces, matrix=matrix, bolts=bolts, loads=np.append(forces.loads, [0.0, load, 0.0]))

    assert with_sliver(1e-3).largest_factor(first) == pytest.approx(expected, rel=2e-4)
    assert with_sliver(0.1).largest_factor(first) == 0.0


def test_a_bolt_may_pull_with_what_it_yields_at_beside_what_it_does():
    """Along the plane, the bolt adds its yield force to what holds: F = W cos β tan φ/(W sin β − T)."""
    blocks = Blocks.from_polygons([rectangle(-6, -3, 8, 0, DIP), rectangle(0, 0, 2, 1, DIP)], fixed=[True, False])
    joints = [JointLaw("plane", math.radians(40))]
    system = dda.BlockSystem(blocks, [ROCK], joints)
    (start, end), pull = rectangle(1, 0.0, 7, 0.0, DIP)[:2], 10e3
    loads = Loads(
        gravity=WEIGHT.gravity,
        bolts=(Bolt(1, tuple(start), GROUND, tuple(end), 1e6, pretension=2e3, yield_force=pull),),
    )
    state = dda.equilibrium(system, State.at_rest(blocks), loads).state
    assert state.bolts["force"][0] < 0.5 * pull
    weight, rest = 2600.0 * GRAVITY * 2.0, State.at_rest(blocks)
    for bolts, most in ((loads.bolts, pull), ((), float(state.bolts["force"][0]))):
        forces = AdmissibleForces.of(system, state, rest, joints, ["plane"], bolts)
        expected = weight * math.cos(DIP) * math.tan(math.radians(40)) / (weight * math.sin(DIP) - most)
        assert forces.largest_factor() == pytest.approx(expected, rel=3e-4)


def test_no_bound_is_given_where_strength_is_no_cone():
    system, state, _ = plane()
    for law in (
        JointLaw("plane", 0.7, 1e4, 1e4),
        JointLaw("plane", 0.7, residual_friction_angle=0.5),
        JointLaw("plane", 0.7, 1e4, residual_cohesion=5e3),
    ):
        assert AdmissibleForces.of(system, state, State.at_rest(system.blocks), [law], ["plane"]) is None


def test_a_toppling_row_whose_factor_depends_on_how_it_is_wedged_is_reported():
    """Seven columns, the second one twice as high as the first: friction admits forces up to 1.5228 (the programme of
    `slope_limits`, set up without the engine), the deformation of the columns brings about what fails at 1.409."""
    slope = random_slope(69)
    problem = problem_of(slope.scene)
    found = dda.factor_of_safety(
        problem.blocks, problem.materials, problem.joints, problem.loads, problem.dda, joint_index=problem.joint_index
    )
    assert found.factor < 0.95 * slope.bound
    assert found.admissible == pytest.approx(slope.bound, rel=2e-3)
    assert f"up to a factor of {found.admissible:.4f}, which is an upper bound" in found.warnings[-1]
    assert found.as_dict(problem.blocks)["largest_factor_with_admissible_forces"] == found.admissible


@pytest.mark.parametrize(
    "seed", [69, pytest.param(104, marks=pytest.mark.slow), pytest.param(114, marks=pytest.mark.slow)]
)
def test_rows_of_joints_that_dilate_by_their_friction_reach_the_bound(seed):
    """What forces exist and what fails agree where slip follows the normal to the strength (Drescher & Detournay 1993):
    the static theorem is exact then, whatever way the columns are wedged in."""
    slope = random_slope(seed)
    problem = problem_of(slope.scene)
    joints = [replace(law, dilation_angle=law.friction_angle) for law in problem.joints]
    found = dda.factor_of_safety(
        problem.blocks, problem.materials, joints, problem.loads, problem.dda, joint_index=problem.joint_index
    )
    assert found.factor == pytest.approx(slope.bound, rel=1e-3) and found.admissible is None


def test_a_row_that_reaches_its_bound_needs_no_warning():
    slope = random_slope(19)
    problem = problem_of(slope.scene)
    found = dda.factor_of_safety(
        problem.blocks, problem.materials, problem.joints, problem.loads, problem.dda, joint_index=problem.joint_index
    )
    assert found.factor == pytest.approx(slope.bound, rel=1e-3) and found.admissible is None and not found.warnings
    # One trial below the bound, one on either side of it, and one that shows where the motion ends.
    assert len(found.trials) == 4


@pytest.mark.parametrize("bend_deg", [0.0, 0.5, 1.25, 2.5, 6.0])
def test_a_bent_plane_counts_its_length_once(bend_deg):
    """A polyline whose chords lean to one another by a little: tributary lengths add up to its length."""
    at = [(0.0, 0.0)]
    for k in range(8):
        angle = math.radians(20 + k * bend_deg)
        at.append((at[-1][0] + math.cos(angle), at[-1][1] + math.sin(angle)))
    (x, y), top = at[-1], at[-1][1] + 2.0
    base = [(-5, -8), (x + 9, -8), (x + 9, y), *at[::-1], (-5, 0)]
    for way in (1.0, -1.0):
        polygons = [np.array(p) * [way, 1.0] for p in (base, [*at, (x, top), (1.0, top)])]
        blocks = Blocks.from_polygons([p[:: int(way)] for p in polygons], fixed=[True, False])
        near = dda.BlockSystem(blocks, [ROCK], [JointLaw("plane", 0.5, 1e4)]).contacts_near(State.at_rest(blocks))
        assert near.geometry[:, 4].sum() == pytest.approx(8.0, rel=2e-3)


@pytest.mark.parametrize("rim", [0.02, 0.2, 1.0])
def test_a_rim_that_holds_a_toe_is_named_with_the_factor_without_it(rim):
    foot = (20.0, 20.0 * math.tan(math.radians(35)))
    base = [(-30, -15), (80, -15), (80, foot[1]), foot, (0, 0), (0, rim), (-30, rim)]
    block = [(0, 0), foot, (9, 22), (0, rim)]
    blocks = Blocks.from_polygons([np.array(base, float), np.array(block, float)], fixed=[True, False])
    found = dda.factor_of_safety(blocks, [ROCK], [JointLaw("plane", math.radians(33))], WEIGHT)
    expected = math.tan(math.radians(33)) / math.tan(math.radians(35))
    print(rim, found.factor, found.warnings)
    assert found.factor > 1.5 * expected and found.toes_hold
    assert found.other_factor == pytest.approx(expected, rel=1e-3)
    assert "toe of 'block 1' touches 'block 0' at x = 0" in found.warnings[0]
    assert f"without it the factor is {found.other_factor:.4f}" in found.warnings[0]


def test_a_toe_on_which_the_factor_does_not_depend_is_listed_without_a_warning():
    """The block behind the rim stands; another one slides on a steeper plane."""
    foot, top = (20.0, 20.0 * math.tan(math.radians(35))), (-50.0, 1.0 + 20.0 * math.tan(math.radians(50)))
    base = [(-60, -15), (80, -15), (80, foot[1]), foot, (0, 0), (0, 1), (-30, 1), top, (-60, top[1])]
    held = [(0, 0), foot, (9, 22), (0, 1)]
    along = np.array([-math.cos(math.radians(50)), math.sin(math.radians(50))])
    slides = np.array([-30.0, 1.0]) + np.array([[5, 0], [5, 2], [10, 2], [10, 0]]) @ np.array(
        [along, -along[::-1] * [-1, 1]]
    )
    blocks = Blocks.from_polygons([np.array(p, float) for p in (base, held, slides)], fixed=[True, False, False])
    found = dda.factor_of_safety(blocks, [ROCK], [JointLaw("plane", math.radians(33))], WEIGHT)
    assert found.factor == pytest.approx(math.tan(math.radians(33)) / math.tan(math.radians(50)), rel=2e-3)
    assert found.toes and found.toes_hold and not [line for line in found.warnings if "the toe of" in line]
