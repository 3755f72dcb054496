"""Element kernels against mpmath quadrature of the defining integrals, near, far and on the element."""

import mpmath as mp
import numpy as np
import pytest

from geomech.ddm.kernels import full_plane, shape_functions

WEIGHTS = {
    shape_functions.ORDINARY: lambda t: mp.mpf(1),
    shape_functions.TIP_START: lambda t: mp.sqrt((1 + t) / 2),
    shape_functions.TIP_END: lambda t: mp.sqrt((1 - t) / 2),
    shape_functions.TIP_BOTH: lambda t: mp.sqrt((1 - t) * (1 + t)),
}


def cauchy(kind, order, zp, zm, y):
    a, b, d = (np.empty((1, order + 1), complex) for _ in range(3))
    full_plane.moments(kind, *(np.array([v]) for v in (zp, zm, y)), order, shape_functions.moments(), a, b, d)
    return a[0], b[0], d[0]


def exact(kind, k, z, side):
    """A_k, A_k', A_k'' by Gauss quadrature in 30 digits on a contour bent away from z (on the side z is seen from)."""
    with mp.workdps(30):
        # The path from −1 to 1 passes below a point above; the integrand is analytic in between.
        mid = mp.mpc(0, -side if side else 0)
        w = WEIGHTS[kind]
        out = []
        for n, factor in ((1, 1), (2, -1), (3, 2)):

            def integrand(t, n=n):
                return w(t) * t**k / (z - t) ** n

            # Both thirds leave the ends slantwise, so that points beside an end stay off the path.
            out.append(complex(factor * mp.quad(integrand, [-1, mid, 1])))
        return out


POINTS = [
    (0.3, 1e-12), (0.3, 1e-3), (-0.7, 0.2), (0.1, 1.3), (2.0, 0.05), (-1.7, -1.6), (2.4, 0.3), (0.2, -3.1), (6.0, 5.0),
    (-40.0, 9.0), (900.0, -1e3), (2e6, 1e6),
]  # fmt: skip


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("kind", WEIGHTS)
def test_moments_hold_ten_digits_from_touching_to_a_million_lengths(kind):
    """1e-10 of each moment, the accuracy that the far series is cut for; p = 12 is the highest order there is."""
    for x, y in POINTS:
        a, b, d = cauchy(kind, 12, x + 1.0, x - 1.0, y)
        for k in (1, 4, 12):
            ref = exact(kind, k, mp.mpc(x, y), float(np.sign(y)))
            got = (a[k], b[k], d[k])
            for one, other in zip(got, ref):
                assert abs(one - other) <= 1e-10 * abs(other), (kind, x, y, k, one, other)


def closed_form(kind, q):
    """A_0(q) of an ordinary element, a tip at the start (or its mirror image), tips at both ends."""
    if kind == shape_functions.ORDINARY:
        return mp.log((q + 1) / (q - 1))
    if kind == shape_functions.TIP_BOTH:
        return mp.pi * (q - mp.sqrt(q - 1) * mp.sqrt(q + 1))
    v = mp.sqrt((1 + q) / 2)
    return v * mp.log((v + 1) / (v - 1)) - 2


@pytest.mark.parametrize("kind", WEIGHTS)
@pytest.mark.parametrize("end", [-1, 1])
def test_moments_close_to_an_end(kind, end):
    """At 1e-12 half lengths from an end the distance itself must not be lost: the leading term is compared."""
    for dx, dy in ((1e-12, 0.0), (7e-13, 7e-13), (0.0, -1e-12), (-3e-9, 2e-9)):
        zp, zm = (dx, dx - 2) if end < 0 else (2 + dx, dx)
        a, b, _ = cauchy(kind, 3, zp, zm, dy)
        with mp.workdps(60):
            z = mp.mpc(mp.mpf(end) + mp.mpf(dx), dy)
            # The mirror image of a tip at the start is one at the end: A(ζ) = −A_start(−ζ).
            mirror = -1 if kind == shape_functions.TIP_END else 1
            h = mp.mpf(10) ** -30
            above, here, below = (closed_form(kind, mirror * z + dz) for dz in (h, 0, -h))
            ref = (mirror * here, (above - below) / (2 * h))
        if dy != 0.0 or dx * end > 0:
            assert abs(a[0] - complex(ref[0])) <= 1e-11 * abs(complex(ref[0]))
            assert abs(b[0] - complex(ref[1])) <= 1e-11 * abs(complex(ref[1]))


def test_sides_of_the_element():
    """On the element A jumps by −2πi w(t) t^k from y = −0 to +0 (Plemelj), to round-off."""
    for kind, w in WEIGHTS.items():
        above = cauchy(kind, 4, 1.4, -0.6, 0.0)[0]
        below = cauchy(kind, 4, 1.4, -0.6, -0.0)[0]
        jump = -2j * np.pi * float(w(mp.mpf("0.4"))) * 0.4 ** np.arange(5)
        assert np.allclose(above - below, jump, rtol=1e-13, atol=1e-14)
