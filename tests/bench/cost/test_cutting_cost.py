"""`geomech bench geometry`: every network is cut whole, and costs are told by size."""

from __future__ import annotations

import pytest

from geomech.bench.cost.cutting_cost import NETWORKS, cost, exponent
from geomech.render.benchmarks.cost_of_size import draw_cutting


def test_every_network_is_cut_into_about_as_many_blocks_as_asked_for(tmp_path):
    costs = {network: [cost(network, n, 1) for n in (50, 100, 400)] for network in NETWORKS}
    for own in costs.values():
        # Poisson lines of a hundred cells are some twenty lines: their number varies by half.
        assert 250 < own[-1].blocks < 900
        # Shares of 1e-16 of the rock each.
        assert max(c.lost for c in own) < 1e-13
        assert own[-1].cutting > 0 and own[-1].cutting + own[-1].making < 60
    path = draw_cutting([c for own in costs.values() for c in own], tmp_path / "cost.png")
    assert path.stat().st_size > 10_000


def test_the_exponent_is_that_of_a_power_law():
    from geomech.bench.cost.cutting_cost import Cost

    rows = [Cost("two sets", n, 0, 0, 0.0, 2e-6 * n**1.3, 0.0, 0.0) for n in (10, 100, 1000, 10_000)]
    assert exponent(rows) == pytest.approx(1.3, rel=1e-12)
