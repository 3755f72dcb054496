"""Damping of a block whose crack opens and closes within a step."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.model import Blocks, DdaSettings, Loads, Material, State

ROCK = Material("rock", 10e9, 0.2, density=2500.0)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("dt", [1e-5, 1e-4, 1e-3])
def test_with_the_crack_open_and_closed_a_step_ends_on_the_same_side(dt):
    # Both responses agree where σ_yy = 0. If the step with the open crack ended in compression and that with the closed
    # one in tension, no state would agree with its own response.
    square = Blocks.from_polygons([np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])])
    system = dda.BlockSystem(square, [ROCK], settings=DdaSettings(dynamic_factor=1.0, newmark=(0.25, 0.5)))
    opened = np.zeros((1, 3, 3))
    opened[0, 1, 1] = 20.0 / 10e9
    rng, sides = np.random.default_rng(0), []
    for _ in range(200):
        state = State.at_rest(square)
        state.stress[0, 1] = rng.uniform(-1e4, 1e4)
        state.crack_strain[0] = opened[0] @ np.maximum(state.stress[0], 0.0)
        state.velocity[0, 4] = rng.uniform(-1e-5, 1e-5) / dt
        ends = [
            system.step(state, Loads(), dt, crack=dda.CrackResponse(compliance, np.zeros((1, 3)))).state.stress[0, 1]
            for compliance in (opened, 0.0 * opened)
        ]
        assert ends[0] * ends[1] >= 0.0
        sides.append(ends[0] > 0.0)
    assert 0.2 < np.mean(sides) < 0.8
