"""Runs that seek static equilibrium by themselves: before they begin, at every load, and where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech.coupling import cycles
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    DdmSettings,
    GrowthSettings,
    History,
    InSituStress,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)


def column(gravity, *, friction=0.6, crack=False, **settings) -> Problem:
    """Two blocks 2 cm above a fixed floor."""
    boxes = [(-2, -1, 3, 0), (0, 0.02, 1, 1.02), (0, 1.02, 1, 2.02)]
    blocks = Blocks.from_polygons(
        [np.array([[a, b], [c, b], [c, d], [a, d]], float) for a, b, c, d in boxes],
        fixed=[True, False, False],
        names=["floor", "lower", "upper"],
    )
    line = [np.array([[0.4, 0.5], [0.6, 0.55]])] if crack else []
    return Problem(
        title="column",
        blocks=blocks,
        cracks=Cracks.from_polylines(line, block=[1] * len(line)),
        materials=(Material("rock", 10e9, 0.25, density=2500.0, k_ic=1e6),),
        joints=(JointLaw("joint", friction_angle=friction),),
        loads=Loads(gravity=gravity),
        dda=DdaSettings(time_step=0.5, max_displacement_ratio=0.01, **settings),
        ddm=DdmSettings(order=3),
        growth=GrowthSettings(increment=0.01),
        run=RunSettings(end_time=1.0),
    )


WEIGHT = History.constant([0.0, -9.81])


@pytest.mark.parametrize("crack", [False, True])
def test_every_load_finds_its_equilibrium(crack):
    # Gravity doubles in the second half; one static step of 0.5 s would leave the blocks hanging in the air.
    gravity = History(np.array([0.0, 0.5, 1.0]), np.array([[0, -9.81], [0, -9.81], [0, -19.62]]))
    seen = list(cycles(column(gravity, equilibrium="loads", crack=crack)))
    assert seen[0].state.vertices[4:8, 1].min() == pytest.approx(0.0, abs=1e-6)
    for cycle, g in ((seen[0], 9.81), (seen[1], 9.81), (seen[-1], 19.62)):
        rows = cycle.state.contacts[cycle.state.contacts["other"] == 0]
        assert rows["normal_force"].sum() == pytest.approx(2 * 2500 * g, rel=1e-5)
    assert seen[-1].state.time == pytest.approx(1.0)
    if crack:
        assert seen[-1].tips["k_ii"] != pytest.approx(np.zeros(2), abs=1.0)


def test_a_dynamic_run_may_begin_at_rest():
    first, *rest = cycles(column(WEIGHT, equilibrium="start", dynamic_factor=1.0))
    assert not first.state.velocity.any()
    assert first.state.stress[1:, 1] == pytest.approx(-2500 * 9.81 * np.array([1.5, 0.5]), rel=1e-4)
    assert np.abs(rest[-1].state.velocity).max() < 1e-6
    assert rest[-1].state.vertices == pytest.approx(first.state.vertices, abs=1e-8)


@pytest.mark.parametrize("when", ["start", "loads"])
def test_a_run_ends_where_there_is_none_and_names_what_moves(when):
    lean = History(np.array([0.0, 0.5]), np.array([[0, -9.81], [2.0 if when == "loads" else 0.0, -9.81]]))
    if when == "start":
        lean = History.constant([2.0, -9.81])
    seen = list(cycles(column(lean, equilibrium=when, friction=0.1)))
    (event,) = seen[-1].events
    assert event.kind == "collapse"
    assert "'upper', 'lower' move" in event.detail or "'lower', 'upper' move" in event.detail
    assert len(seen) == (1 if when == "start" else 2)


def test_a_run_ends_where_nothing_holds_the_blocks_under_the_in_situ_stress():
    """As one that is to begin at rest: with the blocks that go, not with an error."""
    stress = InSituStress.geostatic(2.02, 2500 * 9.81, 0.5)
    problem = replace(column(History.constant([2.0, -9.81]), friction=0.1), in_situ=stress)
    (only,) = cycles(problem)
    (event,) = only.events
    assert event.kind == "collapse" and event.detail.startswith("under the in-situ stress there is no equilibrium")
    assert "'upper', 'lower' move" in event.detail or "'lower', 'upper' move" in event.detail
    assert len(list(cycles(replace(problem, loads=Loads(gravity=WEIGHT))))) > 1


def test_motion_that_is_given_is_given_once():
    # A guided plate pushes the column down by 1 mm in all, half of it at each load.
    from geomech.model import BlockMotion

    pushed = History(np.array([0.0, 1.0]), np.array([[0.0], [-1e-3]]))
    problem = column(History.constant([0.0, 0.0]), equilibrium="loads")
    vertices = problem.blocks.vertices.copy()
    vertices[4:, 1] -= 0.02
    problem = replace(
        problem,
        blocks=problem.blocks.with_vertices(vertices),
        loads=Loads(block_motions=(BlockMotion(2, pushed, ("v0",)),)),
    )
    seen = list(cycles(problem))
    centre = [
        s.blocks.mean_vertices(s.state.vertices)[2, 1] - s.blocks.mean_vertices(s.blocks.vertices)[2, 1] for s in seen
    ]
    assert [s.state.time for s in seen] == pytest.approx([0.0, 0.5, 1.0])
    assert centre == pytest.approx([0.0, -0.5e-3, -1e-3], abs=1e-12)
