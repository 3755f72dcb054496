"""Supports on holes: constraints that tie a supported hole to the rest of the body.

Any rigid motion of the plane inside a hole is free of traction. Where a support constrains the hole's boundary, that
motion must be set to zero: equations in displacement. By reciprocity, the displacement at a point is the work that the
Kelvin field of a unit force at that point does on line forces, and its tractions do on displacement jumps.
"""

from __future__ import annotations

import numpy as np

from ..kernels import shape_functions
from ..kernels.point_forces import KelvinLoad
from ..system.influence_matrix import ElementSet

#: Gauss points per source; the constrained points are several elements away.
_POINTS = 24


class Anchors:
    """Rigid motions of holes that supports constrain.

    rows  (n, r) their distribution over the boundary's equations, in which traction leaves r of them undetermined

    `of_jumps`, `of_forces` and `of_points` give the r motions, times 2μ, that sources impart to the inside of the
    holes.
    """

    def __init__(self, nu: float, extent: float):
        # Kelvin's stresses do not depend on μ; with 2μ = 1 his displacement is the true one times 2μ.
        self._unit, self._extent = _Unit(nu), extent
        self.rows = np.empty((0, 0))
        self._forces: list[list[tuple[np.ndarray, np.ndarray]]] = []

    def add(
        self, rows: np.ndarray, combinations: np.ndarray, centroid: np.ndarray, radius: float, loop: np.ndarray
    ) -> None:
        """Add the ``combinations`` (3, k) of translation in x, in y and rotation of the hole ``loop`` (m, 2), with
        their ``rows`` (n, k). A unit rotation moves points at ``radius`` from ``centroid`` by one."""
        self.rows = rows if not self.rows.size else np.hstack([self.rows, rows])
        centre, room = _deepest_point(loop)
        arm = centroid - centre
        for x, y, turn in combinations.T:
            # Coefficients of the rigid motion: u(middle) = u(centre) + ω × arm, and ω radius.
            couple = 0.25 * room
            spin = (-x * arm[1] + y * arm[0] + turn * radius) / (2 * couple)
            self._forces.append(
                [
                    (centre, np.array([x, y])),
                    (centre + [couple, 0.0], np.array([0.0, spin])),
                    (centre - [couple, 0.0], np.array([0.0, -spin])),
                ]
            )

    @property
    def number(self) -> int:
        """The number of motions, r."""
        return len(self._forces)

    def _fields(self):
        return [
            [KelvinLoad(point, force, self._unit, self._extent) for point, force in forces] for forces in self._forces
        ]

    def of_jumps(self, sources: ElementSet) -> np.ndarray:
        """(r, n_unknowns) from unit nodal jumps, local."""
        points, values, weights = _quadrature(sources)
        out = np.zeros((len(self._forces), sources.n, 2, sources.per))
        for j, fields in enumerate(self._fields()):
            s = sum(f.stress(points.reshape(-1, 2)) for f in fields).reshape(*points.shape[:2], 3)
            n, t = sources.normal[:, None], sources.tangent[:, None]
            tx = s[..., 0] * n[..., 0] + s[..., 2] * n[..., 1]
            ty = s[..., 2] * n[..., 0] + s[..., 1] * n[..., 1]
            for c, axis in enumerate((t, n)):
                along = tx * axis[..., 0] + ty * axis[..., 1]
                out[j, :, c] = np.einsum("eq,eq,eqn->en", along, weights, values)
        return out.reshape(len(out), -1)

    def of_forces(self, start: np.ndarray, end: np.ndarray, degree: int) -> np.ndarray:
        """(r, m, 2, degree + 1) from line forces t^k along and normal to straight pieces."""
        x, w = np.polynomial.legendre.leggauss(_POINTS)
        d = end - start
        half = 0.5 * np.hypot(*d.T)
        t = d / (2 * half)[:, None]
        points = 0.5 * (start + end)[:, None] + 0.5 * x[:, None] * d[:, None]
        powers = np.vander(x, degree + 1, increasing=True) * w[:, None]
        out = np.empty((len(self._forces), len(start), 2, degree + 1))
        for j, fields in enumerate(self._fields()):
            u = sum(f.displacement(points.reshape(-1, 2)) for f in fields).reshape(points.shape)
            for c, axis in enumerate((t, np.column_stack([-t[:, 1], t[:, 0]]))):
                out[j, :, c] = np.einsum("mqc,mc,qk->mk", u, axis, powers) * half[:, None]
        return out

    def of_shapes(self, sources: ElementSet) -> np.ndarray:
        """(r, n_unknowns) from unit nodal line forces, local."""
        unit = self.of_forces(sources.start, sources.end, sources.order)
        to_nodal = shape_functions.to_monomials(sources.family, sources.order, shape_functions.ORDINARY)
        return (unit @ to_nodal).reshape(self.number, -1)

    def of_points(self, points: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """(r,) from point ``forces`` (m, 2) at ``points`` (m, 2)."""
        out = [sum(f.displacement(points) for f in fields) for fields in self._fields()]
        return np.array([np.sum(u * forces) for u in out])


class _Unit:
    """A material with 2μ = 1."""

    shear_modulus = 0.5

    def __init__(self, nu: float):
        self.effective_poissons_ratio = nu


def _quadrature(sources: ElementSet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, q, 2), shape functions (n, q, p+1) and weights (n, q), for square roots at either end."""
    x, w = np.polynomial.legendre.leggauss(_POINTS)
    angle = 0.5 * np.pi * (x + 1)
    t, w = -np.cos(angle), 0.5 * np.pi * w * np.sin(angle)
    values = np.array([shape_functions.at(sources.family, sources.order, kind, t) for kind in range(4)])
    return sources.at(t), values[sources.kind], 0.5 * sources.length[:, None] * w


def _deepest_point(loop: np.ndarray) -> tuple[np.ndarray, float]:
    """A point (2,) inside ``loop`` far from its edges, and its distance from them."""
    from ..mesh.geometry_checks import _to_segments
    from ..mesh.point_location import inside

    low, size = loop.min(axis=0), np.ptp(loop, axis=0)
    grid = np.stack(np.meshgrid(*[np.linspace(0.02, 0.98, 49)] * 2), axis=-1).reshape(-1, 2)
    points = low + grid * size
    points = points[inside([loop[::-1]], points)]
    distance = _to_segments(points, np.stack([loop, np.roll(loop, -1, axis=0)], axis=1))
    at = int(np.argmax(distance))
    return points[at], float(distance[at])
