"""Crack faces in contact by the factors of open ones, against factors of their own equations."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.system import schur_complement
from geomech.ddm.system.closed_face_factor import ClosedFaceFactor
from geomech.ddm.system.contact_rows import Rows
from geomech.ddm.system.dense_lu import Factor
from geomech.model import Cracks, JointLaw, Material

ROCK = Material("rock", youngs_modulus=17e9, poissons_ratio=0.21, k_ic=1e6)


def a_problem():
    """A matrix, rows with nodes that stick, that slide closed and that slide pulled open, and its free equations."""
    rng, per, n_elements = np.random.default_rng(0), 3, 20
    n = 2 * per * n_elements
    matrix = rng.normal(size=(n, n)) + 8 * np.eye(n)
    unknowns = np.arange(n).reshape(n_elements, 2, per)
    along, across = unknowns[:, 0].ravel(), unknowns[:, 1].ravel()
    prescribed, mixed = np.zeros(n, bool), np.zeros(n)
    prescribed[across[::3]] = prescribed[along[::6]] = True
    mixed[along[3::6]], mixed[along[1::12]] = 0.4, 0.3
    free, slides = np.flatnonzero(~prescribed), np.flatnonzero(mixed)
    own = matrix.copy()
    own[slides] += mixed[slides, None] * matrix[slides + per]
    return matrix, Rows(prescribed, mixed, np.zeros(n), per), own[np.ix_(free, free)], rng


class Inverse:
    def __init__(self, matrix):
        self._all = np.linalg.inv(matrix)

    def inverse_columns(self, unknowns):
        return self._all[:, unknowns]


@pytest.mark.parametrize("transposed", [False, True])
def test_solutions(transposed):
    matrix, rows, own, rng = a_problem()
    prescribed = ClosedFaceFactor(rows, Factor(matrix, "open"), Inverse(matrix), "held")
    right = rng.normal(size=(len(own), 3))
    expected = np.linalg.solve(own.T if transposed else own, right)
    np.testing.assert_allclose(prescribed.solve(right, transposed), expected, atol=1e-10)
    np.testing.assert_allclose(prescribed.solve(right[:, 0], transposed), expected[:, 0], atol=1e-10)


def flaws(aperture):
    at = [(x, y) for x in (-0.6, 0.0, 0.6) for y in (-0.7, 0.0, 0.7)]
    lines = [np.array([[x - 0.15, y - 0.2 * s], [x + 0.15, y + 0.2 * s]]) for (x, y), s in zip(at, (1, -1) * 5)]
    return Cracks.from_polylines(lines, aperture=aperture)


@pytest.mark.parametrize(
    "law",
    [
        JointLaw("rough", friction_angle=0.4),
        JointLaw("cohesive", friction_angle=0.3, cohesion=2e4),
        JointLaw("cemented", friction_angle=0.3, cohesion=1e6, tensile_strength=3e5),
        JointLaw("filled", friction_angle=0.3, normal_stiffness=1e12, shear_stiffness=1e12),
    ],
    ids=lambda law: law.name,
)
@pytest.mark.parametrize("aperture", [0.0, 2e-7])
def test_faces_settle_as_by_their_own_equations(law, aperture, monkeypatch):
    """Two loads, the second of which turns slip round; functionals of the tips too."""
    if law.tensile_strength and aperture:
        pytest.skip("cement has no aperture")
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
    loads = [ddm.BodyLoad(remote_stress=s) for s in ([-0.2e6, -1e6, 0.1e6], [-0.9e6, -0.3e6, -0.2e6])]
    found = []
    for least in (1, 10**6):
        monkeypatch.setattr(schur_complement, "WORTHWHILE", least)
        body = ddm.Body([square], flaws(aperture), ROCK, face_laws=[law])
        first = body.solve(loads[0])
        second = body.solve(loads[1], history=first)
        weights = body.k_functionals(second).on_faces
        found.append((first.jumps, second.jumps, weights, body.compliance(second), second.states))
    for by_open, by_own in zip(*found):
        np.testing.assert_allclose(by_open, by_own, atol=1e-8 * np.abs(by_own).max())
