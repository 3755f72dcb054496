"""Toppling slope of sixteen blocks (Goodman & Bray 1976): geometry, published forces, and limit equilibrium.

Goodman & Bray (1976), "Toppling of rock slopes", in: Rock engineering for foundations and slopes, ASCE Specialty
Conference, Boulder, vol. 2, 201-234; the example and its table also in Hoek & Bray (1981), Rock slope engineering, 3rd
ed., chapter 10, and in Wyllie & Mah (2004), 4th ed., table 9.1. Blocks are numbered from the toe, 1 … 16, block 10
stands at the crest. Lengths m, forces kN per metre of thickness, unit weight kN/m³.

`limit_equilibrium` reproduces the printed forces: every thrust within 0.1 kN, every normal force
within 1.5 kN (three are printed without decimals) and the limit friction within 1e-4
(`tests/validation/test_dda_slopes.py`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

WIDTH, BASE_DIP_DEG, UNIT_WEIGHT, CREST = 10.0, 30.0, 25.0, 10
#: Steps from block to block: tops below and above the crest, bases.
STEP_BELOW, STEP_ABOVE, STEP_BASE = 5.0, 5.0, 1.0
HEIGHTS = np.array([4.0, 8, 12, 16, 20, 24, 28, 32, 36, 40, 34, 28, 22, 16, 10, 4])

#: tan φ at which the slope is just stable without support, and the printed φ, degrees.
LIMIT_FRICTION, LIMIT_FRICTION_DEG = 0.7855, 38.15

#: Blocks 1 … 16 at that friction: force from the block above P_{n+1} (what the table calls P_n comes from block n on
#: block n−1), base normal R_n and shear S_n, kN (Wyllie & Mah 2004, table 9.1). The toe's own P is 0.5 kN by Goodman &
#: Bray.
PUBLISHED_P = np.array(
    [472.2, 1413.5, 2825.6, 3978.1, 4637.5, 4837.0, 4594.8, 3922.1, 2826.7, 1556.0, 825.7, 292.5, 0, 0, 0, 0]
)
PUBLISHED_R = np.array(
    [1237.1, 2471.4, 3707.3, 4369.4, 4848.1, 5352.9, 5872.0, 6399.8, 6933.8, 7662.1, 6787.6,
     5643.3, 4533.4, 3463, 2165, 866]
)  # fmt: skip
PUBLISHED_S = np.array(
    [971.8, 1941.3, 2912.1, 3152.5, 3159.4, 3199.5, 3257.8, 3327.3, 3404.6, 3729.3, 3520.0,
     2966.8, 2457.5, 2000, 1250, 500]
)  # fmt: skip
#: Blocks that slide, that topple, and that are stable.
SLIDING, TOPPLING, STANDING = range(1, 4), range(4, 14), range(14, 17)


@dataclass(frozen=True, eq=False)
class Limit:
    """Forces (16,) kN of blocks 1 … 16: ``thrust`` P_n of block n on block n−1, ``normal`` R_n and ``shear`` S_n on its
    base. ``thrust[0]`` is the force required to support the toe: the slope is stable while it is zero."""

    thrust: np.ndarray
    normal: np.ndarray
    shear: np.ndarray


def limit_equilibrium(friction: float) -> Limit:
    """Goodman & Bray's (1976) calculation, from the top block down, with ``friction`` = tan φ in all joints.

    Block n topples about its toe under P_{n−1} = [P_n (M − Δx tan φ) + ½ W (y sin α − Δx cos α)]/L, or slides under
    P_{n−1} = P_n − W (cos α tan φ − sin α)/(1 − tan²φ); the larger thrust acts, if it is positive. M and L are the
    heights of the two thrusts above the base.
    """
    dip = math.radians(BASE_DIP_DEG)
    sine, cosine = math.sin(dip), math.cos(dip)
    thrust, normal, shear = np.zeros(16), np.zeros(16), np.zeros(16)
    above = 0.0
    for n in range(16, 0, -1):
        height = HEIGHTS[n - 1]
        weight = UNIT_WEIGHT * WIDTH * height
        m = height if n < CREST else height - STEP_ABOVE
        arm = height if n > CREST else height - STEP_BELOW
        slide = above - weight * (cosine * friction - sine) / (1 - friction**2)
        # The toe block has no block in front of it to topple against: it can only slide.
        topple = -math.inf
        if n > 1:
            topple = (above * (m - friction * WIDTH) + 0.5 * weight * (height * sine - WIDTH * cosine)) / arm
        push = max(0.0, slide, topple)
        thrust[n - 1] = push
        normal[n - 1] = weight * cosine + friction * (above - push)
        shear[n - 1] = weight * sine + above - push
        above = push
    return Limit(thrust, normal, shear)


def limit_friction() -> float:
    """tan φ at which the toe block needs no support, by bisection of `limit_equilibrium`."""
    low, high = 0.6, 0.95
    while high - low > 1e-12:
        mid = 0.5 * (low + high)
        low, high = (mid, high) if limit_equilibrium(mid).thrust[0] > 0 else (low, mid)
    return 0.5 * (low + high)


def polygons() -> list[np.ndarray]:
    """The stepped base and blocks 1 … 16 as (n, 2) outlines, m: the toe at the origin, uphill to the right."""
    steps = [(WIDTH * n, n - up) for n in range(16, 0, -1) for up in (0, STEP_BASE)]
    base = [(-30.0, -20.0), (200.0, -20.0), (200.0, 16.0), *steps, (-30.0, 0.0)]
    blocks = [
        [(WIDTH * k, k), (WIDTH * k + WIDTH, k), (WIDTH * k + WIDTH, k + y), (WIDTH * k, k + y)]
        for k, y in enumerate(HEIGHTS)
    ]
    dip = math.radians(BASE_DIP_DEG)
    turn = np.array([[math.cos(dip), math.sin(dip)], [-math.sin(dip), math.cos(dip)]])
    return [np.array(p, dtype=float) @ turn for p in (base, *blocks)]
