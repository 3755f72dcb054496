"""What `check` says cracked blocks ask for: their unknowns as the solver has them, memory and time by these."""

from __future__ import annotations

from dataclasses import replace

import pytest

from geomech import ddm
from geomech.coupling import crack_cost


def test_unknowns_are_those_of_the_solver(torn_plate):
    cost = crack_cost.crack_cost(torn_plate)
    assert len(cost.blocks) == 1
    block = int(cost.blocks[0])
    body = ddm.Body(
        torn_plate.blocks.loops(block),
        torn_plate.cracks,
        torn_plate.materials[torn_plate.blocks.material[block]],
        torn_plate.ddm,
    )
    m, n = body.boundary.n_unknowns, body.faces.n_unknowns
    assert (cost.on_sides[0], cost.on_cracks[0]) == (m, n)
    # A_ΓΓ and its factors, A_CΓ A_ΓΓ⁻¹ and A_ΓC, S and its factors with those of other states; these with room to grow.
    assert cost.memory == pytest.approx(8 * (2 * m * m + 2 * m * n + 4 * n * n))
    assert cost.growing == pytest.approx(8 * 4 * n * n)
    assert cost.seconds > 0


def test_many_blocks_store_less(torn_plate, monkeypatch):
    """A product of two thin matrices for A_CΓ A_ΓΓ⁻¹, factors of few states, and of sides no more than a given sum."""
    monkeypatch.setattr(crack_cost, "MANY", 1)
    monkeypatch.setattr(crack_cost, "KEPT_BESIDE_FACTORS", 10)
    monkeypatch.setattr(crack_cost, "FOR_GROWTH", 1e3)
    cost = crack_cost.crack_cost(torn_plate)
    m, n = int(cost.on_sides[0]), int(cost.on_cracks[0])
    assert cost.memory == pytest.approx(8 * (crack_cost.PRODUCT * m * n + crack_cost.STATES * n * n))
    assert cost.growing == pytest.approx(8 * 4 * n * n + 1e3)


def test_lines_name_the_largest_block_and_what_makes_it_large(torn_plate, monkeypatch):
    (line,) = crack_cost.cost_lines(torn_plate)
    assert "1 cracked block" in line and "unknowns on sides" in line and "GB" in line and "processor time" in line
    monkeypatch.setattr(crack_cost, "LARGE", 10)
    monkeypatch.setattr(crack_cost, "FINE", 0.01)
    _, finely, graded = crack_cost.cost_lines(torn_plate)
    assert "simplify_m" in finely and "grading_layers" in graded
    # What the line promises of a problem that is graded.
    ungraded = replace(torn_plate, ddm=replace(torn_plate.ddm, grading_layers=0))
    assert crack_cost.crack_cost(ungraded).memory < crack_cost.crack_cost(torn_plate).memory
    assert len(crack_cost.cost_lines(ungraded)) == 2
