"""En-echelon joints in a slope and the step path between them: first load, path, similarity, convergence."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from geomech.cli import DONE, main
from geomech.output import Run

FOLDER = Path(__file__).parents[2] / "pipelines" / "step_path_slope"
sys.path.insert(0, str(FOLDER))
from compare_step_path_slope import StepPath, check

#: Blocks' displacements turn and stretch what is worked out on the geometry at the start of a step, by parts in ten
#: thousand.
SIMILAR = 1e-3


def run_pipeline(out: Path, *wishes: str, variant: str = "four") -> StepPath:
    """`geomech run pipelines/step_path_slope --variant …`, whose report `check`s it; what its own observer saw."""
    seen = []
    ended = StepPath.on_end

    def keep(self, summary, error=None):
        ended(self, summary, error)
        seen.append(self)

    StepPath.on_end = keep
    try:
        wished = [word for wish in wishes for word in ("--set", wish)]
        code = main(["run", str(FOLDER), "--quiet", "--out", str(out), "--variant", variant, *wished])
    finally:
        StepPath.on_end = ended
    assert code == DONE
    return seen[-1]


@pytest.fixture(scope="module")
def four(tmp_path_factory):
    out = tmp_path_factory.mktemp("step")
    return out, run_pipeline(out)


def test_the_first_tip_starts_at_the_load_of_the_crack_solver_alone(verified, four):
    """7.2104 g for 7.2329 g: in ground as deep as it is wide 0.3 % are left of how it stands."""
    _, seen = four
    check("four", seen)
    verified(
        "en-échelon joints in a slope: first tip starts",
        None,
        "crack solver alone",
        found=seen.started,
        exact=seen.alone,
    )
    assert seen.started == pytest.approx(seen.alone, rel=5e-3)


def test_joints_link_from_the_toe_up_and_the_path_cuts_the_slope(four):
    _, seen = four
    assert len(seen.linked) == 3 and np.all(np.diff(seen.linked) >= 0)
    assert np.all(np.diff(np.array(seen.places)[:, 1]) > 0)
    assert seen.failed == seen.linked[-1] == seen.held
    # Between the kink of pure shear (Erdogan & Sih 1963) and straight across (Einstein et al. 1983).
    assert (seen.links > math.radians(70)).all() and (seen.links < math.radians(95)).all()
    # What comes off is what lies above the joints, but for the bridges' own triangles.
    x, y = seen.cut_off.T
    area = 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
    assert area * 2600 * 9.81 == pytest.approx(seen.weight, rel=0.01)


@pytest.mark.slow
def test_loads_go_with_the_toughness(four, tmp_path):
    """Friction alone: stresses go with gravity, so that a tip of twice the toughness asks for twice the gravity. Here
    half, which the ramp reaches sooner."""
    half = run_pipeline(tmp_path, "materials.rock.k_ic_pa_sqrt_m=0.5e6")
    _, seen = four
    assert half.started == pytest.approx(seen.started / 2, rel=SIMILAR)
    assert half.held == pytest.approx(seen.held / 2, rel=SIMILAR)
    assert half.links == pytest.approx(seen.links, abs=math.radians(0.5))


def test_it_writes_its_files(four):
    out, _ = four
    assert "Einstein" in (out / "comparison.txt").read_text(encoding="utf-8")
    assert (out / "step_path_slope.png").stat().st_size > 20_000
    assert {"initiation", "coalescence", "split"} <= set(Run(out / "four").summary["first"])


@pytest.mark.slow
def test_loads_go_with_the_size(four, tmp_path):
    """K goes with ρ g L^{3/2}: a slope of twice the size fails at 2^−3/2 of the gravity."""
    shape = "geometry.parameters={ joints = 4, joint_length_m = 6.0, step_m = 1.0 }"
    large = run_pipeline(tmp_path, shape, "growth.increment_m=0.3")
    _, seen = four
    assert large.started == pytest.approx(seen.started / 2**1.5, rel=SIMILAR)
    assert large.held == pytest.approx(seen.held / 2**1.5, rel=SIMILAR)


@pytest.mark.slow
def test_loads_do_not_depend_on_the_increment(four, tmp_path):
    """7.80 g with 0.15, 0.1 and 0.05 m, to a part in a thousand; bridges are 0.5 m across."""
    _, seen = four
    for increment in (0.1, 0.05):
        finer = run_pipeline(tmp_path / f"{increment}", f"growth.increment_m={increment}")
        assert finer.held == pytest.approx(seen.held, rel=1e-3)


@pytest.mark.slow
def test_loads_that_are_followed_have_the_same_peak(four, tmp_path):
    """Between bridges the load falls back to what the tips just bear; its peak is the dead load's, to what the
    increments make of paths under another load."""
    followed = run_pipeline(tmp_path, 'run.control="toughness"')
    _, seen = four
    assert followed.held == pytest.approx(seen.held, rel=2e-3)
    assert min(followed.linked) < 0.5 * seen.started


@pytest.mark.slow
def test_ten_joints_go_at_once(tmp_path):
    """The first bridge takes all others with it: 2.404 g whatever the increment, for 2.420 g by the crack solver
    alone."""
    for name in ("increment_300", "increment_150"):
        seen = run_pipeline(tmp_path / name, variant=name)
        assert seen.failed == seen.started == pytest.approx(2.4044, rel=2e-4)
