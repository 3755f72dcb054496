"""Direct solution of the 6×6-block systems of many blocks: nested dissection and dense fronts.

Blocks touch their neighbours in a plane, so a line of blocks parts a system in two halves that know nothing of each
other, and each half again (nested dissection; George 1973). Eliminated leaves first and separators last, the matrix fills
in as little as it can, and all arithmetic happens in dense fronts (Duff & Reid 1983): a front holds the rows of its own
blocks P and of those B to which its elimination reaches,

    Z = F_PP⁻¹,   X = Z F_PB,   S = F_BB − F_BP X,

and S is added into its parent's front. Pivots never leave their front: the diagonal of a block system carries inertia and
springs. What friction without symmetry, or a poor scale, costs in digits is won back by refinement.

A factorisation outlives its matrix: where a few springs have changed since, or blocks have hardly moved, it preconditions
GMRES (Saad & Schultz 1986), which then needs a solution or two for every spring that changed.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numba import njit

_jit = njit(cache=True, fastmath=False, error_model="numpy", nogil=True)

#: Blocks in a leaf of the dissection: smaller ones cost more calls, larger ones more arithmetic (measured on walls).
LEAF = 10
#: The largest residual of a solution, relative to the largest right-hand side, …
RESIDUAL = 1e-12
#: … or to the largest Σ|A||x| of a row, below which it is round-off.
ROUND_OFF = 2e-15
#: Refinements of a solution at most.
REFINEMENTS = 3
#: A kept factorisation is tried when no more 6×6 diagonal blocks than this have changed since by more than ``CHANGED``, …
FEW = 12
CHANGED = 1e-3
#: … and given up after so many solutions: with a fresh one they would cost as much.
TRIES = 16
#: Blocks from which subtrees are factored on all cores.
THREADED = 1500


@dataclass(frozen=True, eq=False)
class Tree:
    """The order of elimination. Fronts stand in postorder, blocks are numbered as they are eliminated.

    rank          (n_blocks,)     the number of each block as given
    pivots        (n_fronts + 1,) first own block of every front
    parent        (n_fronts,)     −1 for a root
    reach         (n_fronts + 1,) first entry of every front in ``boundary``
    boundary      (…,)            blocks that a front's elimination reaches, ascending
    seat          (…,)            where each of them stands in the parent's front
    entries       (n_fronts + 1,) first matrix block of every front in ``entry``
    entry, row, column            the matrix block, and where it stands in the front
    stack         (n_fronts,)     where the front leaves its S
    z, x          (n_fronts + 1,) first entry of Z, and of X and F_BP
    pieces        (k, 2)          ranges of fronts that are independent of one another
    rest          (m,)            fronts that need them, in order
    """

    rank: np.ndarray
    pivots: np.ndarray
    parent: np.ndarray
    reach: np.ndarray
    boundary: np.ndarray
    seat: np.ndarray
    entries: np.ndarray
    entry: np.ndarray
    row: np.ndarray
    column: np.ndarray
    stack: np.ndarray
    stack_size: int
    z: np.ndarray
    x: np.ndarray
    pieces: np.ndarray
    rest: np.ndarray


def dissect(points: np.ndarray, pointer: np.ndarray, neighbour: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """The blocks of every front and (n_fronts,) its parent, in postorder; ``points`` (n, 2) lie where the blocks do.

    Halved at the median of the longer side; the separator is the smaller of the two rows of blocks along the cut.
    """
    side = np.zeros(len(points), np.int8)
    fronts: list[np.ndarray] = []
    parent: list[int] = []
    # (blocks, None) is still to be divided, (separator, number of children) is a front whose children are done.
    work: list[tuple[np.ndarray, int | None]] = [(np.arange(len(points)), None)]
    done: list[int] = []
    while work:
        blocks, children = work.pop()
        if children is None and len(blocks) > LEAF:
            at = points[blocks]
            along = at[:, int(np.argmax(np.ptp(at, axis=0)))]
            half = np.argpartition(along, len(blocks) // 2)
            first, second = blocks[half[: len(blocks) // 2]], blocks[half[len(blocks) // 2 :]]
            side[first], side[second] = 1, 2
            cut_first, cut_second = (
                _meets(first, 2, side, pointer, neighbour),
                _meets(second, 1, side, pointer, neighbour),
            )
            side[blocks] = 0
            if cut_first.sum() < cut_second.sum():
                separator, first = first[cut_first], first[~cut_first]
            else:
                separator, second = second[cut_second], second[~cut_second]
            halves = [half for half in (first, second) if len(half)]
            work.append((separator, len(halves)))
            work += [(half, None) for half in halves]
            continue
        for _ in range(children or 0):
            parent[done.pop()] = len(fronts)
        done.append(len(fronts))
        fronts.append(blocks)
        parent.append(-1)
    return fronts, np.array(parent, dtype=np.int64)


def _around(blocks: np.ndarray, pointer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of all neighbours of ``blocks`` in the list of neighbours, and where each block's begin among them."""
    count = pointer[blocks + 1] - pointer[blocks]
    first = np.cumsum(count) - count
    return np.repeat(pointer[blocks] - first, count) + np.arange(count.sum()), first


def _meets(blocks: np.ndarray, other: int, side: np.ndarray, pointer: np.ndarray, neighbour: np.ndarray) -> np.ndarray:
    """(n,) whether each of ``blocks`` has a neighbour on the ``other`` side. Every block is its own neighbour."""
    at, first = _around(blocks, pointer)
    return np.logical_or.reduceat(side[neighbour[at]] == other, first)


def plan(points: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> Tree:
    """The tree for matrix blocks at (``rows``, ``columns``), both triangles and the diagonal, sorted by row then column."""
    n = len(points)
    pointer = np.searchsorted(rows, np.arange(n + 1))
    fronts, parent = dissect(points, pointer, columns)
    n_fronts = len(fronts)
    rank = np.empty(n, np.int64)
    rank[np.concatenate(fronts)] = np.arange(n)
    pivots = np.cumsum([0, *map(len, fronts)])
    reached: list[np.ndarray] = []
    children: list[list[int]] = [[] for _ in range(n_fronts)]
    for f, blocks in enumerate(fronts):
        met = [reached[c] for c in children[f]]
        if len(blocks):
            met.append(rank[columns[_around(blocks, pointer)[0]]])
        met = np.unique(np.concatenate(met))
        reached.append(met[met >= pivots[f + 1]])
        if parent[f] >= 0:
            children[parent[f]].append(f)
    own, far = np.diff(pivots), np.array([len(r) for r in reached])
    reach = np.concatenate([[0], np.cumsum(far)])
    boundary = np.concatenate(reached)

    def seats(f: int, blocks: np.ndarray) -> np.ndarray:
        """Where ``blocks`` stand in front ``f``: its own first, then its boundary."""
        mine = blocks < pivots[f + 1]
        return np.where(mine, blocks - pivots[f], own[f] + np.searchsorted(reached[f], blocks))

    seat = np.full(len(boundary), -1)
    for f in np.flatnonzero(parent >= 0):
        seat[reach[f] : reach[f + 1]] = seats(parent[f], reached[f])
    row, column = rank[rows], rank[columns]
    # A front without blocks of its own begins where the next one does: the last that begins there owns them.
    front = np.searchsorted(pivots, np.minimum(row, column), side="right") - 1
    entry = np.argsort(front, kind="stable")
    entries = np.searchsorted(front[entry], np.arange(n_fronts + 1))
    for f in range(n_fronts):
        here = entry[entries[f] : entries[f + 1]]
        row[here], column[here] = seats(f, row[here]), seats(f, column[here])
    pieces, rest = _independent(parent, own, far)
    stack, stack_size = _stacked(children, far, pieces, rest)
    return Tree(
        rank=rank,
        pivots=pivots,
        parent=parent,
        reach=reach,
        boundary=boundary,
        seat=seat,
        entries=entries,
        entry=entry,
        row=row[entry],
        column=column[entry],
        stack=stack,
        stack_size=stack_size,
        z=36 * np.concatenate([[0], np.cumsum(own * own)]),
        x=36 * np.concatenate([[0], np.cumsum(own * far)]),
        pieces=pieces,
        rest=rest,
    )


def _independent(parent: np.ndarray, own: np.ndarray, far: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Subtrees, as ranges of fronts in postorder, none of which holds more than an eighth of the arithmetic; and the fronts
    above them."""
    cost = own * (own + far) ** 2.0
    first = np.arange(len(parent))
    for f, p in enumerate(parent):
        if p >= 0:
            cost[p] += cost[f]
            first[p] = min(first[p], first[f])
    share = cost[parent < 0].sum() / 8
    high = cost > share
    tops = np.flatnonzero(~high & ((parent < 0) | high[parent]))
    return np.stack([first[tops], tops + 1], axis=1), np.flatnonzero(high)


def _stacked(
    children: list[list[int]], far: np.ndarray, pieces: np.ndarray, rest: np.ndarray
) -> tuple[np.ndarray, int]:
    """Where each front leaves its S when children's are cleared as they are used, and the room that takes."""
    at = np.zeros(len(far), np.int64)
    base = 0
    for fronts in [*(range(a, b) for a, b in pieces), rest]:
        top, used, here = base, base, set(fronts)
        for f in fronts:
            top = min([top, *(at[c] for c in children[f] if c in here)])
            at[f] = top
            top += 36 * far[f] ** 2
            used = max(used, top)
        base = used
    return at, int(base)


@_jit
def _eliminate(
    fronts,
    data,
    pivots,
    parent,
    reach,
    seat,
    entries,
    entry,
    row,
    column,
    stack,
    z_at,
    x_at,
    child,
    sibling,
    room,
    z,
    x,
    y,
):
    """Eliminate ``fronts``, ascending. ``child`` and ``sibling`` chain the children of a front."""
    for f in fronts:
        p, b = 6 * (pivots[f + 1] - pivots[f]), 6 * (reach[f + 1] - reach[f])
        front = np.zeros((p + b, p + b))
        for k in range(entries[f], entries[f + 1]):
            i, j, s = 6 * row[k], 6 * column[k], 36 * entry[k]
            for a in range(6):
                for c in range(6):
                    front[i + a, j + c] += data[s + 6 * a + c]
        g = child[f]
        while g >= 0:
            first, n = reach[g], reach[g + 1] - reach[g]
            for u in range(n):
                i = 6 * seat[first + u]
                for a in range(6):
                    line = stack[g] + (6 * u + a) * 6 * n
                    for v in range(n):
                        j = 6 * seat[first + v]
                        for c in range(6):
                            front[i + a, j + c] += room[line + 6 * v + c]
            g = sibling[g]
        left = stack[f]
        if p == 0:
            room[left : left + b * b] = front.ravel()
            continue
        inverse = np.linalg.inv(np.ascontiguousarray(front[:p, :p]))
        z[z_at[f] : z_at[f + 1]] = inverse.ravel()
        if b > 0:
            lower = np.ascontiguousarray(front[p:, :p])
            upper = np.dot(inverse, np.ascontiguousarray(front[:p, p:]))
            x[x_at[f] : x_at[f + 1]] = upper.ravel()
            y[x_at[f] : x_at[f + 1]] = lower.ravel()
            room[left : left + b * b] = (front[p:, p:] - np.dot(lower, upper)).ravel()


@_jit
def _substitute(right, pivots, reach, boundary, z_at, x_at, z, x, y):
    """The solution for ``right`` (6n,) in the order of elimination."""
    out = right.copy()
    n_fronts = len(pivots) - 1
    for f in range(n_fronts):
        at, p, n = 6 * pivots[f], 6 * (pivots[f + 1] - pivots[f]), reach[f + 1] - reach[f]
        if p == 0:
            continue
        own = np.dot(z[z_at[f] : z_at[f + 1]].reshape((p, p)), out[at : at + p])
        out[at : at + p] = own
        if n > 0:
            passed = np.dot(y[x_at[f] : x_at[f + 1]].reshape((6 * n, p)), own)
            for u in range(n):
                i = 6 * boundary[reach[f] + u]
                for a in range(6):
                    out[i + a] -= passed[6 * u + a]
    for f in range(n_fronts - 1, -1, -1):
        at, p, n = 6 * pivots[f], 6 * (pivots[f + 1] - pivots[f]), reach[f + 1] - reach[f]
        if p == 0 or n == 0:
            continue
        far = np.empty(6 * n)
        for u in range(n):
            i = 6 * boundary[reach[f] + u]
            for a in range(6):
                far[6 * u + a] = out[i + a]
        out[at : at + p] -= np.dot(x[x_at[f] : x_at[f + 1]].reshape((p, 6 * n)), far)
    return out


@_jit
def multiply(data, pointer, columns, x):
    """A x for 6×6 blocks stored row by row, and the largest Σ|A||x| of a row."""
    n = len(pointer) - 1
    out = np.zeros(6 * n)
    size = 0.0
    for i in range(n):
        for a in range(6):
            total, absolute = 0.0, 0.0
            for k in range(pointer[i], pointer[i + 1]):
                for c in range(6):
                    term = data[36 * k + 6 * a + c] * x[6 * columns[k] + c]
                    total += term
                    absolute += abs(term)
            out[6 * i + a] = total
            size = max(size, absolute)
    return out, size


class BlockSolver:
    """Solves A x = b for one pattern of 6×6 blocks and matrices that change from time to time.

    ``points`` (n, 2) m, where the blocks lie; ``rows`` and ``columns`` (n_entries,) of the matrix's blocks, both triangles
    and the diagonal, sorted by row then column. The order of elimination is internal. ``counts`` tells what was done.
    """

    def __init__(self, points: np.ndarray, rows: np.ndarray, columns: np.ndarray):
        self.n = len(points)
        self.keys = rows * self.n + columns
        self.pointer, self.columns = np.searchsorted(rows, np.arange(self.n + 1)), columns
        self._diagonal = np.flatnonzero(rows == columns)
        self.tree = tree = plan(points, rows, columns)
        n_fronts = len(tree.parent)
        self._child, self._sibling = np.full(n_fronts, -1), np.full(n_fronts, -1)
        for f in range(n_fronts - 1, -1, -1):
            if tree.parent[f] >= 0:
                self._sibling[f] = self._child[tree.parent[f]]
                self._child[tree.parent[f]] = f
        self._by_rank = (6 * np.argsort(tree.rank)[:, None] + np.arange(6)).ravel()
        self._z, self._x, self._y = np.empty(tree.z[-1]), np.empty(tree.x[-1]), np.empty(tree.x[-1])
        self._room = np.empty(tree.stack_size)
        self._factored: np.ndarray | None = None
        self.counts = {"factorisations": 0, "substitutions": 0}

    def holds(self, keys: np.ndarray) -> bool:
        """Whether the pattern has the blocks ``keys`` = row · n + column."""
        return bool((self.keys[self.entry(keys) % len(self.keys)] == keys).all())

    def entry(self, keys: np.ndarray) -> np.ndarray:
        """The number of each of the matrix blocks ``keys``."""
        return np.searchsorted(self.keys, keys)

    def solve(self, data: np.ndarray, right: np.ndarray) -> np.ndarray:
        """x (6n,) for the blocks ``data`` (36 n_entries,), each row by row. Raises numpy.linalg.LinAlgError."""
        if self._near(data):
            x = self._iterate(data, right)
            if x is not None:
                return x
        self.factor(data)
        x = self.substitute(right)
        for _ in range(REFINEMENTS):
            rest, target = self._residual(data, right, x)
            if not np.abs(rest).max() > target:
                break
            x += self.substitute(rest)
        return x

    def _residual(self, data: np.ndarray, right: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, float]:
        """b − A x, and how large its largest entry may be."""
        product, size = multiply(data, self.pointer, self.columns, x)
        return right - product, max(RESIDUAL * float(np.abs(right).max(initial=0.0)), ROUND_OFF * size)

    def factor(self, data: np.ndarray) -> None:
        """Factor the matrix of ``data``. Raises numpy.linalg.LinAlgError when it is singular."""
        t = self.tree
        self._factored = None

        def eliminate(fronts: np.ndarray) -> None:
            _eliminate(
                fronts, data, t.pivots, t.parent, t.reach, t.seat, t.entries, t.entry, t.row, t.column, t.stack, t.z, t.x,
                self._child, self._sibling, self._room, self._z, self._x, self._y,
            )  # fmt: skip

        pieces = [np.arange(a, b) for a, b in t.pieces]
        cores = len(os.sched_getaffinity(0))
        if cores > 1 and self.n >= THREADED:
            with ThreadPoolExecutor(cores, thread_name_prefix="geomech-dda") as pool:
                list(pool.map(eliminate, pieces))
        else:
            for fronts in pieces:
                eliminate(fronts)
        eliminate(t.rest)
        self._factored = self._diagonal_of(data)
        self.counts["factorisations"] += 1

    def substitute(self, right: np.ndarray) -> np.ndarray:
        """The solution of the factored system for ``right`` (6n,)."""
        t = self.tree
        out = np.empty_like(right)
        out[self._by_rank] = _substitute(
            right[self._by_rank], t.pivots, t.reach, t.boundary, t.z, t.x, self._z, self._x, self._y
        )
        self.counts["substitutions"] += 1
        return out

    def multiply(self, data: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The product with the matrix of ``data``."""
        return multiply(data, self.pointer, self.columns, x)[0]

    def _diagonal_of(self, data: np.ndarray) -> np.ndarray:
        """(n, 36) the diagonal blocks of ``data``."""
        return data[36 * self._diagonal[:, None] + np.arange(36)]

    def _near(self, data: np.ndarray) -> bool:
        """Whether the kept factorisation is of nearly the same matrix."""
        if self._factored is None:
            return False
        now = self._diagonal_of(data)
        change = np.abs(now - self._factored).max(axis=1)
        return int((change > CHANGED * np.abs(now).max(axis=1)).sum()) <= FEW

    def _iterate(self, data: np.ndarray, right: np.ndarray) -> np.ndarray | None:
        """GMRES with the kept factorisation on the right; None when it takes too long."""
        x = self.substitute(right)
        for _ in range(3):
            rest, target = self._residual(data, right, x)
            if not np.abs(rest).max() > target:
                return x
            step = self._krylov(data, rest, target)
            if step is None:
                return None
            x += step
        return None

    def _krylov(self, data: np.ndarray, rest: np.ndarray, target: float) -> np.ndarray | None:
        """The correction that brings ``rest`` down to ``target``, None if it would take more than ``TRIES`` solutions."""
        size = float(np.linalg.norm(rest))
        basis, directions = [rest / size], []
        hessenberg = np.zeros((TRIES + 1, TRIES))
        first = np.zeros(TRIES + 1)
        first[0] = size
        for k in range(TRIES):
            directions.append(self.substitute(basis[-1]))
            v = self.multiply(data, directions[-1])
            for _ in range(2):  # twice is enough for orthogonality to round-off
                for i, q in enumerate(basis):
                    share = float(q @ v)
                    hessenberg[i, k] += share
                    v -= share * q
            hessenberg[k + 1, k] = np.linalg.norm(v)
            part = hessenberg[: k + 2, : k + 1]
            y, *_ = np.linalg.lstsq(part, first[: k + 2], rcond=None)
            left = float(np.linalg.norm(first[: k + 2] - part @ y))
            # Restarted, the next round would bring down what this one leaves; it need not go below a millionth.
            if left <= max(target, 1e-6 * size) or hessenberg[k + 1, k] == 0.0:
                return np.column_stack(directions) @ y
            basis.append(v / hessenberg[k + 1, k])
        return None
