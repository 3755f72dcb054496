"""Stress intensity factors of a solution as an array, their largest, and what of them is round-off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..interfaces import SolvedBody

#: K below this part of the stress on closed cracks times the root of their length is no K.
ROUND_OFF = 1e-11


def factors(solution: SolvedBody) -> np.ndarray:
    """(n_tips, 2) K_I and K_II, Pa √m."""
    return np.stack([solution.tips["k_i"], solution.tips["k_ii"]], axis=1)


def largest(k: np.ndarray) -> float:
    """The largest √(K_I² + K_II²) of (n_tips, 2) factors: what errors are relative to."""
    return float(np.hypot(*k.T).max(initial=0.0))


def negligible(solution: SolvedBody) -> float:
    """Pa √m: K that is round-off of the stress on the cracks, where faces in contact let none of it reach the tips."""
    return (
        ROUND_OFF
        * float(np.abs(solution.face_load).max(initial=0.0))
        * float(np.sqrt(solution.body.faces.length.sum()))
    )
