"""Crack growth as geometry: single cases by hand, and random networks whose invariants are checked with Shapely."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from geomech.ddm.growth.tip_advance import SLIVER, advance
from geomech.model import TIP, Cracks, GrowthSettings

SETTINGS = GrowthSettings(increment=1.0, min_increment=0.1, join_distance=0.5)
SQUARE = [np.array([[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]])]
NO_LOOPS = []


def tips_of(cracks, angle=0.0, k_eq=1.0):
    """TIP rows for every tip of the network, all driven alike unless arrays are given."""
    nodes = cracks.tips
    rows = np.zeros(len(nodes), TIP)
    rows["node"] = nodes
    for row, node in zip(rows, nodes):
        ((at, end),) = np.argwhere(cracks.segments == node)
        row["crack"], row["block"], row["point"] = cracks.crack[at], cracks.block[at], cracks.nodes[node]
        out = cracks.nodes[node] - cracks.nodes[cracks.segments[at, 1 - end]]
        row["direction"] = out / np.hypot(*out)
    rows["angle"], rows["k_eq"] = angle, k_eq
    return rows


def only(tips, *points):
    """Drive only the tips nearest to ``points``."""
    tips = tips.copy()
    chosen = [int(np.hypot(*(tips["point"] - p).T).argmin()) for p in points]
    tips["k_eq"] = np.where(np.isin(np.arange(len(tips)), chosen), tips["k_eq"], 0.0)
    return tips


def grow(cracks, tips, loops=SQUARE, settings=SETTINGS, cycle=3):
    growth = advance(cracks, lambda block: loops, tips, settings, np.ones(len(tips)), cycle)
    assert_sound(growth.cracks, {0: loops}, settings)
    return growth


def assert_sound(cracks, loops_of, settings):
    """A planar graph: found with Shapely's tree and predicates, of which the code under test uses nothing."""
    lines = shapely.linestrings(cracks.nodes[cracks.segments])
    size = max(1.0, np.ptp(cracks.nodes, axis=0).max())
    assert (np.sort(np.bincount(cracks.segments.ravel(), minlength=len(cracks.nodes))) > 0).all(), "an unused node"
    assert (cracks.lengths >= 0.999 * SLIVER * settings.min_increment).all(), "a sliver segment"
    pairs = np.sort(cracks.segments, axis=1)
    assert len(np.unique(pairs, axis=0)) == len(pairs), "a segment twice"
    i, j = shapely.STRtree(lines).query(lines, predicate="intersects")
    met = (i < j) & (cracks.block[i] == cracks.block[j])
    i, j = i[met], j[met]
    first, second = cracks.segments[i], cracks.segments[j]
    same = first[:, :, None] == second[:, None, :]
    assert (same.sum(axis=(1, 2)) == 1).all(), "segments meet without one common node"
    node = first[np.arange(len(i)), same.any(axis=2).argmax(axis=1)] if len(i) else np.empty(0, int)
    common = shapely.intersection(lines[i], lines[j])
    # Neighbours on a straight line may overlap by round-off.
    assert (shapely.length(common) < 1e-12 * size).all(), "segments overlap"
    beside = shapely.distance(common, shapely.points(cracks.nodes[node]))
    assert (beside < 1e-9 * size).all(), "segments cross beside their common node"
    own_block = np.zeros(len(cracks.nodes), int)
    own_block[cracks.segments] = cracks.block[:, None]
    for a, b in cKDTree(cracks.nodes).query_pairs(1e-9 * size):
        assert own_block[a] != own_block[b], f"nodes {a} and {b} in one place"
    for block, loops in loops_of.items():
        if not len(loops):
            continue
        rock = shapely.Polygon(loops[0], loops[1:])
        extent = np.ptp(loops[0], axis=0).max()
        mine = np.unique(cracks.segments[cracks.block == block])
        on_edge = shapely.distance(rock.boundary, shapely.points(cracks.nodes[mine]))
        assert (on_edge[cracks.surface[mine]] <= 1e-12 * extent).all(), "a mouth off the boundary"
        assert (on_edge[~cracks.surface[mine]] > 1e-9 * settings.min_increment).all(), "a node on the boundary unmarked"
        inside = lines[cracks.block == block]
        assert (shapely.length(shapely.difference(inside, rock)) < 1e-9 * extent).all(), "a crack outside the rock"


# -- single steps ------------------------------------------------------------------------------------------------------


def test_free_growth_follows_angle_and_drive():
    cracks = Cracks.from_polylines([[[-2, 0], [2, 0]]], names=["flaw"])
    tips = tips_of(cracks, angle=np.array([0.3, -0.3]), k_eq=np.array([1.5, 3.0]))
    growth = grow(cracks, tips)
    np.testing.assert_allclose(growth.grown, [0.5, 1.0], rtol=1e-15)
    after = growth.cracks
    assert after.segments.tolist() == [[2, 0], [0, 1], [1, 3]]  # keeps the crack's direction and order
    assert after.birth_cycle.tolist() == [3, 0, 3] and after.aperture.tolist() == [0, 0, 0]
    assert after.crack.tolist() == [0, 0, 0] and after.names == ("flaw",)
    heading = math.pi + 0.3
    np.testing.assert_allclose(after.nodes[2], [-2 + 0.5 * math.cos(heading), 0.5 * math.sin(heading)], atol=1e-15)
    np.testing.assert_allclose(after.nodes[3], [2 + math.cos(0.3), -math.sin(0.3)], atol=1e-15)
    assert growth.joins == ()


def test_tips_below_toughness_stand_and_increments_have_a_floor():
    cracks = Cracks.from_polylines([[[-2, 0], [2, 0]], [[-2, 5], [2, 5]]])
    tips = tips_of(cracks, k_eq=np.array([0.999, 1.0, 100.0, 0.0]))
    growth = grow(cracks, tips)
    np.testing.assert_allclose(growth.grown, [0, 0.1, 1.0, 0])
    nothing = advance(cracks, lambda b: SQUARE, tips_of(cracks, k_eq=0.5), SETTINGS, np.ones(4), 1)
    assert nothing.cracks is cracks and not nothing.grown.any()


@pytest.mark.parametrize(("gap", "steps", "length"), [(5.0, 0, 1.0), (5.0, 12, 5 / 12), (5.0, 4, 1.0), (0.7, 12, 0.1)])
def test_steps_are_shorter_near_another_crack(gap, steps, length):
    """So many to the nearest one, for the far tip too; no shorter than the floor. The other block's tip is not
    asked."""
    cracks = Cracks.from_polylines([[[-2, 0], [2, 0]], [[2 + gap, -3], [2 + gap, 3]], [[-2, 0.1], [2, 0.1]]])
    cracks = replace(cracks, block=np.array([0, 0, 1]))
    tips = only(tips_of(cracks), [-2, 0], [2, 0])
    growth = advance(cracks, lambda b: [], tips, replace(SETTINGS, approach_steps=steps), np.ones(len(tips)), 3)
    assert growth.grown[tips["k_eq"] > 0] == pytest.approx([length, length], rel=1e-12)


@pytest.mark.parametrize("first", [0, 1])
def test_the_most_driven_tip_goes_first_in_whatever_order_cracks_are_listed(first):
    """Two tips run at the same rock from two sides: where they meet does not depend on which crack is listed first."""
    lines = [np.array([[-3.0, 0.0], [-0.2, 0.0]]), np.array([[0.3, -3.0], [0.3, -0.4]])]
    cracks = Cracks.from_polylines([lines[first], lines[1 - first]], block=[0, 0])
    tips = only(tips_of(cracks), (-0.2, 0.0), (0.3, -0.4))
    tips["k_eq"][tips["k_eq"] > 0] = np.where(tips["point"][tips["k_eq"] > 0][:, 1] == 0.0, 1.5, 1.2)
    growth = grow(cracks, tips)
    ends = sorted(map(tuple, np.round(growth.cracks.nodes, 12).tolist()))
    (join,) = growth.joins
    # The tip at (−0.2, 0) runs 1 m on; the other one, which would be past (0.3, 0) by then, ends at its path.
    assert ends == [(-3.0, 0.0), (-0.2, 0.0), (0.3, -3.0), (0.3, -0.4), (0.3, 0.0), (0.8, 0.0)]
    assert join.point == pytest.approx((0.3, 0.0), abs=1e-12)


def test_aperture_and_law_are_kept_by_the_slot_and_its_halves():
    lines = [[[-2, 0], [2, 0]], [[0, 3], [0, 0.7]]]
    cracks = Cracks.from_polylines(lines, aperture=[math.inf, 1e-3], law=[1, 2])
    growth = grow(cracks, only(tips_of(cracks), (0, 0.7)))
    after = growth.cracks
    assert after.n_segments == 4
    halves = after.crack == 0
    assert halves.sum() == 2 and np.isinf(after.aperture[halves]).all() and (after.birth_cycle[halves] == 0).all()
    assert sorted(after.aperture[~halves].tolist()) == [0.0, 1e-3]
    np.testing.assert_array_equal(after.law, 1 + after.crack)  # grown segments have their crack's


def test_step_that_would_cross_a_face_stops_at_it():
    cracks = Cracks.from_polylines([[[-2, 0], [2, 0]], [[0.5, 3], [0.5, 0.7]]])
    growth = grow(cracks, only(tips_of(cracks), (0.5, 0.7)))
    (join,) = growth.joins
    assert (join.kind, join.crack, join.other_crack) == ("coalescence", 1, 0)
    assert join.point == pytest.approx((0.5, 0.0), abs=1e-15)
    assert growth.grown.max() == pytest.approx(0.7)
    junction = int(np.flatnonzero(growth.cracks.valence == 3)[0])
    np.testing.assert_allclose(growth.cracks.nodes[junction], [0.5, 0.0], atol=1e-15)
    assert len(growth.cracks.tips) == 3


def test_end_near_a_face_goes_to_it_and_prefers_its_tip():
    cracks = Cracks.from_polylines([[[-4, 0], [4, 0]], [[0.5, 3], [0.5, 1.3]]])
    growth = grow(cracks, only(tips_of(cracks), (0.5, 1.3)))
    assert growth.joins[0].point == pytest.approx((0.5, 0.0), abs=1e-15)
    near_tip = Cracks.from_polylines([[[-4, 0], [0.55, 0]], [[0.5, 3], [0.5, 1.3]]])
    growth = grow(near_tip, only(tips_of(near_tip), (0.5, 1.3)))
    assert growth.joins[0].point == (0.55, 0.0)
    assert growth.cracks.valence.max() == 2 and growth.cracks.n_segments == 3


@pytest.mark.parametrize("increment", [1.0, 0.25, 0.05])
def test_a_join_length_holds_for_every_increment(increment):
    """A tip passes a face in front of it at 0.8 after its step: it goes there where the join length is 1, else on."""
    wall = np.array([[increment + 0.8, -3.0], [increment + 0.8, 3.0]])
    cracks = Cracks.from_polylines([np.array([[-2.0, 0.0], [0.0, 0.0]]), wall])
    for length, joins in ((1.0, 1), (0.5, 0)):
        settings = GrowthSettings(increment=increment, min_increment=0.1 * increment, join_length=length)
        growth = grow(cracks, only(tips_of(cracks), (0.0, 0.0)), settings=settings)
        assert len(growth.joins) == joins
        assert growth.grown.max() == pytest.approx(increment + 0.8 if joins else increment)


def test_what_is_not_near_or_not_ahead_is_left_alone():
    cracks = Cracks.from_polylines([[[-4, 0], [4, 0]], [[0.5, 3], [0.5, 1.6]]])
    assert grow(cracks, only(tips_of(cracks), (0.5, 1.6))).joins == ()
    # It grows away from a crack that its end is still near to.
    away = Cracks.from_polylines([[[-4, 0], [4, 0]], [[-1, 1.6], [0.5, 0.3]]])
    tips = only(tips_of(away, angle=math.radians(110)), (0.5, 0.3))
    growth = grow(away, tips)
    assert growth.joins == () and growth.grown.max() == 1.0


def test_near_face_behind_another_is_not_reached():
    cracks = Cracks.from_polylines([[[-4, 0], [4, 0]], [[-4, 0.2], [4, 0.2]], [[0.5, 3], [0.5, 1.3]]])
    growth = grow(cracks, only(tips_of(cracks), (0.5, 1.3)))
    assert growth.joins[0].other_crack == 1


def test_daylighting_is_exactly_on_the_edge():
    loops = [np.array([[0.0, 0.0], [7.0, 1.3], [9.1, 8.2], [-1.0, 6.0]])]
    cracks = Cracks.from_polylines([[[3.0, 4.0], [3.37, 1.2]]])
    growth = grow(cracks, only(tips_of(cracks), (3.37, 1.2)), loops)
    (join,) = growth.joins
    assert join.kind == "daylighting" and join.other_crack == -1
    after = growth.cracks
    (mouth,) = np.flatnonzero(after.surface)
    a, b = loops[0][0], loops[0][1]
    off = np.cross(np.append(b - a, 0), np.append(after.nodes[mouth] - a, 0))[2] / np.hypot(*(b - a))
    assert abs(off) < 1e-15 * 10
    assert mouth not in after.tips and len(after.tips) == 1


def test_hole_and_corner():
    hole = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
    cracks = Cracks.from_polylines([[[4.0, 0.2], [1.6, 0.2]]])
    growth = grow(cracks, only(tips_of(cracks), (1.6, 0.2)), [*SQUARE, hole])
    assert growth.joins[0].kind == "daylighting"
    assert growth.joins[0].point == pytest.approx((1.0, 0.2), abs=1e-15)
    diagonal = Cracks.from_polylines([[[4.0, 4.003], [1.3, 1.303]]])
    growth = grow(diagonal, only(tips_of(diagonal), (1.3, 1.303)), [*SQUARE, hole])
    assert growth.joins[0].point == (1.0, 1.0)


def test_a_mouth_that_is_there_is_used_again():
    cracks = Cracks.from_polylines(
        [[[0.0, -10.0], [0.0, -8.0]], [[0.3, -7.0], [0.02, -9.5]]], surface=[(True, False), (False, False)]
    )
    growth = grow(cracks, only(tips_of(cracks, angle=np.array([0, 0, 0.0])), (0.02, -9.5)))
    assert growth.joins and growth.joins[0].other_crack == 0
    assert growth.cracks.surface.sum() == 1


def one_node_a_place(cracks):
    _, first, number = np.unique(cracks.nodes, axis=0, return_index=True, return_inverse=True)
    segments = number.reshape(-1)[cracks.segments]
    return replace(cracks, nodes=cracks.nodes[first], segments=segments, surface=cracks.surface[first])


def pieces_of(cracks, loop=SQUARE[0]):
    """What the cracks cut the square into, by Shapely."""
    edges = [shapely.LinearRing(loop), *shapely.linestrings(cracks.nodes[cracks.segments])]
    return shapely.get_parts(shapely.polygonize(shapely.get_parts(shapely.node(shapely.union_all(edges)))))


@pytest.mark.parametrize("mouth", [(0.0, -10.0), (10.0, -10.0)])
@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("third", [False, True])
def test_a_ring_that_closes_through_a_mouth_gets_two(mouth, flip, third):
    """Two cracks from one point of the boundary, the end of one growing into the other: the piece would touch the
    boundary at that point, and the rock around it hang by it. With a third one beside them it is the other mouth that
    moves."""
    way = np.array([[-0.5, 3.0], [-3.0, 3.0], [-2.0, 1.3]])
    lines = [mouth + np.array([[0.0, 0.0], [-4.0, 2.0]]), mouth + np.array([[0.0, 0.0], *way])]
    if third:
        lines.append(mouth + np.array([[0.0, 0.0], [-4.0, 1.0] if mouth[0] else [3.0, 1.0]]))
    lines = [line[::-1] for line in lines] if flip else lines
    surface = [(not flip, flip)] * len(lines)
    cracks = one_node_a_place(Cracks.from_polylines(lines, surface=surface))
    tips = only(tips_of(cracks), mouth + way[-1])
    growth = grow(cracks, tips)
    assert [join.kind for join in growth.joins] == ["coalescence"]
    assert growth.cracks.surface.sum() == 2
    found = np.array(sorted(growth.cracks.nodes[growth.cracks.surface].tolist()))
    assert np.hypot(*(found[1] - found[0])) == pytest.approx(SLIVER * SETTINGS.min_increment, rel=1e-9)
    pieces = pieces_of(growth.cracks)
    assert len(pieces) == 2 and not any(len(piece.interiors) for piece in pieces)
    assert sum(piece.area for piece in pieces) == pytest.approx(400.0, rel=1e-12)


def test_a_tip_that_comes_back_to_its_own_mouth_ends_beside_it():
    line = np.array([[0.0, -10.0], [0.0, -7.0], [-2.0, -7.0], [-0.6, -9.4]])
    cracks = Cracks.from_polylines([line], surface=[(True, False)])
    tips = tips_of(cracks)
    tips["angle"] = np.arctan2(-0.6, 0.6) - np.arctan2(-2.4, 1.4)
    growth = grow(cracks, tips)
    assert [join.kind for join in growth.joins] == ["daylighting"]
    assert sorted(growth.cracks.nodes[growth.cracks.surface][:, 0]) == pytest.approx(
        [-SLIVER * SETTINGS.min_increment, 0.0]
    )
    pieces = pieces_of(growth.cracks)
    assert len(pieces) == 2 and not any(len(piece.interiors) for piece in pieces)


def test_tips_that_face_each_other_meet_half_way():
    cracks = Cracks.from_polylines([[[-5, 0], [-0.6, 0]], [[0.6, 0.0], [5, 0.0]]])
    growth = grow(cracks, only(tips_of(cracks), (-0.6, 0), (0.6, 0)))
    (join,) = growth.joins
    assert join.kind == "coalescence" and join.point == pytest.approx((0, 0), abs=1e-15)
    np.testing.assert_allclose(growth.grown, [0, 0.6, 0.6, 0])
    assert len(growth.cracks.tips) == 2 and growth.cracks.valence.max() == 2


def test_steps_that_cross_meet_where_they_cross():
    cracks = Cracks.from_polylines([[[-4, -1], [-0.6, -0.15]], [[0.6, -0.15], [4, -1]]])
    growth = grow(cracks, only(tips_of(cracks), (-0.6, -0.15), (0.6, -0.15)))
    (join,) = growth.joins
    assert join.point == pytest.approx((0, 0), abs=1e-12)


def test_en_echelon_tips_pass_each_other():
    cracks = Cracks.from_polylines([[[-5, 0], [0.2, 0]], [[-0.2, 0.9], [5, 0.9]]])
    growth = grow(cracks, only(tips_of(cracks), (0.2, 0), (-0.2, 0.9)))
    assert growth.joins == () and len(growth.cracks.tips) == 4


def test_own_neighbours_are_not_joined_but_a_true_crossing_is():
    hook = Cracks.from_polylines([[[0, 0], [4, 0], [4, 2], [1.5, 2], [1.5, 0.6]]])
    growth = grow(hook, only(tips_of(hook), (1.5, 0.6)))
    assert growth.joins[0].kind == "self"
    assert growth.joins[0].point == pytest.approx((1.5, 0), abs=1e-15)
    bend = Cracks.from_polylines([[[0, 0], [3, 0], [3.2, 0.3]]])
    assert grow(bend, only(tips_of(bend, angle=np.array([0, 1.2])), (3.2, 0.3))).joins == ()


def test_a_touching_tip_is_not_joined_unless_it_goes_through():
    cracks = Cracks.from_polylines([[[-4, 0], [4, 0]], [[0.5, 3], [0.5, 0.0]]])
    tips = only(tips_of(cracks), (-4, 0))
    growth = advance(cracks, lambda b: SQUARE, tips, SETTINGS, np.ones(len(tips)), 1)
    assert growth.joins == () and growth.cracks.n_segments == 3
    through = only(tips_of(cracks), (0.5, 0.0))
    growth = grow(cracks, through)
    assert growth.joins[0].kind == "coalescence"
    assert growth.cracks.n_segments == 3 and growth.cracks.valence.max() == 3


def test_a_tip_almost_there_is_drawn_on_without_a_sliver():
    cracks = Cracks.from_polylines([[[-4, 0], [4, 0]], [[0.5, 3], [0.5, 0.004]]])
    growth = grow(cracks, only(tips_of(cracks), (0.5, 0.004)))
    assert growth.cracks.n_segments == 3 and growth.grown.max() == pytest.approx(0.004)
    onto_tip = Cracks.from_polylines([[[-4, 0], [0.5, 0]], [[0.5, 3], [0.5, 0.004]]])
    growth = grow(onto_tip, only(tips_of(onto_tip), (0.5, 0.004)))
    assert growth.cracks.n_segments == 2 and len(growth.cracks.nodes) == 3
    onto_edge = Cracks.from_polylines([[[0.5, 3], [0.5, -9.996]]])
    growth = grow(onto_edge, only(tips_of(onto_edge), (0.5, -9.996)))
    assert growth.cracks.n_segments == 1 and growth.cracks.surface.tolist() == [False, True]


def test_infinite_plane_and_other_blocks():
    cracks = Cracks.from_polylines([[[-4, 0], [4, 0]], [[0.5, 3], [0.5, 0.7]]], block=[0, 1])
    tips = only(tips_of(cracks), (0.5, 0.7))
    growth = advance(cracks, lambda b: NO_LOOPS, tips, SETTINGS, np.ones(len(tips)), 1)
    assert growth.joins == () and growth.grown.max() == 1.0
    assert_sound(growth.cracks, {}, SETTINGS)


def test_bad_tips_are_refused():
    cracks = Cracks.from_polylines([[[0, 0], [1, 0], [2, 0]]])
    tips = tips_of(cracks)
    middle = tips.copy()
    middle["node"] = 1
    with pytest.raises(ValueError, match="not a tip"):
        advance(cracks, lambda b: [], middle, SETTINGS, np.ones(2), 1)
    tips["angle"] = np.nan
    with pytest.raises(ValueError, match="is not finite"):
        advance(cracks, lambda b: [], tips, SETTINGS, np.ones(2), 1)


# -- random networks ---------------------------------------------------------------------------------------------------


def random_network(rng):
    """A few cracks that neither cross nor come near each other, in one of three bodies (or an infinite plane)."""
    kind = rng.integers(4)
    angle = np.sort(rng.uniform(0, 2 * math.pi, 9))
    star = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(8, 12, (9, 1))
    hole = np.array([[-1.5, -1.0], [-1.0, 1.5], [1.2, 1.0], [1.0, -1.3]])
    loops = [NO_LOOPS, SQUARE, [*SQUARE, hole], [star]][kind]
    rock = shapely.Polygon(loops[0], loops[1:]) if loops else shapely.box(-8, -8, 8, 8)
    if not rock.is_valid or shapely.Polygon(star).area < 100:
        rock, loops = shapely.Polygon(SQUARE[0]), SQUARE
    room, lines = rock.buffer(-0.3), []
    for _ in range(60):
        at, turn, half = rng.uniform(-9, 9, 2), rng.uniform(0, math.pi), rng.uniform(0.3, 2.5)
        d = half * np.array([math.cos(turn), math.sin(turn)])
        line = shapely.LineString([at - d, at + d])
        if room.contains(line) and all(line.distance(other) > 0.2 for other in lines):
            lines.append(line)
        if len(lines) == rng.integers(2, 9):
            break
    return Cracks.from_polylines([np.array(line.coords) for line in lines]), loops


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(k, marks=pytest.mark.slow) for k in range(3, 40))])
def test_random_networks_stay_sound(seed):
    """45 networks (600 with the slow ones) grown by random walks until nothing moves: every invariant holds at every
    increment."""
    rng = np.random.default_rng(seed)
    kinds = set()
    for _ in range(15):
        cracks, loops = random_network(rng)
        join = rng.choice([0.2, 0.5, 1.0])
        settings = GrowthSettings(increment=rng.choice([0.3, 1.0]), min_increment=0.05, join_distance=join)
        turn = rng.choice([0.2, 0.6, 1.5])
        for cycle in range(1, 26):
            n = len(cracks.tips)
            if not n:
                break
            tips = tips_of(cracks, rng.normal(0, turn, n).clip(-2.4, 2.4), rng.uniform(0.5, 4, n))
            before = cracks
            growth = advance(cracks, lambda b, loops=loops: loops, tips, settings, np.ones(n), cycle)
            cracks = growth.cracks
            assert_sound(cracks, {0: loops}, settings)
            kinds |= {join.kind for join in growth.joins}
            assert (growth.grown[tips["k_eq"] < 1] == 0).all()
            assert (growth.grown <= settings.increment * (1 + join) + 1e-9).all()
            # What was there stays there: total length grows by exactly what the tips grew.
            sliver = SLIVER * settings.min_increment
            if not (growth.grown[growth.grown > 0] < sliver).any():
                # Where cracks close a ring through one mouth, it is parted by up to that along the surface.
                parted = len(growth.joins) - len({join.point for join in growth.joins})
                expected = before.lengths.sum() + growth.grown.sum()
                assert cracks.lengths.sum() == pytest.approx(expected, rel=1e-12, abs=parted * sliver)
            assert cracks.tips.size <= n
            if not loops and not growth.joins:
                assert cracks.tips.size == n
    assert kinds >= {"coalescence"}


def test_growth_is_deterministic():
    rng = np.random.default_rng(5)
    cracks, loops = random_network(rng)
    tips = tips_of(cracks, rng.normal(0, 0.3, len(cracks.tips)))
    runs = [advance(cracks, lambda b: loops, tips, SETTINGS, np.ones(len(tips)), 1) for _ in range(2)]
    assert runs[0].cracks.nodes.tobytes() == runs[1].cracks.nodes.tobytes()
    assert runs[0].joins == runs[1].joins


def test_a_crack_that_the_tip_has_come_past_does_not_draw_it_back():
    """From just beside a crack away from it at 45°: the end is within reach of the crack (0.42 of 0.5), but the way
    leads off it."""
    cracks = Cracks.from_polylines([[[-3.0, 0.0], [3.0, 0.0]], [[-2.0, 1.0], [0.0, 0.02]]])
    tips = only(tips_of(cracks), (0.0, 0.02))
    way = np.array([2.0, -0.98])
    tips["angle"] = np.radians(45) - np.arctan2(way[1], way[0])
    growth = grow(cracks, tips, settings=GrowthSettings(increment=0.6, min_increment=0.06, join_distance=0.75))
    assert growth.joins == ()
    assert growth.cracks.nodes[-1] == pytest.approx([0.6 * np.sqrt(0.5), 0.02 + 0.6 * np.sqrt(0.5)])


@pytest.mark.parametrize("degrees", [0.5, 2.0, 4.0])
def test_a_way_along_a_crack_goes_straight_across_to_it(degrees):
    """Where a block parts along a crack its junctions become mouths, which no body can have at less than 3°."""
    depth = 0.9 * np.sin(np.radians(degrees))
    cracks = Cracks.from_polylines([[[-3.0, 0.0], [3.0, 0.0]], [[-1.0, 1.0], [0.0, depth]]])
    tips = only(tips_of(cracks), (0.0, depth))
    way = np.array([1.0, depth - 1.0])
    tips["angle"] = np.radians(-degrees) - np.arctan2(way[1], way[0])
    growth = grow(cracks, tips)
    assert [join.kind for join in growth.joins] == ["coalescence"]
    assert growth.joins[0].point == pytest.approx((0.0, 0.0), abs=1e-12)
