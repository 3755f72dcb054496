"""Contact laws with rounded corners: that they are the laws, and that they settle what a blocked central path does
not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.dda.open_close import iteration
from geomech.dda.open_close.lagged_friction import LaggedFriction
from geomech.dda.open_close.smoothed_newton import RoundedLaws
from geomech.model import JointLaw, State

STIFFNESS, FRICTION = 4e11, 0.7


def laws(gap: np.ndarray, before: np.ndarray) -> RoundedLaws:
    """Laws of contacts (n,) of this gap (m) and shear force (N) as the step begins, loads of 1 N on their blocks."""
    out, n = object.__new__(RoundedLaws), len(gap)
    out._kn = out._ks = np.full(n, STIFFNESS)
    out._gap, out._before, out._held = gap, before, np.zeros(n, bool)
    out._mu, out._firm, out._unit = np.full(n, FRICTION), np.zeros(n), np.ones(n)
    return out


def contacts() -> tuple[np.ndarray, np.ndarray]:
    gap, before = np.meshgrid(np.array([-1e-5, -1e-7, 0.0, 1e-7, 1e-3]), np.array([-1e6, -1e4, 0.0, 1e4, 1e6]))
    return gap.ravel(), before.ravel()


def test_laws_of_no_rounding_are_coulombs():
    gap, before = contacts()
    normal, shear, *_ = laws(gap, before)._laws(np.zeros((len(gap), 2)), 1e-3)
    pushed = np.maximum(-STIFFNESS * gap, 0.0)
    # Rounded by f, N is off by f at most, S by 2 f and what N is.
    assert normal == pytest.approx(pushed, abs=1.1e-3)
    assert shear == pytest.approx(np.clip(before, -FRICTION * pushed, FRICTION * pushed), abs=4e-3)


@pytest.mark.parametrize("force", [1e3, 1e5])
def test_their_derivatives_are_those_of_differences(force):
    gap, before = contacts()
    of, h = laws(gap, before), 1e-12
    _, _, stiff, along, slope = of._laws(np.zeros((len(gap), 2)), force)
    off, across = np.zeros((len(gap), 2)), np.zeros((len(gap), 2))
    off[:, 0], across[:, 1] = h, h
    (high, high_shear, *_), (low, low_shear, *_) = of._laws(off, force), of._laws(-off, force)
    # Central differences of numbers of up to 1e7 N that differ by h STIFFNESS = 0.4 N: a part in 1e6 at best.
    assert (low - high) / (2 * h) == pytest.approx(stiff, abs=1e-5 * STIFFNESS)
    assert (low_shear - high_shear) / (2 * h) == pytest.approx(slope * stiff, abs=1e-5 * STIFFNESS)
    moved = (of._laws(-across, force)[1] - of._laws(across, force)[1]) / (2 * h)
    assert moved == pytest.approx(along, abs=1e-5 * STIFFNESS)


def settled_both_ways(monkeypatch, blocks, friction: float):
    """Forces (n, 2) N of a first step of 10 ms as it settles, and where the central path counts as blocked at once."""

    def forces():
        law = JointLaw("joint", friction_angle=np.radians(friction))
        system = dda.BlockSystem(blocks, [block_scenes.ROCK], [law], settings=block_scenes.settings(0.01))
        rows = system.step(State.at_rest(blocks), block_scenes.WEIGHT).contacts
        return np.stack([rows["normal_force"], rows["shear_force"]], axis=1)

    first = forces()
    asked = []
    stages = RoundedLaws.stages
    monkeypatch.setattr(iteration, "_proposed", lambda *_, **__: (None, 0))
    monkeypatch.setattr(LaggedFriction, "rounds", lambda self: iter(()))
    monkeypatch.setattr(RoundedLaws, "stages", lambda self: (asked.append(1), stages(self))[1])
    second = forces()
    assert asked
    return first, second


@pytest.mark.parametrize("friction", [20.0, 35.0])
def test_they_lead_to_the_states_that_the_central_path_does(monkeypatch, friction):
    # Two ways that share nothing but the springs; either ends in states that are consistent to round-off.
    path, rounded = settled_both_ways(monkeypatch, block_scenes.wall(150), friction)
    assert rounded == pytest.approx(path, abs=1e-8 * np.abs(path).max())


@pytest.mark.slow
def test_a_jointed_slope_keeps_its_time_step():
    # Sudden weight on blocks that slide and topple. The central path is blocked in the second step; by lagged friction
    # alone that took 770 solutions and two halvings of the step.
    blocks = block_scenes.slope(1000)
    settings = dataclasses.replace(block_scenes.settings(0.01), max_step_cuts=0)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
    state, taken = State.at_rest(blocks), []
    for _ in range(3):
        result = system.step(state, block_scenes.WEIGHT)
        state = result.state
        taken.append(result.statistics["open_close_iterations"])
        assert result.dt == 0.01 and result.statistics["unbalanced"] < 1e-8
    print(f"iterations {taken}")
    assert max(taken) <= 250 and taken[-1] <= 60
