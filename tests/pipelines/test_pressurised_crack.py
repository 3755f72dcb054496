"""The study of a pressurised crack below a free surface, run as the command line runs it, against published values."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
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


def test_stress_intensity_factors_by_an_independent_method(seen):
    """Dislocations in the half-plane: 3e-5 of |K| at all depths that they resolve; the block's size leaves 1e-5."""
    exact = study.independent(seen["depths"])
    off = np.abs(seen["k"] - exact).max(axis=1) / np.hypot(*exact.T)
    assert np.isfinite(off).sum() == 7 and np.nanmax(off) < 3e-5


def test_shallow_cracks_lift_a_thin_plate(seen):
    """Hutchinson & Suo's factors: 0.25 % and 0.15 % are the second order that the extrapolation leaves."""
    assert study.shallow_limit(seen["depths"], seen["k"]) == pytest.approx([1.0, 1.0], abs=5e-3)


def test_deep_cracks_do_not_see_the_surface(seen):
    """Three per cent at five half-lengths, falling with the square of the depth."""
    deep = seen["k"][-2:, 0] / np.sqrt(np.pi) - 1
    assert deep[1] < 0.03 and deep[0] / deep[1] == pytest.approx(2.5**2, rel=0.15)
    assert np.abs(seen["k"][-1, 1]) < 0.004 * seen["k"][-1, 0]


def test_cracks_come_up_on_both_sides(seen):
    for depth, cracks in seen["paths"].items():
        up = cracks.nodes[cracks.surface & (cracks.valence > 0)]
        assert len(up) == 2 and np.allclose(up[:, 1], 0, atol=1e-9) and len(cracks.tips) == 0
        # Mirror images, and outwards all the way.
        assert up[:, 0].sum() == pytest.approx(0, abs=0.02 * np.ptp(up[:, 0])) and np.ptp(up[:, 0]) > 2 * (1 + depth)


def test_it_writes_its_files(seen):
    assert "extrapolated to no depth" in (seen["out"] / "comparison.txt").read_text(encoding="utf-8")
    assert (seen["out"] / "pressurised_crack.png").stat().st_size > 20_000
