"""How long elements are beside their distance to others, and the halving of those that are too long.

Between two faces at a distance d tractions vary over a length d: elements must not be much longer. Thin rock therefore
takes many of them, its length over its thickness. Only in the acute angle where two faces meet they need not shrink for
ever: what happens within a hundredth of the faces' length from there is not seen by K (of cracks that cross at 1° 6e-5
of it, at 3° 2e-7).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import kept, part
from ..kernels import shape_functions

#: Longest element in units of its distance to another one. Its density then still converges like 3.5^−p.
APART = 1.25
#: The same for opposite sides of a body: what is left of equilibrium errors in a slender one is amplified by its
#: slenderness squared.
ACROSS = 0.6
#: The same for elements of cracks that meet at an angle of less than `ACUTE`: they stand beside each other all along,
#: however coarsely they are graded into the node. Graded ones, as long beside that angle as a ratio of 0.3 makes them,
#: are left (0.15 left K of a fold by 165° 10 % off, by 168° anything).
#: At order 2 and below they may be a share `LOW` of that, from a ratio `FINE` on whatever they are.
BESIDE, ACUTE, GRADED, LOW, FINE = 3.5, np.radians(60), 1.05 * (1 / 0.3 - 1), 0.5, 0.299
#: Elements of faces that meet are not halved below this part of the shorter face.
AT_NODE = 0.01
#: The same at a surface, where one of them is a side, or its own image behind a free surface: the thin rock between may
#: be as good as loose, and what its end lacks of equilibrium bends it. (By dislocations, short cracks at 3.5° to a
#: side: K 1 % off; 64 % where only a ten-thousandth of the longer face was.)
AT_BOUNDARY = 0.0001
#: What `Sources.meeting` says of two pieces of one digitised line: they are not compared.
IN_LINE = 2.0
#: Elements are not halved below this part of the largest extent of the geometry.
FLOOR = 1e-10
#: What is longer than so many times its distance to another element, at the floor, is refused.
HOPELESS = 8.0
#: Most unknowns of a mesh that halving has made more than four times as large.
MOST_UNKNOWNS = 20000

_jit = kept(fastmath=False, error_model="numpy", nogil=True)
_part = part(fastmath=False, error_model="numpy", nogil=True)


@_part
def _distance_squared(px, py, ax, ay, bx, by):
    """From a point to a segment."""
    dx, dy = bx - ax, by - ay
    s = ((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy)
    s = min(1.0, max(0.0, s))
    x, y = px - ax - s * dx, py - ay - s * dy
    return x * x + y * y


class Candidates(NamedTuple):
    """Elements that may be halved: ``start``, ``end`` (n, 2), the ``tip`` of each (0: none, 1 at its start, 2 at its end, 3
    at both), and the number of its ``source``, the edge or crack segment that it lies on."""

    start: np.ndarray
    end: np.ndarray
    tip: np.ndarray
    source: np.ndarray


class Sources(NamedTuple):
    """Edges, ``n_edges`` of them, and crack segments: their ``span`` (n_sources,) m; what ``meeting`` (n_sources, n_sources)
    says, 0 for two that do not meet, 1 for those that do, `IN_LINE` for those that go on nearly straight, −sin of the angle between cracks where that is acute; those from
    ``images`` on are behind a free surface. Where they meet, ``chained`` times the distance is allowed, at an acute angle
    `BESIDE` times it, and ``beside`` times `GRADED`."""

    n_edges: int
    images: int
    span: np.ndarray
    meeting: np.ndarray
    chained: float
    beside: float


def crowding(elements: Candidates, sources: Sources) -> np.ndarray:
    """(n,) the largest length / (allowed length) of each of the ``elements`` over all others.

    Allowed is `APART` times the distance, `ACROSS` times it between two edges, and what ``sources`` says where the two lie
    on one source or on two that meet, whose grading already ties sizes to distances; there elements below the part
    `AT_NODE` (`AT_BOUNDARY` at a surface: where one is an edge, or one alone is an image) of the shorter span are left
    alone. Elements that share an end are not compared, but for the tip at the other end of the neighbour.
    """
    start, end = elements.start, elements.end
    length = np.hypot(end[:, 0] - start[:, 0], end[:, 1] - start[:, 1])
    # Farther apart than this along x, two elements cannot matter to one another.
    reach = (1.0 + 1.0 / min(APART, ACROSS)) * length.max() if len(start) else 0.0
    sweep = np.argsort(0.5 * (start[:, 0] + end[:, 0]), kind="stable")
    return _crowding(elements, length, sources, sweep, 1.000001 * reach)


@_jit
def _crowding(elements, length, sources, sweep, reach):
    """See `crowding`; ``sweep`` is the order of the elements along x, ``reach`` m how far apart there they may matter."""
    start, end = elements.start, elements.end
    n, least_apart = len(start), min(APART, ACROSS)
    out = np.zeros(n)
    for m in range(n):
        i = sweep[m]
        mx, my = 0.5 * (start[i, 0] + end[i, 0]), 0.5 * (start[i, 1] + end[i, 1])
        for k in range(m - 1, -1, -1):
            j = sweep[k]
            qx, qy = 0.5 * (start[j, 0] + end[j, 0]), 0.5 * (start[j, 1] + end[j, 1])
            if mx - qx > reach:
                break
            # Squared: most pairs are far apart, and a root for each would be most of the work.
            near = 0.5 * (length[i] + length[j]) + max(length[i], length[j]) / least_apart
            if (mx - qx) ** 2 + (my - qy) ** 2 > near * near:
                continue
            if not _share_an_end(elements, length, i, j, out):
                _compare(elements, length, sources, i, j, out)
    return out


@_part
def _share_an_end(elements, length, i, j, out):
    """Whether two elements do; each is then compared with the tip at the other's far end."""
    start, end, tip = elements.start, elements.end, elements.tip
    shared = False
    for p in range(2):
        for q in range(2):
            u, v = (start[i], start[j]) if p == 0 and q == 0 else (start[i], end[j])
            if p == 1:
                u, v = (end[i], start[j]) if q == 0 else (end[i], end[j])
            if u[0] == v[0] and u[1] == v[1]:
                shared = True
                # The square root at the neighbour's far tip is the singularity to keep clear of.
                if (tip[j] == 1 and q == 1) or (tip[j] == 2 and q == 0):
                    out[i] = max(out[i], length[i] / (APART * length[j]))
                if (tip[i] == 1 and p == 1) or (tip[i] == 2 and p == 0):
                    out[j] = max(out[j], length[j] / (APART * length[i]))
    return shared


@_part
def _compare(elements, length, sources, i, j, out):
    """Compare two elements that share no end."""
    start, end, n_edges = elements.start, elements.end, sources.n_edges
    one, other = elements.source[i], elements.source[j]
    meet = sources.meeting[one, other]
    if meet == IN_LINE:
        return
    allowed = APART
    if meet != 0:
        allowed = sources.chained if meet > 0 else min(sources.chained, BESIDE)
    elif one < n_edges and other < n_edges:
        allowed = ACROSS
    ax, ay, bx, by = start[i, 0], start[i, 1], end[i, 0], end[i, 1]
    cx, cy, dx, dy = start[j, 0], start[j, 1], end[j, 0], end[j, 1]
    d = min(_distance_squared(ax, ay, cx, cy, dx, dy), _distance_squared(bx, by, cx, cy, dx, dy))
    d = min(d, _distance_squared(cx, cy, ax, ay, bx, by), _distance_squared(dx, dy, ax, ay, bx, by))
    d = np.sqrt(d)
    d = max(d, 1e-300)
    least = 0.0
    if meet != 0:
        at_side = one < n_edges or other < n_edges or (one < sources.images) != (other < sources.images)
        least = (AT_BOUNDARY if at_side else AT_NODE) * min(sources.span[one], sources.span[other])
    graded = sources.beside * GRADED / -meet if meet < 0 else np.inf
    for k in (i, j):
        out[k] = max(out[k], length[k] / (d * (allowed if length[k] > least else graded)))


def keep_apart(start, end, kind, source, pieces, touching, n_edges, ratio, extent, unknowns, images=None, line=None):
    """Elements (``start``, ``end`` (n, 2), ``kind``, ``source`` (n,)) with those halved that stand too close to
    another.

    ``pieces`` (n_sources, 2, 2) are the edges, then the crack segments, ``touching`` (n_sources, n_sources) which of
    them meet, ``line`` the same of those that go on nearly straight (None: none do); ``ratio`` that of graded elements, ``unknowns`` those of an element; sources from ``images`` on are
    behind a free surface. Raises ValueError, saying where, when rock is too thin for that: it would take too many
    elements, or shorter ones than coordinates can tell apart.
    """
    # A graded element is 1/ratio times its distance to the next but one.
    chained = max(2.5, 1.05 / ratio)
    if ratio >= FINE:  # acute angles then ask for nothing besides
        beside, meeting = np.inf, touching.astype(float)
    else:
        beside, meeting = LOW if unknowns <= 6 else 1.0, _meeting(pieces, touching, n_edges, np.cos(ACUTE))
    if line is not None:
        meeting[line & ~np.eye(len(pieces), dtype=bool)] = IN_LINE
    span = np.hypot(*(pieces[:, 1] - pieces[:, 0]).T)
    images = len(pieces) if images is None else images
    sources = Sources(n_edges, images, span, meeting, chained, float(beside))
    most = max(4 * len(start), MOST_UNKNOWNS // unknowns)
    while True:
        tip = np.where(kind == shape_functions.ORDINARY, 0, kind)
        start, end = np.ascontiguousarray(start), np.ascontiguousarray(end)
        crowded = crowding(Candidates(start, end, tip, source), sources)
        length = np.hypot(*(end - start).T)
        cut = (crowded > 1 + 1e-9) & (length > 2 * FLOOR * extent)
        if not cut.any():
            break
        if len(start) + cut.sum() > most:
            raise ValueError(f"{_thin(start, end, length, crowded)}: it would take more than {most} elements")
        start, end, kind, source = _halved(start, end, kind, source, cut)
    if len(crowded) and crowded.max() > HOPELESS:
        raise ValueError(f"{_thin(start, end, length, crowded)}: less than coordinates can tell apart")
    return start, end, kind, source


@_jit
def _meeting(pieces, touching, n_edges, acute):
    """What `crowding` has to know of sources that meet; ``acute`` is the cosine of the angle below which two cracks
    do at an acute one."""
    n = len(pieces)
    out = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            if touching[i, j]:
                out[i, j] = 1.0
    for i in range(n_edges, n):
        for j in range(i + 1, n):
            if not touching[i, j]:
                continue
            for p in range(2):
                for q in range(2):
                    if pieces[i, p, 0] != pieces[j, q, 0] or pieces[i, p, 1] != pieces[j, q, 1]:
                        continue
                    ax, ay = pieces[i, 1 - p, 0] - pieces[i, p, 0], pieces[i, 1 - p, 1] - pieces[i, p, 1]
                    bx, by = pieces[j, 1 - q, 0] - pieces[j, q, 0], pieces[j, 1 - q, 1] - pieces[j, q, 1]
                    size = np.hypot(ax, ay) * np.hypot(bx, by)
                    if ax * bx + ay * by > acute * size:
                        out[i, j] = out[j, i] = -max(abs(ax * by - ay * bx) / size, 1e-300)
    return out


def _thin(start, end, length, crowded) -> str:
    """Where rock is too thin, and how thin."""
    at = int(np.argmax(crowded))
    x, y = 0.5 * (start[at] + end[at])
    gap = length[at] / crowded[at]
    return f"cracks or sides near ({x:g}, {y:g}) leave too thin a piece of rock between them, about {gap:.2g} m"


def _halved(start, end, kind, source, cut):
    middle = 0.5 * (start + end)
    at = np.repeat(np.arange(len(start)), np.where(cut, 2, 1))
    second = np.r_[False, at[1:] == at[:-1]]
    first = np.r_[second[1:], False]
    new_start, new_end, new_kind = start[at], end[at], kind[at]
    new_end[first] = middle[at[first]]
    new_start[second] = middle[at[second]]
    was = kind[at]
    starts = (was == shape_functions.TIP_START) | (was == shape_functions.TIP_BOTH)
    stops = (was == shape_functions.TIP_END) | (was == shape_functions.TIP_BOTH)
    new_kind[first] = np.where(starts, shape_functions.TIP_START, shape_functions.ORDINARY)[first]
    new_kind[second] = np.where(stops, shape_functions.TIP_END, shape_functions.ORDINARY)[second]
    return new_start, new_end, new_kind, source[at]
