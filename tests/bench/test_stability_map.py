"""What a cell of the stability map tells besides its error, and that the picture shows it."""

import pytest

from geomech.bench.robustness import stability_scenes as scenes
from geomech.bench.robustness.stability_grid import OF_BLOCKS, RIGHT, Map
from geomech.model import Material
from geomech.render.benchmarks.stability_map import draw


def test_a_cell_tells_penetration_drift_and_cuts_and_is_drawn(tmp_path):
    grid = Map("rest", "height", "gap / size", (0.0,), "dt, s", (1e-2,), 1e-3, lambda g, dt: scenes.start(40, g, dt))
    (cell,) = grid.cells()
    assert cell.verdict == RIGHT
    # Half the weight of a block of 1 m on each of its two springs, 40 E' stiff.
    rock = Material("rock", 10e9, 0.25, density=2600.0)
    sunk = 0.5 * rock.density * scenes.GRAVITY / (40 * rock.plane_modulus)
    assert cell.penetration == pytest.approx(sunk, rel=0.2)
    assert 0 <= cell.drift < 1e-5 and cell.cuts == 0
    plain = draw([grid], [cell], tmp_path / "plain.png", {})
    full = draw([grid], [cell], tmp_path / "full.png", OF_BLOCKS)
    assert full.stat().st_size > plain.stat().st_size > 1000
