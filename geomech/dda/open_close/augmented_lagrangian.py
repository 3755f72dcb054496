"""Contacts without penetration: augmented Lagrangian multipliers take over the forces of penalty springs.

N = λₙ − kₙ g and S = λₜ − kₛ s, with the multipliers raised to N and S after every open–close iteration to the end
(Uzawa; Hestenes 1969, Simo & Laursen 1992), until the gap g of closed contacts and the elastic motion s of sticking
ones are below a tolerance. The penalty then determines the rate of convergence, not the accuracy. The states are those
of max(0, λₙ − kₙ g), so that contacts open and close by the same test. At constant states the map from multipliers to
forces is linear, and Anderson's (1965) mixing is equivalent to GMRES on it, which soft springs in short steps need.

Multipliers are carried over as the contact's forces; the remaining s is carried over too, so that tolerances do not
accumulate as creep. Contacts with a joint's own stiffness keep their springs, which are physical.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...model import OPEN, STICK
from ..joint_laws.penalty_springs import Springs
from .contact_set import ContactSet
from .equations import Unsettled
from .settled_states import Settled

#: Number of earlier differences that Anderson's mixing combines.
_DEPTH = 12
#: Largest number of multiplier updates before the step is cut. Springs as soft as the blocks take about ten in statics.
_MOST_UPDATES = 60
#: Number of updates after which the springs are stiffened, repeatedly, and by which factor (Bertsekas 1982): soft
#: springs in short steps converge slowly while states change.
_PATIENCE, _STIFFER = 10, 5.0


class _Mixing:
    """Anderson's mixing for the fixed point x = F(x), restarted whenever the set of unknowns changes."""

    def __init__(self) -> None:
        self._which: bytes | None = None
        self._points: list[np.ndarray] = []
        self._rests: list[np.ndarray] = []

    def next(self, x: np.ndarray, image: np.ndarray, which: np.ndarray) -> np.ndarray:
        mark = which.tobytes()
        if mark != self._which:
            self._which, self._points, self._rests = mark, [], []
        rest = np.where(which, image - x, 0.0)
        self._points, self._rests = [*self._points[-_DEPTH:], image], [*self._rests[-_DEPTH:], rest]
        if len(self._rests) == 1:
            return image
        changes = np.stack([rest - r for r in self._rests[:-1]], axis=1)
        weights, *_ = np.linalg.lstsq(changes, rest, rcond=1e-12)
        moved = np.stack([image - p for p in self._points[:-1]], axis=1)
        return np.where(which, image - moved @ weights, image)


def settle_augmented(
    solve: Callable[[ContactSet, Springs, np.ndarray, np.ndarray], Settled],
    found: ContactSet,
    springs: Springs,
    gap: np.ndarray,
    incremented: tuple[np.ndarray, np.ndarray],
    tolerance: float,
) -> Settled:
    """The converged step of ``found`` with multipliers. ``solve`` (contacts, springs, starting gaps, stretch) iterates
    open–close states; ``springs`` and starting ``gap`` (n,) are those of the step; ``incremented``: two arrays (n,), which
    contacts have normal and shear penalty springs; ``tolerance`` m.

    Raises `Unsettled` if the multipliers do not converge.
    """
    n = len(found)
    closed = found.state != OPEN
    pressed, drawn = closed & incremented[0], closed & incremented[1]
    multiplier = np.concatenate([np.where(pressed, found.normal, 0.0), np.where(drawn, found.shear, 0.0)])
    stretch = found.stretch
    penalty_shear, mixing, iterations = found.shear, _Mixing(), 0
    for update in range(_MOST_UPDATES):
        if update and update % _PATIENCE == 0:
            more = np.where(incremented[0], (_STIFFER - 1.0) * springs.normal, 0.0)
            gap = (springs.normal * gap + more * found.gap) / (springs.normal + more)
            shear = np.where(incremented[1], _STIFFER, 1.0) * springs.shear
            springs, mixing = springs._replace(normal=springs.normal + more, shear=shear), _Mixing()
        normal, shear = multiplier[:n], multiplier[n:]
        start = replace(found, shear=np.where(incremented[1], shear, penalty_shear))
        settled = solve(start, springs, gap - normal / springs.normal, stretch)
        iterations += settled.iterations
        closed = settled.state != OPEN
        pressed, drawn = closed & incremented[0], closed & incremented[1]
        sticks = drawn & (settled.state == STICK)
        left = np.where(drawn, (shear - settled.shear_force) / springs.shear, 0.0)
        off = max(np.abs(settled.gap[pressed]).max(initial=0.0), np.abs(left[sticks]).max(initial=0.0))
        if off <= tolerance:
            return replace(settled, stretch=np.where(sticks, left, 0.0), iterations=iterations)
        found = replace(found, state=settled.state, direction=settled.direction, bonded=settled.bonded, tried=None)
        image = np.concatenate(
            [np.where(pressed, settled.normal_force, 0.0), np.where(drawn, settled.shear_force, 0.0)]
        )
        multiplier = mixing.next(multiplier, image, np.concatenate([pressed, sticks]))
    worst = int(np.abs(np.where(pressed, settled.gap, 0.0)).argmax())
    raise Unsettled(
        f"{_MOST_UPDATES} updates of the contact forces left gaps of {off:.3g} m ({tolerance:.3g} m allowed)", worst
    )
