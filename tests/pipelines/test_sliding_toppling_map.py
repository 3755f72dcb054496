"""The study of columns on an incline, run as the command line runs it, against Yagoda-Biran & Hatzor (2013)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from geomech.cli import DONE, main
from geomech.reference.block_on_incline import MODES, failure_mode

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


def test_every_column_does_what_the_map_says(seen):
    for slenderness, friction, mode in seen["grid"]:
        assert mode == failure_mode(slenderness, friction, seen["incline"])
    assert {mode for *_, mode in seen["grid"]} == set(MODES)


def test_boundaries_by_bisection(seen):
    # The threshold of motion, 2e-4 g, and elastic give: 0.01° each.
    assert np.degrees(study.worst(seen["incline"], seen["found"])) < 0.02


def test_it_writes_its_files(seen):
    assert "largest difference" in (seen["out"] / "comparison.txt").read_text(encoding="utf-8")
    assert (seen["out"] / "sliding_toppling_map.png").stat().st_size > 20_000
