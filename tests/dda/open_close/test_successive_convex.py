"""Rounds of convex friction: that they end in Coulomb's forces, and that their first problem is associated flow."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.dda.open_close import iteration
from geomech.dda.open_close.smoothed_newton import RoundedLaws
from geomech.dda.open_close.successive_convex import ConvexRounds
from geomech.dda.system import PATIENT_AFTER
from geomech.model import JointLaw, State


def first_step(blocks, friction: float, dt: float = 0.01, **settings):
    law = JointLaw("joint", friction_angle=np.radians(friction))
    asked = dataclasses.replace(block_scenes.settings(dt, dynamic=False), **settings)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [law], settings=asked)
    return system.step(State.at_rest(blocks), block_scenes.WEIGHT)


def by_rounds_alone(monkeypatch) -> list[ConvexRounds]:
    """From here on the central path and rounded laws count as blocked at once; the rounds that were made."""
    made, rounds = [], ConvexRounds.rounds
    monkeypatch.setattr(iteration, "_proposed", lambda *_, **__: (None, 0))
    monkeypatch.setattr(RoundedLaws, "stages", lambda self: iter(()))
    monkeypatch.setattr(ConvexRounds, "rounds", lambda self: (made.append(self), rounds(self))[1])
    return made


@pytest.mark.parametrize("friction", [20.0, 35.0])
def test_they_lead_to_the_states_that_the_central_path_does(monkeypatch, friction):
    blocks = block_scenes.wall(150)

    def forces():
        rows = first_step(blocks, friction).contacts
        return np.stack([rows["normal_force"], rows["shear_force"]], axis=1)

    path = forces()
    made = by_rounds_alone(monkeypatch)
    rounds = forces()
    assert made
    assert rounds == pytest.approx(path, abs=1e-8 * np.abs(path).max())


def test_slip_of_the_first_problem_lifts_by_its_friction(monkeypatch):
    """Associated flow: at its end every contact that slides has a gap of μ times its slip, and one that does not none."""
    made = by_rounds_alone(monkeypatch)
    seen, friction = [], []
    begin = ConvexRounds._begin

    def look(self, epsilon):
        # The second problem begins where the first one has ended.
        if self.solutions and not seen:
            slip = self._slip.sum(axis=0)
            seen.append((self._g + self._normal / self._kn - self._width, friction[0] * slip, slip))
        friction.append(self._mu)
        begin(self, epsilon)

    monkeypatch.setattr(ConvexRounds, "_begin", look)
    first_step(block_scenes.slope(150), 20.0)
    assert made
    (lifted, expected, slip), *_ = seen
    assert (slip > 1e-7).any()
    # Both are known to the balance in which the problem ends, here of motions of 0.5 mm.
    assert lifted == pytest.approx(expected, abs=1e-9)


def test_friction_that_lags_less_and_less_ends_as_coulombs(monkeypatch):
    made = by_rounds_alone(monkeypatch)
    seen, laws = [], ConvexRounds._laws
    monkeypatch.setattr(ConvexRounds, "_laws", lambda self, known, lag: (seen.append(lag), laws(self, known, lag))[1])
    rows = first_step(block_scenes.slope(150), 35.0).contacts
    rounds = made[0]
    print(f"{len(seen)} rounds, {rounds.solutions} solutions; what lags: {np.round(seen, 2)}")
    assert seen[0] == 1.0 and seen[-1] == 0.0 and len(made) == 1
    # The last round's forces are those of the states that stand in the end, of which it has known nothing.
    normal = np.zeros(len(rows))
    normal[rounds._some] = rounds._normal
    assert normal == pytest.approx(rows["normal_force"], abs=1e-4 * normal.max())


@pytest.mark.parametrize("hasty", [False, True])
def test_a_hasty_step_does_not_ask_for_them(monkeypatch, hasty):
    made = by_rounds_alone(monkeypatch)
    blocks = block_scenes.slope(150)
    law = JointLaw("joint", friction_angle=np.radians(20))
    settings = block_scenes.settings(0.01, dynamic=False)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [law], settings=settings)
    result = system.step(State.at_rest(blocks), block_scenes.WEIGHT, hasty=hasty)
    told = result.statistics
    print("hasty" if hasty else "patient", told["open_close_iterations"], "iterations,", told["step_cuts"], "cuts")
    assert bool(made) == (not hasty or told["step_cuts"] >= PATIENT_AFTER)


@pytest.mark.slow
def test_a_slope_of_three_thousand_blocks_settles_in_one_static_step():
    """Nine halvings of the step did not settle it without these rounds; with strengths held wholly they take 444."""
    result = first_step(block_scenes.slope(3000), 35.0, dt=1.0, max_step_cuts=0)
    iterations = result.statistics["open_close_iterations"]
    print(iterations, "iterations")
    assert result.dt == 1.0 and iterations <= 260
    assert result.statistics["unbalanced_ratio"] < 1e-3
