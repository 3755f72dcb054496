"""`geomech bench sliding`: the slab that is drawn, and slopes held against one another and against it."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest

from geomech.bench.slopes.drawn_slopes import problem_of
from geomech.bench.slopes.limited_runs import RIGHT, WRONG
from geomech.bench.slopes.sliding_scenes import Slope, random_slope, slab
from geomech.bench.slopes.sliding_slopes import measure_many, slid, table
from geomech.cli import main
from geomech.cli.verb import BAD_INPUT

#: Few blocks, beds that are thick beside the cross joints' spacing.
FEW = Slope(35.0, 60.0, 0.0, 6.0, 9.0)


def test_the_slab_is_what_lies_above_the_lowest_bed_that_daylights():
    """Its area is that of the polygon between bed, face, crest and back, by hand."""
    import shapely

    problem = problem_of(tomllib.loads(FEW.text(1e-3, 0.1)))
    found = slab(FEW, problem)
    dip = math.radians(35.0)
    normal = np.array([math.sin(dip), math.cos(dip)])
    rock = shapely.Polygon([(0, 0), (60, 0), (60, 20), (42, 20), (30, 40), (0, 40)])
    own = found.blocks[problem.blocks.vertex_block]
    lowest = float((problem.blocks.vertices[own] @ normal).min())
    assert np.array([42.0, 20.0]) @ normal < lowest < np.array([30.0, 40.0]) @ normal
    along = np.array([math.cos(dip), -math.sin(dip)])
    at = lowest * normal
    far = 99 * along, 99 * normal
    above = shapely.Polygon([at - far[0], at + far[0], at + far[0] + far[1], at - far[0] + far[1]])
    expected = max(shapely.get_parts(above & rock), key=lambda part: part.bounds[3])
    assert found.whole and found.mass == pytest.approx(2600 * expected.area, rel=1e-6)
    # One spacing lower, the bed would meet the face below its toe.
    assert lowest - 6.0 < np.array([42.0, 20.0]) @ normal
    way = 0.5 * 9.81 * (math.sin(dip) - math.tan(math.radians(20)) * math.cos(dip)) * 0.1**2
    assert found.work(FEW.acceleration, 0.1) == pytest.approx(found.mass * 9.81 * math.sin(dip) * way)


def test_slopes_of_the_family_are_within_its_bounds():
    slopes = [random_slope(seed) for seed in range(40)]
    assert random_slope(7) == slopes[7] and len(set(slopes)) == 40
    assert all(25 <= each.dip <= 45 and 50 <= each.cross <= 90 and each.acceleration > 0 for each in slopes)
    assert all(1 <= each.bed_spacing <= 5 and 1 <= each.cross_spacing <= 5 for each in slopes)
    assert {bool(each.length) for each in slopes} == {True, False}


def test_a_slope_of_few_blocks_slides_as_the_rigid_slab():
    """In steps of 1 ms and 0.5 ms; stiff rock settles by a hundredth of the slide at most (`sliding_scenes.STIFF`), and
    by 0.1 s the slab has gone a ninth as far as by the 0.3 s that this is said of."""
    found = slid(FEW, (1e-3, 0.5e-3), 0.1)
    assert found.blocks < 60 and len(found.work) == 2
    assert found.moved[-1] == pytest.approx(found.slab_share, abs=1e-9)
    assert abs(found.off_slab()) < 5e-2


def test_a_slope_off_a_bound_is_wrong_in_silence():
    """No step is right to one in 1e12."""
    found = slid(FEW, (2e-3, 1e-3), 0.02, bound=1e-12)
    assert found.verdict == WRONG and any("slab" in fault for fault in found.faults)
    loose = slid(FEW, (2e-3, 1e-3), 0.02, bound=1e12)
    assert loose.verdict == RIGHT and not loose.faults
    told = table([found, loose])
    assert "1 right" in told.text and "1 wrong" in told.text
    assert {figure.name: figure.value for figure in told.figures}["share of slopes wrong"] == 0.5


@pytest.mark.slow
def test_rows_and_the_picture_are_kept(tmp_path, monkeypatch):
    """The second time nothing is run; other steps are another program."""
    asked = {"folder": tmp_path, "steps": (8e-3, 4e-3), "end": 0.04}
    first = measure_many([18, 19], workers=1, **asked)
    assert {path.name for path in tmp_path.iterdir()} == {"sliding.jsonl", "sliding.json", "sliding.png"}
    monkeypatch.setattr("geomech.bench.slopes.seed_rows.ProcessPoolExecutor", None)
    assert measure_many([18, 19], **asked).text == first.text
    with pytest.raises(TypeError):
        measure_many([18, 19], **asked | {"end": 0.05})


def test_seeds_belong_to_slopes_and_sliding(capsys):
    assert main(["bench", "motion", "--seeds", "0-3"]) == BAD_INPUT
    assert "sliding" in capsys.readouterr().err
