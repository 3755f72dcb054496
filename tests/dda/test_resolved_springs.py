"""Contact springs that are no stiffer than the time step resolves: what they leave as it is, and what they save."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.bench.slopes.drawn_slopes import drawn, problem_of
from geomech.bench.slopes.sliding_scenes import Slope
from geomech.dda.joint_laws.penalty_springs import RESOLVED, SOFTEST, penalties, resolved
from geomech.model import OPEN, Blocks, DdaSettings, History, JointLaw, Joints, Loads, Material, State

ROCK = Material("rock", 20e9, 0.25, density=2600.0)
MOTION = DdaSettings(time_step=5e-3, dynamic_factor=1.0)
WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))


def column(height: int) -> Blocks:
    """Unit squares one on another, on a fixed one."""
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    return Blocks.from_polygons(
        [square - [0, 1], *(square + [0, k] for k in range(height))], fixed=[True] + [False] * height
    )


def last(blocks, law, settings, end, state=None):
    """The results of a run until ``end``, s, and the last of them."""
    results = []
    for _ in dda.run(blocks, [ROCK], [law], WEIGHT, settings, end, state=state, watch=results.append):
        pass
    return results, results[-1]


def test_stiffness_follows_the_step_between_half_of_e_and_the_penalty():
    one, other = np.array([0]), np.array([1])
    stiff = penalties(one, other, np.full(1, 0.5), np.full(2, 2e10), np.ones(2), np.zeros(2, bool), np.zeros(2, bool))

    def at(dt, mass=(2600.0, 1000.0)):
        return float(resolved(stiff, one, other, np.array(mass), dt)[0])

    assert at(2e-3) == pytest.approx(RESOLVED * 1000.0 / 2e-3**2)
    assert at(2e-3, (np.inf, 2600.0)) == pytest.approx(RESOLVED * 2600.0 / 2e-3**2)
    assert at(1.0) == pytest.approx(SOFTEST * 2e10) and at(1e-6) == stiff[0]


def test_a_column_at_rest_neither_sinks_nor_springs_when_its_springs_are_eased():
    """Its top stays to a tenth of a micrometre, where on eased springs from the start it would sink by 26; no energy comes
    from nowhere."""
    blocks, law = column(6), JointLaw("joint", friction_angle=0.5)
    tops = {}
    for springs in ("stiff", "resolved"):
        results, end = last(blocks, law, replace(MOTION, springs=springs), 0.3)
        tops[springs] = end.state.vertices[-1, 1]
        assert max(abs(result.energy.residual) for result in results) < 1e-6
    rows = end.state.contacts
    closed = rows["state"] != OPEN
    assert rows["stiffness"][closed] == pytest.approx(RESOLVED * 2600.0 / 5e-3**2, rel=0.05)
    bottom = rows["normal_force"][rows["point"][:, 1] < 0.5].sum()
    assert bottom == pytest.approx(6 * 2600.0 * 9.81, rel=1e-3)
    assert abs(tops["resolved"] - tops["stiff"]) < 1e-7


def test_statics_after_motion_keep_the_forces():
    blocks, law = column(4), JointLaw("joint", friction_angle=0.5)
    _, moved = last(blocks, law, replace(MOTION, springs="resolved"), 0.2)
    still = dda.BlockSystem(blocks, [ROCK], [law], settings=replace(MOTION, springs="resolved")).in_statics()
    result = still.step(moved.state, WEIGHT)
    assert np.abs(result.state.vertices - moved.state.vertices).max() < 1e-7


def test_forces_that_new_faces_inherit_are_kept_as_their_springs_are_eased():
    """A column bears its weight in statics, and its contacts are made anew with the forces they have, as those of a
    block that a crack has cut; in motion they go on with these."""
    blocks, law = column(4), JointLaw("joint", friction_angle=0.5)
    moving = dda.BlockSystem(blocks, [ROCK], [law], settings=replace(MOTION, springs="resolved"))
    still, state = moving.in_statics(), State.at_rest(blocks)
    for _ in range(3):
        state = still.step(state, WEIGHT, 1.0).state
    found, rows = still.contacts_near(state), state.contacts
    assert np.array_equal(found.vertex, rows["vertex"])
    which = np.arange(len(rows))
    forces = dda.InheritedContacts(which, rows["normal_force"], rows["shear_force"], rows["gap"], rows["slip"])
    state = still.with_inherited_contacts(state, found, forces)
    result = moving.step(state, WEIGHT)
    pressed = rows["state"] != OPEN
    assert (result.contacts["stiffness"][pressed] < 0.02 * rows["stiffness"][pressed]).all()
    assert result.contacts["normal_force"] == pytest.approx(rows["normal_force"], rel=1e-3, abs=1.0)


def test_bonds_and_joints_with_a_stiffness_of_their_own_stay():
    blocks = column(3)
    for law in (
        JointLaw("glue", friction_angle=0.5, cohesion=1e6, tensile_strength=1e6),
        JointLaw("soft", friction_angle=0.5, normal_stiffness=1e10, shear_stiffness=1e10),
    ):
        one, two = (last(blocks, law, replace(MOTION, springs=springs), 0.1)[1] for springs in ("stiff", "resolved"))
        assert np.array_equal(one.state.vertices, two.state.vertices)


def test_a_slope_slides_as_on_stiff_springs_in_fewer_iterations():
    """Beds at 35°: the work of gravity until 0.2 s within 1 %."""
    problem = problem_of(drawn(Slope(35.0, 70.0, 0.0, 4.0, 4.0).text(8e-3, 0.2)))
    work, iterations = {}, {}
    for springs in ("stiff", "resolved"):
        results = []
        settings = replace(problem.dda, springs=springs)
        for _ in dda.run(
            problem.blocks, problem.materials, Joints(problem.joints, problem.joint_index), problem.loads, settings, 0.2,
            watch=results.append,
        ):  # fmt: skip
            pass
        work[springs] = sum(result.energy.gravity_work for result in results)
        iterations[springs] = sum(result.statistics["open_close_iterations"] for result in results)
    assert work["resolved"] == pytest.approx(work["stiff"], rel=1e-2)
    assert iterations["resolved"] <= iterations["stiff"]
