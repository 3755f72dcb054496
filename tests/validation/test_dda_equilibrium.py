"""Statics found by themselves: where blocks come to rest, that they do not where none can, and how many steps it
takes."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, moved, rectangle, system_of, turned

from geomech import dda
from geomech.model import Material, State
from geomech.reference.blocks import block_motion as exact
from geomech.reference.blocks import masonry

STONE = Material("stone", 1e11, 0.2, density=2500.0)


def rest(system: dda.BlockSystem, **more) -> dda.Equilibrium:
    found = dda.equilibrium(system, State.at_rest(system.blocks), WEIGHT, **more)
    h = found.history
    print(
        f"{system.blocks.n_blocks} blocks: {found.reason}; {len(h)} steps, {h['iterations'].sum()} open–close "
        f"iterations, {h['cuts'].sum()} cuts"
    )
    return found


def wall(columns: int, courses: int) -> dda.BlockSystem:
    """A running-bond wall of 1 × 0.5 m bricks."""
    polygons = [rectangle(-1, -0.5, columns + 1, 0)]
    for row in range(courses):
        ends = [0, *np.arange(0.5, columns), columns] if row % 2 else range(columns + 1)
        polygons += [rectangle(a, 0.5 * row, b, 0.5 * row + 0.5) for a, b in itertools.pairwise(ends)]
    return system_of(polygons, np.radians(35), max_displacement_ratio=0.01)


def weight_carried(found: dda.Equilibrium) -> float:
    rows = found.result.contacts
    return float(rows["normal_force"][rows["other"] == 0].sum())


def test_a_column_carries_its_weight_whatever_the_time_step_is_set_to():
    n, rock = 8, Material("rock", 10e9, 0.25, density=2600.0)
    ends = []
    for time_step in (1e-4, 1e4):
        system = system_of(
            [rectangle(-1, -1, 2, 0), *(rectangle(0, 2 * k, 1, 2 * k + 2) for k in range(n))], 0.5, rock=rock,
            time_step=time_step,
        )  # fmt: skip
        found = rest(system, tolerance=1e-8)
        assert found.converged and not found.collapsed and found.moving == ()
        assert len(found.history) < 15
        ends.append(found.state)
    weight = 2600.0 * GRAVITY * 2.0
    mean = weight * (np.arange(n, 0, -1) - 0.5)
    # On the geometry as it is shortened: ten steps, each on that of the one before.
    assert ends[0].stress[1:, 1] == pytest.approx(-mean, rel=1e-4)
    assert ends[0].time == 0.0 and not ends[0].velocity.any()
    assert np.array_equal(ends[0].vertices, ends[1].vertices)


def test_blocks_that_first_fall_come_to_rest_on_one_another():
    # Gaps of 5 and 10 cm, a thousand times what a step's springs shorten, and more than a step may move.
    system = system_of(
        [rectangle(-1, -1, 2, 0), rectangle(0, 0.05, 1, 1.05), rectangle(0.1, 1.15, 0.9, 1.95)], 0.5,
        max_displacement_ratio=0.01,
    )  # fmt: skip
    found = rest(system)
    assert found.converged
    shortening = 2600.0 * GRAVITY / 10e9
    assert moved(system, found.state)[:, 1] == pytest.approx([0.0, -0.05, -0.15], abs=5 * shortening)
    assert weight_carried(found) == pytest.approx(2600.0 * GRAVITY * 1.64, rel=1e-5)
    assert found.history["unbalanced"][-1] <= 1e-6 < found.history["unbalanced"][0]


@pytest.mark.parametrize(("friction_deg", "holds"), [(30.1, True), (29.9, False)])
def test_a_block_on_an_incline_holds_or_is_told_to_slide(friction_deg, holds):
    slope = np.radians(30)
    polygons = [turned(rectangle(-20, -1, 20, 0), slope), turned(rectangle(4, 0, 5, 1), slope)]
    system = system_of(polygons, np.radians(friction_deg), names=None)
    found = rest(system, limits=dda.RelaxationLimits(reach=0.5))
    assert found.converged == holds and found.collapsed != holds
    if not holds:
        assert found.moving == (1,)
        assert "'block 1' move" in found.reason
        # What is out of balance is the share of the weight that friction does not carry.
        a = np.hypot(*found.result.acceleration[1, :2])
        assert a == pytest.approx(exact.incline_acceleration(slope, np.radians(friction_deg)), rel=1e-3)


@pytest.mark.parametrize(("share", "stands"), [(1.01, True), (0.99, False)])
def test_an_arch_stands_or_falls_at_the_thickness_of_limit_analysis(share, stands):
    n, radius = 25, 10.0
    ratio = share * masonry.thinnest_arch(n)
    inner, outer = radius * (1 - 0.5 * ratio), radius * (1 + 0.5 * ratio)
    springings = [rectangle(inner, -1, outer, 0), rectangle(-outer, -1, -inner, 0)]
    system = system_of(
        springings + masonry.voussoirs(n, ratio, radius), np.radians(60), fixed=2, rock=STONE,
        max_displacement_ratio=0.01,
    )  # fmt: skip
    found = rest(system)
    assert found.converged == stands and found.collapsed != stands
    if not stands:
        assert len(found.moving) > 5


def test_a_leaning_column_topples_and_its_top_is_named_first():
    # Slope 20° under a column of slenderness 4: tan 20° > 1/4, and rough enough not to slide.
    slope = np.radians(20)
    polygons = [turned(rectangle(-5, -1, 5, 0), slope)] + [turned(rectangle(0, k, 1, k + 1), slope) for k in range(4)]
    found = rest(system_of(polygons, np.radians(50), max_displacement_ratio=0.01))
    assert found.collapsed
    assert found.moving[0] == 4


def test_a_long_fall_is_no_collapse():
    # Half a hundred steps of what a step may move, and as much out of balance all the way.
    system = system_of([rectangle(-1, -1, 2, 0), rectangle(0, 0.3, 1, 1.3)], 0.5, max_displacement_ratio=0.005)
    found = rest(system)
    assert found.converged
    assert moved(system, found.state)[1, 1] == pytest.approx(-0.3, abs=1e-4)


def test_what_is_not_found_is_told_and_nothing_to_move_is_at_rest():
    system = wall(4, 3)
    found = rest(system, limits=dda.RelaxationLimits(1))
    assert not found.converged and not found.collapsed and "after 1 steps" in found.reason
    seen = []
    rest(system, tolerance=1e-9, watch=lambda result, row: seen.append(row["kinetic_energy"]))
    assert len(seen) > 1 and seen[-1] < 1e-6 * max(seen)
    alone = system_of([rectangle(0, 0, 1, 1)], 0.5)
    assert rest(alone).converged
    with pytest.raises(ValueError, match="tolerance"):
        rest(system, tolerance=0.0)


def test_equilibrium_is_where_steps_stand_still():
    # A dynamic run that begins there goes on at rest.
    system = wall(6, 5)
    found = rest(system, tolerance=1e-9)
    state = replace(found.state, time=0.0)
    for _ in range(10):
        state = system.step(state, WEIGHT, 1e-3).state
    assert np.abs(state.velocity[:, :2]).max() < 1e-6
    assert moved(system, state) == pytest.approx(moved(system, found.state), abs=1e-9)


@pytest.mark.slow
def test_a_wall_of_a_thousand_bricks_settles():
    system = wall(32, 31)
    found = rest(system)
    assert found.converged
    assert weight_carried(found) == pytest.approx(2600.0 * GRAVITY * 32 * 15.5, rel=1e-5)
