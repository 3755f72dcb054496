"""Assembly of the 6×6-block system of a step from block equations and contact springs, and its solution.

The unknowns are (u0, v0, h r0, h εx, h εy, h γxy) with h = √area: all six are lengths, and the matrix is well scaled.
Fixed blocks have no unknowns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ...model import OPEN, SLIP, STICK
from ..equation_records import (
    BlockEquations,
    ContactMotion,
    ContactSides,
    ContactStiffness,
    MatrixPlaces,
    SpringsInStates,
)
from .block_solver import RESIDUAL, BlockSolver
from .simd import load_six, minus_product, numbers, plus_product, product, spread, store, store_six, zeros
from .task_pool import SHARE, THREADED, add_at_once, await_value, thread_team

#: Number of free blocks up to which a dense factorisation is faster than a sparse one (measured on brick walls).
DENSE_BLOCKS = 60


@dataclass(frozen=True, eq=False)
class Links:
    """Couplings of blocks other than contacts: ``blocks`` (k, 6, 6) at ``row`` and ``column`` (k,) of the matrix of 6×6
    blocks, at ``places`` (k, 6, 6) of the flat matrix."""

    row: np.ndarray
    column: np.ndarray
    places: np.ndarray
    blocks: np.ndarray


@dataclass(frozen=True, eq=False)
class Pattern:
    """Positions of the 6×6 blocks in the flat matrix: entry (a, b) of a block is data[base + a·stride[row] + b].

    ``order`` (n_blocks,) is the number of each block's unknowns, −1 if it is fixed; the entries of row block i begin at
    ``begins[i]``. ``solver`` is None for a dense matrix. ``links``: couplings other than contacts, or None.
    """

    n: int
    order: np.ndarray
    begins: np.ndarray
    stride: np.ndarray
    diagonal: np.ndarray
    upper: np.ndarray
    lower: np.ndarray
    size: int
    solver: BlockSolver | None = None
    links: Links | None = None

    def add_links(self, data: np.ndarray) -> None:
        """Add the links to an assembled matrix, in place."""
        if self.links is not None:
            np.add.at(data, self.links.places, self.links.blocks)

    def without_contacts(self, matrix: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
        """(n, 6) product of the blocks' own ``matrix`` (n, 6, 6) plus the links with ``unknowns`` (6 n,)."""
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
        begins=36 * n * np.arange(n + 1),
        stride=np.full(n, 6 * n),
        diagonal=36 * n * number + 6 * number,
        upper=36 * n * i + 6 * j,
        lower=36 * n * j + 6 * i,
        size=36 * n * n,
    )


def sparse_pattern(
    order: np.ndarray, block: np.ndarray, other: np.ndarray, points: np.ndarray, kept: BlockSolver | None = None
) -> Pattern:
    """Pattern of a block-sparse matrix whose 6×6 blocks are stored one after the other. ``points`` (n_blocks, 2) m:
    centroids.

    The ``kept`` solver is reused unless two blocks are in contact for which it has no entry.
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
        begins=36 * kept.pointer,
        stride=np.full(n, 6),
        diagonal=36 * kept.entry(number * n + number),
        upper=36 * kept.entry(np.where(both, i * n + j, 0)),
        lower=36 * kept.entry(np.where(both, j * n + i, 0)),
        size=36 * len(kept.keys),
        solver=kept,
    )


@kept(fastmath=False, error_model="numpy", nogil=True)
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


@kept(fastmath=False, error_model="numpy", nogil=True)
def sides_of(n, order, block, other):
    """The `ContactSides` of ``n`` free blocks, ascending."""
    start = np.zeros(n + 2, np.int64)
    for c in range(len(block)):
        i, j = order[block[c]], order[other[c]]
        if i >= 0:
            start[i + 2] += 1
        if j >= 0:
            start[j + 2] += 1
    for b in range(n):
        start[b + 2] += start[b + 1]
    side = np.empty(start[n + 1], np.int64)
    for c in range(len(block)):
        i, j = order[block[c]], order[other[c]]
        if i >= 0:
            side[start[i + 1]] = 2 * c
            start[i + 1] += 1
        if j >= 0:
            side[start[j + 1]] = 2 * c + 1
            start[j + 1] += 1
    return ContactSides(start[: n + 1], side)


@part(error_model="numpy", nogil=True, **UNCOUNTED)
def _put_block(where, at, stride, r0, r1, r2, r3, r4, r5):
    """Write six rows of six, ``stride`` apart."""
    store_six(where, at, r0)
    store_six(where, at + stride, r1)
    store_six(where, at + 2 * stride, r2)
    store_six(where, at + 3 * stride, r3)
    store_six(where, at + 4 * stride, r4)
    store_six(where, at + 5 * stride, r5)


@part(error_model="numpy", nogil=True, **UNCOUNTED)
def _add_pair(room, pull, across, r0, r1, r2, r3, r4, r5):
    """Add to the rows r and the 6 × 6 block the product push ⊗ ``pull`` + drag ⊗ ``across``; push and drag begin at 0
    and 8 of ``room``."""
    r0 = plus_product(plus_product(r0, spread(room, 0), pull), spread(room, 8), across)
    r1 = plus_product(plus_product(r1, spread(room, 1), pull), spread(room, 9), across)
    r2 = plus_product(plus_product(r2, spread(room, 2), pull), spread(room, 10), across)
    r3 = plus_product(plus_product(r3, spread(room, 3), pull), spread(room, 11), across)
    r4 = plus_product(plus_product(r4, spread(room, 4), pull), spread(room, 12), across)
    r5 = plus_product(plus_product(r5, spread(room, 5), pull), spread(room, 13), across)
    return r0, r1, r2, r3, r4, r5


@kept(fastmath=False, error_model="numpy", nogil=True)
def _fill_rows(first, last, sides, data, matrix, places, contacts, stiffness):
    """Fill the rows of blocks from ``first`` to before ``last`` (see `assemble`); ``places`` (`MatrixPlaces`). The rows of
    a block are the same to the last bit whichever thread fills them.

    The block's own 6 × 6, and that of the neighbour being processed, stay in registers."""
    buffer = np.empty(16)
    start, side = sides
    begins, stride, diagonal, upper, lower = places
    block, other, order, vectors = contacts
    normal, shear, slope, lift = stiffness
    room, into, given, along = numbers(buffer), numbers(data), numbers(matrix), numbers(vectors)
    kns, kss, frictions, rises = numbers(normal), numbers(shear), numbers(slope), numbers(lift)
    for b in range(first, last):
        for k in range(begins[b], begins[b + 1]):
            data[k] = 0.0
        step, at = stride[b], 36 * b
        d0, d1, d2 = load_six(given, at), load_six(given, at + 6), load_six(given, at + 12)
        d3, d4, d5 = load_six(given, at + 18), load_six(given, at + 24), load_six(given, at + 30)
        p0 = p1 = p2 = p3 = p4 = p5 = zeros(into)
        at_hand = -1
        for q in range(start[b], start[b + 1]):
            c, at = side[q] >> 1, 6 * (side[q] & 1)
            if normal[c] == 0.0 and shear[c] == 0.0:
                continue
            n, t = load_six(along, 24 * c + at), load_six(along, 24 * c + 12 + at)
            rise = spread(rises, c)
            push = product(spread(kns, c), plus_product(n, spread(frictions, c), t))
            store(room, 0, push)
            store(room, 8, product(spread(kss, c), t))
            pull = minus_product(n, rise, t)
            d0, d1, d2, d3, d4, d5 = _add_pair(room, pull, t, d0, d1, d2, d3, d4, d5)
            if (order[other[c]] if at == 0 else order[block[c]]) >= 0:
                their = upper[c] if at == 0 else lower[c]
                if their != at_hand:
                    if at_hand >= 0:
                        _put_block(into, at_hand, step, p0, p1, p2, p3, p4, p5)
                    at_hand = their
                    # Sum over earlier contacts with this neighbour, which need not be consecutive.
                    p0, p1 = load_six(into, their), load_six(into, their + step)
                    p2, p3 = load_six(into, their + 2 * step), load_six(into, their + 3 * step)
                    p4, p5 = load_six(into, their + 4 * step), load_six(into, their + 5 * step)
                n, t = load_six(along, 24 * c + 6 - at), load_six(along, 24 * c + 18 - at)
                p0, p1, p2, p3, p4, p5 = _add_pair(room, minus_product(n, rise, t), t, p0, p1, p2, p3, p4, p5)
        if at_hand >= 0:
            _put_block(into, at_hand, step, p0, p1, p2, p3, p4, p5)
        _put_block(into, diagonal[b], step, d0, d1, d2, d3, d4, d5)
    # Keeps the arrays alive, which are addressed by pointers above.
    return len(buffer) + len(data) + len(matrix) + len(vectors) + len(normal) + len(shear) + len(slope) + len(lift)


@kept(fastmath=False, error_model="numpy", nogil=True)
def _fill_shared(claimed, done, share, sides, data, matrix, places, contacts, stiffness):
    """Fill the rows of ``share`` blocks at a time, shared with other threads; ``claimed`` and ``done`` (1,) as for the
    elimination of fronts."""
    n = len(matrix)
    shares = (n + share - 1) // share
    while True:
        q = add_at_once(claimed, 0, 1)
        if q >= shares:
            break
        _fill_rows(q * share, min(n, (q + 1) * share), sides, data, matrix, places, contacts, stiffness)
        add_at_once(done, 0, 1)
    await_value(done, 0, shares)


def assemble(
    pattern: Pattern,
    data: np.ndarray,
    matrix: np.ndarray,
    contacts: ContactMotion,
    stiffness: ContactStiffness,
    couplings: tuple[np.ndarray, np.ndarray] | None = None,
    sides: ContactSides | None = None,
) -> None:
    """Fill ``data`` with the blocks' own ``matrix`` (n, 6, 6) and the ``stiffness`` of ``contacts``. ``couplings``:
    ``upper`` and ``lower`` of these contacts, where they are not those of the ``pattern``; ``sides`` as from
    `sides_of`, if known."""
    upper, lower = (pattern.upper, pattern.lower) if couplings is None else couplings
    places = MatrixPlaces(pattern.begins, pattern.stride, pattern.diagonal, upper, lower)
    sides = sides_of(pattern.n, contacts.order, contacts.block, contacts.other) if sides is None else sides
    # Plain tuples: for each named one Numba takes 1.6 µs to find out its type.
    rest = tuple(sides), data, matrix, tuple(places), tuple(contacts), tuple(stiffness)
    if pattern.n < THREADED:
        _fill_rows(0, pattern.n, *rest)
        return
    claimed, done = np.zeros(1, np.int64), np.zeros(1, np.int64)
    thread_team().share(_fill_shared, claimed, done, SHARE, *rest)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def spring_in_state(state, direction, normal, shear, friction, sliding, shear0):
    """Stiffness of a closed contact normal to and along the edge, the ratio of shear to normal force while it slides (0
    while it sticks), and its shear force at zero motion."""
    if state == SLIP:
        return normal, 0.0, direction * friction, direction * sliding
    return normal, shear if state == STICK else 0.0, 0.0, shear0


@kept(fastmath=False, error_model="numpy", nogil=True)
def _springs(right, own_right, contacts, springs):
    """Fill ``right`` (see `assemble_contacts`). Returns (n,) normal and shear stiffness of the contacts in their
    states, the ratio of shear to normal force of sliding ones, and whether the matrix is symmetric."""
    block, other, order, vectors = contacts
    state, direction, gap, normal, shear, friction, sliding, lift, shear0 = springs
    for b in range(own_right.shape[0]):
        for a in range(6):
            right[6 * b + a] = own_right[b, a]
    stiff, along, slope, symmetric = np.zeros(len(block)), np.zeros(len(block)), np.zeros(len(block)), True
    for c in range(block.shape[0]):
        if state[c] == OPEN:
            continue
        stiff[c], along[c], slope[c], given = spring_in_state(
            state[c], direction[c], normal[c], shear[c], friction[c], sliding[c], shear0[c]
        )
        if state[c] == SLIP:
            symmetric = symmetric and slope[c] == 0.0 and lift[c] == 0.0
        pressed = normal[c] * gap[c]
        i, j = order[block[c]], order[other[c]]
        for a in range(12):
            k = i if a < 6 else j
            if k >= 0:
                n, t = vectors[c, 0, a], vectors[c, 1, a]
                right[6 * k + a % 6] += given * t - pressed * (n + slope[c] * t)
    return stiff, along, slope, symmetric


def assemble_contacts(
    pattern: Pattern,
    own: BlockEquations,
    contacts: ContactMotion,
    springs: SpringsInStates,
    data: np.ndarray,
    right: np.ndarray,
    sides: ContactSides | None = None,
) -> tuple[bool, ContactStiffness]:
    """Fill ``data`` and ``right`` with the blocks' ``own`` equations and the ``springs`` of closed ``contacts``. Returns
    whether the matrix is symmetric, and the stiffness in ``data``; ``sides`` as for `assemble`.

    Normal force N = −kₙ(g + n·Δu − κ t·Δu), with dilation κ. Stick: S = S₀ − kₛ t·Δu. Slip: S = ± (μ N + c) with the
    unknown N, which makes the matrix unsymmetric but friction exact in one solution.
    """
    normal, shear, slope, symmetric = _springs(right, own.right, tuple(contacts), tuple(springs))
    stiffness = ContactStiffness(normal, shear, slope, springs.lift)
    assemble(pattern, data, own.matrix, contacts, stiffness, sides=sides)
    return symmetric, stiffness


def solve(
    pattern: Pattern, data: np.ndarray, right: np.ndarray, symmetric: bool, force: float = 0.0,
    near: tuple[np.ndarray | None, np.ndarray | None] = (None, None), within: float = RESIDUAL,
    product: Callable[[np.ndarray], np.ndarray] | None = None,
) -> np.ndarray:  # fmt: skip
    """Unknowns (6 n,) in the pattern's order; ``force``, ``near`` with its residual, ``within`` and ``product`` as for
    `BlockSolver.solve`. Overwrites ``data`` when dense. Raises numpy.linalg.LinAlgError."""
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
    return pattern.solver.solve(data, right, within, force, *near, product)
