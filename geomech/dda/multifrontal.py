"""Elimination of 6×6-block systems in dense fronts, in double or single precision.

A front F holds the rows of its own blocks P and of those B to which their elimination reaches. It is factored a panel of
three blocks at a time,

    Z = F_kk⁻¹,   U = Z F_k·,   F_ij ← F_ij − F_ik U_j,

and what is left of F_BB is added into its parent's front (Duff & Reid 1983). Pivots are sought within a panel only: the
diagonal of a block system carries inertia and springs. What that, or single precision, costs in digits is won back by
refinement.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np
from numba import njit, types

from .dissection import Tree, plan

#: Sums may be reordered and fused: the products of whole fronts are summed as BLAS likes, too.
_jit = njit(cache=True, fastmath={"reassoc", "contract", "nsz"}, error_model="numpy", nogil=True)

#: Unknowns eliminated at a time; twelve to thirty keep BLAS as busy.
PANEL = 18
#: Blocks from which subtrees are factored on all cores.
THREADED = 500

#: BLAS's general products, as Numba itself binds them for np.dot: here with strides, and added in place.
_gemm = types.ExternalFunction(
    "numba_xxgemm",
    types.intc(
        types.char, types.char, types.char, types.intp, types.intp, types.intp, types.voidptr, types.voidptr, types.intp,
        types.voidptr, types.intp, types.voidptr, types.voidptr, types.intp,
    ),
)  # fmt: skip
_gemv = types.ExternalFunction(
    "numba_xxgemv",
    types.intc(
        types.char, types.char, types.intp, types.intp, types.voidptr, types.voidptr, types.intp, types.voidptr,
        types.voidptr, types.voidptr,
    ),
)  # fmt: skip


@_jit
def _subtract_product(units, a, x, y):
    """y ← y − a x for a row-major slice ``a`` and vectors without gaps; ``units`` are 1, −1 of the same type."""
    if a.shape[0] == 0 or a.shape[1] == 0:
        return
    size = a.itemsize
    _gemv(
        100 if size == 8 else 115, 84, a.shape[1], a.shape[0], units[1:].ctypes, a.ctypes, a.strides[0] // size,
        x.ctypes, units.ctypes, y.ctypes,
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
def _eliminate(
    fronts, data, pivots, reach, seat, entries, entry, row, column, stack, at, child, sibling, room, factors, units
):
    """Eliminate ``fronts``, ascending; False if one is singular. ``child`` and ``sibling`` chain the children of a front;
    ``units`` are 1, −1, 0."""
    one, minus, none = units[0:1], units[1:2], units[2:3]
    swapped = np.empty(PANEL, np.int64)
    for f in fronts:
        own, far = pivots[f + 1] - pivots[f], reach[f + 1] - reach[f]
        p, b = 6 * own, 6 * far
        m = p + b
        upper = factors[at[f] : at[f] + p * m].reshape((p, m))
        lower = factors[at[f] + p * m : at[f + 1]].reshape((b, p))
        rest = np.zeros((b, b), factors.dtype)
        upper[:] = 0
        lower[:] = 0
        for k in range(entries[f], entries[f + 1]):
            i, j, s = row[k], column[k], 36 * entry[k]
            for a in range(6):
                for c in range(6):
                    if i < own:
                        upper[6 * i + a, 6 * j + c] = data[s + 6 * a + c]
                    else:
                        lower[6 * (i - own) + a, 6 * j + c] = data[s + 6 * a + c]
        g = child[f]
        while g >= 0:
            first, n = reach[g], reach[g + 1] - reach[g]
            for u in range(n):
                i = seat[first + u]
                for a in range(6):
                    line = stack[g] + (6 * u + a) * 6 * n
                    for v in range(n):
                        j = seat[first + v]
                        for c in range(6):
                            value = room[line + 6 * v + c]
                            if i < own:
                                upper[6 * i + a, 6 * j + c] += value
                            elif j < own:
                                lower[6 * (i - own) + a, 6 * j + c] += value
                            else:
                                rest[6 * (i - own) + a, 6 * (j - own) + c] += value
            g = sibling[g]
        for start in range(0, p, PANEL):
            end = min(start + PANEL, p)
            if not _invert(upper[start:end, start:end], swapped):
                return False
            right = upper[start:end, end:].copy()
            scaled = upper[start:end, end:]
            _add_product(one, upper[start:end, start:end], right, none, scaled)
            _add_product(minus, upper[end:, start:end], scaled, one, upper[end:, end:])
            _add_product(minus, lower[:, start:end], scaled[:, : p - end], one, lower[:, end:])
        if p > 0:
            _add_product(minus, lower, upper[:, p:], one, rest)
        room[stack[f] : stack[f] + b * b] = rest.ravel()
    return True


@_jit
def _substitute(right, pivots, reach, boundary, at, factors, units):
    """The solution for ``right`` (6n,), of the factors' type, in the order of elimination."""
    out = right.copy()
    n_fronts = len(pivots) - 1
    widest = 0
    for f in range(n_fronts):
        widest = max(widest, pivots[f + 1] - pivots[f] + reach[f + 1] - reach[f])
    work = np.empty(6 * widest, factors.dtype)
    part = np.empty(PANEL, factors.dtype)
    for f in range(n_fronts):
        first, p, n = 6 * pivots[f], 6 * (pivots[f + 1] - pivots[f]), reach[f + 1] - reach[f]
        if p == 0:
            continue
        m = p + 6 * n
        upper = factors[at[f] : at[f] + p * m].reshape((p, m))
        lower = factors[at[f] + p * m : at[f + 1]].reshape((6 * n, p))
        own = out[first : first + p]
        for start in range(0, p, PANEL):
            end = min(start + PANEL, p)
            for i in range(start, end):
                part[i - start] = own[i]
                own[i] = 0
            for i in range(start, end):
                for j in range(start, end):
                    own[i] += upper[i, j] * part[j - start]
            _subtract_product(units, upper[end:, start:end], own[start:end], own[end:])
        passed = work[: 6 * n]
        passed[:] = 0
        _subtract_product(units, lower, own, passed)
        for u in range(n):
            i = 6 * boundary[reach[f] + u]
            for a in range(6):
                out[i + a] += passed[6 * u + a]
    for f in range(n_fronts - 1, -1, -1):
        first, p, n = 6 * pivots[f], 6 * (pivots[f + 1] - pivots[f]), reach[f + 1] - reach[f]
        if p == 0:
            continue
        m = p + 6 * n
        upper = factors[at[f] : at[f] + p * m].reshape((p, m))
        own, far = out[first : first + p], work[: 6 * n]
        for u in range(n):
            i = 6 * boundary[reach[f] + u]
            for a in range(6):
                far[6 * u + a] = out[i + a]
        _subtract_product(units, upper[:, p:], far, own)
        for start in range(PANEL * ((p - 1) // PANEL), -1, -PANEL):
            end = min(start + PANEL, p)
            _subtract_product(units, upper[start:end, end:p], own[end:], own[start:end])
    return out


@cache
def _blas_threads() -> Callable[[int], int] | None:
    """Sets the calling thread's number of BLAS threads and returns what it was; None where SciPy's BLAS cannot."""
    import scipy

    for library in Path(scipy.__file__).resolve().parent.parent.glob("scipy.libs/*openblas*"):
        try:
            return ctypes.CDLL(str(library)).openblas_set_num_threads_local
        except (OSError, AttributeError):
            continue
    return None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Products of fronts on the calling core alone: handed out in pieces they take forty times as long on a busy machine."""
    limit = _blas_threads()
    before = limit(1) if limit else 0
    try:
        yield
    finally:
        if limit:
            limit(before)


@contextmanager
def all_cores() -> Iterator[Callable[[Callable, Iterable], Iterator]]:
    """A ``map`` that shares its items among the cores, for work that lets go of the interpreter's lock."""
    with one_blas_thread(), ThreadPoolExecutor(len(os.sched_getaffinity(0)), thread_name_prefix="geomech-dda") as pool:
        yield pool.map


class Factors:
    """The factors of one pattern of 6×6 blocks, in ``dtype`` float64 or float32.

    ``points`` (n, 2) m, where the blocks lie; ``rows`` and ``columns`` (n_entries,) of the matrix's blocks, both triangles
    and the diagonal, sorted by row then column. The order of elimination is internal.
    """

    def __init__(self, points: np.ndarray, rows: np.ndarray, columns: np.ndarray, dtype: type = np.float64):
        self.tree: Tree = plan(points, rows, columns)
        parent = self.tree.parent
        self._child, self._sibling = np.full(len(parent), -1), np.full(len(parent), -1)
        for f in range(len(parent) - 1, -1, -1):
            if parent[f] >= 0:
                self._sibling[f] = self._child[parent[f]]
                self._child[parent[f]] = f
        self._by_rank = (6 * np.argsort(self.tree.rank)[:, None] + np.arange(6)).ravel()
        self._factors = np.empty(self.tree.at[-1], dtype)
        self._room = np.empty(self.tree.stack_size, dtype)
        self._units = np.array([1.0, -1.0, 0.0], dtype)

    def factor(self, data: np.ndarray, threads: bool = True) -> None:
        """Factor the matrix of the blocks ``data`` (36 n_entries,), each row by row. Raises numpy.linalg.LinAlgError when it
        is singular."""
        t = self.tree

        def eliminate(fronts: np.ndarray) -> bool:
            return _eliminate(
                fronts, data, t.pivots, t.reach, t.seat, t.entries, t.entry, t.row, t.column, t.stack, t.at,
                self._child, self._sibling, self._room, self._factors, self._units,
            )  # fmt: skip

        if threads and len(t.rank) >= THREADED:
            groups = [[np.arange(a, b) for a, b in t.pieces], *(wave[:, None] for wave in t.waves)]
            with all_cores() as share:
                done = all(all(share(eliminate, group)) for group in groups)
        else:
            with one_blas_thread():
                done = eliminate(np.arange(len(t.parent)))
        if not done:
            raise np.linalg.LinAlgError("the block system is singular")

    def substitute(self, right: np.ndarray) -> np.ndarray:
        """The solution of the factored system for ``right`` (6n,)."""
        t = self.tree
        out = np.empty(len(right))
        # Single precision has no more than 38 decades: the right side is brought to its middle.
        size = float(np.abs(right).max(initial=0.0)) or 1.0
        given = (right[self._by_rank] / size).astype(self._factors.dtype)
        out[self._by_rank] = _substitute(given, t.pivots, t.reach, t.boundary, t.at, self._factors, self._units)
        return size * out
