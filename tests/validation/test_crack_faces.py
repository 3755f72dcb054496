"""Crack faces in contact, with friction and with a filling, against closed forms."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.model import SLIP, STICK, Cracks, DdmSettings, JointLaw, Material
from geomech.reference import fracture

ROCK = Material("rock", 50e9, 0.25)
FRICTION, COHESION = 0.4, 1e6
ROUGH = JointLaw("rough", friction_angle=math.atan(FRICTION), cohesion=COHESION)


def straight(angle, law, order=4, elements=4):
    d = np.array([math.cos(angle), math.sin(angle)])
    settings = DdmSettings(order=order, elements_per_crack=elements)
    return ddm.Body([], Cracks.from_polylines([np.array([-d, d])]), ROCK, settings, face_laws=(law,))


def under(*stress):
    return ddm.BodyLoad(remote_stress=np.array(stress, dtype=float))


@pytest.mark.parametrize("degrees", [10, 30, 45, 60, 80])
@pytest.mark.parametrize(("order", "elements", "tolerance"), [(4, 1, 1e-13), (4, 4, 1e-5), (8, 4, 1e-8)])
def test_closed_crack_with_friction(degrees, order, elements, tolerance):
    """K_I = 0, K_II = sign(τ) max(0, |τ| − μ|σ_n| − c) √(πa): a crack of one element holds √(a² − x²) exactly, several
    have the errors of Griffith's crack."""
    stress = np.array([-3e6, -20e6, 0.0])
    sol = straight(math.radians(degrees), ROUGH, order, elements).solve(under(*stress))
    _, k_ii = fracture.closed(stress, math.radians(degrees), 1.0, FRICTION, COHESION)
    assert (sol.states == (SLIP if k_ii else STICK)).all() and not sol.tips["k_i"].any()
    np.testing.assert_allclose(sol.tips["k_ii"], k_ii, rtol=tolerance)


def test_cyclic_shear_makes_the_closed_forms_loop():
    """Under pressure p and shear ±τ the faces slip when the shear has turned by twice the limit L = μp + c. K_II follows
    the shear less ±L, and each cycle turns L · 4 (τ − L) · 2πa²/E' into heat (slip volume 2πa² τ/E' of shear τ)."""
    body = straight(0.0, ROUGH, order=4, elements=1)
    limit, top, modulus = FRICTION * 5e6 + COHESION, 8e6, ROCK.plane_modulus
    path = top * np.concatenate([np.linspace(0, 1, 5), np.linspace(1, -1, 9)[1:], np.linspace(-1, 1, 9)[1:]])
    sol, carried, work = None, 0.0, 0.0
    for shear in path:
        sol = body.solve(under(0, -5e6, shear), history=sol)
        # A play operator: what the crack carries stays until the shear is a limit off.
        before, carried = carried, min(max(carried, shear - limit), shear + limit)
        work += limit * abs(carried - before) * 2 * math.pi / modulus
        np.testing.assert_allclose(sol.tips["k_ii"], carried * math.sqrt(math.pi), atol=1e-12 * top)
        assert (sol.states == (STICK if carried == before else SLIP)).all()
        assert sol.frictional_work == pytest.approx(work, rel=1e-12)
    assert work == pytest.approx(limit * 5 * (top - limit) * 2 * math.pi / modulus)
