"""Unilateral contact of crack faces: which collocation nodes are closed.

With the boundary eliminated, the tractions on the faces are S w + r (S the Schur complement, w slip and opening, r the
tractions of the loads on closed faces). At every node the opening is at least −aperture and the faces cannot pull:

    w_n + a ≥ 0,   λ = −(S w + r)_n − p ≥ 0,   λ (w_n + a) = 0,   shear traction zero.

Solved by block principal pivoting (Júdice & Pires 1994): all violated nodes change state at once, as in Newton's
method. Where rock ends in a thin blade, between a crack and a side that it meets at a few degrees, the discrete
compliance is not a P-matrix (a loaded point of the blade moves the wrong way), and the iteration cycles; the states are
then found by removing a confining pressure (`confinement_path`). Nodes that violate their conditions even then are
undecided: the discrete problem has no solution there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

#: Largest number of states tried before the search, which begins earlier if they cycle.
_MOST = 50
#: Allowed violation, relative to the scales of gaps and pressures.
TOLERANCE = 1e-10


class NotConverged(RuntimeError):
    """Contact of crack faces did not converge; ``block``: number of their block, where they are those of one."""

    block: int | None = None


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
    search: Callable[[np.ndarray, np.ndarray], np.ndarray],
    tolerance: float = TOLERANCE,
) -> Settled:
    """Which nodes are closed.

    ``respond(closed)`` (n,) bool solves with these nodes closed and returns the gap w_n + a and the pressure λ of all
    nodes, each scaled to order one; its last call is that of the result. ``can_close`` (n,) bool; ``closed`` (n,):
    first guess. ``search(closed, disputed)`` finds the closed nodes where changing all violated ones at once cycles,
    beginning from ``closed``; ``disputed`` nodes took part in the cycle.
    """
    closed = closed & can_close
    disputed = np.zeros(len(closed), bool)
    # States visited, with the number of violated nodes of each.
    visited: dict[bytes, int] = {}
    searched = False
    while True:
        gap, pressure = respond(closed)
        short = np.where(closed, pressure, np.where(can_close, gap, 0.0))
        wrong = short < -tolerance
        if searched or not wrong.any():
            return Settled(closed, len(visited) + 1, wrong, -float(short.min(where=wrong, initial=0.0)))
        key = closed.tobytes()
        if key in visited or len(visited) > _MOST:
            closed, searched = search(closed, disputed), True
            continue
        if all(count > wrong.sum() for count in visited.values()):
            disputed[:] = False
        visited[key] = int(wrong.sum())
        disputed |= wrong
        closed = closed ^ wrong
