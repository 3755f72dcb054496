"""Canonical blocks from zones: order, sense, edge names, and what is refused."""

import numpy as np
import pytest

from geomech.shapes import EdgeLine, ShapeError, Zone, assemble, rectangle

SQUARE = rectangle(0.0, 0.0, 1.0, 1.0)


def flaws(*args, **kwargs):
    with pytest.raises(ShapeError) as caught:
        assemble(*args, **kwargs)
    return caught.value.flaws


@pytest.mark.parametrize("start", range(4))
@pytest.mark.parametrize("sense", [1, -1])
def test_outline_starts_lowest_left_and_runs_counter_clockwise(start, sense):
    drawn = np.roll(SQUARE[::sense], start, axis=0)
    blocks, _ = assemble([Zone("rock", (drawn,))])
    assert np.array_equal(blocks.vertices, SQUARE)


@pytest.mark.parametrize("sense", [1, -1])
def test_edge_names_follow_their_edges_when_an_outline_is_turned(sense):
    # Edge names are told apart by where the edge is: the name is its middle.
    drawn = np.roll(SQUARE[::sense], 2, axis=0)
    middles = 0.5 * (drawn + np.roll(drawn, -1, axis=0))
    names = tuple(f"{x:g},{y:g}" for x, y in middles)
    blocks, _ = assemble([Zone("rock", (drawn,), (names,))])
    for edge in range(4):
        x, y = 0.5 * (blocks.vertices[edge] + blocks.vertices[blocks.next_vertex[edge]])
        assert blocks.edge_names[blocks.edge_name[edge]] == f"{x:g},{y:g}"


def test_holes_are_clockwise_sorted_and_taken_out_of_the_area():
    upper, lower = rectangle(0.2, 0.7, 0.4, 0.8), rectangle(0.5, 0.1, 0.6, 0.2)
    blocks, _ = assemble([Zone("rock", (SQUARE, upper, lower))])
    loops = blocks.loops(0)
    assert [loop[0].tolist() for loop in loops] == [[0, 0], [0.5, 0.1], [0.2, 0.7]]
    # 1 − 0.02 − 0.01, sums of a few products: round-off only
    assert blocks.areas()[0] == pytest.approx(0.97, abs=1e-15)


def test_closing_repetition_is_dropped():
    blocks, _ = assemble([Zone("rock", (np.vstack([SQUARE, SQUARE[:1]]),))])
    assert blocks.n_vertices == 4


def test_coordinates_keep_the_decimals_that_were_typed():
    outline = np.array([[0.1, 0.2], [0.3, 0.2], [0.3, 0.7], [0.1, 0.7]])
    blocks, _ = assemble([Zone("rock", (outline,))])
    assert np.array_equal(blocks.vertices, outline)


def test_round_off_of_two_ways_to_draw_disappears():
    # One part in 1e15 is what sine and cosine of two programs differ by; the twelve digits kept hide it.
    shaken = SQUARE * (1 + 1e-15) + 1e-16
    a, _ = assemble([Zone("rock", (SQUARE,))])
    b, _ = assemble([Zone("rock", (shaken,))])
    assert np.array_equal(a.vertices, b.vertices)


def test_an_edge_line_names_a_part_of_an_edge_and_makes_vertices():
    blocks, _ = assemble([Zone("rock", (SQUARE,))], edges=[EdgeLine("load:top", (0.25, 1.0), (0.75, 1.0))])
    assert blocks.n_vertices == 6
    (edge,) = blocks.edges_named("load:top")
    ends = blocks.vertices[[edge, blocks.next_vertex[edge]]]
    assert np.array_equal(ends, [[0.75, 1.0], [0.25, 1.0]])
    assert blocks.areas()[0] == pytest.approx(1.0, abs=1e-15)


def test_an_edge_line_names_both_sides_of_a_joint_unless_a_zone_is_given():
    zones = [Zone("a", (SQUARE,)), Zone("b", (SQUARE + [1.0, 0.0],))]
    both, _ = assemble(zones, edges=[EdgeLine("joint:1", (1.0, 0.0), (1.0, 1.0))])
    assert len(both.edges_named("joint:1")) == 2
    one, _ = assemble(zones, edges=[EdgeLine("joint:1", (1.0, 0.0), (1.0, 1.0), "b")])
    assert one.vertex_block[one.edges_named("joint:1")].tolist() == [1]


def test_a_line_longer_than_an_edge_does_not_name_what_it_only_passes():
    # Over ten lengths the line strays by far more than the tolerance, on the edge it does not.
    blocks, _ = assemble([Zone("rock", (SQUARE,))], edges=[EdgeLine("top", (-5.0, 1.0), (5.0, 1.0))])
    assert len(blocks.edges_named("top")) == 1
    assert blocks.n_vertices == 4


def test_zones_of_one_name_are_numbered_blocks():
    zones = [Zone("brick", (SQUARE + [k, 0.0],)) for k in range(3)]
    assert assemble(zones)[0].names == ("brick 1", "brick 2", "brick 3")


def test_everything_wrong_is_said_at_once():
    bow = np.array([[0, 0], [1, 1], [1, 0], [0, 1.0]])
    found = flaws([Zone("bow", (bow,)), Zone("line", (SQUARE[:2],)), Zone("rock", (SQUARE,))])
    assert [(f.part, f.index) for f in found] == [("zones", 0), ("zones", 1)]
    assert "crosses" in found[0].message and "0.5, 0.5" in found[0].message
    assert "2 corners" in found[1].message


@pytest.mark.parametrize(
    ("loops", "message"),
    [
        ((np.array([[0, 0], [1, 0], [1, 0], [0, 1.0]]),), "corners 1 and 2 of the outline coincide"),
        ((np.array([[0, 0], [1, 0], [2, 0.0]]),), "encloses no area"),
        ((SQUARE, rectangle(0.5, 0.5, 1.5, 0.8)), "hole 1 is not inside"),
        ((SQUARE, rectangle(0.0, 0.5, 0.3, 0.8)), "hole 1 is not inside"),
        ((SQUARE, rectangle(0.2, 0.2, 0.5, 0.5), rectangle(0.4, 0.4, 0.6, 0.6)), "holes 1 and 2 touch"),
        ((np.array([[0, 0], [1, 0], [np.nan, 1.0]]),), "not a finite"),
    ],
)
def test_faulty_outlines(loops, message):
    (flaw,) = flaws([Zone("rock", loops)])
    assert "'rock'" in flaw.message and message in flaw.message and flaw.way_out


def test_overlapping_zones_are_refused_and_touching_ones_are_not():
    (flaw,) = flaws([Zone("a", (SQUARE,)), Zone("b", (SQUARE + [0.9, 0.0],))])
    assert "'a' and 'b' overlap" in flaw.message
    assert assemble([Zone("a", (SQUARE,)), Zone("b", (SQUARE + [1.0, 0.5],))])[0].n_blocks == 2
    # A block inside another one.
    assert flaws([Zone("a", (SQUARE,)), Zone("b", (rectangle(0.4, 0.4, 0.6, 0.6),))])


def test_edge_lines_that_name_nothing_or_clash():
    zone = [Zone("rock", (SQUARE,))]
    (flaw,) = flaws(zone, edges=[EdgeLine("top", (0.0, 1.1), (1.0, 1.1))])
    assert "no block edge lies on the line" in flaw.message
    (flaw,) = flaws(zone, edges=[EdgeLine("top", (0.0, 1.0), (1.0, 1.0)), EdgeLine("load", (0.2, 1.0), (0.4, 1.0))])
    assert flaw.index == 1 and "already called 'top'" in flaw.message
    (flaw,) = flaws(zone, edges=[EdgeLine("top", (0.0, 1.0), (1.0, 1.0), "stone")])
    assert "no zone 'stone'" in flaw.message


def test_an_outline_that_touches_itself_by_round_off_is_refused_with_its_zone():
    """Shapely calls it valid: the corner stands 1e-12 m before an edge that slants."""
    outline = np.array([[0, 0], [3, 1], [3, 3], [0.7, 0.233333333334], [0, 3]])
    (flaw,) = flaws([Zone("rock", (outline,))])
    assert flaw.part == "zones" and "'rock'" in flaw.message and "touches itself" in flaw.message
