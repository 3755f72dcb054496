"""Equations of a step of blocks of different orders, in given contact states."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...model import OPEN, STICK
from ..joint_laws.penalty_springs import Springs
from ..open_close.equations import Equations
from .six_row_system import SixRowPattern, fill, moved, springs_in_states


@dataclass(eq=False)
class HigherOrderEquations(Equations):
    """As `Equations`, for all unknowns (`six_row_system`).

    ``base`` is the flat matrix without contacts; ``right`` (n, 6) and ``rows`` (n_contacts, 2, 2, w) refer to all
    unknowns.
    """

    base: np.ndarray = field(default_factory=lambda: np.empty(0))
    rows: np.ndarray = field(default_factory=lambda: np.empty((0, 2, 2, 6)))
    first_order = False

    def __post_init__(self) -> None:
        self._data, self._side = np.empty(self.pattern.size), np.empty(6 * self.pattern.n)
        self._near: np.ndarray | None = None
        self._held = None
        self._force = float(np.abs(self.right).max(initial=0.0))

    def _assembled(self, state: np.ndarray, direction: np.ndarray, springs: Springs, gap: np.ndarray):
        pattern, found = self.pattern, self.found
        assert isinstance(pattern, SixRowPattern)
        self._side[:] = self.right.ravel()
        blocks = found.block, found.other, pattern.order
        *laws, symmetric = springs_in_states(
            self._side, blocks, (pattern.more, pattern.rows), self.rows, (state, direction, gap, found.shear),
            (springs.normal, springs.shear, springs.friction, springs.sliding, springs.lift),
        )  # fmt: skip
        fill(
            self._data, self.base, pattern.places, pattern.step, blocks, self.rows,
            (*laws, springs.lift),
        )  # fmt: skip
        return symmetric, None

    def _forces(
        self, unknowns: np.ndarray, state: np.ndarray, direction: np.ndarray, springs: Springs, gap: np.ndarray
    ) -> np.ndarray:
        pattern, found = self.pattern, self.found
        assert isinstance(pattern, SixRowPattern)
        blocks = found.block, found.other, pattern.order
        across, along = moved(unknowns, blocks, (pattern.more, pattern.rows), self.rows).T
        out = np.zeros((len(found), 4))
        out[:, 2], out[:, 3] = gap + across - springs.lift * along, along
        closed = state != OPEN
        out[closed, 0] = -(springs.normal * out[:, 2])[closed]
        stuck = found.shear - springs.shear * along
        slid = direction * (springs.friction * out[:, 0] + springs.sliding)
        out[closed, 1] = np.where(state == STICK, stuck, slid)[closed]
        return out
