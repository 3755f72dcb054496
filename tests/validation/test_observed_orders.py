"""Errors of K and the order at which they fall with the elements' order p, problem by problem, on one mesh each.

Printed with ``-s``. The observed order is −d ln(error)/d ln(p): where the solution is smooth along the elements it grows
with p, as that of an exponential does, until the error comes to what the reference itself is known to. `test_plates`
and `test_boundary_conditions` have those of polygons for circles, `test_crack_systems` stars and arrays.
"""

import math
from itertools import pairwise

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, JointLaw, Material
from geomech.reference.cracks import boundary_collocation, branched, crack_arrays, fracture, plates

ROCK = Material("rock", youngs_modulus=17e9, poissons_ratio=0.21)
ORDERS = (2, 4, 6, 8)
MIXED, PRESSED = np.array([0.3, 1.0, -0.4]), np.array([-0.2, -1.0, 0.9])
FRICTION = 0.4


def slots(*lines, aperture=math.inf, **options):
    return Cracks.from_polylines([np.array(line, dtype=float) for line in lines], aperture=aperture, **options)


def factors(order, cracks, load, loops=(), **options):
    """(n_tips, 2) K_I, K_II."""
    tips = ddm.Body(loops, cracks, ROCK, DdmSettings(order=order), **options).solve(load).tips
    return np.column_stack([tips["k_i"], tips["k_ii"]])


def at_angle(half, angle):
    u = half * np.array([math.cos(angle), math.sin(angle)])
    return [-u, u]


def plane(*lines, stress=(0.0, 1.0, 0.0), aperture=math.inf, **options):
    load = ddm.BodyLoad(remote_stress=np.array(stress))
    return lambda p: factors(p, slots(*lines, aperture=aperture), load, **options)


def plate(half_width, half_height, line, mouth=False):
    w, h = half_width, half_height
    outline = np.array([[-w, -h], [w, -h], [w, h], [-w, h]])
    load = ddm.BodyLoad(sides={0: (0.0, -1.0), 2: (0.0, 1.0)})
    return lambda p: factors(p, slots(line, surface=[(mouth, False)]), load, [outline])


def mode_one(factor, half, tips=2):
    """A reference of K_I = factor √(π half) at every tip."""
    return lambda: np.array([[factor * math.sqrt(math.pi * half), 0.0]] * tips)


def below_surface(depth):
    ends = np.array([[-1.0, -depth], [1.0, -depth]])
    load, ground = ddm.BodyLoad(crack_pressure=1.0), ddm.HalfPlane()
    return lambda p: factors(p, slots(ends), load, loops=ground), lambda: crack_arrays.near_surface(ends, 1.0, 129)


def collinear_pair():
    inner, outer = fracture.collinear_pair(1.0, 0.2, 1.0)
    return np.array([[outer, 0], [inner, 0], [inner, 0], [outer, 0]])


OVERLAPPING = [np.array([[-2.0, 0], [0.2, 0]]), np.array([[-0.2, 0.4], [2, 0.4]])]
ROUGH = JointLaw("rough", friction_angle=math.atan(FRICTION))
#: Name → K by the order, its reference, and the error to which that is known.
CASES = {
    "Griffith crack": (plane([[-1, 0], [1, 0]]), mode_one(1.0, 1.0), 1e-9),
    "slanted crack": (
        plane(at_angle(1, 0.9), stress=MIXED), lambda: np.array([fracture.slanted(MIXED, 0.9, 1.0)] * 2), 1e-9
    ),
    "closed crack that slips": (
        plane(at_angle(1, 0.9), stress=PRESSED, aperture=0.0, face_laws=(ROUGH,)),
        lambda: np.array([fracture.closed(PRESSED, 0.9, 1.0, FRICTION)] * 2),
        1e-9,
    ),
    "collinear pair": (plane([[-1, 0], [-0.2, 0]], [[0.2, 0], [1, 0]]), collinear_pair, 1e-9),
    "offset, overlapping cracks": (
        plane(*OVERLAPPING, stress=MIXED), lambda: crack_arrays.straight_cracks(OVERLAPPING, MIXED, n=129), 5e-9
    ),
    "pressurised crack below a surface": (*below_surface(0.5), 2e-6),
    "slanted crack in a plate": (
        plate(1.0, 2.0, at_angle(0.5, math.pi / 4)),
        lambda: np.array([boundary_collocation.centre_crack(0.5, 1.0, 2.0, math.pi / 4)] * 2),
        5e-9,
    ),
} | {
    f"centre crack a/W {ratio}, H/W {height:g}": (
        plate(1.0, height, [[-ratio, 0], [ratio, 0]]),
        mode_one(factor, ratio),
        1e-7,
    )
    for height, ratio, factor in [(h, r, plates.CENTRE_CRACK_PLATE[h][r]) for h in (1.0, 3.0) for r in (0.5, 0.9)]
} | {
    # Five digits, of a strip without end.
    f"edge crack a/W {ratio}": (
        plate(0.5, 1.5, [[-0.5, 0], [ratio - 0.5, 0]], True),
        mode_one(fracture.EDGE_CRACK[ratio], ratio, 1),
        4e-5,
    )
    for ratio in (0.1, 0.5, 0.8)
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_errors_fall_with_the_order_down_to_what_the_reference_is_known_to(name):
    solve, reference, known = CASES[name]
    exact = reference()
    errors = [np.abs(solve(p) - exact).max() / np.abs(exact).max() for p in ORDERS]
    orders = -np.diff(np.log(errors)) / np.diff(np.log(ORDERS))
    listed = ", ".join(f"{e:.1e}" for e in errors)
    print(f"{name}: errors at p = 2, 4, 6, 8 {listed}, observed orders {np.round(orders, 1)}")
    assert errors[0] < 3e-3 and errors[1] < 1e-4 and errors[-1] < known
    for before, after in pairwise(errors):
        assert after < max(known, before / 2)


@pytest.mark.parametrize("ratio", [0.01, 1.0])
def test_a_kink_s_error_falls_with_the_layers_of_grading(ratio):
    """A short and a long kink of 45°: beside the corner the opening goes with a broken power of the distance, and every
    layer of half the length takes the same share off."""
    angle, layers = math.radians(45), (2, 4, 6, 8)
    exact = branched.kinked(2.0, ratio, angle, MIXED)
    line = [[-2, 0], [0, 0], [ratio * math.cos(angle), ratio * math.sin(angle)]]
    load, errors = ddm.BodyLoad(remote_stress=MIXED), []
    for n in layers:
        tips = ddm.Body([], slots(line), ROCK, DdmSettings(order=6, grading_layers=n)).solve(load).tips
        errors.append(np.abs(np.column_stack([tips["k_i"], tips["k_ii"]]) - exact).max() / np.abs(exact).max())
    per_layer = np.exp(np.diff(np.log(errors)) / np.diff(layers))
    listed = ", ".join(f"{e:.1e}" for e in errors)
    print(f"kink 1 : {2 / ratio:g}: errors with 2, 4, 6, 8 layers {listed}, a layer leaves {np.round(per_layer, 2)}")
    assert per_layer.max() < 0.8 and errors[-1] < 1e-4
