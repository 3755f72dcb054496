"""First-order displacement of a block, and how a finished step moves its geometry, velocity and stress."""

from __future__ import annotations

import numpy as np
from numba import njit


def displacement_matrix(points: np.ndarray, centroid: np.ndarray) -> np.ndarray:
    """T (..., 2, 6) with u(x) = T (u0, v0, r0, εx, εy, γxy), for ``points`` (..., 2) about ``centroid`` (..., 2).

    Shi (1988), eq. 2.6: the six unknowns are the centroid's displacement, the rotation and the strains.
    """
    arm = np.asarray(points, dtype=float) - centroid
    x, y = arm[..., 0], arm[..., 1]
    t = np.zeros((*x.shape, 2, 6))
    t[..., 0, 0] = t[..., 1, 1] = 1.0
    t[..., 0, 2], t[..., 1, 2] = -y, x
    t[..., 0, 3], t[..., 1, 4] = x, y
    t[..., 0, 5], t[..., 1, 5] = y / 2, x / 2
    return t


def material_weights(loop_vertices: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(n,) weights w with Σw = 1 and Σ wᵢ xᵢ = ``point``: the point then follows the block's affine motion exactly.

    The weights of least norm, so that round-off of single vertices is averaged rather than amplified.
    """
    origin = loop_vertices.mean(axis=0)
    size = np.ptp(loop_vertices, axis=0).max()
    system = np.vstack([np.ones(len(loop_vertices)), ((loop_vertices - origin) / size).T])
    return np.linalg.lstsq(system, np.array([1.0, *((point - origin) / size)]), rcond=None)[0]


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True)
def advance(
    increment,
    carried,
    dt,
    static,
    vertices,
    vertex_start,
    moments,
    tangent,
    stress0,
    compliance,
    offset,
    crack_given,
    crack_strain,
):
    """The state after a step from its displacement ``increment`` (n_blocks, 6) about the old centroids.

    Vertices follow x' = c + d₀ + R(r)(I + ε)(x − c) with the exact rotation R, so a spinning block does not swell;
    stress, strain rates and crack strain are turned by the same R. Stress before turning is ``tangent`` Δε + ``stress0``.
    Velocity is 2d/dt − v (Shi 1988), or the mean rate d/dt in a ``static`` step, which carries none.
    Returns vertices, velocity, stress, crack strain, largest vertex displacement.
    """
    n_blocks = increment.shape[0]
    new_vertices = np.empty_like(vertices)
    velocity = np.empty((n_blocks, 6))
    new_stress = np.empty((n_blocks, 3))
    new_crack = np.empty((n_blocks, 3))
    largest = 0.0
    tensor = np.empty(3)
    for b in range(n_blocks):
        r = increment[b, 2]
        c, s = np.cos(r), np.sin(r)
        ex, ey, g = increment[b, 3], increment[b, 4], 0.5 * increment[b, 5]
        # R(I+ε) − I, formed without cancellation: cos r − 1 = −2 sin²(r/2).
        h = np.sin(0.5 * r)
        cm = -2.0 * h * h
        axx, axy = cm + c * ex - s * g, -s + c * g - s * ey
        ayx, ayy = s + s * ex + c * g, cm + s * g + c * ey
        for i in range(vertex_start[b], vertex_start[b + 1]):
            x, y = vertices[i, 0] - moments[b, 1], vertices[i, 1] - moments[b, 2]
            ux = increment[b, 0] + axx * x + axy * y
            uy = increment[b, 1] + ayx * x + ayy * y
            new_vertices[i, 0] = vertices[i, 0] + ux
            new_vertices[i, 1] = vertices[i, 1] + uy
            largest = max(largest, ux * ux + uy * uy)
        for k in range(6):
            if static:
                velocity[b, k] = increment[b, k] / dt
            else:
                velocity[b, k] = 2.0 * increment[b, k] / dt - carried[b, k]
        # Engineering shear rate: halve, turn, double.
        a, d, e = velocity[b, 3], velocity[b, 4], 0.5 * velocity[b, 5]
        velocity[b, 3] = c * c * a + s * s * d - 2 * s * c * e
        velocity[b, 4] = s * s * a + c * c * d + 2 * s * c * e
        velocity[b, 5] = 2.0 * (s * c * (a - d) + (c * c - s * s) * e)
        for k in range(3):
            tensor[k] = stress0[b, k]
            for m in range(3):
                tensor[k] += tangent[b, k, m] * increment[b, 3 + m]
        a, d, e = tensor[0], tensor[1], tensor[2]
        new_stress[b, 0] = c * c * a + s * s * d - 2 * s * c * e
        new_stress[b, 1] = s * s * a + c * c * d + 2 * s * c * e
        new_stress[b, 2] = s * c * (a - d) + (c * c - s * s) * e
        for k in range(3):
            if crack_given:
                tensor[k] = offset[b, k] + compliance[b, k, 0] * a + compliance[b, k, 1] * d + compliance[b, k, 2] * e
            else:
                tensor[k] = crack_strain[b, k]
        a, d, e = tensor[0], tensor[1], 0.5 * tensor[2]
        new_crack[b, 0] = c * c * a + s * s * d - 2 * s * c * e
        new_crack[b, 1] = s * s * a + c * c * d + 2 * s * c * e
        new_crack[b, 2] = 2.0 * (s * c * (a - d) + (c * c - s * s) * e)
    return new_vertices, velocity, new_stress, new_crack, np.sqrt(largest)


@njit(cache=True, fastmath=False, error_model="numpy", nogil=True)
def energies(velocity, stress, compliance, density, moments, fixed):
    """(kinetic, elastic) energy of all blocks, J/m: ½ ∫ρ|u̇|² of the linear velocity field, ½ A σ·C⁻¹σ."""
    kinetic = elastic = 0.0
    for b in range(velocity.shape[0]):
        area, xx, yy, xy = moments[b, 0], moments[b, 3], moments[b, 4], moments[b, 5]
        for k in range(3):
            for m in range(3):
                elastic += 0.5 * area * stress[b, k] * compliance[b, k, m] * stress[b, m]
        if fixed[b]:
            continue
        u, v, ex, ey = velocity[b, 0], velocity[b, 1], velocity[b, 3], velocity[b, 4]
        # u̇ = (u + ex x + p y, v + q x + ey y)
        p, q = 0.5 * velocity[b, 5] - velocity[b, 2], 0.5 * velocity[b, 5] + velocity[b, 2]
        square = area * (u * u + v * v) + (ex * ex + q * q) * xx + (p * p + ey * ey) * yy + 2 * (ex * p + q * ey) * xy
        kinetic += 0.5 * density[b] * square
    return kinetic, elastic
