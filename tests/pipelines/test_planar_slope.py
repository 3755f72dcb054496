"""The sliding plane with one rock bridge, against limit equilibrium plus the bridge's fracture load."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from geomech.cli import DONE, main
from geomech.output import Run
from geomech.reference.slopes import rock_bridges as published
from geomech.reference.slopes.rock_slopes import plane_failure_factor

FOLDER = Path(__file__).parents[2] / "pipelines" / "planar_slope"
sys.path.insert(0, str(FOLDER))
from compare_planar_slope import BridgedPlane, check


def run_pipeline(out: Path, variants: tuple[str, ...], *wishes: str) -> dict[str, BridgedPlane]:
    """`geomech run pipelines/planar_slope --variant …`; what its own observer saw of each variant."""
    seen = []
    ended = BridgedPlane.on_end

    def keep(self, summary, error=None):
        ended(self, summary, error)
        seen.append(self)

    BridgedPlane.on_end = keep
    try:
        named = [word for name in variants for word in ("--variant", name)]
        wished = [word for wish in wishes for word in ("--set", wish)]
        code = main(["run", str(FOLDER), "--quiet", "--out", str(out), *named, *wished])
    finally:
        BridgedPlane.on_end = ended
    assert code == DONE
    return dict(zip(variants, seen, strict=True))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Bridges of 1 and 2 % of the plane; the report that `main` writes checks them against the formula."""
    out = tmp_path_factory.mktemp("plane")
    return out, run_pipeline(out, ("bridge_300", "bridge_600"))


def test_a_bridge_breaks_at_limit_equilibrium_plus_its_fracture_load(verified, study):
    """1.5755 and 2.1170 g for 1.5853 and 2.1452: the lower end is driven by 0.6 and 1.3 % more than the mean of both,
    which is the formula's to 0.2 %."""
    for name, seen in study[1].items():
        check(name, seen)
        verified(
            f"sliding plane with a bridge of {seen.bridge:g} m: multiple of gravity at failure",
            None,
            "limit equilibrium with K √(πb)",
            found=seen.started,
            exact=seen.expected(),
        )
        assert seen.started == pytest.approx(seen.expected(), rel=0.01 * (1 if name == "bridge_300" else 2) + 0.002)
        assert seen.factor_ratio == pytest.approx(1, abs=0.003)


def test_a_bridge_that_starts_to_shear_goes_at_once_and_frees_the_block(study):
    for seen in study[1].values():
        assert seen.failed == seen.started
        rock = [b for b in range(seen.split.blocks.n_blocks) if not seen.split.blocks.fixed[b]]
        areas = sorted(area(seen.split.blocks.loops(b)[0]) for b in rock)
        # The block is what is drawn above the plane; its path between the joints is straight to rounding.
        assert areas[0] == pytest.approx(area(seen.block), rel=1e-9)
        assert sum(areas) == pytest.approx(area(seen.outline), rel=1e-12)


def test_without_a_bridge_the_formula_is_limit_equilibrium(study):
    seen = study[1]["bridge_300"]
    alone = seen.expected(toughness=0.0)
    factor = plane_failure_factor(
        alone * seen.weight, seen.dip, seen.length, seen.law.cohesion, seen.law.friction_angle
    )
    assert factor == pytest.approx(1, rel=1e-12)
    assert published.shear_factor(seen.excess(seen.expected()), seen.bridge) == pytest.approx(
        seen.rock.k_iic, rel=1e-12
    )


def test_rock_is_worth_less_cohesion_the_longer_its_bridges(study):
    """K √(πb)/2b: as the root of the length. Jennings' plane would have one cohesion for both."""
    short, long = study[1]["bridge_300"].jennings, study[1]["bridge_600"].jennings
    assert short / long == pytest.approx(math.sqrt(2), rel=0.02)


def test_it_writes_its_files(study):
    out, _ = study
    assert "Jennings" in (out / "comparison.txt").read_text(encoding="utf-8")
    assert (out / "planar_slope.png").stat().st_size > 20_000
    assert {"initiation", "split"} <= set(Run(out / "bridge_300").summary["first"])


@pytest.mark.slow
def test_all_bridges_and_whatever_the_increment(tmp_path):
    """Initiation does not know the increment; failure comes with it."""
    names = ("bridge_150", "bridge_300", "bridge_600", "bridge_1200", "tears")
    seen = run_pipeline(tmp_path / "all", names)
    off = [abs(seen[name].started / seen[name].expected() - 1) for name in names[:4]]
    assert np.all(np.diff(off) > 0)  # the formula is for short bridges
    fine = run_pipeline(tmp_path / "fine", ("bridge_600",), "growth.increment_m=0.03")["bridge_600"]
    assert fine.failed == pytest.approx(seen["bridge_600"].failed, rel=1e-6)


def area(loop: np.ndarray) -> float:
    x, y = loop.T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
