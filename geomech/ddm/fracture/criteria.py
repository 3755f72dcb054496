"""Growth criteria: direction and equivalent stress intensity factor of a loaded tip.

Each criterion takes K_I and K_II of many tips, (n,) Pa √m, and the material, and returns ``(angle, k_eq)``: the growth
angle from the direction of the crack (rad, counter-clockwise, so that a positive K_II gives a negative angle) and the
equivalent stress intensity factor to be compared with K_Ic. A tip without a tensile kink has k_eq = 0 and angle 0 (the
F-criterion also admits shear kinks). K_I may be negative: a slot that cannot close has a compressive K_I and still
kinks in tension.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...model import Material
from ..growth import tie_tolerance

Criterion = Callable[[np.ndarray, np.ndarray, Material], tuple[np.ndarray, np.ndarray]]

# Stationary kinks are searched between these angles, first on a grid of one degree (no two are closer). The series of
# Amestoy & Leblond loses its digits beyond 126°: its last term, 4.1 m²⁰, is 0.003 there and grows fast.
_GRID = np.radians(np.arange(-160.5, 161.0, 1.0))
_KINK_GRID = np.radians(np.arange(-126.5, 127.0, 1.0))


def maximum_tangential_stress(
    k_i: np.ndarray, k_ii: np.ndarray, material: Material | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Erdogan & Sih (1963): the tip turns to where the hoop stress is largest, K_I sin θ + K_II (3 cos θ − 1) = 0.

    tan(θ/2) = −2 K_II / (K_I + √(K_I² + 8 K_II²)), written for negative K_I with the conjugate so that nothing cancels;
    K_eq = cos(θ/2) [K_I cos²(θ/2) − 3/2 K_II sin θ]. Independent of the material.
    """
    k_i, k_ii = _tips(k_i, k_ii)
    root = np.hypot(k_i, math.sqrt(8.0) * k_ii)
    opening = k_i >= 0
    numerator = np.where(opening, 2 * np.abs(k_ii), root - k_i)
    denominator = np.where(opening, k_i + root, 4 * np.abs(k_ii))
    half = np.arctan2(numerator, denominator)  # |θ|/2
    cos, sin = np.cos(half), np.sin(half)
    k_eq = cos**2 * (k_i * cos + 3 * np.abs(k_ii) * sin)
    drives = (root > 0) & (opening | (k_ii != 0)) & (k_eq > 0)
    return np.where(drives & (half > 0), -2 * np.copysign(half, k_ii), 0.0), np.where(drives, k_eq, 0.0)


def maximum_energy_release_rate(
    k_i: np.ndarray, k_ii: np.ndarray, material: Material | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The kink with the largest energy release rate, G = (k_1² + k_2²)/E', with K_eq = √(E' G).

    k_1, k_2 are the factors at the tip of an infinitesimal kink (`kink_factors`). Only kinks that open (k_1 > 0) count,
    and of these only true maxima of G: where G merely grows towards a kink that closes (strong compression along the
    crack), the kink with the largest k_1 is taken, and K_eq is that k_1. Kinks beyond 126° are not considered.
    """
    k_i, k_ii = _tips(k_i, k_ii)

    def factors(tip: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, ...]:
        f, slope = _series(theta, _KINK), _series(theta, _KINK_SLOPE)
        a, b = k_i[tip], k_ii[tip]
        return (
            f[..., 0] * a + f[..., 1] * b,
            f[..., 2] * a + f[..., 3] * b,
            slope[..., 0] * a + slope[..., 1] * b,
            slope[..., 2] * a + slope[..., 3] * b,
        )

    def g_slope(tip: np.ndarray, theta: np.ndarray) -> np.ndarray:
        k_1, k_2, dk_1, dk_2 = factors(tip, theta)
        return k_1 * dk_1 + k_2 * dk_2

    def k_1_slope(tip: np.ndarray, theta: np.ndarray) -> np.ndarray:
        return factors(tip, theta)[2]

    angle, k_eq = np.zeros(len(k_i)), np.zeros(len(k_i))
    tip, theta = _turning_points(g_slope, len(k_i), _KINK_GRID)
    k_1, k_2, _, _ = factors(tip, theta)
    _keep_best(angle, k_eq, tip, theta, np.where(k_1 > 0, np.hypot(k_1, k_2), 0.0))
    if (k_eq == 0).any():
        tip, theta = _turning_points(k_1_slope, len(k_i), _KINK_GRID)
        lacking = k_eq[tip] == 0
        tip, theta = tip[lacking], theta[lacking]
        _keep_best(angle, k_eq, tip, theta, np.maximum(factors(tip, theta)[0], 0.0))
    return angle, k_eq


def largest_relative_release_rate(
    k_i: np.ndarray, k_ii: np.ndarray, material: Material
) -> tuple[np.ndarray, np.ndarray]:
    """F-criterion (Shen & Stephansson 1993): the kink with the largest F = G_I/G_Ic + G_II/G_IIc, with K_eq = √F K_Ic.

    So F = (k_1/K_Ic)² + (k_2/K_IIc)² with the factors k_1, k_2 of an infinitesimal kink (`kink_factors`); a kink that
    closes (k_1 < 0) has only its second part. K_IIc = K_Ic gives the criterion of maximum energy release rate, an
    infinite K_IIc that of the largest k_1. Tractions on the faces of a closed kink (friction, stress along the crack)
    do not enter: for an infinitesimal kink they are negligible against k_1 and k_2 (see `f_criterion` for kinks of
    finite length). Kinks beyond 126° are not considered.
    """
    k_i, k_ii = _tips(k_i, k_ii)
    share = material.k_ic / material.k_iic if np.isfinite(material.k_iic) else 0.0

    def factors(tip: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, ...]:
        f, slope = _series(theta, _KINK), _series(theta, _KINK_SLOPE)
        a, b = k_i[tip], k_ii[tip]
        return (
            np.maximum(f[..., 0] * a + f[..., 1] * b, 0.0),
            share * (f[..., 2] * a + f[..., 3] * b),
            slope[..., 0] * a + slope[..., 1] * b,
            share * (slope[..., 2] * a + slope[..., 3] * b),
        )

    def rising(tip: np.ndarray, theta: np.ndarray) -> np.ndarray:
        k_1, k_2, dk_1, dk_2 = factors(tip, theta)
        return k_1 * dk_1 + k_2 * dk_2

    angle, k_eq = np.zeros(len(k_i)), np.zeros(len(k_i))
    tip, theta = _turning_points(rising, len(k_i), _KINK_GRID)
    k_1, k_2, _, _ = factors(tip, theta)
    _keep_best(angle, k_eq, tip, theta, np.hypot(k_1, k_2))
    return angle, k_eq


def minimum_strain_energy_density(
    k_i: np.ndarray, k_ii: np.ndarray, material: Material
) -> tuple[np.ndarray, np.ndarray]:
    """Sih (1974): the tip turns to a local minimum of S = a11 K_I² + 2 a12 K_I K_II + a22 K_II².

    With κ = 3 − 4ν (ν the effective Poisson's ratio) and 16πμ taken out,
    a11 = (1 + cos θ)(κ − cos θ), a12 = sin θ (2 cos θ − κ + 1), a22 = (κ + 1)(1 − cos θ) + (1 + cos θ)(3 cos θ − 1).
    S does not depend on the sign of K, so of its minima the one with the largest hoop stress is taken, if that is
    tensile. K_eq = √(S_min / (2κ − 2)): the K_I that gives the same S ahead of the crack in pure mode I.
    """
    k_i, k_ii = _tips(k_i, k_ii)
    kappa = 3 - 4 * material.effective_poissons_ratio

    def density(tip: np.ndarray, theta: np.ndarray) -> np.ndarray:
        c, s, a, b = np.cos(theta), np.sin(theta), k_i[tip], k_ii[tip]
        return (
            (1 + c) * (kappa - c) * a * a
            + 2 * s * (2 * c - kappa + 1) * a * b
            + ((kappa + 1) * (1 - c) + (1 + c) * (3 * c - 1)) * b * b
        )

    def falling(tip: np.ndarray, theta: np.ndarray) -> np.ndarray:
        c, s, a, b = np.cos(theta), np.sin(theta), k_i[tip], k_ii[tip]
        slope = (
            -s * (kappa - 1 - 2 * c) * a * a
            + 2 * (2 * np.cos(2 * theta) - (kappa - 1) * c) * a * b
            + s * (kappa - 1 - 6 * c) * b * b
        )
        return -slope

    angle, hoop = np.zeros(len(k_i)), np.zeros(len(k_i))
    tip, theta = _turning_points(falling, len(k_i), _GRID)
    c = np.cos(theta / 2)
    _keep_best(angle, hoop, tip, theta, c * (k_i[tip] * c * c - 1.5 * k_ii[tip] * np.sin(theta)))
    every = np.arange(len(k_i))
    return angle, np.where(hoop > 0, np.sqrt(np.maximum(density(every, angle), 0.0) / (2 * kappa - 2)), 0.0)


#: The criteria by the names that scenes use.
CRITERIA: dict[str, Criterion] = {
    "mts": maximum_tangential_stress,
    "g": maximum_energy_release_rate,
    "s": minimum_strain_energy_density,
    "f": largest_relative_release_rate,
}


def kink_factors(theta: np.ndarray) -> np.ndarray:
    """F (..., 2, 2) with (k_1, k_2) = F (K_I, K_II) at the tip of an infinitesimal kink by ``theta`` (...,) rad.

    Amestoy & Leblond (1992), Int. J. Solids Structures 29(4), 465-501: the expansion in m = θ/π to the 20th power.
    """
    theta = np.asarray(theta, dtype=float)
    return _series(theta, _KINK).reshape(*theta.shape, 2, 2)


def _kink_series() -> np.ndarray:
    """Coefficients (21, 4) of F11, F12, F21, F22 in powers of m (Amestoy & Leblond 1992, eqs. 66-69)."""
    p = math.pi
    even = np.arange(0, 21, 2)
    odd = np.arange(1, 20, 2)
    series = np.zeros((21, 4))
    series[even, 0] = [
        1,
        -3 * p**2 / 8,
        p**2 - 5 * p**4 / 128,
        p**2 / 9 - 11 * p**4 / 72 + 119 * p**6 / 15360,
        *(5.07790, -2.88312, -0.0925, 2.996, -4.059, 1.63, 4.1),
    ]
    series[odd, 1] = [
        -3 * p / 2,
        10 * p / 3 + p**3 / 16,
        -2 * p - 133 * p**3 / 180 + 59 * p**5 / 1280,
        *(12.313906, -7.32433, 1.5793, 4.0216, -6.915, 4.21, 4.56),
    ]
    series[odd, 2] = [
        p / 2,
        -4 * p / 3 - p**3 / 48,
        -2 * p / 3 + 13 * p**3 / 30 - 59 * p**5 / 3840,
        *(-6.176023, 4.44112, -1.5340, -2.0700, 4.684, -3.95, -1.32),
    ]
    series[even, 3] = [
        1,
        -(4 + 3 * p**2 / 8),
        8 / 3 + 29 * p**2 / 18 - 5 * p**4 / 128,
        -32 / 15 - 4 * p**2 / 9 - 1159 * p**4 / 7200 + 119 * p**6 / 15360,
        *(10.58254, -4.78511, -1.8804, 7.280, -7.591, 0.25, 12.5),
    ]
    return series


_KINK = _kink_series()
_KINK_SLOPE = _KINK[1:] * np.arange(1, 21)[:, None] / math.pi  # d/dθ


def _series(theta: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    m = np.asarray(theta, dtype=float)[..., None] / math.pi
    return m ** np.arange(len(coefficients)) @ coefficients


def _tips(k_i: np.ndarray, k_ii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    k_i, k_ii = np.atleast_1d(np.asarray(k_i, dtype=float)), np.atleast_1d(np.asarray(k_ii, dtype=float))
    if k_i.shape != k_ii.shape or k_i.ndim != 1:
        raise ValueError(f"K_I and K_II must be vectors of one length, got shapes {k_i.shape} and {k_ii.shape}")
    if not (np.isfinite(k_i).all() and np.isfinite(k_ii).all()):
        raise ValueError("a stress intensity factor is not finite")
    return k_i, k_ii


def _turning_points(slope: Callable, n_tips: int, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All (tip, θ) at which ``slope(tip, θ)`` falls through zero: brackets from the grid, then bisection to
    round-off."""
    tips = np.arange(n_tips)
    values = slope(tips[:, None], grid[None, :])
    tip, at = np.nonzero((values[:, :-1] > 0) & (values[:, 1:] <= 0))
    low, high = grid[at], grid[at + 1]
    for _ in range(50):  # halves a bracket of one degree to below 1e-16 rad
        mid = 0.5 * (low + high)
        rising = slope(tip, mid) > 0
        low, high = np.where(rising, mid, low), np.where(rising, high, mid)
    # θ = 0 is often the exact root, and bisection ends next to it.
    return tip, np.where(np.abs(high) < 1e-15, 0.0, high)


def _keep_best(angle: np.ndarray, best: np.ndarray, tip: np.ndarray, theta: np.ndarray, value: np.ndarray) -> None:
    """Keep for every tip the candidate with the largest positive value; of equal ones see `tie_tolerance.best`."""
    for j in np.unique(tip[value > 0]).tolist():
        own = np.flatnonzero(tip == j)
        k = own[tie_tolerance.best(value[own], theta[own])]
        best[j], angle[j] = value[k], theta[k]
