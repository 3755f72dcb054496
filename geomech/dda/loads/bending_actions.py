"""Bolts on blocks of higher order: their ends move with the deflection of the blocks.

The displacement of a bolt's end at the material point X is T(x) d + R P(X) q (`deflection_basis`). A bolt is therefore a
spring along, and one across, its axis on all unknowns of both blocks, two terms of rank one in the equations; the axis
and its length are those between the deflected points.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...model import GROUND
from ..higher_order.deflected_blocks import DeflectedBlocks, rotation_of
from ..higher_order.glued_cells import push_springs, stiffen_springs
from ..higher_order.six_row_system import SixRowPattern, moved
from ..open_close.contact_set import ContactSet
from ..open_close.settled_states import Settled
from .bending_motion import BendingMotion, Driven
from .bolts import ROUNDS
from .load_vectors import LoadMap
from .step_actions import Settle, StepActions


class DeflectedPoints:
    """Current positions of material points of ``blocks`` with the deflections ``q`` (k,), rotated by ``angle``
    (n_blocks,); ``load_map`` gives those of the strained, undeflected blocks."""

    def __init__(self, load_map: LoadMap, blocks: DeflectedBlocks, angle: np.ndarray, q: np.ndarray) -> None:
        self._load_map, self._blocks = load_map, blocks
        self.take(angle, q)

    def take(self, angle: np.ndarray, q: np.ndarray) -> None:
        """Continue with these rotations and deflections."""
        self._angle, self._q = angle, q

    def point(self, block: int, at: tuple[float, float], vertices: np.ndarray) -> np.ndarray:
        """(2,) m: position of the material point ``at`` (reference coordinates) of ``block``; ``vertices`` as in
        `LoadMap.point`."""
        affine = self._load_map.point(block, at, vertices)
        blocks = self._blocks
        if blocks.order[block] < 2:
            return affine
        own = blocks.basis.of_block(block)
        field = blocks.basis.displacement(np.array([at], float), block)[0, :, : own.stop - own.start]
        return affine + rotation_of(self._angle[block]) @ field @ self._q[own]


class BendingActions(StepActions):
    """As `StepActions`, with bolts and prescribed motion on all unknowns of blocks of higher order.

    ``rows_of(found, vectors)``: rows (n, 2, 2, w) of contacts, with deflection.
    """

    motion = BendingMotion
    rows_of: Callable[[ContactSet, np.ndarray], np.ndarray]

    def bend(self, blocks: DeflectedBlocks, angle: np.ndarray) -> None:
        """Let the bolts act on the deflection of ``blocks`` rotated by ``angle`` (n_blocks,), where forces act."""
        self._width = max(blocks.width, 6)
        if self.bolts is None:
            return
        pairs, bolts = self.bolts.pairs, [self.bolts.bolts[k] for k in self.bolts.number]
        #: (n, 2, 2, m) motion along and across per unit of the deflection of both blocks.
        self.of_deflection = np.zeros((len(bolts), 2, 2, self._width - 6))
        for side, (owner, sign) in enumerate(((pairs.block, -1.0), (pairs.other, 1.0))):
            own = np.flatnonzero(owner != GROUND)
            at = np.array([(bolts[k].start, bolts[k].end)[side] for k in own], float).reshape(-1, 2)
            matrix = blocks.directions(at, owner[own], angle)
            self.of_deflection[own, :, side, : matrix.shape[2]] = sign * pairs.axes[own] @ matrix

    @property
    def n_bolts(self) -> int:
        return 0 if self.bolts is None else len(self.bolts.number)

    def _springs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Blocks (2 n,) of both ends of the springs, those along the bolts and then those across, and their rows (2 n, 2,
        2, w) as contacts have them. An end in the ground, or in the same block as the other, has none of its own."""
        assert self.bolts is not None
        pairs, n = self.bolts.pairs, len(self.bolts.number)
        rows = np.concatenate([pairs.vectors.reshape(n, 2, 2, 6), self.of_deflection], axis=3)
        self.project(pairs.block, pairs.other, rows)
        alone = (pairs.other == GROUND) | (pairs.other == pairs.block)
        rows[alone, :, 0] += rows[alone, :, 1]
        rows[alone, :, 1] = 0.0
        out = np.zeros((2 * n, 2, 2, self._width))
        out[:n, 0], out[n:, 0] = rows[:, 0], rows[:, 1]
        return np.tile(pairs.block, 2), np.tile(np.where(alone, pairs.block, pairs.other), 2), out

    def add(self, right: np.ndarray, data: np.ndarray, pattern: SixRowPattern, n_contacts: int) -> None:
        """Add the bolts, in their present states, to ``right`` (6 n,) and to the flat matrix ``data``; in ``pattern`` they
        follow ``n_contacts`` contacts."""
        if self.bolts is None:
            return
        stiffness, at_rest = self.bolts.springs()
        push = (at_rest - stiffness * self.bolts.pairs.shift).T.ravel()
        block, other, rows = self._springs()
        force = np.stack([-push, np.zeros_like(push)], axis=1)
        push_springs(right, (block, other, pattern.order), pattern.unknowns, rows, force)
        at = n_contacts + np.tile(np.arange(len(self.bolts.number)), 2)
        stiffen_springs(
            data, pattern.places, pattern.step, at, (block, other, pattern.order), rows, stiffness.T.ravel()
        )

    @property
    def driven(self) -> dict[int, Driven]:
        """Blocks of higher order with prescribed motion."""
        return self.imposed.driven_bent if isinstance(self.imposed, BendingMotion) else {}

    def project(self, block: np.ndarray, other: np.ndarray, rows: np.ndarray) -> None:
        """Project the ``rows`` (n, 2, 2, w) of ``block`` and ``other`` (n,) to what prescribed motion leaves free, in
        place."""
        for b, driven in self.driven.items():
            w = len(driven.known)
            for side, owner in enumerate((block, other)):
                own = np.flatnonzero(owner == b)
                rows[own, :, side, :w] = rows[own, :, side, :w] @ driven.free

    def known_motion(self, block: np.ndarray, other: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(n, 2) motion of the ``rows`` (n, 2, 2, w) of ``block`` and ``other`` (n,) that is prescribed."""
        out = np.zeros((len(rows), 2))
        for b, driven in self.driven.items():
            w = len(driven.known)
            for side, owner in enumerate((block, other)):
                own = np.flatnonzero(owner == b)
                out[own] += rows[own, :, side, :w] @ driven.known
        return out

    def _shift_more(self, found: ContactSet, vectors: np.ndarray, shift: np.ndarray) -> None:
        if not self.driven:
            return
        shift += self.known_motion(found.block, found.other, self.rows_of(found, vectors))
        if self.bolts is not None:
            pairs, n = self.bolts.pairs, len(self.bolts.number)
            rows = np.concatenate([pairs.vectors.reshape(n, 2, 2, 6), self.of_deflection], axis=3)
            pairs.shift += self.known_motion(pairs.block, pairs.other, rows)

    def settle(self, pattern, matrix, right, vectors, acting, found, gap, settle):
        settled, unknowns = super().settle(pattern, matrix, right, vectors, acting, found, gap, settle)
        flat = unknowns.reshape(-1)
        for b, driven in self.driven.items():
            flat[pattern.unknowns_of(b, len(driven.known))] += driven.known
        if isinstance(self.imposed, BendingMotion):
            self.imposed.reached = {
                s.block: flat[pattern.unknowns_of(s.block, s.rows.shape[1])] for s in self.imposed.springs_bent
            }
        return settled, unknowns

    def _with_bolts(self, pattern, matrix, right, found, gap, settle: Settle) -> Settled:
        if self.bolts is None:
            return settle(pattern, matrix, right, found, gap)
        for _ in range(ROUNDS):
            settled = settle(pattern, matrix, right, found, gap)
            block, other, rows = self._springs()
            along = moved(
                settled.unknowns.ravel(), (block, other, pattern.order), pattern.unknowns, rows
            )[:, 0]  # fmt: skip
            self._motion = self.bolts.pairs.shift + along.reshape(2, -1).T
            if self.bolts.take_states(self._motion):
                return settled
        raise self.bolts.unsettled()

    def bolt_pushes(self) -> list[tuple[np.ndarray, ...]]:
        """Blocks, others, rows (n, 2, 2, w) and forces (n,) along and across of the bolts, for all their ends."""
        if self.bolts is None:
            return []
        pairs, n = self.bolts.pairs, len(self.bolts.number)
        rows = np.concatenate([pairs.vectors.reshape(n, 2, 2, 6), self.of_deflection], axis=3)
        return [(pairs.block, pairs.other, rows, *self.bolt_forces().T)]

    def deflecting_work(self, change: np.ndarray) -> float:
        """Work, J/m, of bolts and of the forces that move points on the increments ``change`` (n_blocks, m) of deflection."""
        out = self.imposed.deflecting_work(change) if isinstance(self.imposed, BendingMotion) else 0.0
        if self.bolts is None:
            return out
        pairs, force = self.bolts.pairs, self.bolt_forces()
        m = min(change.shape[1], self._width - 6)
        for side, owner in enumerate((pairs.block, pairs.other)):
            own = np.flatnonzero(owner != GROUND)
            rows = self.of_deflection[own, :, side, :m]
            out += float(np.einsum("nk,nkj,nj->", force[own], rows, change[owner[own], :m]))
        return out
