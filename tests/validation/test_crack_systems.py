"""Several cracks, stars, kinks and arrays in the infinite plane, against closed forms and an independent method."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, Material
from geomech.reference.cracks import branched, crack_arrays

ROCK = Material("rock", youngs_modulus=17e9, poissons_ratio=0.21)
ROOT = math.sqrt(math.pi)


def slots(polylines):
    return Cracks.from_polylines([np.asarray(line, dtype=float) for line in polylines], aperture=math.inf)


def factors(cracks, stress, **settings):
    """(n_tips, 2) K_I, K_II over √π."""
    tips = ddm.Body([], cracks, ROCK, DdmSettings(**settings)).solve(ddm.BodyLoad(remote_stress=stress)).tips
    return np.column_stack([tips["k_i"], tips["k_ii"]]) / ROOT


def observed(name, sizes, errors):
    orders = -np.diff(np.log(errors)) / np.diff(np.log(sizes))
    print(f"{name}: errors {', '.join(f'{e:.1e}' for e in errors)}, observed orders {np.round(orders, 1)}")
    return orders


def junction(ways):
    """Arms of length 1 from the origin."""
    n = len(ways)
    return Cracks(
        nodes=np.vstack([np.zeros((1, 2)), ways]), segments=np.array([[0, k + 1] for k in range(n)]),
        crack=np.arange(n),
        block=np.zeros(n, int), birth_cycle=np.zeros(n, int), aperture=np.full(n, math.inf),
        surface=np.zeros(n + 1, bool), names=tuple("abcdef"[:n]),
    )  # fmt: skip


@pytest.mark.parametrize("arms", [3, 4])
def test_stars(arms):
    """The opening is smooth at the junction of a symmetric star: exponential in the order down to the digits of the
    reference, 5e-9; three layers of grading, since the angle between arms, not the grading, limits what is left."""
    angle = 2 * math.pi * np.arange(arms) / arms + 0.3
    star = junction(np.column_stack([np.cos(angle), np.sin(angle)]))
    orders, errors = (2, 4, 6, 8), []
    for p in orders:
        k = factors(star, [1, 1, 0], order=p, grading_layers=3)
        assert np.ptp(k[:, 0]) < 1e-9 and np.abs(k[:, 1]).max() < 1e-9
        errors.append(abs(k[0, 0] - branched.STARS[arms]))
    observed(f"star of {arms}", orders, errors)
    assert errors[1] < 3e-5 and errors[-1] < 1e-8


@pytest.mark.parametrize("kink", [0.01, 0.2, 1.0])
@pytest.mark.parametrize("degrees", [20.0, 45.0, 90.0])
def test_kinked_crack(kink, degrees):
    """Main crack 2, kink 0.01 to 1 of it long, in tension and in shear. Default settings: 2e-3 of σ√(πa). With the
    layers of grading the error falls geometrically (by half a layer at 90°, faster at blunter kinks) to 2e-5 at ten."""
    angle = math.radians(degrees)
    crack = slots([[[-2, 0], [0, 0], [kink * math.cos(angle), kink * math.sin(angle)]]])
    for stress in ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]):
        exact = branched.kinked(2.0, kink, angle, np.array(stress)) / ROOT
        error = [np.abs(factors(crack, stress) - exact).max()]
        for layers in (6, 10):
            error.append(np.abs(factors(crack, stress, order=8, grading_layers=layers) - exact).max())
        print(f"kink {kink} at {degrees}°: default {error[0]:.1e}; 6, 10 layers {error[1]:.1e}, {error[2]:.1e}")
        assert error[0] < 2e-3
        assert error[2] < 0.4 * error[1] and error[2] < 2e-5


def test_parallel_cracks():
    """Two equal ones above one another: they shield each other. Exponential convergence in the order, 1e-8 at p =
    10."""
    for height in (0.25, 1.0):
        ends = [np.array([[-1, 0], [1, 0]]), np.array([[-1, height], [1, height]])]
        exact = crack_arrays.straight_cracks(ends, [0, 1, 0], n=129) / ROOT
        orders, errors = (2, 4, 6, 8), []
        for p in orders:
            errors.append(np.abs(factors(slots(ends), [0, 1, 0], order=p) - exact).max())
        observed(f"parallel cracks at {height}", orders, errors)
        assert errors[1] < 1e-4 and errors[-1] < 1e-6


def test_offset_parallel_cracks():
    """The inner tips overlap, with an offset of a fifth of the cracks: mixed mode."""
    ends = [np.array([[-2, 0], [0.2, 0]]), np.array([[-0.2, 0.4], [2, 0.4]])]
    exact = crack_arrays.straight_cracks(ends, [0, 1, 0], n=129) / ROOT
    assert np.abs(factors(slots(ends), [0, 1, 0]) - exact).max() < 2e-4
    assert np.abs(factors(slots(ends), [0, 1, 0], order=8) - exact).max() < 1e-6


@pytest.mark.parametrize("number", [20, pytest.param(50, marks=pytest.mark.slow)])
def test_random_cracks(verified, number):
    """The densest pair is a fifth of a crack apart. Default order to 5e-5 of σ√(πa), order 8 to 1e-6 (the reference has
    3e-7)."""
    ends = crack_arrays.random_cracks(number)
    stress = np.array([0.3, 1.0, 0.2])
    exact = crack_arrays.straight_cracks(ends, stress, n=49) / ROOT
    for order, tolerance in ((4, 5e-5), (8, 1e-6)):
        error = np.abs(factors(slots(ends), stress, order=order) - exact).max()
        print(f"{number} random cracks, order {order}: {error:.1e}")
        verified(f"{number} random cracks, order {order}: K", error, "distributed dislocations")
        assert error < tolerance


def in_a_row(middles, half, stress):
    """K_I/√π of the middle one of N cracks, extrapolated to N → ∞ by a parabola in 1/N, and for N = 11, 21, 41."""
    sizes, found = np.array([11, 21, 41]), []
    for n in sizes:
        at = (np.arange(n) - n // 2)[:, None, None] * np.asarray(middles) + half * np.array([[-1.0, 0.0], [1.0, 0.0]])
        found.append(factors(slots(list(at)), stress, order=6)[2 * (n // 2), 0])
    return np.polyfit(1 / sizes, found, 2)[-1], sizes, np.array(found)


def test_collinear_array(verified):
    """The middle one of N cracks in a row tends to the periodic array like 1/N, as what is missing acts like Σ 1/n²
    beyond N/2; the parabola leaves 1/N³: 4e-5."""
    exact = crack_arrays.collinear_array(1.0, 0.6, 2.0) / ROOT
    limit, sizes, found = in_a_row([2.0, 0.0], 0.6, [0, 1, 0])
    orders = observed("collinear array", sizes, np.abs(found - exact))
    print(f"extrapolated: {limit / exact - 1:.1e}")
    verified("row of collinear cracks, extrapolated: K", limit / exact - 1, "Irwin 1957")
    assert np.abs(orders - 1).max() < 0.1 and limit == pytest.approx(exact, rel=5e-5)


def test_stacked_array(verified):
    """The middle one of N cracks above one another, the same order; the stack is as high as five to twenty cracks long:
    the parabola leaves 1.4e-3."""
    exact = crack_arrays.stacked_array(1.0, 1.0) / ROOT
    limit, sizes, found = in_a_row([0.0, 1.0], 1.0, [0, 1, 0])
    orders = observed("stacked array", sizes, np.abs(found - exact))
    print(f"extrapolated: {limit / exact - 1:.1e}")
    verified("stack of cracks, extrapolated: K", limit / exact - 1, "closed form")
    assert np.abs(orders - 1).max() < 0.2 and limit == pytest.approx(exact, rel=2e-3)
