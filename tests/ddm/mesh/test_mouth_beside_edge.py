"""A crack's mouth that coordinates place a hair beside its edge: stress intensity factors do not depend on it."""

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, Material

ROCK = Material(name="rock", density=2500.0, youngs_modulus=1e9, poissons_ratio=0.25)
TURN = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) @ TURN.T


def factors(off: float, mouth: float = 0.4, hole: bool = False) -> np.ndarray:
    """K_I and K_II of an edge crack in a spinning square, or of one at a hole under pressure; ``off`` m outside."""
    crack = np.array([[mouth, 1.0 + off], [0.45, 0.6]])
    load = ddm.BodyLoad(body_force_gradient=1e6 * np.eye(2), hole_pressure=1e6 if hole else 0.0)
    loops = [SQUARE]
    if hole:
        crack = np.array([[0.5, 0.6 - off], [0.5, 0.8]])
        loops.append(np.array([[0.4, 0.4], [0.4, 0.6], [0.6, 0.6], [0.6, 0.4]]) @ TURN.T)
    cracks = Cracks.from_polylines([crack @ TURN.T], surface=[(True, False)], aperture=np.inf)
    tips = ddm.Body(loops, cracks, ROCK, DdmSettings()).solve(load).tips
    return np.array([tips["k_i"][0], tips["k_ii"][0]])


@pytest.mark.parametrize("hole", [False, True])
@pytest.mark.parametrize("off", [1e-15, 1e-13, -1e-13, 1e-10, -1e-10, 3e-8, -3e-8])
def test_factors_do_not_depend_on_a_mouth_a_hair_off_its_edge(off, hole):
    k = factors(0.0, hole=hole)
    assert np.allclose(factors(off, hole=hole), k, rtol=0, atol=max(1e-9, 3 * abs(off)) * np.abs(k).max())


@pytest.mark.parametrize("off", [1e-12, -1e-12])
def test_factors_do_not_depend_on_a_mouth_a_hair_off_its_corner(off):
    k = factors(0.0, mouth=0.0)
    assert np.allclose(factors(off, mouth=off), k, rtol=0, atol=1e-9 * np.abs(k).max())
