"""Unilateral contact of crack faces: which collocation nodes are closed.

With the boundary eliminated, the tractions on the faces are S w + r (S the Schur complement, w slip and opening, r what
the loads do to closed faces). At every node the opening cannot pass −aperture and the face can only press:

    w_n + a ≥ 0,   λ = −(S w + r)_n − p ≥ 0,   λ (w_n + a) = 0,   shear traction zero.

It is solved by block principal pivoting (Júdice & Pires 1994): all violated nodes change side at once, as Newton's
method would; when that turns in a round, one at a time in a fixed order of nodes (Murty 1974), which cannot for a
P-matrix.

Where rock runs out in a blade, between a crack and the side that it meets at a few degrees, discrete compliance is no
P-matrix (a point of the blade's end, pressed upon, moves the wrong way), and no state of the nodes there may satisfy
them all. Where single exchanges lead to nothing, the nodes of which block exchanges made their round are left
undecided, in that of its states with the least violation, and the others settle without them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


class NotConverged(RuntimeError):
    """The contact of crack faces was not settled; ``node`` is the number of the one that is worst, if that is known."""

    def __init__(self, message: str, node: int | None = None):
        super().__init__(message)
        self.node = node


@dataclass(frozen=True, eq=False)
class Settled:
    """``closed`` (n,) bool after so many ``solves``; ``undecided`` (n,) bool, nodes that no state satisfies, and their
    worst ``violation``, of the scale of gaps and pressures."""

    closed: np.ndarray
    solves: int
    undecided: np.ndarray
    violation: float


def settle(
    respond: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    can_close: np.ndarray,
    closed: np.ndarray,
    tolerance: float = 1e-10,
    limit: int = 2000,
) -> Settled:
    """Which nodes are closed.

    ``respond(closed)`` (n,) bool solves with these nodes closed and returns the gap w_n + a and the pressure λ of all
    nodes, each scaled to order one; what it was called with last is what is returned. ``can_close`` (n,) bool;
    ``closed`` (n,) the first guess. Raises NotConverged.
    """
    closed = closed & can_close
    undecided = np.zeros(len(closed), bool)
    best, solves, single = len(closed), 0, False
    most = 2 * int(can_close.sum())
    # The states that exchanges went through, with the violation of each, and the round that block exchanges turned in.
    been: dict[bytes, tuple[np.ndarray, float]] = {}
    round_: list[tuple[np.ndarray, float]] = []
    while solves < limit:
        gap, pressure = respond(closed)
        solves += 1
        short = np.where(closed, pressure, np.where(can_close, gap, 0.0))
        wrong = (short < -tolerance) & ~undecided
        best = min(best, int(wrong.sum()))
        if not wrong.any():
            return Settled(closed, solves, undecided, -float(short.min(where=undecided, initial=0.0)))
        key = closed.tobytes()
        again = key in been or single and len(been) == most
        been.setdefault(key, (closed, -float(short.min())))
        if again and single:
            undecided = undecided | np.any([state != round_[0][0] for state, _ in round_], axis=0)
            closed = min(round_, key=lambda state: state[1])[0]
        elif again:
            every = list(been)
            round_ = [been[state] for state in every[every.index(key) :]]
        if again:
            single = not single
            been.clear()
        if single:
            wrong[: int(np.flatnonzero(wrong)[-1])] = False
        if single or not again:
            closed = closed ^ wrong
    raise NotConverged(f"crack faces did not settle in {limit} solves; {best} nodes at best were in violation")
