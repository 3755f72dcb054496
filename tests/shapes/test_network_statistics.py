"""Joint sets against what statistics of fractures knows of them: directions, traces of discs, scan-lines, persistence,
nodes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from scipy.stats import kstest

from geomech.reference.blocks.joint_networks import (
    cells_of_poisson_lines,
    fisher_mean_resultant,
    scan_line_spacing,
    trace_length_moments,
    trace_length_of_discs,
)
from geomech.shapes import Joint, Zone, cut
from geomech.shapes.joint_networks import expected_statistics as expected
from geomech.shapes.joint_networks.fracture_statistics import (
    Topology,
    block_sizes,
    line_statistics,
    passing_curve,
    set_statistics,
)
from geomech.shapes.joint_networks.joint_sets import (
    FisherAngle,
    Law,
    Poles,
    discs,
    mean_pole,
    parallel_set,
    poisson_lines,
    poisson_traces,
    poles_about,
)

REGION = np.array([[0, 0], [200, 0], [200, 120], [0, 120]], dtype=float)
#: A true law is turned down once in a thousand: seeds are fixed, so this is decided once.
SIGNIFICANT = 1e-3


@pytest.mark.parametrize("concentration", [0.5, 5.0, 50.0, 500.0])
def test_poles_have_fishers_mean_resultant(concentration):
    rng = np.random.default_rng(11)
    n = 30_000
    mean = mean_pole(math.radians(50), 0.4, 0.0)
    poles = poles_about(mean, concentration, rng.random(n), rng.uniform(0, 2 * math.pi, n))
    assert np.linalg.norm(poles, axis=1) == pytest.approx(np.ones(n), abs=1e-12)
    resultant = poles.mean(axis=0)
    along = poles @ mean
    # Four standard errors of the mean of the cosine.
    assert resultant @ mean == pytest.approx(fisher_mean_resultant(concentration), abs=4 * along.std() / math.sqrt(n))
    # The cosine about the mean has the law itself: (e^(κ c) − e^−κ) / (e^κ − e^−κ).
    k = concentration
    law = kstest(along, lambda c: (np.exp(k * (c - 1)) - math.exp(-2 * k)) / -math.expm1(-2 * k))
    assert law.pvalue > SIGNIFICANT
    assert np.linalg.norm(resultant - (resultant @ mean) * mean) < 4 * math.sqrt(1 / n)


def test_traces_of_planes_spread_by_fishers_law():
    """Poles in the section: angles by von Mises' law, for large κ normal with 1/√κ; aside, as much as the tilt turns
    them."""
    rng = np.random.default_rng(12)
    beside = FisherAngle(math.radians(60), 0.3, 0.3, 400.0)
    angles = beside.sample(rng, 20_000)
    assert beside.mean == pytest.approx(-math.radians(60)) and beside.spread == pytest.approx(1 / 20, rel=0.01)
    assert angles.mean() == pytest.approx(beside.mean, abs=4 * 0.05 / math.sqrt(20_000))
    assert kstest((angles - beside.mean) * 20, "norm").pvalue > SIGNIFICANT
    assert beside.mean_cosine == pytest.approx(math.exp(-0.5 / 400), rel=1e-4)
    # Seen along the dip direction turned by 60°, a pole nearer to the section's normal turns its trace more.
    aside = FisherAngle(math.radians(60), 0.3, 0.3 + math.radians(60), 400.0)
    flat = np.hypot(*mean_pole(aside.dip, aside.dip_direction, aside.section)[:2])
    assert aside.spread == pytest.approx(1 / 20 / flat, rel=0.02) and aside.sample(rng, 20_000).std() == pytest.approx(
        aside.spread, rel=4 / math.sqrt(40_000)
    )


def whole_traces(joint: Joint, margin: float) -> np.ndarray:
    """Lengths of the traces with their middles at least ``margin`` inside the region: none of them is cut off."""
    ends = np.array(joint.lines)
    middle = ends.mean(axis=1)
    inside = ((middle > REGION.min(axis=0) + margin) & (middle < REGION.max(axis=0) - margin)).all(axis=1)
    return np.hypot(*(ends[inside, 1] - ends[inside, 0]).T)


def test_traces_of_discs_are_as_long_as_warburton_says():
    poles = Poles(dip=math.radians(70), dip_direction=0.5, fisher=20.0, section=0.0)
    one = discs("joint:a", REGION, poles, Law(4.0), 0.5, np.random.default_rng(1))
    length = whole_traces(one, 2.0)
    assert len(length) > 2000
    assert kstest(length, lambda x: trace_length_of_discs(x, 4.0)).pvalue > SIGNIFICANT
    # Diameters that differ are cut in proportion to themselves.
    diameter = Law(4.0, 1.5, "lognormal")
    many = discs("joint:a", REGION, poles, diameter, 0.5, np.random.default_rng(2))
    mean, square = trace_length_moments(diameter.moments)
    length = whole_traces(many, 10.0)
    error = 4 * length.std() / math.sqrt(len(length))
    assert length.mean() == pytest.approx(mean, abs=error)
    assert (length**2).mean() == pytest.approx(square, rel=0.12)  # four standard errors of its wide tail
    # The window cuts some off; Mauldon's estimate of the mean does not feel it.
    found, wanted = set_statistics(many, REGION), expected.of_discs(poles, diameter, 0.5)
    assert found.mean_length == pytest.approx(mean, abs=error)
    for key, value in (("p21_per_m", found.p21), ("p20_per_m2", found.p20), ("p10_per_m", found.p10)):
        assert value == pytest.approx(wanted[key], rel=4 * 1.2 / math.sqrt(found.traces))
    assert math.degrees(found.angle_deviation) == pytest.approx(wanted["angle_deviation_deg"], rel=0.06)
    off = math.degrees(found.mean_angle) - wanted["mean_angle_deg"]
    assert off - 180 * round(off / 180) == pytest.approx(0, abs=1.0)


def test_intensity_on_the_section_is_that_in_space_times_the_sine():
    """P21 = P32 E[sin θ] (Dershowitz & Herda 1992): poles of all directions alike give π/4."""
    wanted = expected.of_discs(Poles(dip=0.3, dip_direction=0.2, fisher=1e-6, section=0.0), Law(3.0), 1.0)
    assert wanted["p21_per_m"] == pytest.approx(math.pi / 4, rel=1e-4)
    for turn in (0.0, 0.7, 1.2):
        upright = Poles(math.pi / 2, turn, 0.0, 0.0)
        assert expected.of_discs(upright, Law(3.0), 2.0)["p21_per_m"] == pytest.approx(2 * math.cos(turn), rel=1e-12)


def test_scan_lines_over_poisson_lines_have_exponential_spacings():
    per_area = 1.5
    spacings = []
    for seed in range(40):
        # One scan-line a network: neighbouring ones meet the same joints.
        joint = poisson_lines("joint:a", REGION, None, per_area, np.random.default_rng(seed))
        ends = np.array([line[[0, -1]] for line in joint.lines])
        a, b = ends[:, 0], ends[:, 1]
        over = (a[:, 1] - 60) * (b[:, 1] - 60) < 0
        t = ((60 - a[:, 1]) / np.where(over, b[:, 1] - a[:, 1], 1))[over]
        spacings.append(np.diff(np.sort(a[over, 0] + t * (b[over, 0] - a[over, 0]))))
    spacings = np.concatenate(spacings)
    assert len(spacings) > 5000
    wanted = expected.of_poisson_lines(None, per_area)
    assert wanted["p10_per_m"] == pytest.approx(2 / math.pi * per_area)
    assert kstest(spacings, lambda x: scan_line_spacing(x, wanted["p10_per_m"])).pvalue > SIGNIFICANT


def test_cells_between_poisson_lines_have_four_sides():
    known = cells_of_poisson_lines(0.6)
    areas, sides, rims = [], [], []
    low, high = REGION.min(axis=0) + 30, REGION.max(axis=0) - 30
    for seed in range(3):
        joint = poisson_lines("joint:a", REGION, None, 0.6, np.random.default_rng(seed))
        blocks = cut([Zone("rock", (REGION,))], [joint]).blocks
        # By their lowest corners, which fall anywhere as the lines do: no cell is favoured for its size.
        first = blocks.vertices[blocks.vertex_start[:-1]]
        own = ((first > low) & (first < high)).all(axis=1)
        areas.append(blocks.areas()[own])
        sides.append(np.diff(blocks.vertex_start)[own])
        rims.append(np.array([shapely.Polygon(blocks.loops(b)[0]).length for b in np.flatnonzero(own)]))
    areas, sides, rims = map(np.concatenate, (areas, sides, rims))
    # Some 1200 cells of a few hundred lines: three per cent is one standard error of the intensity, twice that of
    # areas.
    assert sides.mean() == pytest.approx(known["sides"], rel=0.02)
    assert rims.mean() == pytest.approx(known["perimeter"], rel=0.12)
    assert areas.mean() == pytest.approx(known["area"], rel=0.24)


@pytest.mark.first_by_default(3)
@pytest.mark.parametrize("law", ["constant", "normal", "uniform", "lognormal", "exponential"])
def test_lines_of_a_parallel_set_have_the_spacing_and_persistence_asked_for(law):
    region = np.array([[0, 0], [400, 0], [400, 300], [0, 300]], dtype=float)
    angle, spacing = Law(math.radians(25), math.radians(1), "normal"), Law(2.0, 0.5, law)
    length, gap = Law(9.0, 2.0, "normal"), Law(3.0, 1.0, "uniform")
    joint = parallel_set("joint:a", region, angle, spacing, length, gap, np.random.default_rng(3))
    found, wanted = line_statistics(joint, region), expected.of_parallel(angle, spacing, length, gap)
    n = found.lines
    assert found.persistence == pytest.approx(wanted["persistence"], abs=4 * 0.2 / math.sqrt(len(joint.lines)))
    # Lengths below a hundredth of the mean are drawn again, which makes an exponential law longer by as much.
    longer = 1.01 if law == "exponential" else 1.0
    # Spacings are taken at right angles to the mean direction found, which is off by some hundredths of a degree.
    assert found.mean_spacing == pytest.approx(
        longer * wanted["spacing_m"], abs=4 * wanted["spacing_deviation_m"] / math.sqrt(n) + 0.002
    )
    assert found.spacing_deviation == pytest.approx(wanted["spacing_deviation_m"], rel=0.3, abs=0.01)
    whole = set_statistics(joint, region)
    assert whole.mean_length == pytest.approx(9.0, abs=4 * 2.0 / math.sqrt(whole.traces) + 0.02)
    assert math.degrees(whole.angle_deviation) == pytest.approx(1.0, rel=0.25)


def test_long_scan_lines_tell_p21_and_persistence():
    """Across parallel traces P10 is P21; a line along a trace is joint for the part that persistence says."""
    region = np.array([[0, 0], [1500, 0], [1500, 40], [0, 40]], dtype=float)
    length, gap = Law(6.0, 1.0, "normal"), Law(2.0, 0.5, "normal")
    joint = parallel_set("joint:a", region, Law(0.0), Law(2.0), length, gap, np.random.default_rng(4))
    found = set_statistics(joint, region, scan_lines=1500)
    assert found.p10 == pytest.approx(found.p21, rel=3e-3)
    # Twenty lines of 1500 m with 190 traces each: the part of joint is known to 0.2 / √3800.
    assert found.p21 == pytest.approx(0.75 / 2.0, rel=0.02)
    assert line_statistics(joint, region).persistence == pytest.approx(0.75, abs=4 * 0.2 / math.sqrt(3800))


def test_p20_and_length_are_not_biased_by_the_window():
    """Traces as long as a third of the window: seen lengths are short, Mauldon's estimate is not."""
    small = np.array([[0, 0], [15, 0], [15, 15], [0, 15]], dtype=float)
    found = [
        set_statistics(
            poisson_traces("joint:a", small, Law(0.4, 0.3, "normal"), Law(5.0), 0.3, np.random.default_rng(seed)), small
        )
        for seed in range(15)
    ]
    # 1 000 traces; a fifth of a trace's length is cut off on average.
    assert np.mean([f.p20 for f in found]) == pytest.approx(0.3, rel=4 / math.sqrt(1000))
    assert np.mean([f.p21 for f in found]) == pytest.approx(1.5, rel=4 / math.sqrt(1000))
    assert np.mean([f.mean_length for f in found]) == pytest.approx(5.0, rel=0.07)


def test_nodes_of_known_networks():
    """Sanderson & Nixon (2015): lone traces have no connections, a grid has two a branch."""
    apart = Topology.of({"I": 8, "Y": 0, "X": 0})
    assert (apart.branches, apart.lines, apart.per_branch, apart.per_line) == (4, 4, 0, 0)
    cross = Topology.of({"I": 4, "Y": 0, "X": 1})
    assert (cross.branches, cross.lines, cross.per_branch, cross.per_line) == (4, 2, 1.0, 1.0)
    grid = Topology.of({"I": 0, "Y": 0, "X": 9})
    assert grid.per_branch == 2.0 and math.isnan(grid.per_line)
    square = np.array([[0, 0], [10, 0], [10, 10], [0, 10]], dtype=float)
    traces = ([[2, 5], [8, 5]], [[4, 5], [4, 8]], [[6, 3], [6, 7]])
    cutting = cut([Zone("rock", (square,))], [Joint("joint:a", tuple(np.array(t, float) for t in traces))])
    assert cutting.nodes == {"I": 5, "Y": 1, "X": 1}
    assert Topology.of(cutting.nodes).branches == 6 and Topology.of(cutting.nodes).lines == 3


def test_the_block_size_curve_ends_with_all_the_rock():
    areas = np.array([1.0] * 4 + [4.0, 9.0])
    curve = passing_curve(areas)
    assert curve[-1].tolist() == [3.0, 100.0] and (np.diff(curve, axis=0) >= 0).all()
    assert curve[3, 1] == pytest.approx(400 / 17) and block_sizes(areas, (0.5,))[0.5] == 3.0
    assert len(passing_curve(np.arange(1.0, 5000.0))) == 200


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(
    ("spacing", "deviation"), [("lognormal", 12.0), ("exponential", 0.0), ("normal", 2.0), ("uniform", 3.0)]
)
def test_a_parallel_set_is_as_dense_at_its_edge_as_elsewhere(spacing, deviation):
    """Mean number of lines in strips of 30 m of a column, the first one at its foot: strip over mean spacing, whatever
    the law; four standard errors of 800 networks."""
    law = Law(6.0, deviation, spacing)
    region = np.array([[0, 0], [4, 0], [4, 90], [0, 90]], dtype=float)
    count = np.zeros((800, 3))
    for seed in range(len(count)):
        joint = parallel_set("joint:a", region, Law(0.0), law, None, None, np.random.default_rng(seed))
        count[seed] = np.histogram([line[0, 1] for line in joint.lines], bins=[0, 30, 60, 90])[0]
    error = 4 * count.std(axis=0) / math.sqrt(len(count))
    assert (np.abs(count.mean(axis=0) - 5.0) < error).all()


@pytest.mark.parametrize(("law", "deviation"), [("lognormal", 8.0), ("exponential", 0.0), ("normal", 1.5)])
def test_traces_and_gaps_are_as_persistent_at_the_edge_as_elsewhere(law, deviation):
    """The joint part of the first 2 m of each line, where the set begins, against length / (length + gap)."""
    from geomech.shapes.joint_networks.joint_sets import _intervals

    length, gap, rng = Law(4.0, deviation, law), Law(2.0, 0.5 * deviation, law), np.random.default_rng(3)
    share = []
    for _ in range(4000):
        pieces = _intervals(length, gap, 40.0, rng)
        share.append(sum(max(0.0, min(b, 2.0) - max(a, 0.0)) for a, b in pieces) / 2.0)
    assert np.mean(share) == pytest.approx(4 / 6, abs=4 * np.std(share) / math.sqrt(len(share)))


def test_spacings_beside_holes_are_those_of_the_lines():
    """A set 4 m apart past two holes, one of which takes the middle of three lines: 5.09 m, were those lines not
    counted."""
    region = shapely.Polygon([(0, 0), (60, 0), (60, 40), (0, 40)], [
        [(25, 14), (36, 14), (36, 26), (25, 26)], [(5, 5), (10, 5), (10, 8), (5, 8)]])  # fmt: skip
    for seed in range(20):
        box = np.array([[0, 0], [60, 0], [60, 40], [0, 40]], dtype=float)
        joint = parallel_set("joint:a", box, Law(0.3 * seed), Law(4.0), None, None, np.random.default_rng(seed))
        found = line_statistics(joint, region)
        assert found.mean_spacing == pytest.approx(4.0, rel=1e-9)
        assert found.spacing_deviation == pytest.approx(0.0, abs=1e-9)


def test_planes_beside_the_section_are_seldom_cut():
    """Fisher poles about one 20° off the section's normal: angles of traces as a great many discs of the same poles
    show them, which are cut by geometry alone."""
    dip, direction, section, kappa = math.radians(90), math.radians(70), 0.0, 8.0
    rng = np.random.default_rng(5)
    law = FisherAngle(dip, direction, section, kappa)
    cut_discs = discs("joint:a", REGION, Poles(dip, direction, kappa, section), Law(4.0), 1.5, rng)
    ends = np.array([line[[0, -1]] for line in cut_discs.lines])
    off = np.arctan2(*(ends[:, 1] - ends[:, 0]).T[::-1]) - law.mean
    off = 0.5 * np.angle(np.exp(2j * off))
    sampled = law.sample(rng, 20_000) - law.mean
    assert len(off) > 3000
    for quantity in (np.abs, np.cos):
        error = 4 * quantity(off).std() / math.sqrt(len(off))
        assert quantity(sampled).mean() == pytest.approx(quantity(off).mean(), abs=error)
    assert law.spread == pytest.approx(sampled.std(), rel=0.02)
    assert law.mean_cosine == pytest.approx(np.cos(sampled).mean(), abs=0.01)
