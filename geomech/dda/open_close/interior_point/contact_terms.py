"""Contact terms of one iteration of the central path, in compiled loops; variables as in `central_path`.

Arrays of six columns (n, 6) are N, w, α, β and the remaining strengths above and below S; the products are N w, α times
the strength above, β times that below. Divisions, which take most of the time, are kept to a minimum. Functions process
the contacts from ``first`` to before ``last`` and return the sums over these. (Indices are unsigned: signed ones would
be tested for negative values.) They take plain tuples of the records below.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import uintp

from ....compiled import UNCOUNTED, kept, part

# Sums may not be reordered: otherwise LLVM vectorises across contact records, which takes three times as long.
_jit = kept(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
_part = part(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)

#: Largest step length, relative to that at which a force or gap vanishes.
SHORT_OF = 0.99
#: Lower limit of the remaining strength, relative to the strength: round-off of the difference.
LEAST_LEFT = 1e-14


class Variables(NamedTuple):
    """N ``normal`` and w ``width`` (n,), α and β ``slip`` (2, n), S ``shear`` (n,); ``gap`` and motion ``along`` the edge
    (n,) m."""

    normal: np.ndarray
    width: np.ndarray
    slip: np.ndarray
    shear: np.ndarray
    gap: np.ndarray
    along: np.ndarray


class PathSprings(NamedTuple):
    """Stiffnesses ``kn`` and ``ks`` (n,) N/m, strength ``mu`` N + ``base`` (n,), whether it is ``rough`` (n,), and the
    ``unit`` (n,) J of its products."""

    kn: np.ndarray
    ks: np.ndarray
    mu: np.ndarray
    base: np.ndarray
    rough: np.ndarray
    unit: np.ndarray


class Linearised(NamedTuple):
    """``numbers`` (n, 6); ``missed`` (n, 2) m, residuals of gap and slip; ``laws`` (n, 4): derivative of N w by N, −∂N/∂g,
    −∂S/∂s and ∂S/∂N; ``pulled`` (n, 3) N, see `pull`."""

    numbers: np.ndarray
    missed: np.ndarray
    laws: np.ndarray
    pulled: np.ndarray


class Between(NamedTuple):
    """Positions ``block`` and ``other`` (n,) of a contact's blocks, −1 if fixed; its ``vectors`` (n, 2, 12) and ``lift``
    (n,)."""

    block: np.ndarray
    other: np.ndarray
    vectors: np.ndarray
    lift: np.ndarray


class Changes(NamedTuple):
    """``motion`` (n, 2) m (gaps without dilation); changes of the numbers (``changed`` (n, 6)) and of S (``sheared`` (n,))."""

    motion: np.ndarray
    changed: np.ndarray
    sheared: np.ndarray


@_part
def linearise(first, last, variables, springs, linearised):
    """Linearise at the `Variables` with `PathSprings`. Fills the `Linearised`, ``pulled`` with the present forces. Returns
    the sum of the products, each in its unit."""
    normals, widths, slip, shear, gap, along = variables
    kn, ks, mu, base, rough, unit = springs
    numbers, missed, laws, pulled = linearised
    total = 0.0
    for c in range(uintp(first), uintp(last)):
        normal, width, back, ahead = normals[c], widths[c], slip[0, c], slip[1, c]
        strength = mu[c] * normal + base[c]
        least = LEAST_LEFT * strength
        above, below = max(strength - shear[c], least), max(strength + shear[c], least)
        flat = normal / kn[c]
        missed[c, 0] = gap[c] + flat - width
        missed[c, 1] = along[c] + shear[c] / ks[c] - (ahead - back)
        less, more = back / above, ahead / below
        stiff = ks[c] / (1.0 + ks[c] * (less + more)) if rough[c] else 0.0
        slope = stiff * mu[c] * (less - more)
        soft = width + flat
        numbers[c, 0], numbers[c, 1], numbers[c, 2] = normal, width, back
        numbers[c, 3], numbers[c, 4], numbers[c, 5] = ahead, above, below
        laws[c, 0], laws[c, 1], laws[c, 2], laws[c, 3] = soft, normal / soft, stiff, slope
        pulled[c, 0], pulled[c, 2] = normal, shear[c]
        own = normal * width
        if rough[c]:
            own += back * above + ahead * below
        total += own / unit[c]
    return total


@_part
def pull(first, last, goals, linearised):
    """``pulled`` (n, 3) N: contact forces of a Newton step without motion of the blocks: normal force, shear force
    without and with its dependence on the normal force. ``goals`` (n, 3) J: targets of the products."""
    numbers, missed, laws, pulled = linearised
    for c in range(uintp(first), uintp(last)):
        normal, width, above, below = numbers[c, 0], numbers[c, 1], numbers[c, 4], numbers[c, 5]
        # One division for both.
        share = 1.0 / (above * below)
        more, less = goals[c, 2] * above * share - numbers[c, 3], goals[c, 1] * below * share - numbers[c, 2]
        slid = more - less - missed[c, 1]
        given = (goals[c, 0] - normal * (width + missed[c, 0])) / laws[c, 0]
        sheared = laws[c, 2] * slid
        pulled[c, 0], pulled[c, 1], pulled[c, 2] = given, sheared, sheared + laws[c, 3] * given


@_part
def change(first, last, unknowns, between, springs, linearised, goals, changes):
    """`Changes` of contacts (`Between`) in a step of the ``unknowns`` (6 n_blocks,). Returns the largest step length up to
    1 for which positive numbers stay positive. ``pulled`` is that of `pull`."""
    block, other, vectors, lift = between
    kn, _, mu, _, rough, _ = springs
    numbers, missed, laws, pulled = linearised
    motion, changed, sheared = changes
    far = 1.0
    for c in range(uintp(first), uintp(last)):
        apart = along = 0.0
        n, t = vectors[c, 0], vectors[c, 1]
        # All six at once, so that they are vectorised.
        if block[c] >= 0:
            u = unknowns[6 * block[c] : 6 * block[c] + 6]
            apart += n[0] * u[0] + n[1] * u[1] + n[2] * u[2] + n[3] * u[3] + n[4] * u[4] + n[5] * u[5]
            along += t[0] * u[0] + t[1] * u[1] + t[2] * u[2] + t[3] * u[3] + t[4] * u[4] + t[5] * u[5]
        if other[c] >= 0:
            u = unknowns[6 * other[c] : 6 * other[c] + 6]
            apart += n[6] * u[0] + n[7] * u[1] + n[8] * u[2] + n[9] * u[3] + n[10] * u[4] + n[11] * u[5]
            along += t[6] * u[0] + t[7] * u[1] + t[8] * u[2] + t[9] * u[3] + t[10] * u[4] + t[11] * u[5]
        apart -= lift[c] * along
        motion[c, 0], motion[c, 1] = apart, along
        back, ahead, above, below = numbers[c, 2], numbers[c, 3], numbers[c, 4], numbers[c, 5]
        pushed = pulled[c, 0] - laws[c, 1] * apart
        drawn = pulled[c, 1] - laws[c, 2] * along + laws[c, 3] * pushed
        more, less = mu[c] * pushed - drawn, mu[c] * pushed + drawn
        share = 1.0 / (above * below)
        backward = (goals[c, 1] - back * more) * below * share - back
        forward = (goals[c, 2] - ahead * less) * above * share - ahead
        wider = apart + pushed / kn[c] + missed[c, 0]
        changed[c, 0], changed[c, 1], changed[c, 2], changed[c, 3] = pushed, wider, backward, forward
        changed[c, 4], changed[c, 5], sheared[c] = more, less, drawn
        for k in range(6 if rough[c] else 2):
            if -far * changed[c, k] > SHORT_OF * numbers[c, k]:
                far = -SHORT_OF * numbers[c, k] / changed[c, k]
    return far


@_jit
def products(numbers, changed, far, rough, unit):
    """Sum of the products of all contacts, each in its ``unit`` (n,) J, ``far`` along the changes (n, 6)."""
    total = 0.0
    for c in range(len(unit)):
        own = (numbers[c, 0] + far * changed[c, 0]) * (numbers[c, 1] + far * changed[c, 1])
        if rough[c]:
            own += (numbers[c, 2] + far * changed[c, 2]) * (numbers[c, 4] + far * changed[c, 4])
            own += (numbers[c, 3] + far * changed[c, 3]) * (numbers[c, 5] + far * changed[c, 5])
        total += own / unit[c]
    return total


@_part
def second_order(first, last, epsilon, unit, changed, goals):
    """``goals`` (n, 3) J: targets of the linearised products so that the products are ``epsilon`` units each, including
    the second-order terms of ``changed``."""
    for c in range(uintp(first), uintp(last)):
        target = epsilon * unit[c]
        goals[c, 0] = target - changed[c, 0] * changed[c, 1]
        goals[c, 1] = target - changed[c, 2] * changed[c, 4]
        goals[c, 2] = target - changed[c, 3] * changed[c, 5]


@_part
def nearer(first, last, epsilon, unit, wanted, spread, numbers, changed, goals, better):
    """``better`` (n, 3) J: ``goals`` corrected so that products which a step of length ``wanted`` would leave outside a
    factor ``spread`` of ``epsilon`` units return to that range; corrections from above are limited (Gondzio 1996)."""
    for c in range(uintp(first), uintp(last)):
        target = epsilon * unit[c]
        low, high = target / spread, target * spread
        for k in range(3):
            i, j = (0, 1) if k == 0 else (k + 1, k + 3)
            product = (numbers[c, i] + wanted * changed[c, i]) * (numbers[c, j] + wanted * changed[c, j])
            better[c, k] = goals[c, k] + max(min(max(product, low), high) - product, -high)


@_part
def go(first, last, far, changes, variables):
    """Update the `Variables` by `Changes` of length ``far``, in place."""
    motion, changed, sheared = changes
    normals, widths, slip, shear, gap, along = variables
    for c in range(uintp(first), uintp(last)):
        normals[c] += far * changed[c, 0]
        widths[c] += far * changed[c, 1]
        slip[0, c] += far * changed[c, 2]
        slip[1, c] += far * changed[c, 3]
        shear[c] += far * sheared[c]
        gap[c] += far * motion[c, 0]
        along[c] += far * motion[c, 1]


@_part
def undecided(first, last, variables, springs, clear):
    """Number of contacts whose force and gap, or slip and remaining strength, differ by less than a factor ``clear`` in
    units of the stiffness."""
    normals, widths, slip, shear, _, _ = variables
    kn, ks, mu, base, rough, _ = springs
    number = 0
    for c in range(uintp(first), uintp(last)):
        normal, apart = normals[c], kn[c] * widths[c]
        unclear = clear * normal > apart and apart * clear > normal
        if not unclear and rough[c] and apart < normal:
            strength = mu[c] * normal + base[c]
            least = LEAST_LEFT * strength
            above, below = max(strength - shear[c], least), max(strength + shear[c], least)
            back, ahead = ks[c] * slip[0, c], ks[c] * slip[1, c]
            unclear = (back < clear * above and back * clear > above) or (
                ahead < clear * below and ahead * clear > below
            )
        number += unclear
    return number


@_jit
def balance(first, last, start, side, vectors, pulled, along_normal, along_edge, given, out):
    """``out`` (6 n_blocks,): the forces ``given`` on blocks from ``first`` to before ``last`` and those of their
    contacts, the columns ``along_normal`` and ``along_edge`` of ``pulled`` (n, k); ``start`` and ``side`` as from
    `assembly.sides_of`."""
    for b in range(uintp(first), uintp(last)):
        here, result = given[6 * b : 6 * b + 6], out[6 * b : 6 * b + 6]
        r0, r1, r2, r3, r4, r5 = here[0], here[1], here[2], here[3], here[4], here[5]
        for q in range(uintp(start[b]), uintp(start[b + 1])):
            c, k = uintp(side[q] >> 1), 6 * (side[q] & 1)
            p, d = pulled[c, along_normal], pulled[c, along_edge]
            n, t = vectors[c, 0, k : k + 6], vectors[c, 1, k : k + 6]
            r0, r1, r2 = r0 + p * n[0] + d * t[0], r1 + p * n[1] + d * t[1], r2 + p * n[2] + d * t[2]
            r3, r4, r5 = r3 + p * n[3] + d * t[3], r4 + p * n[4] + d * t[4], r5 + p * n[5] + d * t[5]
        result[0], result[1], result[2], result[3], result[4], result[5] = r0, r1, r2, r3, r4, r5
