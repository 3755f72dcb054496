"""Where the trials of a factor of safety begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from block_problems import WEIGHT, rectangle, turned

from geomech import dda
from geomech.dda.statics import strength_reduction
from geomech.model import GROUND, Blocks, Bolt, JointLaw, Material

DIP, FRICTION = np.radians(25), np.radians(40)


def factor(loads=WEIGHT) -> dda.FactorOfSafety:
    """Of a square on an incline."""
    outlines = [turned(rectangle(-3, -2, 8, 0), DIP), turned(rectangle(1, 0, 2, 1), DIP)]
    blocks = Blocks.from_polygons(outlines, fixed=[True, False])
    return dda.factor_of_safety(
        blocks, [Material("rock", 50e9, 0.0, density=2600.0)], [JointLaw("plane", FRICTION)], loads,
        search=dda.FactorSearch(compare=False, follow=False),
    )  # fmt: skip


@pytest.fixture
def relaxed(monkeypatch):
    """The results of the relaxations so far."""
    found, real = [], strength_reduction._relaxed
    monkeypatch.setattr(strength_reduction, "_relaxed", lambda *args: found.append(real(*args)) or found[-1])
    return found


def test_nothing_is_relaxed_where_the_first_trial_finds_an_equilibrium(relaxed):
    found = factor()
    assert found.factor == pytest.approx(np.tan(FRICTION) / np.tan(DIP), rel=1e-6)
    assert not relaxed and found.trials[0].stable


def test_blocks_that_keep_moving_are_relaxed_and_tried_again(relaxed, monkeypatch):
    real, failed = strength_reduction.stability_trial, []

    def trial(system, state, under, factor, limit):
        result, end = real(system, state, under, factor, limit)
        if failed:
            return result, end
        failed.append(factor)
        return replace(result, stable=False, reason="keeps moving"), end

    monkeypatch.setattr(strength_reduction, "stability_trial", trial)
    found = factor()
    assert found.factor == pytest.approx(np.tan(FRICTION) / np.tan(DIP), rel=1e-6)
    assert len(relaxed) == 1 and [t.stable for t in found.trials if t.factor == failed[0]] == [False, True]


def test_bolted_blocks_begin_with_relaxation(relaxed):
    bolt = Bolt(1, (0.9, 1.0), GROUND, (-3.0, -0.5), 1e8, yield_force=1e3)
    factor(replace(WEIGHT, bolts=(bolt,)))
    assert len(relaxed) == 1 and relaxed[0] is not None


@pytest.mark.parametrize(("aim", "second"), [(1.0, True), (1.2, False)])
def test_a_second_trial_fails_only_where_the_first_fails_at_the_bound(aim, second):
    """A trial above the bound shows the mechanism of the bound, which is another where blocks fail earlier."""
    bracket = object.__new__(strength_reduction._Bracket)
    bracket._aim, bracket._at_once = aim, False
    assert bracket._expected(1.1) == second
