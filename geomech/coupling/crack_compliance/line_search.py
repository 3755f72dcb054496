"""Line search in the iteration between block motion and crack strain, in motion.

Cracks respond to the stress σ of their block with the strain ε_c(σ) = ∂W/∂σ, W convex (`mean_stress_response`); the rest of
the block and its inertia take up what remains of its strain. A pass linearises ε_c about the last stress and finds the next
one: Newton's method. While faces open and close, S = ∂ε_c/∂σ jumps between the values of their states, and the iteration may
run in a circle. Its limit, the stress of the block, minimises a convex function. Its derivative along a step d of stress is

    g(α) = F(σ + α d) · d,      F = strain that is left over = ε_c found − ε_c assumed + (1 − α) F before,

so that a step beyond the minimum is known by g > 0. Then g = 0 is bracketed, and the cracks are linearised there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

#: A step is long enough, and not too long, where |g| is at most this part of its value at the beginning.
_FLAT = 0.5
#: Largest number of solutions of a search.
_TRIALS = 8


class Linearised(NamedTuple):
    """The cracks of a block linearised at ``stress``: their ``strain`` and ``compliance`` there, and the strain ``left``
    over. All in the block's own axes, (w,) and (w, w)."""

    stress: np.ndarray
    strain: np.ndarray
    compliance: np.ndarray
    left: np.ndarray


class LineSearch:
    """The last linearisation of each block (block →) in a pass."""

    def __init__(self) -> None:
        self._last: dict[int, Linearised] = {}

    def forget(self) -> None:
        """Start again: the step has another length."""
        self._last = {}

    def next(
        self,
        block: int,
        found: Linearised,
        assumed: np.ndarray,
        at: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    ) -> Linearised:
        """Where the cracks of ``block`` are to be linearised next: ``found`` or nearer to the last one.

        ``assumed`` (w,): crack strain that the pass assumed at the stress of ``found``, whose ``left`` is the strain found
        minus this one. ``at``: strain and compliance under another stress (w,), Pa, in the block's own axes."""
        began = self._last.get(block)
        self._last[block] = found
        if began is None or began.stress.shape != found.stress.shape:
            return found
        step = found.stress - began.stress
        shift = assumed - began.compliance @ step - began.strain
        before = began.left + shift
        start, end = float(before @ step), float(found.left @ step)
        if not (start < 0.0 and end > -_FLAT * start):
            return found
        low, high, rate_low, rate_high, best = 0.0, 1.0, start, end, found
        for _ in range(_TRIALS):
            part = low - (high - low) * rate_low / (rate_high - rate_low)
            part = min(max(part, low + 0.1 * (high - low)), high - 0.1 * (high - low))
            stress = began.stress + part * step
            strain, compliance = at(stress)
            linear = began.strain + shift + part * (began.compliance @ step)
            best = Linearised(stress, strain, compliance, (1.0 - part) * before + strain - linear)
            rate = float(best.left @ step)
            if abs(rate) <= -_FLAT * start:
                break
            if rate < 0.0:
                low, rate_low = part, rate
            else:
                high, rate_high = part, rate
        self._last[block] = best
        return best
