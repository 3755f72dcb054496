"""Contact of two rounded corners: one contact point with one normal for a pair of convex corners.

The corner v of one block touches the corner w of another where x = v − w lies in the wedge {x·n₁ < 0 and x·n₂ < 0}
between two entrance lines with normals n₁ and n₂ (Shi 1988). In a sharp wedge it is undecided which line holds two
corners that overlap by micrometres: blocks that have settled differently by as little would lock. Here the wedge is
rounded by a circle that touches both lines at the rounding length ρ from its tip (radius R = ρ / tan(φ/2), φ the angle
between n₁ and n₂; the UDEC code rounds block corners likewise). It then has one outward normal everywhere, which varies
continuously:

    G(x) = |x − c| − R  where x − c lies between n₁ and n₂,  c = −R (n₁ + n₂) / (1 + cos φ);  else  x·n₁ or x·n₂.

Corners that overlap by less than ρ slide over each other along a ramp, the lower the less they overlap. Larger overlaps
are held by the side as drawn.

The contact of a step has the normal at the point where x first reaches G = 0 on its extrapolated path, or comes nearest
to it. G is convex: the half-plane with that normal contains the rounded wedge, so that nothing enters it.
"""

from __future__ import annotations

import numpy as np

from ...compiled import UNCOUNTED, part

#: A normal within this angle (cosine; 0.2 rad) of that of one line, and nearer to it than to the bisector of both, is
#: replaced by it: so shallow a ramp is lower than a fiftieth of the rounding length and was not drawn as a step.
_ON_LINE = 0.98
#: Height of that ramp over the rounding length, 1 − cos 0.2.
EASED = 0.02
#: Least rounding length over the penetration of the two blocks' faces: a block on soft joints penetrates before it
#: slides, and must not lock on the next one.
_PRESSED = 4.0


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def rounding_length(rounding, longest, pressed):
    """Common rounding length of two corners, m: of their lengths ``rounding``, at most ``longest``, for blocks with the
    penetrations ``pressed``, all m."""
    return min(longest, max(rounding, _PRESSED * pressed))


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _nearest(x, y, nx1, ny1, nx2, ny2, gap1, gap2, radius, cx, cy, way):
    """G and its gradient at (x, y), and the line it belongs to: 1, 2, or 0 for the arc."""
    zx, zy = x - cx, y - cy
    past_first, past_second = way * (nx1 * zy - ny1 * zx), way * (zx * ny2 - zy * nx2)
    if past_first >= 0.0 and past_second >= 0.0:
        far = np.sqrt(zx * zx + zy * zy)
        if far > 0.0:
            return zx / far, zy / far, far - radius, 0
    if past_second >= 0.0 or (past_first < 0.0 and gap1 >= gap2):
        return nx1, ny1, gap1, 1
    return nx2, ny2, gap2, 2


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def meeting(x, y, dx, dy, nx1, ny1, gap1, nx2, ny2, gap2, length, places):
    """Contact normal and gap of two corners at x = (``x``, ``y``) m with the relative motion (``dx``, ``dy``) m in a
    step.

    ``nx1`` … ``gap2``: unit normals of the two lines and x's distance from them; ``length``: the rounding length, m;
    ``places`` (5,): working space.
    Returns the normal, the gap along it, m, and the line whose normal it is (1, 2, or 0 for neither).
    """
    cosine, sine = nx1 * nx2 + ny1 * ny2, nx1 * ny2 - ny1 * nx2
    way = 1.0 if sine >= 0.0 else -1.0
    radius = length * (1.0 + cosine) / max(abs(sine), 1e-300)
    cx, cy = -radius * (nx1 + nx2) / (1.0 + cosine), -radius * (ny1 + ny2) / (1.0 + cosine)
    mx, my, gap, line = _nearest(x, y, nx1, ny1, nx2, ny2, gap1, gap2, radius, cx, cy, way)
    if gap > 0.0:
        here, zx, zy = (mx, my, gap, line), x - cx, y - cy
        # Where x first reaches the wedge on its path, or comes nearest: lines are reached at an end of the path or
        # where it crosses them, the arc also where the path passes its centre.
        rate1, rate2, travel = dx * nx1 + dy * ny1, dx * nx2 + dy * ny2, dx * dx + dy * dy
        along = zx * dx + zy * dy
        places[0], n = 1.0, 1
        if gap1 > 0.0 and -rate1 > gap1:
            places[n] = -gap1 / rate1
            n += 1
        if gap2 > 0.0 and -rate2 > gap2:
            places[n] = -gap2 / rate2
            n += 1
        if -along > 0.0 and -along < travel:
            left = along * along - travel * (zx * zx + zy * zy - radius * radius)
            places[n] = (-along - np.sqrt(max(left, 0.0))) / travel
            n += 1
            if left < 0.0:
                places[n - 1] = -along / travel
        elif -along > 0.0:
            left = along * along - travel * (zx * zx + zy * zy - radius * radius)
            if left > 0.0 and -along - np.sqrt(left) < travel:
                places[n] = (-along - np.sqrt(left)) / travel
                n += 1
        least, first = gap, 2.0
        tiny = 1e-9 * length
        for k in range(n):
            t = places[k]
            px, py, near, on = _nearest(
                x + t * dx, y + t * dy, nx1, ny1, nx2, ny2, gap1 + t * rate1, gap2 + t * rate2, radius, cx, cy, way
            )
            # Of positions in the wedge the first; otherwise the nearest.
            earlier = (least > tiny or t < first) if near <= tiny else near < least
            if earlier:
                least, first, mx, my, line = near, t, px, py, on
        gap = zx * mx + zy * my - radius
        # The line ahead does not support the corner as long as the corner is behind it, outside the wedge.
        if (line == 1 and gap1 < -EASED * length) or (line == 2 and gap2 < -EASED * length):
            mx, my, gap, line = here
    # Lines that cross at less than twice the angle of `_ON_LINE` are both near the arc's middle: rounding must not choose.
    near = max(_ON_LINE, (mx * (nx1 + nx2) + my * (ny1 + ny2)) / np.sqrt(2.0 + 2.0 * cosine))
    if line == 1 or (mx * nx1 + my * ny1 > near and gap1 > -EASED * length):
        return nx1, ny1, gap1, 1
    if line == 2 or (mx * nx2 + my * ny2 > near and gap2 > -EASED * length):
        return nx2, ny2, gap2, 2
    return mx, my, gap, 0
