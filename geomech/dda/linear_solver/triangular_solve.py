"""Forward and backward substitution with the factors of dense fronts (`front_elimination`), at memory speed.

Rows are interleaved in sixes and multiplied six at a time: their common factor is read once, and their sums, each of
which would be slow by itself, are formed together.
"""

from __future__ import annotations

import numpy as np

from ...compiled import UNCOUNTED, part
from .front_elimination import PANEL
from .simd import (
    BYTES,
    copy,
    load,
    load_first,
    load_six,
    minus,
    numbers,
    plus,
    plus_product,
    store_six,
    sums,
    zeros,
)

_part = part(fastmath=False, error_model="numpy", nogil=True)
_uncounted_part = part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)


@_uncounted_part
def _six(rows, at, x, begin, n, width):
    """Products of six ``rows``, from ``at`` on, with n numbers of ``x``, as the first six numbers of a register of this
    ``width``."""
    s0 = s1 = s2 = s3 = s4 = s5 = zeros(rows)
    j = 0
    while j + width <= n:
        v = load(x, begin + j)
        s0, s1 = plus_product(s0, load(rows, at), v), plus_product(s1, load(rows, at + width), v)
        s2, s3 = plus_product(s2, load(rows, at + 2 * width), v), plus_product(s3, load(rows, at + 3 * width), v)
        s4, s5 = plus_product(s4, load(rows, at + 4 * width), v), plus_product(s5, load(rows, at + 5 * width), v)
        j, at = j + width, at + 6 * width
    k = n - j
    if k > 0:
        v = load_first(x, begin + j, k)
        s0, s1 = plus_product(s0, load_first(rows, at, k), v), plus_product(s1, load_first(rows, at + k, k), v)
        at += 2 * k
        s2, s3 = plus_product(s2, load_first(rows, at, k), v), plus_product(s3, load_first(rows, at + k, k), v)
        at += 2 * k
        s4, s5 = plus_product(s4, load_first(rows, at, k), v), plus_product(s5, load_first(rows, at + k, k), v)
    return sums(s0, s1, s2, s3, s4, s5)


@_uncounted_part
def _longest(pivots, reach, first, last):
    """Largest number of unknowns of a front from ``first`` to before ``last``."""
    most = 0
    for f in range(first, last):
        most = max(most, 6 * (pivots[f + 1] - pivots[f] + reach[f + 1] - reach[f]))
    return most


@_part
def forward(first, last, out, pivots, reach, position, at, child, sibling, factors, passed):
    """Forward substitution in ``out`` (6n,), in the order of elimination, through fronts from ``first`` to before
    ``last``; ``passed`` holds the contribution of each front to its parent."""
    width = BYTES // out.itemsize
    known, part = np.empty(_longest(pivots, reach, first, last), out.dtype), np.empty(PANEL, out.dtype)
    x, y, solution, left, rows = numbers(known), numbers(part), numbers(out), numbers(passed), numbers(factors)
    for f in range(first, last):
        p, b = 6 * (pivots[f + 1] - pivots[f]), 6 * (reach[f + 1] - reach[f])
        m = p + b
        copy(solution, 6 * pivots[f], x, 0, p, width)
        for i in range(p, m):
            known[i] = 0
        g = child[f]
        while g >= 0:
            for u in range(reach[g], reach[g + 1]):
                i = 6 * position[u]
                store_six(x, i, plus(load_six(x, i), load_six(left, 6 * u)))
            g = sibling[g]
        here = at[f]
        for start in range(0, p, PANEL):
            end = min(start + PANEL, p)
            for i in range(start, end, 6):
                store_six(y, i - start, minus(load_six(x, i), _six(rows, here, x, 0, start, width)))
                here += 6 * start
            for i in range(start, end, 6):
                store_six(x, i, _six(rows, here, y, 0, end - start, width))
                here += 6 * (end - start)
        copy(x, 0, solution, 6 * pivots[f], p, width)
        for i in range(p, m, 6):
            store_six(left, 6 * reach[f] + i - p, minus(load_six(x, i), _six(rows, here, x, 0, p, width)))
            here += 6 * p
    # Keeps the arrays alive, which are addressed by pointers above.
    return len(known) + len(part) + len(out) + len(passed) + len(factors)


@_part
def backward(first, last, out, pivots, reach, boundary, back, factors):
    """Backward substitution in ``out`` from front ``last`` − 1 down to ``first``."""
    width = BYTES // out.itemsize
    known = np.empty(_longest(pivots, reach, first, last), out.dtype)
    x, solution, rows = numbers(known), numbers(out), numbers(factors)
    for f in range(last - 1, first - 1, -1):
        p, n = 6 * (pivots[f + 1] - pivots[f]), reach[f + 1] - reach[f]
        m = p + 6 * n
        copy(solution, 6 * pivots[f], x, 0, p, width)
        for u in range(n):
            store_six(x, p + 6 * u, load_six(solution, 6 * boundary[reach[f] + u]))
        here = back[f]
        for start in range(PANEL * ((p - 1) // PANEL), -1, -PANEL):
            end = min(start + PANEL, p)
            for i in range(start, end, 6):
                store_six(x, i, plus(load_six(x, i), _six(rows, here, x, end, m - end, width)))
                here += 6 * (m - end)
        copy(x, 0, solution, 6 * pivots[f], p, width)
    return len(known) + len(out) + len(factors)
