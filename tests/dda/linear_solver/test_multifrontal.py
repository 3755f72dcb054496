"""The direct solver of block systems, held against SuperLU."""

import threading

import numpy as np
import pytest
from scipy.sparse import bsr_array
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay

from geomech.compiled import kept
from geomech.dda.linear_solver import (
    block_solver,
    front_elimination,
    multifrontal,
    nested_dissection,
    simd,
    task_pool,
)
from geomech.dda.linear_solver.block_solver import BlockSolver
from geomech.dda.linear_solver.small_products import Matrix, Size


def springs_between(n, seed, islands=False):
    """Points, pattern and data of n blocks on springs to their neighbours, unsymmetric by friction-like terms."""
    rng = np.random.default_rng(seed)
    points = rng.random((n, 2)) * [3.0, 1.0]
    if islands:
        points[: n // 2] += 10.0
        hulls = [Delaunay(points[: n // 2]).simplices, Delaunay(points[n // 2 :]).simplices + n // 2]
        triangles = np.concatenate(hulls)
    else:
        triangles = Delaunay(points).simplices
    pairs = np.unique(
        np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1), axis=0
    )
    number = np.arange(n)
    keys = np.unique(np.concatenate([number * n + number, pairs @ [n, 1], pairs @ [1, n]]))
    rows, columns = keys // n, keys % n
    data = np.zeros((len(keys), 6, 6))
    data[rows == columns] = np.eye(6)
    for i, j in pairs:
        push, pull = rng.normal(size=(2, 12))
        spring = 1e4 * np.outer(push + 0.3 * pull, push)
        for a, k in enumerate((i, j)):
            for b, m in enumerate((i, j)):
                data[np.searchsorted(keys, k * n + m)] += spring[6 * a : 6 * a + 6, 6 * b : 6 * b + 6]
    return points, rows, columns, data


def full(rows, columns, data, n):
    return bsr_array((data, columns, np.searchsorted(rows, np.arange(n + 1))), shape=(6 * n, 6 * n))


@pytest.mark.parametrize(("n", "islands"), [(1, False), (7, False), (200, False), (200, True), (1700, False)])
def test_solution_is_that_of_superlu(n, islands):
    if n == 1:
        points, rows, columns, data = np.zeros((1, 2)), np.zeros(1, int), np.zeros(1, int), 2.0 * np.eye(6)[None]
    else:
        points, rows, columns, data = springs_between(n, seed=n, islands=islands)
    right = np.random.default_rng(1).normal(size=6 * n)
    x = BlockSolver(points, rows, columns).solve(data.ravel(), right)
    matrix = full(rows, columns, data, n)
    expected = splu(matrix.tocsc()).solve(right)
    # Condition 1e6 or so: both solvers have some ten digits.
    assert np.abs(x - expected).max() <= 1e-8 * np.abs(expected).max()
    assert np.abs(matrix @ x - right).max() <= 1e-11 * (abs(matrix) @ np.abs(x)).max()


def test_only_fronts_of_changed_springs_are_factored_again():
    points, rows, columns, data = springs_between(300, seed=3)
    solver, rng = BlockSolver(points, rows, columns), np.random.default_rng(4)
    right = rng.normal(size=1800)
    solver.solve(data.ravel(), right)
    assert solver.counts["shares"] == 1.0
    changed = data.copy()
    for at in rng.choice(np.flatnonzero(rows == columns), 3, replace=False):
        push = rng.normal(size=6)
        changed[at] += 1e4 * np.outer(push, push)
    x = solver.solve(changed.ravel(), right)
    # Three leaves and what lies above them.
    assert solver.counts["shares"] < 1.5
    fresh = BlockSolver(points, rows, columns).solve(changed.ravel(), right)
    assert np.abs(x - fresh).max() <= 1e-8 * np.abs(fresh).max()
    # A matrix that has hardly changed has nothing factored again.
    solver.solve(changed.ravel() * (1 + 1e-8 * rng.normal(size=changed.size)), right)
    assert solver.counts["factorisations"] == 2
    other = springs_between(300, seed=3)[3] * np.where(rows == columns, 3.0, 1.0)[:, None, None]
    before = solver.counts["shares"]
    solver.solve(other.ravel(), right)
    assert solver.counts["shares"] == before + 1.0


def test_factors_are_the_same_where_fronts_share_room_and_then_made_anew_in_full():
    points, rows, columns, data = springs_between(700, seed=12, islands=True)
    shared = multifrontal.Factors(points, rows, columns, again=False)
    own = multifrontal.Factors(points, rows, columns)
    assert own.tree.stack_size < 0.6 * own.tree.own_room_size
    for factors in (shared, own):
        assert factors.factor(data.ravel()) == 1.0
    assert np.array_equal(shared._factors, own._factors)
    few = np.zeros(700, bool)
    few[[3, 400]] = True
    data[few[rows] & (rows == columns)] *= 1.5
    # Rooms that others have used hold nothing to go on from.
    shared.factor(data.ravel(), few)
    own.factor(data.ravel(), again=False)
    assert own.factor(data.ravel(), few) == 1.0
    data[few[rows] & (rows == columns)] *= 1.5
    assert own.factor(data.ravel(), few) < 0.5
    assert shared.factor(data.ravel(), few) == 1.0
    assert np.array_equal(shared._factors, own._factors)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("single", [False, True])
def test_few_changed_springs_need_no_factors_where_all_would_be_made_anew(monkeypatch, single):
    # As of 100 000 blocks, whose fronts are too many for each to keep what it has passed on.
    monkeypatch.setattr(nested_dissection, "KEPT", 0)
    monkeypatch.setattr(block_solver, "SINGLE", 100 if single else 10**6)
    n, right = 900, np.random.default_rng(1).normal(size=5400)
    points, rows, columns, data = springs_between(n, seed=5)
    # As much inertia as a short step brings.
    data[rows == columns] += 1e3 * np.eye(6)
    solver = BlockSolver(points, rows, columns)
    solver.solve(data.ravel(), right)
    assert not solver.in_parts and solver.work.factorisations == 1
    changed = data.copy()
    for a, b in np.random.default_rng(2).choice(np.stack([rows, columns], axis=1)[rows < columns], 8, replace=False):
        # A stiff spring more between two blocks that meet.
        push = np.random.default_rng(a).normal(size=12)
        spring = 1e4 * np.outer(push, push)
        for u, k in enumerate((a, b)):
            for v, m in enumerate((a, b)):
                changed[(rows == k) & (columns == m)] += spring[6 * u : 6 * u + 6, 6 * v : 6 * v + 6]
    x = solver.solve(changed.ravel(), right)
    assert solver.work.factorisations == 1
    expected = splu(full(rows, columns, changed, n).tocsc()).solve(right)
    assert np.abs(x - expected).max() <= 1e-8 * np.abs(expected).max()


def test_single_precision_is_refined_to_the_same_residual(monkeypatch):
    points, rows, columns, data = springs_between(600, seed=8)
    # As much inertia as a short step brings: with less, these springs at random are beyond single precision.
    data[rows == columns] += 1e3 * np.eye(6)
    right = np.random.default_rng(2).normal(size=3600)
    expected = BlockSolver(points, rows, columns).solve(data.ravel(), right)
    monkeypatch.setattr(block_solver, "SINGLE", 0)
    solver = BlockSolver(points, rows, columns)
    x = solver.solve(data.ravel(), right)
    assert np.abs(x - expected).max() <= 1e-8 * np.abs(expected).max()
    assert solver._factors.single
    # Beyond its range it is double after all, …
    x = solver.solve(1e50 * data.ravel(), right)
    assert not solver._factors.single
    assert np.abs(1e50 * x - expected).max() <= 1e-8 * np.abs(expected).max()
    # … until few digits will do: then single precision takes its place, not one beside it, unless it does not serve
    # there either.
    x = solver.rough_solution(data.ravel())(right, 1e-4)
    assert solver._factors.single and solver._rough is None
    assert np.abs(solver.multiply(data.ravel(), x) - right).max() <= 1e-4 * np.abs(right).max()
    for _ in range(2):
        x = solver.rough_solution(1e50 * data.ravel())(right, 1e-4)
        assert not solver._factors.single
    assert np.abs(1e50 * x - expected).max() <= 1e-8 * np.abs(expected).max()


def test_rough_solutions_have_the_residual_asked_for_and_leave_the_exact_ones_alone():
    points, rows, columns, data = springs_between(600, seed=8)
    data[rows == columns] += 1e3 * np.eye(6)
    right, solver = np.random.default_rng(2).normal(size=3600), BlockSolver(points, rows, columns)
    exact = solver.solve(data.ravel(), right)
    rough = solver.rough_solution(3.0 * data.ravel())
    x = rough(right, 1e-4)
    assert 0.0 < np.abs(solver.multiply(3.0 * data.ravel(), x) - right).max() <= 1e-4 * np.abs(right).max()
    done = solver.counts["factorisations"]
    assert np.array_equal(solver.solve(data.ravel(), right), exact)
    assert solver.counts["factorisations"] == done
    # Beyond the range of single precision they are the exact ones.
    x = solver.rough_solution(1e50 * data.ravel())(right, 1e-4)
    assert np.abs(1e50 * x - exact).max() <= 1e-8 * np.abs(exact).max()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_products_of_parts_of_fronts_are_those_of_numpy(dtype):
    rng = np.random.default_rng(3)
    front = rng.normal(size=(720, 700)).astype(dtype)

    @kept(error_model="numpy", nogil=True)
    def add_product(c, a, b, size, keep, width, units):
        front_elimination._add_product(c, a, b, size, keep, width, units)

    units, width = np.array([1, 0], dtype), simd.BYTES // front.itemsize
    # Of whole registers and not, one and more; the last one is for BLAS.
    for rows, k, n in ((6, 1, 1), (12, 7, 16), (6, 12, 18), (18, 12, 33), (12, 30, 64), (30, 5, 70), (660, 30, 660)):
        a, b = front[24 : 24 + rows, :k], front[:k, 35 : 35 + n]
        product = a.astype(float) @ b.astype(float)
        for keep in (False, True):
            c = front.copy() if keep else np.full_like(front, np.nan)
            expected = c.astype(float)
            expected[60 : 60 + rows, 40 : 40 + n] = product + (front[60 : 60 + rows, 40 : 40 + n] if keep else 0.0)
            given = Matrix(c.reshape(-1), 60 * 700 + 40, 700), Matrix(front.ravel(), 24 * 700, 700)
            add_product(*given, Matrix(front.ravel(), 35, 700), Size(rows, k, n), keep, width, units)
            # What lies beside them is as it was.
            assert np.allclose(c, expected, rtol=0.0, atol=100 * np.finfo(dtype).eps, equal_nan=True)


def test_result_does_not_depend_on_threads(monkeypatch):
    points, rows, columns, data = springs_between(400, seed=5)
    right = np.ones(2400)
    alone = BlockSolver(points, rows, columns).solve(data.ravel(), right)
    monkeypatch.setattr(multifrontal, "THREADED", 0)
    monkeypatch.setattr(multifrontal, "_THREADED_FACTORS", 0)
    for helpers in (0, 1, 5):
        team = task_pool.ThreadTeam(helpers)
        monkeypatch.setattr(multifrontal, "thread_team", lambda team=team: team)
        for _ in range(10):
            # On a busy machine it would go on alone.
            team._alone.clear()
            assert np.array_equal(BlockSolver(points, rows, columns).solve(data.ravel(), right), alone)


def test_tasks_stand_behind_all_they_need():
    points, rows, columns, _ = springs_between(700, seed=8, islands=True)
    tree = nested_dissection.plan(points, rows, columns)
    task = np.full(len(tree.parent), -1)
    for k, (first, last) in enumerate(tree.tasks):
        assert (task[first:last] == -1).all()
        task[first:last] = k
    assert len(tree.tasks) > 10 and (task >= 0).all()
    has = tree.parent >= 0
    mine, its = task[has], task[tree.parent[has]]
    assert (mine <= its).all()
    assert np.array_equal(tree.above[mine[mine != its]], its[mine != its])
    assert (tree.above[task[~has]] == -1).all()


def test_a_thread_works_alone_while_cores_are_busy(monkeypatch):
    team, clock = task_pool.ThreadTeam(2), [0.0]
    monkeypatch.setattr(task_pool.time, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(task_pool.time, "thread_time", lambda: 0.0)
    came, here = [], threading.Barrier(3)

    def work(together):
        came.append(threading.get_ident())
        if together:
            here.wait(60)

    clock[0] = 1.0
    team.share(work, True)
    assert len(set(came)) == 3
    monkeypatch.setattr(task_pool.time, "perf_counter", lambda: clock.append(clock[-1] + 1.0) or clock[-1])
    team.share(work, True)
    del came[:]
    team.share(work, False)
    assert came == [threading.get_ident()]


def test_singular_matrix_is_refused():
    points, rows, columns, data = springs_between(50, seed=6)
    data[rows == 7] = 0.0
    with pytest.raises(np.linalg.LinAlgError):
        BlockSolver(points, rows, columns).solve(data.ravel(), np.ones(300))


def test_every_block_is_eliminated_once_and_reaches_upwards_only():
    points, rows, columns, _ = springs_between(500, seed=7)
    tree = nested_dissection.plan(points, rows, columns)
    assert np.array_equal(np.sort(tree.rank), np.arange(500))
    for f, parent in enumerate(tree.parent):
        reached = tree.boundary[tree.reach[f] : tree.reach[f + 1]]
        assert (reached >= tree.pivots[f + 1]).all()
        assert parent == -1 or parent > f
        assert len(reached) == 0 or parent >= 0
    # A plane graph of n blocks falls apart at separators of √n blocks or so; the fill stays within a few n log n.
    assert np.diff(tree.pivots) @ np.diff(tree.reach) < 2.5 * 500 * np.log2(500)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("turned", [0.0, np.radians(25)])
def test_cuts_follow_the_short_rows_of_blocks(turned):
    # Bricks in courses of twelve, thirty courses high, as wide as they are high; their beds level or inclined.
    i, j = np.meshgrid(np.arange(12), np.arange(30), indexing="ij")
    x, y = (i.ravel() + 0.5 * (j.ravel() % 2)) / 12, j.ravel() / 30
    points = np.column_stack([np.cos(turned) * x - np.sin(turned) * y, np.sin(turned) * x + np.cos(turned) * y])
    near = (np.abs(x[:, None] - x) < 1.1 / 12) & (np.abs(y[:, None] - y) < 1.1 / 30)
    rows, columns = np.nonzero(near)
    tree = nested_dissection.plan(points, rows, columns)
    assert np.diff(tree.pivots)[-1] <= 13


def test_a_solution_goes_no_farther_than_it_is_asked_to():
    points, rows, columns, data = springs_between(300, seed=8)
    solver = BlockSolver(points, rows, columns)
    solver.solve(data.ravel(), np.ones(1800))
    data[rows == columns] *= 1.0 + 0.5 * block_solver.CHANGED  # the factors at hand will do
    done = []
    for within in (1e-3, 1e-12):
        before = solver.counts["substitutions"]
        x = solver.solve(data.ravel(), np.ones(1800), within)
        at = data.ravel(), solver.pointer, solver.columns, x
        product, size = block_solver.multiply(*at), block_solver.largest_terms(*at)
        assert np.abs(1.0 - product).max() <= max(within, block_solver.ROUND_OFF * size)
        done.append(solver.counts["substitutions"] - before)
    assert done[0] < done[1]


def test_products_and_their_largest_terms(monkeypatch):
    _, rows, columns, data = springs_between(30, seed=9)
    matrix, x = full(rows, columns, data, 30), np.random.default_rng(2).normal(size=180)
    at = data.ravel(), np.searchsorted(rows, np.arange(31)), columns, x
    size = (abs(matrix) @ np.abs(x)).max()
    assert block_solver.largest_terms(*at) == pytest.approx(size, rel=1e-14)
    product = block_solver.multiply(*at)
    assert np.abs(product - matrix @ x).max() <= 1e-14 * size
    # The same to the bit when threads share the rows.
    monkeypatch.setattr(block_solver, "THREADED", 0)
    monkeypatch.setattr(block_solver, "SHARE", 4)
    assert np.array_equal(block_solver.multiply(*at), product)


def test_what_large_forces_leave_when_they_cancel_is_solved_to_their_round_off(monkeypatch):
    monkeypatch.setattr(block_solver, "SINGLE", 0)
    points, rows, columns, data = springs_between(600, seed=8)
    data[rows == columns] += 1e3 * np.eye(6)
    right = np.random.default_rng(2).normal(size=3600)
    solver = BlockSolver(points, rows, columns)
    exact = solver.solve(data.ravel(), right)
    before = solver.counts["substitutions"]
    solver.solve(data.ravel(), right)
    alone = solver.counts["substitutions"] - before
    force = 1e8 * np.abs(right).max()
    x = solver.solve(data.ravel(), right, force=force)
    assert solver.counts["substitutions"] - before - alone < alone
    rest = right - full(rows, columns, data, 600) @ x
    assert 0 < np.abs(rest).max() <= 1e-12 * force
    assert np.abs(x - exact).max() <= 1e-3 * np.abs(exact).max()


@pytest.mark.parametrize("single", [False, True])
def test_from_a_near_solution_on_it_takes_fewer_substitutions_to_the_same_residual(monkeypatch, single):
    monkeypatch.setattr(block_solver, "SINGLE", 1 if single else 10**9)
    points, rows, columns, data = springs_between(400, seed=8)
    solver, rng = BlockSolver(points, rows, columns), np.random.default_rng(9)
    right = rng.normal(size=2400)
    before = solver.solve(data.ravel(), right)
    # Factors of the first matrix serve the next one, which differs by less than is factored again.
    data *= 1.0 + 1e-7 * rng.normal(size=len(data))[:, None, None]
    other = right.copy()
    other[:6] += 1e-3
    took, answers = [], []
    for near in (None, before):
        told = solver.counts["substitutions"]
        answers.append(solver.solve(data.ravel(), other, near=near))
        took.append(solver.counts["substitutions"] - told)
        rest = other - solver.multiply(data.ravel(), answers[-1])
        assert np.abs(rest).max() <= max(1.01e-12 * np.abs(other).max(), solver._round_off(data.ravel(), answers[-1]))
    print(f"substitutions {took}")
    assert took[1] < took[0]
    assert np.abs(answers[1] - answers[0]).max() <= 1e-8 * np.abs(answers[0]).max()
    assert np.array_equal(
        before, BlockSolver(points, rows, columns).solve(springs_between(400, seed=8)[3].ravel(), right)
    )


def test_matrices_of_two_kinds_that_come_by_turns_are_each_factored_in_part(monkeypatch):
    points, rows, columns, data = springs_between(300, seed=3)
    right = np.random.default_rng(5).normal(size=1800)
    solver, other = BlockSolver(points, rows, columns), data * np.where(rows == columns, 3.0, 1.0)[:, None, None]
    solver.solve(data.ravel(), right)
    solver.alternate.solve(other.ravel(), right)
    assert solver.counts == {"factorisations": 2, "shares": 2.0, "substitutions": solver.counts["substitutions"]}
    for at in np.flatnonzero(rows == columns)[[7, 150]]:
        data[at] *= 1.5
        other[at] *= 1.5
        solver.solve(data.ravel(), right)
        x = solver.alternate.solve(other.ravel(), right)
    assert solver.counts["factorisations"] == 6 and solver.counts["shares"] < 4.0
    expected = splu(full(rows, columns, other, 300).tocsc()).solve(right)
    assert np.abs(x - expected).max() <= 1e-8 * np.abs(expected).max()
    # Where two would take more room than one may, one serves both, in part or …
    with monkeypatch.context() as patched:
        patched.setattr(block_solver, "KEPT", 2 * solver._factors.tree.own_room_size - 1)
        assert solver.in_parts and solver.alternate is solver
    assert solver.alternate is not solver
    # … where factors are made anew, in full.
    monkeypatch.setattr(nested_dissection, "KEPT", 0)
    large = BlockSolver(points, rows, columns)
    assert large.alternate is large
