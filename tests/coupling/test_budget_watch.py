"""A run whose energy is not accounted for says so, once, with the time."""

from __future__ import annotations

import logging
import re

import numpy as np
import pytest

from geomech.coupling import cycles
from geomech.coupling.budget_watch import BudgetWatch
from geomech.dda.energy import GAIN
from geomech.model import Blocks, Cracks, DdaSettings, History, JointLaw, Loads, Material, Problem, RunSettings


def test_a_share_beyond_the_bound_is_told_once(caplog):
    watch = BudgetWatch()
    with caplog.at_level(logging.WARNING):
        for time, share in ((1.0, 0.9 * GAIN), (2.0, float("nan")), (3.0, -1.5 * GAIN), (4.0, 20.0)):
            watch.check(share, time)
    (line,) = [record.getMessage() for record in caplog.records]
    assert line.startswith("t = 3 s: -0.015 of all energy") and "shorten" in line


def test_a_beam_that_turns_far_in_a_static_step_is_told_of(caplog):
    """A soft beam on a glued end turns by some degrees at once: static steps keep its forces where they began."""
    beam = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 1.0], [0.0, 1.0]])
    wall = np.array([[-2.0, -1.0], [0.0, -1.0], [0.0, 2.0], [-2.0, 2.0]])
    problem = Problem(
        title="a soft beam",
        blocks=Blocks.from_polygons([wall, beam], fixed=[True, False]),
        cracks=Cracks.from_polylines([]),
        materials=(Material("rock", 1e8, 0.2, density=2500.0),),
        joints=(JointLaw("glue", 0.6, 1e12, 1e12),),
        loads=Loads(gravity=History.ramp([0.0, -9.81])),
        dda=DdaSettings(time_step=0.25, dynamic_factor=0.0, max_displacement_ratio=0.2),
        run=RunSettings(end_time=1.0),
    )
    with caplog.at_level(logging.WARNING):
        shares = {c.state.time: c.statistics["budget_residual"] for c in cycles(problem) if c.number}
    over = [time for time, share in shares.items() if abs(share) > GAIN]
    lines = [record.getMessage() for record in caplog.records if "not accounted for" in record.getMessage()]
    assert over and len(lines) == 1
    # Six digits of it are told.
    assert float(re.match(r"t = (\S+) s", lines[0])[1]) == pytest.approx(over[0], rel=1e-5)
