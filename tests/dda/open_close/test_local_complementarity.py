"""States of a few contacts together: against the laws they are to keep, and against the states of the whole step."""

from __future__ import annotations

import numpy as np
import pytest

from geomech.dda import time_step
from geomech.dda.open_close.local_complementarity import clusters, settled_together, states_that_fit
from geomech.model import OPEN, SLIP, STICK, Blocks, DdaSettings, History, JointLaw, Loads, Material, State


def forces_in(state, direction, given, answers, kn, friction, firm):
    """N, S (k,) of contacts in these states, and the gap and slip (k,) that each leaves, by the linear equations."""
    k = len(kn)
    matrix, right = np.zeros((2 * k, 2 * k)), np.zeros(2 * k)
    for c in range(k):
        if state[c] == OPEN:
            matrix[c, c] = matrix[k + c, k + c] = 1.0
            continue
        matrix[c], right[c] = answers[c], -given[c]
        if state[c] == STICK:
            matrix[k + c], right[k + c] = answers[k + c], -given[k + c]
        else:
            matrix[k + c, k + c], matrix[k + c, c] = 1.0, -direction[c] * friction[c]
            right[k + c] = direction[c] * firm[c]
    force = np.linalg.solve(matrix, right)
    moved = given + answers @ force
    return force[:k], force[k:], moved[:k], moved[k:]


@pytest.mark.parametrize("k", [1, 2, 5, 12])
def test_states_keep_the_laws_of_contact_and_friction(k):
    rng = np.random.default_rng(k)
    for _ in range(40):
        factor = rng.normal(size=(2 * k, k + 1))
        kn, ks = 10 ** rng.uniform(0, 3, k), 10 ** rng.uniform(0, 3, k)
        answers = factor @ factor.T + np.diag(1.0 / np.concatenate([kn, ks]))
        given = rng.normal(size=2 * k)
        friction, firm = rng.choice([0.0, 0.3, 1.2], k), np.zeros(k)
        if trial := rng.random() < 0.3:
            # Strength that nothing has to press: all are closed.
            given[:k], firm = -10.0 - given[:k] ** 2, rng.choice([0.0, 0.1], k)
        state, direction = states_that_fit(given, answers, kn, friction, firm)
        normal, shear, gap, slip = forces_in(state, direction, given, answers, kn, friction, firm)
        if trial and (state == OPEN).any():
            continue
        strength = np.where(state == OPEN, 0.0, friction * normal + firm)
        assert (normal > -1e-7).all() and (gap > -1e-7).all()
        assert np.abs(normal * gap).max() < 1e-7
        assert (np.abs(shear) <= strength + 1e-7).all()
        # Friction acts against what slides.
        slides = state == SLIP
        assert (shear[slides] * slip[slides] <= 1e-7).all()
        assert np.abs(shear[slides]) == pytest.approx(strength[slides], abs=1e-7)


def test_a_contact_that_neither_sticks_nor_slides_as_its_shear_says_slides_the_other_way():
    """Pushed along a slope it is pressed harder, so that it would slide back: only sliding up fits, or sticking."""
    answers = np.array([[1.0, -1.6], [-1.6, 3.0]]) + 1e-3 * np.eye(2)
    for along in np.linspace(-1.0, 1.0, 21):
        given = np.array([-0.2, along])
        fitting = states_that_fit(given, answers, np.array([1e3]), np.array([0.84]), np.zeros(1))
        normal, shear, gap, slip = forces_in(*fitting, given, answers, np.ones(1), np.array([0.84]), np.zeros(1))
        assert normal[0] * gap[0] == pytest.approx(0.0, abs=1e-7) and abs(shear[0]) <= 0.84 * normal[0] + 1e-7
        assert slip[0] * shear[0] <= 1e-7


def _wall(columns: int, rows: int) -> Blocks:
    """Bricks 2 × 1 in bond, on a fixed base."""
    polygons = [np.array([[-1.0, -1], [2 * columns + 1, -1], [2 * columns + 1, 0], [-1, 0]])]
    for row in range(rows):
        for column in range(columns - row % 2):
            x = 2 * column + row % 2
            polygons.append(np.array([[x, row], [x + 2, row], [x + 2, row + 1], [x, row + 1]], float))
    return Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))


def test_states_of_a_few_are_those_of_the_whole_step(monkeypatch):
    """A step of a wall that a sideways weight shears; the states of the contacts of some blocks are forgotten and found
    again while the others stand."""
    known = []
    settle = time_step.settle
    monkeypatch.setattr(
        time_step, "settle", lambda *args, **named: known.append((args, settle(*args, **named))) or known[-1][1]
    )
    from geomech import dda

    law = JointLaw("joint", 0.6, normal_stiffness=5e9, shear_stiffness=2e9)
    system = dda.BlockSystem(
        _wall(8, 8), [Material("rock", 1e10, 0.2, density=2500.0)], [law], settings=DdaSettings(dynamic_factor=1.0)
    )
    assert len(system.moving) == 60
    state, loads = State.at_rest(system.blocks), Loads(gravity=History.constant([6.0, -9.81]))
    for _ in range(3):
        state = system.step(state, loads, 0.01).state
    (pattern, matrix, right, found, vectors, springs, gap, *_), settled = known[-1]
    assert {OPEN, STICK, SLIP} <= set(settled.state.tolist())
    rng = np.random.default_rng(0)
    for _ in range(5):
        blocks = rng.choice(system.moving, 3, replace=False)
        which = np.isin(found.block, blocks) | np.isin(found.other, blocks)
        which &= rng.random(len(which)) < 0.7
        wrong = np.where(which, rng.integers(0, 3, len(which)), settled.state)
        again = settled_together(
            which, wrong, settled.direction, pattern, matrix, right, found, vectors, springs, gap
        )  # fmt: skip
        assert again is not None
        rubs = settled.state == SLIP
        assert (again[0] == settled.state).all() and (again[1] == settled.direction)[rubs].all()
        parts = clusters(which, found, pattern.order)
        assert np.array_equal(np.sum(parts, axis=0), which)
        touched = [set(found.block[p]) | set(found.other[p]) for p in parts]
        assert all(not (a & b) - {0} for i, a in enumerate(touched) for b in touched[:i])


def test_a_wall_that_comes_to_bear_on_many_joints_is_not_sought_set_by_set():
    """Dozens of sets of contacts would take forty substitutions an iteration: more than the states of all together."""
    from geomech import dda
    from geomech.bench.cost import block_scenes

    blocks = block_scenes.wall(990)
    law = JointLaw("joint", friction_angle=block_scenes.FRICTION)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [law], settings=block_scenes.settings(0.01))
    state = system.step(State.at_rest(blocks), block_scenes.WEIGHT).state
    counts = system._sparse[1].solver.counts
    before = counts["substitutions"]
    result = system.step(state, block_scenes.WEIGHT)
    iterations = result.statistics["open_close_iterations"]
    print(f"{counts['substitutions'] - before} substitutions in {iterations} iterations")
    assert iterations < 40
    assert counts["substitutions"] - before < 6 * iterations
