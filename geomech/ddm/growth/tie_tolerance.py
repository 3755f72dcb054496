"""What counts as equal where growth chooses: rounding must not.

Sums are taken in another order by another processor, and differ in their last digits. In a symmetric body K at two
tips, the sizes of two kinks or the ways to two faces are equal but for that, and multiples of an increment add up to a
ligament or to less than it. So quantities that differ by less than what is named here are one, and a rule that does not
look at them decides: as a rule that things stay as they are, else the order in which they are given.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

import numpy as np

#: Values nearer than this part of themselves are one. Solutions agree to some 1e-12 between processors, and are right
#: to 1e-5 at best.
TIED = 1e-9
#: Directions nearer than this are one, rad. They move by 1e-13 between processors, and by this if K_II is off by 5e-7
#: of K_I, a hundredth of what it is right to.
ONE_WAY = 1e-6


def reached(value: np.ndarray, limit: np.ndarray | float) -> np.ndarray:
    """Whether ``value`` is at least ``limit``, both positive, or equal to it (`TIED`)."""
    return np.asarray(value) >= (1 - TIED) * np.asarray(limit)


def in_order(values: Sequence[float], apart: float) -> list[int]:
    """Which of ``values`` comes first, second …, from the least on; those within ``apart`` of the least that is left
    come next, as they are given."""
    rising = sorted(range(len(values)), key=lambda k: values[k])
    order: list[int] = []
    while len(order) < len(rising):
        left = rising[len(order) :]
        order += sorted(takewhile(lambda k: values[k] <= values[left[0]] + apart, left))  # noqa: B023
    return order


def best(value: np.ndarray, turn: np.ndarray) -> int:
    """Which of the directions at ``turn`` (n,) rad from straight ahead has the largest ``value`` (n,); of those as good
    the one that turns least, and of two that turn alike the one to the left (counter-clockwise)."""
    as_good = np.flatnonzero(reached(value, np.max(value)))
    return int(as_good[np.argmin(np.abs(turn[as_good]) - ONE_WAY * (turn[as_good] > 0))])
