"""Rounds of lagged friction: their normal forces settle, also where bonds pull."""

import numpy as np
import pytest

from geomech import dda
from geomech.dda import time_step
from geomech.dda.open_close.lagged_friction import LaggedFriction
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State

ROCK = Material("rock", 1e9, 0.25, density=2500.0)
GLUE = JointLaw("glue", friction_angle=np.radians(35), cohesion=1e6, tensile_strength=1e6)


@pytest.mark.parametrize("gravity", [[0.0, -9.81], [8.0, -9.81]])
def test_rounds_come_to_an_end_where_a_block_hangs_on_its_bonds(monkeypatch, gravity):
    """A block glued below a roof: its bonds pull, and what pulls has no friction, nor is it a change from round to
    round."""
    asked = []

    def settle(*arguments, **named):
        asked.append(arguments)
        return true_settle(*arguments, **named)

    true_settle = time_step.settle
    monkeypatch.setattr(time_step, "settle", settle)
    roof = np.array([[-1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [-1.0, 2.0]])
    block = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    blocks = Blocks.from_polygons([roof, block], fixed=[True, False])
    of = dda.BlockSystem(blocks, [ROCK], [GLUE], settings=DdaSettings(time_step=1e-2))
    result = of.step(State.at_rest(blocks), Loads(gravity=History.constant(gravity)))
    assert (result.contacts["normal_force"] < 0).any() and (result.contacts["bonded"] > 0).any()
    pattern, matrix, right, found, vectors, springs, gap, *_ = asked[-1]
    rounds = LaggedFriction(pattern, matrix, right, found, vectors, springs, gap, found.bonded).rounds()
    changes = [change for _, change in zip(range(40), rounds)]
    assert changes[-1] < 1e-9
