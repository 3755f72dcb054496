"""Simplex integration of any order: points and weights that integrate polynomials over polygons exactly.

A polygon is the signed sum of the triangles between a point c and its edges (Shi 1988 calls this simplex integration):
∫_A f dA = Σ_edges ∫_triangle f dA, where triangles of clockwise edges, such as those of holes, count negative. On each
triangle, Duffy's (1982) map of the square, x = c + r (v₀ + s (v₁ − v₀) − c) with the Jacobian r |(v₀ − c) × (v₁ − c)|,
makes Gauss–Legendre points in r and s exact.
"""

from __future__ import annotations

from functools import cache

import numpy as np


@cache
def gauss_points(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The ``n`` Gauss–Legendre points and weights on [0, 1], exact for degree 2n − 1."""
    at, weight = np.polynomial.legendre.leggauss(n)
    return 0.5 * (at + 1.0), 0.5 * weight


@cache
def lobatto_points(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The ``n`` ≥ 2 Gauss–Lobatto points and weights on [0, 1], both ends included, exact for degree 2n − 3."""
    last = np.polynomial.legendre.Legendre.basis(n - 1)
    at = np.concatenate([[-1.0], np.sort(np.real(last.deriv().roots())), [1.0]])
    # Made exactly antisymmetric about 0, so that mirrored faces get mirrored points.
    at = 0.5 * (at - at[::-1])
    return 0.5 * (at + 1.0), 1.0 / (n * (n - 1) * last(at) ** 2)


def polygon_points(start: np.ndarray, end: np.ndarray, about: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 2) and signed weights (k,), m², exact for polynomials of this ``degree`` over a polygon.

    Its edges run from ``start`` to ``end`` (n, 2), m, the outline counter-clockwise and holes clockwise; the triangles
    meet in ``about`` (2,).
    """
    at, weight = gauss_points(degree // 2 + 2)
    first, second = start - about, end - about
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    on_edge = first[:, None] + at[:, None] * (second - first)[:, None]
    points = about + at[None, :, None, None] * on_edge[:, None]
    weights = cross[:, None, None] * (weight * at)[None, :, None] * weight
    return points.reshape(-1, 2), weights.ravel()
