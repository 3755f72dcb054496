"""How many iterations it takes until contact states agree, and by which way."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.dda.linear_solver import block_solver
from geomech.dda.open_close import equations, iteration
from geomech.model import Blocks, ContactSolver, DdaSettings, History, JointLaw, Loads, Material, State

WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))


def brick_wall(rows: int, columns: int, friction_deg: float, dt: float, **law) -> dda.BlockSystem:
    polygons = [rectangle(-1, -0.5, columns + 1, 0)]
    for row in range(rows):
        ends = [0, *np.arange(0.5, columns), columns] if row % 2 else range(columns + 1)
        polygons += [rectangle(a, 0.5 * row, b, 0.5 * row + 0.5) for a, b in itertools.pairwise(ends)]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))
    return dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)],
        [JointLaw("joint", friction_angle=np.radians(friction_deg), **law)],
        settings=DdaSettings(time_step=dt, dynamic_factor=1.0, max_displacement_ratio=0.01),
    )  # fmt: skip


@pytest.mark.parametrize("friction_deg", [10.0, 35.0, 55.0])
def test_a_wall_under_sudden_weight_settles_at_the_step_asked_for(friction_deg):
    # 10 ms is ten periods of a brick and the time of a wave through the wall: half the contacts change in the first
    # steps.
    system = brick_wall(20, 9, friction_deg, 0.01)
    state, table = State.at_rest(system.blocks), []
    for _ in range(15):
        result = system.step(state, WEIGHT)
        table.append(result.statistics["open_close_iterations"])
        assert result.dt == 0.01 and result.statistics["unbalanced"] < 1e-8
        state = result.state
    print(f"φ {friction_deg:g}°: iterations {table}, mean {np.mean(table):.1f}, max {max(table)}")
    assert max(table) <= 60
    assert np.mean(table[-5:]) <= 6


def test_the_central_path_ends_where_contacts_agree(monkeypatch):
    # What it proposes for the first step of a wall is right but for a few contacts in a thousand.
    wrong = []
    proposed, answer = iteration._Search._proposed, equations.Equations.answer
    state = {"follows": False}

    def watch(*arguments):
        state["follows"] = True
        return proposed(*arguments)

    def count(self, *arguments):
        found = answer(self, *arguments)
        if state["follows"]:
            wrong.append(int((found.violation > 0).sum()) / len(found.violation))
            state["follows"] = False
        return found

    monkeypatch.setattr(iteration._Search, "_proposed", watch)
    monkeypatch.setattr(equations.Equations, "answer", count)
    system = brick_wall(20, 9, 35.0, 0.01)
    system.step(State.at_rest(system.blocks), WEIGHT)
    assert wrong and wrong[0] < 0.02


def test_bonds_break_only_where_they_must():
    # A cantilever of five bricks glued at its root, twice as strong as the first joint needs in statics: nothing may
    # break on the way to a consistent state, however the iterations wander.
    polygons = [rectangle(-1, -1, 0, 2)] + [rectangle(k, 0, k + 1, 1) for k in range(5)]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * 5)
    moment = 2600 * 9.81 * 5 * 2.5
    # The extreme fibre of a 1 m joint carries 6 M / (1 m)².
    for share, holds in ((2.0, True), (0.5, False)):
        joint = JointLaw("glue", friction_angle=0.5, cohesion=1e7, tensile_strength=share * 6 * moment)
        system = dda.BlockSystem(
            blocks, [Material("rock", 10e9, 0.25, density=2600.0)], [joint],
            settings=DdaSettings(max_displacement_ratio=0.5),
        )  # fmt: skip
        # A second is statics: the first period of such a beam is 0.08 s.
        rows = system.step(State.at_rest(blocks), WEIGHT, 1.0).contacts
        assert rows["bonded"].all() == holds


class _PathOf:
    """A central path that leaves so many contacts undecided, one after the other."""

    blocked, missed, taken, bonded = False, 0.0, 0, np.zeros(10_000, np.int64)

    def __init__(self, undecided, arrived, epsilon=0.1):
        self.epsilon = epsilon
        self._left, self._arrived = list(undecided), arrived
        self.ended = self.arrived = False

    def advance(self):
        self.taken += 1
        undecided = self._left.pop(0)
        self.ended, self.arrived = not self._left, self._arrived and not self._left
        return undecided

    def states(self):
        return np.full(10_000, 1), np.zeros(10_000)


class _Found:
    """Ten thousand contacts, none of a face that keeps its cohesion as a whole."""

    whole = None

    def __len__(self):
        return 10_000


def proposed(path, **solver):
    """The states that ``path`` proposes to the search of a step of 10 000 contacts in statics."""
    search = object.__new__(iteration._Search)
    search.solver, search.found, search.large = ContactSolver(**solver), _Found(), False
    search.spent, search.offered = 0, set()
    return search._proposed(path)


@pytest.mark.parametrize(("undecided", "arrived", "taken"), [
    ([400, 12, 1], True, 2),  # few enough before the end
    ([400, 50, 20], True, 3),  # at its end the path has said all it can
    ([400, 50, 20], False, None),  # short of it, it has not
])  # fmt: skip
def test_a_path_that_arrives_proposes_its_states_though_some_contacts_hardly_touch(undecided, arrived, taken):
    path = _PathOf(undecided, arrived)
    assert (proposed(path) is not None) == (taken is not None)
    assert path.taken == (taken or 3)


def test_a_path_that_leads_nowhere_is_given_up():
    path = _PathOf([400] * 90, True)
    assert proposed(path, path_iterations=40) is None and path.taken == 40


def test_a_path_whose_forces_and_gaps_are_still_large_proposes_nothing():
    """Of blocks that fly apart contacts are decided, too: where ε has not come down these are no states to try."""
    assert proposed(_PathOf([400, 12, 1], True, epsilon=800.0)) is None


def test_a_wall_at_rest_is_asked_for_nothing_but_its_round_off():
    """A fifth of its contacts are at their strength, known no better than the gaps of coordinates: none is to be
    switched from step to step for digits that are not there."""
    blocks = block_scenes.wall(200)
    system = dda.BlockSystem(
        blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=block_scenes.settings(1.0, dynamic=False)
    )
    state = State.at_rest(blocks)
    for _ in range(3):
        state = system.step(state, block_scenes.WEIGHT).state
    state = replace(state, velocity=np.zeros_like(state.velocity))
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=block_scenes.settings(0.01))
    before, iterations = state.vertices, []
    for _ in range(8):
        result = system.step(state, block_scenes.WEIGHT)
        state = result.state
        iterations.append(result.statistics["open_close_iterations"])
        strength = np.tan(block_scenes.FRICTION) * result.contacts["normal_force"]
        assert (np.abs(result.contacts["shear_force"]) <= strength * (1 + 1e-8) + 1e-2).all()
    assert np.mean(iterations) <= 2.0
    assert np.abs(state.vertices - before).max() < 1e-13


def test_states_that_are_wrong_ask_for_no_exact_solution(monkeypatch):
    """A brick slides on a wall: the same states and motion as by exact solutions, with fewer substitutions."""
    blocks = block_scenes.with_loose_brick(block_scenes.wall(200))
    start = block_scenes.at_rest(blocks)
    velocity = start.velocity.copy()
    velocity[-1, 0] = 0.4
    told = []
    for roughly in (equations._ROUGHLY, block_solver.RESIDUAL):
        monkeypatch.setattr(equations, "_ROUGHLY", roughly)
        settings = block_scenes.settings(0.01)
        system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
        state, iterations = replace(start, velocity=velocity), []
        for _ in range(6):
            result = system.step(state, block_scenes.WEIGHT)
            state = result.state
            iterations.append(result.statistics["open_close_iterations"])
            assert result.statistics["unbalanced"] < 1e-11
        told.append((system._sparse[1].solver.counts["substitutions"], iterations, result))
    (few, iterations, result), (many, exactly, other) = told
    apart = np.abs(result.state.vertices - other.state.vertices).max()
    print(f"iterations {iterations}, {exactly}; substitutions {few}, {many}; {apart:.2g} m apart")
    assert few < many and sum(iterations) <= sum(exactly) + 2
    assert np.array_equal(result.contacts["state"], other.contacts["state"])
    assert apart < 1e-11
