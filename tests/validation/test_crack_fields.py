"""Stress and displacement about a crack, point by point, against Westergaard's and Williams' fields."""

import math

import numpy as np

from geomech import ddm
from geomech.model import Cracks, DdmSettings, Material
from geomech.reference import crack_fields

ROCK = Material("rock", youngs_modulus=17e9, poissons_ratio=0.21)
REMOTE = np.array([0.3e6, 1e6, 0.4e6])
AWAY = np.array([[0.3, 0.4], [-1.5, 0.2], [0.0, -0.7], [1.3, 0.0], [2.0, -3.0], [-40.0, 25.0]])
ON_THE_FACE = np.array([[0.31, 0.0], [-0.2, 0.0], [0.55, 0.0]])


def solution(**settings):
    crack = Cracks.from_polylines([np.array([[-1.0, 0.0], [1.0, 0.0]])], aperture=math.inf)
    return ddm.Body([], crack, ROCK, DdmSettings(**settings)).solve(ddm.BodyLoad(remote_stress=REMOTE))


def exact(points):
    return crack_fields.griffith_field(points, 1.0, REMOTE, ROCK.shear_modulus, ROCK.poissons_ratio)


def test_tip_field_is_the_limit_of_the_whole_field():
    """Williams' singular part beside Westergaard: what is left is T and O(√r), 3e-4 of the largest at r = 1e-8."""
    r, q = np.full(7, 1e-8), np.linspace(-3, 3, 7)
    points = np.column_stack([1 + r * np.cos(q), r * np.sin(q)])
    singular = crack_fields.tip_stress(r, q, *(REMOTE[1:] * math.sqrt(math.pi)))
    assert np.abs(exact(points)[0] - singular).max() < 3e-4 * np.abs(singular).max()


def test_one_element_gives_the_whole_field_to_round_off():
    """The opening is in the element's span, so the fields are exact: 1e-12 of the remote stress, and of the opening."""
    stress, displacement = solution(elements_per_crack=1).fields(np.concatenate([AWAY, ON_THE_FACE]))
    s, u = exact(np.concatenate([AWAY, ON_THE_FACE]))
    assert np.abs(stress - s).max() < 1e-12 * 1e6 * 10
    assert np.abs(displacement - u).max() < 1e-12 * np.abs(u[:3]).max() * 100


def test_fields_converge_with_the_order():
    """Four elements: away from the crack the error falls exponentially with the order, as K's does."""
    s, u = exact(AWAY)
    orders, errors = (2, 4, 6, 8), []
    for p in orders:
        stress, displacement = solution(order=p).fields(AWAY)
        errors.append(max(np.abs(stress - s).max() / 1e6, np.abs(displacement - u).max() / np.abs(u).max()))
    rate = -np.diff(np.log(errors)) / np.diff(np.log(orders))
    print("Westergaard's field, errors", [f"{e:.1e}" for e in errors], "observed orders", np.round(rate, 1))
    assert errors[1] < 1e-5 and errors[3] < 1e-8 and rate.min() > 3


def test_near_a_tip_the_stress_is_williams():
    """A twentieth of an element from the tip to ten times the crack's length ahead of it and around it, order 8."""
    r = np.array([0.03, 0.1, 0.5, 3.0, 20.0])
    for angle in (0.0, 1.0, 2.5, -2.0):
        points = np.column_stack([1 + r * math.cos(angle), r * math.sin(angle)])
        stress, _ = solution(order=8).fields(points)
        s, _ = exact(points)
        assert np.abs(stress - s).max() < 3e-7 * np.abs(s).max()
