"""Blocks as flat arrays: orientation, indices, names, areas, and what is refused."""

import numpy as np
import pytest

from geomech.model import Blocks, Motion

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
HOLE = np.array([[0.5, 0.25], [1.5, 0.25], [1.5, 0.75], [0.5, 0.75]])


def test_loops_are_turned_rock_on_the_left():
    blocks = Blocks.from_polygons([[SQUARE[::-1], HOLE], SQUARE + 5])
    assert blocks.n_blocks == 2 and blocks.n_vertices == 12
    assert blocks.loop_start.tolist() == [0, 4, 8, 12] and blocks.block_loop.tolist() == [0, 2, 3]
    np.testing.assert_allclose(blocks.areas(), [2.0 - 0.5, 2.0], rtol=1e-15)
    signed = [0.5 * np.sum(p[:, 0] * np.roll(p[:, 1], -1) - p[:, 1] * np.roll(p[:, 0], -1)) for p in blocks.loops(0)]
    assert signed[0] > 0 > signed[1]


def test_edge_names_stay_with_their_edges_when_a_loop_is_turned():
    names = ["bottom", "right", "top", "left"]
    given = Blocks.from_polygons([SQUARE], edge_names=[[names]])
    turned = Blocks.from_polygons([SQUARE[::-1]], edge_names=[[["top", "right", "bottom", "left"]]])

    def middles(blocks):
        middle = (blocks.vertices + blocks.vertices[blocks.next_vertex]) / 2
        return {blocks.edge_names[k]: tuple(m) for k, m in zip(blocks.edge_name, middle)}

    assert middles(given) == middles(turned)
    assert given.edges_named("top").tolist() == [2] and given.edges_named("nowhere").tolist() == []


def test_next_and_previous_stay_in_their_loop():
    blocks = Blocks.from_polygons([[SQUARE, HOLE], SQUARE + 5])
    assert blocks.next_vertex.tolist() == [1, 2, 3, 0, 5, 6, 7, 4, 9, 10, 11, 8]
    np.testing.assert_array_equal(blocks.previous_vertex[blocks.next_vertex], np.arange(12))
    assert blocks.vertex_block.tolist() == [0] * 8 + [1] * 4
    assert blocks.vertex_start.tolist() == [0, 8, 12]


def test_areas_keep_their_digits_far_from_the_origin():
    far = SQUARE * 1e-3 + 1e6
    exact = np.prod(far[2] - far[0])  # of the coordinates as they are stored
    assert Blocks.from_polygons([far]).areas()[0] == pytest.approx(exact, rel=1e-12)


def test_defaults_and_replacement():
    blocks = Blocks.from_polygons([SQUARE, SQUARE + 3])
    assert blocks.names == ("block 0", "block 1") and not blocks.fixed.any() and not blocks.material.any()
    moved = blocks.with_vertices(blocks.vertices * 2)
    np.testing.assert_allclose(moved.areas(), 8.0)
    np.testing.assert_allclose(blocks.areas(moved.vertices), 8.0)


@pytest.mark.parametrize(
    ("loop", "message"),
    [
        (SQUARE[:2], "at least three vertices"),
        (np.array([[0, 0], [1, 0], [np.nan, 1]]), "vertex 2 is not a finite point"),
        (np.array([[0, 0], [1, 0], [1, 0], [0, 1]]), "vertices 1 and 2 coincide"),
        (np.array([[0, 0], [1, 1], [2, 2]]), "encloses no area"),
    ],
)
def test_bad_outlines_are_refused_by_name(loop, message):
    with pytest.raises(ValueError, match=f"rock.*{message}"):
        Blocks.from_polygons([loop], names=["rock"])
    with pytest.raises(ValueError, match="4 edges but 1 edge names"):
        Blocks.from_polygons([SQUARE], edge_names=[[["a"]]])


U = np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
WIDE, SMALL = np.array([[0, 0], [10, 0], [10, 10], [0, 10.0]]), np.array([[2, 2], [4, 2], [4, 4], [2, 4.0]])


@pytest.mark.parametrize("far", [0.0, 1e7])
@pytest.mark.parametrize(
    ("loops", "message"),
    [
        ([WIDE, SMALL, SMALL + 1], "slab: holes 1 and 2 overlap at"),
        ([WIDE, SMALL, 2.5 + 0.25 * SMALL], "slab: holes 1 and 2 overlap at"),
        ([WIDE, SMALL + 3, SMALL, SMALL], "slab: holes 2 and 3 overlap at"),
        ([WIDE, SMALL, SMALL[:3]], "slab: holes 1 and 2 overlap at"),
        ([WIDE, SMALL * [2, 0.5], SMALL * [1, 1.5] - [-2, 2.5]], "slab: holes 1 and 2 overlap at"),
        ([U, np.array([[0.5, 2], [2.5, 2], [2.5, 2.2], [0.5, 2.2]])], "slab: a hole reaches out of the outline at"),
        ([WIDE, WIDE], "slab: an edge of a hole lies along the outline at"),
        ([WIDE, WIDE[[1, 2, 0]]], "slab: an edge of a hole lies along the outline at"),
    ],
    ids=["crossing", "inside", "twice", "half of it", "a cross", "over a notch", "all of it", "a half"],
)
def test_holes_that_share_rock_or_leave_it_are_refused(loops, message, far):
    with pytest.raises(ValueError, match=message):
        Blocks.from_polygons([[loop + far for loop in loops]], names=["slab"])


@pytest.mark.parametrize(
    "shift", [(2, 0), (2, 2), (2, 1), (4, 3)], ids=["a side", "a corner", "part of a side", "apart"]
)
def test_holes_that_only_touch_are_two(shift):
    assert Blocks.from_polygons([[WIDE, SMALL, SMALL[::-1] + shift]]).areas() == pytest.approx(100 - 8)


def test_a_hole_may_touch_the_corners_of_its_outline():
    hole = np.array([[0, 0], [4, 1], [10, 10], [1, 4.0]])
    assert Blocks.from_polygons([[WIDE, hole]]).areas() == pytest.approx(100 - 30)


def test_motion_is_recovered_from_the_vertices():
    """An affine map per block, far from the origin, is found again to round-off."""
    rng = np.random.default_rng(3)
    blocks = Blocks.from_polygons([[SQUARE, HOLE], SQUARE + 1e4])
    gradient = np.eye(2) + 0.2 * rng.normal(size=(2, 2, 2))
    shift = rng.normal(size=(2, 2)) * 100
    owner = blocks.vertex_block
    vertices = np.einsum("nij,nj->ni", gradient[owner], blocks.vertices) + shift[owner]
    motion = Motion.of(blocks, vertices)
    np.testing.assert_allclose(motion.gradient, gradient, atol=1e-11)  # 1e4 m off, digits to 1e-12 m in 1 m
    point = np.array([1.3, 0.4])
    np.testing.assert_allclose(motion.current(0, point), gradient[0] @ point + shift[0], rtol=1e-13)
    np.testing.assert_allclose(motion.reference(0, motion.current(0, point)), point, rtol=1e-13)


def test_sides_run_through_straight_vertices_and_round_the_start_of_a_loop():
    """A square with two vertices more in its bottom, numbered from one of them; and a hole."""
    square = np.array([[0.3, 0.0], [0.6, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]])
    hole = np.array([[0.4, 0.4], [0.4, 0.6], [0.6, 0.6]])
    blocks = Blocks.from_polygons([[square, hole]])
    assert blocks.side_start == [5, 5, 2, 3, 4, 5, 6, 7, 8]
    assert blocks.sides == {2: [2, 3], 3: [3, 4], 4: [4, 5], 5: [5, 0, 1, 2], 6: [6, 7], 7: [7, 8], 8: [8, 6]}
