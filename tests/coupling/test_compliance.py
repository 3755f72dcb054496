"""Rotation of stress, strain and compliance between a block's own axes and the present ones."""

import numpy as np
import pytest

from geomech.coupling.compliance import crack_response, strain_rotation, stress_rotation, turned_compliance
from geomech.model import Material


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
