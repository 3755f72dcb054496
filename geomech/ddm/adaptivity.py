"""Element order, number of elements and grading for a target error.

A higher order makes K more accurate, more elements of the same order do not: from one even order to the next the error
falls by a factor of ten to a hundred (an odd order is hardly better than the even one below). A straight crack is
therefore one element unless something is near it (`proximity` divides it then), a side of a body two elements, and the
order follows from the target: it is the lowest whose median error over the problems of
`tests/validation/test_automatic.py` is below half the target.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ..model import DdmSettings
from .kernels import shape_functions

#: (relative error of K, order that reaches it).
_ORDERS = ((1e-2, 2), (1e-4, 4), (1e-5, 6), (1e-7, 8))
#: The order for smaller errors.
HIGHEST = 10
#: Grading ratio of element lengths; needs half as many layers as 0.3.
_RATIO = 0.15
_PER_SIDE = 2


def for_target(settings: DdmSettings) -> DdmSettings:
    """``settings`` with the mesh for their ``target_error``; unchanged if there is none. Raises ValueError if it is not
    between 0 and 1."""
    target = settings.target_error
    if target is None:
        return settings
    check_target(target)
    return of_order(settings, order_for(target), target)


def check_target(target: float) -> None:
    """Raises ValueError for a target error that is not between 0 and 1."""
    if not 0 < target < 1:
        raise ValueError(f"target_error must lie between 0 and 1, got {target!r}")


def order_for(target: float) -> int:
    """The lowest order whose median error is below half the ``target``."""
    return next((p for error, p in _ORDERS if target >= 0.999 * error), HIGHEST)


def of_order(settings: DdmSettings, order: int, target: float) -> DdmSettings:
    """The mesh of ``order``, graded for ``target``."""
    return replace(
        settings,
        order=order,
        elements_per_crack=1,
        elements_per_side=_PER_SIDE,
        grading_ratio=_RATIO,
        # Used at the ends of supports only: corners, kinks and mouths are graded for the target itself.
        grading_layers=math.ceil(-math.log10(target)),
        grading_error=target,
        target_error=None,
    )


def finer(settings: DdmSettings) -> DdmSettings:
    """The next even order, graded one step deeper; at the highest order `coarser`, since the difference between the two
    is all that is needed."""
    if settings.order >= shape_functions.MAX_ORDER:
        return coarser(settings)
    error = settings.grading_error
    return replace(
        settings,
        order=settings.order + (2 if settings.order % 2 == 0 else 1),
        grading_layers=settings.grading_layers + 2,
        grading_error=None if error is None else error / 10,
    )


def coarser(settings: DdmSettings) -> DdmSettings:
    """The next lower even order, graded one step less."""
    error = settings.grading_error
    return replace(
        settings,
        order=max(settings.order - (2 if settings.order % 2 == 0 else 1), 0),
        grading_error=None if error is None else min(10 * error, 0.5),
    )
