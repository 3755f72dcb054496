"""Midpoint configuration: the geometry on which the forces of a time step act.

A step from x₀ to x₁ has the displacement d = ½ (v₀ + v₁) dt, so that v₁² − v₀² is twice the work of the mean
acceleration over d. Forces with the lever arms and directions of the start of the step do another work: after a
rotation r in the step their direction is wrong by r/2, an error of first order in dt that accumulates. With the mean of
both ends,

    x_m = ½ (x₀ + x₁),    n_m = R(r/2) n₀,    Δ(n·w) = n_m·Δw + Δn·w_m + O(r³),

the motion that forces work on is the circular arc up to O(r³), and two blocks exchange the same angular momentum about
any point, Σ (c_m + x_m) × F = 0 (discrete gradients: Simo, Tarnow & Wong 1992; Gonzalez 2000). The end of the step is
predicted from its initial velocity, to second order, and corrected once from the computed motion where they differ
(impacts).

The α-scheme has its forces at the end of the step and uses the geometry there. Motion from there agrees with the arc
except for a known term of second order in r (`ContactSet.arc`). Static steps carry no velocity; their forces act on the
geometry of the start. Strain, stress and inertia of blocks stay on the axes of the start of the step, to which
generalised forces are rotated back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from .displacement_matrix import displacement_matrix


@kept(fastmath=False, error_model="numpy", nogil=True)
def _affine(increment, part):
    """(n_blocks, 6): centroid displacement (m) and displacement gradient, row by row, of ``part`` of a step's motion.

    The motion is the one that `advance` makes of ``increment`` (n_blocks, 6)."""
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
    """(n_blocks, 6) centroid displacement (m) and displacement gradient, row by row, of the motion that `advance` makes
    of ``increment`` (n_blocks, 6)."""
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
    """As `MidpointConfiguration.contacts`; ``edge`` (n, 2) m, the edges as vectors."""
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


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _to_start(xx, yy, xy, moment, affine, turn):
    """Generalised strain forces on the axes of the start: the symmetric part of G⁻¹ (Σ x ⊗ F) R.

    Σ x ⊗ F of forces F at arms x is given by its symmetric part and its ``moment``; G is the block's deformation
    gradient, R its rotation."""
    c, s = np.cos(turn), np.sin(turn)
    up, low = xy + 0.5 * moment, xy - 0.5 * moment
    a, b, d, e = c * xx + s * up, c * up - s * xx, c * low + s * yy, c * yy - s * low
    gxx, gxy, gyx, gyy = 1.0 + affine[2], affine[3], affine[4], 1.0 + affine[5]
    size = gxx * gyy - gxy * gyx
    return (gyy * a - gxy * d) / size, (gxx * e - gyx * b) / size, 0.5 * (gyy * b - gxy * e + gxx * d - gyx * a) / size


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _strains_back(vectors, block, other, geometry, size, affine, turn):
    """As `MidpointConfiguration.turn_back`; ``size`` (n_blocks,) is √area, m."""
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


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _rows_back(rows, owner, affine, turn):
    """Rotate the strain columns of ``rows`` (n, 6) of the blocks ``owner`` (n,) to the axes of the start, in place."""
    for k in range(rows.shape[0]):
        b, v = owner[k], rows[k]
        v[3], v[4], v[5] = _to_start(v[3], v[4], v[5], v[2], affine[b], turn[b])


@dataclass(frozen=True, eq=False)
class MidpointConfiguration:
    """The configuration on which the forces of a step act.

    vertices  (n_vertices, 2)  m
    moments   (n_blocks, 6)    `block_moments` of the start of the step, with the centroids of this configuration
    turn      (n_blocks,)      rotation since the start, rad; None: this is the configuration of the start
    """

    vertices: np.ndarray
    moments: np.ndarray
    turn: np.ndarray | None = None
    affine: np.ndarray | None = None
    start: np.ndarray | None = None

    @classmethod
    def of(
        cls, increment: np.ndarray | None, part: float, vertices: np.ndarray, owner: np.ndarray, moments: np.ndarray
    ) -> MidpointConfiguration:
        """The configuration after ``part`` (0 to 1) of ``increment`` (n_blocks, 6; None: the start).

        ``vertices`` (n_vertices, 2) m and ``moments`` (n_blocks, 6) of the start; ``owner`` (n_vertices,) block."""
        if increment is None:
            return cls(vertices, moments)
        affine, start = _affine(increment, part), np.ascontiguousarray(moments[:, 1:3])
        now = moments.copy()
        now[:, 1:3] += affine[:, :2]
        return cls(_moved(vertices, owner, affine, start), now, part * increment[:, 2], affine, start)

    @property
    def centroid(self) -> np.ndarray:
        """(n_blocks, 2) centroids, m."""
        return np.ascontiguousarray(self.moments[:, 1:3])

    def points(self, points: np.ndarray, owner: np.ndarray) -> np.ndarray:
        """(n, 2) current position of material ``points`` (n, 2) of the blocks ``owner`` (n,), from that at the start,
        m."""
        return points if self.turn is None else _moved(np.ascontiguousarray(points), owner, self.affine, self.start)

    def contacts(self, geometry: np.ndarray, block: np.ndarray, other: np.ndarray, along: np.ndarray) -> np.ndarray:
        """(n, 7) geometry of contacts here, from their ``geometry`` (n, 7) at the start (as in `ContactSet`).

        The point moves with ``block`` (n,), the normal rotates with ``other`` (n,), whose edges are ``along`` (n, 2)
        m."""
        if self.turn is None:
            return geometry
        return _contacts(geometry, block, other, self.affine, self.start, self.turn, along)

    def turn_back(self, vectors: np.ndarray, block: np.ndarray, other: np.ndarray, geometry: np.ndarray) -> None:
        """Rotate `contact_vectors` (n, 2, 12) of this ``geometry`` (n, 7) to the strain axes of the start, in place."""
        if self.turn is not None:
            size = np.sqrt(self.moments[:, 0])
            _strains_back(vectors, block, other, geometry, size, self.affine, self.turn)

    def loads_back(self, load: np.ndarray) -> np.ndarray:
        """(n_blocks, 6) generalised forces ``load`` on this configuration, on the strain axes of the start."""
        if self.turn is None or not load[:, 2:].any():
            return load
        out = load.copy()
        _rows_back(out, np.arange(len(out)), self.affine, self.turn)
        return out

    def displacement(self, points: np.ndarray, owner: np.ndarray | int) -> np.ndarray:
        """Displacement matrix T (..., 2, 6) at points (..., 2) of this configuration, for strains on the axes of the
        start; ``owner`` (...) are the points' blocks."""
        matrix = displacement_matrix(points, self.moments[owner, 1:3])
        if self.turn is not None:
            each = np.repeat(np.ravel(owner), 2)
            _rows_back(matrix.reshape(-1, 6), each, self.affine, self.turn)
        return matrix
