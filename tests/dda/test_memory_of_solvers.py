"""What solvers of many blocks hold at once: factors of one matrix in one precision."""

import weakref
from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.dda.linear_solver import assembly, block_solver, nested_dissection
from geomech.dda.linear_solver.block_solver import BlockSolver
from geomech.dda.linear_solver.multifrontal import Factors
from geomech.model import Blocks, ContactSolver, State


@pytest.fixture
def alive(monkeypatch):
    """As of 100 000 blocks: how many `Factors` are alive whenever some are made, and whether these are single."""
    for module, name, value in (
        (block_solver, "SINGLE", 0), (nested_dissection, "KEPT", 0), (assembly, "DENSE_BLOCKS", 0),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)
    # Of 100 000 blocks, factors of a patch are none beside the others.
    large, settings = ContactSolver(large_system=0, single_precision_only=0, patch_blocks=0), block_scenes.settings
    monkeypatch.setattr(
        block_scenes, "settings", lambda *given, **named: replace(settings(*given, **named), contact_solver=large)
    )
    made, told, factor = weakref.WeakSet(), [], Factors.factor

    def watched(self, *given):
        made.add(self)
        told.append((len(made), self.single))
        return factor(self, *given)

    monkeypatch.setattr(Factors, "factor", watched)
    return told


def column_on_springs(n: int):
    """Points, pattern and data of n blocks, each on a spring of its own and on one to the next."""
    number = np.arange(n)
    keys = np.unique(np.concatenate([number * (n + 1), number[:-1] * (n + 1) + 1, number[1:] * (n + 1) - 1]))
    rows, columns = keys // n, keys % n
    data = np.where((rows == columns)[:, None, None], 3.0, -1.0) * np.eye(6)
    return np.stack([number, 0 * number], axis=1).astype(float), rows, columns, data.ravel()


def serves_only_in_double(monkeypatch):
    """Nothing that single precision leaves is brought down."""
    follow = BlockSolver._follow

    def failing(self, data, x, rest, largest, target, factors, *others):
        return not factors.single and follow(self, data, x, rest, largest, target, factors, *others)

    monkeypatch.setattr(BlockSolver, "_follow", failing)


@pytest.mark.parametrize("rough", [False, True])
def test_single_factors_are_gone_before_double_ones_are_made(alive, monkeypatch, rough):
    solver, right = BlockSolver(*(at := column_on_springs(200))[:3]), np.random.default_rng(1).normal(size=1200)
    expected = solver.solve(at[3], right)
    assert solver._factors.single
    serves_only_in_double(monkeypatch)
    x = solver.rough_solution(at[3])(right, 1e-9) if rough else solver.solve(at[3], right)
    assert alive[0] == (1, True) and alive[-1] == (1, False) and set(alive) == {alive[0], alive[-1]}
    assert x == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_a_solver_of_single_precision_only_gives_up_and_goes_on(alive, monkeypatch):
    *pattern, data = column_on_springs(200)
    solver, right = BlockSolver(*pattern), np.random.default_rng(1).normal(size=1200)
    expected, solver.single_only = solver.solve(data, right), True
    with monkeypatch.context() as patched:
        serves_only_in_double(patched)
        for solve in (solver.solve, lambda *given: solver.rough_solution(data)(right, 1e-9)):
            with pytest.raises(np.linalg.LinAlgError, match="single precision"):
                solve(data, right)
    with pytest.raises(np.linalg.LinAlgError, match="single precision"):
        # Beyond its range, too.
        solver.rough_solution(1e50 * data)(right, 1e-9)
    x = solver.rough_solution(data)(right, 1e-9)
    assert solver._factors.single and np.abs(x - expected).max() < 1e-7
    assert np.array_equal(solver.solve(data, right), expected)


@pytest.mark.parametrize(("spread", "single"), [(0.1, True), (0.9, False)])
def test_single_factors_serve_on_while_residuals_fall(alive, monkeypatch, spread, single):
    """Factors that are wrong by a little take more directions than one cycle has; those that lead nowhere are given
    up after one."""
    *pattern, data = column_on_springs(200)
    right, substitute = np.random.default_rng(1).normal(size=1200), Factors.substitute
    expected = BlockSolver(*pattern).solve(data, right)
    wrong = 1.0 + spread * np.random.default_rng(2).uniform(-1.0, 1.0, 1200)
    monkeypatch.setattr(block_solver, "TRIES", 5)
    monkeypatch.setattr(Factors, "substitute", lambda self, b: substitute(self, b) * (wrong if self.single else 1.0))
    solver = BlockSolver(*pattern)
    assert np.abs(solver.solve(data, right) - expected).max() < 1e-10
    assert solver._factors.single == single and solver.counts["substitutions"] > 6


def test_of_many_blocks_in_motion_a_step_beyond_single_precision_is_cut(alive, monkeypatch):
    blocks = block_scenes.slope(80)

    def step(seconds, dynamic=True):
        settings = block_scenes.settings(seconds, dynamic)
        system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
        return system.step(State.at_rest(blocks), block_scenes.WEIGHT), system._sparse[1].solver

    half = step(0.005)[0]
    solved, asked = BlockSolver._solved, []

    def beyond(self, *given):
        # The first matrix is.
        asked.append(self)
        return None if len(asked) == 1 else solved(self, *given)

    monkeypatch.setattr(BlockSolver, "_solved", beyond)
    result, solver = step(0.01)
    assert (result.dt, result.statistics["step_cuts"]) == (0.005, 1) and solver._factors.single
    assert np.array_equal(result.state.vertices, half.state.vertices)
    assert set(alive) == {(1, True)}
    asked.clear()
    del result, solver
    # In statics a shorter step helps little.
    assert step(0.01, dynamic=False)[0].dt == 0.01
    assert set(alive) == {(1, True), (1, False)}


def test_a_solver_is_gone_before_one_of_more_contacts_factors(alive):
    """A static step in which bricks go through what lies below is tried again with contacts from farther away: here with
    those of courses that are drawn 5 cm apart."""
    blocks, made = block_scenes.wall(80), []
    corners = blocks.vertices.reshape(-1, 4, 2)
    corners = corners + [0.0, 0.05] * np.round(2 * corners.min(axis=1, keepdims=True) + 1)
    settings = replace(block_scenes.settings(0.15, dynamic=False), max_displacement_ratio=1.0)
    blocks = Blocks.from_polygons(list(corners), fixed=blocks.fixed.tolist())
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
    find = system.finder.find
    system.finder.find = lambda *given, **named: made.append(find(*given, **named)) or made[-1]
    system.step(State.at_rest(blocks), block_scenes.WEIGHT)
    pairs = [set(zip(found.block.tolist(), found.other.tolist(), strict=True)) for found in made]
    assert len(pairs) > 1 and pairs[-1] > pairs[0]
    assert {number for number, _ in alive} == {1}


def test_directions_lie_where_factors_are_made(alive, monkeypatch):
    """… in between: what is solved is the same to the bit as with a room of their own."""
    monkeypatch.setattr(block_solver, "TRIES", 8)
    monkeypatch.setattr(block_solver, "TRIES_OF_FEW", 8)
    blocks, told, kept = block_scenes.slope(300), [], Factors.idle_room
    for room in (kept, property(lambda self: np.empty(0))):
        monkeypatch.setattr(Factors, "idle_room", room)
        settings, state = block_scenes.settings(0.01), State.at_rest(blocks)
        system = dda.BlockSystem(blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=settings)
        for _ in range(2):
            state = system.step(state, block_scenes.WEIGHT).state
        solver = system._sparse[1].solver
        told.append((state.vertices, np.shares_memory(solver._directions._directions, solver._factors._room)))
        assert np.shares_memory(solver._directions._directions, solver._shown._directions)
    assert (told[0][1], told[1][1]) == (True, False) and np.array_equal(told[0][0], told[1][0])
