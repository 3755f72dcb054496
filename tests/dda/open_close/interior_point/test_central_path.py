"""Where the central path of a step's contacts begins."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.dda import time_step
from geomech.dda.open_close.interior_point.central_path import CentralPath
from geomech.dda.open_close.iteration import settle
from geomech.model import OPEN, Blocks, ContactSolver, DdaSettings, History, JointLaw, Loads, Material, State

STIFFNESS, FRICTION = 4e11, 0.7


def centred(gap: np.ndarray, sheared: np.ndarray, epsilon: float) -> CentralPath:
    """A path centred on contacts (n,) of this gap and stretch of the shear spring (m), where all products are
    ``epsilon`` J."""
    path, n = object.__new__(CentralPath), len(gap)
    path._g, path._s, path._kn, path._ks = gap, sheared, np.full(n, STIFFNESS), np.full(n, STIFFNESS)
    path._mu, path._base, path._rough = np.full(n, FRICTION), np.zeros(n), np.ones(n, bool)
    with np.errstate(all="raise"):
        path._centre(np.full(n, epsilon))
    return path


@pytest.mark.parametrize("epsilon", [1e-2, 1e-12, 1e-22])
def test_the_start_is_central_however_far_off_a_contact_is(epsilon):
    # Far apart or deep inside, w and N/kₙ differ by all digits there are; sheared far, S is its strength to the last
    # one.
    far = np.array([-1e-1, -1e-6, -1e-13, 0.0, 1e-13, 1e-6, 1e-1])
    gap, sheared = (grid.ravel() for grid in np.meshgrid(far, far))
    path = centred(gap, sheared, epsilon)
    assert (path._normal > 0).all() and (path._width > 0).all() and (path._slip > 0).all()
    assert path._normal * path._width == pytest.approx(epsilon, rel=1e-12)
    assert path._width - path._normal / STIFFNESS == pytest.approx(gap, rel=1e-9, abs=1e-16)
    assert (np.abs(path._shear) <= FRICTION * path._normal).all()


@pytest.mark.parametrize("gravity", [(0.0, -9.81), (9.81, -2.0)])
def test_pebbles_below_a_large_block_bear_it(monkeypatch, gravity):
    """A weight a million times their own comes onto three layers of pebbles at once, beside a wall: the path carries it
    through them. (Where contacts had units of their own blocks' load it stopped after five steps, with nothing
    balanced.)"""
    size, layers = 0.01, 3
    square = size * np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1]])
    pebbles = [square + (x, size * k) for k in range(layers) for x in np.linspace(0.0, 10 - size, 12)]
    ground = np.array([[-1.0, -1], [11, -1], [11, 12], [10, 12], [10, 0], [-1, 0]])
    load = np.array([[0.0, layers * size], [10, layers * size], [10, 10], [0, 10]])
    blocks = Blocks.from_polygons([ground, *pebbles, load], fixed=[True] + (len(pebbles) + 1) * [False])
    rock, joint = Material("rock", 20e9, 0.25, density=2600.0), JointLaw("joint", friction_angle=0.6)
    system = dda.BlockSystem(blocks, [rock], [joint], settings=DdaSettings(time_step=0.01, dynamic_factor=1.0))
    asked = []
    monkeypatch.setattr(time_step, "settle", lambda *given, **named: asked.append(given) or settle(*given, **named))
    system.step(State.at_rest(blocks), Loads(gravity=History.constant(gravity)))
    of = asked[0][0]
    of = dataclasses.replace(of, expected=None)
    path = CentralPath(of, (of.springs, of.gap), of.found.bonded, of.found.normal)
    taken = 0
    while not path.ended:
        path.advance()
        taken += 1
    assert path.arrived and path.missed < 1e-6 and taken < 40


def test_few_contacts_that_stop_the_path_are_centred_alone():
    rng = np.random.default_rng(4)
    path = centred(rng.uniform(-1e-6, 1e-6, 200), rng.uniform(-1e-6, 1e-6, 200), 1e-9)
    path._unit, path._rough[7] = np.ones(200), False
    numbers = np.stack([path._normal, path._width, *path._slip, *path._left()])
    changes = -0.5 * numbers
    changes[1, 3], changes[4, 5] = -1e4 * numbers[1, 3], -1e3 * numbers[4, 5]
    changes[4, 7] = -1e9 * numbers[4, 7]  # no friction there: nothing to run out of
    far, alone = path._without_few(numbers, changes, 1e-4)
    assert far == 1.0 and np.flatnonzero(alone).tolist() == [3, 5]
    path._centre_alone(alone, 1e-6)
    products = path._normal * path._width
    assert products[alone] == pytest.approx(1e-6) and products[~alone] == pytest.approx(1e-9)
    changes[1, :50] = -1e4 * numbers[1, :50]
    assert path._without_few(numbers, changes, 1e-4)[1] is None


def test_of_many_blocks_in_motion_a_step_whose_path_is_stopped_is_halved_at_once(monkeypatch):
    """What comes out is the half step, to the bit; in statics, and of fewer blocks, the path is followed."""
    blocks, asked, large = block_scenes.slope(300), [], ContactSolver()

    def step(seconds, dynamic=True):
        settings = dataclasses.replace(block_scenes.settings(seconds, dynamic), contact_solver=large)
        system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
        return system.step(State.at_rest(blocks), block_scenes.WEIGHT)

    def stopped(path):
        # Only the first one is.
        asked.append(path)
        return asked[0] is path

    whole = step(0.02)
    large = ContactSolver(large_system=100)
    half = step(0.01)
    monkeypatch.setattr(CentralPath, "stopped", property(stopped))
    result = step(0.02)
    assert len({id(path) for path in asked}) > 1
    assert whole.dt == 0.02 and result.dt == 0.01 and result.statistics["step_cuts"] == 1
    assert np.array_equal(result.state.vertices, half.state.vertices)
    asked.clear()
    assert step(0.02, dynamic=False).dt == 0.02 and not asked


def test_many_blocks_that_no_wave_has_reached_need_not_decide_what_touches():
    """In 1 ms the base is felt a few blocks up; above, all fall together, and contacts neither bear nor part."""
    large = ContactSolver(large_system=100)
    blocks = block_scenes.slope(2500)
    settings = dataclasses.replace(block_scenes.settings(1e-3), contact_solver=large)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
    result = system.step(State.at_rest(blocks), block_scenes.WEIGHT)
    assert result.dt == 1e-3 and result.statistics["unbalanced"] < 1e-9
    corner = blocks.vertices[blocks.vertex_start[:-1]]
    # Away from the foot and the back, which are held.
    far = (corner[:, 1] > 15.0) & (corner[:, 0] < corner[:, 0].max() - 15.0)
    fall = -block_scenes.GRAVITY * result.dt
    assert far.sum() > 100 and result.state.velocity[far, 1] == pytest.approx(fall, rel=1e-3)


def test_one_brick_that_slides_on_many_at_rest_asks_for_no_path():
    """It shakes loose a twentieth of the contacts of 1 500 bricks: the paths stopped, and steps were cut twelve times
    in ten."""
    large = ContactSolver(large_system=1000)
    blocks = block_scenes.with_loose_brick(block_scenes.wall(1500))
    state = block_scenes.at_rest(blocks)
    velocity = state.velocity.copy()
    velocity[-1, 0] = 0.4
    state = dataclasses.replace(state, velocity=velocity)
    settings = dataclasses.replace(block_scenes.settings(0.01), contact_solver=large)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
    took, cuts = [], []
    for _ in range(5):
        result = system.step(state, block_scenes.WEIGHT)
        state = result.state
        took.append(result.statistics["open_close_iterations"])
        cuts.append(result.statistics["step_cuts"])
    print(f"iterations {took}, cuts {cuts}")
    assert not any(cuts[1:]) and max(took[1:]) < 10


@pytest.mark.slow
def test_a_slope_of_twenty_thousand_blocks_takes_half_a_step_under_sudden_weight():
    """Somewhere in so large a slope no states are near that fit 10 ms: the path is stopped there, and what was tried
    after it came to nothing in 126 s of processor time."""
    blocks = block_scenes.slope(20_000)
    settings = block_scenes.settings(0.01)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
    result = system.step(State.at_rest(blocks), block_scenes.WEIGHT)
    told = result.statistics
    print(f"{told['open_close_iterations']} iterations, step of {result.dt:g} s, {told['unbalanced']:.1e} left")
    assert result.dt in (0.005, 0.01) and told["unbalanced"] < 1e-9
    # Falling and borne: nothing stands above its weight, nothing penetrates.
    assert told["worst_penetration"] < 1e-5
    assert np.abs(result.state.velocity[:, :2]).max() < 1.5 * block_scenes.GRAVITY * result.dt


@pytest.mark.slow
def test_a_wall_of_ten_thousand_bricks_settles_in_one_static_step():
    """States that hang by a hair come right at the very end of the path; before, the step was cut."""
    blocks = block_scenes.wall(10_010)
    settings = dataclasses.replace(block_scenes.settings(1.0, dynamic=False), max_step_cuts=0)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
    result = system.step(State.at_rest(blocks), block_scenes.WEIGHT)
    told = result.statistics
    print(f"{told['open_close_iterations']} iterations, {told['unbalanced_ratio']:.1e} of the weight left")
    assert result.dt == 1.0 and told["unbalanced_ratio"] < 1e-3
    # The base bears the weight, less what a step of a second still sets in motion: 4e-4 of it.
    rows = result.contacts[result.contacts["state"] != OPEN]
    on_base = rows[rows["other"] == 0]
    weight, moved = block_scenes.GRAVITY * system.mass[1:], system.mass[1:] * result.acceleration[1:, 1]
    assert abs(moved.sum()) < 1e-3 * weight.sum()
    assert float(on_base["normal_force"].sum()) == pytest.approx(float((weight + moved).sum()), rel=1e-8)
