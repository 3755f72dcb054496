"""Equations of a step of blocks of different orders, in given contact states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...model import OPEN, STICK
from ..equation_records import ContactStiffness
from ..joint_laws.penalty_springs import Springs
from ..linear_solver.block_solver import RESIDUAL
from ..open_close.equations import Equations
from .six_row_system import SixRowPattern, differing, fill, moved, springs_in_states, take_change, times


@dataclass(eq=False)
class HigherOrderEquations(Equations):
    """As `Equations`, for all unknowns (`six_row_system`).

    ``base`` is the flat matrix without contacts; ``right`` (n, 6) and ``rows`` (n_contacts, 2, 2, w) refer to all
    unknowns. ``own``: the blocks' own matrices and their starts (`six_row_system.fill_own`), if ``base`` has nothing else.
    """

    base: np.ndarray = field(default_factory=lambda: np.empty(0))
    rows: np.ndarray = field(default_factory=lambda: np.empty((0, 2, 2, 6)))
    own: tuple[np.ndarray, np.ndarray] | None = None
    first_order = False

    def __post_init__(self) -> None:
        super().__post_init__()
        self._laws: tuple[np.ndarray, ...] = ()
        self._motion = np.zeros((0, 2))
        self._rest: np.ndarray | None = None

    def _assembled(self, state: np.ndarray, direction: np.ndarray, springs: Springs, gap: np.ndarray):
        pattern, found, held = self._six_rows, self.found, self._held is not None
        before = self._laws, self._side.copy()
        self._side[:] = self.right.ravel()
        blocks = found.block, found.other, pattern.order
        *laws, symmetric = springs_in_states(
            self._side, blocks, pattern.unknowns, self.rows, (state, direction, gap, found.shear),
            (springs.normal, springs.shear, springs.friction, springs.sliding, springs.lift),
        )  # fmt: skip
        self._laws = (*laws, springs.lift)
        n = len(self.sides.start) - 1
        which = differing(blocks, n, self._laws, before[0]) if held else np.ones(n, np.bool_)
        self._rest = self._rest_after(*before) if held else None
        if not held:
            self._data[:] = self.base
        matrix = self._data, self.base
        fill(which, matrix, pattern.places, pattern.step, blocks, tuple(self.sides), self.rows, self._laws)
        return symmetric, ContactStiffness(*self._laws)

    def _rest_after(self, laws: tuple[np.ndarray, ...], side: np.ndarray) -> np.ndarray | None:
        """(6 n,) residual of the last solution with the present laws and right side, from that with the ``laws`` and
        right ``side`` before: only contacts in other states change it."""
        pattern, found = self._six_rows, self.found
        assert pattern.solver is not None
        if pattern.solver.rest is None or self._near is None:
            return None
        rest = pattern.solver.rest + (self._side - side)
        blocks = found.block, found.other, pattern.order
        take_change(rest, blocks, pattern.unknowns, self.rows, self._motion, laws, self._laws)
        return rest

    def _rest_of_near(self, within: float) -> np.ndarray | None:
        return self._rest if within > RESIDUAL else None

    @property
    def _product(self) -> Callable[[np.ndarray], np.ndarray] | None:
        """Multiplies with blocks and contacts one by one, which are fewer numbers than the matrix has: for 1 000 blocks of
        order 3 these do not fit the cache."""
        if self.own is None:
            return None
        pattern, found, own = self._six_rows, self.found, self.own
        blocks = found.block, found.other, pattern.order

        def product(x: np.ndarray) -> np.ndarray:
            out = np.zeros(len(x))
            out[pattern.unknown] = times(x[pattern.unknown], own, pattern.unknowns[1:], blocks, self.rows, self._laws)
            return out

        return product

    @property
    def _six_rows(self) -> SixRowPattern:
        assert isinstance(self.pattern, SixRowPattern)
        return self.pattern

    def _forces(
        self, unknowns: np.ndarray, state: np.ndarray, direction: np.ndarray, springs: Springs, gap: np.ndarray
    ) -> np.ndarray:
        pattern, found = self._six_rows, self.found
        blocks = found.block, found.other, pattern.order
        self._motion = moved(unknowns, blocks, pattern.unknowns, self.rows)
        across, along = self._motion.T
        out = np.zeros((len(found), 4))
        out[:, 2], out[:, 3] = gap + across - springs.lift * along, along
        closed = state != OPEN
        out[closed, 0] = -(springs.normal * out[:, 2])[closed]
        stuck = found.shear - springs.shear * along
        slid = direction * (springs.friction * out[:, 0] + springs.sliding)
        out[closed, 1] = np.where(state == STICK, stuck, slid)[closed]
        return out
