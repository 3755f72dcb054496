"""A block whose weight acts at once on an incline flatter than its friction angle: it vibrates, and must hold still."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.dda.joint_laws.penalty_springs import PENALTY_RATIO
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from geomech.reference.blocks.block_on_springs import SpringContact, creep_of_a_sudden_weight

GRAVITY, DENSITY = 9.81, 2600.0
ROCK = Material("rock", 10e9, 0.25, density=DENSITY)
WEIGHT = Loads(gravity=History.constant([0.0, -GRAVITY]))
INCLINE, FRICTION = np.radians(30), np.radians(35)


def on_an_incline(**settings):
    """System, state and the direction down a 30° incline; friction angle 35°."""
    c, s = np.cos(INCLINE), np.sin(INCLINE)
    turn = np.array([[c, s], [-s, c]])
    boxes = ([-20, -1, 20, 0], [4, 0, 5, 1])
    polygons = [np.array([[a, b], [c, b], [c, d], [a, d]], dtype=float) @ turn for a, b, c, d in boxes]
    blocks = Blocks.from_polygons(polygons, fixed=[True, False])
    system = dda.BlockSystem(
        blocks, [ROCK], [JointLaw("joint", friction_angle=FRICTION)],
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.05, **settings),
    )  # fmt: skip
    return system, State.at_rest(blocks), -np.array([c, s])


def marched(system, state, duration, dt):
    for _ in range(round(duration / dt)):
        state = system.step(state, WEIGHT, dt).state
    return state


def travel(system, state, down) -> float:
    return float((state.vertices - system.blocks.vertices)[4:].mean(axis=0) @ down)


@pytest.mark.first_by_default(5)
@pytest.mark.parametrize(
    "dt", [0.1, 0.01, 1e-3, 5e-4, 1e-4, 5e-5, *(pytest.param(dt, marks=pytest.mark.slow) for dt in (2e-5, 1e-5))]
)
def test_the_block_holds_still_at_every_step(dt):
    # With the default damping. While it vibrates it slips once or twice, by the size of its elastic shortening, W/E' ≈
    # 2 µm; ten periods later (1 ms each) it stands still: a hundredth of a micrometre in as long again.
    system, state, down = on_an_incline()
    half = max(1e-2, 30 * dt)
    state = marched(system, state, half, dt)
    before = travel(system, state, down)
    state = marched(system, state, half, dt)
    assert abs(before) < 5e-6
    assert travel(system, state, down) == pytest.approx(before, abs=1e-8)
    assert abs(state.velocity[1, :2] @ down) < 1e-4


def test_creep_of_a_block_that_is_hardly_damped_is_that_of_independent_integration():
    # At 5 % of critical damping the vibration goes on, fed by the slip itself, and the block creeps by millimetres a
    # second although its friction would hold it at rest: friction is lost whenever the normal force is. That is no
    # error of the step: it tends to the explicit integration, with the first order of the scheme.
    end, modulus = 5e-3, ROCK.plane_modulus
    contact = SpringContact(FRICTION, 0.05, PENALTY_RATIO * modulus)
    expected = creep_of_a_sudden_weight(end, 5e-7, 1, INCLINE, contact, ROCK, GRAVITY)[0]
    assert expected > 1e-5
    errors = []
    for dt in (4e-5, 2e-5, 1e-5):
        system, state, down = on_an_incline(damping=0.05)
        errors.append(abs(travel(system, marched(system, state, end, dt), down) / expected - 1))
    assert errors[-1] < 0.03
    order = np.log2(errors[0] / errors[-1]) / 2
    assert 0.7 < order < 1.5


def test_the_slip_of_a_damped_block_is_that_of_independent_integration():
    system, state, down = on_an_incline()
    damping = system.settings.damping
    contact = SpringContact(FRICTION, damping, PENALTY_RATIO * ROCK.plane_modulus)
    expected = creep_of_a_sudden_weight(2e-2, 5e-7, 2, INCLINE, contact, ROCK, GRAVITY)
    assert expected[1] == pytest.approx(expected[0], rel=0.01)  # it stands
    errors = []
    for dt in (4e-5, 1e-5):
        system, state, down = on_an_incline()
        errors.append(abs(travel(system, marched(system, state, 1e-2, dt), down) / expected[1] - 1))
    assert errors[1] < 0.1
    assert errors[1] < 0.5 * errors[0]
