"""Stress and displacement about a crack, point by point, against Westergaard's and Williams' fields."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.bench.accuracy import crack_problems
from geomech.model import Cracks, DdmSettings, Material
from geomech.reference.cracks import crack_fields, fracture

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


#: Beside an arc of a quarter circle, within and without, ahead of a tip, near its centre and far away.
BESIDE_AN_ARC = np.array([[0.1, 0.85], [-0.3, 1.2], [0.95, 0.5], [0.1, -0.2], [1.5, 0.7], [-0.2, -1.1], [3.0, -40.0]])


def arc(points):
    return crack_fields.arc_field(points, 1.0, math.pi / 4, ROCK.shear_modulus, ROCK.poissons_ratio)


def test_muskhelishvilis_arc_keeps_its_conditions():
    """Nothing pulls on the faces, all is as before far away, ahead of the tips stand the published K, and stress and
    displacement obey Hooke's law."""
    q = np.linspace(math.pi / 4 + 0.1, 3 * math.pi / 4 - 0.1, 7)
    normal = np.column_stack([np.cos(q), np.sin(q)])
    for r in (1 - 1e-9, 1 + 1e-9):
        s = arc(r * normal)[0]
        pull = np.column_stack([s[:, 0] * normal[:, 0] + s[:, 2] * normal[:, 1], (s[:, 1:] * normal[:, ::-1]).sum(1)])
        assert np.abs(pull).max() < 1e-7
    assert arc(np.array([[1e4, 3e3]]))[0][0] == pytest.approx([1, 1, 0], abs=1e-7)
    way, left, r = np.array([1.0, -1.0]) / math.sqrt(2), np.array([1.0, 1.0]) / math.sqrt(2), 1e-8
    xx, yy, xy = arc((left + r * way)[None])[0][0]
    pull = math.sqrt(2 * math.pi * r) * np.array([[xx, xy], [xy, yy]]) @ left
    assert [left @ pull, -way @ pull] == pytest.approx(fracture.circular_arc(1.0, 1.0, math.pi / 4), rel=1e-6)
    h, mu, nu = 1e-5, ROCK.shear_modulus, ROCK.poissons_ratio
    by_x, by_y = ((arc(BESIDE_AN_ARC + d)[1] - arc(BESIDE_AN_ARC - d)[1]) / (2 * h) for d in h * np.eye(2))
    strain = np.column_stack([by_x[:, 0], by_y[:, 1], 0.5 * (by_x[:, 1] + by_y[:, 0])])
    mean = 2 * mu * nu / (1 - 2 * nu) * (strain[:, 0] + strain[:, 1])
    hooke = 2 * mu * strain + mean[:, None] * [1, 1, 0]
    assert np.abs(hooke - arc(BESIDE_AN_ARC)[0]).max() < 1e-6


def test_stress_beside_an_arc_is_muskhelishvilis():
    """A polygon of tangents follows the arc with second order, and so do the fields beside it."""
    sizes, errors = (8, 16, 32), []
    for n in sizes:
        solved = crack_problems.arc_of_tangents(n).solve(DdmSettings(elements_per_crack=1))
        stress, displacement = solved.fields(BESIDE_AN_ARC)
        s, u = arc(BESIDE_AN_ARC)
        moved = displacement - u
        # Where the plane rests is free.
        moved = np.abs(moved - moved[0]).max() / np.ptp(u[:-1])
        errors.append(max(np.abs(stress - s).max(), moved))
    orders = -np.diff(np.log(errors)) / np.diff(np.log(sizes))
    print("Muskhelishvili's arc, errors", errors, "observed orders", orders)
    assert errors[-1] < 1e-3 and orders.min() > 1.7
