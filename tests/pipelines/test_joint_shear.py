"""Direct shear of a joint with a rock bridge, run as the command line runs it, against friction and fracture loads."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

from geomech.cli import DONE, main
from geomech.reference.slopes import rock_bridges as published

FOLDER = Path(__file__).parents[2] / "pipelines" / "joint_shear"
sys.path.insert(0, str(FOLDER))
from compare_joint_shear import Sheared, check


def run_pipeline(out: Path, *variants: str) -> dict[str, Sheared]:
    """`geomech run pipelines/joint_shear`; what its own observers saw, by variant."""
    seen = []
    ended = Sheared.on_end

    def keep(self, summary, error=None):
        ended(self, summary, error)
        seen.append(self)

    Sheared.on_end = keep
    try:
        named = [word for name in variants for word in ("--variant", name)]
        few = ["--set", "output.interior=false", "--set", "output.checkpoint_every=0"]
        assert main(["run", str(FOLDER), "--quiet", "--out", str(out), *named, *few]) == DONE
    finally:
        Sheared.on_end = ended
    return dict(zip(variants, seen))


def unbalanced(run: Path) -> float:
    """The largest part of all energy converted that was not accounted for in any cycle."""
    with (run / "history.csv").open(encoding="utf-8") as file:
        return max(abs(float(row["budget_residual"])) for row in csv.DictReader(file) if row["budget_residual"])


def test_bridge_shears_and_friction_is_left(tmp_path):
    test = run_pipeline(tmp_path, "shears")["shears"]
    check({"shears": test})
    assert "shears" in (tmp_path / "comparison.txt").read_text()
    # A study whose bridge broke at another toughness is told.
    test.toughness *= 1.001
    with pytest.raises(AssertionError, match="K_IIc"):
        check({"shears": test})
    assert "Lajtai" in (tmp_path / "comparison.txt").read_text()


@pytest.mark.slow
def test_short_bridges_are_those_between_half_planes_and_load_adds_friction(tmp_path):
    """What the bridge carries beside friction over K_IIc √(πb): 1.243, 1.064 and 1.018 for bridges of 30, 15 and 7.5 %
    of the specimen; what is over 1 falls to less than 0.4 with every half."""
    tests = run_pipeline(tmp_path, "shears", "bridge_15", "bridge_7", "pressed")
    check(tests)
    over = np.array([tests[name].factor - 1 for name in ("shears", "bridge_15", "bridge_7")])
    assert (over > 0).all() and (over[1:] < 0.4 * over[:-1]).all()
    assert over[-1] < 0.025
    # Twice the normal load adds its friction; the bridge's part, which the joints' uneven pressure changes, grows by 7
    # %.
    part = [tests[name].start - tests[name].friction for name in ("pressed", "shears")]
    assert part[0] == pytest.approx(part[1], rel=0.1)


@pytest.mark.slow
def test_wings_leave_the_bridge_and_do_not_depend_on_the_increment(tmp_path):
    """Where only tension breaks rock both ends send wings away at 70.5° (Erdogan & Sih 1963; the first thing that tests
    show: Lajtai 1969, Gehle & Kutter 2003): the force falls at once, then rises with the way as they grow. With 2 and 1
    mm the same to 1e-3."""
    tests = run_pipeline(tmp_path, "tears", "tears_fine")
    check(tests)
    assert np.degrees(published.KINK) == pytest.approx(70.53, abs=5e-3)
    coarse, fine = tests.values()
    assert coarse.peak == pytest.approx(fine.peak, rel=1e-5)
    for grown in (0.014, 0.016):
        assert coarse.force_at(grown) == pytest.approx(fine.force_at(grown), rel=1e-3)
    # Followed back, not jumped, the energy of faces that rub while cracks grow closes with the increment.
    left = [unbalanced(tmp_path / name) for name in tests]
    print(left)
    assert left[0] < 5e-3 and left[1] < 0.4 * left[0]
