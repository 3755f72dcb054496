"""Prescribed motion of blocks, points and the base in a time step, imposed exactly, and its reactions.

A block with m linear conditions C d = δ, C (m, 6), changes to the unknowns z of d = Q z, where C = (Rᵀ 0) Qᵀ (QR
factors of Cᵀ). The first m are known, z₁ = R⁻ᵀ δ, and are eliminated. A fixed block has no unknowns: its motion enters
its contacts as a shift of their gaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...model import UNKNOWNS, BaseMotion, BlockMotion, Blocks, Loads, PointMotion
from ..kinematics.midpoint_configuration import MidpointConfiguration
from .force_records import POINT_FORCE

if TYPE_CHECKING:
    from ..higher_order.deflected_blocks import DeflectedBlocks

#: Rows of C are linearly dependent below this relative size: they contradict or repeat one another.
_DEPENDENT = 1e-10


@dataclass(eq=False)
class _Given:
    """Conditions on one moving block: rows of C, their increments, their rates at the end of the step, and the point
    motion that each comes from (−1: a block motion)."""

    rows: list[np.ndarray]
    increment: list[float]
    rate: list[float]
    source: list[int]


@dataclass(eq=False)
class _Changed:
    """A moving block in the unknowns z; its original equations and contacts are kept for the reactions."""

    block: int
    basis: np.ndarray  # Q (6, 6)
    known: np.ndarray  # z₁ (m,)
    constraint: np.ndarray  # C (m, 6) of the scaled unknowns
    rate: np.ndarray
    source: list[int]
    matrix: np.ndarray
    right: np.ndarray
    pairs: list[tuple[np.ndarray, np.ndarray]]  # its rows in each set of pairs, and its (k, 2, 6) part of their vectors


@dataclass(eq=False)
class Pairs:
    """Pairs of interacting blocks: contacts or bolts.

    vectors  (n, 2, 12)  of the relative motion in two directions, over the unknowns of both blocks
    points   (n, 2, 2)   where the motion is taken, on the first and on the second block, m
    axes     (n, 2, 2)   the directions
    sense                factor on (motion of the first block − motion of the second)
    shift    (n, 2)      relative motion due to prescribed motion, m
    """

    block: np.ndarray
    other: np.ndarray
    vectors: np.ndarray
    points: np.ndarray
    axes: np.ndarray
    sense: float
    shift: np.ndarray


class MovedBlocks(NamedTuple):
    """The ``blocks`` of a step, those that are ``fixed`` (n_blocks,), and ``removed`` (n_blocks,) by excavation (None:
    none). ``bent``: those of higher order, and by how much blocks (n_blocks,) are rotated where forces act, rad; None
    without any."""

    blocks: Blocks
    fixed: np.ndarray
    removed: np.ndarray | None
    bent: tuple[DeflectedBlocks, np.ndarray] | None = None


def refuse_contradiction(constraint: np.ndarray, name: str) -> None:
    """Raise ValueError that names the block where rows of its ``constraint`` (c, w) contradict or repeat one another."""
    r = np.linalg.qr(constraint.T)[1]
    if len(constraint) > constraint.shape[1] or np.abs(np.diag(r)).min() <= _DEPENDENT * np.abs(r).max():
        raise ValueError(f"{name}: the motions prescribed for it contradict or repeat one another")


class PrescribedMotion:
    """Motion that ``loads`` prescribe from ``start`` to ``end`` (s), on the midpoint configuration ``midpoint``.

    ``totals`` (k,) are the values at ``end``, ``before`` those at the start as the last step left them (None: the
    values at ``start``): static equilibrium at one time may take many steps. ``increment`` and ``rate`` (n_blocks, 6)
    are those of fixed blocks, zero elsewhere.

    Raises ValueError that names a block with contradicting or repeated conditions, a fixed block with a point motion,
    and a fixed block with prescribed strains.
    """

    def __init__(
        self, moved: MovedBlocks, loads: Loads, midpoint: MidpointConfiguration, point_at, before: np.ndarray, start: float,
        end: float,
    ) -> None:  # fmt: skip
        blocks, fixed, removed = moved.blocks, moved.fixed, moved.removed
        n = blocks.n_blocks
        self.blocks, self.fixed, self.moments = blocks, fixed, midpoint.moments
        self._midpoint = midpoint
        self.increment, self.rate = np.zeros((n, 6)), np.zeros((n, 6))
        self._given: dict[int, _Given] = {}
        self._springs: list[tuple[int, int, np.ndarray, np.ndarray]] = []
        self._changed: list[_Changed] = []
        self._points = loads.point_motions
        self._rows = np.zeros(len(loads.point_motions), POINT_FORCE)
        removed = np.zeros(n, bool) if removed is None else removed
        base = [loads.base] if loads.base is not None and loads.base.frame == "ground" else []
        given: list[BaseMotion | BlockMotion | PointMotion] = [*base, *loads.block_motions, *loads.point_motions]
        totals = [motion.total(end) for motion in given]
        self.totals = np.concatenate(totals)
        if len(before) != len(self.totals):
            before = np.concatenate([motion.total(start) for motion in given])
        by = np.split(self.totals - before, np.cumsum([len(total) for total in totals])[:-1])
        for shaking, change in zip(base, by):
            self._base(shaking, removed, change, end)
        for motion, change in zip(loads.block_motions, by[len(base) :]):
            if not removed[motion.block]:
                self._block(motion, change, start, end)
        for k, (point, change) in enumerate(zip(loads.point_motions, by[len(base) + len(loads.block_motions) :])):
            if not removed[point.block]:
                self._point(k, point, change, point_at(point.block, point.at), start, end)
        self.moving_base = bool(self.increment.any())

    def _base(self, base: BaseMotion, removed: np.ndarray, by: np.ndarray, end: float) -> None:
        shaken = self.blocks.fixed & ~removed
        if base.blocks is not None:
            shaken &= np.isin(np.arange(len(shaken)), base.blocks)
        self.increment[shaken, :2] = by
        self.rate[shaken, :2] = base.acceleration.integral(end)

    def _block(self, motion: BlockMotion, by: np.ndarray, start: float, end: float) -> None:
        rate = motion.rate(start, end)
        at = [UNKNOWNS.index(name) for name in motion.unknowns]
        if self.fixed[motion.block]:
            if max(at) > 2:
                raise ValueError(
                    f"{self._name(motion.block)} is fixed and therefore rigid: its strains cannot be prescribed, only u0, v0 "
                    "and r0"
                )
            self.increment[motion.block, at] += by
            self.rate[motion.block, at] += rate
            return
        for k, unknown in enumerate(at):
            self._add(motion.block, np.eye(6)[unknown], by[k], rate[k], -1)

    def _point(
        self, number: int, motion: PointMotion, by: np.ndarray, now: np.ndarray, start: float, end: float
    ) -> None:
        b = motion.block
        acts = self._midpoint.points(now[None], np.array([b]))[0]
        self._rows[number]["block"], self._rows[number]["at"], self._rows[number]["point"] = b, motion.at, acts
        if self.fixed[b]:
            raise ValueError(
                f"a point of {self._name(b)} has a prescribed motion, but the block is fixed: prescribe the motion of the block"
            )
        rows = motion.axes @ self._midpoint.displacement(acts, b)
        if motion.kind == "displacement":
            # Towards the total position, so that the next step corrects the second-order error of a rotation.
            by = motion.history.at(end) - motion.axes @ (now - np.asarray(motion.at, dtype=float))
        if motion.stiffness is not None:
            self._springs.append((number, b, rows, by))
            return
        for row, value, speed in zip(rows, by, motion.rate(start, end), strict=True):
            self._add(b, row, value, speed, number)

    @property
    def at_points(self) -> np.ndarray:
        """POINT_FORCE rows of point motions, with the forces that `reactions` has found."""
        return self._rows

    @property
    def driven(self) -> list[int]:
        """Blocks that are not fixed and have prescribed motion: impacts do not change it."""
        return list(self._given)

    def _add(self, block: int, row: np.ndarray, by: float, rate: float, source: int) -> None:
        given = self._given.setdefault(block, _Given([], [], [], []))
        given.rows.append(row)
        given.increment.append(float(by))
        given.rate.append(float(rate))
        given.source.append(source)

    def _name(self, block: int) -> str:
        return repr(self.blocks.names[block])

    def _scale(self, block: int) -> np.ndarray:
        """(6,) scale of the solver's unknowns, which are all lengths, over d."""
        h = float(np.sqrt(self.moments[block, 0]))
        return np.array([1.0, 1.0, h, h, h, h])

    def without_prescribed(self, constrained: np.ndarray) -> np.ndarray:
        """The constraints ``constrained`` (n_blocks, 6) without those of blocks with prescribed motion, which impose them as
        zeros."""
        rest = constrained.copy()
        for b, given in self._given.items():
            taken = {int(row.argmax()) for row, source in zip(given.rows, given.source, strict=True) if source < 0}
            for unknown in set(np.flatnonzero(constrained[b]).tolist()) - taken:
                self._add(b, np.eye(6)[unknown], 0.0, 0.0, -1)
            rest[b] = False
        self._springs = [(number, b, rows * ~rest[b], by) for number, b, rows, by in self._springs]
        return rest

    # -- before the step is solved -------------------------------------------------------------------------------------

    def impose(self, matrix: np.ndarray, right: np.ndarray, sets: list[Pairs], order: np.ndarray) -> None:
        """Eliminate the prescribed unknowns, in place, from ``matrix``, ``right`` and the vectors of the pairs in
        ``sets``.

        Arrays as in `assembly`. The pairs' shift becomes the relative motion due to prescribed motion."""
        for number, b, rows, by in self._springs:
            rows, k = rows / self._scale(b), self._points[number].stiffness
            matrix[order[b]] += k * rows.T @ rows
            right[order[b]] += k * rows.T @ by
        if self.moving_base:
            for pairs in sets:
                pairs.shift += self._of_base(pairs)
        size = np.abs(matrix).max(initial=0.0)
        for b, given in self._given.items():
            self._change(b, given, matrix, right, sets, order[b], size)

    def _of_base(self, pairs: Pairs) -> np.ndarray:
        """(n, 2) relative motion due to the motion of fixed blocks, m."""
        moved = np.zeros((len(pairs.block), 2))
        for k, (owner, sign) in enumerate(((pairs.block, 1.0), (pairs.other, -1.0))):
            arm = pairs.points[:, k] - self.moments[owner, 1:3]
            u = np.where((owner >= 0)[:, None], self.increment[owner], 0.0)
            moved += sign * np.stack([u[:, 0] - u[:, 2] * arm[:, 1], u[:, 1] + u[:, 2] * arm[:, 0]], axis=1)
        return pairs.sense * np.einsum("nkd,nd->nk", pairs.axes, moved)

    def _change(self, b, given: _Given, matrix, right, sets: list[Pairs], row: int, size: float) -> None:
        constraint = np.array(given.rows) / self._scale(b)
        m = len(constraint)
        if m > 6:
            raise ValueError(f"{self._name(b)}: {m} motions are prescribed for its six unknowns")
        basis, r = np.linalg.qr(constraint.T, mode="complete")
        if np.abs(np.diag(r)).min() <= _DEPENDENT * np.abs(r).max():
            raise ValueError(f"{self._name(b)}: the motions prescribed for it contradict or repeat one another")
        known = np.linalg.solve(r[:m].T, np.array(given.increment))
        before, own = (matrix[row].copy(), right[row].copy()), []
        for pairs in sets:
            for side, owner in enumerate((pairs.block, pairs.other)):
                at, part = np.flatnonzero(owner == b), slice(6 * side, 6 * side + 6)
                vectors = pairs.vectors[at, :, part]
                own.append((at, vectors))
                turned = vectors @ basis
                pairs.shift[at] += turned[:, :, :m] @ known
                turned[:, :, :m] = 0.0
                pairs.vectors[at, :, part] = turned
        self._changed.append(_Changed(b, basis, known, constraint, np.array(given.rate), given.source, *before, own))
        matrix[row] = basis.T @ matrix[row] @ basis
        right[row] = basis.T @ right[row] - matrix[row][:, :m] @ known
        matrix[row, :m], matrix[row, :, :m] = 0.0, 0.0
        matrix[row, range(m), range(m)] = size
        right[row, :m] = 0.0

    # -- after ---------------------------------------------------------------------------------------------------------

    def recover(self, unknowns: np.ndarray, order: np.ndarray) -> np.ndarray:
        """(n, 6) ``unknowns`` in terms of d, prescribed ones included, from the solver's ``unknowns`` (n, 6)."""
        unknowns = unknowns.copy()
        for c in self._changed:
            z = unknowns[order[c.block]]
            z[: len(c.known)] = c.known
            unknowns[order[c.block]] = c.basis @ z
        return unknowns

    def free_part(self, unknowns: np.ndarray, order: np.ndarray) -> np.ndarray:
        """(n, 6) the same for a change of the ``unknowns``: prescribed ones do not change."""
        unknowns = unknowns.copy()
        for c in self._changed:
            z = unknowns[order[c.block]]
            z[: len(c.known)] = 0.0
            unknowns[order[c.block]] = c.basis @ z
        return unknowns

    def correct_velocity(self, velocity: np.ndarray) -> None:
        """Set prescribed rates at the end of the step in ``velocity`` (n_blocks, 6), in place: the time scheme
        oscillates about them."""
        velocity[self.fixed] = self.rate[self.fixed]
        for c in self._changed:
            scale = self._scale(c.block)
            found = velocity[c.block] * scale
            found += c.constraint.T @ np.linalg.solve(c.constraint @ c.constraint.T, c.rate - c.constraint @ found)
            velocity[c.block] = found / scale

    def reactions(
        self, unknowns: np.ndarray, pushes: list[np.ndarray], order: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Reactions: generalised forces (n_blocks, 6) of block motions about the centroids, N and N m, and POINT_FORCE
        rows of point motions.

        ``unknowns`` (n, 6) from `recover`; ``pushes``: forces (n, 2) of each set of pairs, N."""
        of_blocks = np.zeros((self.blocks.n_blocks, 6))
        at_points = np.zeros((len(self._points), 2))
        for number, b, rows, by in self._springs:
            missing = by - rows / self._scale(b) @ unknowns[order[b]]
            at_points[number] += self._points[number].stiffness * missing @ self._points[number].axes
        for c in self._changed:
            left = c.matrix @ unknowns[order[c.block]] - c.right
            for (at, vectors), push in zip(c.pairs, [p for p in pushes for _ in range(2)], strict=True):
                left = left - np.einsum("nk,nka->a", push[at], vectors)
            multiplier = np.linalg.lstsq(c.constraint.T, left, rcond=None)[0]
            for value, row, source in zip(multiplier, c.constraint, c.source, strict=True):
                if source < 0:
                    of_blocks[c.block] += value * row * self._scale(c.block)
            for number in {s for s in c.source if s >= 0}:
                own_multipliers = [
                    value for value, source in zip(multiplier, c.source, strict=True) if source == number
                ]
                at_points[number] += np.array(own_multipliers) @ self._points[number].axes
        self._rows["force"] = at_points
        return of_blocks, self._rows
