"""The 6×6-block system of a step: the blocks' own equations, contact springs, and its solution.

Unknowns are (u0, v0, h r0, h εx, h εy, h γxy) with h = √area, so that all six are lengths and the matrix stays well
scaled. Free blocks only: a fixed block has no unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ..model import OPEN, SLIP, STICK
from .block_solver import BlockSolver

#: Up to this many free blocks a dense factorisation is quicker than a sparse one (measured on brick walls).
DENSE_BLOCKS = 60


@dataclass(frozen=True, eq=False)
class Links:
    """What links blocks besides contacts: ``blocks`` (k, 6, 6) of the matrix at ``row`` and ``column`` (k,) of its 6×6
    blocks, which stand at ``places`` (k, 6, 6) of the flat matrix."""

    row: np.ndarray
    column: np.ndarray
    places: np.ndarray
    blocks: np.ndarray


@dataclass(frozen=True, eq=False)
class Pattern:
    """Where each 6×6 block stands in the flat matrix: entry (a, b) of a block is data[base + a·stride[row] + b].

    ``order`` (n_blocks,) is the number of each block's unknowns, −1 if fixed. ``solver`` is None for a dense matrix.
    ``links`` are those that other things than contacts make, None without.
    """

    n: int
    order: np.ndarray
    stride: np.ndarray
    diagonal: np.ndarray
    upper: np.ndarray
    lower: np.ndarray
    size: int
    solver: BlockSolver | None = None
    links: Links | None = None

    def add_links(self, data: np.ndarray) -> None:
        """Add them to an assembled matrix."""
        if self.links is not None:
            np.add.at(data, self.links.places, self.links.blocks)

    def without_contacts(self, matrix: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
        """(n, 6) the product of the blocks' own ``matrix`` (n, 6, 6) and of the links with ``unknowns`` (6 n,)."""
        rows = unknowns.reshape(-1, 6)
        out = np.einsum("bij,bj->bi", matrix, rows)
        if self.links is not None:
            np.add.at(out, self.links.row, np.einsum("kij,kj->ki", self.links.blocks, rows[self.links.column]))
        return out


def dense_pattern(order: np.ndarray, block: np.ndarray, other: np.ndarray) -> Pattern:
    """Pattern of a full matrix; ``block`` and ``other`` (n_contacts,) are the contacts' owners."""
    n = int(order.max()) + 1
    number = np.arange(n)
    i, j = order[block], order[other]
    return Pattern(
        n=n,
        order=order,
        stride=np.full(n, 6 * n),
        diagonal=36 * n * number + 6 * number,
        upper=36 * n * i + 6 * j,
        lower=36 * n * j + 6 * i,
        size=36 * n * n,
    )


def sparse_pattern(
    order: np.ndarray, block: np.ndarray, other: np.ndarray, points: np.ndarray, kept: BlockSolver | None = None
) -> Pattern:
    """Pattern of a block-sparse matrix, its 6×6 blocks stored one after the other. ``points`` (n_blocks, 2) m:
    centroids.

    The ``kept`` solver serves on as long as no two blocks meet that did not when it was made.
    """
    n = int(order.max()) + 1
    i, j = order[block], order[other]
    both = (i >= 0) & (j >= 0)
    number = np.arange(n)
    pairs = np.concatenate([i[both] * n + j[both], j[both] * n + i[both]])
    if kept is None or not kept.holds(pairs):
        keys = np.unique(np.concatenate([number * n + number, pairs]))
        free = np.empty(n, np.int64)
        free[order[order >= 0]] = np.flatnonzero(order >= 0)
        kept = BlockSolver(points[free], keys // n, keys % n)
    return Pattern(
        n=n,
        order=order,
        stride=np.full(n, 6),
        diagonal=36 * kept.entry(number * n + number),
        upper=36 * kept.entry(np.where(both, i * n + j, 0)),
        lower=36 * kept.entry(np.where(both, j * n + i, 0)),
        size=36 * len(kept.keys),
        solver=kept,
    )


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True)
def contact_vectors(block, other, geometry, order, moments):
    """(n, 2, 12): relative motion of vertex and edge along the normal and along the edge, per unit of the unknowns.

    Both blocks turn about the vertex itself, so that the pair of contact forces has no moment; the owner of the edge
    is strained at the vertex's projection on the edge, so that penetration does not stretch its arm.
    """
    n = block.shape[0]
    out = np.zeros((n, 2, 12))
    for c in range(n):
        nx, ny = geometry[c, 1], geometry[c, 2]
        for side in range(2):
            b = block[c] if side == 0 else other[c]
            if order[b] < 0:
                continue
            sign = 1.0 if side == 0 else -1.0
            h = np.sqrt(moments[b, 0])
            x, y = (geometry[c, 5] - moments[b, 1]) / h, (geometry[c, 6] - moments[b, 2]) / h
            for k in range(2):
                ax, ay = (nx, ny) if k == 0 else (-ny, nx)
                at = 6 * side
                out[c, k, at] = sign * ax
                out[c, k, at + 1] = sign * ay
                out[c, k, at + 2] = sign * (x * ay - y * ax)
                sx = x - side * geometry[c, 3] * nx / h
                sy = y - side * geometry[c, 3] * ny / h
                out[c, k, at + 3] = sign * sx * ax
                out[c, k, at + 4] = sign * sy * ay
                out[c, k, at + 5] = sign * 0.5 * (sy * ax + sx * ay)
    return out


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True)
def begin(data, matrix, stride, diagonal):
    """The flat ``data`` as lines of six, with the blocks' own part alone."""
    data[:] = 0.0
    lines = data.reshape((-1, 6))
    for b in range(matrix.shape[0]):
        for a in range(6):
            line = (diagonal[b] + a * stride[b]) // 6
            for m in range(6):
                lines[line, m] = matrix[b, a, m]
    return lines


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True, inline="always")
def _add_block(lines, first, step, push, drag, pull, across, mine, its):
    """Add the 6 × 6 of ``push`` ⊗ ``pull`` + ``drag`` ⊗ ``across`` (12,) whose rows begin at ``mine`` and columns at
    ``its`` to every ``step``-th of the ``lines`` of `begin`. (Written out and inlined: two thirds of the time of
    loops.)"""
    u0, u1, u2, u3, u4, u5 = pull[its], pull[its + 1], pull[its + 2], pull[its + 3], pull[its + 4], pull[its + 5]
    t = across
    t0, t1, t2, t3, t4, t5 = t[its], t[its + 1], t[its + 2], t[its + 3], t[its + 4], t[its + 5]
    for a in range(6):
        line, p, d = first + a * step, push[mine + a], drag[mine + a]
        lines[line, 0] += p * u0 + d * t0
        lines[line, 1] += p * u1 + d * t1
        lines[line, 2] += p * u2 + d * t2
        lines[line, 3] += p * u3 + d * t3
        lines[line, 4] += p * u4 + d * t4
        lines[line, 5] += p * u5 + d * t5


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True, inline="always")
def add_contact(lines, i, j, diagonal, stride, upper, lower, push, drag, pull, across):
    """Add what a contact of the blocks with unknowns ``i`` and ``j`` (−1: none) does to the ``lines`` of `begin`, as
    `_add_block`; ``upper`` and ``lower`` are where the blocks that couple them begin."""
    if i >= 0:
        _add_block(lines, diagonal[i] // 6, stride[i] // 6, push, drag, pull, across, 0, 0)
    if j >= 0:
        _add_block(lines, diagonal[j] // 6, stride[j] // 6, push, drag, pull, across, 6, 6)
    if i >= 0 and j >= 0:
        _add_block(lines, upper // 6, stride[i] // 6, push, drag, pull, across, 0, 6)
        _add_block(lines, lower // 6, stride[j] // 6, push, drag, pull, across, 6, 0)


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True)
def assemble_contacts(
    data,
    right,
    matrix,
    base_right,
    stride,
    diagonal,
    upper,
    lower,
    block,
    other,
    order,
    vectors,
    state,
    direction,
    gap,
    normal,
    shear,
    friction,
    sliding,
    lift,
    shear0,
):
    """Fill ``data`` and ``right`` with the blocks' own part and the springs of closed contacts; True if symmetric.

    Normal force N = −kₙ(g + n·Δu − κ t·Δu), with the lift κ by sliding. Stick: S = S₀ − kₛ t·Δu. Slip: S = ± (μ N + c),
    with N the unknown one, which makes the matrix unsymmetric but friction exact in one solution.
    """
    lines = begin(data, matrix, stride, diagonal)
    for b in range(matrix.shape[0]):
        for a in range(6):
            right[6 * b + a] = base_right[b, a]
    symmetric = True
    push, drag, pull, across = np.empty(12), np.empty(12), np.empty(12), np.empty(12)
    for c in range(block.shape[0]):
        if state[c] == OPEN:
            continue
        slope, given = 0.0, shear0[c]
        if state[c] == SLIP:
            slope = direction[c] * friction[c]
            given = direction[c] * sliding[c]
            symmetric = symmetric and slope == 0.0 and lift[c] == 0.0
        stiff_along = shear[c] if state[c] == STICK else 0.0
        kn, rise, pressed = normal[c], lift[c], normal[c] * gap[c]
        i, j = order[block[c]], order[other[c]]
        for a in range(12):
            n, t = vectors[c, 0, a], vectors[c, 1, a]
            push[a], drag[a] = n + slope * t, stiff_along * t
            pull[a], across[a] = n - rise * t, t
            k = i if a < 6 else j
            if k >= 0:
                right[6 * k + a % 6] += given * t - pressed * push[a]
            push[a] *= kn
        add_contact(lines, i, j, diagonal, stride, upper[c], lower[c], push, drag, pull, across)
    return symmetric


def solve(pattern: Pattern, data: np.ndarray, right: np.ndarray, symmetric: bool) -> np.ndarray:
    """Unknowns (6 n,) in the pattern's order. Overwrites ``data`` when dense. Raises numpy.linalg.LinAlgError."""
    pattern.add_links(data)
    if pattern.solver is None:
        from scipy.linalg.lapack import dgesv, dposv

        # The flat matrix is C-ordered: its Fortran view is the transpose.
        full = data.reshape(6 * pattern.n, -1).T
        if symmetric:
            _, x, info = dposv(full, right, lower=1, overwrite_a=1)
        else:
            _, _, x, info = dgesv(np.asfortranarray(full.T), right, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError(f"the step's matrix is singular (unknown {info - 1})")
        return x
    return pattern.solver.solve(data, right)
