"""Many cracks in the plane: closed forms of periodic arrays, and systems of straight cracks by `dislocations`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .dislocations import Arm, stack, stress_intensity


def collinear_array(stress: float, half_length: float, period: float) -> float:
    """K_I (and, in shear, K_II) of collinear cracks 2a with a ``period`` b between their centres: σ√(b tan(πa/b))
    (Westergaard 1939; Irwin 1957)."""
    return stress * math.sqrt(period * math.tan(math.pi * half_length / period))


def stacked_array(half_length: float, period: float, n: int = 65) -> float:
    """K_I/σ of parallel cracks 2a above one another, with a ``period`` h, in tension normal to them (computed,
    `dislocations.stack`); √(h/2) if they are long compared with h (Koiter 1959)."""
    pulled = np.array([0.0, 1.0, 0.0])
    return float(stress_intensity([Arm(-half_length, half_length)], _uniform(pulled), stack(period), n)[0, 0])


def stacked_array_limit(stress: float, period: float) -> float:
    """K_I = σ√(h/2) of long cracks above one another (Koiter 1959): each strip's strain energy σ²h/2E' is released."""
    return stress * math.sqrt(period / 2)


def straight_cracks(ends: Sequence[np.ndarray], stress: np.ndarray, n: int = 33) -> np.ndarray:
    """(2 n_cracks, 2) K_I, K_II at the start and end of every crack (2, 2) in a remote ``stress`` (3,), with all of
    them open (computed, `dislocations`)."""
    arms = [Arm(complex(*a), complex(*b), crack=k) for k, (a, b) in enumerate(ends)]
    return stress_intensity(arms, _uniform(stress), n=n)


def near_surface(ends: np.ndarray, pressure: float, n: int = 65) -> np.ndarray:
    """(2, 2) K_I, K_II at the start and end of a crack (2, 2) below the free surface y = 0 with the fluid ``pressure``
    in it (computed, `dislocations`)."""
    (a, b), inside = ends, np.array([pressure, pressure, 0.0])
    return stress_intensity([Arm(complex(*a), complex(*b))], _uniform(inside), "half-plane", n)


#: Edge crack in a half-plane, K_I/(σ√(πa)) (Koiter 1965). The digits are those of `dislocations` with 257 to 1025
#: points, which differ by 1e-11.
EDGE_CRACK_HALF_PLANE = 1.1215222552


def _uniform(stress: np.ndarray):
    return lambda points: np.broadcast_to(np.asarray(stress, dtype=float), (len(points), 3))


def random_cracks(number: int, seed: int = 7, length: float = 1.0, spacing: float = 1.0) -> list[np.ndarray]:
    """``number`` cracks (2, 2) of 0.4 to 1 times the given ``length`` in random directions in a square. Distances
    between cracks are at least a fifth of their length. ``spacing``: side of the square per crack."""
    random = np.random.default_rng(seed)
    side = spacing * math.sqrt(number) * length
    chosen: list[np.ndarray] = []
    t = np.linspace(-1, 1, 41)[:, None]
    while len(chosen) < number:
        half = 0.5 * length * random.uniform(0.4, 1.0)
        angle = random.uniform(0, math.pi)
        way = half * np.array([math.cos(angle), math.sin(angle)])
        centre = random.uniform(0, side, 2)
        line = centre + t * way
        others = (c[0] + (t + 1) / 2 * (c[1] - c[0]) for c in chosen)
        if all(np.hypot(*(line[:, None] - other[None]).T).min() > 0.4 * half for other in others):
            chosen.append(np.array([centre - way, centre + way]))
    return chosen


def cracks_in_cells(number: int, seed: int = 0, spread: float = 6.0) -> list[np.ndarray]:
    """``number``² cracks (2, 2) of lengths from 0.96 down to 0.96/``spread``, evenly distributed in the logarithm, each
    in a random position and direction in its cell of side 1. Fast for thousands of cracks; neighbours may be as near as
    a fiftieth."""
    random = np.random.default_rng(seed)
    n = number * number
    half = 0.48 * spread ** -random.uniform(0, 1, n)
    turn = random.uniform(0, math.pi, n)
    arm = half[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    cell = np.stack(np.meshgrid(np.arange(number), np.arange(number)), axis=-1).reshape(-1, 2) + 0.5
    centre = cell + random.uniform(-1, 1, (n, 2)) * (0.49 - np.abs(arm))
    return list(np.stack([centre - arm, centre + arm], axis=1))
