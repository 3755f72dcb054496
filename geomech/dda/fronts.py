"""Elimination of dense fronts of 6×6 blocks, in double or single precision.

A front F holds the rows of its own blocks P and of those B to which their elimination reaches. It is factored a panel
of two blocks at a time,

    Z = F_kk⁻¹,   U = Z F_k·,   F_ij ← F_ij − F_ik U_j,

and what is left of F_BB is added into its parent's front (Duff & Reid 1983). Arrays of the tree are those of
`dissection.Tree`; ``child`` and ``sibling`` (n_fronts,) chain the children of a front.

Factors lie in the order in which `substitution` reads them, first what it reads on its way up, then what it reads on
its way back: one core reads so 28 GB/s, but 9 where it skips every other few kilobytes (measured). ``at`` and ``back``
(n_fronts,) say where a front's begin: at ``at`` for every panel F_k·, then Z, and behind all panels F_BP; at ``back``
U of every panel, the last first. Each is a number of *sixes*: six rows, first a register of the first, of the second,
…, then the next register of each, and what is left of each.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

from .lanes import BYTES, load, load_first, numbers, store, store_first

#: Kept with the kernel that calls them only, for they are made of what stands in other files, too. Sums may be
#: reordered and fused: the products of whole fronts are summed as BLAS likes, too.
_jit = njit(fastmath={"reassoc", "contract", "nsz"}, error_model="numpy", nogil=True)

#: Unknowns eliminated at a time; twelve to thirty keep BLAS as busy.
PANEL = 12
#: What so many do to the rows and columns behind them is one product: longer ones keep BLAS busier.
STRIP = 48

#: BLAS's general products, as Numba itself binds them for np.dot: here with strides, and added in place.
_gemm = types.ExternalFunction(
    "numba_xxgemm",
    types.intc(
        types.char, types.char, types.char, types.intp, types.intp, types.intp, types.voidptr, types.voidptr,
        types.intp,
        types.voidptr, types.intp, types.voidptr, types.voidptr, types.intp,
    ),
)  # fmt: skip


@_jit
def _add_product(scale, a, b, keep, c):
    """c ← keep c + scale a b for row-major slices; ``scale`` and ``keep`` (1,) of the same type."""
    if c.shape[0] == 0 or c.shape[1] == 0:
        return
    size = c.itemsize
    # Row-major arrays are their transposes to BLAS: cᵀ = bᵀaᵀ.
    _gemm(
        100 if size == 8 else 115, 78, 78, c.shape[1], c.shape[0], a.shape[1], scale.ctypes, b.ctypes,
        b.strides[0] // size, a.ctypes, a.strides[0] // size, keep.ctypes, c.ctypes, c.strides[0] // size,
    )  # fmt: skip


@_jit
def _invert(a, swapped):
    """Invert ``a`` (n, n) in place, Gauss–Jordan with exchange of rows; False if it is singular."""
    n = a.shape[0]
    for k in range(n):
        pivot, largest = k, abs(a[k, k])
        for i in range(k + 1, n):
            if abs(a[i, k]) > largest:
                pivot, largest = i, abs(a[i, k])
        if not (largest > 0.0 and largest < np.inf):
            return False
        swapped[k] = pivot
        if pivot != k:
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        share = 1 / a[k, k]
        a[k, k] = 1
        for j in range(n):
            a[k, j] *= share
        for i in range(n):
            if i != k:
                share = a[i, k]
                a[i, k] = 0
                for j in range(n):
                    a[i, j] -= share * a[k, j]
    for k in range(n - 1, -1, -1):
        pivot = swapped[k]
        if pivot != k:
            for i in range(n):
                a[i, k], a[i, pivot] = a[i, pivot], a[i, k]
    return True


@_jit
def _clear(array):
    """Fill the flat ``array`` with zeros."""
    for k in range(len(array)):
        array[k] = 0


def places(own: np.ndarray, far: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """``at`` and ``back`` of fronts with so many blocks of their ``own`` and ``far`` ones (n_fronts,), and how many
    numbers all factors are."""
    p, b = 6 * own, 6 * far
    panels, rest = p // PANEL, p % PANEL
    # Σ h e over the panels of h rows up to the row e.
    squares = PANEL**2 * panels * (panels + 1) // 2 + rest * p
    up, down = squares + b * p, p * (p + b) - squares
    return np.cumsum(up) - up, int(up.sum() + down.sum()) - np.cumsum(down), int(up.sum() + down.sum())


@_jit
def _leave_sixes(given, at, stride, rows, n, taken, to, width):
    """Write ``rows`` so far apart, of n numbers each, as sixes; where they end."""
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


@_jit
def _leave(front, p, m, factors, at, back):
    """Write the factors of a ``front`` to where they belong."""
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
    # What is found by its place is kept until here.
    return len(front) + len(factors)


@_jit
def _runs(met, own, begins):
    """Where runs of blocks that stand side by side begin among the seats ``met`` (n,) in a front with ``own`` blocks:
    in ``begins``, n behind the last; how many there are, and how many of them among its own."""
    runs = mine = 0
    for v in range(len(met)):
        if v == 0 or met[v] != met[v - 1] + 1 or met[v] == own:
            begins[runs] = v
            runs += 1
            mine += met[v] < own
    begins[runs] = len(met)
    return runs, mine


@_jit
def _add_runs(here, added, met, begins, first, last, beside):
    """Add to the row ``here`` of a front the runs from ``first`` to before ``last`` of a child's row ``added``; ``here``
    begins with block ``beside``."""
    for r in range(first, last):
        v, w = 6 * begins[r], 6 * begins[r + 1]
        j = 6 * (met[begins[r]] - beside)
        # Slices, for their indices need no check for a negative sign, which would keep loops from vectors.
        into, what = here[j : j + w - v], added[v:w]
        for c in range(w - v):
            into[c] += what[c]


@_jit
def eliminate(
    first,
    last,
    touched,
    data,
    pivots,
    reach,
    seat,
    entries,
    entry,
    row,
    column,
    stack,
    at,
    back,
    child,
    sibling,
    room,
    factors,
    units,
    space,
):
    """Eliminate the ``touched`` (n_fronts,) fronts from ``first`` to before ``last``; False if one is singular.
    ``stack`` (n_fronts,): where S are left in the ``room``; ``units`` are 1, −1, 0; ``space`` as from
    `working_space`."""
    one, minus, none = units[0:1], units[1:2], units[2:3]
    front, panel, begins, swapped = space
    for f in range(first, last):
        if not touched[f]:
            continue
        own, far = pivots[f + 1] - pivots[f], reach[f + 1] - reach[f]
        p, b = 6 * own, 6 * far
        m = p + b
        upper = front[: p * m].reshape((p, m))
        lower = front[p * m : p * m + b * p].reshape((b, p))
        rest = room[stack[f] : stack[f] + b * b].reshape((b, b))
        _clear(front[: p * m + b * p])
        for k in range(entries[f], entries[f + 1]):
            i, j = row[k], column[k]
            block = data[36 * entry[k] : 36 * entry[k] + 36]
            for a in range(6):
                here = (upper[6 * i + a] if i < own else lower[6 * (i - own) + a])[6 * j : 6 * j + 6]
                for c in range(6):
                    here[c] = block[6 * a + c]
        # What children leave in the rows and columns that are eliminated here; the rest of it below.
        g = child[f]
        while g >= 0:
            met, n = seat[reach[g] : reach[g + 1]], 6 * (reach[g + 1] - reach[g])
            left = room[stack[g] : stack[g] + n * n].reshape((n, n))
            runs, mine = _runs(met, own, begins)
            for u in range(len(met)):
                i = met[u]
                for a in range(6):
                    if i < own:
                        _add_runs(upper[6 * i + a], left[6 * u + a], met, begins, 0, runs, 0)
                    else:
                        _add_runs(lower[6 * (i - own) + a], left[6 * u + a], met, begins, 0, mine, 0)
            g = sibling[g]
        for begin in range(0, p, STRIP):
            stop = min(begin + STRIP, p)
            for start in range(begin, stop, PANEL):
                end = min(start + PANEL, stop)
                if not _invert(upper[start:end, start:end], swapped):
                    return False
                right = panel[: (end - start) * (m - end)].reshape((end - start, m - end))
                scaled = upper[start:end, end:]
                for i in range(end - start):
                    copied, given = right[i], scaled[i]
                    for j in range(m - end):
                        copied[j] = given[j]
                _add_product(one, upper[start:end, start:end], right, none, scaled)
                _add_product(minus, upper[end:stop, start:end], scaled, one, upper[end:stop, end:])
                _add_product(minus, upper[stop:, start:end], scaled[:, : stop - end], one, upper[stop:, end:stop])
                _add_product(minus, lower[:, start:end], scaled[:, : stop - end], one, lower[:, end:stop])
            _add_product(minus, upper[stop:, begin:stop], upper[begin:stop, stop:], one, upper[stop:, stop:])
            _add_product(minus, lower[:, begin:stop], upper[begin:stop, stop:p], one, lower[:, stop:])
        if p > 0:
            _add_product(minus, lower, upper[:, p:], none, rest)
        else:
            _clear(rest.reshape(b * b))
        _leave(front, p, m, factors, at[f], back[f])
        g = child[f]
        while g >= 0:
            met, n = seat[reach[g] : reach[g + 1]], 6 * (reach[g + 1] - reach[g])
            left = room[stack[g] : stack[g] + n * n].reshape((n, n))
            runs, mine = _runs(met, own, begins)
            for u in range(begins[mine], len(met)):
                for a in range(6):
                    _add_runs(rest[6 * (met[u] - own) + a], left[6 * u + a], met, begins, mine, runs, own)
            g = sibling[g]
    return True


@_jit
def working_space(pivots, reach, factors):
    """What `eliminate` works in: room for a front but for its F_BB, for a panel, and for numbers."""
    most, far, size = 0, 0, 0
    for f in range(len(reach) - 1):
        p, b = 6 * (pivots[f + 1] - pivots[f]), 6 * (reach[f + 1] - reach[f])
        most, far, size = max(most, p + b), max(far, b), max(size, p * (p + 2 * b))
    front, panel = np.empty(size, factors.dtype), np.empty(PANEL * most, factors.dtype)
    return front, panel, np.empty(far // 6 + 1, np.int64), np.empty(PANEL, np.int64)
