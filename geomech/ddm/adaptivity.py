"""From the error that is asked for to order, elements and grading.

More elements of one order do not make K more accurate, a higher order does: by a factor of ten to a hundred from one
even order to the next (odd ones are hardly better than the even one below). So a straight crack is one element as long
as nothing is near (`proximity` halves what is), a side of a body two, and the order follows the target. The orders are
those whose median error over the problems of `tests/validation/test_automatic.py` is below half the target.
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
#: Elements are graded by this ratio: half as many layers do what those of 0.3 do.
_RATIO = 0.15
_PER_SIDE = 2


def for_target(settings: DdmSettings) -> DdmSettings:
    """``settings`` with the mesh that their ``target_error`` asks for; as they are without one. ValueError when it is
    not between 0 and 1."""
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
    """The order whose median error is below half the ``target``."""
    return next((p for error, p in _ORDERS if target >= 0.999 * error), HIGHEST)


def of_order(settings: DdmSettings, order: int, target: float) -> DdmSettings:
    """The mesh of ``order``, graded for ``target``."""
    return replace(
        settings,
        order=order,
        elements_per_crack=1,
        elements_per_side=_PER_SIDE,
        grading_ratio=_RATIO,
        # Only the ends of supports ask for these: corners, kinks and mouths are graded for the target itself.
        grading_layers=math.ceil(-math.log10(target)),
        grading_error=target,
        target_error=None,
    )


def finer(settings: DdmSettings) -> DdmSettings:
    """The next even order, graded one step deeper; at the highest order the even one below instead, as what differs
    from it is known then as well."""
    up = settings.order < shape_functions.MAX_ORDER
    error = settings.grading_error
    return replace(
        settings,
        order=settings.order + (2 if settings.order % 2 == 0 else 1) * (1 if up else -1),
        grading_layers=settings.grading_layers + 2 if up else settings.grading_layers,
        grading_error=None if error is None else error / 10 if up else min(10 * error, 0.5),
    )
