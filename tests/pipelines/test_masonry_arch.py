"""The study of the masonry arch, run as the command line runs it, against limit analysis and Milankovitch (1907)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from geomech.cli import DONE, main

FOLDER = Path(__file__).parents[2] / "pipelines" / "masonry_arch"
sys.path.insert(0, str(FOLDER))
import compare_masonry_arch as study


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the study hands to its report, and its folder."""
    out, seen = tmp_path_factory.mktemp("arch"), {}
    written = study.report

    def keep(thinnest, hinges):
        seen.update(thinnest=thinnest, hinges=hinges)
        return written(thinnest, hinges)

    study.report = keep
    try:
        assert main(["run", str(FOLDER), "--quiet", "--out", str(out)]) == DONE
    finally:
        study.report = written
    return {**seen, "out": out}


def test_its_check_holds_and_sees_what_is_off(seen):
    """That of the study itself: limit analysis, Milankovitch's ratio, five hinges."""
    thinnest, hinges = seen["thinnest"], seen["hinges"]
    # Joints stand every 7.5°: the one next to Milankovitch's 54.5° is 52.5°.
    assert sorted(hinges) == pytest.approx([0.0, 52.5, 52.5, 90.0, 90.0])
    study.check(thinnest, hinges, 24)
    with pytest.raises(AssertionError, match="6 voussoirs"):
        study.check(thinnest | {6: 1.001 * thinnest[6]}, hinges, 24)
    with pytest.raises(AssertionError, match="five hinges"):
        study.check(thinnest, hinges[:4], 24)


def test_it_writes_its_files(seen):
    assert "Milankovitch" in (seen["out"] / "comparison.txt").read_text(encoding="utf-8")
    assert (seen["out"] / "masonry_arch.png").stat().st_size > 20_000
