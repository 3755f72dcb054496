"""Limits of blocks of higher order, as `geomech bench stability` maps them."""

import pytest

from geomech.bench.robustness import bending_scenes
from geomech.bench.robustness import stability_scenes as scenes
from geomech.bench.robustness.stability_grid import WRONG


@pytest.mark.parametrize("order", [2, 6])
def test_nearly_incompressible_rock_bears_its_weight(order):
    assert bending_scenes.incompressible(order, 1e-9).error < 1e-9


def test_contrasts_and_slivers():
    assert scenes.column(1e-3, 1e3, order=3).error < 1e-6
    assert scenes.sliver(1e3, 0.0, order=3).error < 1e-6


def test_frames_with_re_entrant_corners_bear_their_weight():
    assert bending_scenes.frame(3, 0.1).error < 1e-6
    assert bending_scenes.frame(8, 0.01).error < 1e-6


def test_a_spinning_block():
    outcome = bending_scenes.spinning(3, 5e-3)
    assert outcome.error < 1e-3 and outcome.drift < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("grid", list(bending_scenes.maps(True)), ids=lambda grid: grid.title)
def test_no_cell_is_silently_wrong(grid):
    assert not [cell for cell in grid.cells() if cell.verdict == WRONG]
