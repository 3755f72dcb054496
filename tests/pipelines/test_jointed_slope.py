"""The slope in an earthquake, run as the command line runs it, in large blocks, beside Newmark's sliding block."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from geomech import load_scene
from geomech.cli import DONE, main
from geomech.output import Run
from geomech.reference.blocks.base_shaking import sliding_block

FOLDER = Path(__file__).parents[2] / "pipelines" / "jointed_slope"
sys.path.insert(0, str(FOLDER))
from compare_jointed_slope import Slide, report


def run_pipeline(out: Path, *wishes: str) -> Slide:
    """`geomech run pipelines/jointed_slope --variant short`; returns what its own observer saw."""
    seen = []
    ended = Slide.on_end
    Slide.on_end = lambda self, summary, error=None: seen.append(self)
    try:
        sets = [word for wish in wishes for word in ("--set", wish)]
        assert main(["run", str(FOLDER), "--variant", "short", "--quiet", "--out", str(out), *sets]) == DONE
    finally:
        Slide.on_end = ended
    return seen[-1]


def test_it_has_a_thousand_blocks_and_a_hundred_cracks():
    problem = load_scene(FOLDER).problem()
    assert (~problem.blocks.fixed).sum() == pytest.approx(1000, rel=0.05)
    assert problem.cracks.n_cracks == pytest.approx(100, rel=0.05)


def test_record_is_that_of_el_centro():
    """As the sliding block's own test has it, after half a second at rest."""
    base = load_scene(FOLDER).problem().loads.base.acceleration
    rows = np.loadtxt(Path(__file__).parents[1] / "validation" / "el_centro_1940_ns.txt").ravel()
    assert base.times[1:] == pytest.approx(0.5 + 0.02 * np.arange(len(rows) + 1))
    assert base.values[2:, 0] / 9.80665 == pytest.approx(rows)
    assert not base.values[:2].any()


@pytest.mark.slow
def test_slips_like_a_sliding_block(tmp_path):
    """Whole blocks, over the two pulses that move the slope: Newmark's rigid block slips by 34.5 mm on its plane.

    Found: 40.9 mm in the mean of the rock, 42.0 in shorter steps. Jointed rock is no rigid block: it turns on its
    joints, which open and slide too (a tenth of the blocks move 12 mm or less, a tenth 64 mm or more), for which a
    quarter is allowed. Until the first pulse above the yield acceleration, at 2.1 s, nothing slides: blocks and joints
    give by 0.74 mm (in steps of 2.5 ms; 0.75 here) and swing back.
    """
    slide = run_pipeline(tmp_path, "geometry.dead_ends=trim", "output.every=1000")
    table = slide.table
    expected = slide.newmark(table[:, 0])
    assert table[-1, 1] == pytest.approx(expected[-1], rel=0.25)
    quiet = (table[:, 0] >= 0.5) & (table[:, 0] < 1.9)
    assert np.abs(table[quiet, 1]).max() == pytest.approx(0.74e-3, rel=0.05)
    assert np.abs(table[quiet, 1][-2:]).max() < 0.2e-3
    text = (tmp_path / "short" / "comparison.txt").read_text(encoding="utf-8")
    assert "Newmark's sliding block" in text and "by phase" in text and "nan" not in text
    assert (tmp_path / "short" / "jointed_slope.png").stat().st_size > 50_000


@pytest.mark.slow
def test_rock_bridges_break_and_the_slope_slides_a_little_farther(tmp_path):
    """With cracks, of which nine cut their blocks: 41 mm found, as in whole blocks, Newmark 34.5. Blocks and
    cracks agree in every cycle; the study itself checks when and how far it slides."""
    slide = run_pipeline(tmp_path, "output.every=1000")
    assert max(slide.settled) < 0.1
    assert slide.events["split"] > 5
    assert slide.table[-1, 1] == pytest.approx(41.0e-3, rel=0.15)


def test_newmark_is_followed_on_its_own_times():
    """Interpolation of the record and of the result changes nothing that could be seen."""
    slide = Slide(problem=load_scene(FOLDER).problem())
    record = slide.problem.loads.base.acceleration
    exact = sliding_block(record.times, record.values[:, 0], np.radians(22.0), np.radians(28.0))
    assert slide.newmark(record.times) == pytest.approx(exact, abs=1e-5)
    assert exact[-1] > 0.05


@pytest.fixture(scope="module")
def cracked(tmp_path_factory):
    """The first steps with cracks, until most of the weight has come."""
    out = tmp_path_factory.mktemp("slope")
    return run_pipeline(out, "run.end_time_s=0.2", "output.checkpoint_every=5"), out / "short"


def test_cracked_blocks_take_their_weight(cracked):
    """Every tip has its factors, the run is stored, its time told by phase."""
    slide, out = cracked
    run = Run(out)
    assert run.summary["end"] == "end of the scene"
    assert slide.problem.cracks.n_cracks > 10 and len(slide.last.tips) > 10
    assert np.isfinite(slide.last.tips["k_eq"]).all()
    assert (out / "checkpoint").is_dir()
    assert {"dda", "ddm solve", "tractions", "compliance"} <= set(run.summary["seconds"])


def test_a_run_whose_cracks_and_blocks_disagree_is_not_trusted(cracked):
    """Steps that end without agreement make energy: the study says so beside its comparison."""
    slide, _ = cracked
    slide.settled = [1e-5, 0.5]
    assert "not to be trusted" in report(slide, {"wall_s": 1.0})
    slide.settled = [1e-5, 1e-3]
    assert "not to be trusted" not in report(slide, {"wall_s": 1.0})
