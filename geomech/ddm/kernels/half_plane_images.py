"""Contribution of a free surface to the influence of straight elements (half-plane): closed forms and series. All
compiled.

The rock lies below the traction-free surface y = 0. With φ₀, ψ₀ the Kolosov potentials of a source in the infinite
plane, Muskhelishvili's continuation (1953, §§ 92–93) gives those of the contribution of the surface,

    φ₁(z) = −z φ̄₀'(z) − ψ̄₀(z),   ψ₁(z) = −φ̄₀(z) − z φ₁'(z),   φ̄(z) = conj φ(conj z),

    half the trace            2 Re φ₁'
    (σyy − σxx)/2 + i σxy     −2i y φ₁'' − φ₁' − φ̄₀'
    2μ (u_x + i u_y)          κ φ₁ − 2i y conj φ₁' + φ₀(conj z),   κ = 3 − 4ν.

The sources appear at their mirror images, so that everything follows from the moments A_k of `full_plane` at ζ, the
mirror image of the field point in the frame of the element. The depth of the source varies linearly along it, which
needs one order more, and the stress of a jump needs A'''. With E the conjugate of the element's tangent, s its slope, η
the depth of its midpoint in half lengths c and W = η A_k + s A_{k+1},

    slip       conj φ₁' = f/c (i/2 A' + E W''),            conj φ₁'' = f/c² (i/2 E A'' + E² W'''),   conj φ̄₀' = i f/2c A'
    opening    i times that, + f/c E² A',                  the same + f/c² E³ A'',                   i times that
    force      f/2 (2i E W' − κ E² A)                      f/2c (2i E² W'' − κ E³ A')                −f/2 A

along the element, and (iκE²A − 2EW') f/2, (iκE³A' − 2E²W'') f/2c, −i A f/2 across it; f = 1/4π(1−ν). No term exceeds
the sum by more than the ratio of the distances to source and image, so that the accuracy is that of the infinite plane.
"""

from __future__ import annotations

import numpy as np

from .full_plane import _CLASSES, _ROW, _TERMS, _TILE, _first_moment, _inlined, _jit, _part, _sort, nodal_sums
from .shape_functions import MAX_ORDER
from .simd import (
    WIDTH,
    angle,
    both,
    gather,
    im,
    load_complex,
    log,
    norm,
    pile,
    re,
    splat,
    store,
    term,
    times_i,
    value,
)

#: Offsets of A', A'', A''' and the next order behind A.
_B, _D, _T, _STEP = 2 * WIDTH, 4 * WIDTH, 6 * WIDTH, 8 * WIDTH
#: One order more than that of the density.
_ROOM = (MAX_ORDER + 2) * _STEP


@_part
def _third(kind, zp, zm, b, d):
    """A_0''' from A_0' and A_0'', by differentiation of the closed forms of `full_plane`."""
    if kind == 3:
        z, gap = 0.5 * (zp + zm), zp * zm
        # A_0'' = π (ζ² − 1)^(−3/2).
        return -3.0 * (z * d) / gap
    s, s1 = 0.5 * zp, 0.5 * zm
    if kind == 2:
        s, s1, d = -s1, -s, -d
    i1 = 1.0 / s1
    if kind == 0:
        i = 1.0 / s
        return 0.25 * (i * i * i - i1 * i1 * i1)
    return (0.25 * (i1 * i1) - 0.75 * d) / s - 0.25 * (i1 * i1 * i1)


@_part
def _moments(kind, distance, zp, zm, highest, table, w):
    """A_k and three derivatives for k = 0 … highest at eight points of one distance class, into ``w``, ``_STEP``
    numbers per order."""
    z = 0.5 * (zp + zm)
    if distance == 0 or (distance == 1 and highest <= 5):
        a, b, d = _first_moment(kind, zp, zm)
        t = _third(kind, zp, zm, b, d)
        for k in range(highest + 1):
            store(w, k * _STEP, a)
            store(w, k * _STEP + _B, b)
            store(w, k * _STEP + _D, d)
            store(w, k * _STEP + _T, t)
            t = 3.0 * d + z * t
            d = 2.0 * b + z * d
            b = a + z * b
            a = z * a - table[kind, k]
        return
    i = 1.0 / z
    n = _TERMS[distance - 1]
    # Odd moments vanish for even weights.
    first, step, q, lead = 0, 1, i, i
    if kind == 0 or kind == 3:
        first, step, q = highest % 2, 2, i * i
        n = first + n
        if first == 1:
            lead = q
    u, v = 2.0 * re(q), norm(q)
    zero = both(splat(0.0), splat(0.0))
    a, b, d, t = zero, zero, zero, zero
    for j in range(n, first - 1, -step):
        m = table[kind, highest + j]
        a = term(a, u, v, m)
        m *= j + 1.0
        b = term(b, u, v, m)
        m *= j + 2.0
        d = term(d, u, v, m)
        t = term(t, u, v, m * (j + 3.0))
    a = value(a, q) * lead
    lead = lead * i
    b = -(value(b, q) * lead)
    lead = lead * i
    d = value(d, q) * lead
    t = -(value(t, q) * (lead * i))
    for k in range(highest, -1, -1):
        store(w, k * _STEP, a)
        store(w, k * _STEP + _B, b)
        store(w, k * _STEP + _D, d)
        store(w, k * _STEP + _T, t)
        if k > 0:
            a = (a + table[kind, k - 1]) * i
            b = (b - a) * i
            d = (d - 2.0 * b) * i
            t = (t - 3.0 * d) * i


@_inlined
def _force_tractions(w, n1, g, kappa, eta, ty, conj, turn, lift, parts):
    """Traction (normal + i tangential) of line forces along and across an element, into ``parts``."""
    conj2 = conj * conj
    conj3 = conj2 * conj
    for k in range(n1):
        at = k * _STEP
        a, b = load_complex(w, at), load_complex(w, at + _B)
        w1 = eta * b + ty * load_complex(w, at + _STEP + _B)
        w2 = eta * load_complex(w, at + _D) + ty * load_complex(w, at + _STEP + _D)
        ww, aa = 2.0 * (conj * w1), kappa * (conj2 * a)
        p, q = 2.0 * (conj2 * w2), kappa * (conj3 * b)
        half = times_i(ww) - aa
        whole = g * (lift * (times_i(p) - q) - turn * (half - a))
        store(parts, at, whole + (2.0 * g) * re(half))
        half = times_i(aa) - ww
        whole = g * (lift * (times_i(q) - p) - turn * (half - times_i(a)))
        store(parts, at + _B, whole + (2.0 * g) * re(half))


@_inlined
def _jump_tractions(w, n1, g, eta, ty, conj, turn, lift, parts):
    """Traction (normal + i tangential) of displacement jumps along and across an element."""
    conj2 = conj * conj
    conj3 = conj2 * conj
    for k in range(n1):
        at = k * _STEP
        b, d = load_complex(w, at + _B), load_complex(w, at + _D)
        w2 = eta * d + ty * load_complex(w, at + _STEP + _D)
        w3 = eta * load_complex(w, at + _T) + ty * load_complex(w, at + _STEP + _T)
        ib = 0.5 * times_i(b)
        half = ib + conj * w2
        bent = conj * (0.5 * times_i(d)) + conj2 * w3
        whole = g * (lift * bent - turn * (half + ib))
        store(parts, at, whole + (2.0 * g) * re(half))
        half, bent = times_i(half) + conj2 * b, times_i(bent) + conj3 * d
        whole = g * (lift * bent - turn * (half + times_i(ib)))
        store(parts, at + _B, whole + (2.0 * g) * re(half))


@_jit
def tractions(points, tangents, per, first, last, elements, order, kernel, table, nodal, out):
    """Add the contribution of the free surface y = 0 to `full_plane.tractions` in ``out``.

    ``points``: mirror images of the field points; other arguments as there; everything in the frame of the surface. An
    element on the surface (forces only) has the rock on its left, and the images of points on it on its right.
    """
    nu, n1 = kernel.nu, order + 1
    w, parts = np.empty(_ROOM), np.empty(_ROOM)
    tile = np.empty(4 * _TILE)
    chosen = np.empty(_CLASSES * _ROW, np.int64)
    count = np.empty(_CLASSES, np.int64)
    places = np.empty(_TILE, np.int64)
    lane_places = np.empty(WIDTH, np.int64)
    below, height_at = len(tangents) // 2, len(points) // 2
    height = len(out) // (2 * n1 * len(elements.start))
    f = 1.0 / (4.0 * np.pi * (1.0 - nu))
    kappa = 3.0 - 4.0 * nu
    for begin in range(first, last, _TILE):
        n = min(_TILE, last - begin)
        for i in range(n):
            places[i] = (begin + i) // per * per + begin + i
        for e in range(len(elements.start)):
            c, tx, ty = _sort(points, begin, n, elements, e, kernel.tol, -1.0, tile, chosen, count)
            eta = 0.5 * (elements.start[e, 1] + elements.end[e, 1]) / c
            source = elements.kind[e]
            conj = both(splat(tx), splat(-ty))
            for distance in range(_CLASSES):
                row = distance * _ROW
                for batch in range(row, row + count[distance], WIDTH):
                    y = gather(tile, 2 * _TILE, chosen, batch)
                    zp, zm = both(gather(tile, 0, chosen, batch), y), both(gather(tile, _TILE, chosen, batch), y)
                    _moments(source, distance, zp, zm, order + 1, table, w)
                    ux, uy = gather(tangents, begin, chosen, batch), gather(tangents, begin + below, chosen, batch)
                    turn = both(ux, -uy)
                    turn = turn * turn
                    # The y of the point is minus that of its image; 2i y φ'' c.
                    lift = times_i(turn) * ((-2.0 / c) * gather(points, begin + height_at, chosen, batch))
                    if kernel.force:
                        _force_tractions(w, n1, 0.5 * f, kappa, eta, ty, conj, turn, lift, parts)
                    else:
                        _jump_tractions(w, n1, f / c, eta, ty, conj, turn, lift, parts)
                    for k in range(WIDTH):
                        lane_places[k] = places[chosen[batch + k]]
                    for j in range(n1):
                        along, normal = nodal_sums(parts, _STEP, nodal, source, j, n1)
                        at = (2 * e * n1 + j) * height
                        pile(out, at + per, lane_places, 0, re(along))
                        pile(out, at, lane_places, 0, -im(along))
                        at += n1 * height
                        pile(out, at + per, lane_places, 0, re(normal))
                        pile(out, at, lane_places, 0, -im(normal))


@_inlined
def _of_forces(w, density, half_f, kappa, eta, c, ty, own, conj, zm, moments):
    """conj φ₁', conj φ₁'', conj φ̄₀', and the displacement without its term in the depth, of line forces."""
    conj2 = conj * conj
    zero = both(splat(0.0), splat(0.0))
    half, bent, back, moved = zero, zero, zero, zero
    end_log = zm * own
    end_log = both(0.5 * log(norm(end_log)) + np.log(c), angle(im(end_log), re(end_log)))
    start_log = end_log + load_complex(w, 0)
    for k in range(density.shape[1]):
        at = k * _STEP
        a, b = load_complex(w, at), load_complex(w, at + _B)
        w0 = eta * a + ty * load_complex(w, at + _STEP)
        w1 = eta * b + ty * load_complex(w, at + _STEP + _B)
        w2 = eta * load_complex(w, at + _D) + ty * load_complex(w, at + _STEP + _D)
        x, z = half_f * density[0, k], half_f * density[1, k]
        # The force in its own frame and its conjugate.
        q, q_bar = both(splat(x), splat(z)), both(splat(x), splat(-z))
        half = half + 2.0 * times_i(conj * (q * w1)) - kappa * (conj2 * (q_bar * a))
        bent = bent + 2.0 * times_i(conj2 * (q * w2)) - kappa * (conj2 * (conj * (q_bar * b)))
        back = back - q * a
        # conj ∫ t^k log(z − conj t) dt by parts.
        logs = (load_complex(w, at + _STEP) + end_log + start_log) / (k + 1.0)
        start_log = -start_log
        turned = own * q
        logs = both(re(logs), -im(logs))
        w0 = both(re(w0), -im(w0))
        # κ (q̄ (m + Q) − κ q L) − q conj L, in half lengths; conj(own q) is the global q̄.
        flat = both(re(turned), -im(turned)) * (moments[k] - 2.0 * times_i(own * w0))
        moved = moved + kappa * flat - kappa * kappa * (turned * logs)
        moved = moved - turned * both(re(logs), -im(logs))
    return half, bent / c, back, c * moved


@_inlined
def _of_jumps(w, density, f, kappa, eta, c, ty, own, conj):
    """The same for displacement jumps."""
    conj2 = conj * conj
    zero = both(splat(0.0), splat(0.0))
    half, bent, back, moved = zero, zero, zero, zero
    for k in range(density.shape[1]):
        at = k * _STEP
        a, b, d = load_complex(w, at), load_complex(w, at + _B), load_complex(w, at + _D)
        w1 = eta * b + ty * load_complex(w, at + _STEP + _B)
        w2 = eta * d + ty * load_complex(w, at + _STEP + _D)
        w3 = eta * load_complex(w, at + _T) + ty * load_complex(w, at + _STEP + _T)
        x, z = f * density[0, k], f * density[1, k]
        # Slip + i opening, and i/2 of it.
        jump, h = both(splat(x), splat(z)), both(splat(-0.5 * z), splat(0.5 * x))
        half = half + h * b + jump * (conj * w2) + z * (conj2 * b)
        bent = bent + conj * (h * d) + jump * (conj2 * w3) + z * (conj2 * (conj * d))
        back = back + h * b
        mirrored = (h * own + z * conj) * a - 2.0 * times_i(h * w1)
        moved = moved + kappa * both(re(mirrored), -im(mirrored)) + h * (own * a)
    return half / c, bent / (c * c), back / c, moved


@_jit
def fields(points, first, last, elements, order, density, kernel, table, out):
    """Add the contribution of the free surface y = 0 to `full_plane.fields` in ``out`` (5, n); ``points``: mirror
    images."""
    nu = kernel.nu
    w = np.empty(_ROOM)
    tile = np.empty(4 * _TILE)
    total = np.empty(5 * _TILE)
    chosen = np.empty(_CLASSES * _ROW, np.int64)
    count = np.empty(_CLASSES, np.int64)
    height_at = len(points) // 2
    f = 1.0 / (4.0 * np.pi * (1.0 - nu))
    kappa = 3.0 - 4.0 * nu
    ordinary = table[0]
    for begin in range(first, last, _TILE):
        n = min(_TILE, last - begin)
        for i in range(5 * _TILE):
            total[i] = 0.0
        for e in range(len(elements.start)):
            c, tx, ty = _sort(points, begin, n, elements, e, kernel.tol, -1.0, tile, chosen, count)
            eta = 0.5 * (elements.start[e, 1] + elements.end[e, 1]) / c
            source = elements.kind[e]
            own, conj = both(splat(tx), splat(ty)), both(splat(tx), splat(-ty))
            of_element = density[e]
            for distance in range(_CLASSES):
                row = distance * _ROW
                for batch in range(row, row + count[distance], WIDTH):
                    y = gather(tile, 2 * _TILE, chosen, batch)
                    zp, zm = both(gather(tile, 0, chosen, batch), y), both(gather(tile, _TILE, chosen, batch), y)
                    _moments(source, distance, zp, zm, order + 1, table, w)
                    # The y of the point is minus that of its image.
                    depth = -gather(points, begin + height_at, chosen, batch)
                    if kernel.force:
                        half, bent, back, moved = _of_forces(
                            w, of_element, 0.5 * f, kappa, eta, c, ty, own, conj, zm, ordinary
                        )
                    else:
                        half, bent, back, moved = _of_jumps(w, of_element, f, kappa, eta, c, ty, own, conj)
                    moved = moved - 2.0 * times_i(depth * half)
                    deviator = 2.0 * times_i(depth * bent) - half - back
                    trace = 2.0 * re(half)
                    pile(total, 0, chosen, batch, trace - re(deviator))
                    pile(total, _TILE, chosen, batch, trace + re(deviator))
                    pile(total, 2 * _TILE, chosen, batch, -im(deviator))
                    pile(total, 3 * _TILE, chosen, batch, re(moved))
                    pile(total, 4 * _TILE, chosen, batch, im(moved))
        for k in range(5):
            for i in range(n):
                out[k, begin + i] += total[k * _TILE + i]
