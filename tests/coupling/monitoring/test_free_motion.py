"""Bodies without friction that drift in a static run are named, and only these."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest

from geomech.coupling import Coupling
from geomech.coupling.load_pass import balanced
from geomech.coupling.monitoring.free_motion import FreeMotion
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    History,
    JointLaw,
    Loads,
    Material,
    PointMotion,
    Problem,
    RunSettings,
)

BASE = np.array([[-3.0, -1.0], [3.0, -1.0], [3.0, 0.0], [-3.0, 0.0]])
BLOCK = np.array([[-0.5, 0.0], [0.5, 0.0], [0.5, 1.0], [-0.5, 1.0]])


def on_a_base(friction: float, *, order: int = 1, held: bool = False) -> Problem:
    """A block on a fixed base under its weight, or with a point that is ``held``."""
    still = PointMotion(1, (0.0, 1.0), History.constant((0.0,)), direction=(1.0, 0.0))
    orders = None if order == 1 else [1, order]
    return Problem(
        title="block on a base",
        blocks=Blocks.from_polygons([BASE, BLOCK], fixed=[True, False], order=orders, names=["base", "block"]),
        cracks=Cracks.from_polylines([]),
        materials=(Material("rock", 20e9, 0.25, 2500.0),),
        joints=(JointLaw("joint", friction),),
        loads=Loads(gravity=History.constant([0.0, -9.81]), point_motions=(still,) if held else ()),
        dda=DdaSettings(time_step=1.0),
        run=RunSettings(end_time=4.0),
    )


def drifts(problem: Problem, caplog, by: float = 1e-3) -> bool:
    """Whether the block is named when its last step, at rest, has displaced it by ``by``, m."""
    run = Coupling(problem)
    *_, _ = run.cycles()
    assert "nothing keeps" not in caplog.text
    result = balanced(run.now, 1.0, 4.0).result
    velocity = result.state.velocity.copy()
    velocity[1, 0] += by
    caplog.clear()
    FreeMotion().check(run.now, replace(result, state=replace(result.state, velocity=velocity)))
    return "nothing keeps block in place along" in caplog.text


@pytest.mark.parametrize("order", [1, 3])
def test_a_block_without_friction_that_drifts_is_named(caplog, order):
    caplog.set_level(logging.WARNING)
    assert drifts(on_a_base(0.0, order=order), caplog)


@pytest.mark.parametrize("more", [{"friction": 0.3}, {"friction": 0.0, "held": True}])
def test_a_block_with_friction_or_that_is_held_is_not(caplog, more):
    caplog.set_level(logging.WARNING)
    assert not drifts(on_a_base(**more), caplog)


def test_a_block_that_rests_is_not(caplog):
    """Also without friction: nothing moves it."""
    caplog.set_level(logging.WARNING)
    assert not drifts(on_a_base(0.0), caplog, by=0.0)
