"""Small kinks: the crack solver against the expansion of Amestoy & Leblond (1992) that the energy criterion uses."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.criteria import CRITERIA, kink_factors
from geomech.model import Cracks, DdmSettings, Material

ROCK = Material("rock", 1e10, 0.25)


def solved_factors(theta, length=1e-5):
    """F (2, 2) from a crack of half-length 1 with a short kink, under biaxial tension (no T stress) and under shear."""
    kink = [1 + length * math.cos(theta), length * math.sin(theta)]
    crack = Cracks.from_polylines([[[-1, 0], [1, 0], kink]], aperture=math.inf)
    body = ddm.Body([], crack, ROCK, DdmSettings(order=6, grading_layers=12))
    columns = []
    for stress in ([1.0, 1.0, 0.0], [0.0, 0.0, 1.0]):
        tips = body.solve(ddm.BodyLoad(remote_stress=np.array(stress))).tips
        tip = tips[int(np.argmax(tips["point"][:, 0]))]
        columns.append([tip["k_i"], tip["k_ii"]])
    return np.array(columns).T / math.sqrt(math.pi)


@pytest.mark.parametrize(("degrees", "tolerance"), [(30, 3e-4), (-60, 1e-3), (75, 1e-3), (100, 1e-3), (120, 3e-3)])
def test_kink_factors_agree_with_a_solved_kink(degrees, tolerance):
    """The tolerance is the solver's at a kink of 1 : 100 000 (1e-4 at 30°, 8e-4 at 75°); at 120° it is the
    expansion's, whose last term given is 1e-3 there."""
    theta = math.radians(degrees)
    np.testing.assert_allclose(solved_factors(theta), kink_factors(theta), atol=tolerance)


@pytest.mark.parametrize("name", CRITERIA)
def test_criteria_pick_a_kink_that_opens_and_hardly_shears(name):
    """Cotterell & Rice (1980): in a mixed mode of K_II = K_I/4 every criterion is near local symmetry (k_2 ≈ 0)."""
    angle, _ = CRITERIA[name]([1.0], [0.25], ROCK)
    k_1, k_2 = solved_factors(float(angle[0])) @ [1.0, 0.25]
    assert k_1 > 1 and abs(k_2) < 0.03 * k_1
