"""Where two outcomes are equally near in exact arithmetic, rounding does not choose between them.

Each case is computed on inputs that are off by a few last digits to either side, as other orders of summation leave
them, and must have one outcome.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from geomech.ddm import Body, BodyLoad
from geomech.ddm.fracture import criteria, f_criterion
from geomech.ddm.growth import initiation
from geomech.ddm.growth.initiation import overstress
from geomech.ddm.growth.path_correction import Chords, Memory
from geomech.ddm.growth.tie_tolerance import best, in_order, reached
from geomech.ddm.growth.tip_advance import advance
from geomech.model import TIP, Cracks, DdmSettings, GrowthSettings, Material

pytestmark = pytest.mark.other_machines

ROCK = Material("rock", 17e9, 0.21, 2200.0, 1e6)
#: Last digits of numbers of order one, of either sign.
OFF = (0.0, 1e-14, -1e-14, 1e-12, -1e-12)
SETTINGS = GrowthSettings(increment=1.0, min_increment=0.1, join_distance=0.5)


def turned(points, angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points) @ np.array([[c, s], [-s, c]])


def tips_of(cracks, angle=0.0, k_eq=1.0):
    """TIP rows for every tip of the network."""
    rows = np.zeros(len(cracks.tips), TIP)
    rows["node"] = cracks.tips
    for row, node in zip(rows, cracks.tips):
        ((at, end),) = np.argwhere(cracks.segments == node)
        row["crack"], row["point"] = cracks.crack[at], cracks.nodes[node]
        out = cracks.nodes[node] - cracks.nodes[cracks.segments[at, 1 - end]]
        row["direction"] = out / np.hypot(*out)
    rows["angle"], rows["k_eq"] = angle, k_eq
    return rows


def grow(lines, loops=(), driven=None, angle=0.0, settings=SETTINGS, surface=None):
    """The growth of the tips ``driven`` (default: all)."""
    cracks = Cracks.from_polylines([np.asarray(line, dtype=float) for line in lines], surface=surface)
    tips = tips_of(cracks, angle)
    if driven is not None:
        tips["k_eq"][np.setdiff1d(np.arange(len(tips)), driven)] = 0.0
    return advance(cracks, lambda block: list(loops), tips, settings, np.ones(len(tips)), 1)


def outcome(growth):
    """All of a growth that is a choice, and its lengths and places to nine digits."""
    joins = [(join.kind, join.tip_node, join.crack, join.other_crack) for join in growth.joins]
    at = np.round(np.concatenate([growth.grown, growth.cracks.nodes.ravel()]), 9) + 0.0
    return joins, growth.cracks.segments.tolist(), growth.cracks.surface.tolist(), at.tolist()


def the_one(outcomes):
    first, *others = outcomes
    for other in others:
        assert other == first
    return first


# -- lengths ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.1])
@pytest.mark.parametrize(("left", "joins"), [(1.5, 0), (1.0, 1), (2.0, 0), (1.499, 1), (1.501, 0), (0.5, 1)])
def test_a_ligament_that_is_a_multiple_of_the_increment(angle, left, joins):
    """An increment of 1 and a join distance of 0.5: with 1.5 left the tip ends just as far from the edge as would be
    near, and is left in the rock."""
    square = [[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]]
    found = []
    for off in OFF:
        line = [[0.0, 0.1], [4.0 - left + off, 0.1]]
        growth = grow([turned(line, angle)], [turned(square, angle)], driven=[1])
        found.append((len(growth.joins), round(float(growth.grown[1]), 9)))
    assert the_one(found) == (joins, left if joins else 1.0)


@pytest.mark.parametrize("increment", [0.1, 0.3, 0.7])
def test_increments_that_add_up_to_the_ligament(increment):
    """Steps of 0.1 are summed, to 0.7999999999999999 after eight: the eighth of 8.5 steps leaves half a step, which is
    not near, and the ninth crosses."""
    settings = replace(SETTINGS, increment=increment, min_increment=0.1 * increment)
    edge = 8.5 * increment
    loop = np.array([[-1.0, -9.0], [edge, -9.0], [edge, 9.0], [-1.0, 9.0]])
    cracks = Cracks.from_polylines([np.array([[-0.5, 0.0], [0.0, 0.0]])])
    grown = []
    while not len(grown) or cracks.tips.size == 2:
        tips = tips_of(cracks)
        tips["k_eq"][tips["point"][:, 0] < -0.4] = 0.0
        growth = advance(cracks, lambda block: [loop], tips, settings, np.ones(2), len(grown) + 1)
        grown.append(growth.grown.max() / increment)
        cracks = growth.cracks
    assert grown == pytest.approx([1.0] * 8 + [0.5], rel=1e-9)


@pytest.mark.parametrize(("gap", "joins"), [(2.5, 0), (2.499, 1), (2.0, 1)])
def test_tips_that_come_towards_each_other(gap, joins):
    """Two steps of 1 and a join distance of 0.5 fill a gap of 2.5, and no more; those that meet do so in the middle,
    though the two lines, which are one, cross anywhere by rounding."""
    found = []
    for off in OFF:
        for turn in OFF:
            lines = [[[-5.0, 0.0], [-0.5 * gap, 0.0]], [[0.5 * gap + off, 0.3 * off], [5.0, 0.0]]]
            growth = grow(lines, driven=[1, 2], angle=np.array([0.0, turn, -0.7 * turn, 0.0]))
            found.append((len(growth.joins), *(round(float(way), 9) for way in growth.grown)))
    way = 0.5 * gap if joins else 1.0
    assert the_one(found) == (joins, 0.0, way, way, 0.0)


def test_a_tip_that_two_others_are_as_near_to_is_met_by_the_first():
    """One tip between two, at the same distance: whichever the digits say is nearer, the first pair in the list."""
    found = []
    for off in OFF:
        lines = [[[-4.0, 0.0], [-1.0, 0.0]]]
        lines += [[[1.0 + side * off, side * 0.8], [4.0, side * 3.2]] for side in (1.0, -1.0)]
        growth = grow(lines, driven=[1, 2, 4])
        found.append((growth.joins[0].crack, growth.joins[0].other_crack, len(growth.joins)))
    assert the_one(found)[:2] == (0, 1)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.1])
def test_a_tip_that_runs_along_a_surface_goes_on(angle):
    """It comes no nearer, so that the surface does not draw it, however near it is."""
    square = [[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]]
    line = [[-3.0, 3.6], [-1.0, 3.6]]
    found = [outcome(grow([turned(line, angle)], [turned(square, angle)], driven=[1], angle=off))[:3] for off in OFF]
    assert the_one(found)[0] == []


def test_faces_and_nodes_as_far_off_as_one_another():
    """A tip that ends in the middle between two cracks joins the first in the list, and of two nodes of one face the
    first."""
    found = []
    for off in OFF:
        beside = [[[1.2, side * 0.4 + off], [3.0, side * 0.4]] for side in (1.0, -1.0)]
        found.append(outcome(grow([[[-2.0, 0.0], [0.0, 0.0]], *beside], driven=[1]))[0])
    assert the_one(found) == [("coalescence", 1, 0, 1)]


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.1])
def test_a_step_that_ends_at_a_corner_or_a_mouth(angle):
    """The edges of a corner, and the crack and the edge at a mouth, are met at once: the corner, and the mouth, are
    joined."""
    square = np.array([[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]])
    corner, mouth = [], []
    for off in OFF:
        growth = grow([turned([[0.0, 0.0], [3.6, 3.6 + off]], angle)], [turned(square, angle)], driven=[1])
        corner.append(outcome(growth))
        lines = [turned([[4.0, 1.0], [2.5, 2.5]], angle), turned([[0.0, 0.0], [3.6, 0.9 + off]], angle)]
        growth = grow(lines, [turned(square, angle)], driven=[2], surface=[(True, False), (False, False)])
        mouth.append(outcome(growth))
    assert [join[0] for join in the_one(corner)[0]] == ["daylighting"]
    joins, segments, surface, _ = the_one(mouth)
    assert [join[3] for join in joins] == [0] and sum(surface) == 1 and len(segments) == 3


# -- drives and directions -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("k_ic", [1.0, 0.7e6])
def test_tips_at_their_toughness_grow_together(k_ic):
    for off in OFF:
        cracks = Cracks.from_polylines([np.array([[-1.0, 0.0], [1.0, 0.0]])])
        tips = tips_of(cracks, k_eq=np.array([k_ic * (1 + off), k_ic * (1 - off)]))
        growth = advance(cracks, lambda block: [], tips, SETTINGS, np.full(2, k_ic), 1)
        assert growth.grown == pytest.approx([1.0, 1.0], rel=1e-9)
        tips["k_eq"] *= 1 - 1e-6
        assert not advance(cracks, lambda block: [], tips, SETTINGS, np.full(2, k_ic), 1).grown.any()


@pytest.mark.parametrize("name", criteria.CRITERIA)
def test_a_tip_without_shear_has_one_direction(name):
    """In compression a slot's K_I is negative, and by the F-criterion it shears to either side alike: it goes to the
    left, whatever K_II's sign is by rounding."""
    weak = replace(ROCK, k_iic=0.5e6)
    for k_i in (1e6, -1e6):
        k_ii = k_i * np.array(OFF)
        angle, k_eq = criteria.CRITERIA[name](np.full(len(OFF), k_i), k_ii, weak)
        assert k_eq == pytest.approx(np.full(len(OFF), k_eq[0]), rel=1e-9, abs=1e-3)
        drives = k_eq > 1e-3
        assert angle[drives] == pytest.approx(np.full(drives.sum(), angle[0]), abs=1e-9)
        if name == "f" and k_i < 0:
            assert drives.all() and angle[0] > math.radians(30)


def test_trial_kinks_to_either_side_as_good():
    """Two maxima, images of one another: that to the left."""
    turn = f_criterion.DIRECTIONS
    value = np.cos(3 * (np.abs(turn) - math.radians(60.0))) + 1
    for off in OFF:
        angle, _ = f_criterion._largest((value * (1 + off * np.sign(turn)))[:, None], ROCK)
        assert angle == pytest.approx([math.radians(60.0)], abs=1e-9)


def test_stress_alike_in_all_directions_has_one_direction():
    stress = np.array([[-1e6 * (1 + off), -1e6, 1e6 * other] for off in OFF for other in OFF])
    assert not overstress(stress, replace(ROCK, tensile_strength=1e6, cohesion=1e6, friction_angle=0.5))[2].any()


def test_halves_of_a_crack_have_as_many_elements():
    """2½ of five each, by halves whose lengths are one but for rounding."""
    settings = DdmSettings(elements_per_crack=5)
    for off in OFF:
        cracks = Cracks.from_polylines([np.array([[-1.0, 0.0], [off, 0.0], [1.0, 0.0]])])
        middle = Body([], cracks, ROCK, settings).faces.nodes.mean(axis=1)[:, 0]
        assert np.sort(middle) == pytest.approx(-np.sort(middle)[::-1], abs=1e-9)


def test_births_as_far_apart_as_the_spacing():
    """A square that is pulled evenly, 6 by 6 spacings: cracks are looked for in the middle of each."""
    strong = replace(ROCK, tensile_strength=1e6)
    settings = GrowthSettings(increment=0.01, initiation="everywhere", initiation_spacing=0.1)
    found = []
    for off in OFF:
        side = 0.6 * (1 + off)
        loop = np.array([[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]])
        ends = loop[[[1, 2], [3, 0]]]
        load = BodyLoad(segments=ends, tractions=np.array([[[1e6, 0.0]] * 2, [[-1e6, 0.0]] * 2]))
        solution = Body([loop], Cracks.from_polylines([]), strong).solve(load)
        born = [birth for birth in initiation._candidates(solution, strong, settings) if birth.place == "rock"]
        assert all(birth.end[1] > birth.start[1] for birth in born)
        found.append(len(born))
    assert the_one(found) == 36


def test_a_path_that_goes_straight_on_tells_nothing_of_the_next():
    """In a straight path the tangent and the turn ahead are rounding, and so is what one is of the other."""
    cracks = Cracks.from_polylines([np.array([[-1.0, 0.0], [0.0, 0.0]])])
    for start in OFF:
        for turn in OFF:
            tips = tips_of(cracks)[1:]
            tips["angle"] = start
            chords, memory = Chords(tips), Memory()
            growth = advance(cracks, lambda block: [], tips, SETTINGS, np.ones(1), 1)
            ahead = tips_of(growth.cracks, turn)
            assert chords.bend(tips, growth.grown, ahead, growth.cracks, 1)
            chords.remember(memory, tips, growth, 1)
            (told,) = memory.values()
            assert math.isnan(told.kappa) and abs(told.angle) < 1e-11


def test_tips_that_stand_keep_their_direction_while_others_are_bent():
    """Beside a tip whose path turns by so much that it is looked at twice, the other one stands, without a shear to
    turn it."""
    cracks = Cracks.from_polylines([np.array([[-1.0, 0.0], [0.0, 0.0]])])
    for off in OFF:
        tips = tips_of(cracks, angle=np.array([off, 0.1]), k_eq=np.array([0.0, 1.0]))
        chords, turn, looks = Chords(tips), 0.5, 0
        settled = False
        while not settled:
            growth = advance(cracks, lambda block: [], tips, SETTINGS, np.ones(2), 1)
            ahead = tips_of(growth.cracks, np.array([off, turn - (tips["angle"][1] - 0.1)]))
            settled = chords.bend(tips, growth.grown, ahead, growth.cracks, 1)
            looks += 1
        assert looks > 1 and tips["angle"][0] == off and tips["angle"][1] > 0.2


# -- the rules themselves --------------------------------------------------------------------------------------------


def test_the_order_of_what_is_alike_is_that_given():
    for off in OFF:
        assert in_order([2.0, 1.0 + off, 1.0, 3.0, 1.0 - off, 2.0 - off], 1e-9) == [1, 2, 4, 0, 5, 3]
        assert reached(1.0 + off, 1.0) and not reached(1.0 - 1e-8, 1.0)
        assert best(np.array([1.0 + off, 0.5, 1.0]), np.array([-1.0, 0.0, 1.0])) == 2
        assert best(np.array([1.0 + off, 1.0, 1.0]), np.array([-1.0, 0.0, 1.0])) == 1
