"""Static steps by operator splitting: the same forces as Newton's method finds, mechanisms, and factors of safety."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.bench.safety.factor_cost import slope_of
from geomech.dda import time_step
from geomech.dda.open_close.static_splitting import KeepsMoving, can_split_statics, split_statics
from geomech.dda.statics import strength_reduction
from geomech.model import ContactSolver, State

#: tan 36°/tan 27°: every slab of the slope slides on its bed.
FACTOR = math.tan(math.radians(36.0)) / math.tan(math.radians(27.0))
EVERY = ContactSolver(static_splitting=1)


def equations_of(factor: float, monkeypatch):
    """The equations of a long static step of some sixty blocks from rest with strengths divided by ``factor``, with a limit
    of motion of 1 cm, and the result of Newton's method."""
    problem, seen = slope_of(60), []
    settle = time_step.settle

    def settling(equations, *rest):
        seen.append((equations, settle(equations, *rest)))
        return seen[-1][1]

    monkeypatch.setattr(time_step, "settle", settling)
    laws = [strength_reduction.reduced(law, factor) for law in problem.joints]
    system = dda.BlockSystem(problem.blocks, problem.materials, laws, problem.joint_index, problem.dda)
    state = State.at_rest(problem.blocks)
    system.step(state, problem.loads, 0.3, load_time=0.0, pseudo_inertia=True)
    equations, settled = seen[0]
    return replace(equations, reach=np.full(problem.blocks.n_blocks, 0.01)), settled


def test_forces_and_motion_are_those_of_newtons_method(monkeypatch):
    equations, settled = equations_of(0.8 * FACTOR, monkeypatch)
    bonded = np.zeros(len(equations.found), np.int64)
    assert can_split_statics(equations, bonded, EVERY) and not can_split_statics(
        replace(equations, reach=None), bonded, EVERY
    )
    found = split_statics(equations, bonded, EVERY)
    # Blocks are balanced to a thousandth of the forces on them: measured 1e-3 of the mean force, and 2e-4 of the largest motion.
    mean = settled.normal_force.mean()
    assert np.sqrt(np.mean((found.forces[:, 0] - settled.normal_force) ** 2)) < 0.01 * mean
    difference = np.abs(found.unknowns - settled.unknowns.ravel())
    assert difference.max() < 0.01 * np.abs(settled.unknowns).max()


def test_blocks_without_support_are_named_with_their_unbalanced_forces(monkeypatch):
    equations, _ = equations_of(1.25 * FACTOR, monkeypatch)
    with pytest.raises(KeepsMoving) as moving:
        split_statics(equations, np.zeros(len(equations.found), np.int64), EVERY)
    # They slide down the beds, to the left or to the right, under a force in the direction of their motion.
    motion, force = moving.value.motion, moving.value.unbalanced
    fastest = motion[np.hypot(motion[:, 0], motion[:, 1]).argmax(), :2]
    assert abs(math.degrees(math.atan(fastest[1] / fastest[0]))) == pytest.approx(27.0, abs=3.0)
    assert fastest[1] < 0.0 and (motion[:, :2] * force[:, :2]).sum() > 0.0


def test_the_factor_is_that_of_sliding():
    problem = slope_of(60)
    settings = replace(problem.dda, contact_solver=EVERY)
    found = dda.factor_of_safety(
        problem.blocks, problem.materials, problem.joints, problem.loads, settings, joint_index=problem.joint_index,
        search=dda.FactorSearch(follow=False),
    )  # fmt: skip
    # The bracket is as wide as 2e-3.
    assert found.factor == pytest.approx(FACTOR, rel=2e-3)
    assert found.lower <= found.factor <= found.upper <= found.lower * 1.0021
    assert found.moving
