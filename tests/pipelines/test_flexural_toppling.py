"""The study of flexural toppling, run as the command line runs it; its own check asserts bending theory and the turning
piece."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from geomech.cli import DONE, main
from geomech.output import Run
from geomech.reference.slopes import flexural_toppling as published

FOLDER = Path(__file__).parents[2] / "pipelines" / "flexural_toppling"
FEW_FILES = ("--set", "output.interior=false", "--set", "output.every=1000")
#: Of the energy converted, what may be left over in any cycle.
LEFT_OVER = 0.01


def run(out: Path, *variants: str, more: tuple[str, ...] = ()) -> str:
    named = [word for name in variants for word in ("--variant", name)]
    assert main(["run", str(FOLDER), "--quiet", "--out", str(out), *named, *FEW_FILES, *more]) == DONE
    for name in variants:
        assert np.nanmax(np.abs(Run(out / name).history["budget_residual"])) < LEFT_OVER
    return (out / "comparison.txt").read_text(encoding="utf-8")


def test_a_flawed_column_breaks_where_bending_theory_has_it(tmp_path):
    # The load at which it starts is no matter of the increment: it is to be through in two of them.
    assert "bending theory" in run(tmp_path, "flaw_30", more=("--set", "growth.increment_m=0.4"))
    last = Run(tmp_path / "flaw_30").history[-1]
    # Rock takes K_Ic²/E' for the way; loads that are held up as it breaks would have done 15 times that, and more.
    assert last["fracture_energy"] == pytest.approx(0.7 * 1e12 * (1 - 0.25**2) / 10e9, rel=0.02)


@pytest.mark.slow
def test_size_of_the_flaw_joints_without_flaws_and_the_piece_that_topples(tmp_path):
    text = run(tmp_path, "flaw_10", "flaw_20", "stack", "topples")
    assert "rigid one on its toe" in text and "bent columns" in text


def test_bending_theory_by_hand():
    bending, mean = published.base_stresses(25e3, 10.0, 1.0, math.radians(30))
    assert bending == pytest.approx(6 * (25e3 * 10 * 0.5 * 5.0))  # 6M/t²
    assert mean == pytest.approx(-25e4 * math.cos(math.radians(30)))
    # A rod that hangs from its end, let go level: it is level again on the other side after the time of its swing.
    times = [0.0, 1.0]
    still = published.turning((0.0, -1.0), 4 / 3, (0.0, -9.81), 0.0, times)
    assert still[-1] == pytest.approx(0.0, abs=1e-12)
    slow = published.turning((1e-6, -1.0), 4 / 3, (0.0, -9.81), 0.0, [0.0, math.pi / math.sqrt(9.81 * 3 / 4)])
    assert slow[-1] == pytest.approx(-2e-6, rel=1e-6)  # half a period of a small swing
