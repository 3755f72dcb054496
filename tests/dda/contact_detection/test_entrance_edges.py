"""Which contacts are found: every arrangement's set is known by inspection."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.dda.contact_detection.entrance_edges import (
    Corners,
    Known,
    Outlines,
    convex_corners,
    describe_contacts,
    find_contacts,
)
from geomech.dda.contact_detection.neighbour_search import boxes, near_pairs
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State, corner_lengths


def search(polygons, window=0.05, turn=0.0, fixed=None, rounding=0.01):
    blocks = Blocks.from_polygons(polygons, fixed=fixed)
    c, s = np.cos(turn), np.sin(turn)
    v = blocks.vertices @ np.array([[c, s], [-s, c]])
    next_, previous = blocks.next_vertex.astype(np.int64), blocks.previous_vertex.astype(np.int64)
    start, fixed = blocks.vertex_start.astype(np.int64), np.asarray(blocks.fixed, bool)
    none = np.empty(0, np.int64)
    near = near_pairs(boxes(v, start[:-1]), fixed, window)
    corners = Corners(
        convex_corners(v, next_, previous), *corner_lengths(blocks, rounding), blocks.areas(), np.zeros(len(polygons)),
        np.zeros_like(v), np.inf,
    )  # fmt: skip
    outlines = Outlines(v, next_, previous, start)
    table, met = find_contacts(outlines, near, window, none, corners)
    geometry, mate, _ = describe_contacts(table, met, outlines, window, Known(none, none, np.empty((0, 2)), none))
    return table, geometry, mate


def pairs(table) -> set[tuple[int, int]]:
    return {(int(v), int(e)) for v, e in table[:, :2]}


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.7, 3.1, -2.0])
def test_equal_widths_meet_in_two_contacts_not_four(turn):
    table, geometry, _ = search([rectangle(0, 0, 2, 1), rectangle(0, 1, 2, 2)], turn=turn)
    assert len(table) == 2
    assert sorted(geometry[:, 4]) == pytest.approx([1.0, 1.0])  # half the face each
    assert geometry[:, 3] == pytest.approx([0, 0], abs=1e-14)
    assert (table[:, 2] == -1).all()


def test_a_narrow_block_on_a_wide_one_brings_its_own_corners():
    table, geometry, mate = search([rectangle(0, 0, 4, 1), rectangle(1, 1, 2, 2)])
    assert pairs(table) == {(4, 2), (5, 2)}
    assert geometry[:, 4] == pytest.approx([0.5, 0.5])
    assert set(mate.tolist()) == {4}


def test_a_wide_block_on_a_narrow_one_is_touched_by_its_corners():
    table, _, _ = search([rectangle(1, 0, 2, 1), rectangle(0, 1, 4, 2)])
    assert pairs(table) == {(2, 4), (3, 4)}


def test_a_block_in_a_reentrant_corner_touches_both_walls():
    corner = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3.0]])
    table, _, _ = search([corner, rectangle(1, 1, 2, 2)])
    # Lower left corner on floor (edge 2) and wall (edge 3), lower right on the floor, upper left on the wall.
    assert pairs(table) == {(6, 2), (6, 3), (7, 2), (9, 3)}
    assert (table[:, 2] == -1).all()


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.7, 3.1, -2.0])
def test_corner_over_corner_meets_it_on_the_arc_of_both(turn):
    table, geometry, _ = search([rectangle(0, 0, 1, 1), rectangle(1.01, 1.02, 2.01, 2.02)], turn=turn)
    assert len(table) == 1 and table[0, 2] >= 0
    # Rounded over a hundredth of their size, their arc is that of a circle of 10 mm about (−10, −10) mm.
    away = np.hypot(0.02, 0.03)
    assert geometry[0, 3] == pytest.approx(away - 0.01, abs=1e-14)
    normal = geometry[0, 1:3] * (1.0 if table[0, 0] >= 4 else -1.0)
    c, s = np.cos(turn), np.sin(turn)
    assert normal @ [[c, -s], [s, c]] == pytest.approx(np.array([0.02, 0.03]) / away, abs=1e-12)


def test_bricks_in_running_bond():
    table, geometry, _ = search([rectangle(0, 0, 1, 1), rectangle(1, 0, 2, 1), rectangle(0.5, 1, 1.5, 2)])
    # Two contacts between the lower bricks; the upper brick rests on each with its corner and on their upper corners.
    on_top = table[(table[:, 0] >= 8) | (table[:, 1] >= 8)]
    assert len(table) == 6 and len(on_top) == 4
    assert sorted(geometry[:, 4]) == pytest.approx([0.25, 0.25, 0.25, 0.25, 0.5, 0.5])


def test_nothing_is_found_beyond_the_window_or_between_fixed_blocks():
    far = [rectangle(0, 0, 1, 1), rectangle(0, 1.2, 1, 2)]
    assert len(search(far)[0]) == 0
    assert len(search(far, window=0.3)[0]) == 2
    touching = [rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)]
    assert len(search(touching, fixed=[True, True])[0]) == 0


def test_a_face_split_by_a_flat_node_keeps_its_length():
    lower = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [0, 1.0]])
    upper = np.array([[0, 1], [1, 1], [2, 1], [2, 2], [0, 2.0]])
    table, geometry, _ = search([lower, upper])
    assert len(table) == 3
    assert geometry[:, 4].sum() == pytest.approx(2.0)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("beside", [0.0, *(way * 10.0**k for k in (-7, -6, -5, -4, -3, -2) for way in (1, -1))])
def test_a_face_keeps_its_length_while_a_corner_passes_a_flat_node(beside, mirrored):
    """The length is what a joint's stiffness is multiplied by: a corner that has slid a tenth of a millimetre past a
    node of the face below stands on no soft spring there. Counted double or not at all is at most where the two are
    told apart, 1e-4 of an edge of 3 m, on both of its sides."""
    lower = np.array([[-3, -1], [3, -1], [3, 0], [0, 0], [-3, 0.0]])
    upper = rectangle(beside, 0.0, beside + 2.0, 1.0)
    if mirrored:
        lower, upper = (polygon[::-1] * [-1.0, 1.0] for polygon in (lower, upper))
    _, geometry, _ = search([lower, upper])
    assert geometry[:, 4].sum() == pytest.approx(2.0, abs=6e-4)
    near = np.abs(geometry[:, 5]) < 0.5
    assert geometry[near, 4].sum() == pytest.approx(1.0, abs=6e-4 + abs(beside))


def test_many_blocks_agree_with_testing_every_pair():
    # The sweep over sorted boxes against the same narrow phase run on each pair of blocks alone.
    rng = np.random.default_rng(3)
    polygons = []
    for row in range(6):
        for column in range(6):
            angle = np.sort(rng.uniform(0, 2 * np.pi, 3)) + 2 * np.pi * np.arange(3) / 3 / 4
            polygons.append(np.array([column, row]) + 0.62 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    together = search(polygons, window=0.1)[0]
    blocks = Blocks.from_polygons(polygons)
    alone = set()
    for a in range(len(polygons)):
        for b in range(a + 1, len(polygons)):
            for v, e in search([polygons[a], polygons[b]], window=0.1)[0][:, :2]:
                new = [blocks.vertex_start[a] + v if v < 3 else blocks.vertex_start[b] + v - 3 for v in (v, e)]
                alone.add((int(new[0]), int(new[1])))
    assert len(alone) >= 15
    assert pairs(together) == alone


@pytest.mark.parametrize("tilt", [0.0, 0.03, -0.03])
def test_a_short_common_face_is_held_at_both_ends(tilt):
    # Nearer to each other than the window, the corners of the overlap are met as corners; each still bears on its own.
    c, s = np.cos(tilt), np.sin(tilt)
    upper = (rectangle(0, 0, 1, 1) @ np.array([[c, s], [-s, c]])) + [0.96, 1.0]
    table, _, _ = search([rectangle(0, 0, 1, 1), upper])
    assert {(2, 4), (4, 2)} <= pairs(table)
    # The line beside the corners, which both have crossed, holds nothing.
    assert len(table) == 2


@pytest.mark.parametrize("window", [0.004, 0.05, 0.3])
def test_faces_that_a_crack_has_left_touch_and_do_not_overlap(window):
    """A bump of facets shorter than the window in its own imprint: lines of far facets are crossed, their blocks are
    not."""
    x = np.array([-0.05, -0.03, -0.01, 0.0, 0.01, 0.03, 0.05])
    bump = np.column_stack([x, 1.0 + 0.0026 * (1 - (x / 0.05) ** 2)])
    below = np.vstack([[[-2, 0], [2, 0], [2, 1]], bump[::-1], [[-2, 1]]])
    above = np.vstack([[[-2, 1]], bump, [[2, 1], [2, 2], [-2, 2]]])
    _, geometry, _ = search([below, above], window=window)
    gap = geometry[:, 3]
    assert gap.min() > -1e-12
    # Level ends of the faces, and the facets in their imprint.
    assert (np.abs(gap) < 1e-12).sum() >= 6


@pytest.mark.parametrize("window", [0.01, 0.1, 0.374])
def test_corners_round_a_short_riser_do_not_overlap(window):
    """Columns that have broken at their base side by side: the break of one ends 5 cm above where the next begins."""
    base = [[-2, -1], [2, -1], [2, 0], [1, 0.0], [0.5, 0.0267], [0.2, 0.0158], [-0.15, 0.0146], [-0.5, 0.0]]
    left = [[-0.5, 0.0526], [-0.8, 0.0257], [-1.15, 0.0], [-1.5, 0.0], [-2, 0.0]]
    below = np.array(base + left)
    inner = np.array([[-0.5, 0.0], [-0.15, 0.0146], [0.2, 0.0158], [0.5, 0.0267], [0.5, 10], [-0.5, 10]])
    outer = np.array([[-1.5, 0.0], [-1.15, 0.0], [-0.8, 0.0257], [-0.5, 0.0526], [-0.5, 10], [-1.5, 10]])
    _, geometry, _ = search([below, inner, outer], window=window)
    gap = geometry[:, 3]
    assert gap.min() > -1e-12
    assert (np.abs(gap) < 1e-12).sum() >= 8


def leaning(angle: float) -> np.ndarray:
    """A square of 1 m on its left corner at (1, 1), its base leaning by ``angle``."""
    c, s = np.cos(angle), np.sin(angle)
    return rectangle(0, 0, 1, 1) @ np.array([[c, s], [-s, c]]) + [1.0, 1.0]


@pytest.mark.parametrize(
    "angle, window, met", [(0.04, 0.2, 2), (0.1, 0.2, 2), (0.2, 0.3, 2), (0.1, 0.05, 1), (0.3, 0.4, 1)]
)
def test_a_face_that_leans_may_turn_flat_in_the_step(angle, window, met):
    table, geometry, _ = search([rectangle(0, 0, 4, 1), leaning(angle)], window=window)
    assert pairs(table) == ({(4, 2), (5, 2)} if met == 2 else {(4, 2)})
    assert geometry[-1, 3] == pytest.approx(np.sin(angle) if met == 2 else 0.0, abs=1e-14)


def test_two_squares_that_turn_to_each_other_within_a_step_do_not_overlap():
    corner, lean, spin = np.array([0.05, 1.0]), 0.075, 6.0
    upper = 0.9 * (leaning(lean) - 1.0) + corner
    system = dda.BlockSystem(
        Blocks.from_polygons([rectangle(0, 0, 1.4, 1), upper]),
        [Material("rock", 10e9, 0.25, density=2600.0)],
        [JointLaw("joint", friction_angle=0.5)],
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.2),
    )
    state = State.at_rest(system.blocks)
    for b, rate in enumerate((spin, -spin)):
        x, y = system.blocks.vertices[4 * b : 4 * b + 4].mean(axis=0) - corner
        state.velocity[b, :3] = -rate * y, rate * x, rate  # both about the corner that touches
    energy = np.inf
    for _ in range(3):
        result = system.step(state, Loads(), 1e-2)
        state = result.state
        base = state.vertices[[2, 3, 5]]
        (tx, ty), (x, y) = base[1] - base[0], base[2] - base[0]
        assert tx * y - ty * x < 1e-4  # the corner that comes down is outside the lower one's top
        assert result.statistics["worst_penetration"] < 1e-4
        after = sum(result.statistics[name] for name in ("kinetic_energy", "elastic_energy", "contact_energy"))
        assert after < energy * (1 + 1e-9)
        energy = after


#: A needle of 1.1° between a block with a flat corner (178.9°) at its tip and what lies on its other side: as cross joints of
#: a slope cut them that meet at a shallow angle.
NEEDLE = np.array(
    [[4.558000269154, 2.990049766305], [4.645896210674, 3.233735866807], [4.553782714671, 2.993002929747]]
)
FLAT = np.array([
    [6.420925462199, 1.685615503026], [6.553808610733, 2.093087302111], [4.704830113225, 3.387755984045],
    [4.645896210674, 3.233735866807], [4.558000269154, 2.990049766305],
])  # fmt: skip


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.2, 4.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_needle_is_held_at_its_tip_by_the_flat_corner_beside_it(turn, mirrored):
    polygons = [FLAT, NEEDLE]
    if mirrored:
        polygons = [polygon[::-1] * [-1.0, 1.0] for polygon in polygons]
    table, geometry, _ = search(polygons, turn=turn, fixed=[True, False])
    tip = np.argmax(np.hypot(*(polygons[1] - polygons[1].mean(axis=0)).T))
    c, s = np.cos(turn), np.sin(turn)
    tip = polygons[1][tip] @ np.array([[c, s], [-s, c]])
    at = np.hypot(*(geometry[:, 5:7] - tip).T)
    # Both ends of the common face bear, with normals across it, and its length is shared.
    assert len(table) == 2 and at.min() < 1e-9 and at.max() > 0.25
    assert np.abs(geometry[0, 1:3] @ geometry[1, 1:3]) == pytest.approx(1.0, abs=1e-3)
    assert geometry[:, 4] == pytest.approx([0.1295, 0.1295], abs=2e-3)


def test_a_needle_that_is_pressed_on_a_flat_corner_does_not_sink_in():
    """A body force of 10 g across its face, for 20 ms: rigid, it would turn into the block by 8 mm at its tip."""
    rock, joint = Material("rock", 1e9, 0.25, density=2600.0), JointLaw("joint", friction_angle=0.5)
    blocks = Blocks.from_polygons([FLAT, NEEDLE], fixed=[True, False])
    settings = DdaSettings(time_step=1e-3, dynamic_factor=1.0, max_displacement_ratio=0.05)
    across = 98.1 * np.array([0.9407, -0.3393])
    states = list(dda.run(blocks, [rock], [joint], Loads(gravity=History.constant(across)), settings, end_time=0.02))
    off = states[-1].vertices[-3:] - blocks.vertices[-3:]
    assert np.hypot(*off.T).max() < 1e-6


@pytest.mark.parametrize(("inwards", "flat"), [(0.0, True), (1e-8, True), (-1e-8, True), (1e-5, False)])
def test_noise_does_not_decide_whether_a_straight_side_has_a_corner(inwards, flat):
    """A vertex in the middle of a side of 2 cm, beside it by some 1e-10 m: flat as in `Blocks.in_side`."""
    outline = np.array([[0.0, 0.0], [0.01, 0.01 * inwards], [0.02, 0.0], [0.02, 1.0], [0.0, 1.0]])
    blocks = Blocks.from_polygons([outline])
    middle = np.flatnonzero(blocks.vertices[:, 0] == 0.01)
    convex = convex_corners(blocks.vertices, blocks.next_vertex.astype(int), blocks.previous_vertex.astype(int))
    assert convex[middle].all() == flat and blocks.in_side[middle].all() == flat
