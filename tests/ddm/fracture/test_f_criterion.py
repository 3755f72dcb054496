"""Kinks that are tried: in the limit those of no length, and shear cracks where wings are pressed shut."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.fracture.criteria import CRITERIA
from geomech.ddm.fracture.f_criterion import DIRECTIONS, driven
from geomech.model import Cracks, GrowthSettings, JointLaw, Material

ROCK = Material("rock", 17e9, 0.21, k_ic=1e6, k_iic=2e6)
HALF = 10e-3
LAW = [JointLaw("flaw", friction_angle=math.atan(0.3))]


def flaw(degrees=55):
    end = HALF * np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    return Cracks.from_polylines([[-end, end]])


def pressed(confinement):
    return ddm.BodyLoad(remote_stress=[-30e6 * confinement, -30e6, 0.0])


def test_short_kinks_are_those_of_no_length():
    """A kink of a thousandth of the crack under mixed load and under compression against the expansion of Amestoy &
    Leblond (1992): what its length adds is of the order of √(1/1000), and a parabola over 10° costs a fraction of a
    degree."""
    opened = Cracks.from_polylines([[[-HALF, 0.0], [HALF, 0.0]]], aperture=math.inf)
    for cracks, load in ((opened, ddm.BodyLoad(remote_stress=[0, 1e6, 0.7e6])), (flaw(), pressed(0.0))):
        solution = ddm.Body([], cracks, ROCK, face_laws=LAW).solve(load)
        expected = CRITERIA["f"](solution.tips["k_i"], solution.tips["k_ii"], ROCK)
        angle, k_eq = driven(solution, 1e-3 * HALF, ROCK)
        np.testing.assert_allclose(k_eq, expected[1], rtol=0.04)
        np.testing.assert_allclose(angle, expected[0], atol=math.radians(2))


@pytest.mark.slow
def test_confined_cracks_grow_in_shear():
    """A closed crack with friction at 55°, σ3/σ1 = 0.2: kinks of no length make wings, at 76°; those of a tenth of
    the crack's half are pressed shut and go straight on, driven by shear, at a K_eq that is K_II K_Ic/K_IIc (growth
    ahead keeps K_II to some 10 %). Without confinement wings open all the same. Growth does as the criterion says,
    and reuses the trials of a geometry for all loads."""
    load = pressed(0.2)
    solution = ddm.Body([], flaw(), ROCK, face_laws=LAW).solve(load)
    wings, _ = CRITERIA["f"](solution.tips["k_i"], solution.tips["k_ii"], ROCK)
    assert np.degrees(np.abs(wings)) == pytest.approx(76.5, abs=1)
    angle, k_eq = driven(solution, 0.1 * HALF, ROCK)
    assert (np.degrees(np.abs(angle)) < 6).all()
    np.testing.assert_allclose(k_eq, np.abs(solution.tips["k_ii"]) / 2, rtol=0.1)
    free = ddm.Body([], flaw(), ROCK, face_laws=LAW).solve(pressed(0.0))
    assert (np.degrees(np.abs(driven(free, 0.1 * HALF, ROCK)[0])) > 50).all()
    bodies = solution.body.work.bodies
    assert bodies == 1 + len(DIRECTIONS)
    driven(solution.body.solve(pressed(0.3)), 0.1 * HALF, ROCK)
    assert solution.body.work.bodies == bodies
    growth = GrowthSettings("f", increment=1e-3, min_increment=1e-3, trial_kink=1e-3, correct=False)
    steps = list(ddm.propagate([], flaw(), ROCK, load, growth, control="toughness", max_steps=3, face_laws=LAW))
    ends = steps[-1].cracks.nodes[steps[-1].cracks.tips]
    assert (np.abs(np.degrees(np.arctan2(ends[:, 1], ends[:, 0])) % 180 - 55) < 2).all()


def test_tips_without_room_are_judged_by_kinks_of_no_length():
    """The right tip is nearer to a side than a kink is long; the left one has room, and a fluid's pressure by
    segments."""
    block = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    cracks = Cracks.from_polylines([[[0.5, 0.1], [0.96, 0.0]]], aperture=math.inf)
    load = ddm.BodyLoad(sides={0: (0.0, -1e6), 2: (0.0, 1e6)}, crack_pressure=[1e5])
    solution = ddm.Body([block], cracks, ROCK).solve(load)
    angle, k_eq = driven(solution, 0.05, ROCK)
    zero = CRITERIA["f"](solution.tips["k_i"], solution.tips["k_ii"], ROCK)
    assert (angle[1], k_eq[1]) == (zero[0][1], zero[1][1])
    assert angle[0] != zero[0][0] and k_eq[0] == pytest.approx(zero[1][0], rel=0.2)


def test_what_trial_kinks_cannot_do_is_refused():
    for growth, message in (
        (GrowthSettings("mts", trial_kink=1e-3), 'the criterion "f", not'),
        (GrowthSettings("f", trial_kink=-1.0), "trial_kink must be a length"),
        (GrowthSettings("x"), "no growth criterion 'x'"),
    ):
        with pytest.raises(ValueError, match=message):
            ddm.propagate([], flaw(), ROCK, pressed(0.0), growth)
