"""Products of small matrices whose rows are interleaved in sixes, as in fronts.

A tile of C, six rows by two registers, stays in registers while it is summed. BLAS first copies its operands, which
pays only in large products.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ...compiled import UNCOUNTED, part
from .simd import load, load_first, plus, plus_product, spread, store, store_first, zeros

_part = part(error_model="numpy", nogil=True, **UNCOUNTED)


class Matrix(NamedTuple):
    """A matrix whose first number is ``of[at]`` and whose rows are ``row`` numbers apart."""

    of: Any
    at: int
    row: int


class Size(NamedTuple):
    """Size of a product: (``rows`` × ``k``) times (``k`` × ``n``)."""

    rows: int
    k: int
    n: int


@_part
def _put(c, at, sum_, n, width, keep):
    """Write the first ``n`` numbers of ``sum_`` to ``c``, or add them if ``keep``."""
    if n == width:
        store(c, at, plus(load(c, at), sum_) if keep else sum_)
    else:
        store_first(c, at, plus(load_first(c, at, n), sum_) if keep else sum_, n)


@_part
def _put_six(c, s0, s1, s2, s3, s4, s5, n, width, keep):
    """`_put` of the first six rows of the `Matrix` ``c``."""
    of, at, row = c
    _put(of, at, s0, n, width, keep)
    _put(of, at + row, s1, n, width, keep)
    _put(of, at + 2 * row, s2, n, width, keep)
    _put(of, at + 3 * row, s3, n, width, keep)
    _put(of, at + 4 * row, s4, n, width, keep)
    _put(of, at + 5 * row, s5, n, width, keep)


@_part
def _two_wide(c_of, a_of, b_of, k, n, width, keep):
    """Six rows of C in two registers; of the second one only the first ``n`` numbers."""
    (c, at, row_c), (a, at_a, row_a), (b, at_b, row_b) = c_of, a_of, b_of
    s0 = s1 = s2 = s3 = s4 = s5 = t0 = t1 = t2 = t3 = t4 = t5 = zeros(c)
    a0, a1, a2 = at_a, at_a + row_a, at_a + 2 * row_a
    a3, a4, a5 = at_a + 3 * row_a, at_a + 4 * row_a, at_a + 5 * row_a
    for _ in range(k):
        v, w = load(b, at_b), load_first(b, at_b + width, n)
        x, y, z = spread(a, a0), spread(a, a1), spread(a, a2)
        s0, s1, s2 = plus_product(s0, x, v), plus_product(s1, y, v), plus_product(s2, z, v)
        t0, t1, t2 = plus_product(t0, x, w), plus_product(t1, y, w), plus_product(t2, z, w)
        x, y, z = spread(a, a3), spread(a, a4), spread(a, a5)
        s3, s4, s5 = plus_product(s3, x, v), plus_product(s4, y, v), plus_product(s5, z, v)
        t3, t4, t5 = plus_product(t3, x, w), plus_product(t4, y, w), plus_product(t5, z, w)
        a0, a1, a2, a3, a4, a5, at_b = a0 + 1, a1 + 1, a2 + 1, a3 + 1, a4 + 1, a5 + 1, at_b + row_b
    _put_six(c_of, s0, s1, s2, s3, s4, s5, width, width, keep)
    _put_six(Matrix(c, at + width, row_c), t0, t1, t2, t3, t4, t5, n, width, keep)


@_part
def _one_wide(c_of, a_of, b_of, k, n, width, keep):
    """Six rows of C in one register, its first ``n`` numbers."""
    (a, at_a, row_a), (b, at_b, row_b) = a_of, b_of
    s0 = s1 = s2 = s3 = s4 = s5 = zeros(c_of.of)
    a0, a1, a2 = at_a, at_a + row_a, at_a + 2 * row_a
    a3, a4, a5 = at_a + 3 * row_a, at_a + 4 * row_a, at_a + 5 * row_a
    for _ in range(k):
        v = load_first(b, at_b, n)
        s0, s1 = plus_product(s0, spread(a, a0), v), plus_product(s1, spread(a, a1), v)
        s2, s3 = plus_product(s2, spread(a, a2), v), plus_product(s3, spread(a, a3), v)
        s4, s5 = plus_product(s4, spread(a, a4), v), plus_product(s5, spread(a, a5), v)
        a0, a1, a2, a3, a4, a5, at_b = a0 + 1, a1 + 1, a2 + 1, a3 + 1, a4 + 1, a5 + 1, at_b + row_b
    _put_six(c_of, s0, s1, s2, s3, s4, s5, n, width, keep)


@_part
def small_product(c, a, b, size, width, keep):
    """C ← A B, or C + A B if ``keep``: `Matrix` records of addresses, rows interleaved in sixes; ``size`` as `Size`; a
    register holds ``width`` numbers."""
    rows, k, n = size
    j = 0
    while j < n:
        here = min(n - j, 2 * width)
        for i in range(0, rows, 6):
            six, of_a = Matrix(c.of, c.at + i * c.row + j, c.row), Matrix(a.of, a.at + i * a.row, a.row)
            of_b = Matrix(b.of, b.at + j, b.row)
            if here > width:
                _two_wide(six, of_a, of_b, k, here - width, width, keep)
            else:
                _one_wide(six, of_a, of_b, k, here, width, keep)
        j += here
