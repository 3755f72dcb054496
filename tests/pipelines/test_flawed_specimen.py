"""The study of specimens with many flaws, a small version of it run as the command line runs it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from geomech.cli import DONE, main

FOLDER = Path(__file__).parents[2] / "pipelines" / "flawed_specimen"
sys.path.insert(0, str(FOLDER))
import compare_flawed_specimen as study
import specimen


def test_one_closed_flaw_starts_at_the_load_of_ashby_and_hallam(verified, tmp_path):
    """√3/(√(1+μ²) − μ) = 3 for 30°; a specimen as wide as six flaws starts 1 to 2 % earlier. A flaw that stands 10° steeper
    starts later."""
    import numpy as np

    first = []
    for angle in np.radians([study.worst_angle(specimen.FRICTION_DEG), study.worst_angle(specimen.FRICTION_DEG) + 10]):
        half = 0.5 * specimen.FLAW * np.array([np.cos(angle), np.sin(angle)])
        first.append(specimen.course(tmp_path, [np.array([-half, half])], True, most=6).first)
    assert study.ashby_hallam(30.0) == pytest.approx(3.0)
    verified(
        "one closed flaw: σ √(πa) / K_Ic at initiation",
        None,
        "Ashby & Hallam 1986",
        found=study.scaled(first[0]),
        exact=3.0,
    )
    assert study.scaled(first[0]) == pytest.approx(3.0, rel=study.FIRST_TOLERANCE)
    assert first[1] > 1.03 * first[0]


@pytest.mark.slow
def test_a_small_version(tmp_path, monkeypatch):
    """One specimen with four closed flaws, past its peak, and a check that sees what is off."""
    seen, written = {}, study.report
    run = sys.modules.pop("run", None)
    monkeypatch.setattr(
        study, "report", lambda alone, runs: seen.update(alone=alone, runs=runs) or written(alone, runs)
    )
    monkeypatch.setattr(specimen, "NUMBERS", (4,))
    monkeypatch.setattr(specimen, "SEEDS", (1,))
    assert main(["run", str(FOLDER), "--quiet", "--out", str(tmp_path), "--variant", "closed"]) == DONE
    assert (tmp_path / "flawed_specimen.png").stat().st_size > 20_000 and run is None
    with pytest.raises(AssertionError, match="Ashby"):
        study.check(replace(seen["alone"], first=1.1 * seen["alone"].first), {})


@pytest.mark.slow
def test_twenty_flaws_are_pressed_through_their_peak(tmp_path):
    """Twenty closed frictional flaws: 29 MPa = 3.6 K_Ic/√(πa), first wings at 20.8."""
    found = specimen.course(tmp_path, specimen.flaws(20, 1), True)
    assert found.passed and found.joined >= 2
    assert found.first == pytest.approx(20.8e6, rel=0.01)
    assert 20e6 < found.peak < 40e6


def test_open_flaws_run_too(tmp_path):
    found = specimen.course(tmp_path, specimen.flaws(2, 1), False, most=4)
    assert found.first > 0.0 and len(found.load) == 5
