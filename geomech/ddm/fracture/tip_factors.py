"""Stress intensity factors of a solution as an array, their maximum, and their round-off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..interfaces import SolvedBody

#: Round-off of K, relative to the stress on closed cracks times the root of their length.
ROUND_OFF = 1e-11


def factors(solution: SolvedBody) -> np.ndarray:
    """(n_tips, 2) K_I and K_II, Pa √m."""
    return np.stack([solution.tips["k_i"], solution.tips["k_ii"]], axis=1)


def largest(k: np.ndarray) -> float:
    """The largest √(K_I² + K_II²) of (n_tips, 2) factors, to which errors are relative."""
    return float(np.hypot(*k.T).max(initial=0.0))


def negligible(solution: SolvedBody) -> float:
    """Pa √m: K below this is round-off of the stress on the cracks, for example where closed faces shield the tips."""
    return (
        ROUND_OFF
        * float(np.abs(solution.face_load).max(initial=0.0))
        * float(np.sqrt(solution.body.faces.length.sum()))
    )
