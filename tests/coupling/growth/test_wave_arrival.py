"""What drives a tip has to last as long as waves take to it: impacts, and loads as steady as they are slow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech.coupling import cycles
from geomech.coupling.cycle import Coupling
from geomech.coupling.growth.wave_arrival import LeftOut, WaveTime
from geomech.coupling.load_transfer.boundary_tractions import BoundaryLoad
from geomech.model import (
    TIP,
    Blocks,
    Cracks,
    DdaSettings,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)

ROCK = Material("rock", 17e9, 0.21, 2600.0, k_ic=3e4)


def dropped(height: float, dt: float, end: float, k_ic: float = 3e4, at: float = 0.5) -> Problem:
    """A block of 1 × 1 m with a level closed crack ``at`` a part of its height that falls onto a base."""
    block = np.array([[-0.5, 0.0], [0.5, 0.0], [0.5, 1.0], [-0.5, 1.0]]) + [0.0, height]
    base = np.array([[-3.0, -1.0], [3.0, -1.0], [3.0, 0.0], [-3.0, 0.0]])
    line = np.array([[-0.15, at], [0.15, at]]) + [0.0, height]
    rock = Material("rock", 17e9, 0.21, 2600.0, k_ic=k_ic)
    return Problem(
        title="dropped",
        blocks=Blocks.from_polygons([block, base], fixed=[False, True]),
        cracks=Cracks.from_polylines([line]),
        materials=(rock,),
        joints=(JointLaw("joint", friction_angle=0.6),),
        loads=Loads(gravity=History.constant([0.0, -9.81])),
        dda=DdaSettings(time_step=dt, dynamic_factor=1.0, max_displacement_ratio=0.05),
        growth=GrowthSettings(increment=0.02, min_increment=2e-3),
        run=RunSettings(end_time=end, stop_at=()),
    )


def test_a_falling_block_has_no_stress_at_its_cracks():
    """Free fall: gravity and inertia cancel; K is round-off beside that of the weight, 1e4 Pa √m."""
    for cycle in cycles(dropped(1.0, 1e-3, 0.02)):
        assert np.abs(cycle.tips["k_i"]).max(initial=0.0) < 1e-10 * 1e4
        assert np.abs(cycle.tips["k_ii"]).max(initial=0.0) < 1e-10 * 1e4


def test_impact_opens_no_crack_that_it_presses_shut():
    """In its first microseconds the base pushes on a block without strain yet, whose middle bears what the whole block
    does on average: no stress at first, and then the pressure that waves bring. (Were the inertia of the strain to come
    spread over the block, it would open the crack by 1.1e5 Pa √m.)"""
    height = 2e-5
    seen = [c for c in cycles(dropped(height, 1e-5, np.sqrt(2 * height / 9.81) + 6e-4)) if c.number]
    assert min(c.state.stress[0, 1] for c in seen) < -5e4  # else nothing has knocked
    assert max(c.tips["k_i"].max() for c in seen) < 1e-3 * ROCK.k_ic


def test_impact_grows_no_crack_that_waves_have_not_reached():
    """… far from the base the crack solver sees the block decelerated from its base on, and opens a crack near its top
    beyond its toughness; waves, there after 0.3 ms, bring no such thing, and it does not grow."""
    height = 2e-5
    seen = [c for c in cycles(dropped(height, 1e-5, np.sqrt(2 * height / 9.81) + 6e-4, at=0.8)) if c.number]
    assert max(c.tips["k_i"].max() for c in seen) > 3e4  # else this would test nothing
    assert all((c.tips["grown"] == 0).all() for c in seen)


def one_tip(k_eq: float) -> np.ndarray:
    tips = np.zeros(1, TIP)
    tips["point"], tips["k_eq"] = (0.0, 0.5), k_eq
    return tips


@pytest.mark.parametrize("parts", [1, 7, 50])
def test_mean_over_the_time_of_a_wave(parts):
    """Of a tip 0.5 m from its surface: a push of a third of that time counts as a third, whatever the steps; a steady
    one in full after that time; one that has gone, not at all."""
    given = dropped(0.0, 1e-5, 1.0)
    time = 0.5 / ROCK.pressure_wave_speed
    waves, dt = WaveTime(given), time / 3 / parts
    for n in range(3 * parts):
        tips = one_tip(1e5)
        drive = waves.drive(tips, given.blocks, dt)[0]
        assert drive == pytest.approx(1e5 * (n + 1) / (3 * parts), rel=1e-9)
        waves.end(tips, given.blocks, dt)
    assert waves.drive(one_tip(0.0), given.blocks, dt)[0] == 0.0
    assert waves.drive(one_tip(1e5), given.blocks, 2 * time)[0] == 1e5


def test_steps_in_which_a_block_was_left_out_count_when_they_are_asked_for():
    """The mean is that of K in these steps; a block is solved for them only if a tip of it is driven later, once."""
    given = dropped(0.0, 1e-5, 1.0)
    time = 0.5 / ROCK.pressure_wave_speed
    solved = []

    class Left(LeftOut):
        keys = ((0, 0),)

        def __init__(self, k: float) -> None:
            self.k = k

        def k_eq(self, key):
            solved.append(key)
            return self.k

    waves, dt = WaveTime(given), time / 5
    waves.end(one_tip(0.0)[:0], given.blocks, dt, left_out={0: Left(2e4)})
    waves.end(one_tip(3e4), given.blocks, dt)
    waves.end(one_tip(0.0)[:0], given.blocks, dt, left_out={0: Left(1e4)})
    assert not solved
    assert waves.drive(one_tip(9e4), given.blocks, dt)[0] == pytest.approx((9e4 + 1e4 + 3e4 + 2e4) / 5, rel=1e-12)
    assert solved == [(0, 0)] * 2


def test_a_block_left_out_is_solved_as_it_would_have_been():
    """TIP rows of the last step of a block that falls onto its base, from its load alone."""
    coupling = Coupling(dropped(1e-5, 1e-5, 2e-3))
    for cycle in coupling.cycles():
        if cycle.number and np.abs(cycle.tips["k_eq"]).max() > 1e3:
            break
    now = coupling.now
    left = LeftOut(now.problem, now.blocks, 0, now.bodies[0], now.loads[0], now.nodes_of[0])
    assert left.keys == [(int(tip["crack"]), int(tip["end"])) for tip in cycle.tips]
    for tip in cycle.tips:
        assert left.k_eq((int(tip["crack"]), int(tip["end"]))) == pytest.approx(float(tip["k_eq"]), rel=1e-9)


def test_waves_come_from_where_the_block_is_loaded():
    """A tip 0.1 m from a free side and 0.5 m from the loaded base: the base's waves count."""
    given = dropped(0.0, 1e-5, 1.0)
    base = BoundaryLoad(
        np.array([[[-0.5, 0.0], [0.5, 0.0]]]), np.ones((1, 2, 2)), np.zeros(2), np.zeros((2, 2)), np.zeros(2), 0.0
    )
    tips = one_tip(1e5)
    tips["point"] = (0.4, 0.5)
    dt = 0.1 / ROCK.pressure_wave_speed
    waves = WaveTime(given)
    assert waves.drive(tips, given.blocks, dt * 1.001)[0] == 1e5
    assert waves.drive(tips, given.blocks, dt, {0: base})[0] == pytest.approx(1e5 / 5, rel=1e-9)
    # Round-off of the balanced loads on the near side is no load.
    side = np.array([[[0.5, 0.0], [0.5, 1.0]]])
    both = np.concatenate([base.segments, side]), np.concatenate([base.tractions, np.full((1, 2, 2), 1e-16)])
    rounded = replace(base, segments=both[0], tractions=both[1])
    assert waves.drive(tips, given.blocks, dt, {0: rounded})[0] == pytest.approx(1e5 / 5, rel=1e-9)


def test_slow_shaking_is_its_quasi_static_limit():
    """A block that stands on a rough base, an open slot in its middle, under gravity that swings by 0.3 g at 5 Hz (its
    own vibration: 900 Hz, so that inertia adds 1e-4): at the first peak K is that of statics under the same pull, to 1
    %, which is what the block still rings by."""

    def under(dynamic: float, sideways: History, dt: float, end: float):
        given = dropped(0.0, dt, end, k_ic=np.inf)
        line = np.array([[-0.1, 0.4], [0.1, 0.6]])
        given = replace(
            given,
            cracks=Cracks.from_polylines([line], aperture=np.inf),
            loads=Loads(gravity=sideways),
            dda=replace(given.dda, dynamic_factor=dynamic),
        )
        *_, cycle = cycles(given)
        return np.stack([cycle.tips["k_i"], cycle.tips["k_ii"]])

    times = np.linspace(0.0, 0.06, 301)
    # Weight comes on slowly, then the base swings.
    down = -9.81 * np.clip(times / 0.01, 0.0, 1.0)
    swing = 2.943 * np.where(times > 0.01, np.sin(2 * np.pi * 5.0 * (times - 0.01)), 0.0)
    shaken = under(1.0, History(times, np.column_stack([swing, down])), 2e-4, 0.06)
    still = under(0.0, History.constant([2.943, -9.81]), 1.0, 3.0)
    assert shaken == pytest.approx(still, abs=0.01 * np.abs(still).max())
