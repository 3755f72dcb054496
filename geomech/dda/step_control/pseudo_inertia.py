"""Static steps in which supported blocks bear their loads without inertia.

A static step solves (2M/dt² + K) d = F. The inertia 2M d/dt² limits the displacement of unsupported blocks. On a
supported block it carries a part of the load, the larger the shorter the step: a joint that dilates by d = v dt tan ψ
would be pressed by 2 M v tan ψ/dt. The step is therefore solved again about the last displacement d_k, a proximal point
iteration,

    2M/dt² (d_{k+1} − d_k) + K d_{k+1} = F,

in which the inertia force decreases by q = M/(M + K dt²/2) each time and vanishes on supported blocks. On unsupported
blocks it does not decrease, and they keep their first displacement. Bolts are soft: on the blocks that they support, q
is little below 1. The displacement of these is extrapolated to the sum of the geometric series, d_k + (d_{k+1} −
d_k)/(1 − q) (Aitken 1926), and the step is solved again from there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..interfaces import SteppedSystem
from ..kinematics.tolerances import LITTLE, NOTHING, SAME
from ..open_close.contact_set import ContactSet
from ..open_close.equations import Unsettled
from ..time_step import Attempt, StepStart

#: Blocks are supported if their inertia force decreases to this fraction or less each time; and largest number of
#: solutions. (In a slope of 200 blocks under sudden weight it decreases to an eighth.)
_FALLS, _SOLUTIONS = 0.5, 12


#: A bolt supports a block if it would stop it within this fraction of the block's size √area. After an extrapolation this
#: fraction of the inertia force must have vanished, and little of it may remain in the opposite direction: friction would
#: hold a block that has gone too far.
_WITHIN, _GONE = 0.1, 0.5


def balanced_attempt(
    system: SteppedSystem, start: StepStart, dt: float, found: ContactSet, cuts: int, reach: float = 0.0
) -> Attempt:
    """A static step of ``dt`` from ``start`` in which supported blocks bear their loads without inertia; arguments as
    for `Attempt`. Blocks on bolts move by at most ``reach`` m to the position in which these balance them. Raises
    `Unsettled`."""
    attempt = first = Attempt(system, start, dt, found, cuts)
    inertia, size = attempt.inertia_and_size()
    begun, negligible, ahead = inertia, NOTHING * size, None
    supported, bolted = inertia > negligible, reach > 0.0 and _bolts_hold(start)
    for _ in range(_SOLUTIONS):
        if not (supported & (inertia > negligible)).any():
            break
        again = _again(system, start, attempt, np.where(supported[:, None], attempt.increment, 0.0))
        if again is None:
            break
        after = again.inertia_and_size()[0]
        decreases = after <= np.maximum(_FALLS * inertia, negligible)
        if decreases[supported].all():
            attempt, inertia = again, after
            continue
        extrapolated = (
            _Extrapolated.of(attempt, again, inertia, after, supported & ~decreases, reach) if bolted else None
        )
        trial = (
            None
            if extrapolated is None
            else _again(system, start, again, extrapolated.rest(again, supported & decreases))
        )
        if (
            extrapolated is not None
            and trial is not None
            and extrapolated.confirmed_by(trial, inertia, supported & decreases, negligible)
        ):
            attempt, inertia, supported = (
                trial,
                trial.inertia_and_size()[0],
                (supported & decreases) | extrapolated.blocks,
            )
            ahead = extrapolated.ahead if ahead is None else ahead
            if extrapolated.share < 1.0:
                break
            continue
        if attempt.rest is not None:
            break
        supported &= decreases
    return (
        first
        if ahead is not None and _too_far(attempt, ahead, inertia > np.maximum(LITTLE * begun, negligible))
        else attempt
    )


def _again(system: SteppedSystem, start: StepStart, attempt: Attempt, rest: np.ndarray) -> Attempt | None:
    """The step of ``attempt`` solved again about the displacements ``rest`` (n_blocks, 6); None if contacts find no
    states."""
    same = attempt.found.trying(attempt.found.rows(attempt.settled), without_lost=True)
    try:
        again = Attempt(system, replace(start, rest=rest), attempt.dt, same, attempt.cuts)
    except Unsettled:
        return None
    again.iterations += attempt.iterations
    return again


def _bolts_hold(start: StepStart) -> bool:
    """Whether there are installed bolts that can take more load."""
    rows = start.state.bolts
    most = np.array([bolt.yield_force for bolt in start.loads.bolts])[: len(rows)]
    return bool((rows["installed"] & ~rows["broken"] & (rows["force"] < most)).any())


def _too_far(attempt: Attempt, ahead: np.ndarray, unbalanced: np.ndarray) -> bool:
    """Whether an ``unbalanced`` block has moved beyond the equilibrium position on its bolt, which lies ``ahead``,
    (n_blocks, 6)."""
    if attempt.rest is None:
        return False
    back = np.einsum("na,na->n", attempt.increment - attempt.rest, ahead) < 0.0
    return bool((back & unbalanced).any())


@dataclass(frozen=True, eq=False)
class _Extrapolated:
    """Blocks that bolts will stop: ``blocks`` (n_blocks,) bool, their remaining displacement ``ahead`` (n_blocks, 6)
    after an attempt, and the ``share`` of it that a step may make."""

    blocks: np.ndarray
    ahead: np.ndarray
    share: float

    @classmethod
    def of(
        cls, attempt: Attempt, again: Attempt, inertia: np.ndarray, after: np.ndarray, slow: np.ndarray, reach: float
    ) -> _Extrapolated | None:
        """From two attempts and the inertia forces in each, ``inertia`` and ``after`` (n_blocks,) N; only blocks that
        are ``slow``. None if there are none."""
        size = np.sqrt(attempt.moments[:, 0])
        gain = 1.0 - after / np.maximum(inertia, 1e-300)
        slow = slow & (gain > SAME)
        ahead = np.where(slow[:, None], again.increment - attempt.increment, 0.0)
        ahead /= np.where(slow, gain, 1.0)[:, None]
        far = np.hypot(ahead[:, 0], ahead[:, 1]) + size * np.abs(ahead[:, 2])
        slow &= far <= _WITHIN * size
        if not slow.any():
            return None
        return cls(slow, ahead * slow[:, None], min(1.0, reach / max(float(far[slow].max()), 1e-300)))

    def confirmed_by(self, trial: Attempt, inertia: np.ndarray, supported: np.ndarray, negligible: np.ndarray) -> bool:
        """Whether in the attempt ``trial``, solved about `rest`, the inertia force has decreased from ``inertia``,
        (n_blocks,) N, as expected. ``supported``: other blocks that must meet the criterion; ``negligible``: force that
        counts as zero."""
        least = np.where(self.blocks, 1.0 - _GONE * self.share, _FALLS)
        after = trial.inertia_and_size()[0]
        return bool((after <= np.maximum(least * inertia, negligible))[supported | self.blocks].all())

    def rest(self, again: Attempt, supported: np.ndarray) -> np.ndarray:
        """(n_blocks, 6) displacement about which to solve; that of ``again`` for the blocks ``supported``."""
        return np.where((supported | self.blocks)[:, None], again.increment + self.share * self.ahead, 0.0)
