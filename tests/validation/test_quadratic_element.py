"""The quadratic element of Crouch & Starfield (1983) and its three-term tip element, as the paper that this project
started from uses them: p = 2 with collocation in the middle of three equal sub-elements. Its known errors are shown."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.kernels import shape_functions
from geomech.model import Cracks, DdmSettings, Material
from geomech.reference.cracks import fracture

ROCK = Material("rock", youngs_modulus=17e9, poissons_ratio=0.21)
PAPER = {"order": 2, "nodes": "equal"}


def griffith_error(stress=(0, 1.0, 0), **settings):
    crack = Cracks.from_polylines([np.array([[-1.0, 0.0], [1.0, 0.0]])], aperture=math.inf)
    tips = ddm.Body([], crack, ROCK, DdmSettings(**settings)).solve(ddm.BodyLoad(remote_stress=list(stress))).tips
    return tips["k_i"][0] / fracture.griffith(1.0, 1.0) - 1


def test_shape_functions_are_the_published_ones():
    """The quadratic element in the usual form (Crouch & Starfield 1983): N_1 = ξ(ξ − 2)/8, N_2 = −(ξ² − 4)/4, N_3 = ξ(ξ
    + 2)/8 with nodes at −2, 0 and 2, ξ in sub-element half lengths; the tip element carries √r, r√r and r²√r."""
    xi = np.linspace(-3, 3, 13)
    published = np.column_stack([xi * (xi - 2) / 8, -(xi**2 - 4) / 4, xi * (xi + 2) / 8])
    assert np.allclose(shape_functions.at("equal", 2, shape_functions.ORDINARY, xi / 3), published, atol=1e-14)
    r = np.linspace(0.01, 2, 9)
    tip = shape_functions.at("equal", 2, shape_functions.TIP_START, r - 1)
    basis = np.column_stack([r**0.5, r**1.5, r**2.5])
    fitted = np.linalg.lstsq(basis, tip, rcond=None)[0]
    assert np.abs(basis @ fitted - tip).max() < 1e-13


def test_its_error_does_not_fall_with_more_elements():
    """8.2e-4 in K_I with 4 elements, 8.4e-4 with 64: what is wrong at the tip is as wrong at every scale. The observed
    order is 0, and only the order of the element helps: the same 4 elements with p = 8 have 6e-10."""
    errors = {n: abs(griffith_error(elements_per_crack=n, **PAPER)) for n in (4, 8, 16, 32, 64)}
    print("quadratic elements, equal nodes:", {n: f"{e:.1e}" for n, e in errors.items()})
    assert errors[4] == pytest.approx(8.2e-4, rel=0.05)
    assert max(errors.values()) < 1.1 * min(errors.values())
    assert abs(griffith_error(order=8)) < 1e-9


def test_constant_elements_are_of_first_order():
    """Opening in the middle of the crack with p = 0 (and √r at the tips): 3 % with 11 elements, first order."""
    crack = Cracks.from_polylines([np.array([[-1.0, 0.0], [1.0, 0.0]])], aperture=math.inf)
    middle, sizes = [], np.array([11, 21, 41])
    for n in sizes:
        body = ddm.Body([], crack, ROCK, DdmSettings(order=0, elements_per_crack=int(n)))
        opening = body.solve(ddm.BodyLoad(remote_stress=[0, 1.0, 0])).faces.opening[n // 2, 1]
        middle.append(opening / (4 / ROCK.plane_modulus) - 1)
    orders = -np.diff(np.log(np.abs(middle))) / np.diff(np.log(sizes))
    print("constant elements, opening in the middle:", middle, "observed orders", orders)
    assert np.abs(orders - 1).max() < 0.15
