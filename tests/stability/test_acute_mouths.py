"""Cracks that leave a surface nearly along it: the blade of rock beside them is as good as loose, and K is what bends
it."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.fracture.tip_factors import factors, largest
from geomech.model import Cracks, Material
from geomech.reference.cracks import dislocations
from geomech.reference.cracks.dislocations import Arm

ROCK = Material("rock", 17e9, 0.21)
PRESSURE = ddm.BodyLoad(crack_pressure=1.0)


def below_a_surface(degrees):
    """K_I, K_II (1, 2) of a crack 1 long at an angle to the surface of a half-plane, under a pressure 1 in it and under
    a tension 1 along the surface, by distributed dislocations."""
    tip = complex(math.cos(math.radians(degrees)), -math.sin(math.radians(degrees)))
    arms = [Arm(0j, tip, start_is_tip=False, open=True)]
    return [
        np.atleast_2d(
            dislocations.stress_intensity(
                arms, lambda p, stress=stress: np.tile(stress, (len(p), 1)), "half-plane", 513
            )
        )
        for stress in ([1.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    ]


@pytest.mark.parametrize(("degrees", "tolerance"), [(5, 3e-3), (10, 1e-2)])
def test_mouths_at_the_surface_of_a_half_plane(degrees, tolerance):
    """2e-2 at 5° where elements ended at a hundredth of the crack from its mouth. The estimate says as much."""
    tip = [math.cos(math.radians(degrees)), -math.sin(math.radians(degrees))]
    crack = Cracks.from_polylines([np.array([[0, 0], tip])], aperture=math.inf, surface=[(True, False)])
    body = ddm.Body(ddm.HalfPlane((0, 0)), crack, ROCK)
    for load, exact in zip((PRESSURE, ddm.BodyLoad(remote_stress=[1, 0, 0])), below_a_surface(degrees)):
        solution = body.solve(load)
        error = np.abs(factors(solution) - exact).max() / largest(exact)
        assert error < tolerance and error < 1.5 * solution.tip_errors.max() / largest(exact)


@pytest.mark.parametrize("degrees", [3.5, 5])
def test_short_cracks_beside_a_long_side(degrees):
    """A twentieth of the side of a block, which is a half-plane to it but for 1e-3. K was 15 to 64 % off where elements
    ended by the longer of the two faces."""
    t, length, exact = math.radians(degrees), 0.1, np.abs(below_a_surface(degrees)[0])
    block = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]])
    for y in (-0.8, -0.3):
        line = np.array([[-1, y], [-1 + length * math.sin(t), y + length * math.cos(t)]])
        body = ddm.Body([block], Cracks.from_polylines([line], aperture=math.inf, surface=[(True, False)]), ROCK)
        error = np.abs(np.abs(factors(body.solve(PRESSURE))) / math.sqrt(length) - exact).max() / largest(exact)
        print(f"{degrees}° at {y}: {error:.1e}")
        assert error < 1.5e-2
