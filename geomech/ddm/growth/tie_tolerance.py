"""Tolerances for decisions in growth that must not depend on rounding.

Processors sum in different orders and differ in the last digits. In a symmetric body K at two tips, the values of two
kinks or the distances to two faces are equal up to that, and increments may just add up to a ligament or not.
Quantities that differ by less than these tolerances count as equal, and another rule decides: in general that nothing
changes, otherwise the given order.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

import numpy as np

#: Relative tolerance of values. Solutions agree to about 1e-12 between processors, and are accurate to 1e-5 at best.
TIED = 1e-9
#: Tolerance of directions, rad. They differ by 1e-13 between processors, and by this much if K_II is off by 5e-7 of
#: K_I, a hundredth of its accuracy.
ONE_WAY = 1e-6


def reached(value: np.ndarray | float, limit: np.ndarray | float) -> np.ndarray:
    """Whether ``value`` is at least ``limit``, both positive, or equal to it (`TIED`)."""
    return np.asarray(value) >= (1 - TIED) * np.asarray(limit)


def in_order(values: Sequence[float], apart: float) -> list[int]:
    """Indices of ``values`` in ascending order; those within ``apart`` of the least remaining one come next, in the
    given order."""
    rising = sorted(range(len(values)), key=lambda k: values[k])
    order: list[int] = []
    while len(order) < len(rising):
        left = rising[len(order) :]
        order += sorted(takewhile(lambda k: values[k] <= values[left[0]] + apart, left))  # noqa: B023
    return order


def best(value: np.ndarray, turn: np.ndarray) -> int:
    """Index of the direction with the largest ``value`` (n,), among those at ``turn`` (n,) rad from straight ahead; of
    equal values that with the smallest turn, of equal turns the one to the left (counter-clockwise)."""
    as_good = np.flatnonzero(reached(value, np.max(value)))
    return int(as_good[np.argmin(np.abs(turn[as_good]) - ONE_WAY * (turn[as_good] > 0))])
