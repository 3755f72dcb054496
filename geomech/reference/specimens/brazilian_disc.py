"""A disc compressed along a diameter, intact (Hertz 1883) and with a central crack (Atkinson, Smelser & Sanchez 1982)."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ..cracks.boundary_collocation import crack_in_disc
from ..cracks.dislocations import Arm, stress_intensity

#: Number of terms of the series in `atkinson`, as in the paper.
TERMS = 5


def whole_disc(points: np.ndarray, load: float, angle: float = math.pi / 2) -> np.ndarray:
    """(n, 3) stress in a disc of radius 1 compressed by ``load`` (N/m) at the ends of the diameter at ``angle`` (rad)
    (Hertz 1883): two Flamant fields −2P cos θ/(πr) and a uniform stress P/π."""
    points = np.asarray(points, dtype=float)
    way = np.array([math.cos(angle), math.sin(angle)])
    out = np.tile([1.0, 1.0, 0.0], (len(points), 1)) * load / math.pi
    for side in (1.0, -1.0):
        d = points - side * way
        r2 = np.sum(d * d, axis=1)
        radial = -2 * load / math.pi * (d @ (-side * way)) / r2
        out += (radial / r2)[:, None] * np.column_stack([d[:, 0] ** 2, d[:, 1] ** 2, d[:, 0] * d[:, 1]])
    return out


def central_crack(half_length: float, angle: float, load: float = 1.0, n: int = 65) -> np.ndarray:
    """(2,) K_I, K_II of a central crack along the x-axis in a disc of radius 1 compressed by ``load`` along the
    diameter at ``angle`` (rad) to the crack (computed, `dislocations`)."""
    arms = [Arm(-half_length, half_length)]
    return stress_intensity(arms, lambda p: whole_disc(p, load, angle), "disc", n)[1]


def normalised(k: np.ndarray, half_length: float) -> np.ndarray:
    """N_I, N_II = K √π R/(P √a), R = P = 1."""
    return np.asarray(k) * math.sqrt(math.pi / half_length)


def small_crack(ratio: float, angle: float) -> tuple[float, float]:
    """N_I, N_II for small a/R, with an error of order (a/R)² times the correction included here (Atkinson, Smelser &
    Sanchez 1982); ``angle`` between crack and load."""
    c, s = math.cos(angle), math.sin(angle)
    first = 1 - 4 * s * s + 4 * s * s * (1 - 4 * c * c) * ratio**2
    return first, (2 + (8 * c * c - 5) * ratio**2) * math.sin(2 * angle)


@lru_cache
def power_factors(ratio: float, terms: int = TERMS) -> tuple[np.ndarray, np.ndarray]:
    """(terms,) T_i and S_i: K_I and K_II, in units of √(πa), of a crack a/R = ``ratio`` whose faces carry the traction
    (x/a)^(2i−2).

    These coefficients of Atkinson, Smelser & Sanchez (1982) are computed by `boundary_collocation` (not taken from
    their table, which later literature reproduces with errors beyond the second column); `dislocations` agrees to ten
    digits.
    """
    out = [
        [crack_in_disc(ratio, 2 * j, shear) / ratio ** (2 * j) / math.sqrt(math.pi * ratio) for j in range(terms)]
        for shear in (False, True)
    ]
    return np.array(out[0]), np.array(out[1])


def hertz_powers(angle: float, terms: int = TERMS) -> tuple[np.ndarray, np.ndarray]:
    """(terms,) normal and shear traction on the line of the crack in the intact disc, as coefficients of (x/R)^(2j),
    for P/πR = 1.

    −4 (j+1) sin θ sin (2j+1)θ (for j = 0 plus a uniform part of 1: 1 − 4 sin²θ) and 2j sin 2jθ − 2 (j+1) sin 2(j+1)θ,
    by expansion of `whole_disc`; θ = ``angle`` between crack and load.
    """
    j = np.arange(terms)
    pull = -4 * (j + 1) * math.sin(angle) * np.sin((2 * j + 1) * angle)
    pull[0] += 1
    return pull, 2 * j * np.sin(2 * j * angle) - 2 * (j + 1) * np.sin(2 * (j + 1) * angle)


def atkinson(ratio: float, angle: float, terms: int = TERMS) -> tuple[float, float]:
    """N_I and |N_II| by the series in (a/R)², ``ratio`` = a/R (Atkinson, Smelser & Sanchez 1982), with `power_factors`.
    The omitted terms are of order 4 ``terms`` (a/R)^(2 terms) T."""
    reach = ratio ** (2.0 * np.arange(terms))
    pull, shear = hertz_powers(angle, terms)
    opened, slid = power_factors(ratio, terms)
    return float(np.sum(opened * reach * pull)), abs(float(np.sum(slid * reach * shear)))
