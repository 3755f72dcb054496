"""Blocks of any shape that fall, spin and pile up, on a slope and in a drum: what holds in every step of it."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from geomech.bench.robustness.debris import DIP, LENGTH, avalanche, drum, follow


def checked(system, loads, seconds, caplog):
    with caplog.at_level(logging.WARNING):
        seen = follow(system, loads, seconds)
    print(
        f"{int((~system.blocks.fixed).sum())} blocks, {seconds:g} s, {seen.steps} steps, {seen.cuts} cuts: penetration "
        f"{seen.penetration:.1e}, overlap {seen.overlap:.1e} of a block, strain {seen.strain:.1e}; from nowhere "
        f"{seen.gained:.1e}, moving {seen.budget.last.kinetic / seen.budget.turnover:.1e} of all energy"
    )
    assert not caplog.records and seen.unbalanced < 1e-6
    # Springs of 40 E' give by v √(m/k), 1e-3 of a block, under an impact at 20 m/s.
    assert seen.penetration < 1e-3 and seen.overlap < 1e-3
    assert seen.gained < 1e-4 and seen.budget.scheme > 0.0
    return system.blocks.mean_vertices(seen.state.vertices)[~system.blocks.fixed], seen


@pytest.mark.parametrize(("n", "seconds"), [(25, 0.9), pytest.param(100, 60.0, marks=pytest.mark.slow)])
def test_an_avalanche_makes_no_energy_and_lets_no_block_into_another(n, seconds, caplog):
    middle, _ = checked(*avalanche(n), seconds, caplog)
    surface = np.where(middle[:, 0] < LENGTH * np.cos(DIP), -np.tan(DIP) * middle[:, 0], -LENGTH * np.sin(DIP))
    assert (middle[:, 1] > surface).all()


@pytest.mark.parametrize(("n", "seconds"), [(12, 0.8), pytest.param(100, 15.0, marks=pytest.mark.slow)])
def test_a_drum_that_turns_keeps_its_blocks_and_gives_them_no_more_than_its_work(n, seconds, caplog):
    system, loads = drum(n)
    middle, seen = checked(system, loads, seconds, caplog)
    inside = system.blocks.vertices[system.blocks.vertex_block == 0]
    # The sides' middles are the nearest to the axis.
    radius = np.hypot(*inside.T).min() * np.cos(np.pi / 36)
    assert (np.hypot(*middle.T) < radius).all()
    # The drum, which is fixed but for its turn, has turned as it was told to.
    assert seen.state.rotation[0] == pytest.approx(0.3 * seconds, rel=1e-9)
