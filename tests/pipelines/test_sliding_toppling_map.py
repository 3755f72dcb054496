"""The study of columns on an incline, run as the command line runs it, against Yagoda-Biran & Hatzor (2013)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from geomech.cli import DONE, main

FOLDER = Path(__file__).parents[2] / "pipelines" / "sliding_toppling_map"
sys.path.insert(0, str(FOLDER))
import compare_sliding_toppling_map as study


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the study draws, and its folder."""
    out, seen = tmp_path_factory.mktemp("map"), {}
    drawn = study.draw

    def keep(path, incline, grid, found):
        seen.update(incline=incline, grid=grid, found=found)
        return drawn(path, incline, grid, found)

    study.draw = keep
    try:
        assert main(["run", str(FOLDER), "--quiet", "--out", str(out)]) == DONE
    finally:
        study.draw = drawn
    return {**seen, "out": out}


def test_its_check_holds_and_sees_what_is_off(seen):
    """That of the study itself: every column does what the map says, boundaries by bisection."""
    incline, grid, found = (seen[name] for name in ("incline", "grid", "found"))
    study.check(incline, grid, found)
    slenderness, friction, mode = grid[0]
    with pytest.raises(AssertionError, match="δ = "):
        study.check(incline, [(slenderness, friction, next(m for m in study.MODES if m != mode)), *grid[1:]], found)
    with pytest.raises(AssertionError, match="boundary"):
        study.check(incline, grid, {kind: table + np.radians([0, 0.05]) for kind, table in found.items()})


def test_it_writes_its_files(seen):
    assert "largest difference" in (seen["out"] / "comparison.txt").read_text(encoding="utf-8")
    assert (seen["out"] / "sliding_toppling_map.png").stat().st_size > 20_000
