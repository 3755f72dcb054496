"""Prescribed motion of blocks of higher order and of points in them, imposed exactly on all unknowns, and its reactions.

A block with the conditions C d = δ has the unknowns d = d₀ + y with d₀ = C⁺ δ and C y = 0. With the projection
N = 1 − C⁺ C its equations K d = f become (N K N + s (1 − N)) y = N (f − K d₀), whose solution satisfies C y = 0; rows of
contacts, glue and bolts are projected likewise, and the relative motion due to d₀ is added to theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import UNKNOWNS, BlockMotion, PointMotion
from ..higher_order.deflected_blocks import DeflectedBlocks
from ..higher_order.deflection_basis import n_deflections
from .prescribed_motion import MovedBlocks, PrescribedMotion, refuse_contradiction


@dataclass(eq=False)
class Driven:
    """Conditions on a block of higher order: C (c, w) of the solver's unknowns, δ (c,), rates at the end of the step (c,),
    and the point motion that each comes from (−1: a block motion). ``residual`` (w,) N: of the block's equations."""

    constraint: np.ndarray
    increment: np.ndarray
    rate: np.ndarray
    source: list[int]
    residual: np.ndarray | None = None

    def __post_init__(self) -> None:
        inverse = np.linalg.pinv(self.constraint)
        #: (w,) d₀, and (w, w) N.
        self.known, self.inverse = inverse @ self.increment, inverse
        self.free = np.eye(len(inverse)) - inverse @ self.constraint

    @property
    def multiplier(self) -> np.ndarray:
        """(c,) forces of the conditions."""
        assert self.residual is not None
        return self.inverse.T @ self.residual


@dataclass(frozen=True, eq=False)
class PointSpring:
    """A spring of ``stiffness``, N/m, that moves a point of a block towards ``by`` (c,) along ``rows`` (c, w); ``number``
    of the point motion."""

    number: int
    block: int
    stiffness: float
    rows: np.ndarray
    by: np.ndarray


class BendingMotion(PrescribedMotion):
    """As `PrescribedMotion`, with blocks of higher order: ``driven_bent`` (block → `Driven`) and ``springs_bent``."""

    def __init__(self, moved: MovedBlocks, *more) -> None:
        assert moved.bent is not None
        self._bent: DeflectedBlocks = moved.bent[0]
        self._angle = moved.bent[1]
        self._conditions: dict[int, list[tuple[np.ndarray, float, float, int]]] = {}
        self.springs_bent: list[PointSpring] = []
        #: Rows (c, m) of deflection of the points that are moved, by their numbers.
        self.point_rows_bent: dict[int, np.ndarray] = {}
        super().__init__(moved, *more)
        self.driven_bent: dict[int, Driven] = {}
        for b, rows in self._conditions.items():
            constraint = np.array([row for row, *_ in rows])
            refuse_contradiction(constraint, self._name(b))
            by, rate = (np.array([row[k] for row in rows]) for k in (1, 2))
            self.driven_bent[b] = Driven(constraint, by, rate, [row[3] for row in rows])

    def _bends(self, block: int) -> bool:
        return bool(self._bent.order[block] > 1)

    def _scaled(self, block: int, rows: np.ndarray) -> np.ndarray:
        rows = rows.copy()
        rows[:, :6] /= self._scale(block)
        return rows

    def _block(self, motion: BlockMotion, by: np.ndarray, start: float, end: float) -> None:
        b = motion.block
        if not self._bends(b):
            super()._block(motion, by, start, end)
            return
        rows = np.zeros((len(by), 6 + n_deflections(int(self._bent.order[b]))))
        rows[range(len(by)), [UNKNOWNS.index(name) for name in motion.unknowns]] = 1.0
        self._take(b, self._scaled(b, rows), by, motion.rate(start, end), -1)

    def _point(
        self, number: int, motion: PointMotion, by: np.ndarray, now: np.ndarray, start: float, end: float
    ) -> None:
        b = motion.block
        if not self._bends(b):
            super()._point(number, motion, by, now, start, end)
            return
        acts = self._midpoint.points(now[None], np.array([b]))[0]
        self._rows[number]["block"], self._rows[number]["at"], self._rows[number]["point"] = b, motion.at, acts
        m = n_deflections(int(self._bent.order[b]))
        bent = self._bent.directions(np.array([motion.at], float), np.array([b]), self._angle)[0, :, :m]
        rows = np.hstack([motion.axes @ self._midpoint.displacement(acts, b), motion.axes @ bent])
        self.point_rows_bent[number] = bent
        if motion.kind == "displacement":
            by = motion.history.at(end) - motion.axes @ (now - np.asarray(motion.at, dtype=float))
        rows = self._scaled(b, rows)
        if motion.stiffness is not None:
            self.springs_bent.append(PointSpring(number, b, motion.stiffness, rows, by))
            return
        self._take(b, rows, by, motion.rate(start, end), number)

    def _take(self, block: int, rows: np.ndarray, by: np.ndarray, rate: np.ndarray, source: int) -> None:
        given = self._conditions.setdefault(block, [])
        given += [(row, float(d), float(v), source) for row, d, v in zip(rows, by, rate, strict=True)]

    def spring_equations(self) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """(block, matrix (w, w), right side (w,)) of each spring that moves a point."""
        return [(s.block, s.stiffness * s.rows.T @ s.rows, s.stiffness * s.rows.T @ s.by) for s in self.springs_bent]

    def correct_rates(self, velocity: np.ndarray, rates: np.ndarray) -> None:
        """Set prescribed rates at the end of the step in ``velocity`` (n_blocks, 6) and in ``rates`` (k,) of deflection, in
        place."""
        for b, driven in self.driven_bent.items():
            own = self._bent.basis.of_block(b)
            found = np.concatenate([velocity[b] * self._scale(b), rates[own]])
            found += driven.inverse @ (driven.rate - driven.constraint @ found)
            velocity[b], rates[own] = found[:6] / self._scale(b), found[6:]

    def reactions(
        self, unknowns: np.ndarray, pushes: list[np.ndarray], order: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        of_blocks, rows = super().reactions(unknowns, pushes, order)
        for b, driven in self.driven_bent.items():
            for value, row, source in zip(driven.multiplier, driven.constraint, driven.source, strict=True):
                if source < 0:
                    of_blocks[b] += value * row[:6] * self._scale(b)
            for number in {s for s in driven.source if s >= 0}:
                own_multipliers = [
                    v for v, source in zip(driven.multiplier, driven.source, strict=True) if source == number
                ]
                rows["force"][number] = np.array(own_multipliers) @ self._points[number].axes
        for spring in self.springs_bent:
            missing = spring.by - spring.rows @ self.reached[spring.block]
            rows["force"][spring.number] = spring.stiffness * missing @ self._points[spring.number].axes
        return of_blocks, rows

    #: block → all its unknowns (w,) in the solution of the step.
    reached: dict[int, np.ndarray]

    def deflecting_work(self, change: np.ndarray) -> float:
        """Work, J/m, of the forces that move points on the increments ``change`` (n_blocks, m) of deflection."""
        out = 0.0
        for number, bent in self.point_rows_bent.items():
            out += float(self._rows["force"][number] @ bent @ change[self._rows["block"][number], : bent.shape[1]])
        return out
