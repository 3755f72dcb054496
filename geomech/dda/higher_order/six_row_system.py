"""Linear system of blocks of different orders, with rows of six unknowns for all.

A block of order p has (p + 1)(p + 2) unknowns, its first six and then its deflection: 1, 2, 5, 7, 12 or 15 rows of six
for p = 1, 2, 4, 5, 7, 8. For p = 3 and 6 two unknowns are left after 3 and 9 rows; those of three neighbours share a
row. The solvers for first-order blocks (`linear_solver`), which use blocks of 6 × 6, therefore serve all orders: a
block is as many nodes of their graph as it has rows of six, the cost of factors grows with the cube of its unknowns,
and blocks of order 1 are treated as before.

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
from ..linear_solver.nested_dissection import LEAF, dissect, plan
from ..linear_solver.simd import (
    BYTES,
    load_first,
    numbers,
    plus_product,
    spread,
    store,
    store_first,
    sums,
    zeros,
)

#: Number of rows of six from which factors are in single precision: with four rows a block they take half the time of
#: double ones, and a solution two substitutions more (`geomech bench order`: walls of 1 000 blocks).
SINGLE_ROWS = 500

#: Numbers in a register.
LANES = BYTES // 8

_jit = kept(fastmath={"contract"}, error_model="numpy", nogil=True)


@dataclass(frozen=True, eq=False)
class SixRows:
    """Where the unknowns of blocks are among ``n`` rows of six.

    A block's unknowns are divided into pieces of six; a last piece of two shares its row with those of other blocks.

    size   (n_blocks,)  number of unknowns of each block, 0 without any
    first  (n_blocks,)  its first piece among those of all blocks
    begin  (k,)         position of the first unknown of each piece among all unknowns (6 n,)
    """

    n: int
    size: np.ndarray
    first: np.ndarray
    begin: np.ndarray

    @property
    def pieces(self) -> np.ndarray:
        """(n_blocks,) number of pieces of each block."""
        return -(-self.size // 6)

    def unknowns(self) -> np.ndarray:
        """(m,) positions of all unknowns, block after block."""
        pieces = self.pieces
        owner = np.repeat(np.arange(len(pieces)), pieces)
        width = np.minimum(6, self.size[owner] - 6 * (np.arange(len(owner)) - self.first[owner]))
        start = np.cumsum(width) - width
        return np.repeat(self.begin - start, width) + np.arange(int(width.sum()))

    @classmethod
    def of(cls, order: np.ndarray, size: np.ndarray, fronts: list[np.ndarray]) -> tuple[SixRows, list[list[int]]]:
        """Rows of blocks numbered by ``order`` (n_blocks,), which is the number of their first row, and the rows of
        each front.

        ``fronts``: the blocks that are eliminated together, in that order; pieces of two share rows within a front.
        """
        pieces = -(-size // 6)
        first = np.cumsum(pieces) - pieces
        begin = np.empty(int(pieces.sum()), np.int64)
        rows, n = [], int((order >= 0).sum())
        for blocks in fronts:
            own: list[int] = []
            row, used = -1, 6
            for b in blocks.tolist():
                at = int(first[b])
                for piece in range(int(pieces[b])):
                    width = min(6, int(size[b]) - 6 * piece)
                    if piece == 0:
                        begin[at] = 6 * order[b]
                        own.append(int(order[b]))
                    elif width == 6:
                        begin[at + piece] = 6 * n
                        own.append(n)
                        n += 1
                    else:
                        if used + width > 6:
                            row, used = n, 0
                            own.append(n)
                            n += 1
                        begin[at + piece] = 6 * row + used
                        used += width
            rows.append(own)
        return cls(n, size, first, begin), rows


@dataclass(frozen=True, eq=False)
class SixRowPattern(assembly.Pattern):
    """Locations in the flat matrix of the pairs of `SixRows` pieces; ``n`` is the number of rows of six.

    layout    the rows
    unknown   (m,)         positions of the blocks' unknowns among all (6 n,), block after block …
    at        (n_blocks,)  … and where those of each block begin
    where     (k,)         locations of the pairs of pieces of two blocks that meet, row after row
    own       (n_blocks,)  start of each block's own entries in ``where``
    spare     (s,)         diagonal entries of places in rows that no block uses
    """

    layout: SixRows = field(default_factory=lambda: SixRows(0, *(np.empty(0, np.int64) for _ in range(3))))
    unknown: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    at: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    where: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    own: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    spare: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    step: int = 6

    def unknowns_of(self, block: int, n: int) -> np.ndarray:
        """(n,) positions of the first ``n`` unknowns of ``block`` among all (6 n,)."""
        return self.unknown[self.at[block] : self.at[block] + n]

    @property
    def places(self) -> tuple[np.ndarray, ...]:
        """As in `fill`."""
        return self.where, self.own, self.upper, self.lower, self.layout.size

    @property
    def unknowns(self) -> tuple[np.ndarray, ...]:
        """As in `moved`."""
        return self.unknown, self.at, self.layout.size


def six_row_pattern(
    order: np.ndarray, size: np.ndarray, block: np.ndarray, other: np.ndarray, points: np.ndarray,
    kept_pattern: SixRowPattern | None = None,
) -> SixRowPattern:  # fmt: skip
    """The pattern of blocks with ``size`` (n_blocks,) unknowns each, 0 for those without.

    ``order`` (n_blocks,) numbers the others, of which ``block`` and ``other`` (n_contacts,) meet; ``points`` (n_blocks,
    2) m lie inside them. The solver of ``kept_pattern`` is reused if it contains all pairs.
    """
    n_blocks, free = len(order), np.flatnonzero(order >= 0)
    both = (order[block] >= 0) & (order[other] >= 0) & (block != other)
    low, high = np.minimum(block, other)[both], np.maximum(block, other)[both]
    keys = np.unique(low * n_blocks + high)
    first = np.concatenate([free, keys // n_blocks, keys % n_blocks])
    second = np.concatenate([free, keys % n_blocks, keys // n_blocks])
    layout, solver = _kept(kept_pattern, order, size, first, second)
    if layout is None:
        layout, solver = _planned(order, size, points, first, second)
    n, unknown = layout.n, layout.unknowns()
    i, j, start = _pairs(layout, first, second)
    if solver is None:
        where, step, total = 6 * n * i + j, 6 * n, 36 * n * n
    else:
        entry = solver.entry(i // 6 * n + j // 6)
        where, step, total = 36 * entry + 6 * (i % 6) + j % 6, 6, 36 * len(solver.keys)
    used = np.zeros(6 * n, bool)
    used[unknown] = True
    spare = np.flatnonzero(~used)
    diagonal = 6 * n * spare if solver is None else 36 * solver.entry(spare // 6 * (n + 1)) + 6 * (spare % 6)
    own, up, down = np.full(n_blocks, -1), np.zeros(len(block), np.int64), np.zeros(len(block), np.int64)
    own[free] = start[: len(free)]
    if both.any():
        index = np.searchsorted(keys, low * n_blocks + high)
        one, two = start[len(free) + index], start[len(free) + len(keys) + index]
        ascending = block[both] < other[both]
        up[both], down[both] = np.where(ascending, one, two), np.where(ascending, two, one)
    return SixRowPattern(
        n=n, order=order, begins=np.zeros(0, np.int64), stride=np.zeros(0, np.int64), diagonal=np.zeros(0, np.int64),
        upper=up, lower=down, size=total, solver=solver, layout=layout, unknown=unknown,
        at=np.cumsum(size) - size, where=where, own=own, spare=diagonal + (spare if solver is None else spare % 6),
        step=step,
    )  # fmt: skip


def _pairs(layout: SixRows, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions of the first unknowns of both pieces, for all pairs of pieces of the blocks ``first`` and ``second`` (k,),
    those of two blocks one after the other; and the first pair of each two blocks."""
    pieces = layout.pieces
    number = pieces[first] * pieces[second]
    start = np.cumsum(number) - number
    pair = np.repeat(np.arange(len(first)), number)
    at = np.arange(int(number.sum())) - start[pair]
    upper, lower = at // pieces[second[pair]], at % pieces[second[pair]]
    return layout.begin[layout.first[first[pair]] + upper], layout.begin[layout.first[second[pair]] + lower], start


def _kept(
    pattern: SixRowPattern | None, order: np.ndarray, size: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[SixRows | None, BlockSolver | None]:
    """Rows and solver of the ``pattern`` if they serve the pairs of blocks ``first`` and ``second``; None otherwise."""
    if pattern is None or pattern.solver is None:
        return None, None
    if not (np.array_equal(pattern.layout.size, size) and np.array_equal(pattern.order, order)):
        return None, None
    i, j, _ = _pairs(pattern.layout, first, second)
    holds = pattern.solver.holds(i // 6 * pattern.n + j // 6)
    return (pattern.layout, pattern.solver) if holds else (None, None)


def _planned(
    order: np.ndarray, size: np.ndarray, points: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[SixRows, BlockSolver | None]:
    """Rows of the blocks, of which ``first`` and ``second`` meet, and their solver, None for a dense matrix."""
    free = np.flatnonzero(order >= 0)
    free = free[np.argsort(order[free])]
    if int((-(-size // 6)).sum()) <= assembly.DENSE_BLOCKS:
        return SixRows.of(order, size, [free])[0], None
    n_free = len(free)
    keys = np.unique(order[first] * n_free + order[second])
    pointer = np.searchsorted(keys // n_free, np.arange(n_free + 1))
    leaf = max(1, round(LEAF * 6 * n_free / int(size.sum())))
    blocks, pivots, parent = dissect(np.ascontiguousarray(points[free]), pointer, keys % n_free, leaf)
    fronts = [free[blocks[a:b]] for a, b in zip(pivots[:-1].tolist(), pivots[1:].tolist(), strict=True)]
    layout, rows = SixRows.of(order, size, fronts)
    n = layout.n
    of_row = np.empty(n, np.int64)
    of_row[layout.begin // 6] = np.repeat(np.arange(len(size)), layout.pieces)
    i, j, _ = _pairs(layout, first, second)
    # (A row that three blocks share meets itself, even where two of these do not meet.)
    entries = np.unique(np.concatenate([i // 6 * n + j // 6, np.arange(n) * (n + 1)]))
    cut = np.concatenate([np.array(own, np.int64) for own in rows]), np.cumsum([0, *map(len, rows)]), parent
    where = np.ascontiguousarray(points[of_row]), entries // n, entries % n
    return layout, BlockSolver(*where, plan(*where, cut), SINGLE_ROWS)


@part(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def _add_own(data, where, first, step, size, matrix, begin):
    """Add the ``size`` rows and columns of a block's own ``matrix``, stored from ``begin`` on in whole rows of six."""
    rows = (size + 5) // 6
    for i in range(rows):
        high = min(6, size - 6 * i)
        for j in range(rows):
            at, wide = where[first + i * rows + j], min(6, size - 6 * j)
            for k in range(high):
                given = begin + (6 * i + k) * 6 * rows + 6 * j
                for m in range(wide):
                    data[at + k * step + m] = matrix[given + m]


@part(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def add_pair(data, where, first, step, size, others, given, along):
    """Add push ⊗ pull + drag ⊗ across of a contact.

    ``given`` (2, w): push and drag of the block with ``size`` unknowns; ``along`` (2, w): pull and across of the one
    with ``others``.
    """
    push, drag, pull, across = given[0], given[1], along[0], along[1]
    rows, columns = (size + 5) // 6, (others + 5) // 6
    for i in range(rows):
        high = min(6, size - 6 * i)
        for j in range(columns):
            at, wide = where[first + i * columns + j], min(6, others - 6 * j)
            for k in range(high):
                p, s = push[6 * i + k], drag[6 * i + k]
                if wide == 6:
                    for m in range(6):
                        data[at + k * step + m] += p * pull[6 * j + m] + s * across[6 * j + m]
                else:
                    for m in range(wide):
                        data[at + k * step + m] += p * pull[6 * j + m] + s * across[6 * j + m]


@part(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def _copy_pair(data, base, where, first, step, size, others):
    """Copy the entries of two blocks with ``size`` and ``others`` unknowns from ``base`` to ``data``."""
    rows, columns = (size + 5) // 6, (others + 5) // 6
    for i in range(rows):
        high = min(6, size - 6 * i)
        for j in range(columns):
            at, wide = where[first + i * columns + j], min(6, others - 6 * j)
            for k in range(high):
                for m in range(wide):
                    data[at + k * step + m] = base[at + k * step + m]


@kept(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def fill_own(data, places, step, own, order):
    """Fill the flat matrix ``data`` with the blocks' matrices: ``own`` holds them one after the other, and the start of
    each.

    ``places`` as in `fill`, ``order`` of the pattern.
    """
    where, own_at, _, _, size = places
    data[:] = 0.0
    for b in range(len(size)):
        if order[b] >= 0:
            _add_own(data, where, own_at[b], step, size[b], own[0], own[1][b])


@_jit
def fill(which, matrix, places, step, blocks, sides, vectors, laws):
    """Fill the rows of the blocks ``which`` (n,) bool, in the pattern's order, of the first flat ``matrix`` with the
    second one, which does not depend on contact states, and with contacts.

    As `assembly.assemble`; a row is the same to the last bit whatever others are filled. ``places``: ``where``, ``own``,
    ``upper``, ``lower`` and sizes of the pattern; ``blocks``: block and other of contacts, and the pattern's order;
    ``sides``: the `ContactSides` of all blocks; ``vectors`` (n_contacts, 2, 2, w): direction, side, unknowns of the
    side's block; ``laws``: kₙ, kₛ, μ and κ (n_contacts,).
    """
    data, base = matrix
    where, own_at, upper, lower, size = places
    block, other, order = blocks
    start, side_of = sides
    normal, shear, slope, lift = laws
    width = vectors.shape[3]
    given, near, far = np.empty((2, width)), np.empty((2, width)), np.empty((2, width))
    for i in range(len(order)):
        b = order[i]
        if b < 0 or not which[b]:
            continue
        _copy_pair(data, base, where, own_at[i], step, size[i], size[i])
        for again in range(2):
            last = -1
            for q in range(start[b], start[b + 1]):
                c, side = side_of[q] >> 1, side_of[q] & 1
                j = other[c] if side == 0 else block[c]
                pair = upper[c] if side == 0 else lower[c]
                if again == 0:
                    if order[j] >= 0 and pair != last:
                        _copy_pair(data, base, where, pair, step, size[i], size[j])
                        last = pair
                    continue
                if normal[c] == 0.0 and shear[c] == 0.0:
                    continue
                for a in range(width):
                    n, t = vectors[c, 0, side, a], vectors[c, 1, side, a]
                    given[0, a], given[1, a] = normal[c] * (n + slope[c] * t), shear[c] * t
                    near[0, a], near[1, a] = n - lift[c] * t, t
                    n, t = vectors[c, 0, 1 - side, a], vectors[c, 1, 1 - side, a]
                    far[0, a], far[1, a] = n - lift[c] * t, t
                add_pair(data, where, own_at[i], step, size[i], size[i], given, near)
                if order[j] >= 0:
                    add_pair(data, where, pair, step, size[i], size[j], given, far)


@_jit
def differing(blocks, n, laws, before):
    """(n,) bool: blocks, in the pattern's order, with contacts whose ``laws`` differ from those ``before``; other arguments
    as in `fill`."""
    block, other, order = blocks
    out = np.zeros(n, np.bool_)
    for c in range(len(block)):
        differs = False
        for k in range(4):
            differs |= laws[k][c] != before[k][c]
        if differs:
            for b in (order[block[c]], order[other[c]]):
                if b >= 0:
                    out[b] = True
    return out


@kept(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def take_change(rest, blocks, unknowns, vectors, motion, before, laws):
    """Subtract from ``rest`` (6 n,) the change of the product of the matrix with the unknowns that give contacts this
    ``motion`` (n_contacts, 2), where their laws are no longer those ``before``; arguments as in `moved` and `fill`."""
    block, other, order = blocks
    unknown, at, size = unknowns
    for c in range(len(block)):
        push = drag = 0.0
        differs = False
        for sign, (normal, shear, slope, lift) in ((-1.0, before), (1.0, laws)):
            pressed = sign * normal[c] * (motion[c, 0] - lift[c] * motion[c, 1])
            push += pressed
            drag += pressed * slope[c] + sign * shear[c] * motion[c, 1]
        for k in range(4):
            differs |= laws[k][c] != before[k][c]
        if differs:
            for side in range(2):
                b = block[c] if side == 0 else other[c]
                if order[b] >= 0:
                    add_force(rest, unknown, at[b], size[b], vectors[c, :, side], -push, -drag)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _six_rows(rows, at, apart, x, begin, n):
    """Products of six ``rows`` of n numbers, from ``at`` on and this far ``apart``, with ``x``: a register."""
    s0 = s1 = s2 = s3 = s4 = s5 = zeros(rows)
    for j in range(0, n, LANES):
        k, r = min(LANES, n - j), at + j
        v = load_first(x, begin + j, k)
        s0, s1 = plus_product(s0, load_first(rows, r, k), v), plus_product(s1, load_first(rows, r + apart, k), v)
        s2 = plus_product(s2, load_first(rows, r + 2 * apart, k), v)
        s3 = plus_product(s3, load_first(rows, r + 3 * apart, k), v)
        s4 = plus_product(s4, load_first(rows, r + 4 * apart, k), v)
        s5 = plus_product(s5, load_first(rows, r + 5 * apart, k), v)
    return sums(s0, s1, s2, s3, s4, s5)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _add_motion(across, along, rows, at, apart, x, begin, n):
    """Add to the registers of the motion ``across`` and ``along`` a face that of one block, whose ``rows`` begin at ``at``,
    this far ``apart``."""
    for j in range(0, n, LANES):
        k = min(LANES, n - j)
        v = load_first(x, begin + j, k)
        across = plus_product(across, load_first(rows, at + j, k), v)
        along = plus_product(along, load_first(rows, at + apart + j, k), v)
    return across, along


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _add_forces(out, begin, rows, at, apart, n, room):
    """Add the forces normal to and along a face, which stand in ``room``, to ``out``; other arguments as in `_add_motion`."""
    push, drag = spread(room, 0), spread(room, 1)
    for j in range(0, n, LANES):
        k = min(LANES, n - j)
        total = plus_product(load_first(out, begin + j, k), push, load_first(rows, at + j, k))
        store_first(out, begin + j, plus_product(total, drag, load_first(rows, at + apart + j, k)), k)


@_jit
def times(x, own, unknowns, blocks, vectors, laws):
    """(m,) product of the matrix with ``x`` (m,), the unknowns block after block.

    ``own`` as in `fill_own`; ``unknowns``: where those of each block begin, and their number; other arguments as in
    `fill`."""
    matrices, begins = own
    at, size = unknowns
    block, other, order = blocks
    normal, shear, slope, lift = laws
    out, buffer, width = np.zeros(len(x)), np.zeros(LANES), vectors.shape[3]
    given, taken, room, own_rows, rows = numbers(x), numbers(out), numbers(buffer), numbers(matrices), numbers(vectors)
    for b in range(len(size)):
        if order[b] >= 0:
            n, row = size[b], (size[b] + 5) // 6 * 6
            for i in range(0, n, 6):
                six = _six_rows(own_rows, begins[b] + i * row, row, given, at[b], n)
                store_first(taken, at[b] + i, six, min(6, n - i))
    for c in range(len(block)):
        if normal[c] == 0.0 and shear[c] == 0.0:
            continue
        here, one, two, b = 4 * width * c, zeros(room), zeros(room), block[c]
        if order[b] >= 0:
            one, two = _add_motion(one, two, rows, here, 2 * width, given, at[b], size[b])
        b = other[c]
        if order[b] >= 0:
            one, two = _add_motion(one, two, rows, here + width, 2 * width, given, at[b], size[b])
        store(room, 0, sums(one, two, one, two, one, two))
        across, along = buffer[0], buffer[1]
        buffer[0] = normal[c] * (across - lift[c] * along)
        buffer[1] = buffer[0] * slope[c] + shear[c] * along
        for side in range(2):
            b = block[c] if side == 0 else other[c]
            if order[b] >= 0:
                _add_forces(taken, at[b], rows, here + side * width, 2 * width, size[b], room)
    # Keeps the arrays alive, which are addressed by pointers above.
    return out[: len(x) + 0 * (len(matrices) + len(vectors) + len(buffer))]


@part(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def add_force(right, unknown, at, size, along, push, drag):
    """Add ``push`` normal to and ``drag`` along a face, with the rows ``along`` (2, w) of one block, to the right
    side. Its ``size`` unknowns are the ``unknown`` ones from ``at`` on."""
    for a in range(size):
        right[unknown[at + a]] += push * along[0, a] + drag * along[1, a]


@_jit
def springs_in_states(right, blocks, unknowns, vectors, states, springs):
    """Add the forces of closed contacts at zero motion to ``right`` (6 n,).

    Returns their normal and shear stiffness, the ratio of sliding shear to normal force (n_contacts,) each, and whether
    the matrix is symmetric (`assembly.assemble_contacts`). ``blocks``: block and other of contacts, and the pattern's
    order; ``unknowns`` as in `moved`; ``states``: state, direction, gap and initial shear force; ``springs``: kₙ, kₛ,
    friction, sliding force and lift.
    """
    block, other, order = blocks
    unknown, at, size = unknowns
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
                    right, unknown, at[b], size[b], vectors[c, :, side], -pressed, given - pressed * slope[c]
                )  # fmt: skip
    return stiff, along, slope, symmetric


@_jit
def moved(values, blocks, unknowns, vectors):
    """(n_contacts, 2): motion across and along the face due to the ``values`` (6 n,) of all unknowns.

    ``blocks`` as in `springs_in_states`; ``unknowns``: ``unknown`` and ``at`` of the pattern, and sizes of blocks."""
    block, other, order = blocks
    unknown, at, size = unknowns
    out = np.zeros((len(block), 2))
    for c in range(len(block)):
        for side in range(2):
            b = block[c] if side == 0 else other[c]
            if order[b] < 0:
                continue
            across = along = 0.0
            for a in range(size[b]):
                value = values[unknown[at[b] + a]]
                across += vectors[c, 0, side, a] * value
                along += vectors[c, 1, side, a] * value
            out[c, 0] += across
            out[c, 1] += along
    return out
