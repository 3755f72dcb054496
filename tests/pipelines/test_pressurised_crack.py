"""The study of a pressurised crack below a free surface, run as the command line runs it, against published values."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from geomech.cli import DONE, main

FOLDER = Path(__file__).parents[2] / "pipelines" / "pressurised_crack"
sys.path.insert(0, str(FOLDER))
import compare_pressurised_crack as study


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the study hands to its report, and its folder."""
    out, seen = tmp_path_factory.mktemp("pressurised"), {}
    written = study.report

    def keep(depths, k, paths):
        seen.update(depths=depths, k=k, paths=paths)
        return written(depths, k, paths)

    study.report = keep
    try:
        assert main(["run", str(FOLDER), "--quiet", "--out", str(out)]) == DONE
    finally:
        study.report = written
    return {**seen, "out": out}


def test_its_check_holds_and_sees_what_is_off(seen):
    """That of the study itself: dislocations in the half-plane at all depths that they resolve, Hutchinson & Suo's thin
    plate, Griffith far down, and cracks that come up on both sides."""
    depths, k, paths = seen["depths"], seen["k"], seen["paths"]
    study.check(depths, k, paths)
    assert (depths >= study.RESOLVED).sum() == 7
    with pytest.raises(AssertionError, match="dislocations"):
        study.check(depths, 1.0001 * k, paths)
    shallow = k.copy()
    shallow[0] *= 1.01  # of a depth that dislocations do not resolve
    with pytest.raises(AssertionError, match="thin plate"):
        study.check(depths, shallow, paths)
    with pytest.raises(AssertionError, match="outwards"):
        study.check(depths, k, {10.0 * depth: cracks for depth, cracks in paths.items()})


def test_it_writes_its_files(seen):
    assert "extrapolated to no depth" in (seen["out"] / "comparison.txt").read_text(encoding="utf-8")
    assert (seen["out"] / "pressurised_crack.png").stat().st_size > 20_000
