"""Crack networks: blocks found, mouths on the outline, crossings noded, bad cracks refused by name."""

import numpy as np
import pytest
import shapely

from geomech.shapes import ShapeError, Trace, Zone, assemble, cutting_cracks, rectangle, straight_crack

SQUARE = rectangle(0.0, 0.0, 1.0, 1.0)
ROCK = [Zone("rock", (SQUARE,))]


def cracks(*lines, zones=ROCK, **kwargs):
    traces = [Trace("abcdefgh"[k], (np.array(line, dtype=float),)) for k, line in enumerate(lines)]
    return assemble(zones, traces, **kwargs)[1]


def flaws(*lines, **kwargs):
    with pytest.raises(ShapeError) as caught:
        cracks(*lines, **kwargs)
    return caught.value.flaws


def test_cracks_keep_their_direction_and_order():
    net = cracks([[0.8, 0.2], [0.2, 0.3]], [[0.2, 0.8], [0.5, 0.7], [0.8, 0.8]])
    assert net.names == ("a", "b") and net.crack.tolist() == [0, 1, 1]
    assert np.array_equal(net.nodes[net.segments[0]], [[0.8, 0.2], [0.2, 0.3]])
    assert net.nodes[net.tips].tolist() == [[0.8, 0.2], [0.2, 0.3], [0.2, 0.8], [0.8, 0.8]]


def test_each_crack_goes_to_its_block():
    zones = [Zone("left", (SQUARE,)), Zone("right", (SQUARE + [1.0, 0.0],))]
    net = cracks([[1.2, 0.2], [1.4, 0.3]], [[0.2, 0.2], [0.4, 0.3]], zones=zones)
    assert net.block.tolist() == [1, 0]


def test_an_end_near_the_outline_becomes_a_mouth_exactly_on_it():
    # 3e-7 of the size is within the drawing tolerance of 1e-6, on either side of the outline
    for off in (-3e-7, 0.0, 3e-7):
        net = cracks([[1.0 + off, 0.4], [0.6, 0.4]])
        assert net.nodes[net.surface].tolist() == [[1.0, 0.4]]
        assert net.nodes[net.tips].tolist() == [[0.6, 0.4]]


def test_a_mouth_on_a_slanted_edge_lies_on_it():
    triangle = np.array([[0.0, 0.0], [1.0, 0.0], [0.3, 0.7]])
    net = cracks([[0.65, 0.35], [0.4, 0.2]], zones=[Zone("rock", (triangle,))])
    (mouth,) = net.nodes[net.surface]
    a, b = triangle[1], triangle[2]
    # distance from the line through a, b; coordinates of order one: a few units of round-off
    off = (b - a)[0] * (mouth - a)[1] - (b - a)[1] * (mouth - a)[0]
    assert abs(off) / np.hypot(*(b - a)) < 1e-15


def test_an_end_near_a_corner_becomes_that_corner():
    net = cracks([[1e-7, 1e-7], [0.4, 0.3]])
    assert net.nodes[net.surface].tolist() == [[0.0, 0.0]]


def test_a_mouth_on_a_hole():
    zones = [Zone("rock", (SQUARE, rectangle(0.4, 0.4, 0.6, 0.6)))]
    net = cracks([[0.6, 0.5], [0.8, 0.5]], zones=zones)
    assert net.surface.tolist() == [True, False]


def test_crossing_cracks_share_a_node():
    net = cracks([[0.2, 0.5], [0.8, 0.5]], [[0.5, 0.2], [0.5, 0.8]])
    assert net.n_segments == 4 and len(net.nodes) == 5
    assert sorted(net.valence.tolist()) == [1, 1, 1, 1, 4]
    assert net.nodes[net.valence == 4].tolist() == [[0.5, 0.5]]
    assert net.crack.tolist() == [0, 0, 1, 1] and len(net.tips) == 4


def test_many_random_cracks_become_a_planar_graph():
    # The number of crossings is counted independently, by the signs of four triangles a pair.
    rng = np.random.default_rng(3)
    lines = [straight_crack(rng.uniform(0.25, 0.75, 2), 0.4, rng.uniform(0, np.pi)) for _ in range(40)]
    traces = [Trace(str(k), (line,)) for k, line in enumerate(lines)]
    net = assemble(ROCK, traces)[1]

    def turn(a, b, c):
        return np.sign((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0])

    crossings = 0
    for i, (a, b) in enumerate(lines):
        for c, d in lines[:i]:
            crossings += turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0
    assert crossings > 100
    assert len(net.nodes) == 80 + crossings
    assert net.n_segments == 40 + 2 * crossings
    assert (net.valence[net.valence > 1] == 4).all() and len(net.tips) == 80
    # Cutting loses no length: nodes are rounded at 1e-12.
    assert np.bincount(net.crack, net.lengths) == pytest.approx(np.full(40, 0.4), abs=1e-11)


def test_an_end_on_another_crack_joins_it():
    net = cracks([[0.2, 0.5], [0.8, 0.5]], [[0.4, 0.5 + 5e-7], [0.4, 0.8]])
    assert net.valence.max() == 3 and net.n_segments == 3 and len(net.tips) == 3
    # The crack that is met stays straight.
    assert net.nodes[net.valence == 3].tolist() == [[0.4, 0.5]]


def test_ends_that_meet_share_a_node():
    net = cracks([[0.2, 0.5], [0.5, 0.5]], [[0.5, 0.5 + 1e-8], [0.7, 0.8]])
    assert len(net.nodes) == 3 and len(net.tips) == 2


def test_a_branching_crack_stays_one_crack():
    star = tuple(np.array([[0.5, 0.5], [0.5 + 0.2 * np.cos(t), 0.5 + 0.2 * np.sin(t)]]) for t in (0.1, 2.2, 4.3))
    net = assemble(ROCK, [Trace("star", star)])[1]
    assert net.names == ("star",) and net.crack.tolist() == [0, 0, 0] and net.valence.max() == 3


@pytest.mark.parametrize(
    ("lines", "index", "message"),
    [
        ([[[1.2, 0.2], [1.4, 0.2]]], 0, "'a' from (1.2, 0.2) to (1.4, 0.2) lies outside the rock"),
        ([[[0.8, 0.2], [1.2, 0.2]]], 0, "'a' crosses the outline of zone 'rock' at (1, 0.2)"),
        ([[[1.0, 0.2], [1.0, 0.6]]], 0, "'a' runs along the outline of zone 'rock'"),
        ([[[0.2, 0.2], [0.2, 0.2]]], 0, "coincide"),
        ([[[0.2, 0.2]]], 0, "1 point"),
        ([[[0.5, 0.5], [1.0, 0.7], [0.5, 0.9]]], 0, "touches the outline of zone 'rock' between its ends, at (1, 0.7)"),
        ([[[0.2, 0.5], [0.6, 0.5]], [[0.8, 0.5], [0.4, 0.5]]], 1, "cracks 'a' and 'b' coincide"),
        ([[[0.2, 0.5], [0.6, 0.5]], [[0.6, 0.5], [0.2, 0.5]]], 1, "cracks 'a' and 'b' coincide"),
        ([[[0.2, 0.5], [0.6, 0.5], [0.4, 0.5]]], 0, "'a' coincides with itself"),
    ],
)
def test_bad_cracks_are_refused_by_name(lines, index, message):
    (flaw,) = flaws(*lines)
    assert (flaw.part, flaw.index) == ("cracks", index) and message in flaw.message and flaw.way_out


def test_a_crack_across_two_blocks_is_refused():
    zones = [Zone("left", (SQUARE,)), Zone("right", (SQUARE + [1.0, 0.0],))]
    (flaw,) = flaws([[0.6, 0.5], [1.3, 0.5]], zones=zones)
    assert "crosses the outline of zone 'left'" in flaw.message


def test_a_reentrant_corner_on_a_crack_is_refused():
    ell = np.array([[0, 0], [1, 0], [1, 0.5], [0.5, 0.5], [0.5, 1], [0, 1.0]])
    (flaw,) = flaws([[0.2, 0.8], [0.8, 0.2]], zones=[Zone("ell", (ell,))])
    assert "touches the outline" in flaw.message


RING = [[[0.3, 0.3], [0.7, 0.3]], [[0.6, 0.2], [0.4, 0.7]], [[0.3, 0.2], [0.5, 0.7]]]


@pytest.mark.parametrize(
    ("lines", "found"),
    [
        ([[[0.0, 0.4], [1.0, 0.6]]], [0]),  # from side to side
        ([[[0.0, 0.4], [0.5, 0.5], [0.0, 0.6]]], [0]),  # a bite out of one side
        ([[[0.0, 0.4], [0.6, 0.5]], [[0.4, 0.3], [0.4, 0.8]], [[1.0, 0.7], [0.3, 0.7]]], [2]),  # three together
        (RING, [2]),  # a triangle inside
        (RING[:2], []),
        ([[[0.0, 0.4], [0.6, 0.5]], [[0.4, 0.3], [0.4, 0.8]]], []),
    ],
)
def test_cracks_that_cut_a_piece_off_are_found(lines, found):
    """Against Shapely's polygonize: a piece is cut off when outline and cracks bound more than one polygon."""
    blocks, net = assemble(ROCK, [Trace(str(k), (np.array(line),)) for k, line in enumerate(lines)])
    assert [crack for crack, _ in cutting_cracks(blocks, net)] == found
    noded = shapely.union_all([*shapely.linestrings(net.nodes[net.segments]), shapely.LinearRing(SQUARE)])
    pieces = shapely.polygonize(shapely.get_parts(noded)).geoms
    assert (len(pieces) > 1) == bool(found)


def test_one_bridge_to_a_hole_cuts_nothing_off_and_two_do():
    zones = [Zone("rock", (SQUARE, rectangle(0.4, 0.4, 0.6, 0.6)))]
    left, right = (Trace(n, (np.array(p),)) for n, p in (("l", [[0, 0.5], [0.4, 0.5]]), ("r", [[0.6, 0.5], [1, 0.5]])))
    blocks, one = assemble(zones, [left])
    assert one.surface.all() and cutting_cracks(blocks, one) == []
    assert cutting_cracks(*assemble(zones, [left, right])) == [(1, 0)]
