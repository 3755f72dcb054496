"""Blocks that bend, cells, glued sub-blocks of first order and finite elements on the same panels."""

from __future__ import annotations

import numpy as np
import pytest

from geomech.bench.accuracy.bending_precision import PANELS, energy, table
from geomech.bench.figures import Point


def error(panel: str, *given, **more) -> float:
    return abs(energy(PANELS[panel], *given, **more) / PANELS[panel].exact - 1)


def test_orders_and_sizes_bring_the_error_down():
    """What the table of `geomech bench order` says, of its coarsest grids."""
    assert error("cantilever", 0, 1) > 0.9 < error("cantilever", 1, 1, glued=False)
    assert error("cantilever", 0, 3) < 3e-3
    assert error("cantilever", 1, 3) < 4e-4 < error("cantilever", 1, 2) < 1e-2
    assert error("Cook's membrane", 2, 3) < 0.5 * error("Cook's membrane", 1, 3) < 0.02


def test_finite_elements_come_to_the_same_energy():
    pytest.importorskip("skfem", reason="pip install 'geomech[bench]'")
    from geomech.bench.peers.quadratic_quads import stored_energy

    for panel, rel in ((PANELS["cantilever"], 1e-4), (PANELS["Cook's membrane"], 4e-3)):
        found, unknowns = stored_energy(
            panel.corners, 4 * panel.columns, 4 * panel.rows, panel.rock, np.array([0, panel.traction])
        )
        assert found == pytest.approx(panel.exact, rel=rel)
        assert unknowns > 500


def test_the_table_has_a_row_for_each_method():
    text = table(
        [Point("cantilever", "one block", 3, 1e-3, 0.01), Point("cantilever", "cells of order 2", 1, 2e-3, 0.02)]
    )
    assert "one block" in text and "1: 2.0e-03    20.0" in text


def test_the_table_has_observed_orders():
    text = table(
        [Point("cantilever", "one block", p, 10.0**-p, 0.01) for p in (2, 4)]
        + [Point("cantilever", "cells of order 2", n, n**-3.0, 0.02) for n in (1, 2, 4)]
    )
    assert "1.00 digits an order" in text and "h^3.0" in text
