"""Elimination of 6×6-block systems in dense fronts, in double or single precision.

A front F holds the rows of its own blocks P and of those B to which their elimination reaches. It is factored a panel
of three blocks at a time,

    Z = F_kk⁻¹,   U = Z F_k·,   F_ij ← F_ij − F_ik U_j,

and what is left of F_BB is added into its parent's front (Duff & Reid 1983). Pivots are sought within a panel only: the
diagonal of a block system carries inertia and springs. What that, or single precision, costs in digits is won back by
refinement.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
from numba import njit, types

from .blas_threads import blas_threads
from .dissection import Tree, plan

#: Sums may be reordered and fused: the products of whole fronts are summed as BLAS likes, too.
_jit = njit(cache=True, fastmath={"reassoc", "contract", "nsz"}, error_model="numpy", nogil=True)

#: Unknowns eliminated at a time; twelve to thirty keep BLAS as busy.
PANEL = 18
#: Blocks from which subtrees are factored, and solutions substituted, on all cores.
THREADED, THREADED_SOLUTION = 500, 4000

#: BLAS's general products, as Numba itself binds them for np.dot: here with strides, and added in place.
_gemm = types.ExternalFunction(
    "numba_xxgemm",
    types.intc(
        types.char, types.char, types.char, types.intp, types.intp, types.intp, types.voidptr, types.voidptr, types.intp,
        types.voidptr, types.intp, types.voidptr, types.voidptr, types.intp,
    ),
)  # fmt: skip


@_jit
def _product(a, x):
    """Σ a x. Where a factor streams from memory, one row after the other runs at twice the speed of BLAS, which reads
    four at a time."""
    total = a.dtype.type(0)
    for j in range(len(a)):
        total += a[j] * x[j]
    return total


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
    fronts,
    data,
    pivots,
    reach,
    seat,
    entries,
    entry,
    row,
    column,
    stack,
    kept,
    at,
    child,
    sibling,
    room,
    factors,
    units,
):
    """Eliminate ``fronts``, ascending; False if one is singular. ``child`` and ``sibling`` chain the children of a
    front; ``units`` are 1, −1, 0."""
    one, minus, none = units[0:1], units[1:2], units[2:3]
    swapped = np.empty(PANEL, np.int64)
    longest = 0
    for g in range(len(child)):
        longest = max(longest, reach[g + 1] - reach[g])
    begins = np.empty(longest + 1, np.int64)
    for f in fronts:
        own, far = pivots[f + 1] - pivots[f], reach[f + 1] - reach[f]
        p, b = 6 * own, 6 * far
        m = p + b
        upper = factors[at[f] : at[f] + p * m].reshape((p, m))
        lower = factors[at[f] + p * m : at[f + 1]].reshape((b, p))
        if kept:
            rest = room[stack[f] : stack[f] + b * b].reshape((b, b))
        else:
            rest = np.empty((b, b), factors.dtype)
        # A leaf's rest is its own product alone: not cleared, for clearing takes as long as adding.
        leaf = child[f] < 0 and p > 0
        if not leaf:
            rest[:] = 0
        upper[:] = 0
        lower[:] = 0
        for k in range(entries[f], entries[f + 1]):
            i, j = row[k], column[k]
            block = data[36 * entry[k] : 36 * entry[k] + 36]
            for a in range(6):
                here = (upper[6 * i + a] if i < own else lower[6 * (i - own) + a])[6 * j : 6 * j + 6]
                for c in range(6):
                    here[c] = block[6 * a + c]
        g = child[f]
        while g >= 0:
            first, n = reach[g], reach[g + 1] - reach[g]
            # Neighbours in the child's boundary mostly stand side by side in the parent too: long rows are added at
            # once.
            runs = 0
            for v in range(n):
                j = seat[first + v]
                if v == 0 or j != seat[first + v - 1] + 1 or j == own:
                    begins[runs] = v
                    runs += 1
            begins[runs] = n
            for u in range(n):
                i = seat[first + u]
                for a in range(6):
                    line = room[stack[g] + (6 * u + a) * 6 * n : stack[g] + (6 * u + a + 1) * 6 * n]
                    if i < own:
                        own_row, far_row = upper[6 * i + a, :p], upper[6 * i + a, p:]
                    else:
                        own_row, far_row = lower[6 * (i - own) + a], rest[6 * (i - own) + a]
                    for r in range(runs):
                        j, v, w = 6 * seat[first + begins[r]], 6 * begins[r], 6 * begins[r + 1]
                        # Slices, for their indices need no check for a negative sign, which would keep loops from
                        # vectors.
                        here = own_row[j : j + w - v] if j < p else far_row[j - p : j - p + w - v]
                        added = line[v:w]
                        for c in range(w - v):
                            here[c] += added[c]
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
            _add_product(minus, lower, upper[:, p:], none if leaf else one, rest)
        if not kept:
            room[stack[f] : stack[f] + b * b] = rest.ravel()
    return True


@_jit
def _mark_above(touched, parent):
    """Mark the parents of marked fronts, and theirs."""
    for f in range(len(parent)):
        if touched[f] and parent[f] >= 0:
            touched[parent[f]] = True


@_jit
def _forward(fronts, out, pivots, reach, seat, at, child, sibling, factors, passed):
    """Forward substitution in ``out`` (6n,), in the order of elimination; ``passed`` holds what each front passes
    on."""
    part = np.empty(PANEL, factors.dtype)
    for f in fronts:
        own, far = pivots[f + 1] - pivots[f], reach[f + 1] - reach[f]
        p = 6 * own
        m = p + 6 * far
        mine, further = out[6 * pivots[f] : 6 * pivots[f + 1]], passed[6 * reach[f] : 6 * reach[f + 1]]
        further[:] = 0
        g = child[f]
        while g >= 0:
            for u in range(reach[g], reach[g + 1]):
                i = seat[u]
                here = mine[6 * i : 6 * i + 6] if i < own else further[6 * (i - own) : 6 * (i - own) + 6]
                for a in range(6):
                    here[a] += passed[6 * u + a]
            g = sibling[g]
        upper = factors[at[f] : at[f] + p * m].reshape((p, m))
        lower = factors[at[f] + p * m : at[f + 1]].reshape((6 * far, p))
        for start in range(0, p, PANEL):
            end = min(start + PANEL, p)
            for i in range(start, end):
                part[i - start] = mine[i] - _product(upper[i, :start], mine)
            for i in range(start, end):
                mine[i] = _product(upper[i, start:end], part)
        for i in range(6 * far):
            further[i] -= _product(lower[i], mine)


@_jit
def _backward(fronts, out, pivots, reach, boundary, at, factors):
    """Backward substitution in ``out`` for ``fronts``, the last first."""
    longest = 0
    for f in fronts:
        longest = max(longest, 6 * (pivots[f + 1] - pivots[f] + reach[f + 1] - reach[f]))
    known = np.empty(longest, factors.dtype)
    for f in fronts[::-1]:
        first, p, n = 6 * pivots[f], 6 * (pivots[f + 1] - pivots[f]), reach[f + 1] - reach[f]
        m = p + 6 * n
        upper = factors[at[f] : at[f] + p * m].reshape((p, m))
        known[:p] = out[first : first + p]
        for u in range(n):
            i, j = 6 * boundary[reach[f] + u], p + 6 * u
            for a in range(6):
                known[j + a] = out[i + a]
        for start in range(PANEL * ((p - 1) // PANEL), -1, -PANEL):
            end = min(start + PANEL, p)
            for i in range(start, end):
                known[i] -= _product(upper[i, end:], known[end:])
        out[first : first + p] = known[:p]


@cache
def _cores() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(len(os.sched_getaffinity(0)), thread_name_prefix="geomech-dda")


class Factors:
    """The factors of one pattern of 6×6 blocks, in ``dtype`` float64 or float32.

    ``points`` (n, 2) m, where the blocks lie; ``rows`` and ``columns`` (n_entries,) of the matrix's blocks, both
    triangles and the diagonal, sorted by row then column. The order of elimination is internal, or that of a ``tree``
    already planned for the same pattern.
    """

    def __init__(
        self,
        points: np.ndarray,
        rows: np.ndarray,
        columns: np.ndarray,
        dtype: type = np.float64,
        tree: Tree | None = None,
    ):
        self.tree: Tree = plan(points, rows, columns) if tree is None else tree
        parent = self.tree.parent
        self._child, self._sibling = np.full(len(parent), -1), np.full(len(parent), -1)
        for f in range(len(parent) - 1, -1, -1):
            if parent[f] >= 0:
                self._sibling[f] = self._child[parent[f]]
                self._child[parent[f]] = f
        self._by_rank = (6 * np.argsort(self.tree.rank)[:, None] + np.arange(6)).ravel()
        self._front = np.searchsorted(self.tree.pivots, self.tree.rank, side="right") - 1
        self._all = np.arange(len(parent))
        self._factors = np.empty(self.tree.at[-1], dtype)
        self._room = np.empty(self.tree.stack_size, dtype)
        self._passed = np.empty(6 * self.tree.reach[-1], dtype)
        self._units = np.array([1.0, -1.0, 0.0], dtype)

    @property
    def single(self) -> bool:
        """Whether the factors are in single precision."""
        return self._factors.dtype == np.float32

    def factor(self, data: np.ndarray, changed: np.ndarray | None = None) -> float:
        """Factor the matrix of the blocks ``data`` (36 n_entries,), each row by row; the share of it that was done.

        Where only rows and columns of the blocks ``changed`` (n,) differ from the matrix factored before, only their
        fronts and those above are eliminated again. Raises numpy.linalg.LinAlgError when the matrix is singular.
        """
        t = self.tree
        touched = np.ones(len(t.parent), np.bool_)
        if changed is not None and t.kept:
            touched[:] = False
            touched[self._front[changed]] = True
            _mark_above(touched, t.parent)

        def eliminate(fronts: np.ndarray) -> bool:
            return _eliminate(
                fronts[touched[fronts]], data, t.pivots, t.reach, t.seat, t.entries, t.entry, t.row, t.column, t.stack,
                t.kept, t.at, self._child, self._sibling, self._room, self._factors, self._units,
            )  # fmt: skip

        if not all(self._climb(eliminate, THREADED)):
            raise np.linalg.LinAlgError("the block system is singular")
        return float(np.diff(t.at)[touched].sum() / max(1, t.at[-1]))

    def substitute(self, right: np.ndarray) -> np.ndarray:
        """The solution of the factored system for ``right`` (6n,)."""
        t = self.tree
        # Single precision has no more than 38 decades: the right side is brought to its middle.
        size = float(np.abs(right).max(initial=0.0)) or 1.0
        out = (right[self._by_rank] / size).astype(self._factors.dtype)

        def forward(fronts: np.ndarray) -> None:
            _forward(
                fronts, out, t.pivots, t.reach, t.seat, t.at, self._child, self._sibling, self._factors, self._passed,
            )  # fmt: skip

        def backward(fronts: np.ndarray) -> None:
            _backward(fronts, out, t.pivots, t.reach, t.boundary, t.at, self._factors)

        self._climb(forward, THREADED_SOLUTION)
        self._climb(backward, THREADED_SOLUTION, down=True)
        x = np.empty(len(right))
        x[self._by_rank] = out
        return size * x

    def _climb(self, work: Callable, least: int, down: bool = False) -> list:
        """What ``work`` gives for all fronts in pieces, children before parents or the other way; from ``least`` blocks
        on, pieces that are independent share the cores, for ``work`` lets go of the interpreter's lock."""
        t = self.tree
        with blas_threads(1):
            if len(t.rank) < least:
                return [work(self._all)]
            groups = [[np.arange(a, b) for a, b in t.pieces], *(wave[:, None] for wave in t.waves)]
            return [one for group in groups[:: -1 if down else 1] for one in _cores().map(work, group)]
