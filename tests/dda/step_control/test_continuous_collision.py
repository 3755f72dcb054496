"""Nothing goes into or through a block: paths of vertices against edges, and walls thinner than what a step moves."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from geomech import dda
from geomech.bench.robustness import thin_scenes
from geomech.dda.contact_detection.entrance_edges import Outlines
from geomech.dda.contact_detection.neighbour_search import boxes
from geomech.dda.contact_detection.thin_walls import from_outside
from geomech.dda.step_control.continuous_collision import INTO, THROUGH, Allowed, Paths, crossings
from geomech.dda.step_control.overlap_energy import Overlap, OverlapWatch
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material

WALL = np.array([[0.0, 0.0], [0.01, 0.0], [0.01, 1.0], [0.0, 1.0]])
SQUARE = np.array([[-0.3, 0.4], [-0.1, 0.4], [-0.1, 0.6], [-0.3, 0.6]])


def found(moved, pressed=0.0, corner=(-0.3, 0.4)):
    """Crossings of a square, its lower left ``corner`` here, that moves by ``moved`` beside a wall 1 cm thick."""
    blocks = Blocks.from_polygons([WALL, SQUARE - SQUARE[0] + corner])
    before = np.ascontiguousarray(blocks.vertices)
    after = before.copy()
    after[4:] += moved
    start = np.ascontiguousarray(blocks.vertex_start, np.int64)
    one, two = boxes(before, start[:-1]), boxes(after, start[:-1])
    box = np.concatenate([np.minimum(one[:, :2], two[:, :2]), np.maximum(one[:, 2:], two[:, 2:])], axis=1)
    paths = Paths(before, after, np.ascontiguousarray(blocks.next_vertex, np.int64), start)
    return crossings(paths, np.array([[0, 1]]), box, Allowed(np.full(8, pressed), np.sqrt(blocks.areas()), np.zeros(8)))


def test_what_ends_in_a_wall_or_beyond_it_is_found_by_the_face_it_came_in_by():
    assert not len(found((0.099, 0.0))[0])
    _, vertex, edge, kind, depth = found((0.104, 0.0))
    assert vertex.tolist() == [5, 6] and edge.tolist() == [3, 3] and (kind == INTO).all()
    assert depth == pytest.approx(0.004, rel=1e-9)
    _, vertex, edge, kind, _ = found((0.5, 0.0))
    assert {5, 6} <= set(vertex.tolist()) and (kind == THROUGH).all() and (edge == 3).all()
    # What contacts are pressed in by is no crossing, twice that at most.
    assert not len(found((0.104, 0.0), pressed=0.003)[0])
    assert len(found((0.104, 0.0), pressed=0.001)[0])


def test_what_passes_above_a_wall_or_cuts_its_corner_by_little_crosses_nothing():
    assert not len(found((0.5, 0.0), corner=(-0.3, 1.001))[0])
    # A corner goes round the wall's, and the straight path cuts that by a tenth of a millimetre; then by 5.
    assert not len(found((3e-4, -3.1e-4), corner=(0.0099, 1.00001))[0])
    assert (found((5.3e-3, -1.1e-3), corner=(0.005, 1.0001))[3] == THROUGH).all()
    assert len(found((5.3e-3, -1.1e-3), corner=(0.005, 1.0001))[3])


def test_a_vertex_meets_no_face_from_behind_a_wall():
    """The far face of a wall 1 cm thick, from 2 mm outside the near one and from 2 mm within it; the near one from there;
    and the far one where it has been pressed on before."""
    blocks = Blocks.from_polygons([WALL, SQUARE])
    start = np.ascontiguousarray(blocks.vertex_start, np.int64)
    next_vertex, previous = (np.ascontiguousarray(a, np.int64) for a in (blocks.next_vertex, blocks.previous_vertex))
    owner = np.ascontiguousarray(blocks.vertex_block, np.int64)

    def kept(x, edge, known=False):
        vertices = np.ascontiguousarray(blocks.vertices.copy())
        vertices[5] = x, 0.5
        gap = np.array([x - 0.01 if edge == 1 else -x])
        return bool(
            from_outside(
                np.array([5]), np.array([edge]), gap, Outlines(vertices, next_vertex, previous, start), owner,
                np.array([known]), np.full(1, -1.0),
            )[0]
        )  # fmt: skip

    near, far = 3, 1
    assert not kept(-0.002, far) and not kept(0.002, far) and kept(0.002, near) and kept(0.008, far)
    assert kept(0.002, far, known=True)


def c_with_wall(wall, x, tilt, ratio):
    """Energy by overlaps and of the end's motion over the work of the weight: a square that falls 0.3 m onto the outer
    corner of a C."""
    w = wall
    c = np.array([[0, 0], [6, 0], [6, w], [w, w], [w, 3 - w], [6, 3 - w], [6, 3], [0, 3]], dtype=float)
    square = thin_scenes.turned(thin_scenes.rectangle(0, 0, 1, 1), tilt)
    square = square - square[square[:, 1].argmin()] + [x, 3.3]
    blocks = Blocks.from_polygons([c, square], fixed=[True, False])
    settings = DdaSettings(time_step=0.01, automatic_time_step=True, dynamic_factor=1.0, max_displacement_ratio=ratio)
    results = []
    rock = Material("rock", 10e9, 0.25, density=1000.0, rigid=True)
    weight = Loads(gravity=History.constant([0.0, -9.81]))
    for _ in dda.run(blocks, [rock], [JointLaw("smooth")], weight, settings, 0.5, watch=results.append):
        pass
    work = sum(result.energy.gravity_work for result in results)
    return sum(result.energy.overlap for result in results) / work, results[-1].energy.kinetic / work


@pytest.mark.first_by_default(3)
@pytest.mark.parametrize(
    ("wall", "ratio"),
    [
        (0.001, 1e-3),
        *((wall, ratio) for wall in (0.001, 0.02, 0.1) for ratio in (1e-2, 1e-1)),
        *(pytest.param(wall, 1e-3, marks=pytest.mark.slow) for wall in (0.02, 0.1)),
    ],
)
def test_a_square_lands_on_a_thin_wall(wall, ratio):
    """The far face of the wall has no part in it: what overlaps bring in is below 1e-6 of the weight's work, the landing
    takes energy away, and the square turns or lies there."""
    for x in (0.1 * wall, 0.6 * wall, 1.5 * wall):
        for tilt in (0.0, 0.02):
            overlap, kinetic = c_with_wall(wall, x, tilt, ratio)
            assert overlap < 1e-6 and kinetic < 1.0


@pytest.mark.parametrize("ratio", [*(pytest.param(ratio, marks=pytest.mark.slow) for ratio in (1e-3, 1e-2)), 1e-1])
@pytest.mark.parametrize("rigid", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_ring_holds_what_flies_in_it(rigid, ratio):
    """Walls of 1 mm to 10 cm at 30 m/s: below 1, nothing is deeper than half a wall, out, or driven by overlaps."""
    for wall in (1e-3, 1e-2, 1e-1):
        assert thin_scenes.ring(rigid, ratio, wall, 30.0).error < 1.0


@pytest.mark.parametrize(
    ("scene", "thin", "speed"),
    [(thin_scenes.nested, 1e-3, 30.0), (thin_scenes.chain, 3e-3, 10.0), (thin_scenes.combs, 3e-3, 10.0),
     (thin_scenes.cogs, 30.0, 20), pytest.param(thin_scenes.sticks, 1e-3, 10.0, marks=pytest.mark.slow), (thin_scenes.box_of_debris, 3e-3, 10.0)],
)  # fmt: skip
def test_hooks_combs_cogs_sticks_and_boxes_stay_out_of_each_other(scene, thin, speed):
    for ratio in (1e-2, 1e-1):
        assert scene(ratio, thin, speed).error < 1.0


def test_energy_of_overlaps_is_told_of_and_ends_the_run(caplog):
    """At 1 % of the energy converted, once, and at 10 %: with the blocks and the place. Overlaps that were drawn count
    for nothing."""
    empty = dda.StepEnergy(*[0.0] * len(dda.StepEnergy._fields))
    drawn = empty._replace(kinetic=100.0, overlap=50.0)
    budget, watch = dda.EnergyBudget().after(drawn, 0.0), OverlapWatch()
    watch.check(budget, Overlap(50.0, 0, 1, 0.1, 2.0, 3.0), ("a", "b"), 0.0)
    assert budget.by_overlap == 0.0 and not caplog.records
    worst = Overlap(2.0, 0, 1, 0.01, 2.0, 3.0)
    with caplog.at_level(logging.WARNING):
        for k in range(4):
            budget = budget.after(empty._replace(kinetic=100.0, before=100.0, overlap=2.0), 0.1 * k)
            watch.check(budget, worst, ("a", "b"), 0.1 * k)
    assert len(caplog.records) == 1
    assert "'a' and 'b' overlapped by 0.01 m near x = 2, y = 3 m" in caplog.text
    budget = budget.after(empty._replace(kinetic=100.0, before=100.0, overlap=3.0), 0.5)
    with pytest.raises(dda.NotConverged, match=r"0.11 of all converted energy .* 'a' and 'b'"):
        watch.check(budget, worst, ("a", "b"), 0.5)
