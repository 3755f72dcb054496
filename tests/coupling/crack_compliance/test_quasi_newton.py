"""Blocks and cracks that have to agree: passes on blocks whose contacts open and close, and the acceleration alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech.bench.cost.block_scenes import cracked_wall
from geomech.coupling import cycles
from geomech.coupling.crack_compliance.added_compliance import strain_rotation
from geomech.coupling.crack_compliance.quasi_newton import QuasiNewton, strain_size
from geomech.dda import BlockSystem
from geomech.model import History, Loads, State


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("friction", [0.0, 30.0])
def test_passes_settle_on_shaken_bricks_with_closed_cracks(friction):
    """Bricks that fall onto each other and are shaken by 0.3 g at 10 Hz, one in three with a closed crack: contacts
    and crack faces change their states in every step, and passes agree in each. (With tractions that jumped as a
    contact went, one step in ten never did.)"""
    given = cracked_wall(40, 13)
    times = np.linspace(0.0, 0.1, 401)
    shaking = np.column_stack([3.0 * np.sin(20 * np.pi * times), np.full(401, -9.81)])
    given = replace(
        given,
        cracks=replace(given.cracks, aperture=np.zeros(given.cracks.n_segments)),
        face_laws=(replace(given.joints[0], friction_angle=np.radians(friction)),),
        loads=Loads(gravity=History(times, shaking)),
        dda=replace(given.dda, time_step=1e-3),
        run=replace(given.run, end_time=0.009),
    )
    seen = [cycle for cycle in cycles(given) if cycle.number]
    assert max(cycle.statistics["compliance_mismatch"] for cycle in seen) < 1e-4
    assert np.mean([cycle.statistics["compliance_passes"] for cycle in seen]) < 5


def test_a_pass_begins_with_the_contact_states_of_the_one_before():
    """… and ends where it would have ended anyway, at a fraction of the iterations: bricks that come under their
    weight."""
    given = cracked_wall(60, 20)

    def step(like):
        system = BlockSystem(given.blocks, given.materials, given.joints, None, given.dda)
        return system.step(State.at_rest(given.blocks), given.loads, 0.01, None, None, like)

    alone = step(None)
    again = step(alone)
    assert alone.statistics["open_close_iterations"] > 5
    assert again.statistics["open_close_iterations"] == 1
    moved = np.abs(alone.state.vertices - given.blocks.vertices).max()
    assert np.abs(again.state.vertices - alone.state.vertices).max() < 1e-9 * moved


def test_acceleration_solves_a_linear_agreement_in_as_many_passes_as_it_has_unknowns():
    """x = A x + b of three unknowns, whose plain iteration would need 60 passes for 1e-6: Anderson's is GMRES then
    (Walker & Ni 2011, theorem 2.2), which is done after three steps more."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    matrix, given = turn @ np.diag([0.8, -0.5, 0.3]) @ turn.T, np.array([1.0, 2.0, 3.0])
    exact = np.linalg.solve(np.eye(3) - matrix, given)
    settling, offset = QuasiNewton(), np.zeros((1, 3))
    for _ in range(5):
        residual = (offset @ matrix.T + given) - offset
        offset = settling.next(offset, residual, np.ones((1, 3, 3)), np.ones(1))
    assert offset[0] == pytest.approx(exact, rel=1e-9)


def test_what_one_solution_has_learnt_another_need_not():
    """The same matrix, another b, as at another load: after one pass the next one is exact. Beside it, as at cracks that
    have grown, what was learnt is nearly true: each pass gains as much as the matrix is alike. Of other blocks, or once
    it has led astray, nothing is kept."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    matrix = turn @ np.diag([0.8, -0.5, 0.3]) @ turn.T
    settling = QuasiNewton()

    def passes(matrix, given, most, blocks=(7,)) -> list[float]:
        """Largest differences of the passes of one solution."""
        settling.begin(blocks)
        offset, left = np.zeros((1, 3)), []
        for _ in range(most):
            residual = (offset @ matrix.T + given) - offset
            left.append(float(np.abs(residual).max()))
            offset = settling.next(offset, residual, np.ones((1, 3, 3)), np.ones(1))
        return left

    passes(matrix, np.array([1.0, 2.0, 3.0]), 5)
    assert passes(matrix, np.array([3.0, -1.0, 2.0]), 2)[1] < 1e-12
    near = passes(1.02 * matrix, np.array([1.0, 1.0, -4.0]), 3)
    assert near[1] < 0.2 * near[0] and near[2] < 0.1 * near[1]
    assert passes(-matrix, np.array([1.0, 2.0, 3.0]), 6)[5] < 1e-9
    passes(matrix, np.array([1.0, 2.0, 3.0]), 5)
    others = passes(matrix, np.array([3.0, -1.0, 2.0]), 5, blocks=(8,))
    assert others[1] > 0.1 and others[4] < 1e-9


def test_answers_that_turn_about_with_the_states_of_faces_are_relaxed():
    """x = c − 1.3 x of a block whose S is another one in every pass: handing back what was found goes away from the
    answer for ever; relaxed, it is there to 1e-6 after a few passes. A second block, at peace, is not held back."""
    settling, offset = QuasiNewton(), np.zeros((2, 3))
    target = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    for n in range(8):
        found = np.stack([2.3 * target[0] - 1.3 * offset[0], target[1]])
        offset = settling.next(offset, found - offset, np.full((2, 3, 3), 1.0 + n), np.ones(2))
    assert offset == pytest.approx(target, rel=1e-6)


@pytest.mark.slow
def test_passes_settle_while_cracks_grow_through_shaken_bricks():
    """Closed rough cracks that grow, meet sides and part bricks under their sudden weight and 0.3 g: faces of nearly
    cut bricks open in one pass and close in the next (and did so for ever, one growing pass in ten 0.5 to 0.9 off). All
    passes agree, most of them after three or four."""
    given = cracked_wall(100, 10)
    times = np.linspace(0.0, 0.1, 401)
    shaking = np.column_stack([3.0 * np.sin(10 * np.pi * times), np.full(401, -9.81)])
    rock = replace(given.materials[0], k_ic=2.2e4)
    given = replace(
        given,
        materials=(rock,),
        cracks=replace(given.cracks, aperture=np.zeros(given.cracks.n_segments)),
        face_laws=(replace(given.joints[0], friction_angle=np.radians(30.0)),),
        loads=Loads(gravity=History(times, shaking)),
        dda=replace(given.dda, time_step=2e-3),
        run=replace(given.run, end_time=0.016, stop_at=()),
    )
    seen = [cycle for cycle in cycles(given) if cycle.number]
    assert sum(event.kind == "split" for cycle in seen for event in cycle.events) >= 2
    assert max(cycle.statistics["compliance_mismatch"] for cycle in seen) < 1e-4
    assert np.mean([cycle.statistics["compliance_passes"] for cycle in seen]) < 5
    told = seen[-1].statistics
    # Blocks spend on their cracks what is there to be spent (by ∫ G da of held forces on ligaments it was three times
    # the weight's work).
    spent = told["crack_elastic"] + told["crack_friction"] + told["fracture_energy"]
    assert spent < 0.01 * told["gravity_work"]
    assert abs(told["energy_residual"]) < 1e-5 * told["gravity_work"]


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.2])
def test_acceleration_does_not_depend_on_the_axes(turn):
    """Three blocks whose strains oscillate: offsets in axes turned by any angle are the turned offsets, in every pass."""
    rng = np.random.default_rng(4)
    size, compliance = np.array([1.0, 0.4, 2.0]), np.zeros((3, 3, 3))
    steps = [(rng.normal(size=(3, 3)), (-1.0) ** k * rng.normal(size=(3, 3))) for k in range(7)]
    plain, turned = QuasiNewton(), QuasiNewton()
    to = strain_rotation(turn)
    for k, (offset, residual) in enumerate(steps):
        if k in (0, 4):
            for each in (plain, turned):
                each.begin((0, 1, 2))
        found = plain.next(offset, residual, compliance, size)
        assert turned.next(offset @ to.T, residual @ to.T, compliance, size) @ np.linalg.inv(to).T == pytest.approx(
            found, rel=1e-9, abs=1e-9
        )
        assert strain_size(residual @ to.T) == pytest.approx(strain_size(residual), rel=1e-12)
