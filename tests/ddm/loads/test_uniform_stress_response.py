"""Solutions under an even stress that are scaled from unit ones, against solutions of the whole problem."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.loads.uniform_stress_response import KEPT, scaled
from geomech.model import Cracks, DdmSettings, JointLaw, Material

ROCK = Material("rock", 10e9, 0.25, k_ic=1e6)
SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5]])
#: A kinked crack inside, and one from the left side.
LINES = [np.array([[0.7, 0.5], [1.1, 0.8], [1.5, 0.8]]), np.array([[0.0, 1.1], [0.5, 1.2]])]


def body_with(aperture, **others):
    cracks = Cracks.from_polylines(LINES, block=0, aperture=aperture, surface=[(False, False), (True, False)])
    return ddm.Body([SQUARE], cracks, ROCK, DdmSettings(), **others)


@pytest.mark.parametrize("aperture", [np.inf, 0.0, 2e-5], ids=["slots", "closed", "narrow"])
def test_a_scaled_solution_is_the_solution(aperture):
    """Jumps, strain, energy and K to round-off, whatever faces are open, shut or in part; and it is told where states
    change, never wrongly."""
    body, rng, was_scaled = body_with(aperture), np.random.default_rng(2), 0
    warm = None
    for stress in rng.normal(size=(12, 3)) * 10.0 ** rng.uniform(4, 7, size=(12, 1)):
        for size in (1.0, 0.7, 1.3):
            known = scaled(body, size * stress, warm)
            exact = body.solve(ddm.BodyLoad(remote_stress=size * stress), warm=warm)
            if known is not None:
                was_scaled += 1
                np.testing.assert_array_equal(known.closed, exact.closed)
                large = np.abs(exact.jumps).max()
                assert known.jumps == pytest.approx(exact.jumps, rel=0, abs=1e-11 * large)
                assert known.crack_strain == pytest.approx(exact.crack_strain, rel=1e-11, abs=1e-13 * large / 1e10)
                assert known.crack_energy == pytest.approx(exact.crack_energy, rel=1e-11)
                for name in ("k_i", "k_ii"):
                    assert known.tips[name] == pytest.approx(exact.tips[name], rel=0, abs=1e-10 * np.abs(stress).max())
                assert known.face_states.key == exact.face_states.key
            body.compliance(exact)  # as the coupling asks for it, whenever states are new
            warm = exact if known is None else known
    assert was_scaled == 36 if aperture == np.inf else 6 < was_scaled < 36
    assert len(body.uniform_responses) <= KEPT and body.work.solutions_scaled == was_scaled


def test_faces_with_memory_and_holes_are_solved_for():
    """What has slipped, and holes, which an even stress passes by otherwise, are never scaled."""
    stress = np.array([0.0, 1e6, 0.0])
    rough = body_with(0.0, face_laws=(JointLaw("rough", friction_angle=np.radians(30.0)),))
    hole = np.array([[1.6, 0.3], [1.6, 0.5], [1.8, 0.5], [1.8, 0.3]])
    assert scaled(rough, stress) is None and scaled(body_with(np.inf, holes=[hole]), stress) is None
    assert scaled(body_with(np.inf), stress) is not None


def test_a_body_that_has_grown_is_another_one():
    """The states of its faces are no guess for the scaled answer of other elements."""
    body = body_with(np.inf)
    longer = [LINES[0], np.array([[0.0, 1.1], [0.5, 1.2], [0.6, 1.2]])]
    cracks = Cracks.from_polylines(longer, block=0, aperture=np.inf, surface=[(False, False), (True, False)])
    grown = ddm.Body([SQUARE], cracks, ROCK, DdmSettings(), reuse=ddm.Reuse(body))
    before = scaled(body, np.array([1e6, 0.0, 0.0]))
    assert scaled(grown, np.array([1e6, 0.0, 0.0]), before) is None
