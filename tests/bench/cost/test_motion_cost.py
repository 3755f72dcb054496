"""`geomech bench motion`: costs of slopes in motion beside their errors and a wall."""

from __future__ import annotations

import math

import pytest

from geomech.bench.cost import motion_cost
from geomech.bench.cost.motion_cost import Cost, Sized, measured, slope_of, table
from geomech.bench.figures import ERROR, TIME
from geomech.render.benchmarks.motion_cost import draw


def cost(dt, work, second=1.0):
    return Cost(100, dt, 10, 5.0, 2e-3, second, 0.1, work, work - 1)


def test_errors_are_those_off_the_shortest_steps_that_were_finished():
    sized = Sized(100, 100, (cost(4e-3, 1.1), cost(2e-3, 1.0), cost(1e-3, math.nan)), 1e-3)
    assert sized.errors()[0] == pytest.approx(0.1)
    assert math.isnan(sized.errors()[1]) and math.isnan(sized.errors()[2])
    assert Sized(100, 100, (), 1e-3, ("none",)).errors() == []


def test_a_small_slope_is_measured_beside_a_wall(tmp_path):
    sized = measured(60, (5e-3, 2.5e-3), 60.0, 0.0)
    assert 30 < sized.blocks < 120 and sized.wall > 0 and not sized.missing
    assert [c.dt for c in sized.costs] == [5e-3, 2.5e-3]
    # 0.1 s of motion; steps are cut, never lengthened.
    assert sized.costs[0].steps >= 20 and sized.costs[1].steps >= 40
    for each in sized.costs:
        assert each.blocks == sized.blocks and each.finished and each.iterations >= 1
        # A step may be cut; then its attempts take longer than their iterations count.
        assert each.second == pytest.approx(each.iteration * each.iterations * each.steps / 0.1, rel=1e-6)
    found = table([sized])
    kinds = {figure.kind for figure in found.figures}
    assert kinds == {ERROR, TIME} and "wall:" in found.text
    assert draw([sized], tmp_path / "motion.png").stat().st_size > 10_000


def test_what_takes_too_long_is_said_and_has_no_error():
    sized = measured(200, (10e-3, 5e-3), 0.02, 0.0)
    assert not any(c.finished for c in sized.costs)
    assert len(sized.missing) + len(sized.costs) == 2
    assert not [f for f in table([sized]).figures if f.kind == ERROR]


def test_spacings_make_about_as_many_blocks_as_they_say():
    import tomllib

    from geomech.bench.slopes.drawn_slopes import problem_of

    for size in (300, 1000, 3000):
        blocks = problem_of(tomllib.loads(slope_of(size).text(1e-3, 0.1))).blocks
        assert 0.8 * size < blocks.n_blocks < 1.25 * size
    assert slope_of(4000).bed_spacing == pytest.approx(0.5 * motion_cost.SPACINGS[1000], rel=1e-3)
