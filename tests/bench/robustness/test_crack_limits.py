"""The maps of the crack solver's limits: no cell is wrong in silence."""

import pytest

from geomech.bench.robustness import crack_limits
from geomech.bench.robustness.stability_grid import REFUSED, RIGHT, WRONG, table


@pytest.mark.parametrize("title", ["kink", "crack far from the origin", "closed crack that rubs"])
def test_no_cell_is_wrong_in_silence(title):
    (grid,) = (each for each in crack_limits.maps(quick=True) if each.title == title)
    cells = list(grid.cells())
    assert not [cell for cell in cells if cell.verdict == WRONG]
    assert [cell for cell in cells if cell.verdict == RIGHT]
    assert all(cell.reason for cell in cells if cell.verdict == REFUSED)
    assert len(list(table(grid, cells))) >= len(grid.rows) + 2


@pytest.mark.slow
def test_no_cell_of_any_map_is_wrong_in_silence():
    wrong = [cell for grid in crack_limits.maps(quick=False) for cell in grid.cells() if cell.verdict == WRONG]
    assert not wrong
