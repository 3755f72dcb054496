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
"""

from __future__ import annotations

import numpy as np
from numba import njit

#: |ζ|² beyond which the series is used. Upward steps lose a factor |ζ| each: six steps at 2.2 half lengths lose two
#: digits, and so do eleven at 1.5, which the orders above 5 get.
FAR = 2.2**2
FAR_HIGH_ORDER = 1.5**2

_jit = njit(cache=True, fastmath=False, error_model="numpy", nogil=True)


@_jit
def _tip_moment(xp, xm, y):
    """A_0, A_0', A_0'' of √((1+t)/2): with s = (1+ζ)/2 and v = √s, A_0 = v log((v+1)/(v−1)) − 2."""
    s = complex(0.5 * xp, 0.5 * y)
    s1 = complex(0.5 * xm, 0.5 * y)
    size = abs(s)
    if s.real >= 0.0:
        vr = np.sqrt(0.5 * (size + s.real))
        vi = 0.5 * s.imag / vr
    else:
        vi = np.copysign(np.sqrt(0.5 * (size - s.real)), s.imag)
        vr = 0.5 * abs(s.imag) / abs(vi)
    v = complex(vr, vi)
    # |v|² − 1 and |v − 1| written through s − 1, which is known to full relative accuracy near the far end.
    below = (s1.real * (s.real + 1.0) + s.imag * s.imag) / (size + 1.0)
    up = (vr + 1.0) * (vr + 1.0) + vi * vi
    lam = complex(np.log(up / abs(s1)), np.arctan2(-2.0 * vi, below))
    i1 = 1.0 / s1
    i0 = 1.0 / s
    a = v * lam - 2.0
    b = 0.5 * (0.5 * lam / v - i1)
    d = 0.25 * (-0.25 * lam * i0 / v - 0.5 * i0 * i1 + i1 * i1)
    return a, b, d


@_jit
def _moments(kind, xp, xm, y, order, table, a, b, d):
    """A_k, A_k', A_k'' for k = 0 … order into ``a``, ``b``, ``d``; ζ + 1 = xp + iy, ζ − 1 = xm + iy."""
    x = 0.5 * (xp + xm)
    z = complex(x, y)
    rr = x * x + y * y
    if rr < FAR_HIGH_ORDER or (order <= 5 and rr < FAR):
        if kind == 0:
            rp = xp * xp + y * y
            rm = xm * xm + y * y
            ip = complex(xp / rp, -y / rp)
            im = complex(xm / rm, -y / rm)
            a[0] = complex(0.5 * np.log(rp / rm), np.arctan2(-2.0 * y, xp * xm + y * y))
            b[0] = -2.0 * ip * im
            d[0] = im * im - ip * ip
        elif kind == 1:
            a[0], b[0], d[0] = _tip_moment(xp, xm, y)
        elif kind == 2:
            # The mirror image: A(ζ) = −A_start(−ζ).
            a0, b0, d0 = _tip_moment(-xm, -xp, -y)
            a[0], b[0], d[0] = -a0, b0, -d0
        else:
            root = np.sqrt(complex(xm, y)) * np.sqrt(complex(xp, y))
            i = 1.0 / root
            a[0] = np.pi * (z - root)
            b[0] = np.pi * (1.0 - z * i)
            d[0] = np.pi * i * i * i
        for k in range(1, order + 1):
            a[k] = z * a[k - 1] - table[kind, k - 1]
            b[k] = a[k - 1] + z * b[k - 1]
            d[k] = 2.0 * b[k - 1] + z * d[k - 1]
        return
    # Terms left out are below 1e-17 of the first.
    if rr < FAR:
        n = 94
    elif rr < 9.0:
        n = 52
    elif rr < 25.0:
        n = 38
    elif rr < 100.0:
        n = 26
    elif rr < 1e4:
        n = 18
    else:
        n = 10
    inverse = complex(x / rr, -y / rr)
    first, step, q = 0, 1, inverse
    if kind == 0 or kind == 3:
        # Odd moments vanish.
        first, step, q = order % 2, 2, inverse * inverse
        n = first + (n // 2) * 2
    s0 = complex(0.0, 0.0)
    s1 = complex(0.0, 0.0)
    s2 = complex(0.0, 0.0)
    for j in range(n, first - 1, -step):
        m = table[kind, order + j]
        s0 = s0 * q + m
        s1 = s1 * q + m * (j + 1.0)
        s2 = s2 * q + m * ((j + 1.0) * (j + 2.0))
    lead = inverse
    if first == 1:
        lead = inverse * inverse
    a[order] = s0 * lead
    b[order] = -s1 * lead * inverse
    d[order] = s2 * lead * inverse * inverse
    for k in range(order, 0, -1):
        a[k - 1] = (a[k] + table[kind, k - 1]) * inverse
        b[k - 1] = (b[k] - a[k - 1]) * inverse
        d[k - 1] = (d[k] - 2.0 * b[k - 1]) * inverse


@_jit
def _log_moment(xp, xm, y, k, table, a):
    """∫ t^k log|ζ − t| dt of an ordinary element; ``a`` holds A up to k + 1."""
    x = 0.5 * (xp + xm)
    rr = x * x + y * y
    if rr < FAR:
        at_end = 0.5 * np.log(xm * xm + y * y)
        at_start = 0.5 * np.log(xp * xp + y * y)
        sign = 1.0 if k % 2 == 0 else -1.0
        return (at_end + sign * at_start + a[k + 1].real) / (k + 1.0)
    inverse = complex(x / rr, -y / rr)
    total = complex(0.0, 0.0)
    for j in range(54, 0, -1):
        total = (total + table[0, k + j] / j) * inverse
    return 0.5 * table[0, k] * np.log(rr) - total.real


@_jit
def _local(px, py, sx, sy, ex, ey, tol, side):
    """Field point in the element's frame: (xp, xm, y, c, tx, ty), lengths in half lengths c.

    A point within ``tol`` of the open element is put on it, on the given side; one that meets an end is moved off by
    1e-14 along the normal, so that what is infinite there stays finite.
    """
    lx, ly = ex - sx, ey - sy
    length = np.sqrt(lx * lx + ly * ly)
    tx, ty = lx / length, ly / length
    c = 0.5 * length
    ax, ay = px - sx, py - sy
    bx, by = px - ex, py - ey
    xp = ax * tx + ay * ty
    xm = bx * tx + by * ty
    # From the nearer end, so that y keeps its digits close to either.
    if abs(xp) < abs(xm):
        y = ay * tx - ax * ty
    else:
        y = by * tx - bx * ty
    if abs(y) <= tol and xp > 0.0 and xm < 0.0:
        y = np.copysign(0.0, side)
    xp, xm, y = xp / c, xm / c, y / c
    if min(abs(xp), abs(xm)) < 1e-14 and abs(y) < 1e-14:
        y = np.copysign(1e-14, side)
    return xp, xm, y, c, tx, ty


@_jit
def tractions(points, tangents, per, first, last, start, end, kind, order, nu, tol, side, force, table, out):
    """Traction (along the tangent, along the normal left of it) at points from unit monomial densities.

    ``points``, ``tangents`` (n, 2), ``per`` of them an element; those from ``first`` to ``last`` are done. Sources:
    ``start``, ``end`` (m, 2), ``kind`` (m,). ``out`` (2n, 2(p+1)m): rows run element, component, node; columns element,
    component (along, normal), k. ``force``: line forces instead of jumps.
    """
    n1 = order + 1
    a = np.empty(n1, np.complex128)
    b = np.empty(n1, np.complex128)
    d = np.empty(n1, np.complex128)
    factor = 1.0 / (4.0 * np.pi * (1.0 - nu))
    for i in range(first, last):
        row_t = (i // per) * 2 * per + i % per
        row_n = row_t + per
        for e in range(len(start)):
            xp, xm, y, c, tx, ty = _local(
                points[i, 0], points[i, 1], start[e, 0], start[e, 1], end[e, 0], end[e, 1], tol, side
            )
            _moments(kind[e], xp, xm, y, order, table, a, b, d)
            cd = tangents[i, 0] * tx + tangents[i, 1] * ty
            sd = tangents[i, 1] * tx - tangents[i, 0] * ty
            c2 = cd * cd - sd * sd
            s2 = 2.0 * sd * cd
            col = e * 2 * n1
            if force:
                # Half the trace, half the deviator (σyy − σxx)/2 and the shear in the element's frame, each direction.
                for k in range(n1):
                    g, h = -factor * a[k].real, -factor * a[k].imag
                    ya, yb = -factor * y * b[k].real, -factor * y * b[k].imag
                    dx, qx = yb - 2.0 * (1.0 - nu) * g, -2.0 * (1.0 - nu) * h - ya
                    dy, qy = ya - (1.0 - 2.0 * nu) * h, (1.0 - 2.0 * nu) * g + yb
                    out[row_t, col + k] = dx * s2 + qx * c2
                    out[row_n, col + k] = g + dx * c2 - qx * s2
                    out[row_t, col + n1 + k] = dy * s2 + qy * c2
                    out[row_n, col + n1 + k] = -h + dy * c2 - qy * s2
            else:
                f2 = factor / c
                f3 = f2 * y
                for k in range(n1):
                    ra, rb = f2 * b[k].real, f2 * b[k].imag
                    yc, yd = f3 * d[k].real, f3 * d[k].imag
                    dx, qx = rb + yc, yd - ra
                    out[row_t, col + k] = dx * s2 + qx * c2
                    out[row_n, col + k] = dx * c2 - qx * s2 - rb
                    out[row_t, col + n1 + k] = yc * c2 - yd * s2
                    out[row_n, col + n1 + k] = -ra - yd * c2 - yc * s2


@_jit
def fields(points, first, last, start, end, kind, order, density, nu, tol, side, force, table, stress, shift):
    """Add stress (n, 3) and 2μ times displacement (n, 2) of elements with monomial densities (m, 2, p+1), local
    components, at ``points``. Line forces (``force``) are on ordinary elements only."""
    n1 = order + 1
    a = np.empty(n1 + 1, np.complex128)
    b = np.empty(n1 + 1, np.complex128)
    d = np.empty(n1 + 1, np.complex128)
    factor = 1.0 / (4.0 * np.pi * (1.0 - nu))
    for i in range(first, last):
        for e in range(len(start)):
            xp, xm, y, c, tx, ty = _local(
                points[i, 0], points[i, 1], start[e, 0], start[e, 1], end[e, 0], end[e, 1], tol, side
            )
            _moments(kind[e], xp, xm, y, order + 1 if force else order, table, a, b, d)
            half, dev, shear, ux, uy = 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(n1):
                p, q = density[e, 0, k], density[e, 1, k]
                g, h = a[k].real, a[k].imag
                ya, yb = y * b[k].real, y * b[k].imag
                if force:
                    # f = −F/(4π(1−ν)), its sign taken into p and q.
                    p, q = -factor * p, -factor * q
                    log = c * (_log_moment(xp, xm, y, k, table, a) + np.log(c) * table[0, k])
                    half += p * g - q * h
                    dev += p * (yb - 2.0 * (1.0 - nu) * g) + q * (ya - (1.0 - 2.0 * nu) * h)
                    shear += p * (-2.0 * (1.0 - nu) * h - ya) + q * ((1.0 - 2.0 * nu) * g + yb)
                    cy = c * y
                    ux += p * ((3.0 - 4.0 * nu) * log - cy * h) - q * cy * g
                    uy += q * ((3.0 - 4.0 * nu) * log + cy * h) - p * cy * g
                else:
                    p, q = factor * p, factor * q
                    ra, rb = b[k].real / c, b[k].imag / c
                    yc, yd = y * d[k].real / c, y * d[k].imag / c
                    half -= p * rb + q * ra
                    dev += p * (rb + yc) - q * yd
                    shear += p * (yd - ra) + q * yc
                    ux += p * (-2.0 * (1.0 - nu) * h - ya) + q * (-(1.0 - 2.0 * nu) * g + yb)
                    uy += p * ((1.0 - 2.0 * nu) * g + yb) + q * (-2.0 * (1.0 - nu) * h + ya)
            c2 = tx * tx - ty * ty
            s2 = 2.0 * tx * ty
            turned = dev * c2 + shear * s2
            stress[i, 0] += half - turned
            stress[i, 1] += half + turned
            stress[i, 2] += shear * c2 - dev * s2
            shift[i, 0] += ux * tx - uy * ty
            shift[i, 1] += ux * ty + uy * tx
