"""A disc pressed along a diameter, whole (Hertz 1883) and with a central crack (Atkinson, Smelser & Sanchez 1982)."""

from __future__ import annotations

import math

import numpy as np

from .dislocations import Arm, stress_intensity

#: Atkinson, Smelser & Sanchez 1982, quoted from later literature (T_1 confirmed by `central_crack` to 3e-6): a/R → coefficients T_1 … T_5 and S_1 … S_5 of the series of `atkinson`.
T = {
    0.1: (1.014998, 0.503597, 0.376991, 0.376991, 0.314159),
    0.2: (1.060049, 0.514907, 0.382430, 0.383392, 0.318086),
    0.3: (1.135551, 0.533477, 0.391640, 0.393835, 0.325033),
}
S = {
    0.1: (1.009987, 0.502341, 0.376991, 0.376991, 0.314159),
    0.2: (1.039864, 0.509959, 0.379956, 0.380584, 0.316245),
    0.3: (1.089702, 0.522272, 0.384867, 0.386253, 0.319495),
}


def whole_disc(points: np.ndarray, load: float, angle: float = math.pi / 2) -> np.ndarray:
    """(n, 3) stress in a disc of radius 1 pressed by ``load`` (N/m) on the ends of the diameter at ``angle`` (rad)
    (Hertz 1883): two Flamant fields −2P cos θ/(πr) and a uniform P/π."""
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
    """(2,) K_I, K_II of a central crack along the x-axis in a disc of radius 1 pressed by ``load`` on the diameter that
    stands at ``angle`` (rad) from the crack (computed, `dislocations`)."""
    arms = [Arm(-half_length, half_length)]
    return stress_intensity(arms, lambda p: whole_disc(p, load, angle), "disc", n)[1]


def normalised(k: np.ndarray, half_length: float) -> np.ndarray:
    """N_I, N_II = K √π R/(P √a), R = P = 1."""
    return np.asarray(k) * math.sqrt(math.pi / half_length)


def small_crack(ratio: float, angle: float) -> tuple[float, float]:
    """N_I, N_II for small a/R, an error of order (a/R)² times their own correction (Atkinson, Smelser & Sanchez 1982);
    ``angle`` between crack and load."""
    c, s = math.cos(angle), math.sin(angle)
    first = 1 - 4 * s * s + 4 * s * s * (1 - 4 * c * c) * ratio**2
    return first, (2 + (8 * c * c - 5) * ratio**2) * math.sin(2 * angle)


def atkinson(ratio: float, angle: float) -> tuple[float, float]:
    """N_I and |N_II| by the series in (a/R)², ``ratio`` = a/R a key of `T` (Atkinson, Smelser & Sanchez 1982); four terms
    of the second, whose fifth is below 2e-3 there. The paper was not at hand: signs in the fourth term of N_II are those that
    agree with `central_crack` to what the series leaves out."""
    c2 = math.cos(angle) ** 2
    s2, k = 1 - c2, 2 * c2 - 1
    first = (
        1 - 4 * s2,
        8 * s2 * (1 - 4 * c2),
        -4 * s2 * (3 - 36 * c2 + 48 * c2**2),
        -16 * s2 * (-1 + 24 * c2 - 80 * c2**2 + 64 * c2**3),
        -20 * s2 * (1 - 40 * c2 + 240 * c2**2 - 448 * c2**3 + 256 * c2**4),
    )
    second = (1, 8 * c2 - 5, -3 - 8 * k * (2 - 3 * c2), 3 - 16 * k - 12 * k**2 + 32 * k**3)
    n_i = sum(t * ratio ** (2 * i) * a for i, (t, a) in enumerate(zip(T[ratio], first)))
    n_ii = 2 * math.sin(2 * angle) * sum(t * ratio ** (2 * i) * b for i, (t, b) in enumerate(zip(S[ratio], second)))
    return n_i, abs(n_ii)
