"""Unilateral contact of crack faces: which collocation nodes are closed.

With the boundary eliminated, the tractions on the faces are S w + r (S the Schur complement, w slip and opening, r the
tractions of the loads on closed faces). At every node the opening is at least −aperture and the faces cannot pull:

    w_n + a ≥ 0,   λ = −(S w + r)_n − p ≥ 0,   λ (w_n + a) = 0,   shear traction zero.

Solved by block principal pivoting (Júdice & Pires 1994): all violated nodes change state at once, as in Newton's
method. When that cycles, one node at a time in fixed order (Murty 1974), which cannot cycle for a P-matrix.

Where rock ends in a thin blade, between a crack and a side that it meets at a few degrees, the discrete compliance is
not a P-matrix (a loaded point of the blade moves the wrong way), and no state may satisfy all nodes. If single changes
do not converge, the nodes that took part in the cycle are left undecided, in the state of the cycle with the least
violation, and the others are solved without them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


class NotConverged(RuntimeError):
    """Contact of crack faces did not converge; ``node``: the worst one, if known."""

    def __init__(self, message: str, node: int | None = None):
        super().__init__(message)
        self.node = node


@dataclass(frozen=True, eq=False)
class Settled:
    """``closed`` (n,) bool after so many ``solves``; ``undecided`` (n,) bool: nodes without a consistent state, and
    their largest ``violation``, relative to the scale of gaps and pressures."""

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
    nodes, each scaled to order one; its last call is that of the result. ``can_close`` (n,) bool; ``closed`` (n,):
    first guess. Raises NotConverged.
    """
    closed = closed & can_close
    undecided = np.zeros(len(closed), bool)
    best, solves, single = len(closed), 0, False
    most = 2 * int(can_close.sum())
    # States visited, with the violation of each, and the cycle in which block changes ended.
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
        again = key in been or (single and len(been) == most)
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
