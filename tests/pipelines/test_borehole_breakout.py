"""The borehole study, run as the command line runs it; its own report asserts the closed forms."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from geomech.cli import DONE, main

FOLDER = Path(__file__).parents[2] / "pipelines" / "borehole_breakout"
sys.path.insert(0, str(FOLDER))
import compare_borehole
from borehole import GREATER, LESSER, RADIUS, ROCK, azimuths, steps

from geomech.reference.openings.borehole import breakdown_pressure, breakout_ratio


def test_the_study_runs_and_is_what_was_published(tmp_path):
    pytest.importorskip("matplotlib")
    assert main(["run", str(FOLDER), "--quiet", "--out", str(tmp_path)]) == DONE
    text = (tmp_path / "comparison.txt").read_text(encoding="utf-8")
    assert "Hubbert & Willis" in text and "Breakout" in text
    assert (tmp_path / "borehole.png").stat().st_size > 10_000


def test_onset_and_breakdown_converge_to_the_closed_forms(verified):
    """Of second order in the sides of the polygon; half the sides, more than twice the error."""
    expected = {
        "breakout": breakout_ratio(GREATER, LESSER, ROCK.cohesion, ROCK.friction_angle),
        "mud_pressure": breakdown_pressure(GREATER, LESSER, ROCK.tensile_strength) / 1e6,
    }
    for name, value in expected.items():
        errors = []
        for sides in (24, 48):
            run = steps(name, sides=sides, most=1)
            errors.append(abs(compare_borehole.onset(run) / value - 1))
            assert np.abs(azimuths(run) - (90 if name == "breakout" else 0)).max() < 1e-3
        print(f"{name}: errors {errors}, observed order {np.log2(errors[0] / errors[1]):.2f}")
        verified(
            f"borehole, {name.replace('_', ' ')}: load at which rock fails first",
            errors,
            "Kirsch 1898; Hubbert & Willis 1957",
            over=("sides of the borehole", (24, 48)),
        )
        assert errors[1] < 0.5 * errors[0]


@pytest.mark.slow
def test_shear_cracks_stop_where_they_stop_whatever_the_increment():
    """Half the increment: the same depth, to within the longer one."""
    depths = []
    for increment in (8e-3, 4e-3):
        run = steps("shear", increment=increment)
        assert run[-1].events[-1].kind == "arrest"
        depths.append(compare_borehole.depth(run))
    print(f"arrested at {depths} radii")
    assert abs(depths[0] - depths[1]) * RADIUS < 8e-3


def test_a_variant_that_is_not_there_is_refused(tmp_path, capsys):
    assert main(["run", str(FOLDER), "--quiet", "--out", str(tmp_path), "--variant", "flood"]) != DONE
    assert "no variant 'flood'" in capsys.readouterr().err
