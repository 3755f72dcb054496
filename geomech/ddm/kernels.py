"""Influence of straight elements, in closed form near and by series far: everything that is compiled for statics.

With t on the element, w(t) its weight (`shapes`) and ζ the field point in half lengths c about the middle, all fields
of an element follow from the Cauchy moments and their derivatives

    A_k(ζ) = ∫ w(t) t^k / (ζ − t) dt,   A_k = ζ A_{k−1} − m_{k−1},   m_j = ∫ w t^j dt,

because G' = A, G'' = A'/c, G''' = A''/c² for G(z) = ∫ N log(z − t) dt (Crouch & Starfield 1983, ch. 5). The
recurrence runs upwards near the element; far away it would lose |ζ|^(k+1) in digits, so there A_p comes from its series
in 1/ζ and the same recurrence runs downwards, where it is stable.

Densities are jumps u⁺ − u⁻ times 2μ (so a crack's slip and opening, a boundary's own displacement when the rock lies
on the left) and line forces. A point on the element's line is seen from the side that the sign of y (±0.0 included)
tells.

Points are sorted by distance, element by element, and taken eight of a class at a time (`lanes`): a pair's value is that
of its lane, whatever stands beside it, so it does not depend on what else is asked for, nor on threads.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .lanes import WIDTH, angle, gather, less, load, log, root, scatter, signed, size, splat, store
from .shapes import MAX_ORDER

#: |ζ| from which each class of distance reaches, and the terms its series needs. Below the first is the closed form of
#: orders above 5, below the second that of orders up to 5: upward steps lose a factor |ζ| each, six at 2.2 two digits,
#: and so do eleven at 1.5. The terms left out are below 1e-17 of the first.
_REACH = np.array([1.5, 2.2, 2.6, 3.2, 4.2, 6.0, 9.0, 15.0, 30.0, 100.0, 1e3, 1e5])


def _terms(reach: float) -> int:
    n = 1
    # The second derivative's coefficients grow as j²/2, the moments fall as 1/j.
    while 0.5 * (n + 2) * reach**-n > 1e-17:
        n += 1
    return n + n % 2


_TERMS = np.array([_terms(r) for r in _REACH])
_REACH_SQUARED = _REACH**2
_CLASSES = len(_REACH) + 1

#: Points sorted at a time.
_TILE = 256
_ROW = _TILE + WIDTH
_SLOT = (MAX_ORDER + 2) * WIDTH

_jit = njit(cache=True, fastmath=False, error_model="numpy", nogil=True)


@_jit
def _square_root(re, im):
    """The principal root, above or below its cut by the sign of ``im``."""
    r = root(re * re + im * im)
    large = root(0.5 * (r + size(re)))
    small = 0.5 * size(im) / large
    return less(re, 0.0, small, large), signed(less(re, 0.0, large, small), im)


@_jit
def _tip_moment(xp, xm, y):
    """A_0, A_0', A_0'' of √((1+t)/2): with s = (1+ζ)/2 and v = √s, A_0 = v log((v+1)/(v−1)) − 2."""
    sr, s1r, si = 0.5 * xp, 0.5 * xm, 0.5 * y
    vr, vi = _square_root(sr, si)
    ss = sr * sr + si * si
    far = s1r * s1r + si * si
    r = root(ss)
    # |v|² − 1 and |v − 1| written through s − 1, which is known to full relative accuracy near the far end.
    below = (s1r * (sr + 1.0) + si * si) / (r + 1.0)
    up = (vr + 1.0) * (vr + 1.0) + vi * vi
    lr, li = 0.5 * log(up * up / far), angle(-2.0 * vi, below)
    # 1/(s − 1), 1/s and λ/v.
    er, ei = s1r / far, -si / far
    fr, fi = sr / ss, -si / ss
    gr, gi = (lr * vr + li * vi) / r, (li * vr - lr * vi) / r
    ar, ai = vr * lr - vi * li - 2.0, vr * li + vi * lr
    br, bi = 0.25 * gr - 0.5 * er, 0.25 * gi - 0.5 * ei
    # −λ/(4sv) − 1/(2s(s−1)) + 1/(s−1)², gathered by 1/s.
    hr, hi = 0.25 * gr + 0.5 * er, 0.25 * gi + 0.5 * ei
    dr = 0.25 * (er * er - ei * ei - (hr * fr - hi * fi))
    di = 0.25 * (2.0 * er * ei - (hr * fi + hi * fr))
    return ar, ai, br, bi, dr, di


@_jit
def _first_moment(kind, xp, xm, y):
    """A_0, A_0', A_0'' in closed form."""
    if kind == 0:
        rp, rm = xp * xp + y * y, xm * xm + y * y
        pr, pi, mr, mi = xp / rp, -y / rp, xm / rm, -y / rm
        ar, ai = 0.5 * log(rp / rm), angle(-2.0 * y, xp * xm + y * y)
        br, bi = -2.0 * (pr * mr - pi * mi), -2.0 * (pr * mi + pi * mr)
        dr, di = mr * mr - mi * mi - (pr * pr - pi * pi), 2.0 * (mr * mi - pr * pi)
    elif kind == 3:
        r1, i1 = _square_root(xm, y)
        r2, i2 = _square_root(xp, y)
        rr, ri = r1 * r2 - i1 * i2, r1 * i2 + i1 * r2
        square = rr * rr + ri * ri
        er, ei = rr / square, -ri / square
        x = 0.5 * (xp + xm)
        ar, ai = np.pi * (x - rr), np.pi * (y - ri)
        br, bi = np.pi * (1.0 - (x * er - y * ei)), -np.pi * (x * ei + y * er)
        tr, ti = er * er - ei * ei, 2.0 * er * ei
        dr, di = np.pi * (tr * er - ti * ei), np.pi * (tr * ei + ti * er)
    else:
        # A tip at the end is the mirror image: A(ζ) = −A_start(−ζ).
        turn = 1.0 if kind == 1 else -1.0
        if kind == 1:
            ar, ai, br, bi, dr, di = _tip_moment(xp, xm, y)
        else:
            ar, ai, br, bi, dr, di = _tip_moment(-xm, -xp, -y)
        ar, ai, dr, di = turn * ar, turn * ai, turn * dr, turn * di
    return ar, ai, br, bi, dr, di


@_jit
def _moments(kind, distance, xp, xm, y, order, table, w):
    """A_k, A_k', A_k'' (real, imaginary) for k = 0 … order, eight points of one class, into six slots of ``w``."""
    x = 0.5 * (xp + xm)
    if distance == 0 or (distance == 1 and order <= 5):
        ar, ai, br, bi, dr, di = _first_moment(kind, xp, xm, y)
        for k in range(order + 1):
            at = k * WIDTH
            store(w, at, ar)
            store(w, at + _SLOT, ai)
            store(w, at + 2 * _SLOT, br)
            store(w, at + 3 * _SLOT, bi)
            store(w, at + 4 * _SLOT, dr)
            store(w, at + 5 * _SLOT, di)
            dr, di = 2.0 * br + (x * dr - y * di), 2.0 * bi + (x * di + y * dr)
            br, bi = ar + (x * br - y * bi), ai + (x * bi + y * br)
            ar, ai = x * ar - y * ai - table[kind, k], x * ai + y * ar
        return
    rr = x * x + y * y
    er, ei = x / rr, -y / rr
    n = _TERMS[distance - 1]
    first, step = 0, 1
    qr, qq = er, 1.0 / rr
    qi = ei
    if kind == 0 or kind == 3:
        # Odd moments vanish.
        first, step = order % 2, 2
        qr, qi, qq = er * er - ei * ei, 2.0 * er * ei, qq * qq
        n = first + n
    # Real coefficients at a complex q (Knuth 1981, §4.6.4): b_j = c_j + 2 Re q b_{j+1} − |q|² b_{j+2}.
    u = 2.0 * qr
    s0, s1, s2, t0, t1, t2 = splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    for j in range(n, first - 1, -step):
        m = table[kind, order + j]
        s0, t0 = (u * s0 + m) - qq * t0, s0
        s1, t1 = (u * s1 + m * (j + 1.0)) - qq * t1, s1
        s2, t2 = (u * s2 + m * ((j + 1.0) * (j + 2.0))) - qq * t2, s2
    lr, li = er, ei
    if first == 1:
        lr, li = er * er - ei * ei, 2.0 * er * ei
    pr, pi = s0 - qr * t0, qi * t0
    ar, ai = pr * lr - pi * li, pr * li + pi * lr
    lr, li = -(lr * er - li * ei), -(lr * ei + li * er)
    pr, pi = s1 - qr * t1, qi * t1
    br, bi = pr * lr - pi * li, pr * li + pi * lr
    lr, li = -(lr * er - li * ei), -(lr * ei + li * er)
    pr, pi = s2 - qr * t2, qi * t2
    dr, di = pr * lr - pi * li, pr * li + pi * lr
    for k in range(order, -1, -1):
        at = k * WIDTH
        store(w, at, ar)
        store(w, at + _SLOT, ai)
        store(w, at + 2 * _SLOT, br)
        store(w, at + 3 * _SLOT, bi)
        store(w, at + 4 * _SLOT, dr)
        store(w, at + 5 * _SLOT, di)
        if k > 0:
            m = table[kind, k - 1]
            ar, ai = (ar + m) * er - ai * ei, (ar + m) * ei + ai * er
            br, bi = (br - ar) * er - (bi - ai) * ei, (br - ar) * ei + (bi - ai) * er
            dr, di = (dr - 2.0 * br) * er - (di - 2.0 * bi) * ei, (dr - 2.0 * br) * ei + (di - 2.0 * bi) * er


@_jit
def moments(kind, xp, xm, y, order, table, a, b, d):
    """A_k, A_k', A_k'' for k = 0 … order into ``a``, ``b``, ``d`` (n, order+1) at ζ + 1 = xp + iy, ζ − 1 = xm + iy,
    (n,) each."""
    w = np.empty(6 * _SLOT)
    for i in range(len(y)):
        x = 0.5 * (xp[i] + xm[i])
        distance = np.searchsorted(_REACH_SQUARED, x * x + y[i] * y[i], side="right")
        _moments(kind, distance, splat(xp[i]), splat(xm[i]), splat(y[i]), order, table, w)
        for k in range(order + 1):
            at = k * WIDTH
            a[i, k] = complex(w[at], w[at + _SLOT])
            b[i, k] = complex(w[at + 2 * _SLOT], w[at + 3 * _SLOT])
            d[i, k] = complex(w[at + 4 * _SLOT], w[at + 5 * _SLOT])


@_jit
def _sort(points, first, n, sx, sy, ex, ey, tol, side, tile, chosen, count):
    """Points ``first`` … + n in the element's frame, lengths in half lengths c, sorted by distance.

    ``points`` x … y … flat, each padded to whole lanes; ``tile``: x + 1, x − 1, y (``_TILE`` each, a fourth is scratch);
    ``chosen`` (_CLASSES rows of _ROW) the points of a class, ``count`` of them, the last repeated so that it fills lanes.
    Returns (c, tx, ty).

    A point within ``tol`` of the open element is put on it, on the given side; one that meets an end is moved off by
    1e-14 along the normal, so that what is infinite there stays finite.
    """
    lx, ly = ex - sx, ey - sy
    length = np.sqrt(lx * lx + ly * ly)
    tx, ty = lx / length, ly / length
    c = 0.5 * length
    below = len(points) // 2
    for i in range(0, n, WIDTH):
        px, py = load(points, first + i), load(points, first + i + below)
        ax, ay, bx, by = px - sx, py - sy, px - ex, py - ey
        xp, xm = ax * tx + ay * ty, bx * tx + by * ty
        # From the nearer end, so that y keeps its digits close to either.
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
    count[:] = 0
    for i in range(n):
        rr = tile[3 * _TILE + i]
        k = 0
        while k < _CLASSES - 1 and rr >= _REACH_SQUARED[k]:
            k += 1
        chosen[k * _ROW + count[k]] = i
        count[k] += 1
    for k in range(_CLASSES):
        if count[k]:
            at = k * _ROW + count[k]
            chosen[at : at + WIDTH] = chosen[at - 1]
    return c, tx, ty


@_jit
def tractions(points, tangents, per, first, last, start, end, kind, order, nu, tol, side, force, table, nodal, out):
    """Traction (along the tangent, along the normal left of it) at points from unit densities.

    ``points``, ``tangents`` flat (`lanes_of`), ``per`` of the points an element; those from ``first`` to ``last`` are
    done. Sources: ``start``, ``end`` (m, 2), ``kind`` (m,). ``nodal`` (4, p+1, p+1) turns the monomials of each kind into
    unknowns. ``out`` flat, (2(p+1)m, 2n): rows run element, component (along, normal), unknown; columns element, component,
    node. ``force``: line forces instead of jumps.
    """
    n1 = order + 1
    w = np.empty(6 * _SLOT)
    parts = np.empty(4 * _SLOT)
    tile = np.empty(4 * _TILE)
    chosen = np.empty(_CLASSES * _ROW, np.int64)
    count = np.empty(_CLASSES, np.int64)
    places = np.empty(_TILE, np.int64)
    lane_places = np.empty(WIDTH, np.int64)
    below = len(tangents) // 2
    height = len(out) // (2 * n1 * len(start))
    factor = 1.0 / (4.0 * np.pi * (1.0 - nu))
    for begin in range(first, last, _TILE):
        n = min(_TILE, last - begin)
        for i in range(n):
            places[i] = (begin + i) // per * per + begin + i
        for e in range(len(start)):
            c, tx, ty = _sort(
                points, begin, n, start[e, 0], start[e, 1], end[e, 0], end[e, 1], tol, side, tile, chosen, count
            )
            source = kind[e]
            for distance in range(_CLASSES):
                row = distance * _ROW
                for batch in range(row, row + count[distance], WIDTH):
                    xp, xm = gather(tile, 0, chosen, batch), gather(tile, _TILE, chosen, batch)
                    y = gather(tile, 2 * _TILE, chosen, batch)
                    _moments(source, distance, xp, xm, y, order, table, w)
                    ux, uy = gather(tangents, begin, chosen, batch), gather(tangents, begin + below, chosen, batch)
                    cd, sd = ux * tx + uy * ty, uy * tx - ux * ty
                    c2, s2 = cd * cd - sd * sd, 2.0 * sd * cd
                    if force:
                        # Half the trace, half the deviator (σyy − σxx)/2 and the shear in the element's frame, each
                        # direction.
                        for k in range(n1):
                            at = k * WIDTH
                            g, h = -factor * load(w, at), -factor * load(w, at + _SLOT)
                            ya, yb = -factor * y * load(w, at + 2 * _SLOT), -factor * y * load(w, at + 3 * _SLOT)
                            dx, qx = yb - 2.0 * (1.0 - nu) * g, -2.0 * (1.0 - nu) * h - ya
                            dy, qy = ya - (1.0 - 2.0 * nu) * h, (1.0 - 2.0 * nu) * g + yb
                            store(parts, at, dx * s2 + qx * c2)
                            store(parts, at + _SLOT, dy * s2 + qy * c2)
                            store(parts, at + 2 * _SLOT, g + (dx * c2 - qx * s2))
                            store(parts, at + 3 * _SLOT, (dy * c2 - qy * s2) - h)
                    else:
                        f2 = factor / c
                        f3 = f2 * y
                        for k in range(n1):
                            at = k * WIDTH
                            ra, rb = f2 * load(w, at + 2 * _SLOT), f2 * load(w, at + 3 * _SLOT)
                            yc, yd = f3 * load(w, at + 4 * _SLOT), f3 * load(w, at + 5 * _SLOT)
                            dx, qx = rb + yc, yd - ra
                            store(parts, at, dx * s2 + qx * c2)
                            store(parts, at + _SLOT, yc * c2 - yd * s2)
                            store(parts, at + 2 * _SLOT, dx * c2 - qx * s2 - rb)
                            store(parts, at + 3 * _SLOT, -ra - yd * c2 - yc * s2)
                    for k in range(WIDTH):
                        lane_places[k] = places[chosen[batch + k]]
                    for j in range(n1):
                        o0, o1, o2, o3 = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
                        for k in range(n1):
                            at = k * WIDTH
                            t = nodal[source, k, j]
                            o0 = o0 + t * load(parts, at)
                            o1 = o1 + t * load(parts, at + _SLOT)
                            o2 = o2 + t * load(parts, at + 2 * _SLOT)
                            o3 = o3 + t * load(parts, at + 3 * _SLOT)
                        # Lanes that repeat a point write the same number to the same place.
                        along, normal = (2 * e * n1 + j) * height, (2 * e * n1 + n1 + j) * height
                        scatter(out, along, lane_places, 0, o0)
                        scatter(out, normal, lane_places, 0, o1)
                        scatter(out, along + per, lane_places, 0, o2)
                        scatter(out, normal + per, lane_places, 0, o3)


@_jit
def fields(points, first, last, start, end, kind, order, density, nu, tol, side, force, table, out):
    """Add stress (xx, yy, xy) and 2μ times displacement (x, y) of elements with monomial densities (m, 2, p+1), local
    components, to ``out`` (5, n) at ``points`` (flat, `lanes_of`). Line forces (``force``) are on ordinary elements
    only."""
    n1 = order + 1
    highest = order + 1 if force else order
    factor = 1.0 / (4.0 * np.pi * (1.0 - nu))
    if force:
        factor = -factor
    tile = np.empty(4 * _TILE)
    total = np.empty(5 * _TILE)
    chosen = np.empty(_CLASSES * _ROW, np.int64)
    count = np.empty(_CLASSES, np.int64)
    p, q = np.zeros(MAX_ORDER + 1), np.zeros(MAX_ORDER + 1)
    folded_p, folded_q = np.empty(len(table[0])), np.empty(len(table[0]))
    for begin in range(first, last, _TILE):
        n = min(_TILE, last - begin)
        total[:] = 0.0
        for e in range(len(start)):
            c, tx, ty = _sort(
                points, begin, n, start[e, 0], start[e, 1], end[e, 0], end[e, 1], tol, side, tile, chosen, count
            )
            source = kind[e]
            for k in range(n1):
                p[k], q[k] = factor * density[e, 0, k], factor * density[e, 1, k]
            # The element's own multipoles, as many as its nearest points by series ask for.
            for distance in range(1, _CLASSES):
                if count[distance]:
                    for j in range(_TERMS[distance - 1] + n1):
                        one, two = 0.0, 0.0
                        for k in range(n1):
                            one += p[k] * table[source, j + k]
                            two += q[k] * table[source, j + k]
                        folded_p[j], folded_q[j] = one, two
                    break
            c2, s2 = tx * tx - ty * ty, 2.0 * tx * ty
            for distance in range(_CLASSES):
                row = distance * _ROW
                for batch in range(row, row + count[distance], WIDTH):
                    xp, xm = gather(tile, 0, chosen, batch), gather(tile, _TILE, chosen, batch)
                    y = gather(tile, 2 * _TILE, chosen, batch)
                    x = 0.5 * (xp + xm)
                    # Sums over p and q of the moments, their derivatives and the logarithms.
                    apr, api, aqr, aqi = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
                    bpr, bpi, bqr, bqi = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
                    dpr, dpi, dqr, dqi = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
                    log_p, log_q = splat(0.0), splat(0.0)
                    if distance == 0 or (distance == 1 and highest <= 5):
                        ar, ai, br, bi, dr, di = _first_moment(source, xp, xm, y)
                        if force:
                            at_end, at_start = 0.5 * log(xm * xm + y * y), 0.5 * log(xp * xp + y * y)
                        for k in range(n1):
                            one, two = p[k], q[k]
                            apr, api, aqr, aqi = apr + one * ar, api + one * ai, aqr + two * ar, aqi + two * ai
                            bpr, bpi, bqr, bqi = bpr + one * br, bpi + one * bi, bqr + two * br, bqi + two * bi
                            dpr, dpi, dqr, dqi = dpr + one * dr, dpi + one * di, dqr + two * dr, dqi + two * di
                            dr, di = 2.0 * br + (x * dr - y * di), 2.0 * bi + (x * di + y * dr)
                            br, bi = ar + (x * br - y * bi), ai + (x * bi + y * br)
                            ar, ai = x * ar - y * ai - table[source, k], x * ai + y * ar
                            if force:
                                # ∫ t^k log|ζ − t| dt by parts.
                                value = (at_end + ar) + at_start if k % 2 == 0 else (at_end + ar) - at_start
                                log_p = log_p + (one / (k + 1.0)) * value
                                log_q = log_q + (two / (k + 1.0)) * value
                    else:
                        rr = x * x + y * y
                        er, ei = x / rr, -y / rr
                        u, v = 2.0 * er, 1.0 / rr
                        if force:
                            for j in range(_TERMS[distance - 1] + order, 0, -1):
                                log_p, dpr = (u * log_p + folded_p[j] / j) - v * dpr, log_p
                                log_q, dqr = (u * log_q + folded_q[j] / j) - v * dqr, log_q
                            far = 0.5 * log(rr)
                            log_p = folded_p[0] * far - (er * log_p - v * dpr)
                            log_q = folded_q[0] * far - (er * log_q - v * dqr)
                            dpr, dqr = splat(0.0), splat(0.0)
                        # As in `_moments`; the imaginary parts hold b_{j+1} for the while.
                        for j in range(_TERMS[distance - 1] + order, -1, -1):
                            one, two = folded_p[j], folded_q[j]
                            apr, api = (u * apr + one) - v * api, apr
                            aqr, aqi = (u * aqr + two) - v * aqi, aqr
                            one, two = one * (j + 1.0), two * (j + 1.0)
                            bpr, bpi = (u * bpr + one) - v * bpi, bpr
                            bqr, bqi = (u * bqr + two) - v * bqi, bqr
                            one, two = one * (j + 2.0), two * (j + 2.0)
                            dpr, dpi = (u * dpr + one) - v * dpi, dpr
                            dqr, dqi = (u * dqr + two) - v * dqi, dqr
                        fr, fi = -(er * er - ei * ei), -2.0 * er * ei
                        hr, hi = -(er * fr - ei * fi), -(er * fi + ei * fr)
                        apr, api = apr - er * api, ei * api
                        aqr, aqi = aqr - er * aqi, ei * aqi
                        bpr, bpi = bpr - er * bpi, ei * bpi
                        bqr, bqi = bqr - er * bqi, ei * bqi
                        dpr, dpi = dpr - er * dpi, ei * dpi
                        dqr, dqi = dqr - er * dqi, ei * dqi
                        apr, api = apr * er - api * ei, apr * ei + api * er
                        aqr, aqi = aqr * er - aqi * ei, aqr * ei + aqi * er
                        bpr, bpi = bpr * fr - bpi * fi, bpr * fi + bpi * fr
                        bqr, bqi = bqr * fr - bqi * fi, bqr * fi + bqi * fr
                        dpr, dpi = dpr * hr - dpi * hi, dpr * hi + dpi * hr
                        dqr, dqi = dqr * hr - dqi * hi, dqr * hi + dqi * hr
                    if force:
                        sum_p, sum_q = 0.0, 0.0
                        for k in range(n1):
                            sum_p += p[k] * table[0, k]
                            sum_q += q[k] * table[0, k]
                        half = apr - aqi
                        dev = y * (bpi + bqr) - 2.0 * (1.0 - nu) * apr - (1.0 - 2.0 * nu) * aqi
                        shear = y * (bqi - bpr) - 2.0 * (1.0 - nu) * api + (1.0 - 2.0 * nu) * aqr
                        ux = (3.0 - 4.0 * nu) * (log_p + np.log(c) * sum_p) - y * (api + aqr)
                        uy = (3.0 - 4.0 * nu) * (log_q + np.log(c) * sum_q) + y * (aqi - apr)
                        ux, uy = c * ux, c * uy
                    else:
                        ratio = 1.0 / c
                        half = -ratio * (bpi + bqr)
                        dev = ratio * (bpi + y * (dpr - dqi))
                        shear = ratio * (y * (dpi + dqr) - bpr)
                        ux = y * (bqi - bpr) - 2.0 * (1.0 - nu) * api - (1.0 - 2.0 * nu) * aqr
                        uy = y * (bpi + bqr) + (1.0 - 2.0 * nu) * apr - 2.0 * (1.0 - nu) * aqi
                    turned = dev * c2 + shear * s2
                    # Lanes that repeat a point write the same sum to the same place.
                    at = gather(total, 0, chosen, batch)
                    scatter(total, 0, chosen, batch, at + (half - turned))
                    at = gather(total, _TILE, chosen, batch)
                    scatter(total, _TILE, chosen, batch, at + (half + turned))
                    at = gather(total, 2 * _TILE, chosen, batch)
                    scatter(total, 2 * _TILE, chosen, batch, at + (shear * c2 - dev * s2))
                    at = gather(total, 3 * _TILE, chosen, batch)
                    scatter(total, 3 * _TILE, chosen, batch, at + (ux * tx - uy * ty))
                    at = gather(total, 4 * _TILE, chosen, batch)
                    scatter(total, 4 * _TILE, chosen, batch, at + (ux * ty + uy * tx))
        for k in range(5):
            for i in range(n):
                out[k, begin + i] += total[k * _TILE + i]


def lanes_of(points: np.ndarray) -> np.ndarray:
    """``points`` (n, 2) as the kernels read them: all x, all y, each with room for whole lanes."""
    flat = np.zeros((2, len(points) + WIDTH))
    flat[:, : len(points)] = points.T
    return flat.ravel()
