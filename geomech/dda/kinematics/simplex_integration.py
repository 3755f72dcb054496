"""Simplex integration: exact area, centroid, second moments and mass matrix of polygonal blocks (Shi 1988)."""

from __future__ import annotations

import numpy as np

from ...compiled import UNCOUNTED, kept


@kept(fastmath=False, error_model="numpy", nogil=True)
def block_moments(vertices, next_vertex, vertex_start):
    """(n_blocks, 6): area, centroid x and y, and ∫x², ∫y², ∫xy about the centroid; m², m, m⁴.

    Green's theorem over every loop (holes run clockwise and so subtract themselves). The sums are taken about the
    block's own first vertex, which keeps their digits far from the origin; Shi (1988) calls them simplex integrals.
    """
    n_blocks = vertex_start.shape[0] - 1
    out = np.empty((n_blocks, 6))
    for b in range(n_blocks):
        first = vertex_start[b]
        ox, oy = vertices[first, 0], vertices[first, 1]
        area = mx = my = sxx = syy = sxy = 0.0
        for i in range(first, vertex_start[b + 1]):
            j = next_vertex[i]
            x0, y0 = vertices[i, 0] - ox, vertices[i, 1] - oy
            x1, y1 = vertices[j, 0] - ox, vertices[j, 1] - oy
            cross = x0 * y1 - x1 * y0
            area += cross
            mx += cross * (x0 + x1)
            my += cross * (y0 + y1)
            sxx += cross * (x0 * x0 + x0 * x1 + x1 * x1)
            syy += cross * (y0 * y0 + y0 * y1 + y1 * y1)
            sxy += cross * (2 * x0 * y0 + x0 * y1 + x1 * y0 + 2 * x1 * y1)
        area *= 0.5
        cx, cy = mx / (6 * area), my / (6 * area)
        out[b, 0] = area
        out[b, 1] = ox + cx
        out[b, 2] = oy + cy
        out[b, 3] = sxx / 12 - area * cx * cx
        out[b, 4] = syy / 12 - area * cy * cy
        out[b, 5] = sxy / 24 - area * cx * cy
    return out


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def fastest_vertex(rates, vertices, vertex_start, moments):
    """Largest speed of a vertex, m/s, for blocks with ``rates`` (n_blocks, 6) of their unknowns; blocks at rest are
    skipped."""
    largest = 0.0
    for b in range(rates.shape[0]):
        u, v, r, ex, ey, g = rates[b, 0], rates[b, 1], rates[b, 2], rates[b, 3], rates[b, 4], 0.5 * rates[b, 5]
        if u == 0.0 and v == 0.0 and r == 0.0 and ex == 0.0 and ey == 0.0 and g == 0.0:
            continue
        for i in range(vertex_start[b], vertex_start[b + 1]):
            x, y = vertices[i, 0] - moments[b, 1], vertices[i, 1] - moments[b, 2]
            vx, vy = u - r * y + ex * x + g * y, v + r * x + ey * y + g * x
            largest = max(largest, vx * vx + vy * vy)
    return np.sqrt(largest)


def mass_matrix(moments: np.ndarray, density: float | np.ndarray) -> np.ndarray:
    """Mass matrix (..., 6, 6) ∫ρ TᵀT dA of blocks, unknowns (u0, v0, r0, εx, εy, γxy); ``moments`` (..., 6) as from
    `block_moments`, ``density`` (...) kg/m³."""
    area, _, _, xx, yy, xy = np.moveaxis(np.asarray(moments, float), -1, 0)
    mass = np.zeros((*np.shape(area), 6, 6))
    for row, column, value in (
        (0, 0, area), (1, 1, area), (2, 2, xx + yy), (3, 3, xx), (4, 4, yy), (5, 5, (xx + yy) / 4),
        (2, 3, -xy), (2, 4, xy), (2, 5, (xx - yy) / 2), (3, 5, xy / 2), (4, 5, xy / 2),
    ):  # fmt: skip
        mass[..., row, column] = mass[..., column, row] = value
    return np.asarray(density)[..., None, None] * mass
