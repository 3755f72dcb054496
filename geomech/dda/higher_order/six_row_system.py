"""Linear system of blocks of different orders, with rows of six unknowns for all.

A block of order p has (p + 1)(p + 2) unknowns, its first six and then its deflection: 2, 5, 7, 12 or 15 rows of six for
p = 2, 4, 5, 7, 8, and 4 or 10 for p = 3, 6 with four unknowns to spare, which are set to zero. The solvers for
first-order blocks (`linear_solver`), which use blocks of 6 × 6, therefore serve all orders: a block is as many nodes of
their graph as it has rows of six, the cost of factors grows with the cube of its unknowns, and blocks of order 1 are
treated as before.

A contact responds to a motion Δu of its two blocks by dN = −kₙ (n − κ t)·Δu and dS = −kₛ t·Δu + μ dN, with n and t the
motion across and along the face per unit of all unknowns of both blocks (`fill`, as `linear_solver.assembly`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ...model import OPEN, SLIP
from ..linear_solver import assembly
from ..linear_solver.assembly import spring_in_state
from ..linear_solver.block_solver import BlockSolver

_jit = kept(fastmath={"contract"}, error_model="numpy", nogil=True)


@dataclass(frozen=True, eq=False)
class SixRowPattern(assembly.Pattern):
    """Locations in the flat matrix of the 6 × 6 blocks of pairs of rows of six; ``n`` is the number of rows of six.

    rows      (n_blocks,)  number of rows of each block; 0 for fixed ones. The first is ``order[block]``, …
    more      (n_blocks,)  … the others begin here
    where     (k,)         locations of 6 × 6 blocks: row after row of two blocks that meet
    own       (n_blocks,)  start of each block's own entries in ``where``
    """

    rows: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    more: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    where: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    own: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    step: int = 6

    def unknowns_of(self, block: int, n: int) -> np.ndarray:
        """(n,) positions of the ``n`` unknowns of ``block`` among all (6 n,)."""
        first = 6 * int(self.order[block]) + np.arange(6)
        return np.concatenate([first, 6 * int(self.more[block]) + np.arange(n - 6)])

    @property
    def places(self) -> tuple[np.ndarray, ...]:
        """As in `fill`."""
        return self.where, self.own, self.upper, self.lower, self.rows


def six_row_pattern(
    order: np.ndarray, rows: np.ndarray, block: np.ndarray, other: np.ndarray, points: np.ndarray,
    kept_pattern: SixRowPattern | None = None,
) -> SixRowPattern:  # fmt: skip
    """The pattern of blocks with ``rows`` (n_blocks,) rows of six, 0 for those without unknowns.

    ``order`` (n_blocks,) numbers the others, of which ``block`` and ``other`` (n_contacts,) meet; ``points`` (n_blocks,
    2) m lie inside them. The solver of ``kept_pattern`` is reused if it contains all pairs.
    """
    n_blocks, free = len(order), np.flatnonzero(order >= 0)
    n = int(rows.sum())
    extra = np.where(order >= 0, rows - 1, 0)
    more = len(free) + np.cumsum(extra) - extra
    both = (order[block] >= 0) & (order[other] >= 0) & (block != other)
    low, high = np.minimum(block, other)[both], np.maximum(block, other)[both]
    keys = np.unique(low * n_blocks + high)
    first = np.concatenate([free, keys // n_blocks, keys % n_blocks])
    second = np.concatenate([free, keys % n_blocks, keys // n_blocks])
    # All pairs of rows of six, those of two blocks one after the other.
    size = rows[first] * rows[second]
    start = np.cumsum(size) - size
    pair = np.repeat(np.arange(len(first)), size)
    at = np.arange(int(size.sum())) - start[pair]
    upper, lower = at // rows[second[pair]], at % rows[second[pair]]

    def number(b: np.ndarray, r: np.ndarray) -> np.ndarray:
        return np.where(r == 0, order[b], more[b] + r - 1)

    i, j = number(first[pair], upper), number(second[pair], lower)
    owner = np.empty(n, np.int64)
    owner[order[free]] = free
    owner[len(free) :] = np.repeat(np.arange(n_blocks), extra)
    solver, step = None, 6
    if n <= assembly.DENSE_BLOCKS:
        where, step, total = 36 * n * i + 6 * j, 6 * n, 36 * n * n
    else:
        entries = i * n + j
        solver = None if kept_pattern is None else kept_pattern.solver
        if solver is None or solver.n != n or not solver.holds(entries):
            entries = np.unique(entries)
            solver = BlockSolver(np.ascontiguousarray(points[owner]), entries // n, entries % n)
        where, total = 36 * solver.entry(i * n + j), 36 * len(solver.keys)
    own, up, down = np.full(n_blocks, -1), np.zeros(len(block), np.int64), np.zeros(len(block), np.int64)
    own[free] = start[: len(free)]
    if both.any():
        index = np.searchsorted(keys, low * n_blocks + high)
        one, two = start[len(free) + index], start[len(free) + len(keys) + index]
        ascending = block[both] < other[both]
        up[both], down[both] = np.where(ascending, one, two), np.where(ascending, two, one)
    return SixRowPattern(
        n=n, order=order, begins=np.zeros(0, np.int64), stride=np.zeros(0, np.int64), diagonal=np.zeros(0, np.int64),
        upper=up, lower=down, size=total, solver=solver, rows=rows, more=more, where=where, own=own, step=step,
    )  # fmt: skip


@part(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def _add_own(data, where, first, step, rows, matrix, begin):
    """Add a block's own ``matrix``, stored from ``begin`` on, with ``rows`` rows of six."""
    size = 6 * rows
    for i in range(rows):
        for j in range(rows):
            at = where[first + i * rows + j]
            for k in range(6):
                given = begin + (6 * i + k) * size + 6 * j
                for m in range(6):
                    data[at + k * step + m] = matrix[given + m]


@part(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def add_pair(data, where, first, step, rows, others, given, along):
    """Add push ⊗ pull + drag ⊗ across of a contact.

    ``given`` (2, w): push and drag of the block with ``rows`` rows of six; ``along`` (2, w): pull and across of the one
    with ``others``.
    """
    push, drag, pull, across = given[0], given[1], along[0], along[1]
    for i in range(rows):
        for j in range(others):
            at = where[first + i * others + j]
            for k in range(6):
                p, s = push[6 * i + k], drag[6 * i + k]
                for m in range(6):
                    data[at + k * step + m] += p * pull[6 * j + m] + s * across[6 * j + m]


@kept(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def fill_own(data, places, step, own, order):
    """Fill the flat matrix ``data`` with the blocks' matrices: ``own`` holds them one after the other, and the start of
    each.

    ``places`` as in `fill`, ``order`` of the pattern.
    """
    where, own_at, _, _, rows = places
    data[:] = 0.0
    for b in range(len(rows)):
        if order[b] >= 0:
            _add_own(data, where, own_at[b], step, rows[b], own[0], own[1][b])


@_jit
def fill(data, base, places, step, blocks, vectors, laws):
    """Fill the flat matrix ``data`` with ``base``, which does not depend on contact states, and with contacts.

    As `assembly.assemble`. ``places``: ``where``, ``own``, ``upper``, ``lower`` and ``rows`` of the pattern;
    ``blocks``: block and other of contacts, and the pattern's order; ``vectors`` (n_contacts, 2, 2, w): direction,
    side, unknowns of the side's block; ``laws``: kₙ, kₛ, μ and κ (n_contacts,).
    """
    where, own_at, upper, lower, rows = places
    block, other, order = blocks
    normal, shear, slope, lift = laws
    data[:] = base
    width = vectors.shape[3]
    given, along = np.empty((2, 2, width)), np.empty((2, 2, width))
    for c in range(len(block)):
        if normal[c] == 0.0 and shear[c] == 0.0:
            continue
        for side in range(2):
            for a in range(width):
                n, t = vectors[c, 0, side, a], vectors[c, 1, side, a]
                given[side, 0, a] = normal[c] * (n + slope[c] * t)
                given[side, 1, a] = shear[c] * t
                along[side, 0, a] = n - lift[c] * t
                along[side, 1, a] = t
        i, j = block[c], other[c]
        if order[i] >= 0:
            add_pair(data, where, own_at[i], step, rows[i], rows[i], given[0], along[0])
        if order[j] >= 0:
            add_pair(data, where, own_at[j], step, rows[j], rows[j], given[1], along[1])
        if order[i] >= 0 and order[j] >= 0:
            add_pair(data, where, upper[c], step, rows[i], rows[j], given[0], along[1])
            add_pair(data, where, lower[c], step, rows[j], rows[i], given[1], along[0])


@part(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def add_force(right, first, more, count, along, push, drag):
    """Add ``push`` normal to and ``drag`` along a face, with the rows ``along`` (2, w) of one block, to the right
    side."""
    for a in range(count):
        at = 6 * first + a if a < 6 else 6 * more + a - 6
        right[at] += push * along[0, a] + drag * along[1, a]


@_jit
def springs_in_states(right, blocks, rows, vectors, states, springs):
    """Add the forces of closed contacts at zero motion to ``right`` (6 n,).

    Returns their normal and shear stiffness, the ratio of sliding shear to normal force (n_contacts,) each, and whether
    the matrix is symmetric (`assembly.assemble_contacts`). ``blocks``: block and other of contacts, and the pattern's
    order; ``rows``: ``more`` and ``rows`` of the pattern; ``states``: state, direction, gap and initial shear force;
    ``springs``: kₙ, kₛ, friction, sliding force and lift.
    """
    block, other, order = blocks
    more, count = rows
    state, direction, gap, shear0 = states
    normal, shear, friction, sliding, lift = springs
    stiff, along, slope, symmetric = np.zeros(len(block)), np.zeros(len(block)), np.zeros(len(block)), True
    for c in range(len(block)):
        if state[c] == OPEN:
            continue
        stiff[c], along[c], slope[c], given = spring_in_state(
            state[c], direction[c], normal[c], shear[c], friction[c], sliding[c], shear0[c]
        )
        if state[c] == SLIP:
            symmetric = symmetric and slope[c] == 0.0 and lift[c] == 0.0
        pressed = normal[c] * gap[c]
        for side in range(2):
            b = block[c] if side == 0 else other[c]
            if order[b] >= 0:
                add_force(
                    right, order[b], more[b], 6 * count[b], vectors[c, :, side], -pressed, given - pressed * slope[c]
                )
    return stiff, along, slope, symmetric


@_jit
def moved(unknowns, blocks, rows, vectors):
    """(n_contacts, 2): motion across and along the face due to ``unknowns`` (6 n,); other arguments as in
    `springs_in_states`."""
    block, other, order = blocks
    more, count = rows
    out = np.zeros((len(block), 2))
    for c in range(len(block)):
        for side in range(2):
            b = block[c] if side == 0 else other[c]
            if order[b] < 0:
                continue
            for a in range(6 * count[b]):
                value = unknowns[6 * order[b] + a] if a < 6 else unknowns[6 * more[b] + a - 6]
                out[c, 0] += vectors[c, 0, side, a] * value
                out[c, 1] += vectors[c, 1, side, a] * value
    return out
