"""What the answers of cracks at two loads foretell of a third, and how many passes that leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech.coupling import cycles
from geomech.coupling.crack_compliance.load_extrapolation import Answer, LoadExtrapolation
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)

ROCK = Material("rock", 10e9, 0.2, density=2500.0, k_ic=1e12)


def loads(time: float, aside: float = 0.0) -> np.ndarray:
    """A weight that grows, beside loads that stay."""
    return np.array([aside, -10.0 * time, 3e5])


def answer(time: float, systems: tuple, softer: float = 1.0) -> Answer:
    """Of two blocks, whose cracks open by S σ and beyond it by 3 and −2 times the time."""
    s = np.stack([np.eye(3), softer * np.eye(3)])
    stress = time * np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 1.0]])
    beyond = time * np.array([[3.0, 0.0, 0.0], [0.0, -2.0, 0.0]]) + 0.5
    return Answer(loads(time), systems, beyond + (s @ stress[..., None])[..., 0], stress, s)


def test_a_third_load_lies_on_the_line_through_two():
    systems = object(), object()
    extrapolation = LoadExtrapolation()
    extrapolation.take((4, 9), answer(1.0, systems))
    extrapolation.take((4, 9), answer(2.0, systems))
    known, beyond, s = extrapolation.at(loads(5.0), (4, 9), systems)
    assert known.all() and np.array_equal(s, answer(5.0, systems).compliance)
    assert beyond == pytest.approx(answer(5.0, systems).beyond(s), rel=1e-12)
    # Beside the line the nearest load is all that is known.
    beside = extrapolation.at(loads(5.0, aside=1.0), (4, 9), systems)[1]
    assert beside == pytest.approx(answer(2.0, systems).beyond(s), rel=1e-12)
    # Faces of the second block have changed: of it the nearest load is all that is known.
    extrapolation.take((4, 9), answer(3.0, systems, softer=1.5))
    known, beyond, s = extrapolation.at(loads(5.0), (4, 9), systems)
    assert beyond[0] == pytest.approx(answer(5.0, systems).beyond(s)[0], rel=1e-12)
    assert beyond[1] == pytest.approx(answer(3.0, systems, softer=1.5).beyond(s)[1], rel=1e-12)
    # Its cracks have grown: of them nothing is.
    assert extrapolation.at(loads(5.0), (4, 9), (systems[0], object()))[0].tolist() == [True, False]
    assert not extrapolation.at(loads(5.0), (4, 8), systems)[0].any()


def bench(**changes) -> Problem:
    """A block with an edge crack, glued to one that stands fast by half of its side, comes under its weight and is
    pulled: forces that press and bend it unevenly, and contacts that pass them on by how it is strained."""
    wall = np.array([[-2.0, -1.0], [0.0, -1.0], [0.0, 2.0], [-2.0, 2.0]])
    beam = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 1.0]])
    prop = np.array([[1.5, -1.0], [3.0, -1.0], [3.0, 0.0], [1.5, 0.0]])
    line = np.array([[0.9, 1.0], [1.0, 0.6]])
    pull = EdgeTraction("end", History.ramp([2e4, 0.0]))
    given = Problem(
        title="bench",
        blocks=Blocks.from_polygons(
            [wall, beam, prop], fixed=[True, False, False], edge_names=[[[""] * 4], [["", "end", "", ""]], [[""] * 4]]
        ),
        cracks=Cracks.from_polylines([line], block=1, aperture=np.inf, surface=[(True, False)]),
        materials=(ROCK,),
        joints=(JointLaw("glue", 0.6, 1e12, 1e12),),
        loads=Loads(gravity=History.ramp([0.0, -9.81]), edge_tractions=(pull,)),
        dda=DdaSettings(time_step=0.25, dynamic_factor=0.0, max_displacement_ratio=0.1),
        growth=GrowthSettings(increment=0.05, max_passes=3),
        run=RunSettings(end_time=1.5, stop_at=("split",)),
    )
    return replace(given, **changes)


def test_a_pass_or_two_where_the_response_is_linear():
    """Passes find no more than how the block's shape has changed. (Each took three or four.)"""
    passes = [c.statistics["compliance_passes"] for c in cycles(bench()) if c.number]
    assert len(passes) == 6 and max(passes) <= 2


def test_what_is_foretold_is_no_other_answer():
    """The state after six loads is that of all of the load at once, but for the shape of the blocks in between."""
    by_steps = list(cycles(bench()))[-1].state
    at_once = list(cycles(bench(dda=replace(bench().dda, time_step=1.5))))[-1].state
    assert by_steps.crack_strain[1] == pytest.approx(at_once.crack_strain[1], rel=1e-3)
