"""The study of random slopes: exact, published and rare probabilities of failure."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from geomech.cli import DONE, main
from geomech.reference.slopes.random_strengths import HOEK_DEVIATION, HOEK_MEAN, HOEK_PROBABILITY, PlanarSlope
from geomech.sweep.execution import read_sweep
from geomech.sweep.measures import Job, carry_out
from geomech.sweep.plan import plan_of

FOLDER = Path(__file__).parents[2] / "pipelines" / "random_slope"
sys.path.insert(0, str(FOLDER))
import compare_random_slope as study


@pytest.fixture(scope="module")
def out(tmp_path_factory) -> Path:
    """Two slopes with normal strengths, as the command line makes them; `main` checks them."""
    folder = tmp_path_factory.mktemp("random")
    words = ["--variant", "normal_strengths", "--set", "sweep.runs=2"]
    assert main(["run", str(FOLDER), "--quiet", "--out", str(folder), *words]) == DONE
    return folder


def test_every_factor_is_that_of_limit_equilibrium(verified, out):
    found = read_sweep(out / "normal_strengths")
    assert len(found.rows) == 2
    verified(
        "factors of random planar slopes",
        np.abs(study.factors_off("normal_strengths", found)).max(),
        "limit equilibrium",
    )
    assert np.abs(study.factors_off("normal_strengths", found)).max() < study.FACTOR_TOLERANCE
    assert "exact" in (out / "comparison.txt").read_text(encoding="utf-8")
    assert (out / "random_slope.png").stat().st_size > 10_000 and (out / "normal_strengths" / "report.html").is_file()


def test_the_check_sees_what_is_off(out):
    found = read_sweep(out / "normal_strengths")
    study.check({"normal_strengths": found})
    found.rows[1]["factor_of_safety"] *= 1.01
    with pytest.raises(AssertionError, match="off limit equilibrium"):
        study.check({"normal_strengths": found})


def test_the_published_slope_is_drawn_as_it_is_published():
    """Crack, water and shaking of three samples: each factor as limit equilibrium has it."""
    plan = plan_of(FOLDER / "planar.toml", table=FOLDER / "sau_mau_ping.toml")
    for number in (0, 1, 2):
        values = plan.table[number]
        row = carry_out(Job(number, str(plan.scene), None, plan.changes(values), plan.settings, plan.box, plan.cells))
        assert row["status"] == "done", row["reason"]
        exact = study.limit_equilibrium("sau_mau_ping", values)
        assert row["factor_of_safety"] == pytest.approx(exact, rel=study.FACTOR_TOLERANCE)


def test_limit_equilibrium_of_its_distributions_gives_the_published_numbers():
    """Hoek (2007): 6.4 %, 1.34 ± 0.23, printed to two digits, of a few thousand samples; here a hundred thousand."""
    plan = plan_of(FOLDER / "planar.toml", {"runs": 100_000}, table=FOLDER / "sau_mau_ping.toml", limit=10**6)
    factors = np.array([study.limit_equilibrium("sau_mau_ping", row) for row in plan.table])
    # Plus the error of a probability known from 1 000 samples, as those of the day were.
    assert np.mean(factors < 1) == pytest.approx(HOEK_PROBABILITY, abs=0.0005 + math.sqrt(0.064 * 0.936 / 1000))
    assert factors.mean() == pytest.approx(HOEK_MEAN, abs=0.005)
    assert factors.std() == pytest.approx(HOEK_DEVIATION, abs=0.005)


def test_the_exact_probability_is_that_of_many_samples():
    """A million samples of linear margins, known to 1/√(n P_f)."""
    slope, rng = PlanarSlope(water=5.0, shaking=0.05), np.random.default_rng(1)
    z = rng.standard_normal((1_000_000, 2)) @ np.linalg.cholesky([[1, -0.3], [-0.3, 1]]).T
    margin = slope.length * (98.1e3 + 19.62e3 * z[:, 0]) + slope.pressing * (0.7 + 0.1 * z[:, 1]) - slope.driving
    exact = slope.probability((98.1e3, 19.62e3), (0.7, 0.1), -0.3)
    assert np.mean(margin < 0) == pytest.approx(exact, rel=3.3 / math.sqrt(1e6 * exact))
    # The margin is what the factor exceeds 1 by, times what drives.
    assert slope.factor(98.1e3, math.atan(0.7)) - 1.0 == pytest.approx(
        (slope.length * 98.1e3 + slope.pressing * 0.7 - slope.driving) / slope.driving, rel=1e-12
    )


@pytest.mark.slow
def test_the_whole_study(tmp_path):
    """`main` checks exact, rare and published probabilities, and factors of all planar runs."""
    assert main(["run", str(FOLDER), "--quiet", "--out", str(tmp_path)]) == DONE
    text = (tmp_path / "comparison.txt").read_text(encoding="utf-8")
    assert "Hoek" in text and "Two joint sets" in text
