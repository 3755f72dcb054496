"""Fields from a billionth of a crack to a thousand cracks away, on both faces and beside the ends of elements."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, Material
from geomech.reference.cracks import crack_fields

ROCK = Material("rock", youngs_modulus=17e9, poissons_ratio=0.21)
REMOTE = np.array([0.3e6, 1e6, 0.4e6])


def solution(order, elements=4):
    crack = Cracks.from_polylines([np.array([[-1.0, 0.0], [1.0, 0.0]])], aperture=math.inf)
    settings = DdmSettings(order=order, elements_per_crack=elements)
    return ddm.Body([], crack, ROCK, settings).solve(ddm.BodyLoad(remote_stress=REMOTE))


def exact(points, side=1.0):
    """On the crack's line the reference gives the upper face, so the lower one is the mirror image's upper one, in
    which shear turns its sign."""
    if side > 0:
        return crack_fields.griffith_field(points, 1.0, REMOTE, ROCK.shear_modulus, ROCK.poissons_ratio)
    mirror = REMOTE * [1, 1, -1]
    stress, moved = crack_fields.griffith_field(points * [1, -1], 1.0, mirror, ROCK.shear_modulus, ROCK.poissons_ratio)
    return stress * [1, 1, -1], moved * [1, -1]


@pytest.mark.parametrize(("order", "tolerance"), [(4, 4e-5), (6, 4e-7), (8, 1e-8)])
def test_about_a_tip_at_any_distance(order, tolerance):
    """Relative to the stress there, a few times the error of K at its order (2e-5 and 3e-9 seen at p = 4 and 8), from
    1e-9 to 1e3 crack lengths: the √r of tip elements holds at any distance."""
    sol = solution(order)
    for r in (1e-9, 1e-7, 1e-5, 1e-3, 0.03, 0.3, 3.0, 30.0, 1e3):
        angle = np.linspace(-math.pi, math.pi, 24)[1:-1]
        points = np.column_stack([1 + 2 * r * np.cos(angle), 2 * r * np.sin(angle)])
        stress, s = sol.stress(points), exact(points)[0]
        assert np.abs(stress - s).max() < tolerance * np.abs(s).max()
        if r < 1e-8:
            k = sol.tips[-1]
            near = crack_fields.tip_stress(np.full(len(angle), 2 * r), angle, k["k_i"], k["k_ii"])
            # The next term is the T-stress, √r of this one: 1e-4.
            assert np.abs(stress - near).max() < 3e-4 * np.abs(s).max()


def test_on_either_face():
    """Stress and displacement at both faces of the crack, each the limit from its own side, order 8: 1e-6 of the remote
    stress is what the discretisation leaves between its nodes, 1e-8 of the opening."""
    sol = solution(8)
    x = np.array([-0.999999, -0.97, -0.8, -0.3, -0.1, 0.05, 0.2, 0.45, 0.6, 0.9, 0.9999])
    points = np.column_stack([x, np.zeros(len(x))])
    for side in (1.0, -1.0):
        stress, moved = sol.fields(points, side)
        s, u = exact(points, side)
        scale = np.maximum(np.abs(s).max(axis=1, keepdims=True), 1e6)
        assert (np.abs(stress - s) < 2e-6 * scale).all()
        assert np.abs(moved - u).max() < 1e-8 * np.abs(u).max()
        # Beside the face nothing is lost either.
        for off in (1e-14, 1e-10, 1e-6):
            beside = sol.stress(points + [0, side * off], side)
            assert (np.abs(beside - stress) < 1e-9 * scale + 300 * off / (1 - np.abs(x))[:, None] * scale).all()


@pytest.mark.parametrize(("order", "tolerance"), [(4, 3e-3), (8, 5e-5)])
def test_beside_inner_ends_of_elements(order, tolerance):
    """Where elements go straight on the field passes through their ends as it should; with a point moved aside instead
    it was 3e-2 off at every order."""
    sol = solution(order)
    assert 0.5 in sol.body.faces.start[:, 0]
    for side in (1.0, -1.0):
        angle = side * np.linspace(0, math.pi, 9)
        way = np.column_stack([np.cos(angle), np.sin(angle)])
        way[[0, -1], 1] = 0.0
        for r in (0.0, 1e-12, 1e-7, 1e-4, 2e-3, 0.01):
            points = np.array([0.5, 0.0]) + r * way
            assert np.abs(sol.stress(points, side) - exact(points, side)[0]).max() < tolerance * 1e6


def test_principal_stress_is_the_eigenvalues():
    points = np.array([[1.3, 0.2], [0.0, 0.5], [-1.1, -0.4], [7.0, 3.0]])
    sol = solution(4)
    values, angle = sol.principal_stress(points)
    for (xx, yy, xy), value, turn in zip(sol.stress(points), values, angle):
        tensor = np.array([[xx, xy], [xy, yy]])
        assert np.allclose(np.linalg.eigvalsh(tensor)[::-1], value, rtol=1e-12)
        direction = np.array([math.cos(turn), math.sin(turn)])
        assert np.allclose(tensor @ direction, value[0] * direction, atol=1e-9 * np.abs(value).max())
