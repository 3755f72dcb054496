"""Condensed contact of smooth faces under uniform stress, against solutions of all crack unknowns."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.crack_contact import uniform_contact
from geomech.ddm.crack_contact.uniform_contact import UniformContact, condenses
from geomech.ddm.loads.uniform_stress_response import scaled
from geomech.model import Cracks, DdmSettings, JointLaw, Material

ROCK = Material("rock", 10e9, 0.25, k_ic=1e6)
SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5]])
#: Inside, kinked; from the left side; and one that leaves a blade of rock below the upper side.
LINES = [
    np.array([[0.7, 0.5], [1.1, 0.8], [1.5, 0.8]]),
    np.array([[0.0, 1.1], [0.5, 1.2]]),
    np.array([[0.9, 1.5], [1.9, 1.4]]),
]
SURFACE = [(False, False), (True, False), (True, False)]


def body_with(aperture=0.0, **others):
    cracks = Cracks.from_polylines(LINES, block=0, aperture=aperture, surface=SURFACE)
    return ddm.Body([SQUARE], cracks, ROCK, DdmSettings(), **others)


def none_closed(body):
    return np.zeros(body.faces.n_unknowns, bool)


def test_condensed_solutions_are_those_of_all_unknowns():
    """States, strain, energy, compliance, jumps and K of one stress after the other, large and small steps apart."""
    body, rng = body_with(), np.random.default_rng(2)
    contact = UniformContact(body, none_closed(body))
    states, stress = set(), np.zeros(3)
    for k in range(36):
        stress = rng.normal(size=3) * 1e6 if k % 4 == 0 else stress + rng.normal(size=3) * 1e4
        known = contact.solve(stress)
        exact = body.solve(ddm.BodyLoad(remote_stress=stress))
        np.testing.assert_array_equal(known.closed, exact.closed)
        large = np.abs(exact.jumps).max()
        assert known.jumps == pytest.approx(exact.jumps, rel=0, abs=1e-9 * large)
        assert known.crack_strain == pytest.approx(exact.crack_strain, rel=1e-9, abs=1e-11 * large / 1e10)
        assert known.crack_energy == pytest.approx(exact.crack_energy, rel=1e-9)
        response = body.strain_weights @ body.jumps_under(body.mean_stress_traction, exact)
        assert body.compliance(known) == pytest.approx(0.5 * (response + response.T), rel=0, abs=1e-9 * response.max())
        for name in ("k_i", "k_ii"):
            assert known.tips[name] == pytest.approx(exact.tips[name], rel=0, abs=1e-8 * np.abs(stress).max())
        states.add(known.closed.tobytes())
        # The response is kept for the states, and scaled.
        again = scaled(body, 1.7 * stress, known)
        assert again is not None and again.crack_strain == pytest.approx(1.7 * known.crack_strain, rel=1e-12)
    assert len(states) > 10


def test_digits_that_exchanges_lose_are_found_again(monkeypatch):
    """A matrix that has drifted is computed again in the states that it leads to."""
    body = body_with()
    contact, stress = UniformContact(body, none_closed(body)), np.array([-1e6, -2e6, 1e6])
    right = contact.solve(stress).crack_strain
    contact._now[:, -3:] *= 1 + 1e-6
    began = []
    begin = UniformContact._begin
    monkeypatch.setattr(
        UniformContact, "_begin", lambda self, closed: (began.append(closed.copy()), begin(self, closed))
    )
    other = contact.solve(np.array([1e6, -2e6, 1e6])).crack_strain
    assert len(began) == 1
    assert other == pytest.approx(body.solve(ddm.BodyLoad(remote_stress=[1e6, -2e6, 1e6])).crack_strain, rel=1e-9)
    body.uniform_responses.clear()
    assert contact.solve(stress).crack_strain == pytest.approx(right, rel=1e-9)


def test_states_that_cycle_are_left_to_others(monkeypatch):
    monkeypatch.setattr(uniform_contact, "_MOST", -1)
    body = body_with()
    assert UniformContact(body, none_closed(body)).solve(np.array([-1e6, -2e6, 1e6])) is None


def test_what_is_condensed():
    """Faces that touch without load and have no memory; of many bodies alone, and once the cracks have stood a while."""
    body = body_with()
    assert condenses(body) and body.condensed_contact(none_closed(body)) is None
    rough = (JointLaw("rough", friction_angle=np.radians(30.0)),)
    assert not any(condenses(other) for other in (body_with(np.inf), body_with(2e-5), body_with(face_laws=rough)))
    body.release()
    assert body.condensed_contact() is None
    contact = body.condensed_contact(none_closed(body))
    assert contact is not None and body.condensed_contact() is contact
    longer = [LINES[0], np.array([[0.0, 1.1], [0.5, 1.2], [0.6, 1.2]]), LINES[2]]
    cracks = Cracks.from_polylines(longer, block=0, aperture=0.0, surface=SURFACE)
    grown = ddm.Body([SQUARE], cracks, ROCK, DdmSettings(), reuse=ddm.Reuse(body))
    assert grown.condensed_contact(none_closed(grown)) is None
    grown.uniform_solutions = 5
    assert grown.condensed_contact(none_closed(grown)) is not None
