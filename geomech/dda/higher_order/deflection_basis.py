"""Basis of deflection: the part of a complete polynomial displacement that is not in Shi's six unknowns.

The displacement of a block of order p is

    u(X) = T(X) d + R P(X) q,

with Shi's T and d = (u0, v0, r0, εx, εy, γxy), the block's rotation R and its deflection q of (p + 1)(p + 2) − 6
unknowns (m). X are coordinates of the undeformed block. The columns of P are polynomials of degree 2 to p and an affine
part such that

    ∫ P dA = 0,   ∫ X × P dA = 0,   ∫ ε(P) dA = 0,   ∫ Pᵢ · Pⱼ dA = A δᵢⱼ:

deflection has neither momentum nor mean strain, and d keeps its meaning of a first-order block: its strains are the
mean strains of the block, and first-order stress and stiffness are those of the mean. The mass matrix of q is ρ A times
the identity; strain rates and deflection are coupled by inertia (`DeflectionBasis.coupling`), but not by stiffness.

Products of Legendre polynomials in the block's principal axes, scaled to its bounding box, and the Cholesky factor of
their Gram matrix, applied twice, keep the basis orthonormal to round-off up to p = 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ...model import HIGHEST_ORDER
from ..kinematics.displacement_matrix import displacement_matrix
from ..kinematics.polygon_quadrature import polygon_points

#: The highest order of a basis: the error estimate uses two orders more than a block has.
_HIGHEST_BASIS = HIGHEST_ORDER + 2


#: A number, or many.
Orders = TypeVar("Orders", int, np.ndarray)


def n_deflections(order: Orders) -> Orders:
    """Number of unknowns of deflection of a block of this ``order``."""
    return (order + 1) * (order + 2) - 6


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _legendre(x, order, value, slope):
    """Legendre polynomials of degree 0 to ``order`` at ``x`` and their derivatives, into ``value`` and ``slope``."""
    value[0], slope[0] = 1.0, 0.0
    value[1], slope[1] = x, 1.0
    for n in range(2, order + 1):
        value[n] = ((2 * n - 1) * x * value[n - 1] - (n - 1) * value[n - 2]) / n
        slope[n] = slope[n - 2] + (2 * n - 1) * value[n - 1]


@kept(fastmath=False, error_model="numpy", nogil=True)
def _evaluate(owner, points, order, centre, to_box, coefficients, gradients):
    """Displacement (n, 2, m) of unit deflections at ``points`` (n, 2) of the blocks ``owner`` (n,), or, if
    ``gradients``, its derivatives (n, 4, m): ∂ux/∂x, ∂ux/∂y, ∂uy/∂x, ∂uy/∂y."""
    n, most = len(owner), coefficients.shape[3]
    out = np.zeros((n, 4 if gradients else 2, most))
    size = 2
    for b in range(len(order)):
        size = max(size, order[b] + 1)
    px, py, dx, dy = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    for i in range(n):
        b = owner[i]
        p = order[b]
        if p < 2:
            continue
        x, y = points[i, 0] - centre[b, 0], points[i, 1] - centre[b, 1]
        _legendre(to_box[b, 0, 0] * x + to_box[b, 0, 1] * y, p, px, dx)
        _legendre(to_box[b, 1, 0] * x + to_box[b, 1, 1] * y, p, py, dy)
        own = (p + 1) * (p + 2) - 6
        term = 0
        for degree in range(p + 1):
            for k in range(degree + 1):
                f = px[degree - k] * py[k]
                fx, fy = dx[degree - k] * py[k], px[degree - k] * dy[k]
                gx = fx * to_box[b, 0, 0] + fy * to_box[b, 1, 0]
                gy = fx * to_box[b, 0, 1] + fy * to_box[b, 1, 1]
                for way in range(2):
                    given = coefficients[b, term, way]
                    if gradients:
                        for j in range(own):
                            out[i, 2 * way, j] += gx * given[j]
                            out[i, 2 * way + 1, j] += gy * given[j]
                    else:
                        for j in range(own):
                            out[i, way, j] += f * given[j]
                term += 1
    return out


def _principal_box(loop: np.ndarray, points: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre (2,) and matrix (2, 2) that map the block's bounding box along its principal axes to the square [−1, 1]².

    ``loop`` (n, 2) are the vertices; ``points`` and ``weights`` integrate over the area.
    """
    area = weights.sum()
    arm = points - weights @ points / area
    second = np.einsum("k,ka,kb->ab", weights, arm, arm)
    # A square or a disc has no principal axes: the coordinate axes serve.
    deviator = 0.5 * (second[0, 0] - second[1, 1]), second[0, 1]
    even = np.hypot(*deviator) <= 1e-9 * (second[0, 0] + second[1, 1])
    angle = 0.0 if even else 0.5 * np.arctan2(deviator[1], deviator[0])
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    along = loop @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    return 0.5 * (low + high) @ axes, axes * (2.0 / (high - low))[:, None]


def _integral(weights: np.ndarray, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """(i, j) ∫ oneᵀ two dA of fields (k, a, i) and (k, a, j) at points with these ``weights`` (k,)."""
    return (one * weights[:, None, None]).reshape(-1, one.shape[2]).T @ two.reshape(-1, two.shape[2])


@dataclass(frozen=True, eq=False)
class DeflectionBasis:
    """Basis of deflection of blocks, each with its own order.

    order         (n_blocks,)            p; 1: the block has no deflection
    start         (n_blocks + 1,)        first unknown of each block among those of all blocks
    area          (n_blocks,)            m², undeformed
    centroid      (n_blocks, 2)          m, undeformed
    centre        (n_blocks, 2)          m, of the box on which the Legendre polynomials are defined
    to_box        (n_blocks, 2, 2)       from X − centre to the square [−1, 1]²
    coefficients  (n_blocks, k, 2, m)    of the products of Legendre polynomials; padded with zeros
    coupling      (n_blocks, 3, m)       ∫ (∂u/∂ε)ᵀ P dA, the inertia that couples strain rates and deflection, m³
    """

    order: np.ndarray
    start: np.ndarray
    area: np.ndarray
    centroid: np.ndarray
    centre: np.ndarray
    to_box: np.ndarray
    coefficients: np.ndarray
    coupling: np.ndarray

    @classmethod
    def of(
        cls, vertices: np.ndarray, next_vertex: np.ndarray, vertex_start: np.ndarray, order: np.ndarray
    ) -> DeflectionBasis:
        """Basis of undeformed blocks of this ``order`` (n_blocks,).

        ``vertices`` (n_vertices, 2) m; ``next_vertex`` (n_vertices,); ``vertex_start`` first vertex of each block.
        Raises ValueError for an order that is not 1 to 10.
        """
        order = np.array(order, np.int64)
        if len(order) and not (order.min() >= 1 and order.max() <= _HIGHEST_BASIS):
            raise ValueError(f"the order of a basis is 1 to {_HIGHEST_BASIS}, got {order.min()} to {order.max()}")
        n, highest = len(order), int(order.max(initial=1))
        own = n_deflections(order)
        terms, most = (highest + 1) * (highest + 2) // 2, int(own.max(initial=0))
        basis = cls(
            order=order,
            start=np.concatenate([[0], np.cumsum(own)]),
            area=np.zeros(n),
            centroid=np.zeros((n, 2)),
            centre=np.zeros((n, 2)),
            to_box=np.zeros((n, 2, 2)),
            coefficients=np.zeros((n, terms, 2, most)),
            coupling=np.zeros((n, 3, most)),
        )
        for b in range(n):
            some = np.arange(vertex_start[b], vertex_start[b + 1])
            points, weights = polygon_points(
                vertices[some], vertices[next_vertex[some]], vertices[some].mean(axis=0), 2 * int(order[b])
            )
            basis.area[b] = weights.sum()
            basis.centroid[b] = weights @ points / weights.sum()
            basis.centre[b], basis.to_box[b] = _principal_box(vertices[some], points, weights)
            if order[b] > 1:
                basis._orthonormalise(b, points, weights)
        return basis

    @property
    def n_unknowns(self) -> int:
        return int(self.start[-1])

    def of_block(self, block: int) -> slice:
        """Slice of the unknowns of ``block`` among those of all blocks."""
        return slice(int(self.start[block]), int(self.start[block + 1]))

    def displacement(self, points: np.ndarray, owner: np.ndarray | int) -> np.ndarray:
        """P (n, 2, m) at undeformed ``points`` (n, 2) of the blocks ``owner``; padded with zeros."""
        return self._evaluated(points, owner, False)

    def strain(self, points: np.ndarray, owner: np.ndarray | int) -> np.ndarray:
        """ε(P) (n, 3, m), engineering shear strain, 1/m; arguments as of `displacement`."""
        slope = self._evaluated(points, owner, True)
        return np.stack([slope[:, 0], slope[:, 3], slope[:, 1] + slope[:, 2]], axis=1)

    def gradient(self, points: np.ndarray, owner: np.ndarray | int) -> np.ndarray:
        """∇P (n, 4, m), 1/m: ∂ux/∂x, ∂ux/∂y, ∂uy/∂x, ∂uy/∂y; arguments as of `displacement`."""
        return self._evaluated(points, owner, True)

    def stiffness(self, block: int, start: np.ndarray, end: np.ndarray, elastic: np.ndarray) -> np.ndarray:
        """(m, m) ∫ ε(P)ᵀ C ε(P) dA of ``block``, Pa; its edges run from ``start`` to ``end`` (n, 2), C is ``elastic``
        (3, 3) Pa."""
        points, weights = polygon_points(start, end, self.centroid[block], 2 * int(self.order[block]) - 2)
        strain = self.strain(points, block)[..., : n_deflections(int(self.order[block]))]
        out = _integral(weights, strain, elastic @ strain)
        return 0.5 * (out + out.T)

    def _evaluated(self, points: np.ndarray, owner: np.ndarray | int, gradients: bool) -> np.ndarray:
        points = np.ascontiguousarray(points, float).reshape(-1, 2)
        owner = np.full(len(points), owner, np.int64)
        return _evaluate(owner, points, self.order, self.centre, self.to_box, self.coefficients, gradients)

    def _orthonormalise(self, block: int, points: np.ndarray, weights: np.ndarray) -> None:
        """Compute the coefficients and the coupling of ``block``; ``points`` and ``weights`` are exact for degree 2
        p."""
        order, coefficients = int(self.order[block]), self.coefficients[block]
        own, area = int(n_deflections(order)), self.area[block]
        for j in range(own):
            # The 3 terms of first order come last, as the affine part.
            coefficients[3 + j // 2, j % 2, j] = 1.0
        for _ in range(2):
            self._without_affine_part(block, points, weights)
            values = self.displacement(points, block)[..., :own]
            gram = _integral(weights, values, values) / area
            factor = np.linalg.cholesky(gram)
            coefficients[..., :own] = np.linalg.solve(factor, coefficients[..., :own].reshape(-1, own).T).T.reshape(
                coefficients[..., :own].shape
            )
        values = self.displacement(points, block)
        by_strain = displacement_matrix(points, self.centroid[block])[..., 3:]
        self.coupling[block] = _integral(weights, by_strain, values)

    def _without_affine_part(self, block: int, points: np.ndarray, weights: np.ndarray) -> None:
        """Subtract rigid motion (by mass) and mean strain from the columns of ``block``."""
        matrix = displacement_matrix(points, self.centroid[block])
        values, strain = self.displacement(points, block), self.strain(points, block)
        mean = np.tensordot(weights, strain, 1) / self.area[block]
        values = values - matrix[..., 3:] @ mean
        rigid = matrix[..., :3]
        mass = _integral(weights, rigid, rigid)
        motion = np.linalg.solve(mass, _integral(weights, rigid, values))
        # The affine field T(X) (motion, mean) in terms of 1, ξ, η of the box, about its centre.
        gradient = np.array(
            [[mean[0], 0.5 * mean[2] - motion[2]], [0.5 * mean[2] + motion[2], mean[1]]]
        )  # (2, 2, m): ∂u_a/∂x_b
        shift = self.centre[block] - self.centroid[block]
        constant = motion[:2] + shift[0] * gradient[:, 0] + shift[1] * gradient[:, 1]
        (a, b), (c, d) = self.to_box[block]
        # ∂u/∂ξ = ∂u/∂x · (inverse of the matrix to the box).
        inverse = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
        slopes = np.swapaxes(np.swapaxes(gradient, 1, 2) @ inverse, 1, 2)
        coefficients = self.coefficients[block]
        coefficients[0] -= constant
        coefficients[1] -= slopes[:, 0]
        coefficients[2] -= slopes[:, 1]
