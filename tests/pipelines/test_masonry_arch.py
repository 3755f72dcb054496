"""The study of the masonry arch, run as the command line runs it, against limit analysis and Milankovitch (1907)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from geomech.cli import DONE, main
from geomech.reference import masonry

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


def test_thinnest_arches_are_those_of_limit_analysis(seen):
    # Bisection to 1e-5 and an elastic shortening of 1e-4 of the thickness.
    for n, ratio in seen["thinnest"].items():
        assert ratio == pytest.approx(masonry.thinnest_arch(n), rel=3e-4)
    assert seen["thinnest"][max(seen["thinnest"])] == pytest.approx(masonry.MILANKOVITCH_RATIO, abs=2e-4)


def test_it_falls_by_five_hinges(seen):
    # Joints stand every 7.5°: the one next to Milankovitch's 54.5° is 52.5°.
    assert sorted(seen["hinges"]) == pytest.approx([0.0, 52.5, 52.5, 90.0, 90.0])


def test_it_writes_its_files(seen):
    assert "Milankovitch" in (seen["out"] / "comparison.txt").read_text(encoding="utf-8")
    assert (seen["out"] / "masonry_arch.png").stat().st_size > 20_000
