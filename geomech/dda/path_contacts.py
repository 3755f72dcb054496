"""The contacts of one iteration of the central path, in compiled loops; see `central_path` for what the numbers are.

Arrays of six rows (6, n) are N, w, α, β and the strengths left above and below S; the products are those of N and w, of
α and the strength above, of β and the one below. Of divisions, which take most of the time, there are as few as can be.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_jit = njit(cache=True, fastmath={"reassoc", "contract", "nsz"}, error_model="numpy", nogil=True)

#: No step goes farther than this part of the way to where a force or a gap vanishes.
SHORT_OF = 0.99
#: The part of a contact's strength that is left at least, however hard it is sheared: the round-off of their
#: difference.
LEAST_LEFT = 1e-14


@_jit
def linearised(normal, width, slip, shear, gap, along, kn, ks, mu, base, rough, rise):
    """The numbers (6, n), what is missed (2, n) m of gap and slip, and how contacts answer motions (5, n): N m by which
    the product of N and w goes with N, −∂N/∂g, −∂S/∂s, ∂S/∂N, and by how much the motion along the edge lifts."""
    n = len(normal)
    numbers, missed, laws = np.empty((6, n)), np.empty((2, n)), np.empty((5, n))
    for c in range(n):
        strength = mu[c] * normal[c] + base[c]
        least = LEAST_LEFT * strength
        above, below = max(strength - shear[c], least), max(strength + shear[c], least)
        back, ahead = slip[0, c], slip[1, c]
        flat = normal[c] / kn[c]
        missed[0, c] = gap[c] + flat - width[c] - rise[c] * (back + ahead)
        missed[1, c] = along[c] + shear[c] / ks[c] - (ahead - back)
        less, more = back / above, ahead / below
        stiff = ks[c] / (1.0 + ks[c] * (less + more)) if rough[c] else 0.0
        slope = stiff * mu[c] * (less - more)
        soft = width[c] + flat + normal[c] * rise[c] * (mu[c] * (less + more) - slope * (less - more))
        numbers[0, c], numbers[1, c], numbers[2, c] = normal[c], width[c], back
        numbers[3, c], numbers[4, c], numbers[5, c] = ahead, above, below
        laws[0, c], laws[1, c], laws[2, c], laws[3, c] = soft, normal[c] / soft, stiff, slope
        laws[4, c] = rise[c] * stiff * (less - more)
    return numbers, missed, laws


@_jit
def pulls(goals, numbers, missed, laws, rise):
    """(3, n) N of a Newton step where blocks stand still: normal forces, shear forces without what answers these, and
    with it. ``goals`` (3, n) J for the products; slip lifts by ``rise``."""
    n = len(rise)
    out = np.empty((3, n))
    for c in range(n):
        normal, width, above, below = numbers[0, c], numbers[1, c], numbers[4, c], numbers[5, c]
        # One division for both.
        share = 1.0 / (above * below)
        more, less = goals[2, c] * above * share - numbers[3, c], goals[1, c] * below * share - numbers[2, c]
        slid = more - less - missed[1, c]
        risen = laws[4, c] * slid + (rise[c] * (more + less) if rise[c] > 0.0 else 0.0)
        given = (goals[0, c] - normal * (width + missed[0, c] - risen)) / laws[0, c]
        out[0, c], out[1, c] = given, laws[2, c] * slid
        out[2, c] = out[1, c] + laws[3, c] * given
    return out


@_jit
def changes(goals, numbers, missed, pulled, motion, laws, kn, mu, rough, rise):
    """Changes (6, n) of the ``numbers``, (n,) of S, and how far along them positive numbers stay so, at most 1:
    ``pulled`` from `pulls`, ``motion`` (n, 2) m of the blocks, gaps without what sliding lifts."""
    n = len(kn)
    out, shear, far = np.empty((6, n)), np.empty(n), 1.0
    for c in range(n):
        back, ahead, above, below = numbers[2, c], numbers[3, c], numbers[4, c], numbers[5, c]
        pushed = pulled[0, c] - laws[1, c] * (motion[c, 0] + laws[4, c] * motion[c, 1])
        sheared = pulled[1, c] - laws[2, c] * motion[c, 1] + laws[3, c] * pushed
        more, less = mu[c] * pushed - sheared, mu[c] * pushed + sheared
        out[0, c], out[4, c], out[5, c], shear[c] = pushed, more, less, sheared
        share = 1.0 / (above * below)
        out[2, c] = (goals[1, c] - back * more) * below * share - back
        out[3, c] = (goals[2, c] - ahead * less) * above * share - ahead
        out[1, c] = motion[c, 0] + pushed / kn[c] + missed[0, c]
        if rise[c] > 0.0:
            out[1, c] -= rise[c] * (out[2, c] + out[3, c])
        for k in range(6 if rough[c] else 2):
            if -far * out[k, c] > SHORT_OF * numbers[k, c]:
                far = -SHORT_OF * numbers[k, c] / out[k, c]
    return out, shear, far


@_jit
def products(numbers, changed, far, rough, unit):
    """Sum of the products of all contacts, each in its ``unit`` (n,) J, ``far`` along the changes (6, n)."""
    total = 0.0
    for c in range(len(unit)):
        own = (numbers[0, c] + far * changed[0, c]) * (numbers[1, c] + far * changed[1, c])
        if rough[c]:
            own += (numbers[2, c] + far * changed[2, c]) * (numbers[4, c] + far * changed[4, c])
            own += (numbers[3, c] + far * changed[3, c]) * (numbers[5, c] + far * changed[5, c])
        total += own / unit[c]
    return total


@_jit
def second_order(target, changed):
    """(3, n) J: what products are to be at first for the ``target`` (n,), after what their factors' changes make."""
    goals = np.empty((3, len(target)))
    for c in range(len(target)):
        goals[0, c] = target[c] - changed[0, c] * changed[1, c]
        goals[1, c] = target[c] - changed[2, c] * changed[4, c]
        goals[2, c] = target[c] - changed[3, c] * changed[5, c]
    return goals


@_jit
def nearer(goals, numbers, changed, wanted, target, spread):
    """(3, n) J: ``goals`` corrected so that products which the step, taken as far as ``wanted``, would leave beyond a
    factor ``spread`` of the ``target`` (n,) come back to there, by no more than that above it (Gondzio 1996)."""
    out = np.empty_like(goals)
    for c in range(len(target)):
        low, high = target[c] / spread, target[c] * spread
        for k in range(3):
            i, j = (0, 1) if k == 0 else (k + 1, k + 3)
            product = (numbers[i, c] + wanted * changed[i, c]) * (numbers[j, c] + wanted * changed[j, c])
            out[k, c] = goals[k, c] + max(min(max(product, low), high) - product, -high)
    return out


@_jit
def undecided(normal, width, slip, above, below, kn, ks, rough, clear):
    """How many contacts have a force and a gap, or slip and strength left, that differ by less than a factor ``clear``
    in units of the stiffness."""
    number = 0
    for c in range(len(normal)):
        apart = kn[c] * width[c]
        vague = clear * normal[c] > apart and apart * clear > normal[c]
        if not vague and rough[c] and apart < normal[c]:
            back, ahead = ks[c] * slip[0, c], ks[c] * slip[1, c]
            vague = (back < clear * above[c] and back * clear > above[c]) or (
                ahead < clear * below[c] and ahead * clear > below[c]
            )
        number += vague
    return number
