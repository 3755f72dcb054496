"""Influence of straight elements in the infinite plane: closed forms nearby, series far away. All compiled.

With t on the element, w(t) its weight (`shape_functions`) and ζ the field point relative to the midpoint, in half
lengths c, all fields of an element follow from the Cauchy moments and their derivatives

    A_k(ζ) = ∫ w(t) t^k / (ζ − t) dt,   A_k = ζ A_{k−1} − m_{k−1},   m_j = ∫ w t^j dt,

because G' = A, G'' = A'/c, G''' = A''/c² for G(z) = ∫ N log(z − t) dt (Crouch & Starfield 1983, ch. 5). The recurrence
runs upwards near the element. Far away it would lose |ζ|^(k+1) digits; there A_p comes from its series in 1/ζ, and the
same recurrence runs downwards, where it is stable.

Densities are jumps u⁺ − u⁻ times 2μ (slip and opening of a crack; the displacement of a boundary with the rock on its
left) and line forces. On the line of an element, the sign of y (±0.0 included) selects the side from which a point is
seen.

Points are sorted by distance, element by element, and evaluated in groups of eight of one distance class (`simd`). The
value for a pair depends on that pair alone, not on other points or on the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from .shape_functions import MAX_ORDER
from .simd import (
    WIDTH,
    angle,
    both,
    gather,
    im,
    less,
    load,
    load_complex,
    log,
    log1p,
    norm,
    pile,
    re,
    root,
    scatter,
    signed,
    size,
    splat,
    store,
    term,
    times_i,
    value,
)

#: Lower bounds |ζ| of the distance classes; each has as many series terms as it needs. Below the first bound the closed
#: form is used for orders above 5, below the second for orders up to 5: each upward step loses a factor |ζ|, so that
#: six steps at 2.2, or eleven at 1.5, lose two digits. Omitted terms are below 1e-17 of the first.
_REACH = np.array([1.5, 2.2, 2.6, 3.2, 4.2, 6.0, 9.0, 15.0, 30.0, 100.0, 1e3, 1e5])


def _terms(reach: float) -> int:
    n = 1
    # The coefficients of the second derivative grow as j²/2, the moments fall as 1/j.
    while 0.5 * (n + 2) * reach**-n > 1e-17:
        n += 1
    return n + n % 2


_TERMS = np.array([_terms(r) for r in _REACH])
_REACH_SQUARED = _REACH**2
_CLASSES = len(_REACH) + 1

#: Number of points sorted at a time.
_TILE = 256
_ROW = _TILE + WIDTH
#: Offsets of A', A'' and the next order behind A.
_B, _D, _STEP = 2 * WIDTH, 4 * WIDTH, 6 * WIDTH

_jit = kept(fastmath=False, error_model="numpy", nogil=True)
_part = part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
#: Inlined into the calling kernel, so that products and sums are fused as if written there.
_inlined = part(fastmath=False, error_model="numpy", nogil=True, forceinline=True, **UNCOUNTED)


class Elements(NamedTuple):
    """Straight elements: ``start``, ``end`` (m, 2) m and ``kind`` (m,), see `shape_functions`."""

    start: np.ndarray
    end: np.ndarray
    kind: np.ndarray


class Kernel(NamedTuple):
    """Type of source: Poisson's ratio ``nu`` of the rock; jumps, or line forces (``force``); points within ``tol`` m of
    an open element lie on it and are seen from ``side``."""

    nu: float
    tol: float
    side: float
    force: bool


@_part
def _square_root(z):
    """Principal square root; on the cut the sign of Im z selects the side."""
    r = root(norm(z))
    large = root(0.5 * (r + size(re(z))))
    small = 0.5 * size(im(z)) / large
    return both(less(re(z), 0.0, small, large), signed(less(re(z), 0.0, large, small), im(z)))


@_part
def _first_moment(kind, zp, zm):
    """A_0, A_0', A_0'' in closed form; ``zp``, ``zm`` are ζ + 1 and ζ − 1.

    With s = (1+ζ)/2, v = √s a tip at the start has A_0 = v log((v+1)/(v−1)) − 2; one at the end is its mirror image,
    A(ζ) = −A_start(−ζ).
    """
    if kind == 3:
        turned = _square_root(zm) * _square_root(zp)
        z, i = 0.5 * (zp + zm), 1.0 / turned
        return np.pi * (z - turned), np.pi * (1.0 - z * i), np.pi * (i * i * i)
    s, s1 = 0.5 * zp, 0.5 * zm
    if kind == 2:
        s, s1 = -s1, -s
    v = s
    y = im(s)
    if kind == 0:
        # Ratios of distances as 1 + x, with x accurate to full relative precision, from the nearer end.
        way, more = re(s + s1), size(re(s + s1)) / less(norm(s), norm(s1), norm(s), norm(s1))
        up, below = -2.0 * y, 2.0 * (re(s) * re(s1) + y * y)
    else:
        v = _square_root(s)
        # |v|² − 1 and |v − 1| from s − 1, which is accurate to full relative precision near the far end.
        way, more = re(v), 4.0 * re(v) * norm(v + 1.0) / norm(s1)
        up, below = -2.0 * im(v), (re(s1) * (re(s) + 1.0) + y * y) / (root(norm(s)) + 1.0)
    # log((ζ+1)/(ζ−1)), or log((v+1)/(v−1)).
    a = both(signed(0.5 * log1p(more), way), angle(up, below))
    i1 = 1.0 / s1
    if kind == 0:
        i = 1.0 / s
        return a, -0.5 * (i * i1), 0.25 * (i1 * i1 - i * i)
    g = a / v
    a = v * a - 2.0
    b = 0.25 * g - 0.5 * i1
    d = 0.25 * (i1 * i1 - (0.25 * g + 0.5 * i1) / s)
    if kind == 2:
        a, d = -a, -d
    return a, b, d


@_part
def _moments(kind, distance, zp, zm, order, table, w):
    """A_k, A_k', A_k'' for k = 0 … order at eight points of one distance class, into ``w``, ``_STEP`` numbers per
    order."""
    z = 0.5 * (zp + zm)
    if distance == 0 or (distance == 1 and order <= 5):
        a, b, d = _first_moment(kind, zp, zm)
        for k in range(order + 1):
            store(w, k * _STEP, a)
            store(w, k * _STEP + _B, b)
            store(w, k * _STEP + _D, d)
            d = 2.0 * b + z * d
            b = a + z * b
            a = z * a - table[kind, k]
        return
    i = 1.0 / z
    n = _TERMS[distance - 1]
    # Odd moments vanish for even weights.
    even = kind == 0 or kind == 3
    first, step, q, lead = 0, 1, i, i
    if even:
        first, step, q = order % 2, 2, i * i
        n = first + n
        if first == 1:
            lead = q
    u, v = 2.0 * re(q), norm(q)
    zero = both(splat(0.0), splat(0.0))
    a, b, d = zero, zero, zero
    for j in range(n, first - 1, -step):
        m = table[kind, order + j]
        a = term(a, u, v, m)
        m *= j + 1.0
        b = term(b, u, v, m)
        d = term(d, u, v, m * (j + 2.0))
    a = value(a, q) * lead
    lead = lead * i
    b = -(value(b, q) * lead)
    d = value(d, q) * (lead * i)
    for k in range(order, -1, -1):
        store(w, k * _STEP, a)
        store(w, k * _STEP + _B, b)
        store(w, k * _STEP + _D, d)
        if k > 0:
            a = (a + table[kind, k - 1]) * i
            b = (b - a) * i
            d = (d - 2.0 * b) * i


@_jit
def moments(kind, xp, xm, y, order, table, a, b, d):
    """A_k, A_k', A_k'' for k = 0 … order into ``a``, ``b``, ``d`` (n, order+1), at ζ + 1 = xp + iy, ζ − 1 = xm + iy,
    (n,) each."""
    w = np.empty((MAX_ORDER + 1) * _STEP)
    for i in range(len(y)):
        x = 0.5 * (xp[i] + xm[i])
        distance = np.searchsorted(_REACH_SQUARED, x * x + y[i] * y[i], side="right")
        zp, zm = both(splat(xp[i]), splat(y[i])), both(splat(xm[i]), splat(y[i]))
        _moments(kind, distance, zp, zm, order, table, w)
        for k in range(order + 1):
            at = k * _STEP
            a[i, k] = complex(w[at], w[at + WIDTH])
            b[i, k] = complex(w[at + _B], w[at + _B + WIDTH])
            d[i, k] = complex(w[at + _D], w[at + _D + WIDTH])


@_part
def _sort(points, first, n, elements, e, tol, side, tile, chosen, count):
    """Transform points ``first`` … + n to the frame of element ``e``, in half lengths c, and sort them by distance.

    ``points`` x … y … flat, each padded to whole lanes; ``tile``: x + 1, x − 1, y (``_TILE`` each, a fourth is
    scratch); ``chosen`` (_CLASSES rows of _ROW): points of each class, ``count`` of them, the last repeated to fill the
    lanes. Returns (c, tx, ty).

    A point within ``tol`` of the open element is moved onto it, on the given side. A point at an end is moved by 1e-14
    along the normal, so that singular values stay finite.
    """
    sx, sy, ex, ey = elements.start[e, 0], elements.start[e, 1], elements.end[e, 0], elements.end[e, 1]
    lx, ly = ex - sx, ey - sy
    length = np.sqrt(lx * lx + ly * ly)
    tx, ty = lx / length, ly / length
    c = 0.5 * length
    below = len(points) // 2
    for i in range(0, n, WIDTH):
        px, py = load(points, first + i), load(points, first + i + below)
        ax, ay, bx, by = px - sx, py - sy, px - ex, py - ey
        xp, xm = ax * tx + ay * ty, bx * tx + by * ty
        # From the nearer end, which keeps the digits of y close to both.
        y = less(size(xp), size(xm), ay * tx - ax * ty, by * tx - bx * ty)
        on = less(tol, size(y), y, signed(splat(0.0), splat(side)))
        y = less(0.0, xp, less(xm, 0.0, on, y), y)
        xp, xm, y = xp / c, xm / c, y / c
        end = less(size(xp), size(xm), size(xp), size(xm))
        off = less(size(y), 1e-14, signed(splat(1e-14), splat(side)), y)
        y = less(end, 1e-14, off, y)
        x = 0.5 * (xp + xm)
        store(tile, i, xp)
        store(tile, i + _TILE, xm)
        store(tile, i + 2 * _TILE, y)
        store(tile, i + 3 * _TILE, x * x + y * y)
    for k in range(_CLASSES):
        count[k] = 0
    for i in range(n):
        rr = tile[3 * _TILE + i]
        k = 0
        while k < _CLASSES - 1 and rr >= _REACH_SQUARED[k]:
            k += 1
        chosen[k * _ROW + count[k]] = i
        count[k] += 1
    for k in range(_CLASSES):
        at = k * _ROW + count[k]
        if count[k] > 0:
            for i in range(WIDTH):
                chosen[at + i] = chosen[at - 1]
    return c, tx, ty


@_inlined
def _force_tractions(w, n1, factor, nu, y, turn, parts):
    """Traction (normal + i tangential) of line forces along and across an element, into ``parts``: half the deviator
    (σyy − σxx)/2 + i shear, rotated, plus half the trace."""
    for k in range(n1):
        at = k * _STEP
        a, b = -factor * load_complex(w, at), (-factor * y) * load_complex(w, at + _B)
        along = -(times_i(b) + 2.0 * (1.0 - nu) * a)
        store(parts, at, along * turn + re(a))
        store(parts, at + _B, (b + (1.0 - 2.0 * nu) * times_i(a)) * turn - im(a))


@_inlined
def _jump_tractions(w, n1, f2, y, turn, parts):
    """Traction (normal + i tangential) of displacement jumps along and across an element."""
    f3 = f2 * y
    for k in range(n1):
        at = k * _STEP
        b, d = f2 * load_complex(w, at + _B), (f3 * load_complex(w, at + _D)) * turn
        store(parts, at, d - times_i(b) * turn - im(b))
        store(parts, at + _B, times_i(d) - re(b))


@_inlined
def nodal_sums(parts, step, nodal, source, j, n1):
    """Tractions of the nodal density ``j`` along and across an element: Σ_k nodal[source, k, j] times those of the
    monomials in ``parts``, ``step`` numbers an order."""
    along, normal = both(splat(0.0), splat(0.0)), both(splat(0.0), splat(0.0))
    for k in range(n1):
        t = nodal[source, k, j]
        along = along + t * load_complex(parts, k * step)
        normal = normal + t * load_complex(parts, k * step + _B)
    return along, normal


@_jit
def tractions(points, tangents, per, first, last, elements, order, kernel, table, nodal, out):
    """Traction (along the tangent, along the normal to its left) at points, from unit densities.

    ``points``, ``tangents`` flat (`lanes_of`), ``per`` points per element; those from ``first`` to ``last`` are
    computed. Sources: `Elements` of the `Kernel` type. ``nodal`` (4, p+1, p+1) converts the monomials of each kind to
    nodal unknowns. ``out`` flat, (2(p+1)m, 2n): rows element, component (along, normal), unknown; columns element,
    component, node.
    """
    nu, n1 = kernel.nu, order + 1
    w = np.empty((MAX_ORDER + 1) * _STEP)
    parts = np.empty((MAX_ORDER + 1) * _STEP)
    tile = np.empty(4 * _TILE)
    chosen = np.empty(_CLASSES * _ROW, np.int64)
    count = np.empty(_CLASSES, np.int64)
    places = np.empty(_TILE, np.int64)
    lane_places = np.empty(WIDTH, np.int64)
    below = len(tangents) // 2
    height = len(out) // (2 * n1 * len(elements.start))
    factor = 1.0 / (4.0 * np.pi * (1.0 - nu))
    for begin in range(first, last, _TILE):
        n = min(_TILE, last - begin)
        for i in range(n):
            places[i] = (begin + i) // per * per + begin + i
        for e in range(len(elements.start)):
            c, tx, ty = _sort(points, begin, n, elements, e, kernel.tol, kernel.side, tile, chosen, count)
            source = elements.kind[e]
            for distance in range(_CLASSES):
                row = distance * _ROW
                for batch in range(row, row + count[distance], WIDTH):
                    y = gather(tile, 2 * _TILE, chosen, batch)
                    zp, zm = both(gather(tile, 0, chosen, batch), y), both(gather(tile, _TILE, chosen, batch), y)
                    _moments(source, distance, zp, zm, order, table, w)
                    ux, uy = gather(tangents, begin, chosen, batch), gather(tangents, begin + below, chosen, batch)
                    # Twice the angle from the element to the target.
                    turn = both(ux * tx + uy * ty, uy * tx - ux * ty)
                    turn = turn * turn
                    # Normal + i tangential traction: (half the deviator (σyy − σxx)/2 + i shear), rotated, plus half
                    # the trace.
                    if kernel.force:
                        _force_tractions(w, n1, factor, nu, y, turn, parts)
                    else:
                        _jump_tractions(w, n1, factor / c, y, turn, parts)
                    for k in range(WIDTH):
                        lane_places[k] = places[chosen[batch + k]]
                    for j in range(n1):
                        along, normal = nodal_sums(parts, _STEP, nodal, source, j, n1)
                        # Lanes with the same point write the same number to the same place.
                        at = (2 * e * n1 + j) * height
                        scatter(out, at + per, lane_places, 0, re(along))
                        scatter(out, at, lane_places, 0, im(along))
                        at += n1 * height
                        scatter(out, at + per, lane_places, 0, re(normal))
                        scatter(out, at, lane_places, 0, im(normal))


@_part
def _fold(p, q, moments, n, folded_p, folded_q):
    """The first ``n`` multipoles of an element with monomial densities ``p`` and ``q`` (p+1,), from the ``moments`` of
    its weight."""
    for j in range(n):
        folded_p[j] = 0.0
        folded_q[j] = 0.0
        for k in range(len(p)):
            folded_p[j] += p[k] * moments[j + k]
            folded_q[j] += q[k] * moments[j + k]


@_inlined
def _near_sums(kind, zp, zm, p, q, moments, force):
    """Moments, their two derivatives and, for forces, logarithms, each summed with ``p`` and with ``q``: closed
    form."""
    nothing = splat(0.0)
    zero = both(nothing, nothing)
    ap, aq, bp, bq, dp, dq = zero, zero, zero, zero, zero, zero
    log_p, log_q, log_r = nothing, nothing, nothing
    z = 0.5 * (zp + zm)
    if force:
        log_r = 0.5 * log(norm(zm))
    a, b, d = _first_moment(kind, zp, zm)
    # log|ζ + 1|.
    other = log_r + re(a)
    for k in range(len(p)):
        fp, fq = p[k], q[k]
        ap = ap + fp * a
        aq = aq + fq * a
        bp = bp + fp * b
        bq = bq + fq * b
        dp = dp + fp * d
        dq = dq + fq * d
        d = 2.0 * b + z * d
        b = a + z * b
        a = z * a - moments[k]
        if force:
            # ∫ t^k log|ζ − t| dt by parts.
            part = (re(a) + log_r + other) / (k + 1.0)
            log_p = log_p + fp * part
            log_q = log_q + fq * part
            other = -other
    return ap, aq, bp, bq, dp, dq, log_p, log_q


@_inlined
def _far_sums(zp, zm, last, folded_p, folded_q, force):
    """The same from the multipoles up to number ``last``."""
    nothing = splat(0.0)
    zero = both(nothing, nothing)
    ap, aq, bp, bq, dp, dq, lp, lq = zero, zero, zero, zero, zero, zero, zero, zero
    log_p, log_q, log_r = nothing, nothing, nothing
    z = 0.5 * (zp + zm)
    if force:
        log_r = 0.5 * log(norm(z))
    i = 1.0 / z
    u, v = 2.0 * re(i), norm(i)
    for j in range(last, -1, -1):
        fp, fq = folded_p[j], folded_q[j]
        if force and j > 0:
            lp, lq = term(lp, u, v, fp / j), term(lq, u, v, fq / j)
        ap, aq = term(ap, u, v, fp), term(aq, u, v, fq)
        fp *= j + 1.0
        fq *= j + 1.0
        bp, bq = term(bp, u, v, fp), term(bq, u, v, fq)
        dp, dq = term(dp, u, v, fp * (j + 2.0)), term(dq, u, v, fq * (j + 2.0))
    if force:
        log_p = folded_p[0] * log_r - re(value(lp, i) * i)
        log_q = folded_q[0] * log_r - re(value(lq, i) * i)
    lead = i
    ap, aq = value(ap, i) * lead, value(aq, i) * lead
    lead = -(lead * i)
    bp, bq = value(bp, i) * lead, value(bq, i) * lead
    lead = -(lead * i)
    dp, dq = value(dp, i) * lead, value(dq, i) * lead
    return ap, aq, bp, bq, dp, dq, log_p, log_q


@_inlined
def _of_forces(sums, y, c, nu, p, q, moments):
    """Half the trace, half the deviator (σyy − σxx)/2 + i shear, and 2μ times the displacement, of line forces."""
    ap, aq, bp, bq, _, _, log_p, log_q = sums
    half = re(ap) - im(aq)
    deviator = y * (bq - times_i(bp)) - 2.0 * (1.0 - nu) * ap + (1.0 - 2.0 * nu) * times_i(aq)
    sum_p, sum_q = 0.0, 0.0
    for k in range(len(p)):
        sum_p += p[k] * moments[k]
        sum_q += q[k] * moments[k]
    log_p = (3.0 - 4.0 * nu) * (log_p + np.log(c) * sum_p) - y * (im(ap) + re(aq))
    log_q = (3.0 - 4.0 * nu) * (log_q + np.log(c) * sum_q) + y * (im(aq) - re(ap))
    return half, deviator, c * both(log_p, log_q)


@_inlined
def _of_jumps(sums, y, c, nu):
    """The same for displacement jumps."""
    ap, aq, bp, bq, dp, dq, _, _ = sums
    half = -(im(bp) + re(bq)) / c
    deviator = (y * (dp + times_i(dq)) - times_i(bp)) / c
    moved = both(
        y * (im(bq) - re(bp)) - 2.0 * (1.0 - nu) * im(ap) - (1.0 - 2.0 * nu) * re(aq),
        y * (im(bp) + re(bq)) - 2.0 * (1.0 - nu) * im(aq) + (1.0 - 2.0 * nu) * re(ap),
    )
    return half, deviator, moved


@_jit
def fields(points, first, last, elements, order, density, kernel, table, out):
    """Add stress (xx, yy, xy) and 2μ times displacement (x, y) of `Elements` of the `Kernel` type to ``out`` (5, n).

    ``points`` flat (`lanes_of`); ``density`` (m, 2, p+1): monomial densities, local components. Line forces act on
    ordinary elements only."""
    nu, force, n1 = kernel.nu, kernel.force, order + 1
    highest = order + 1 if force else order
    factor = 1.0 / (4.0 * np.pi * (1.0 - nu))
    if force:
        factor = -factor
    tile = np.empty(4 * _TILE)
    total = np.empty(5 * _TILE)
    chosen = np.empty(_CLASSES * _ROW, np.int64)
    count = np.empty(_CLASSES, np.int64)
    p, q = np.empty(n1), np.empty(n1)
    folded_p, folded_q = np.empty(table.shape[1]), np.empty(table.shape[1])
    ordinary = table[0]
    for begin in range(first, last, _TILE):
        n = min(_TILE, last - begin)
        for i in range(5 * _TILE):
            total[i] = 0.0
        for e in range(len(elements.start)):
            c, tx, ty = _sort(points, begin, n, elements, e, kernel.tol, kernel.side, tile, chosen, count)
            source, weights = elements.kind[e], table[elements.kind[e]]
            for k in range(n1):
                p[k] = factor * density[e, 0, k]
                q[k] = factor * density[e, 1, k]
            # As many multipoles as the nearest point of the series needs.
            nearest = 1
            while nearest < _CLASSES - 1 and count[nearest] == 0:
                nearest += 1
            _fold(p, q, weights, _TERMS[nearest - 1] + n1, folded_p, folded_q)
            along = both(splat(tx), splat(ty))
            turn = both(splat(tx), splat(-ty))
            turn = turn * turn
            for distance in range(_CLASSES):
                row = distance * _ROW
                for batch in range(row, row + count[distance], WIDTH):
                    y = gather(tile, 2 * _TILE, chosen, batch)
                    zp, zm = both(gather(tile, 0, chosen, batch), y), both(gather(tile, _TILE, chosen, batch), y)
                    if distance == 0 or (distance == 1 and highest <= 5):
                        sums = _near_sums(source, zp, zm, p, q, weights, force)
                    else:
                        sums = _far_sums(zp, zm, _TERMS[distance - 1] + order, folded_p, folded_q, force)
                    if force:
                        half, deviator, moved = _of_forces(sums, y, c, nu, p, q, ordinary)
                    else:
                        half, deviator, moved = _of_jumps(sums, y, c, nu)
                    deviator = deviator * turn
                    moved = moved * along
                    # Lanes with the same point write the same sum to the same place.
                    pile(total, 0, chosen, batch, half - re(deviator))
                    pile(total, _TILE, chosen, batch, half + re(deviator))
                    pile(total, 2 * _TILE, chosen, batch, im(deviator))
                    pile(total, 3 * _TILE, chosen, batch, re(moved))
                    pile(total, 4 * _TILE, chosen, batch, im(moved))
        for k in range(5):
            for i in range(n):
                out[k, begin + i] += total[k * _TILE + i]


def lanes_of(points: np.ndarray) -> np.ndarray:
    """``points`` (n, 2) in the layout of the kernels: all x, all y, each padded to whole lanes."""
    flat = np.zeros((2, len(points) + WIDTH))
    flat[:, : len(points)] = points.T
    return flat.ravel()
