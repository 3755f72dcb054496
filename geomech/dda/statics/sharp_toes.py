"""Sharp toes: corners of a block in a re-entrant corner, between the face on which the block slides and the obstacle at
its end.

The last corner of a block on a plane that ends at a floor, or of the active block of a bilinear plane, touches an
obstacle. Two sharp corners can carry any force there, whatever the joints. Real rock has no such corners, and cutting a
centimetre off the toe, which does not change the forces, would release the block. Let the corner, with half angle α and
inward bisector b, be rounded by a circle that touches its edges at the rounding length ρ from the tip. Its distance
from a line with normal n through the tip is

    δ = ρ (b·n / cos α − tan α)

so that the block can move by this much before it is stopped.

A rim of a few centimetres at the end of a plane acts like a sharp corner, but rounding does not release it. The factor
without it is found by leaving out the corners and all faces shorter than a tenth of their block's size at the end of a
longer face of the same two blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kinematics.tolerances import LITTLE, ONE_FACE_SIN

#: Distance by which a toe that must not carry load is moved off, relative to its block's size √area.
_FAR = 0.02
#: A corner is a toe if its distance from the end of a face is less than this, in rounding lengths, or less than a
#: thousandth of its block's size √area, …
_NEAR = 1.0
#: … and the gap of that face is less than this fraction of that distance.
_TOUCHING = 0.1
#: A face shorter than this fraction of its block's size counts as a toe at the end of a longer face to which it is
#: inclined by more than this (sine of 20°).
_SHORT, _LEANS = 0.1, 0.34
#: Treatment of toes in a search for equilibrium: sharp tips as drawn, rounded, or without load.
SHARP, ROUNDED, FREE = "sharp", "rounded", "free"


@dataclass(frozen=True)
class Toe:
    """A corner of ``block`` at the point ``at`` (m) that obstructs its sliding along a face by touching ``other``.

    vertex, edge  of the blocks
    stands_off    m, distance of the rounded corner from the line that the sharp one touches
    force         N/m, that it carries
    """

    block: int
    other: int
    vertex: int
    edge: int
    at: tuple[float, float]
    stands_off: float
    force: float


def place(x: float, y: float) -> str:
    """Text of a point to the millimetre; adding zero turns −0 into 0."""
    return f"x = {round(x, 3) + 0.0:.7g}, y = {round(y, 3) + 0.0:.7g} m"


@dataclass(frozen=True, eq=False)
class ToeCorners:
    """Arrays (n_vertices,): next and previous vertex on the outline, block (``owner``), rounding length m, size √area
    (m) of the block, and initial position (``drawn``, (n_vertices, 2))."""

    after: np.ndarray
    before: np.ndarray
    owner: np.ndarray
    rounding: np.ndarray
    size: np.ndarray
    drawn: np.ndarray


def stand_off(
    vertex: np.ndarray, edge: np.ndarray, met: np.ndarray, geometry: np.ndarray, vertices: np.ndarray,
    corners: ToeCorners, toes: str,
) -> np.ndarray:  # fmt: skip
    """(n,) m: distance of the corner of each toe contact from its edge if ``toes`` are `ROUNDED` or `FREE`; negative
    for other contacts.

    ``vertex``, ``edge``, the corner ``met`` and ``geometry`` (n, 7) as in `ContactSet`, with springs at the corners;
    ``vertices`` (n_vertices, 2) m. `FREE` also includes corners that have come to touch something they were drawn apart
    from, and the ends of short faces next to longer ones.
    """
    out = np.full(len(vertex), -1.0)
    # Corner-to-corner contacts are rounded already.
    lone = (geometry[:, 4] <= 0.0) & (met < 0)
    near = np.maximum(_NEAR * corners.rounding, LITTLE * corners.size)
    faces = np.flatnonzero(
        (geometry[:, 4] > 0.0) & (geometry[:, 3] <= _TOUCHING * np.minimum(near[vertex], near[edge]))
    )
    if toes == FREE:
        short = _short_faces(vertex, edge, geometry, faces, corners)
        out[short] = _FAR * corners.size[vertex[short]]
    if not lone.any():
        return out
    # Ends of closed faces: vertices in contact with the face, and vertices of it near a contact of another block.
    ends = np.zeros(len(vertices), bool)
    ends[vertex[faces]] = True
    start, end = edge[faces], corners.after[edge[faces]]
    length = np.hypot(*(vertices[end] - vertices[start]).T)
    along = geometry[faces, 0] * length
    ends[start[along <= near[start]]] = True
    ends[end[length - along <= near[end]]] = True
    ending = ends[vertex]
    if toes == FREE:
        ending |= _drawn_apart(vertex, edge, corners) > _TOUCHING * near[vertex]
    rows = np.flatnonzero(lone & ending)
    if not len(rows):
        return out
    v, n = vertex[rows], geometry[rows, 1:3]

    def direction(of: np.ndarray) -> np.ndarray:
        way = vertices[of] - vertices[v]
        return way / np.hypot(way[:, 0], way[:, 1])[:, None]

    one, two = direction(corners.before[v]), direction(corners.after[v])
    half = one + two
    bisector = half / np.maximum(np.hypot(half[:, 0], half[:, 1]), 1e-300)[:, None]
    cosine = np.einsum("na,na->n", bisector, one)
    leans = np.minimum(np.einsum("na,na->n", one, n), np.einsum("na,na->n", two, n))
    # A side parallel to the edge forms a face with it once they touch.
    sharp = (leans > ONE_FACE_SIN) & (cosine > ONE_FACE_SIN)
    if toes == FREE:
        off = _FAR * corners.size[v]
    else:
        tangent = np.sqrt(np.maximum(0.0, 1.0 - cosine**2)) / np.maximum(cosine, 1e-300)
        off = corners.rounding[v] * (np.einsum("na,na->n", bisector, n) / np.maximum(cosine, 1e-300) - tangent)
    out[rows[sharp]] = np.maximum(off[sharp], 0.0)
    return out


def _short_faces(
    vertex: np.ndarray, edge: np.ndarray, geometry: np.ndarray, faces: np.ndarray, corners: ToeCorners
) -> np.ndarray:
    """Rows of the contacts on short faces next to longer ones of the same two blocks, with the corners at their ends;
    ``faces``: rows of the contacts on faces."""
    size = np.minimum(corners.size[vertex], corners.size[edge])
    # Each end of a face has half of its length.
    length = 2.0 * geometry[:, 4]
    is_short = length <= _SHORT * size
    some, long = faces[is_short[faces]], faces[~is_short[faces]]
    one, two = corners.owner[vertex], corners.owner[edge]
    low, high = np.minimum(one, two), np.maximum(one, two)
    point, across = geometry[:, 5:7], geometry[:, 1:3] * np.where(one < two, 1.0, -1.0)[:, None]
    out = np.zeros(len(vertex), bool)
    for row in some:
        same = (low == low[row]) & (high == high[row])
        near = same & (np.hypot(*(point - point[row]).T) <= 1.5 * length[row])
        partner = long[near[long]]
        if (np.abs(_cross(across[row], across[partner])) > _LEANS).any():
            out |= near & is_short & (np.abs(_cross(across[row], across)) < _LEANS)
    return np.flatnonzero(out)


def _cross(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    return one[0] * two[:, 1] - one[1] * two[:, 0]


def _drawn_apart(vertex: np.ndarray, edge: np.ndarray, corners: ToeCorners) -> np.ndarray:
    """(n,) m: initial distance of each ``vertex`` from the line of its ``edge``."""
    start = corners.drawn[edge]
    along, out = corners.drawn[corners.after[edge]] - start, corners.drawn[vertex] - start
    return (out[:, 0] * along[:, 1] - out[:, 1] * along[:, 0]) / np.hypot(along[:, 0], along[:, 1])
