"""Closed cracks with kinks: no face can slip through one along itself, which makes slip less smooth than at an open
kink."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.adaptivity import for_target
from geomech.ddm.fracture.tip_factors import factors, largest
from geomech.model import Cracks, DdmSettings, Material

ROCK = Material("rock", 1.0, 0.25)
FINE = replace(for_target(DdmSettings(target_error=1e-7)), order=9)
SHEARED = [0.0, -1.0, 0.9]


def kinked(degrees, ratio, longer=0.0):
    """A closed crack of length 2 with a kink ``ratio`` as long, and ``longer``, at its end."""
    t, end = math.radians(degrees), 2 * ratio + longer
    return Cracks.from_polylines([np.array([[-2, 0], [0, 0], [end * math.cos(t), end * math.sin(t)]])])


@pytest.mark.parametrize("ratio", [1.0, 0.1])
def test_default_meshes_and_their_estimates(ratio):
    """Against order 9 graded for 1e-7. Graded as open ones are, K of kinks by 5° to 45° was up to 1 % off, and the
    estimate a thirtieth of the error; ungraded below 5° are 5e-4 at most."""
    for degrees in (3, 6, 12, 19, 30, 45):
        cracks = kinked(degrees, ratio)
        for stress in (SHEARED, [-0.2, -1.0, -0.7]):
            load = ddm.BodyLoad(remote_stress=stress)
            exact = factors(ddm.Body([], cracks, ROCK, FINE).solve(load))
            solution = ddm.Body([], cracks, ROCK).solve(load)
            error = np.abs(factors(solution) - exact).max() / largest(exact)
            assert error < 8e-4, (degrees, stress)
            assert error < 3 * solution.tip_errors.max() / largest(exact), (degrees, stress)


def slip_work(cracks, settings):
    """½ ∫ σ₀n·[u] ds: what the remote stress does on the cracks; their contact, smooth, does nothing."""
    solution = ddm.Body([], cracks, ROCK, settings).solve(ddm.BodyLoad(remote_stress=SHEARED))
    c, faces = solution.body.faces, solution.faces
    xx, yy, xy = SHEARED
    pull = c.normal @ np.array([[xx, xy], [xy, yy]])
    jump = faces.opening[..., None] * c.normal[:, None] + faces.slip[..., None] * c.tangent[:, None]
    return 0.5 * float(np.einsum("ek,ekc,ec->", c.quadrature, jump[:, 1:-1], pull)), factors(solution)


def test_the_work_of_a_longer_kink_is_its_release_rate():
    """dW/da = (K_I² + K_II²)/E' at the tip that moves: W knows nothing of how K is read. Central differences, 1e-3 of
    the kink."""
    step = 2e-4
    (more, _), (less, _) = (slip_work(kinked(12, 0.1, way * step), FINE) for way in (0.5, -0.5))
    rate = (more - less) / step
    for settings, tolerance in ((FINE, 2e-5), (DdmSettings(), 2e-3)):
        k = slip_work(kinked(12, 0.1), settings)[1][1]
        assert (k @ k) / ROCK.plane_modulus == pytest.approx(rate, rel=tolerance)
