"""Jointed slopes in statics, their weight put on at once: how many iterations it takes until all contacts agree."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geomech import dda
from geomech.bench import block_scenes
from geomech.model import OPEN, JointLaw, State


@pytest.mark.parametrize(
    "n, law, most",
    [
        # Without correctors 49 iterations; with them, but not centred again, the path ends early and rounded laws take 107.
        (1000, {}, 35),
        # Bonds that break round by round: 412 and 495 where the path lets them yield and knows of none that holds.
        (200, {"cohesion": 20e3}, 170),
        (200, {"cohesion": 20e3, "tensile_strength": 10e3}, 170),
    ],
    ids=["no cohesion", "cohesion", "bonds"],
)
def test_weight_put_on_at_once_is_carried_by_way_of_the_central_path(n, law, most):
    blocks = block_scenes.slope(n)
    joint = JointLaw("joint", friction_angle=block_scenes.FRICTION, **law)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [joint], settings=block_scenes.settings(0.01, dynamic=False))
    result = system.step(State.at_rest(blocks), block_scenes.WEIGHT)
    iterations = result.statistics["open_close_iterations"]
    print(f"{n} blocks, {law}: {iterations} iterations")
    assert result.statistics["step_cuts"] == 0
    assert iterations <= most
    # Forces balance to the round-off of springs 1e5 times as stiff as the inertia, and what no bond holds keeps Coulomb's law.
    assert result.statistics["unbalanced"] < 1e-8
    loose = result.contacts[(result.contacts["state"] != OPEN) & (result.contacts["bonded"] == 0)]
    largest = 1e-8 * loose["normal_force"].max()
    assert len(loose) and (loose["normal_force"] > -largest).all()
    assert (np.abs(loose["shear_force"]) <= math.tan(block_scenes.FRICTION) * loose["normal_force"] + largest).all()
