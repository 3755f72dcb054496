"""Rotation of stress, strain and compliance between a block's own axes and the present ones."""

import numpy as np
import pytest

from geomech.coupling.crack_compliance.added_compliance import (
    crack_response,
    passive,
    strain_rotation,
    stress_rotation,
)
from geomech.model import Material


def turned_compliance(compliance, angle):
    return crack_response(compliance, np.zeros(3), np.zeros(3), angle)[0]


def test_work_does_not_depend_on_the_axes():
    rng = np.random.default_rng(1)
    stress, strain = rng.normal(size=3), rng.normal(size=3)
    turned = (stress_rotation(0.7) @ stress) @ (strain_rotation(0.7) @ strain)
    assert turned == pytest.approx(stress @ strain, rel=1e-14)


def test_isotropic_compliance_does_not_turn():
    compliance = Material("rock", 17e9, 0.21).compliance()
    assert turned_compliance(compliance, 1.1) == pytest.approx(compliance, rel=1e-13, abs=1e-24)


def test_quarter_turn_exchanges_the_axes():
    """Cracks across x soften x; turned by 90° they soften y."""
    assert turned_compliance(np.diag([1.0, 0.0, 0.5]), np.pi / 2) == pytest.approx(np.diag([0.0, 1.0, 0.5]), abs=1e-15)


def test_response_reproduces_the_crack_strain_it_was_made_from():
    compliance, strain, stress = np.diag([2.0, 1.0, 3.0]), np.array([0.3, 0.1, -0.2]), np.array([1.0, -2.0, 0.5])
    s, offset = crack_response(compliance, strain, stress, 0.4)
    assert offset + s @ stress == pytest.approx(strain_rotation(0.4) @ strain, rel=1e-13)


def test_no_direction_gives_energy_back():
    """A face that slides under friction tan 40° answers pressure with less slip, but shear with no opening: half of
    that is symmetric, and negative somewhere. What is left is positive, the same in whatever axes, and nothing is taken
    from others."""
    shear, friction = 2.0, np.tan(np.radians(40.0))
    response = np.array(
        [[0, 0, 0], [0, 1e-3, 0], [0, shear * friction, shear]]
    )  # a face along x; σy drives slip by friction
    symmetric = 0.5 * (response + response.T)
    assert np.linalg.eigvalsh(symmetric)[0] < -0.1
    kept = passive(symmetric)
    assert np.linalg.eigvalsh(kept)[0] > -1e-15
    for angle in (0.3, 1.2):
        assert passive(turned_compliance(symmetric, angle)) == pytest.approx(turned_compliance(kept, angle), abs=1e-14)
    assert passive(np.diag([1.0, 0.0, 2.0])) == pytest.approx(np.diag([1.0, 0.0, 2.0]), abs=0)
