"""Unilateral contact of crack faces: which collocation nodes are closed.

With the boundary eliminated, the tractions on the faces are S w + r (S the Schur complement, w slip and opening, r what
the loads do to closed faces). At every node the opening cannot pass −aperture and the face can only press:

    w_n + a ≥ 0,   λ = −(S w + r)_n − p ≥ 0,   λ (w_n + a) = 0,   shear traction zero.

It is solved by block principal pivoting (Júdice & Pires 1994): all violated nodes change side at once, as Newton's
method would; when that stops improving, one at a time in a fixed order of nodes (Murty 1974), which cannot cycle for a
P-matrix.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

#: Block exchanges allowed without progress before the single ones.
_PATIENCE = 8


class NotConverged(RuntimeError):
    """The contact of crack faces was not settled."""


def settle(
    respond: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    can_close: np.ndarray,
    closed: np.ndarray,
    tolerance: float = 1e-10,
    limit: int = 2000,
) -> tuple[np.ndarray, int]:
    """The closed nodes and the number of solves.

    ``respond(closed)`` (n,) bool solves with these nodes closed and returns the gap w_n + a and the pressure λ of all
    nodes, each scaled to order one. ``can_close`` (n,) bool; ``closed`` (n,) the first guess. Raises NotConverged.
    """
    closed = closed & can_close
    best, patience, solves = len(closed) + 1, _PATIENCE, 0
    while solves < limit:
        gap, pressure = respond(closed)
        solves += 1
        wrong = np.where(closed, pressure < -tolerance, can_close & (gap < -tolerance))
        n_wrong = int(wrong.sum())
        if n_wrong == 0:
            return closed, solves
        if n_wrong < best:
            best, patience = n_wrong, _PATIENCE
        else:
            patience -= 1
        if patience <= 0:
            wrong[: int(np.flatnonzero(wrong)[-1])] = False
        closed = closed ^ wrong
    raise NotConverged(f"crack faces did not settle in {limit} solves; {best} nodes at best were in violation")
