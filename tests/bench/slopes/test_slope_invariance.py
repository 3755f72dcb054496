"""`geomech bench slopes --invariance`: scenes drawn once and moved, and what must not change held against what does."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geomech.bench.slopes.drawn_slopes import (
    Isometry,
    can_be_moved,
    drawn,
    frictionless,
    moved,
    problem_of,
    reordered,
)
from geomech.bench.slopes.limited_runs import REPORTED, RIGHT, VERDICTS, WRONG, Ended
from geomech.bench.slopes.moved_mass import BlockDisplacements, moving_from
from geomech.bench.slopes.random_slopes import scene_text
from geomech.bench.slopes.slope_invariance import (
    BOUNDS,
    VARIANTS,
    Invariance,
    _Compared,
    _difference,
    _off_moved,
    _Run,
    invariance,
    measure_invariance,
    table,
)
from geomech.cli import main
from geomech.cli.verb import BAD_INPUT
from geomech.coupling import cycles
from geomech.model import State
from geomech.repeats import with_noise

#: One block 2 × 1 m on a plane that falls by 40° to the right, friction 10°.
SLIDES = """
title = "A block on a plane"
[geometry]
[[geometry.zones]]
name = "rock"
polygon = [[0, 0], [2, 0], [2, 1], [0, 1]]
[[geometry.zones]]
name = "base"
polygon = [[-1, -1], [6, -1], [6, 0], [-1, 0]]
[materials.rock]
youngs_modulus_pa = 50e9
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.base]
fixed = true
[joints.default]
friction_angle_deg = 10
[loads]
gravity_m_s2 = [6.3057, -7.5149]
[dda]
time_step_s = 0.004
dynamic_factor = 1.0
max_displacement_ratio = 0.05
[run]
end_time_s = 0.1
"""


def test_joints_that_are_drawn_cut_the_same_blocks_as_their_sets():
    """Seed 5 has three sets and no block so small that it joins another: the cutting has its own tests."""
    text = scene_text(5)
    scene = drawn(text)
    assert "joint_sets" not in scene["geometry"] and len(scene["geometry"]["joints"]) > 5
    problem = problem_of(scene)
    # Traces are written with all their digits; crossings are rounded to 1e-12 of the extent.
    assert np.sort(problem.blocks.areas()) == pytest.approx(np.sort(_of_text(text).blocks.areas()), rel=1e-9)


def _of_text(text):
    import tomllib

    return problem_of(tomllib.loads(text))


@pytest.mark.parametrize("by", [Isometry.mirrored(), Isometry.rotated(0.3), Isometry.shifted((1e4, -50.0))])
def test_blocks_and_loads_are_moved_alike(by):
    scene = drawn(scene_text(5))
    one, other = problem_of(scene), problem_of(moved(scene, by))
    expected = one.blocks.vertices @ by.matrix.T + by.shift
    found = other.blocks.vertices + np.array(other.origin)
    # Of coordinates up to 1e4: the grid of the cutting is 1e-12 of them.
    distance = np.abs(expected[:, None] - found[None]).max(axis=2).min(axis=1)
    assert distance.max() < 1e-7
    assert other.loads.gravity.at(0.0) == pytest.approx(by.matrix @ one.loads.gravity.at(0.0), abs=1e-12)
    assert by.back(expected) == pytest.approx(one.blocks.vertices, abs=1e-9)


@pytest.mark.parametrize("by", [Isometry.mirrored(), Isometry.rotated(0.3), Isometry.shifted((1e4, -50.0))])
def test_in_situ_stress_and_shaking_go_with_the_slope(by):
    """σ'(M x + s) = M σ(x) Mᵀ, and the same of what was moved once already."""
    scene = drawn(SLIDES)
    scene["loads"]["in_situ"] = {"surface_m": 1.0, "unit_weight_n_per_m3": 25e3, "k0": 0.7, "surcharge_pa": 1e3}
    scene["loads"]["base"] = {"acceleration_m_s2": [2.0, 0.5], "frequency_hz": 3.0}
    there = moved(scene, by)
    assert there["loads"]["base"]["acceleration_m_s2"] == pytest.approx(by.matrix @ [2.0, 0.5])
    points = np.array([[0.3, -2.0], [5.0, 0.2]])
    stresses = [problem_of(each).in_situ for each in (scene, there, moved(there, Isometry.rotated(-0.7)))]
    second = Isometry.rotated(-0.7)
    for x in points:
        expected = by.stress(stresses[0].at(x))
        y = by.matrix @ x + by.shift
        scale = 1e4 * 25e3 * 1e-12  # Pa: round-off of the shift
        origin = np.array(problem_of(there).origin)
        assert stresses[1].at(y - origin) == pytest.approx(expected, rel=1e-9, abs=scale)
        again = second.matrix @ y - np.array(problem_of(moved(there, second)).origin)
        assert stresses[2].at(again) == pytest.approx(second.stress(expected), rel=1e-9, abs=scale)


def test_a_scene_with_water_is_not_turned():
    scene = drawn(SLIDES)
    scene["loads"]["water"] = {"points": [[0.0, 0.2], [2.0, 0.4]]}
    assert can_be_moved(scene, Isometry.mirrored()) and not can_be_moved(scene, Isometry.rotated(0.1))
    assert moved(scene, Isometry.mirrored())["loads"]["water"]["points"] == [[-2.0, 0.4], [0.0, 0.2]]
    with pytest.raises(ValueError, match="water"):
        moved(scene, Isometry.rotated(0.1))
    scene["loads"]["forces"] = []
    with pytest.raises(ValueError, match="no isometry of forces"):
        moved(scene, Isometry.mirrored())


def test_order_noise_and_no_friction_change_nothing_else():
    scene, rng = drawn(scene_text(5)), np.random.default_rng(1)
    problem = problem_of(scene)
    again = problem_of(reordered(scene, rng))
    assert reordered(scene, rng)["geometry"]["joints"] != scene["geometry"]["joints"]
    assert np.sort(again.blocks.areas()) == pytest.approx(np.sort(problem.blocks.areas()), rel=1e-12)
    off = with_noise(problem, 1e-12, rng).blocks.vertices - problem.blocks.vertices
    assert 0 < np.abs(off).max() <= 1e-12 * np.ptp(problem.blocks.vertices, axis=0).max() * (1 + 1e-3)
    smooth = problem_of(frictionless(scene, 2e-3))
    assert all(law.friction_angle == 0 and law.cohesion == 0 for law in smooth.joints)
    assert smooth.dda.time_step == 2e-3 and smooth.dda.dynamic_factor == 1.0


def test_mass_and_work_of_what_moves_are_those_of_a_rigid_shift():
    """Moved by hand: 26 kN of rock go 3 mm to the right and 4 mm down."""
    problem = problem_of(drawn(SLIDES))
    state = State.at_rest(problem.blocks)
    own = ~problem.blocks.fixed[problem.blocks.vertex_block]
    state.vertices[own] += [3e-3, -4e-3]
    at = BlockDisplacements.of(problem, problem.blocks, state)
    assert at.share(4.9e-3) == 1.0 and at.share(5.1e-3) == 0.0 and at.work(5.1e-3) == 0.0
    assert at.work(1e-3) == pytest.approx(5200 * (6.3057 * 3e-3 + 7.5149 * 4e-3), rel=1e-9)
    assert moving_from(problem) == 1e-3
    short = replace(problem, run=replace(problem.run, end_time=0.01))
    assert moving_from(short) == pytest.approx(0.1 * 0.5 * math.hypot(6.3057, 7.5149) * 1e-4)


def _fallen(*depths, areas=None):
    """Blocks of a tonne per m² beside each other that fell by ``depths``, m."""
    areas = np.ones(len(depths)) if areas is None else np.array(areas)
    centres = np.column_stack([np.arange(len(depths)), np.zeros(len(depths))])
    down = np.column_stack([np.zeros(len(depths)), -np.array(depths)])
    return BlockDisplacements(1e3 * areas, areas, centres, down, np.array([0.0, -10.0]))


def test_a_block_at_the_threshold_counts_in_both_runs_or_in_none():
    """Half the rock goes 1 % less than the threshold in one run and 1 % more in the other; 10 % are a difference."""
    assert _off_moved(_fallen(1.0, 0.099), _fallen(1.0, 0.101), 0.1) == (0.0, pytest.approx(0.002 / 1.101))
    assert _off_moved(_fallen(1.0, 0.101), _fallen(1.0, 0.099), 0.1) == (0.0, 0.0)
    share, work = _off_moved(_fallen(1.0, 0.05), _fallen(1.0, 0.2), 0.1)
    assert share == 0.5 and work == pytest.approx(0.2 / 1.2)
    assert _off_moved(_fallen(1.0, 0.5), _fallen(1.0, 0.4), 0.1) == (0.0, pytest.approx(0.1 / 1.4))


@pytest.mark.parametrize("threshold", np.geomspace(0.05, 0.2, 25))
def test_what_differs_by_five_per_cent_differs_wherever_the_threshold_lies(threshold):
    """All displacements, those of half of the rock on either side of the threshold, and rock that moves in one run only."""
    bound = BOUNDS["work, dt"].bound
    finest = _fallen(0.1, 0.1, 1.0)
    for factor in (0.95, 1.05):
        assert max(_off_moved(_fallen(0.1 * factor, 0.1 * factor, factor), finest, threshold)) > bound
    share, _ = _off_moved(_fallen(0.975 * threshold, 1.0), _fallen(1.025 * threshold, 1.0), threshold)
    assert share == 0.5
    areas = [0.05, 0.95]
    still, moves = _fallen(0.0, 1.0, areas=areas), _fallen(1.0, 1.0, areas=areas)
    for off in (_off_moved(still, moves, threshold), _off_moved(moves, still, threshold)):
        assert off[0] == pytest.approx(0.05) and max(off) > bound
    # Blocks that are not the same are not compared.
    one, cut = _fallen(0.99 * threshold), _fallen(1.01 * threshold, 0.99 * threshold, areas=[0.5, 0.5])
    assert _off_moved(one, cut, threshold)[0] == 0.5


def test_a_block_that_slides_is_the_same_in_all_variants():
    """A single block on a plane: friction acts on all of its face, or on none."""
    found = invariance(0, text=SLIDES)
    assert found.verdict == RIGHT, found
    assert set(found.scatter) == set(BOUNDS) and found.moved == (1.0, 1.0, 1.0)
    # Rigid block: weight along the plane, and friction on what is across it.
    way = 0.5 * (6.3057 - math.tan(math.radians(10)) * 7.5149) * 0.1**2
    # Elastic shortening under sudden weight is some 1e-6 m of 25 mm.
    assert found.work[-1] == pytest.approx(5200 * 6.3057 * way, rel=1e-3)


def test_a_mechanism_is_the_same_if_the_same_blocks_move():
    """In statics: how far the block has gone where the run ends depends on the step."""
    static = SLIDES.replace("dynamic_factor = 1.0", "dynamic_factor = 0").replace(
        "end_time_s = 0.1", "end_time_s = 0.5"
    )
    found = invariance(0, text=static.replace("time_step_s = 0.004", "time_step_s = 0.05"))
    assert found.verdict == RIGHT and found.moved == (1.0, 1.0, 1.0), found
    assert found.work[0] > 2 * found.work[-1] and "work, dt" not in found.scatter

    tells = Ended(
        warnings=("cycle 6, t = 1 s: nothing holds rock: 3 % of the forces on a block are left over, step after step",)
    )
    one, other = (_Run(tells, _fallen(*depths), np.zeros(4)) for depths in ((1.0, 0.0), (0.3, 0.0)))
    assert _difference(one, other, Isometry(), 0.1) == 0.0
    assert _difference(one, replace(other, at=_fallen(1.0, 0.5)), Isometry(), 0.1) == 0.5
    assert _difference(one, replace(other, ended=Ended()), Isometry(), 0.1) == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("line", "fallen"),
    [
        ("t = 0 s: no equilibrium: blocks have moved 1.8 m, and 25 steps brought no more balance; the run ends", True),
        ("t = 0 s: no equilibrium where the blocks are: they come to rest 0.3 m farther; the run ends", False),
    ],
)
def test_a_run_that_ends_without_equilibrium_to_begin_from_is_a_mechanism(line, fallen):
    assert _Run(Ended(warnings=(line,))).has_no_equilibrium is fallen


@pytest.mark.parametrize(("times", "reported"), [((0.0, 0.1, 0.3), False), ((0.0, 0.2, 0.3), True), ((0.0, 0.3), True)])
def test_a_warning_about_steps_counts_where_variants_were_cut_to_other_steps(times, reported):
    """Not where they took the same ones."""
    compared = _Compared(0, None, 1.0)
    tells = Ended(warnings=("t = 0.3 s: bonds broke within steps over which their forces would have done 0.03 of all",))
    compared._take("noise, friction", 0.1, "", _Run(tells, times=(0.0, 0.1, 0.3)), _Run(tells, times=times))
    assert (len(compared.reported), len(compared.faults)) == ((1, 0) if reported else (0, 1))


def test_what_changes_in_silence_is_wrong_and_with_a_warning_reported(monkeypatch):
    """With gravity that grows with the step."""
    import logging

    from geomech.coupling import cycles
    from geomech.model import History

    def coarse(problem):
        dt = problem.dda.time_step
        heavier = History.constant(problem.loads.gravity.at(0.0) * (1 + 20 * dt))
        yield from cycles(replace(problem, loads=replace(problem.loads, gravity=heavier)))

    monkeypatch.setattr("geomech.coupling.cycles", coarse)
    found = invariance(0, text=SLIDES)
    assert found.verdict == WRONG and any("work, dt" in fault for fault in found.faults)
    # dt = 4 ms against dt/4, under a constant acceleration, for which the scheme is exact: 1 + 20 dt over 1 + 5 dt.
    assert found.scatter["work, dt"] == pytest.approx(1.08 / 1.02 - 1, rel=1e-2)

    def warns(problem):
        logging.getLogger("geomech.coupling").warning("t = 0 s: nothing holds rock")
        yield from coarse(problem)

    monkeypatch.setattr("geomech.coupling.cycles", warns)
    found = invariance(0, text=SLIDES)
    assert found.verdict == REPORTED and not found.faults and found.reported


def test_the_table_counts_what_is_beyond_a_bound():
    rows = [
        Invariance(k, verdict, 3, 1e-3, (0.5,) * 3, (1.0,) * 3, {"work, dt": 0.01 * 3**k})
        for k, verdict in enumerate(VERDICTS)
    ]
    found = table(rows)
    assert "1 right  1 reported" in found.text and all(name in found.text for name in (*BOUNDS, *VARIANTS))
    line = next(line for line in found.text.splitlines() if line.startswith("  work, dt"))
    assert "3/5" in line
    assert found.figures[0].value == pytest.approx(0.2)


@pytest.mark.slow
def test_rows_and_pictures_of_seeds_are_kept(tmp_path, monkeypatch):
    first = measure_invariance([3, 5], seconds=20.0, folder=tmp_path, workers=1)
    assert {path.name for path in tmp_path.iterdir()} == {"invariance.jsonl", "invariance.json", "invariance.png"}
    monkeypatch.setattr("geomech.bench.slopes.seed_rows.ProcessPoolExecutor", None)
    assert measure_invariance([3, 5], seconds=20.0, folder=tmp_path).text == first.text


@pytest.mark.parametrize("asked", [["dda", "--invariance"], ["slopes", "--invariance"]])
def test_invariance_belongs_to_seeds_of_slopes(asked, capsys):
    assert main(["bench", *asked]) == BAD_INPUT
    assert "--invariance" in capsys.readouterr().err


def test_rounding_does_not_decide_which_joints_slide_under_the_in_situ_stress():
    """Slope 9, whose stress finds nothing at the face: contact forces under noise were 14 % of the largest off."""
    problem = problem_of(drawn(scene_text(9)))
    other = with_noise(problem, 1e-12, np.random.default_rng(9))
    rows = [next(iter(cycles(each))).state.contacts for each in (problem, other)]
    # Corners that touch nothing may meet this edge or that.
    one, two = ({(row["vertex"], row["edge"]): row for row in each if row["normal_force"] != 0} for each in rows)
    assert one.keys() == two.keys() and len(one) > 50
    largest = max(row["normal_force"] for row in one.values())
    for at, row in one.items():
        for force in ("normal_force", "shear_force"):
            assert abs(row[force] - two[at][force]) < 1e-4 * largest


def test_noise_of_corners_does_not_press_on_faces_as_drawn():
    """Slope 14: springs made forces of the gaps of 1e-11 m that noise leaves, 5e-5 of the largest."""
    problem = problem_of(frictionless(drawn(scene_text(14)), 3e-3))
    problem = replace(problem, run=replace(problem.run, end_time=3e-3))
    found = []
    for each in (problem, with_noise(problem, 1e-12, np.random.default_rng(14))):
        *_, last = cycles(each)
        found.append({(row["vertex"], row["edge"]): row["normal_force"] for row in last.state.contacts})
    one, two = found
    largest = max(one.values())
    assert max(abs(force - two.get(at, 0.0)) for at, force in one.items()) < 1e-8 * largest


@pytest.mark.slow
@pytest.mark.parametrize("by", [Isometry.mirrored(), Isometry.rotated(math.radians(10))])
@pytest.mark.parametrize("seed", [37, 56])
def test_parts_of_cut_blocks_start_alike_in_any_frame(seed, by):
    """Slopes in whose first steps without friction several blocks are cut. Parts inherited round-off where single corners had
    pressed, which closed faces that were apart in one of both frames (37: 0.4 %); a face cut at a vertex left its whole force
    on a corner that no longer faces it, or not, depending on the sense of its edge (56: 0.7 %); and rotated, ends of joints
    on outlines bent the joints at crossings, which became corners of blocks beside them (37)."""
    scene, found = frictionless(drawn(scene_text(seed)), 3e-3), []
    for each, back in ((scene, Isometry()), (moved(scene, by), by)):
        problem = problem_of(each)
        *_, last = cycles(replace(problem, run=replace(problem.run, end_time=9e-3)))
        at = BlockDisplacements.of(problem, last.blocks, last.state)
        found.append((back.back(at.centre), at.displacement @ back.matrix))
    (centre, way), (other_centre, other_way) = found
    distance = np.hypot(*(centre[:, None] - other_centre).T).T
    nearest = distance.argmin(axis=1)
    assert len(centre) == len(other_centre) == 17 and distance.min(axis=1).max() < 1e-6
    assert np.abs(other_way[nearest] - way).max() < 1e-6 * np.abs(way).max()
