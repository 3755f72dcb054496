"""Jointed slopes in statics, their weight put on at once: how many iterations it takes until all contacts agree."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.conventions import normal_of
from geomech.model import OPEN, Bolt, JointLaw, State


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize(
    "n, law, most",
    [
        # Without correctors of the central path 49 iterations.
        (1000, {}, 35),
        # Bonds that break round by round: 412 and 495 where the path lets them yield and knows of none that holds.
        (200, {"cohesion": 20e3}, 170),
        # (Of 200 such blocks some 500 bonds are left when the path stops, on this side or that of states that stand as
        # the last digits fall, and the step may be halved.)
        (150, {"cohesion": 20e3, "tensile_strength": 10e3}, 170),
    ],
    ids=["no cohesion", "cohesion", "bonds"],
)
def test_weight_put_on_at_once_is_carried_by_way_of_the_central_path(n, law, most):
    blocks = block_scenes.slope(n)
    joint = JointLaw("joint", friction_angle=block_scenes.FRICTION, **law)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [joint], settings=block_scenes.settings(0.01, dynamic=False))
    # One solution of the step: what inertia takes of it, further ones would take out.
    result = system.step(State.at_rest(blocks), block_scenes.WEIGHT, pseudo_inertia=True)
    iterations = result.statistics["open_close_iterations"]
    print(f"{n} blocks, {law}: {iterations} iterations")
    # Where hundreds of bonds that pull are left when the path stops, the step is halved once.
    assert result.statistics["step_cuts"] <= ("tensile_strength" in law)
    assert iterations <= most
    # Forces balance to the round-off of springs 1e5 times as stiff as the inertia, and what no bond holds keeps
    # Coulomb's law.
    assert result.statistics["unbalanced"] < 1e-8
    loose = result.contacts[(result.contacts["state"] != OPEN) & (result.contacts["bonded"] == 0)]
    largest = 1e-8 * loose["normal_force"].max()
    assert len(loose) and (loose["normal_force"] > -largest).all()
    assert (np.abs(loose["shear_force"]) <= math.tan(block_scenes.FRICTION) * loose["normal_force"] + largest).all()


def test_stiff_bolts_between_blocks_take_no_more_iterations_than_none():
    # Bars as stiff as the blocks: equations whose balance leaves out what one end does to the other do not settle
    # without cuts.
    blocks = block_scenes.slope(200)
    centre = np.array([part.mean(axis=0) for part in np.split(blocks.vertices, blocks.vertex_start[1:-1])])
    free = np.flatnonzero(~np.asarray(blocks.fixed))
    down = 3.0 * np.array([math.cos(math.radians(20)), -math.sin(math.radians(20))])
    ends = [(i, int(np.linalg.norm(centre - centre[i] - down, axis=1).argmin())) for i in free[::9]]
    bars = tuple(
        Bolt(int(i), tuple(centre[i]), j, tuple(centre[j]), stiffness=1e11, compression=True, name=f"bar {i}")
        for i, j in ends
        if j != i
    )
    system = dda.BlockSystem(
        blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=block_scenes.settings(0.01, dynamic=False)
    )
    result = system.step(State.at_rest(blocks), replace(block_scenes.WEIGHT, bolts=bars), pseudo_inertia=True)
    iterations = result.statistics["open_close_iterations"]
    print(f"{len(bars)} bars: {iterations} iterations")
    assert result.statistics["step_cuts"] == 0 and result.statistics["unbalanced"] < 1e-8
    assert iterations <= 30


@pytest.mark.slow
def test_the_last_digits_of_a_step_do_not_decide_how_long_it_takes():
    # 27 or 28 iterations; with predictors of the central path solved to 1e-2 some of these steps took 100 to 190.
    blocks = block_scenes.slope(1000)
    taken = []
    for k in range(8):
        settings = block_scenes.settings(0.01 * (1 + k * 1e-10))
        system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
        result = system.step(State.at_rest(blocks), block_scenes.WEIGHT)
        taken.append(result.statistics["open_close_iterations"])
        assert result.statistics["step_cuts"] == 0
    print(taken)
    assert max(taken) <= 40


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["wall", "slope"])
def test_ten_thousand_blocks_under_sudden_weight_find_their_equilibrium(scene):
    blocks = {"wall": block_scenes.wall, "slope": block_scenes.slope}[scene](10_010)
    settings = block_scenes.settings(1.0, dynamic=False)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
    found = dda.equilibrium(system, State.at_rest(blocks), block_scenes.WEIGHT)
    steps = found.history
    print(f"{scene} of {blocks.n_blocks}: {len(steps)} steps, {steps['iterations'].sum()} iterations; {found.reason}")
    assert found.converged
    # What is fixed bears the weight of all that is not, less what the last step still sets in motion.
    rows = found.result.contacts[found.result.contacts["state"] != OPEN]
    force = rows["normal_force"][:, None] * rows["normal"] + rows["shear_force"][:, None] * normal_of(rows["normal"])
    on_fixed = blocks.fixed[rows["block"]].astype(float) - blocks.fixed[rows["other"]]
    mass, moved = system.mass[~blocks.fixed], found.result.acceleration[~blocks.fixed, :2]
    weight = block_scenes.GRAVITY * mass.sum()
    assert np.abs(mass @ moved).max() < 1e-4 * weight
    assert on_fixed @ force == pytest.approx([0.0, -weight] - mass @ moved, abs=1e-8 * weight)
