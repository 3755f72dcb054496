"""The system of blocks of different orders: rows, matrix, products and residuals during open–close iterations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.dda.higher_order.equations import HigherOrderEquations
from geomech.dda.higher_order.six_row_system import SixRows, six_row_pattern
from geomech.dda.linear_solver import assembly, block_solver
from geomech.model import State


def wall_of(orders: list[int], bricks: int):
    """A wall whose bricks have these ``orders`` in turn, as a system, and its state at rest."""
    blocks = block_scenes.wall(bricks)
    order = np.resize(orders, blocks.n_blocks)
    blocks = replace(blocks, order=np.where(blocks.fixed, 1, order))
    system = dda.BlockSystem(
        blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=block_scenes.settings(0.01)
    )  # fmt: skip
    return system, State.at_rest(blocks)


@pytest.mark.parametrize(("order", "rows"), [(2, 120), (3, 200), (6, 560)])
def test_unknowns_of_three_blocks_share_a_row(order, rows):
    """60 blocks of 12, 20 and 56 unknowns: as many rows of six as they fill, and each unknown has its own place."""
    numbers, size = np.arange(60), np.full(60, (order + 1) * (order + 2))
    layout, _ = SixRows.of(numbers, size, [numbers])
    places = layout.unknowns()
    assert layout.n == rows
    assert len(np.unique(places)) == 60 * size[0] == len(places)
    assert places.max() < 6 * rows
    np.testing.assert_array_equal(places[:: size[0]], 6 * numbers)


def test_blocks_of_unlike_order_keep_their_places_with_the_solver():
    """A pattern with one pair fewer takes over the rows and the solver of the last one; one with a new pair does not."""
    n = 60
    order, size = np.arange(n), np.resize([6, 20, 12, 56, 20, 20], n)
    points = np.column_stack([np.arange(n), np.zeros(n)])
    block, other = np.arange(n - 1), np.arange(1, n)
    first = six_row_pattern(order, size, block, other, points)
    fewer = six_row_pattern(order, size, block[1:], other[1:], points, first)
    assert first.solver is not None and fewer.solver is first.solver
    np.testing.assert_array_equal(fewer.unknown, first.unknown)
    more = six_row_pattern(order, size, np.append(block, 0), np.append(other, 40), points, first)
    assert more.solver is not first.solver


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("orders", [[3], [1, 2, 3, 3, 6]])
def test_what_iterations_carry_along_is_what_they_would_compute(orders, monkeypatch):
    """In two steps of a wall: rows of blocks whose contacts have not changed are those of the whole matrix, bit for bit;
    the product by blocks and contacts, and the residual carried along, are those of the matrix to round-off."""
    assemble, solve, seen = HigherOrderEquations._assembled, assembly.solve, {"again": 0, "carried": 0}

    def checked(self, state, direction, springs, gap):
        held = self._held is not None
        out = assemble(self, state, direction, springs, gap)
        if held:
            data, side, rest = self._data.copy(), self._side.copy(), self._rest
            self._held = None
            assemble(self, state, direction, springs, gap)
            np.testing.assert_array_equal(data, self._data)
            np.testing.assert_array_equal(side, self._side)
            self._rest = rest
            seen["again"] += 1
        return out

    def solved(pattern, data, right, symmetric, force=0.0, near=(None, None), **named):
        if pattern.solver is not None:
            x = np.random.default_rng(1).normal(size=len(right))
            x[np.setdiff1d(np.arange(len(right)), pattern.unknown)] = 0.0
            by_entries = block_solver.multiply(data, pattern.solver.pointer, pattern.solver.columns, x)
            scale = np.abs(by_entries).max()
            np.testing.assert_allclose(named["product"](x), by_entries, rtol=0, atol=1e-13 * scale)
            if near[1] is not None:
                rest = right - block_solver.multiply(data, pattern.solver.pointer, pattern.solver.columns, near[0])
                size = block_solver.largest_terms(data, pattern.solver.pointer, pattern.solver.columns, near[0])
                np.testing.assert_allclose(near[1], rest, rtol=0, atol=1e-13 * size)
                seen["carried"] += 1
        return solve(pattern, data, right, symmetric, force, near, **named)

    monkeypatch.setattr(HigherOrderEquations, "_assembled", checked)
    monkeypatch.setattr(assembly, "solve", solved)
    system, state = wall_of(orders, 40)
    for _ in range(2):
        state = system.step(state, block_scenes.WEIGHT).state
    assert seen["again"] > 2 and seen["carried"] > 2


def test_single_precision_factors_give_the_result_of_double_ones(monkeypatch):
    """Residuals are round-off with both: the same wall, to what steps of different round-off agree to."""
    ends = []
    for rows in (1, 10**9):
        monkeypatch.setattr("geomech.dda.higher_order.six_row_system.SINGLE_ROWS", rows)
        system, state = wall_of([3], 40)
        for _ in range(3):
            result = system.step(state, block_scenes.WEIGHT)
            state = result.state
        assert system._sparse[1].solver._factors.single == (rows == 1)
        ends.append(state)
    np.testing.assert_allclose(ends[0].vertices, ends[1].vertices, rtol=0, atol=1e-12)
    speed = np.abs(ends[1].velocity).max()
    np.testing.assert_allclose(ends[0].velocity, ends[1].velocity, rtol=0, atol=1e-6 * speed)
