"""Sharp toes: corners of a block that stick in a re-entrant corner, between a face that they slide along and what ends it.

A block on a plane that ends in a floor, and the active block of a bilinear plane, touch with their last corner what bars
the way. Two sharp corners there hold any force, whatever the joints are like; rock has no such corners, and to cut a
centimetre off the toe, which changes nothing in the forces, frees the block. Rounded by a circle that touches both its
edges at the rounding length ρ from the tip, the corner with the half angle α and the inward bisector b stands off a
line with the normal n by

    δ = ρ (b·n / cos α − tan α)

when its tip is on it, and the block moves on by as much before it is held.

A rim of a few centimetres at the end of a plane holds as a sharp corner does, and no rounding frees it. What the factor
is without it is found by leaving out, with the corners, all faces shorter than a tenth of their block's size that stand
at the end of a longer face of the same two blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Sides that lean to an edge by less than this (sine of 3°) make a face with it, which is no toe's.
_LEAN = 0.053
#: Toes that hold nothing stand off by this part of their block's size, √area.
_FAR = 0.02
#: A corner is a toe's so near to the end of a face, in rounding lengths or parts of its block's size, √area, …
_NEAR, _NEAR_IN_SIZES = 1.0, 1e-3
#: … whose sides are no farther apart than this part of that.
_TOUCHING = 0.1
#: Faces up to this part of their block's size hold as a toe does, at the end of a face that is longer than that, to
#: which they lean by more than this (sine of 20°).
_SHORT, _LEANS = 0.1, 0.34
#: What toes do in a search for equilibrium: hold with their sharp tips, are rounded, or hold nothing at all.
SHARP, ROUNDED, FREE = "sharp", "rounded", "free"


@dataclass(frozen=True)
class Toe:
    """A corner of ``block`` at the point ``at`` (m) that bars its way along a face by touching ``other``.

    vertex, edge  of the blocks
    stands_off    m by which the rounded corner stands off where the sharp one touches
    force         N/m that it bears
    """

    block: int
    other: int
    vertex: int
    edge: int
    at: tuple[float, float]
    stands_off: float
    force: float


@dataclass(frozen=True, eq=False)
class ToeCorners:
    """Of each vertex (n_vertices,): the next one and the one before on its outline, its block (``owner``), its rounding
    length m, the size √area (m) of its block, and where it was ``drawn`` (n_vertices, 2)."""

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
    """(n,) m by which the corner of each contact that is a toe's stands off its edge, when ``toes`` are `ROUNDED` or
    `FREE`; below zero for other contacts.

    ``vertex``, ``edge``, the corner that is ``met`` and ``geometry`` (n, 7) as in `ContactSet`, springs at the corners; ``vertices`` (n_vertices, 2)
    m. Of those that are `FREE` are also corners that have come to touch what they were drawn apart from, and the ends of
    short faces beside longer ones.
    """
    out = np.full(len(vertex), -1.0)
    # Two corners that meet are rounded already.
    lone = (geometry[:, 4] <= 0.0) & (met < 0)
    near = np.maximum(_NEAR * corners.rounding, _NEAR_IN_SIZES * corners.size)
    faces = np.flatnonzero(
        (geometry[:, 4] > 0.0) & (geometry[:, 3] <= _TOUCHING * np.minimum(near[vertex], near[edge]))
    )
    if toes == FREE:
        short = _short_faces(vertex, edge, geometry, faces, corners)
        out[short] = _FAR * corners.size[vertex[short]]
    if not lone.any():
        return out
    # Vertices that end a face which touches: those that stand on it, and those near which another's stand.
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
    middle = half / np.maximum(np.hypot(half[:, 0], half[:, 1]), 1e-300)[:, None]
    cosine = np.einsum("na,na->n", middle, one)
    leans = np.minimum(np.einsum("na,na->n", one, n), np.einsum("na,na->n", two, n))
    # A side that lies along the edge makes a face with it as soon as they come to lie on each other.
    sharp = (leans > _LEAN) & (cosine > _LEAN)
    if toes == FREE:
        off = _FAR * corners.size[v]
    else:
        tangent = np.sqrt(np.maximum(0.0, 1.0 - cosine**2)) / np.maximum(cosine, 1e-300)
        off = corners.rounding[v] * (np.einsum("na,na->n", middle, n) / np.maximum(cosine, 1e-300) - tangent)
    out[rows[sharp]] = np.maximum(off[sharp], 0.0)
    return out


def _short_faces(
    vertex: np.ndarray, edge: np.ndarray, geometry: np.ndarray, faces: np.ndarray, corners: ToeCorners
) -> np.ndarray:
    """Rows of the contacts on a short face beside a longer one of the same two blocks, corners at its ends included;
    ``faces``: rows of the contacts on faces."""
    size = np.minimum(corners.size[vertex], corners.size[edge])
    # Each end of a face stands for half of it.
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
        beside = long[near[long]]
        if (np.abs(_cross(across[row], across[beside])) > _LEANS).any():
            out |= near & is_short & (np.abs(_cross(across[row], across)) < _LEANS)
    return np.flatnonzero(out)


def _cross(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    return one[0] * two[:, 1] - one[1] * two[:, 0]


def _drawn_apart(vertex: np.ndarray, edge: np.ndarray, corners: ToeCorners) -> np.ndarray:
    """(n,) m by which each ``vertex`` was drawn off the line of its ``edge``."""
    start = corners.drawn[edge]
    along, out = corners.drawn[corners.after[edge]] - start, corners.drawn[vertex] - start
    return (out[:, 0] * along[:, 1] - out[:, 1] * along[:, 0]) / np.hypot(along[:, 0], along[:, 1])
