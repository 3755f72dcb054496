"""Limits the length of elements relative to their distance from others, by halving those that are too long.

Between two faces at a distance d tractions vary over a length d, so that elements must not be much longer: thin rock
takes as many elements as its length over its thickness. In the acute angle where two faces meet, elements need not
shrink without limit: the region within a hundredth of the faces' length from the vertex has no effect on K (6e-5 of K
for cracks that cross at 1°, 2e-7 at 3°).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ..kernels import shape_functions

#: Largest element length relative to its distance from another element. The density still converges like 3.5^−p.
APART = 1.25
#: The same for opposite edges of a body: in a slender body the remaining equilibrium error is amplified by the
#: slenderness squared.
ACROSS = 0.6
#: The same for elements of cracks that meet at an angle below `ACUTE`: they run close to each other however they are
#: graded towards the node. Graded elements with the lengths that a ratio of 0.3 gives are kept (a ratio of 0.15 left K
#: of a fold of 165° off by 10 %, of 168° useless). At order 2 and below the limit is a share `LOW` of it; from a ratio
#: of `FINE` on, there is none.
AT_ACUTE, ACUTE, GRADED, LOW, FINE = 3.5, np.radians(60), 1.05 * (1 / 0.3 - 1), 0.5, 0.299
#: Elements of faces that meet are not halved below this part of the shorter face.
AT_NODE = 0.01
#: The same at a surface, where one of them is an edge, or its own image behind a free surface: the thin rock between
#: them may be almost detached, and equilibrium errors at its end bend it. (Measured with dislocations on short cracks
#: at 3.5° to an edge: K off by 1 %; by 64 % with a ten-thousandth of the longer face.)
AT_BOUNDARY = 0.0001
#: Shortest element that halving may make, relative to the extent of the geometry.
FLOOR = 1e-10
#: An element at that limit is refused if its length exceeds this many times its distance from another.
REFUSED_ABOVE = 8.0
#: Largest number of unknowns of a mesh that halving has made more than four times as large.
MOST_UNKNOWNS = 20000

_jit = kept(fastmath=False, error_model="numpy", nogil=True)
_part = part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)


@_part
def _distance_squared(px, py, ax, ay, bx, by):
    """Squared distance of a point from a segment."""
    dx, dy = bx - ax, by - ay
    s = ((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy)
    s = min(1.0, max(0.0, s))
    x, y = px - ax - s * dx, py - ay - s * dy
    return x * x + y * y


class Candidates(NamedTuple):
    """Elements that may be halved.

    start, end   (n, 2)
    tip          (n,)  0: none, 1: at the start, 2: at the end, 3: at both
    source       (n,)  number of the edge or crack segment on which the element lies
    """

    start: np.ndarray
    end: np.ndarray
    tip: np.ndarray
    source: np.ndarray


class Sources(NamedTuple):
    """Edges (the first ``n_edges``) and crack segments.

    images    number from which on sources are images behind a free surface
    span      (n_sources,)  length, m
    meeting   (n_sources, n_sources)  0: they do not meet; 1: they meet; −sin of the angle between cracks where acute
    chained   largest length relative to the distance where they meet; at an acute angle `AT_ACUTE`, and ``acute_share`` times
              `GRADED`
    """

    n_edges: int
    images: int
    span: np.ndarray
    meeting: np.ndarray
    chained: float
    acute_share: float


def crowding(elements: Candidates, sources: Sources) -> np.ndarray:
    """(n,) the largest ratio of the length of each of the ``elements`` to its allowed length, over all others.

    Allowed is `APART` times the distance, `ACROSS` times it between two edges, and a larger value from ``sources``
    where the two lie on one source or on two that meet, whose grading already ties sizes to distances; there elements
    below the part `AT_NODE` (`AT_BOUNDARY` at a surface: where one is an edge, or only one is an image) of the shorter
    span are left alone. Elements that share an end are compared only with the tip at the far end of the neighbour.
    """
    start, end = elements.start, elements.end
    length = np.hypot(end[:, 0] - start[:, 0], end[:, 1] - start[:, 1])
    # Elements farther apart along x than this need not be compared.
    reach = (1.0 + 1.0 / min(APART, ACROSS)) * length.max() if len(start) else 0.0
    sweep = np.argsort(0.5 * (start[:, 0] + end[:, 0]), kind="stable")
    return _crowding(elements, length, sources, sweep, 1.000001 * reach)


@_jit
def _crowding(elements, length, sources, sweep, reach):
    """See `crowding`; ``sweep`` orders the elements along x, ``reach`` (m) is the largest distance along x that
    matters."""
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
            # Squared distances: most pairs are far apart, and their square roots would dominate the time.
            near = 0.5 * (length[i] + length[j]) + max(length[i], length[j]) / least_apart
            if (mx - qx) ** 2 + (my - qy) ** 2 > near * near:
                continue
            if not _share_an_end(elements, length, i, j, out):
                _compare(elements, length, sources, i, j, out)
    return out


@_part
def _share_an_end(elements, length, i, j, out):
    """Whether two elements share an end; then each is compared with the tip at the far end of the other."""
    start, end, tip = elements.start, elements.end, elements.tip
    shared = False
    for p in range(2):
        for q in range(2):
            u, v = (start[i], start[j]) if p == 0 and q == 0 else (start[i], end[j])
            if p == 1:
                u, v = (end[i], start[j]) if q == 0 else (end[i], end[j])
            if u[0] == v[0] and u[1] == v[1]:
                shared = True
                # The square-root singularity at the neighbour's far tip is what an element must be short for.
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
    allowed = APART
    if meet != 0:
        allowed = sources.chained if meet > 0 else min(sources.chained, AT_ACUTE)
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
    graded = sources.acute_share * GRADED / -meet if meet < 0 else np.inf
    for k in (i, j):
        out[k] = max(out[k], length[k] / (d * (allowed if length[k] > least else graded)))


class Pieces(NamedTuple):
    """The edges and crack segments on which elements lie.

    ends       (n_sources, 2, 2) m, the first ``n_edges`` edges, then crack segments
    touching   (n_sources, n_sources) bool, which of them meet
    images     number from which on they are images behind a free surface
    """

    ends: np.ndarray
    touching: np.ndarray
    n_edges: int
    images: int


def keep_apart(start, end, kind, source, pieces: Pieces, ratio: float, extent: float, unknowns: int):
    """Halve elements (``start``, ``end`` (n, 2), ``kind``, ``source`` (n,)) that are too long for their distance to
    others.

    ``ratio`` is the grading ratio, ``extent`` (m) that of the geometry, ``unknowns`` the number per element. Raises
    ValueError with the place where rock is too thin: it would take too many elements, or shorter ones than coordinates
    can resolve.
    """
    # A graded element is 1/ratio times its distance from the next but one.
    chained = max(2.5, 1.05 / ratio)
    if ratio >= FINE:  # acute angles then add no limit of their own
        acute_share, meeting = np.inf, pieces.touching.astype(float)
    else:
        acute_share = LOW if unknowns <= 6 else 1.0
        meeting = _meeting(pieces.ends, pieces.touching, pieces.n_edges, np.cos(ACUTE))
    span = np.hypot(*(pieces.ends[:, 1] - pieces.ends[:, 0]).T)
    sources = Sources(pieces.n_edges, pieces.images, span, meeting, chained, float(acute_share))
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
            raise ValueError(f"{_thin(start, end, length, crowded)}: the mesh would need more than {most} elements")
        start, end, kind, source = _halved(start, end, kind, source, cut)
    if len(crowded) and crowded.max() > REFUSED_ABOVE:
        raise ValueError(f"{_thin(start, end, length, crowded)}, which coordinates cannot resolve")
    return start, end, kind, source


@_jit
def _meeting(pieces, touching, n_edges, acute):
    """Relations between sources as `crowding` needs them; ``acute`` is the cosine of the angle below which two cracks
    meet acutely."""
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
    """Message: where rock is too thin, and how thin."""
    at = int(np.argmax(crowded))
    x, y = 0.5 * (start[at] + end[at])
    gap = length[at] / crowded[at]
    return f"cracks or sides near ({x:g}, {y:g}) leave too thin a piece of rock between them, about {gap:.2g} m"


def _halved(start, end, kind, source, cut):
    midpoint = 0.5 * (start + end)
    at = np.repeat(np.arange(len(start)), np.where(cut, 2, 1))
    second = np.r_[False, at[1:] == at[:-1]]
    first = np.r_[second[1:], False]
    new_start, new_end, new_kind = start[at], end[at], kind[at]
    new_end[first] = midpoint[at[first]]
    new_start[second] = midpoint[at[second]]
    was = kind[at]
    starts = (was == shape_functions.TIP_START) | (was == shape_functions.TIP_BOTH)
    stops = (was == shape_functions.TIP_END) | (was == shape_functions.TIP_BOTH)
    new_kind[first] = np.where(starts, shape_functions.TIP_START, shape_functions.ORDINARY)[first]
    new_kind[second] = np.where(stops, shape_functions.TIP_END, shape_functions.ORDINARY)[second]
    return new_start, new_end, new_kind, source[at]
