"""Elimination of dense fronts of 6×6 blocks, in double or single precision.

A front F holds the rows of its own blocks P and of the blocks B that their elimination reaches. It is factored in
panels of two blocks,

    Z = F_kk⁻¹,   U = −Z F_k·,   F_ij ← F_ij + F_ik U_j,

and the remaining F_BB is added to the front of the parent (Duff & Reid 1983). Arrays of the tree are those of
`nested_dissection.Tree`; ``child`` and ``sibling`` (n_fronts,) link the children of a front.

Factors are stored in the order in which `triangular_solve` reads them, first for the forward, then for the backward
pass: one core then reads 28 GB/s, instead of 9 if it skips every few kilobytes (measured). ``at`` and ``back``
(n_fronts,) are the starting positions of each front: at ``at`` F_k· of every panel, then Z, and after all panels F_BP;
at ``back`` U of every panel, the last one first. Each is stored as *sixes*, six rows interleaved register by register,
followed by their remainders.
"""

from __future__ import annotations

import numpy as np
from numba import types

from ...compiled import UNCOUNTED, part
from .simd import (
    BYTES,
    load,
    load_first,
    load_six,
    minus_product,
    numbers,
    plus,
    plus_product,
    spread,
    store,
    store_first,
    store_six,
    zeros,
)
from .small_products import Matrix, Size, small_product

#: Sums may be reordered and fused, as in BLAS products of whole fronts.
_part = part(fastmath={"reassoc", "contract", "nsz"}, error_model="numpy", nogil=True, **UNCOUNTED)

#: Unknowns eliminated at a time.
PANEL = 12
#: Unknowns whose effect on the following rows and columns is computed in one product (by BLAS if these are many).
STRIP = 96
#: Rows in which a panel is inverted: whole registers in either precision.
SIDE = 16
#: Size of a product from which BLAS is faster, because it no longer fits the second-level cache.
LARGE = 300_000

#: The general matrix product of BLAS, as bound by Numba for np.dot; here with strides, and added in place.
_gemm = types.ExternalFunction(
    "numba_xxgemm",
    types.intc(
        types.char, types.char, types.char, types.intp, types.intp, types.intp, types.voidptr, types.voidptr,
        types.intp,
        types.voidptr, types.intp, types.voidptr, types.voidptr, types.intp,
    ),
)  # fmt: skip


@_part
def _add_product(c_of, a_of, b_of, size, keep, width, units):
    """C ← A B, or C + A B to ``keep`` C: `Matrix` of arrays; ``size`` as `Size`; ``units`` (2,) are 1 and 0."""
    (c, at_c, row_c), (a, at_a, row_a), (b, at_b, row_b), (rows, k, n) = c_of, a_of, b_of, size
    if rows * n < LARGE:
        place = Matrix(numbers(c), at_c, row_c)
        small_product(place, Matrix(numbers(a), at_a, row_a), Matrix(numbers(b), at_b, row_b), size, width, keep)
    elif k > 0:
        # Row-major arrays are their transposes to BLAS: cᵀ = bᵀaᵀ.
        _gemm(
            100 if c.itemsize == 8 else 115, 78, 78, n, rows, k, units[0:].ctypes, b[at_b:].ctypes, row_b,
            a[at_a:].ctypes, row_a, units[0 if keep else 1 :].ctypes, c[at_c:].ctypes, row_c,
        )  # fmt: skip
    # Keeps the arrays alive, which are addressed by pointers above.
    return len(a) + len(b) + len(c)


@_part
def _pivot(cell, k, n):
    """Row, from ``k`` on, with the largest entry in column ``k``; −1 if all entries are zero or one is not finite."""
    pivot, largest = k, abs(cell[SIDE * k + k])
    for i in range(k + 1, n):
        size = abs(cell[SIDE * i + k])
        if size > largest:
            pivot, largest = i, size
    return pivot if largest > 0.0 and largest < np.inf else -1


@_part
def _swap_back(cell, n, swapped):
    """Exchange the columns of an inverse in the order in which rows of the matrix were ``swapped``, the last exchange
    first."""
    for k in range(n - 1, -1, -1):
        pivot = swapped[k]
        if pivot != k:
            for i in range(n):
                cell[SIDE * i + k], cell[SIDE * i + pivot] = cell[SIDE * i + pivot], cell[SIDE * i + k]


@_part
def _invert(front, at, m, n, cell, others, swapped, width):
    """Invert an n × n block of a ``front`` with rows of length m, from ``at`` on, in place, by Gauss–Jordan elimination
    with row exchanges; False if it is singular. ``cell`` (`SIDE`² + 1,): work space; ``others`` (`SIDE`²,): ones, with
    zeros on the diagonal."""
    whole, here, but = numbers(front), numbers(cell), numbers(others)
    for i in range(n):
        for q in range(0, SIDE, width):
            store(here, SIDE * i + q, load_first(whole, at + i * m + q, min(max(n - q, 0), width)))
    for k in range(n):
        pivot = _pivot(cell, k, n)
        if pivot < 0:
            return False
        swapped[k] = pivot
        if pivot != k:
            for q in range(0, SIDE, width):
                given = load(here, SIDE * k + q)
                store(here, SIDE * k + q, load(here, SIDE * pivot + q))
                store(here, SIDE * pivot + q, given)
        cell[SIDE * SIDE] = 1 / cell[SIDE * k + k]
        share = spread(here, SIDE * SIDE)
        cell[SIDE * k + k] = 1
        for q in range(0, SIDE, width):
            store(here, SIDE * k + q, plus_product(zeros(here), share, load(here, SIDE * k + q)))
        for i in range(n):
            if i != k:
                share = spread(here, SIDE * i + k)
                for q in range(0, SIDE, width):
                    rest = plus_product(zeros(here), load(here, SIDE * i + q), load(but, SIDE * k + q))
                    store(here, SIDE * i + q, minus_product(rest, share, load(here, SIDE * k + q)))
    _swap_back(cell, n, swapped)
    for i in range(n):
        for q in range(0, n, width):
            store_first(whole, at + i * m + q, load(here, SIDE * i + q), min(n - q, width))
    # Keeps the arrays alive, which are addressed by pointers above.
    return len(front) + len(cell) + len(others) > 0


@_part
def _clear(array):
    """Fill the flat ``array`` with zeros."""
    for k in range(len(array)):
        array[k] = 0


def places(own: np.ndarray, far: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """``at`` and ``back`` of fronts with ``own`` and ``far`` blocks (n_fronts,), and the total size of the factors."""
    p, b = 6 * own, 6 * far
    panels, rest = p // PANEL, p % PANEL
    # Σ h e over the panels of h rows up to the row e.
    squares = PANEL**2 * panels * (panels + 1) // 2 + rest * p
    up, down = squares + b * p, p * (p + b) - squares
    return np.cumsum(up) - up, int(up.sum() + down.sum()) - np.cumsum(down), int(up.sum() + down.sum())


@_part
def _leave_sixes(given, at, stride, rows, n, taken, to, width):
    """Write the ``rows``, this distance apart and of length n, as sixes; returns the position after them."""
    for i in range(at, at + rows * stride, 6 * stride):
        j = 0
        while j + width <= n:
            for a in range(6):
                store(taken, to + a * width, load(given, i + a * stride + j))
            j, to = j + width, to + 6 * width
        k = n - j
        if k > 0:
            for a in range(6):
                store_first(taken, to + a * k, load_first(given, i + a * stride + j, k), k)
            to += 6 * k
    return to


@_part
def _leave(front, p, m, factors, at, back):
    """Write the factors of a ``front`` to their positions."""
    if p == 0:
        return 0
    width = BYTES // front.itemsize
    here, there = numbers(front), numbers(factors)
    for start in range(0, p, PANEL):
        end = min(start + PANEL, p)
        at = _leave_sixes(here, start * m, m, end - start, start, there, at, width)
        at = _leave_sixes(here, start * m + start, m, end - start, end - start, there, at, width)
    _leave_sixes(here, p * m, p, m - p, p, there, at, width)
    for start in range(PANEL * ((p - 1) // PANEL), -1, -PANEL):
        end = min(start + PANEL, p)
        back = _leave_sixes(here, start * m + end, m, end - start, m - end, there, back, width)
    # Keeps the arrays alive, which are addressed by pointers above.
    return len(front) + len(factors)


@_part
def _runs(met, own, begins):
    """Runs of consecutive positions among ``met`` (n,) in a front with ``own`` blocks: their starts in ``begins``,
    followed by n; returns the number of runs, and the number of positions within its own blocks."""
    runs = own_count = 0
    for v in range(len(met)):
        if v == 0 or met[v] != met[v - 1] + 1 or met[v] == own:
            begins[runs] = v
            runs += 1
            own_count += met[v] < own
    begins[runs] = len(met)
    return runs, own_count


@_part
def _add_runs(into, at, added, begin, met, begins, first, last, width):
    """Add to the row of a front that begins at ``into[at]`` the runs from ``first`` to before ``last`` of the row of a
    child that begins at ``added[begin]``."""
    for r in range(first, last):
        v, j = begin + 6 * begins[r], at + 6 * met[begins[r]]
        n = 6 * (begins[r + 1] - begins[r])
        while n >= 3 * width:
            for q in range(0, 3 * width, width):
                store(into, j + q, plus(load(into, j + q), load(added, v + q)))
            j, v, n = j + 3 * width, v + 3 * width, n - 3 * width
        for q in range(0, n, 6):
            store_six(into, j + q, plus(load_six(into, j + q), load_six(added, v + q)))


@_part
def _fill(front, f, own, p, m, matrix):
    """Add the entries of ``matrix`` that belong to front ``f``: rows of length m of its ``own`` blocks, then rows of
    length p."""
    data, entries, entry, row, column = matrix
    for k in range(entries[f], entries[f + 1]):
        i, j = row[k], column[k]
        block = data[36 * entry[k] : 36 * entry[k] + 36]
        to, apart = (6 * i * m + 6 * j, m) if i < own else (p * m + 6 * (i - own) * p + 6 * j, p)
        for a in range(6):
            into = front[to + a * apart : to + a * apart + 6]
            for c in range(6):
                into[c] = block[6 * a + c]


@_part
def _gather(here, further, f, own, p, m, fronts, stack, begins, width):
    """Add the contributions of children to the rows and columns that are eliminated in front ``f``."""
    _, reach, position, child, sibling = fronts
    g = child[f]
    while g >= 0:
        met, n = position[reach[g] : reach[g + 1]], 6 * (reach[g + 1] - reach[g])
        runs, own_runs = _runs(met, own, begins)
        for u in range(len(met)):
            i, left = met[u], stack[g] + 6 * u * n
            for a in range(6):
                if i < own:
                    _add_runs(here, (6 * i + a) * m, further, left + a * n, met, begins, 0, runs, width)
                else:
                    to = p * m + (6 * (i - own) + a) * p
                    _add_runs(here, to, further, left + a * n, met, begins, 0, own_runs, width)
        g = sibling[g]


@_part
def _pass_on(further, f, own, p, b, fronts, stack, begins, width):
    """Add the contributions of children to the part of front ``f`` that remains after its own blocks."""
    _, reach, position, child, sibling = fronts
    g = child[f]
    while g >= 0:
        met, n = position[reach[g] : reach[g + 1]], 6 * (reach[g + 1] - reach[g])
        runs, own_runs = _runs(met, own, begins)
        for u in range(begins[own_runs], len(met)):
            i, left = 6 * (met[u] - own), stack[g] + 6 * u * n
            for a in range(6):
                to = stack[f] + (i + a) * b - p
                _add_runs(further, to, further, left + a * n, met, begins, own_runs, runs, width)
        g = sibling[g]


@_part
def _factor(front, p, b, space, units, width):
    """Factor the p own unknowns of a ``front`` in which b others remain; False if it is singular."""
    panel, cell, others, swapped = space
    here, m = numbers(front), p + b
    lower = p * m
    for begin in range(0, p, STRIP):
        stop = min(begin + STRIP, p)
        for start in range(begin, stop, PANEL):
            end = min(start + PANEL, stop)
            h, k, known = end - start, start - begin, begin * m + start
            if k > 0:
                # Effect of earlier panels of this strip on the rows of this panel, and on the columns below.
                above = Matrix(here, known, m)
                rows, earlier = Matrix(here, start * m + start, m), Matrix(here, start * m + begin, m)
                small_product(rows, earlier, above, Size(h, k, m - start), width, True)
                below, earlier = Matrix(here, end * m + start, m), Matrix(here, end * m + begin, m)
                small_product(below, earlier, above, Size(p - end, k, h), width, True)
                others_below, earlier = Matrix(here, lower + start, p), Matrix(here, lower + begin, p)
                small_product(others_below, earlier, above, Size(b, k, h), width, True)
            if not _invert(front, start * m + start, m, h, cell, others, swapped, width):
                return False
            for i in range(h):
                copied = panel[i * (m - end) : (i + 1) * (m - end)]
                given = front[(start + i) * m + end : (start + i + 1) * m]
                for j in range(len(copied)):
                    copied[j] = -given[j]
            behind, inverse = Matrix(here, start * m + end, m), Matrix(here, start * m + start, m)
            small_product(behind, inverse, Matrix(numbers(panel), 0, m - end), Size(h, h, m - end), width, False)
        k, known = stop - begin, begin * m + stop
        if stop < p:
            above = Matrix(front, known, m)
            rest, earlier = Matrix(front, stop * m + stop, m), Matrix(front, stop * m + begin, m)
            _add_product(rest, earlier, above, Size(p - stop, k, m - stop), True, width, units)
            rest, earlier = Matrix(front, lower + stop, p), Matrix(front, lower + begin, p)
            _add_product(rest, earlier, above, Size(b, k, p - stop), True, width, units)
    # Keeps the arrays alive, which are addressed by pointers above.
    return len(front) + len(panel) > 0


@_part
def eliminate(first, last, touched, fronts, matrix, stored, memory, space):
    """Eliminate the ``touched`` (n_fronts,) fronts from ``first`` to before ``last``; False if one is singular.

    ``fronts``: pivots, reach, position, child and sibling; ``matrix``: data, entries, entry, row and column; ``stored``:
    positions of S (n_fronts,), and ``at`` and ``back`` of the factors; ``memory``: storage of S, factors, and the
    numbers 1 and 0; ``space`` from `working_space`.
    """
    pivots, reach, _, _, _ = fronts
    stack, at, back = stored
    room, factors, units = memory
    front, panel, begins, cell, others, swapped = space
    width = BYTES // front.itemsize
    here, further = numbers(front), numbers(room)
    for f in range(first, last):
        if not touched[f]:
            continue
        own, far = pivots[f + 1] - pivots[f], reach[f + 1] - reach[f]
        p, b = 6 * own, 6 * far
        m = p + b
        # Rows of length m of the own unknowns, then rows of length p of the others; F_BB is in the storage of S.
        _clear(front[: p * m + b * p])
        _fill(front, f, own, p, m, matrix)
        _gather(here, further, f, own, p, m, fronts, stack, begins, width)
        if not _factor(front, p, b, (panel, cell, others, swapped), units, width):
            return False
        if p > 0:
            left, upper = Matrix(front, p * m, p), Matrix(front, p, m)
            _add_product(Matrix(room, stack[f], b), left, upper, Size(b, p, b), False, width, units)
        else:
            _clear(room[stack[f] : stack[f] + b * b])
        _leave(front, p, m, factors, at[f], back[f])
        _pass_on(further, f, own, p, b, fronts, stack, begins, width)
    # Keeps the arrays alive, which are addressed by pointers above.
    return len(room) + len(front) > 0


@part(error_model="numpy", nogil=True)
def working_space(pivots, reach, factors):
    """Work space of `eliminate`: a front without its F_BB, a panel, and index arrays."""
    most, far, size = 0, 0, 0
    for f in range(len(reach) - 1):
        p, b = 6 * (pivots[f + 1] - pivots[f]), 6 * (reach[f + 1] - reach[f])
        most, far, size = max(most, p + b), max(far, b), max(size, p * (p + 2 * b))
    front, panel = np.empty(size, factors.dtype), np.empty(PANEL * most, factors.dtype)
    cell, others = np.empty(SIDE * SIDE + 1, factors.dtype), np.empty(SIDE * SIDE, factors.dtype)
    for k in range(SIDE * SIDE):
        others[k] = k % (SIDE + 1) != 0
    return front, panel, np.empty(far // 6 + 1, np.int64), cell, others, np.empty(PANEL, np.int64)
