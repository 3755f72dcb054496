"""Crack networks: tips, junctions, mouths, parts of a network, and what is refused."""

import math

import numpy as np
import pytest

from geomech.model import Blocks, Cracks, Material, Problem


def test_polylines_become_segments():
    cracks = Cracks.from_polylines(
        [[[0, 0], [1, 0], [1, 1]], [[3, 0], [3, 4]]], block=[0, 1], aperture=[0.0, math.inf], names=["a", "b"]
    )
    assert cracks.n_segments == 3 and cracks.n_cracks == 2
    assert cracks.segments.tolist() == [[0, 1], [1, 2], [3, 4]]
    assert cracks.crack.tolist() == [0, 0, 1] and cracks.block.tolist() == [0, 0, 1]
    np.testing.assert_array_equal(cracks.lengths, [1, 1, 4])
    assert cracks.aperture.tolist() == [0, 0, math.inf]
    assert cracks.tips.tolist() == [0, 2, 3, 4]


def test_mouths_and_junctions_are_no_tips():
    mouth = Cracks.from_polylines([[[0, 0], [1, 0]]], surface=[(True, False)])
    assert mouth.tips.tolist() == [1]
    star = Cracks(
        nodes=np.array([[0, 0], [1, 0], [0, 1], [-1, -1.0]]),
        segments=np.array([[1, 0], [0, 2], [0, 3]]),
        crack=np.array([0, 0, 1]),
        block=np.zeros(3, int),
        birth_cycle=np.zeros(3, int),
        aperture=np.zeros(3),
        surface=np.zeros(4, bool),
        names=("a", "b"),
    )
    assert star.law.tolist() == [0, 0, 0]
    assert star.valence.tolist() == [3, 1, 1, 1] and star.tips.tolist() == [1, 2, 3]


def test_part_of_a_network_keeps_what_is_said_of_it():
    lines = [[[0, 0], [1, 0]], [[5, 0], [6, 0], [7, 1]]]
    cracks = Cracks.from_polylines(lines, block=[0, 2], names=["a", "b"], law=[0, 3])
    part = cracks.in_block(2)
    assert part.law.tolist() == [3, 3]
    np.testing.assert_array_equal(part.nodes, [[5, 0], [6, 0], [7, 1]])
    assert part.segments.tolist() == [[0, 1], [1, 2]] and part.crack.tolist() == [1, 1] and part.names == ("a", "b")
    assert cracks.in_block(1).n_segments == 0


def test_no_cracks_at_all():
    nothing = Cracks.from_polylines([])
    assert nothing.n_segments == 0 and nothing.tips.size == 0 and nothing.in_block(0).n_segments == 0


@pytest.mark.parametrize(
    ("line", "message"),
    [([[0, 0]], "at least two points"), ([[0, 0], [np.inf, 0]], "not finite"), ([[1, 1], [1, 1]], "no length")],
)
def test_bad_cracks_are_refused_by_name(line, message):
    with pytest.raises(ValueError, match=f"flaw: .*{message}"):
        Cracks.from_polylines([line], names=["flaw"])


def test_cracks_in_no_block_and_joint_laws_by_name():
    blocks = Blocks.from_polygons([np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])])
    rock = (Material("rock", 1e9, 0.2),)
    with pytest.raises(ValueError, match="block that does not exist"):
        Problem("t", blocks, Cracks.from_polylines([[[0, 0], [1, 1]]], block=3), rock, ())
    pairs = {("", "x"): 1, ("x", "y"): 2}
    problem = Problem("t", blocks, Cracks.from_polylines([]), rock, (), joint_of=pairs)
    assert problem.joint_index("y", "x") == 2 and problem.joint_index("x", "z") == 1
    assert problem.joint_index("p", "q") == 0


def test_points_that_coincide_are_joined_where_that_is_asked_for():
    """Three arms from one point, a ring, and a mouth that two cracks share, all with round-off in their points."""
    turn = np.radians([90, 210, 330])
    arms = [np.array([[1e-17, -1e-17], [np.cos(q), np.sin(q)]]) for q in turn]
    star = Cracks.from_polylines(arms, join=True)
    assert star.segments.tolist() == [[0, 1], [0, 2], [0, 3]] and star.tips.tolist() == [1, 2, 3]
    assert star.valence.tolist() == [3, 1, 1, 1] and star.crack.tolist() == [0, 1, 2]
    apart = Cracks.from_polylines(arms)
    assert len(apart.nodes) == 6 and len(apart.tips) == 6
    corners = np.column_stack([np.cos(turn), np.sin(turn)])
    ring = Cracks.from_polylines([[*corners, corners[0] * (1 + 1e-15)], [[5.0, 0], [6, 0]]], join=True)
    assert ring.segments.tolist() == [[0, 1], [1, 2], [2, 0], [3, 4]] and ring.tips.tolist() == [3, 4]
    mouth = Cracks.from_polylines(
        [[[1, 0], [0, 0]], [[0, 0], [1, 1]]], surface=[(False, True), (False, False)], join=True
    )
    assert mouth.surface.tolist() == [False, True, False] and mouth.tips.tolist() == [0, 2]
    with pytest.raises(ValueError, match=r"short: .*too short relative to the network's extent"):
        Cracks.from_polylines([[[0, 0], [1e-12, 0]], [[1, 0], [2, 0]]], names=["short", "long"], join=True)
