"""Where blocks are when the forces of a step act on them: in the middle of it.

A step from x₀ to x₁ has the displacement d = ½ (v₀ + v₁) dt, so that v₁² − v₀² is twice the work of the mean
acceleration on it. Forces that keep the arms and directions of the step's start do another work than that: turned by r
in the step they miss r/2 of it, an error of first order in dt that stays. With the mean of both ends' arms,

    x_m = ½ (x₀ + x₁),    n_m = R(r/2) n₀,    Δ(n·w) = n_m·Δw + Δn·w_m + O(r³),

the motion that forces work on is that of the arc, up to the third order in r, and the angular momentum that two blocks
pass to each other is the same about any point, Σ (c_m + x_m) × F = 0 (discrete gradients: Simo, Tarnow & Wong 1992;
Gonzalez 2000). Where the step is to lead is taken from the velocity it begins with, which is right to the second order,
and once more from its own motion where that went elsewhere (impacts).

The α-scheme, whose forces are those of the end of a step, takes the end's geometry so; motion from there is that of the
arc but for the second order in r, which is known as well as the geometry is (`ContactSet.arc`). Statics carry no
velocity, and their forces act where the step begins. Strains, stress and inertia of blocks stay on the axes of the
step's start throughout; generalised forces are turned back to these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...compiled import kept, part
from .displacement_matrix import displacement_matrix


@kept(fastmath=False, error_model="numpy", nogil=True)
def _affine(increment, part):
    """(n_blocks, 6): displacement of the centroid and gradient, row by row, of ``part`` of the motion that `advance`
    makes of ``increment`` (n_blocks, 6)."""
    out = np.empty((increment.shape[0], 6))
    for b in range(increment.shape[0]):
        c, s, h = np.cos(increment[b, 2]), np.sin(increment[b, 2]), np.sin(0.5 * increment[b, 2])
        ex, ey, g = increment[b, 3], increment[b, 4], 0.5 * increment[b, 5]
        cm = -2.0 * h * h
        out[b, 0], out[b, 1] = part * increment[b, 0], part * increment[b, 1]
        out[b, 2], out[b, 3] = part * (cm + c * ex - s * g), part * (-s + c * g - s * ey)
        out[b, 4], out[b, 5] = part * (s + s * ex + c * g), part * (cm + s * g + c * ey)
    return out


def affine_motion(increment: np.ndarray) -> np.ndarray:
    """(n_blocks, 6) displacement of each centroid and its gradient, row by row, that `advance` makes of ``increment``."""
    return _affine(increment, 1.0)


@kept(fastmath=False, error_model="numpy", nogil=True)
def _moved(points, owner, affine, centroid):
    out = np.empty_like(points)
    for i in range(points.shape[0]):
        b = owner[i]
        x, y = points[i, 0] - centroid[b, 0], points[i, 1] - centroid[b, 1]
        out[i, 0] = points[i, 0] + affine[b, 0] + affine[b, 2] * x + affine[b, 3] * y
        out[i, 1] = points[i, 1] + affine[b, 1] + affine[b, 4] * x + affine[b, 5] * y
    return out


@kept(fastmath=False, error_model="numpy", nogil=True)
def _contacts(geometry, block, other, affine, centroid, turn, edge):
    """As `Middle.contacts`; ``edge`` (n, 2) m, the edges as vectors."""
    out = geometry.copy()
    for k in range(geometry.shape[0]):
        a, b = block[k], other[k]
        nx, ny, gap = geometry[k, 1], geometry[k, 2], geometry[k, 3]
        px, py = geometry[k, 5], geometry[k, 6]
        fx, fy = px - gap * nx, py - gap * ny
        x, y = px - centroid[a, 0], py - centroid[a, 1]
        px += affine[a, 0] + affine[a, 2] * x + affine[a, 3] * y
        py += affine[a, 1] + affine[a, 4] * x + affine[a, 5] * y
        x, y = fx - centroid[b, 0], fy - centroid[b, 1]
        fx += affine[b, 0] + affine[b, 2] * x + affine[b, 3] * y
        fy += affine[b, 1] + affine[b, 4] * x + affine[b, 5] * y
        c, s = np.cos(turn[b]), np.sin(turn[b])
        mx, my = c * nx - s * ny, s * nx + c * ny
        out[k, 1], out[k, 2] = mx, my
        out[k, 3] = mx * (px - fx) + my * (py - fy)
        length = np.sqrt(edge[k, 0] * edge[k, 0] + edge[k, 1] * edge[k, 1])
        out[k, 0] += (mx * (py - fy) - my * (px - fx)) / length
        out[k, 5], out[k, 6] = px, py
    return out


@part(fastmath=False, error_model="numpy", nogil=True)
def _to_start(xx, yy, xy, moment, affine, turn):
    """What forces F at arms x, Σ x ⊗ F with this symmetric part and ``moment``, do to strains on the axes of the start:
    the symmetric part of G⁻¹ (Σ x ⊗ F) R, arms and forces as the block's own, unturned and unstrained, has them."""
    c, s = np.cos(turn), np.sin(turn)
    up, low = xy + 0.5 * moment, xy - 0.5 * moment
    a, b, d, e = c * xx + s * up, c * up - s * xx, c * low + s * yy, c * yy - s * low
    gxx, gxy, gyx, gyy = 1.0 + affine[2], affine[3], affine[4], 1.0 + affine[5]
    size = gxx * gyy - gxy * gyx
    return (gyy * a - gxy * d) / size, (gxx * e - gyx * b) / size, 0.5 * (gyy * b - gxy * e + gxx * d - gyx * a) / size


@kept(fastmath=False, error_model="numpy", nogil=True)
def _strains_back(vectors, block, other, geometry, size, affine, turn):
    """As `Middle.turn_back`; ``size`` (n_blocks,) m is √area."""
    for k in range(vectors.shape[0]):
        for side in range(2):
            b = block[k] if side == 0 else other[k]
            at = 6 * side
            for way in range(2):
                v = vectors[k, way]
                if v[at] == 0.0 and v[at + 1] == 0.0:
                    continue  # a block without unknowns
                moment = v[at + 2]
                if side == 1 and way == 1:
                    # The edge is strained at the foot of the vertex, about which the shear has another moment.
                    moment += geometry[k, 3] / size[b]
                v[at + 3], v[at + 4], v[at + 5] = _to_start(v[at + 3], v[at + 4], v[at + 5], moment, affine[b], turn[b])


@kept(fastmath=False, error_model="numpy", nogil=True)
def _rows_back(rows, owner, affine, turn):
    """Bring the strain columns of ``rows`` (n, 6) of the blocks ``owner`` (n,) to the start, in place."""
    for k in range(rows.shape[0]):
        b, v = owner[k], rows[k]
        v[3], v[4], v[5] = _to_start(v[3], v[4], v[5], v[2], affine[b], turn[b])


@dataclass(frozen=True, eq=False)
class Middle:
    """The geometry on which the forces of a step act.

    vertices  (n_vertices, 2)  m
    moments   (n_blocks, 6)    those of the step's start about centroids where they are now
    turn      (n_blocks,)      rad since the start; None where this is the start itself
    """

    vertices: np.ndarray
    moments: np.ndarray
    turn: np.ndarray | None = None
    affine: np.ndarray | None = None
    start: np.ndarray | None = None

    @classmethod
    def of(
        cls, increment: np.ndarray | None, part: float, vertices: np.ndarray, owner: np.ndarray, moments: np.ndarray
    ) -> Middle:
        """``part`` of the way of ``increment`` (n_blocks, 6) from ``vertices``, whose blocks are ``owner``
        (n_vertices,) and have these ``moments``; None: the start."""
        if increment is None:
            return cls(vertices, moments)
        affine, start = _affine(increment, part), np.ascontiguousarray(moments[:, 1:3])
        now = moments.copy()
        now[:, 1:3] += affine[:, :2]
        return cls(_moved(vertices, owner, affine, start), now, part * increment[:, 2], affine, start)

    @property
    def centroid(self) -> np.ndarray:
        """(n_blocks, 2) m."""
        return np.ascontiguousarray(self.moments[:, 1:3])

    def points(self, points: np.ndarray, owner: np.ndarray) -> np.ndarray:
        """(n, 2) where material ``points`` (n, 2) of the blocks ``owner`` (n,) are, given where they were."""
        return points if self.turn is None else _moved(np.ascontiguousarray(points), owner, self.affine, self.start)

    def contacts(self, geometry: np.ndarray, block: np.ndarray, other: np.ndarray, along: np.ndarray) -> np.ndarray:
        """(n, 7) of contacts, from their ``geometry`` at the start (as in `ContactSet`): the point goes with ``block``
        (n,), the normal turns with ``other`` (n,), whose edges are ``along`` (n, 2) m."""
        if self.turn is None:
            return geometry
        return _contacts(geometry, block, other, self.affine, self.start, self.turn, along)

    def turn_back(self, vectors: np.ndarray, block: np.ndarray, other: np.ndarray, geometry: np.ndarray) -> None:
        """Bring `contact_vectors` (n, 2, 12) made of this ``geometry`` (n, 7) to the axes of strain, in place."""
        if self.turn is not None:
            size = np.sqrt(self.moments[:, 0])
            _strains_back(vectors, block, other, geometry, size, self.affine, self.turn)

    def loads_back(self, load: np.ndarray) -> np.ndarray:
        """(n_blocks, 6) generalised forces ``load`` on this geometry, on the axes of strain."""
        if self.turn is None or not load[:, 2:].any():
            return load
        out = load.copy()
        _rows_back(out, np.arange(len(out)), self.affine, self.turn)
        return out

    def displacement(self, points: np.ndarray, owner: np.ndarray | int) -> np.ndarray:
        """T (..., 2, 6), as `displacement_matrix` gives it, of points (..., 2) on this geometry, which follow the
        blocks ``owner`` (...), for strains on the axes of the start."""
        matrix = displacement_matrix(points, self.moments[owner, 1:3])
        if self.turn is not None:
            each = np.repeat(np.ravel(owner), 2)
            _rows_back(matrix.reshape(-1, 6), each, self.affine, self.turn)
        return matrix
