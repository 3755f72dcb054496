"""Order of elimination of a plane system of blocks: nested dissection into fronts (George 1973).

Blocks touch only their neighbours in the plane, so a line of blocks divides a system into two independent halves, and
each half again. If the leaves are eliminated first and the separators last, fill-in is minimal. A *front* holds the
rows of its own blocks and of those that their elimination reaches (Duff & Reid 1983).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...compiled import UNCOUNTED, kept, part

#: Blocks in a leaf of the dissection: smaller leaves cost more calls, larger ones more arithmetic (measured on walls).
LEAF = 10
#: Smallest share of the blocks in either part of a cut.
_LEAST = 0.3
#: Directions (2, k) across which cuts are searched, more of them from this number of blocks on: joints may be inclined.
_LARGE = 200
_TWO, _MANY = (np.stack([np.cos(t), np.sin(t)]) for t in (np.pi / 2 * np.arange(2), np.pi / 8 * np.arange(8)))
#: Largest total number of entries of all S up to which they are kept: 1.2 GB in single precision, some fifty thousand
#: blocks.
KEPT = 300_000_000


@dataclass(frozen=True, eq=False)
class Tree:
    """The order of elimination. Fronts are in postorder, blocks numbered in the order of elimination.

    rank          (n_blocks,)     the number of each block as given
    pivots        (n_fronts + 1,) first own block of every front
    parent        (n_fronts,)     −1 for a root
    reach         (n_fronts + 1,) first entry of every front in ``boundary``
    boundary      (…,)            blocks that a front's elimination reaches, ascending
    position      (…,)            position of each of them in the parent's front
    entries       (n_fronts + 1,) first matrix block of every front in ``entry``
    entry, row, column            matrix block, and its position in the front
    kept          whether every S may have memory of its own, so that fronts can be eliminated again one by one
    own_room      (n_fronts,)     place of the front's S in that case, in memory of ``own_room_size``
    stack         (n_fronts,)     its place in memory of ``stack_size`` that later fronts reuse: recently used memory is
                                  still in the cache
    at            (n_fronts + 1,) first entry of every front's factor
    tasks         (k, 2)          ranges of fronts that are one thread's work at a time, each after those it needs
    above         (k,)            the task that needs the result of each task, −1 without
    """

    rank: np.ndarray
    pivots: np.ndarray
    parent: np.ndarray
    reach: np.ndarray
    boundary: np.ndarray
    position: np.ndarray
    entries: np.ndarray
    entry: np.ndarray
    row: np.ndarray
    column: np.ndarray
    kept: bool
    own_room: np.ndarray
    own_room_size: int
    stack: np.ndarray
    stack_size: int
    at: np.ndarray
    tasks: np.ndarray
    above: np.ndarray


@part(fastmath=False, error_model="numpy", nogil=True)
def _best_cut(order, pointer, neighbour, place, least):
    """(cost, k, whether the first part contains the separator) of the cheapest cut of the blocks in ``order`` into the
    first k and the rest, neither below ``least``; ``place`` (n,): working space, −1 everywhere before and after."""
    m = len(order)
    for q in range(m):
        place[order[q]] = q
    # Block q is in the separator of a cut before k if q < k ≤ the last neighbour's place, or the first one's < k ≤ q.
    first, second = np.zeros(m + 2, np.int64), np.zeros(m + 2, np.int64)
    for q in range(m):
        low = high = q
        for e in range(pointer[order[q]], pointer[order[q] + 1]):
            r = place[neighbour[e]]
            if r >= 0:
                low, high = min(low, r), max(high, r)
        first[q + 1] += 1
        first[high + 1] -= 1
        second[low + 1] += 1
        second[q + 1] -= 1
    for q in range(m):
        place[order[q]] = -1
    price, at, from_first = np.inf, m // 2, True
    a = b = 0
    for k in range(1, m):
        a += first[k]
        b += second[k]
        if least <= k <= m - least:
            off = (2.0 * k - m) / m
            here = min(a, b) * (1.0 + off * off)
            if here < price:
                price, at, from_first = here, k, a <= b
    return price, at, from_first


@part(fastmath=False, error_model="numpy", nogil=True)
def _meets(order, at, from_first, pointer, neighbour, place):
    """(m,) bool: blocks in ``order`` that belong to the first ``at`` (or, not ``from_first``, to the rest) and touch one on
    the other side."""
    m = len(order)
    out = np.zeros(m, np.bool_)
    for q in range(m):
        place[order[q]] = q
    for q in range(m):
        if (q < at) == from_first:
            for e in range(pointer[order[q]], pointer[order[q] + 1]):
                r = place[neighbour[e]]
                out[q] = out[q] or (r >= 0 and (r < at) != from_first)
    for q in range(m):
        place[order[q]] = -1
    return out


@part(fastmath=False, error_model="numpy", nogil=True)
def _partition(order, side, counts, room):
    """Sort the blocks of ``order`` (m,), in place and stably, by their ``side`` 0, 1 or 2, of which there are ``counts``
    (3,); ``room`` (≥ m,) is work space."""
    at = np.array([0, counts[0], counts[0] + counts[1]])
    for q in range(len(order)):
        room[q] = order[q]
    for q in range(len(order)):
        b = room[q]
        order[at[side[b]]] = b
        at[side[b]] += 1


@kept(fastmath=False, error_model="numpy", nogil=True)
def _dissected(orders, pointer, neighbour, leaf, large, least_part, across):
    """The blocks (n,) front by front, the start of each front among them (n_fronts + 1,), and its parent. ``orders``
    (k, n), overwritten: all blocks in their order across each direction; ``across``: the directions across which small
    parts are cut. The direction perpendicular to number d is d + k/2, or d − k/2 reversed."""
    k, n = orders.shape
    place, side = np.full(n, -1), np.empty(n, np.int64)
    room = np.empty(n, np.int64)
    blocks, begins, parent = np.empty(n, np.int64), np.zeros(2 * n + 2, np.int64), np.full(2 * n + 1, -1)
    # Parts to be divided, as ranges of every order; and separators, as ranges with the number of their children (−1 for
    # parts still to be divided).
    work, waiting, done, ended = np.empty((2 * n + 8, 3), np.int64), 1, np.empty(2 * n + 1, np.int64), 0
    work[0, 0], work[0, 1], work[0, 2] = 0, n, -1
    fronts = 0
    while waiting > 0:
        waiting -= 1
        first, last, children = work[waiting]
        m = last - first
        if children >= 0 or m <= leaf:
            for _ in range(children):
                ended -= 1
                parent[done[ended]] = fronts
            for q in range(m):
                blocks[begins[fronts] + q] = orders[0, first + q]
            done[ended] = fronts
            ended += 1
            begins[fronts + 1] = begins[fronts] + m
            fronts += 1
            continue
        least = max(1, int(least_part * m))
        best, price, at, from_first = -1, np.inf, 0, True
        for d in range(k):
            if m >= large or across[d]:
                here, begin, of_first = _best_cut(orders[d, first:last], pointer, neighbour, place, least)
                if here < price or best < 0:
                    best, price, at, from_first = d, here, begin, of_first
        order = orders[best, first:last]
        cut = _meets(order, at, from_first, pointer, neighbour, place)
        halves = np.zeros(3, np.int64)
        for q in range(m):
            side[order[q]] = 2 if cut[q] else (0 if q < at else 1)
            halves[side[order[q]]] += 1
        one, two = first + halves[0], first + halves[0] + halves[1]
        # Each order is continued within the two halves and the separator.
        for d in range(k):
            if m >= large or across[d]:
                _partition(orders[d, first:last], side, halves, room)
        # A separator is eliminated from one end to the other.
        turned = best + k // 2 >= k
        along = best - k // 2 if turned else best + k // 2
        for q in range(last - two):
            room[q] = orders[along, last - 1 - q if turned else two + q]
        for q in range(last - two):
            orders[0, two + q] = room[q]
        work[waiting, 0], work[waiting, 1], work[waiting, 2] = two, last, (halves[0] > 0) + (halves[1] > 0)
        waiting += 1
        for begin, end in ((first, one), (one, two)):
            if end > begin:
                work[waiting, 0], work[waiting, 1], work[waiting, 2] = begin, end, -1
                waiting += 1
    return blocks, begins[: fronts + 1].copy(), parent[:fronts].copy()


def dissect(points: np.ndarray, pointer: np.ndarray, neighbour: np.ndarray, leaf: int = LEAF) -> tuple[np.ndarray, ...]:
    """The blocks (n,) front by front, the start of each front among them (n_fronts + 1,), and its parent (n_fronts,),
    in postorder. ``points`` (n, 2): positions of the blocks; ``pointer`` and ``neighbour``: which blocks meet; ``leaf``:
    blocks in a leaf.

    A part is cut across the direction in which the separator, the smaller of the two rows of blocks along the cut, is
    smallest: bricks, for example, are many per metre upwards and few along a course.
    """
    directions = _MANY if len(points) >= _LARGE else _TWO
    across = np.abs(directions).max(axis=0) > 1.0 - 1e-9
    orders = np.ascontiguousarray(np.argsort(points @ directions, axis=0, kind="stable").T)
    return _dissected(orders, pointer, neighbour, leaf, _LARGE, _LEAST, across)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _position(number, front, pivots, reach, boundary):
    """Position of a block in a front: its own blocks first, then its boundary."""
    if number < pivots[front + 1]:
        return number - pivots[front]
    low, high = reach[front], reach[front + 1]
    while low < high:
        mid = (low + high) // 2
        if boundary[mid] < number:
            low = mid + 1
        else:
            high = mid
    return pivots[front + 1] - pivots[front] + low - reach[front]


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _sort(numbers, first, last):
    """Sort the ``numbers`` from ``first`` to before ``last`` in place, by insertion at decreasing distances (Shell
    1959): some hundred numbers that are mostly in order. (np.sort takes two seconds to compile.)"""
    apart = 1
    while 3 * apart < last - first:
        apart = 3 * apart + 1
    while apart > 0:
        for k in range(first + apart, last):
            given, at = numbers[k], k
            while at - apart >= first and numbers[at - apart] > given:
                numbers[at] = numbers[at - apart]
                at -= apart
            numbers[at] = given
        apart //= 3


@kept(fastmath=False, error_model="numpy", nogil=True)
def _reached(blocks, rank, pivots, parent, pointer, neighbour):
    """``reach``, ``boundary`` and ``position`` of a `Tree`; ``blocks`` (n,) in the order of elimination."""
    n_fronts = len(parent)
    reach, boundary, top = np.zeros(n_fronts + 1, np.int64), np.empty(4 * len(blocks) + 16, np.int64), 0
    child, sibling, met = np.full(n_fronts, -1), np.full(n_fronts, -1), np.full(len(blocks), -1)
    for f in range(n_fronts):
        last = pivots[f + 1]
        if len(boundary) < top + len(blocks):
            more = np.empty(2 * len(boundary), np.int64)
            for k in range(top):
                more[k] = boundary[k]
            boundary = more
        for q in range(pivots[f], last):
            b = blocks[q]
            for e in range(pointer[b], pointer[b + 1]):
                r = rank[neighbour[e]]
                if r >= last and met[r] != f:
                    met[r], boundary[top] = f, r
                    top += 1
        g = child[f]
        while g >= 0:
            for k in range(reach[g], reach[g + 1]):
                r = boundary[k]
                if r >= last and met[r] != f:
                    met[r], boundary[top] = f, r
                    top += 1
            g = sibling[g]
        _sort(boundary, reach[f], top)
        reach[f + 1] = top
        if parent[f] >= 0:
            sibling[f], child[parent[f]] = child[parent[f]], f
    position = np.full(top, -1)
    for f in range(n_fronts):
        for k in range(reach[f], reach[f + 1]):
            position[k] = _position(boundary[k], parent[f], pivots, reach, boundary)
    return reach, boundary[:top].copy(), position


@kept(fastmath=False, error_model="numpy", nogil=True)
def _places(row, column, entry, entries, pivots, reach, boundary):
    """Positions in their fronts of the rows and columns of the matrix blocks ``entry`` (…,), given by their block
    numbers."""
    rows, columns = np.empty(len(entry), np.int64), np.empty(len(entry), np.int64)
    for f in range(len(entries) - 1):
        for k in range(entries[f], entries[f + 1]):
            rows[k] = _position(row[entry[k]], f, pivots, reach, boundary)
            columns[k] = _position(column[entry[k]], f, pivots, reach, boundary)
    return rows, columns


def plan(points: np.ndarray, rows: np.ndarray, columns: np.ndarray, cut: tuple[np.ndarray, ...] | None = None) -> Tree:
    """The tree for matrix blocks at (``rows``, ``columns``), both triangles and the diagonal, sorted by row then
    column; with the fronts of ``cut`` if given, as from `dissect`."""
    n, columns = len(points), np.ascontiguousarray(columns)
    pointer = np.searchsorted(rows, np.arange(n + 1))
    blocks, pivots, parent = dissect(points, pointer, columns) if cut is None else cut
    n_fronts = len(parent)
    rank = np.empty(n, np.int64)
    rank[blocks] = np.arange(n)
    reach, boundary, position = _reached(blocks, rank, pivots, parent, pointer, columns)
    own, far = np.diff(pivots), np.diff(reach)
    row, column = rank[rows], rank[columns]
    # A front without own blocks begins at the same position as the next one: the last front that begins there owns the
    # blocks.
    front = np.searchsorted(pivots, np.minimum(row, column), side="right") - 1
    entry = np.argsort(front, kind="stable")
    entries = np.searchsorted(front[entry], np.arange(n_fronts + 1))
    row, column = _places(row, column, entry, entries, pivots, reach, boundary)
    tasks, above = _tasks(parent, own, far)
    size = 36 * far**2
    stack, stack_size = _stacked(parent, size, tasks)
    return Tree(
        rank=rank,
        pivots=pivots,
        parent=parent,
        reach=reach,
        boundary=boundary,
        position=position,
        entries=entries,
        entry=entry,
        row=row,
        column=column,
        kept=int(size.sum()) <= KEPT,
        own_room=np.cumsum(size) - size,
        own_room_size=int(size.sum()),
        stack=stack,
        stack_size=stack_size,
        at=36 * np.concatenate([[0], np.cumsum(own * (own + 2 * far))]),
        tasks=tasks,
        above=above,
    )


def _tasks(parent: np.ndarray, own: np.ndarray, far: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Subtrees, as ranges of fronts in postorder, none of which has more than an eighth of the arithmetic, and the
    fronts above them one by one; and the task above each. Tasks with the most arithmetic on their path to the root come
    first."""
    cost = own * (own + far) ** 2.0
    alone, first = cost.copy(), np.arange(len(parent))
    for f, p in enumerate(parent):
        if p >= 0:
            cost[p] += cost[f]
            first[p] = min(first[p], first[f])
    high = cost > cost[parent < 0].sum() / 8
    tops = np.flatnonzero(high | (parent < 0) | high[parent])
    first[high] = np.flatnonzero(high)
    way = np.where(high, alone, cost)
    for f in tops[::-1]:
        if parent[f] >= 0:
            way[f] += way[parent[f]]
    order = tops[np.lexsort((tops, -way[tops]))]
    number = np.full(len(parent) + 1, -1)
    number[order] = np.arange(len(order))
    return np.stack([first[order], order + 1], axis=1), number[parent[order]]


def _stacked(parent: np.ndarray, size: np.ndarray, tasks: np.ndarray) -> tuple[np.ndarray, int]:
    """Storage position of the S, of ``size`` (n_fronts,), of each front, and the total size. Each task has two stacks,
    for fronts an even and an odd number of levels below the root: S of a front is put on one while those of its
    children, the last on the other, are used up."""
    at, level = np.zeros(len(parent), np.int64), np.zeros(len(parent), np.int64)
    for f in range(len(parent) - 1, -1, -1):
        if parent[f] >= 0:
            level[f] = level[parent[f]] + 1
    base, below = 0, np.full(len(parent), -1)
    for a, b in tasks:
        top, most = [0, 0], [0, 0]
        for f in range(a, b):
            stack = level[f] % 2
            # If its children belong to this task, the first one lies lowest.
            if below[f] >= a:
                top[1 - stack] = at[below[f]]
            at[f] = top[stack]
            top[stack] += size[f]
            most[stack] = max(most[stack], top[stack])
            if parent[f] >= 0 and below[parent[f]] < a:
                below[parent[f]] = f
        at[a:b] += np.where(level[a:b] % 2 == 1, base + most[0], base)
        base += sum(most)
    return at, int(base)
