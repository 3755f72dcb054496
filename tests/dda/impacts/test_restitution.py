"""Impacts with a coefficient of restitution against closed forms of rigid bodies, whatever the step.

Motion in a straight line agrees to the round-off of the sweeps that impulses are found by (1e-9); where a block turns,
gaps do not close in a parabola, and agree to the square of its turn in a step.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from block_problems import rectangle, turned

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from geomech.reference.blocks import impact as exact

GRAVITY, DENSITY = 9.81, 2600.0
ROCK = Material("rock", 5e9, 0.25, density=DENSITY)
STEPS = (8e-3, 4e-3, 1e-3, 2.5e-4)


class Fall:
    """Blocks above a fixed floor, their states, velocities (n_steps, n_blocks, 6) and budget."""

    def __init__(
        self, polygons, dt, end, *, restitution, friction=0.0, velocity=None, gravity=GRAVITY, fixed=(0,), **more
    ):
        self.blocks = Blocks.from_polygons(polygons, fixed=[b in fixed for b in range(len(polygons))])
        settings = DdaSettings(time_step=dt, dynamic_factor=1.0, max_displacement_ratio=1.0, **more)
        state = State.at_rest(self.blocks)
        for b, v in (velocity or {}).items():
            state.velocity[b, : len(v)] = v
        law = JointLaw("face", friction_angle=np.arctan(friction), restitution=restitution)
        self.budget, self.results = dda.EnergyBudget(), []

        def watch(result: dda.StepResult) -> None:
            self.budget = self.budget.after(result.energy, result.state.time)
            self.results.append(result)

        self.states = list(
            dda.run(
                self.blocks,
                [ROCK],
                [law],
                Loads(gravity=History.constant([0.0, -gravity])),
                settings,
                end,
                state=state,
                watch=watch,
            )
        )
        self.time = np.array([s.time for s in self.states])
        self.velocity = np.array([s.velocity for s in self.states])

    def centroid(self, block: int) -> np.ndarray:
        """(n_steps, 2) m."""
        at = self.blocks.vertex_start
        return np.array([s.vertices[at[block] : at[block + 1]].mean(axis=0) for s in self.states])

    def strikes(self, block: int) -> np.ndarray:
        """Numbers of the steps in which the block's velocity upwards has grown."""
        return np.flatnonzero(np.diff(self.velocity[:, block, 1]) > 1e-3) + 1


def floor() -> np.ndarray:
    return rectangle(-5, -1, 6, 0)


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize("dt", STEPS)
def test_a_block_dropped_flat_comes_up_to_e_squared_of_its_height(dt):
    seen = Fall([floor(), rectangle(0, 0.1, 1, 1.1)], dt, 0.2, restitution=0.5, friction=0.6)
    height = seen.centroid(1)[:, 1] - 0.5 + seen.velocity[:, 1, 1] ** 2 / (2 * GRAVITY)
    assert height[-1] == pytest.approx(exact.rebound_height(0.1, 0.5), rel=1e-7)
    assert np.abs(seen.velocity[:, 1, 2]).max() < 1e-7  # it does not begin to turn


@pytest.mark.parametrize("restitution", (0.3, 0.8, 1.0))
@pytest.mark.parametrize("scheme", ({"newmark": (0.25, 0.5)}, {"newmark": (0.5, 1.0)}, {"spectral_radius": 0.6}))
def test_every_time_scheme_has_the_same_rebound(restitution, scheme):
    seen = Fall([floor(), rectangle(0, 0.4, 1, 1.4)], 5e-3, 0.4, restitution=restitution, **scheme)
    first = seen.strikes(1)[0]
    speed = np.sqrt(2 * GRAVITY * 0.4)
    left = seen.time[first] - speed / GRAVITY
    assert seen.velocity[first, 1, 1] == pytest.approx(restitution * speed - GRAVITY * left, abs=1e-7 * speed)


def test_without_the_key_the_step_decides():
    """What restitution is for: the part of the energy that is left depends on where in the step a block strikes."""
    left = []
    for dt in STEPS[:3]:
        seen = Fall([floor(), rectangle(0, 0.2, 1, 1.2)], dt, 0.25, restitution=None)
        height = seen.centroid(1)[:, 1] - 0.5 + seen.velocity[:, 1, 1] ** 2 / (2 * GRAVITY)
        left.append(height[-1])
    assert np.ptp(left) > 0.01
    assert "impact_loss" in seen.budget.statistics() and seen.budget.impact == 0.0


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("dt", (8e-3, 2e-3))
def test_bounces_follow_each_other_as_a_geometric_series(dt):
    height, restitution = 0.5, 0.6
    seen = Fall([floor(), rectangle(0, height, 1, 1 + height)], dt, 1.4, restitution=restitution)
    above, speed = seen.centroid(1)[:, 1] - 0.5, seen.velocity[:, 1, 1]
    energy = above + speed**2 / (2 * GRAVITY)
    strikes = seen.strikes(1)[:4]
    for n, (strike, following) in enumerate(pairwise(strikes), 1):
        assert energy[(strike + following) // 2] == pytest.approx(
            exact.rebound_height(height, restitution, n), rel=1e-6
        )
        # Back along its parabola from where it is at the end of the step.
        since = (np.sqrt(2.0 * GRAVITY * energy[strike]) - speed[strike]) / GRAVITY
        assert seen.time[strike] - since == pytest.approx(exact.bounce_time(height, restitution, n), abs=1e-6)
    # In the end it lies there, and what has been left to the time scheme was less than gravity makes in a few steps.
    assert np.abs(seen.velocity[-1, 1]).max() < 5e-2 * GRAVITY * dt
    assert abs(seen.budget.scheme) < DENSITY * (2.0 * GRAVITY * dt) ** 2


@pytest.mark.parametrize("friction", (0.2, 0.5))
@pytest.mark.parametrize("dt", (8e-3, 5e-4))
def test_an_oblique_impact_is_coulombs(friction, dt):
    """μ = 0.2: it slides on; 0.5: friction stops it. A flat block, so low that it is not turned over."""
    across, along = -3.0, 2.0
    seen = Fall(
        [rectangle(-5, -1, 9, 0), rectangle(0, 0.05, 2, 0.55)], dt, 0.04, restitution=0.4, friction=friction,
        gravity=0.0, velocity={1: (along, across)},
    )  # fmt: skip
    after = exact.oblique(across, along, 0.4, friction)
    assert seen.velocity[-1, 1, 1] == pytest.approx(after[0], rel=1e-6)
    assert seen.velocity[-1, 1, 0] == pytest.approx(after[1], abs=1e-6)
    assert abs(seen.velocity[-1, 1, 2]) < 1e-6
    mass = DENSITY
    lost = 0.5 * mass * (across**2 - after[0] ** 2)
    rubbed = 0.5 * mass * (along**2 - after[1] ** 2)
    assert seen.budget.impact == pytest.approx(lost, rel=1e-5)
    assert seen.budget.friction == pytest.approx(rubbed, rel=1e-5)


@pytest.mark.parametrize("dt", (4e-3, 5e-4))
def test_a_corner_that_strikes_turns_the_block(dt):
    """A square tilted by 20° falls on a smooth floor."""
    tilt, speed = np.radians(20.0), 2.0
    block = turned(rectangle(-0.5, -0.5, 0.5, 0.5), tilt)
    low = block[block[:, 1].argmin()]
    block = block + [0.0, 0.01 - low[1]]
    seen = Fall([floor(), block], dt, 0.02, restitution=0.5, gravity=0.0, velocity={1: (0.0, -speed)})
    first = seen.strikes(1)[0]
    velocity, rate = exact.eccentric(speed, low[0], DENSITY, DENSITY / 6.0, 0.5)
    assert seen.velocity[first, 1, 1] == pytest.approx(velocity, rel=1e-4)
    assert seen.velocity[first, 1, 2] == pytest.approx(rate, rel=1e-4)


@pytest.mark.parametrize("dt", (8e-3, 2e-3))
def test_a_block_bounces_down_an_incline(dt):
    slope, restitution, friction, speed = np.radians(30.0), 0.5, 0.1, 2.0
    plane, block = rectangle(-12, -1, 3, 0), rectangle(0, 0.001, 2, 0.501)
    begun = np.sqrt(speed**2 - 2.0 * GRAVITY * np.cos(slope) * 1e-3)
    across = turned(np.array([[0.0, -begun]]), slope)[0]
    bounces = 3
    time, along = exact.down_an_incline(speed, slope, restitution, friction, bounces)
    seen = Fall(
        [turned(plane, slope), turned(block, slope)], dt, time + (bounces + 2) * dt, restitution=restitution,
        friction=friction, velocity={1: across},
    )  # fmt: skip
    direction = turned(np.array([[-1.0, 0.0], [0.0, 1.0]]), slope)
    down, off = seen.velocity[:, 1, :2] @ direction[0], seen.velocity[:, 1, :2] @ direction[1]
    strikes = np.flatnonzero(np.diff(off) > 1e-3) + 1
    last = strikes[bounces - 1]
    fall = (speed - begun) / (GRAVITY * np.cos(slope))
    since = seen.time[last] - fall - time
    assert -1e-4 < since < 1.01 * dt
    # Gravity has gone on since.
    assert off[last] == pytest.approx(restitution**bounces * speed - GRAVITY * np.cos(slope) * since, rel=1e-3)
    assert down[last] == pytest.approx(along + GRAVITY * np.sin(slope) * since, abs=1e-4)
    assert abs(seen.budget.residual) < 1e-5 * seen.budget.turnover


@pytest.mark.parametrize("restitution", (0.0, 0.7, 1.0))
def test_two_blocks_in_flight_keep_their_momentum(restitution):
    small, large = rectangle(0, 0, 1, 1), rectangle(1.1, -0.5, 3.1, 1.5)
    seen = Fall(
        [small, large], 7e-3, 0.1, restitution=restitution, friction=0.5, gravity=0.0, fixed=(),
        velocity={0: (3.0, 0.0), 1: (-1.0, 0.0)},
    )  # fmt: skip
    mass = np.array([1.0, 4.0]) * DENSITY
    first, second = exact.central((mass[0], 3.0), (mass[1], -1.0), restitution)
    assert seen.velocity[-1, 0, 0] == pytest.approx(first, abs=1e-6)
    assert seen.velocity[-1, 1, 0] == pytest.approx(second, abs=1e-6)
    momentum = (mass[:, None] * seen.velocity[:, :, :2].transpose(1, 0, 2).reshape(2, -1)).sum(axis=0)
    assert np.abs(momentum.reshape(-1, 2) - momentum[:2]).max() < 1e-9 * mass.sum()


@pytest.mark.parametrize("dt", (5e-3, 1e-3))
def test_a_block_that_rests_passes_the_blow_to_the_floor(dt):
    """What strikes a block that lies on the floor comes up as from the floor, and that block stays where it is."""
    seen = Fall([floor(), rectangle(-1, 0, 2, 0.5), rectangle(0, 0.9, 1, 1.9)], dt, 0.35, restitution=0.5, friction=0.5)
    first = seen.strikes(2)[-1]
    height = seen.centroid(2)[:, 1] - 1.0 + seen.velocity[:, 2, 1] ** 2 / (2 * GRAVITY)
    assert height[first] == pytest.approx(0.1, rel=0.01)
    assert np.abs(seen.centroid(1) - seen.centroid(1)[0]).max() < 1e-4


def test_the_energy_of_a_fall_is_accounted_for():
    """A tilted block tumbles down a stair until it lies: gravity's work is in friction, impacts, and little else."""
    stair = np.array([[-4, -2], [6, -2], [6, 0], [2, 0], [2, 1], [0, 1], [0, 2], [-4, 2]], dtype=float)
    block = turned(rectangle(-0.4, -0.3, 0.4, 0.3), np.radians(25.0)) + [-0.4, 3.0]
    seen = Fall([stair, block], 4e-3, 2.5, restitution=0.4, friction=0.4, velocity={1: (1.5, 0.0)})
    budget = seen.budget
    assert budget.gravity_work > 0.0 and budget.impact > 0.1 * budget.gravity_work and budget.friction > 0.0
    assert abs(budget.scheme) < 0.02 * budget.turnover
    assert abs(budget.residual) < 2e-3 * budget.turnover
    assert min(result.energy.impact for result in seen.results) > -1e-9 * budget.turnover


def test_friction_never_makes_restitution_a_gain():
    """A rod at 60° (Kane & Levinson 1985): its blow would turn its tip backwards, friction holds that, and so pushes
    the way
    the tip was going: with e = 1 Newton's law would add 8 % to the energy. Restitution gives way, to what keeps it."""
    rod = turned(rectangle(-1.0, -0.05, 1.0, 0.05), np.radians(60.0))
    rod = rod + [0.0, 0.003 - rod[:, 1].min()]
    speed = 2.0
    for along in (-0.3, 0.3):
        seen = Fall(
            [floor(), rod], 1e-3, 0.004, restitution=1.0, friction=0.8, gravity=0.0, velocity={1: (along, -speed)}
        )
        kinetic = np.array([result.energy.kinetic for result in seen.results])
        assert (np.diff(kinetic) < 1e-9 * kinetic[0]).all()
        low = seen.states[-1].vertices[4:][rod[:, 1].argmin()] - seen.centroid(1)[-1]
        tip = seen.velocity[-1, 1, 1] + seen.velocity[-1, 1, 2] * low[0]
        if along > 0.0:
            assert 0.9 * speed < tip < 0.99 * speed and kinetic[-1] == pytest.approx(kinetic[0], rel=1e-5)
        else:
            assert tip == pytest.approx(speed, rel=2e-3) and kinetic[-1] < 0.95 * kinetic[0]
        assert min(result.energy.friction for result in seen.results) >= 0.0
