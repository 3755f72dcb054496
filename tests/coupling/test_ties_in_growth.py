"""Where two outcomes of growth in blocks are equally near in exact arithmetic, rounding does not choose between them:
inputs that are off by their last digits have one outcome."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from geomech.coupling import cycles
from geomech.coupling.growth.crack_initiation import first_new_cracks
from geomech.coupling.growth.tip_speed_limit import TipSpeed
from geomech.ddm.growth import initiation
from geomech.model import (
    TIP,
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    Loads,
    Material,
    Problem,
    RunSettings,
)

pytestmark = pytest.mark.other_machines

ROCK = Material("rock", 17e9, 0.21, 2200.0, 1e6)
OFF = (0.0, 1e-14, -1e-14)
W, H = 0.03, 0.06


def plate(rate: float = 0.2e6) -> Problem:
    """A plate 2W wide under tension that rises by ``rate`` Pa/s, with a crack across its middle, 9 mm from either edge when
    it has grown by 6 mm."""
    polygon = np.array([[-W, -H], [W, -H], [W, H], [-W, H]])
    ends = (("load:top", rate), ("load:bottom", -rate))
    return Problem(
        title="plate",
        blocks=Blocks.from_polygons([polygon], edge_names=[[["load:bottom", "", "load:top", ""]]]),
        cracks=Cracks.from_polylines([np.array([[-0.015, 0.0], [0.015, 0.0]])]),
        materials=(ROCK,),
        joints=(),
        loads=Loads(edge_tractions=tuple(EdgeTraction(name, History.ramp([0.0, rate])) for name, rate in ends)),
        growth=GrowthSettings(increment=6e-3),
        run=RunSettings(end_time=1e4, stop_at=("split",), stepping="events", control="toughness"),
        load_edge="load:top",
    )


def test_both_tips_of_a_plate_go_on_and_through_together():
    """Increments of 6 mm and a join distance of 3 mm leave 3 mm of 9 mm at either side, just as far as would be near:
    both tips end in the rock, then run out to the edges at one load."""
    for off in OFF:
        for shift in OFF:
            problem = plate()
            crack = np.array([[-0.015, 0.0], [0.015 * (1 + off), 0.0]]) + W * shift
            grown = [
                cycle.tips["grown"]
                for cycle in cycles(replace(problem, cracks=Cracks.from_polylines([crack])))
                if len(cycle.tips) and cycle.tips["grown"].any()
            ]
            np.testing.assert_allclose(grown, [[6e-3, 6e-3], [6e-3, 6e-3], [3e-3, 3e-3]], rtol=1e-9)


def test_a_fixed_step_to_just_the_toughness_grows_both_tips():
    """Steps of 1 s, the first to the load at which K_eq = K_Ic but for rounding: K is proportional to the load."""
    fixed = RunSettings(end_time=1.0, stop_at=())

    def first(rate: float) -> np.ndarray:
        problem = replace(plate(rate), run=fixed, dda=DdaSettings(time_step=1.0))
        return next(cycle.tips for cycle in cycles(problem) if len(cycle.tips))

    rate = 0.2e6
    for _ in range(3):
        rate *= ROCK.k_ic / first(rate)["k_eq"].min()
    for off in (*OFF, 1e-12, -1e-12):
        tips = first(rate * (1 + off))
        assert tips["k_eq"] == pytest.approx(ROCK.k_ic, rel=1e-11)
        assert tips["grown"] == pytest.approx([6e-3, 6e-3], rel=1e-9)
    assert not first(rate * (1 - 1e-6))["grown"].any()


def test_of_blocks_that_are_alike_the_first_breaks(monkeypatch):
    blocks = Blocks.from_polygons([np.array([[x, 0.0], [x + 1, 0.0], [x + 1, 1.0], [x, 1.0]]) for x in (0.0, 2.0)])
    for off in OFF:
        size = {0: 1.0 - off, 1: 1.0 + off}
        found = {b: [initiation.NewCrack("tension", "surface", size[b], (0.0, 0.0), (0.0, 0.1))] for b in size}
        monkeypatch.setattr(initiation, "new_cracks", lambda solution, *rest: found[solution])  # noqa: B023
        born, where = first_new_cracks(blocks, (ROCK,), {0: 0, 1: 1}, GrowthSettings())
        assert where == 0 and born == found[0]


def test_a_way_of_just_the_shortest_increment_is_gone():
    """Steps that each give a part of it; of 19 and 24 the sum is less than it by rounding."""
    blocks = Blocks.from_polygons([np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])])
    tips = np.zeros(1, TIP)
    for part in (3, 10, 19, 24):
        growth = GrowthSettings(increment=1e-2, min_increment=1e-3, speed_limit=0.4)
        dt = growth.min_increment / part / (growth.speed_limit * ROCK.rayleigh_speed)
        speed = TipSpeed(SimpleNamespace(growth=growth, materials=(ROCK,)))
        for _ in range(part - 1):
            assert speed.left(tips, blocks, dt) == 0.0
            speed.end(tips, blocks, dt, np.array([True]))
        assert speed.left(tips, blocks, dt) == pytest.approx(growth.min_increment, rel=1e-9)
