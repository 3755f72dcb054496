"""Generated joint sets have the statistics that were asked for, within sampling error."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geomech.shapes import Joint, Zone, cut
from geomech.shapes.joint_networks.fracture_statistics import block_sizes, set_statistics
from geomech.shapes.joint_networks.joint_sets import (
    Law,
    Poles,
    apparent_dip,
    discs,
    parallel_set,
    poisson_lines,
    poisson_traces,
    terminated,
    voronoi,
)

REGION = np.array([[0, 0], [100, 0], [100, 60], [0, 60]], dtype=float)


@pytest.mark.parametrize("law", ["constant", "normal", "uniform", "lognormal", "exponential"])
def test_laws_have_their_mean_and_deviation(law):
    values = Law(3.0, 0.6, law).sample(np.random.default_rng(1), 200_000)
    deviation = {"constant": 0.0, "exponential": 3.0}.get(law, 0.6)
    # Four standard errors of the mean, and of the deviation of an exponential law, the widest.
    assert values.mean() == pytest.approx(3.0, abs=4 * max(deviation, 1e-12) / math.sqrt(200_000) + 1e-12)
    assert values.std() == pytest.approx(deviation, abs=0.03 if law == "exponential" else 0.006)


def test_a_parallel_set_has_its_spacing_persistence_and_angle():
    rng = np.random.default_rng(2)
    angle, spacing, length, gap = Law(math.radians(35)), Law(1.0, 0.3, "lognormal"), Law(4.0, 1.0, "normal"), Law(1.0)
    joint = parallel_set("joint:a", REGION, angle, spacing, length, gap, rng)
    found = set_statistics(joint, REGION)
    assert found.mean_angle == pytest.approx(math.radians(35), abs=1e-9)
    # 1 / spacing lines per metre across, four fifths of each of them joint; some 90 lines: 3 % each way, four times.
    assert found.p21 == pytest.approx(0.8, rel=0.12)
    assert found.p10 == pytest.approx(found.p21, rel=0.02)  # across parallel traces the two are one
    whole = set_statistics(
        parallel_set("joint:a", REGION, angle, spacing, None, None, np.random.default_rng(2)), REGION
    )
    assert found.p21 / whole.p21 == pytest.approx(0.8, rel=0.03)


def test_poisson_traces_have_their_number_and_length():
    joint = poisson_traces("joint:a", REGION, Law(0.5, 0.1, "normal"), Law(3.0), 0.2, np.random.default_rng(3))
    found = set_statistics(joint, REGION)
    assert found.p21 == pytest.approx(0.6, rel=4 / math.sqrt(1200))
    assert found.angle_deviation == pytest.approx(0.1, rel=0.1) and found.mean_angle == pytest.approx(0.5, abs=0.02)


def test_poisson_lines_of_all_directions():
    """Blocks between isotropic Poisson lines have the mean area π / P21² (Miles 1964)."""
    joints = [poisson_lines("joint:a", REGION, None, 0.8, np.random.default_rng(seed)) for seed in range(20)]
    # Some 1900 lines in all: 2.3 % is one standard error.
    assert np.mean([set_statistics(joint, REGION).p21 for joint in joints]) == pytest.approx(0.8, rel=0.09)
    middle = np.array([[20, 10], [80, 10], [80, 50], [20, 50]], dtype=float)
    areas, p21 = [], []
    for joint in joints[:6]:
        # Blocks cut off at the edge are left out; larger ones meet it more often, so the rock is twice as large as the
        # part.
        blocks = cut([Zone("rock", (REGION,))], [joint]).blocks
        centre = blocks.mean_vertices(blocks.vertices)
        areas.append(blocks.areas()[((centre > middle.min(axis=0)) & (centre < middle.max(axis=0))).all(axis=1)])
        p21.append(set_statistics(joint, middle).p21)
    assert np.concatenate(areas).mean() == pytest.approx(math.pi / np.mean(np.square(p21)), rel=0.12)


def test_discs_cut_by_the_section():
    """P21 = P32 E[sin θ], θ between the poles and the section's normal: 1 for poles in the section, cos 60° here."""
    diameter, p32 = Law(5.0, 1.0, "lognormal"), 0.4
    for direction, factor in ((0.0, 1.0), (math.radians(60), 0.5)):
        poles = Poles(math.radians(90), direction, 0.0, 0.0)
        joint = discs("joint:a", REGION, poles, diameter, p32, np.random.default_rng(5))
        found = set_statistics(joint, REGION)
        assert found.p21 == pytest.approx(0.4 * factor, rel=4 * 1.1 / math.sqrt(found.traces))
        assert abs(found.mean_angle) == pytest.approx(math.pi / 2, abs=1e-9)
    poles = Poles(math.radians(90), 0.0, 100, 0.0)
    spread = discs("joint:a", REGION, poles, diameter, p32, np.random.default_rng(5))
    # Fisher's constant K spreads poles by 81°/√K (Priest 1993, 3.6): in the section by 1/√K rad.
    assert set_statistics(spread, REGION).angle_deviation == pytest.approx(0.1, rel=0.15)


def test_apparent_dip():
    assert apparent_dip(math.radians(40), 0.0, 0.0) == pytest.approx(-math.radians(40))
    assert apparent_dip(math.radians(40), math.pi, 0.0) == pytest.approx(math.radians(40))
    assert apparent_dip(math.radians(40), math.pi / 2, 0.0) == pytest.approx(0, abs=1e-15)
    assert apparent_dip(math.pi / 2, 0.3, 0.0) == math.pi / 2


def test_voronoi_cells_have_their_mean_area():
    joint = voronoi("joint:grains", REGION, 9.0, np.random.default_rng(6))
    cutting = cut([Zone("rock", (REGION,))], [joint])
    whole = cutting.blocks.areas()
    assert len(whole) == pytest.approx(6000 / 9, rel=0.15)
    # Three edges meet at each corner inside: P21 = 2/√(cell area) for Poisson points (Miles 1970).
    assert set_statistics(joint, REGION).p21 == pytest.approx(2 / 3.0, rel=0.06)
    assert cutting.cracks.n_cracks == 0


def test_terminations():
    rng = np.random.default_rng(7)
    beds = parallel_set("joint:beds", REGION, Law(0.0), Law(2.0), None, None, rng)
    cross = poisson_traces("joint:cross", REGION, Law(math.pi / 2), Law(3.0), 0.1, rng)
    ended = terminated(cross, [beds], 1.0, rng)
    before, after = (sum(np.hypot(*(line[1] - line[0])) for line in j.lines) for j in (cross, ended))
    assert after < 0.75 * before
    levels = np.array([line[0, 1] for line in beds.lines])
    for line in ended.lines:
        low, high = np.sort(line[:, 1])
        assert not ((levels > low + 1e-9) & (levels < high - 1e-9)).any()
    assert all(np.array_equal(a, b) for a, b in zip(terminated(cross, [beds], 0.0, rng).lines, cross.lines))


def test_the_same_seed_gives_the_same_joints():
    make = [
        parallel_set("joint:a", REGION, Law(0.3), Law(5.0, 1.0, "normal"), Law(9.0), Law(2.0), np.random.default_rng(8))
        for _ in "12"
    ]
    assert all(np.array_equal(a, b) for a, b in zip(make[0].lines, make[1].lines, strict=True))


def test_block_sizes_by_area():
    assert block_sizes(np.array([1.0] * 4 + [4.0]), (0.25, 0.5, 0.75)) == {0.25: 1.0, 0.5: 1.0, 0.75: 2.0}


def test_bad_laws_are_named():
    with pytest.raises(ValueError, match="no law 'cauchy'"):
        Law(1.0, 1.0, "cauchy")
    with pytest.raises(ValueError, match="hardly ever positive"):
        Law(-1.0, 0.1, "normal").lengths(np.random.default_rng(0), 3)
    assert Joint("joint:a", ()).lines == ()
