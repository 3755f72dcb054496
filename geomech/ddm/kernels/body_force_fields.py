"""A particular solution for body forces that vary linearly.

For a force b = b0 + B X per volume, X measured from any origin, with M = λ + 2μ the cubic field

    u_x = −(b0x x²/2 + Bxx x³/6)/M − Bxy y³/(6μ),    u_y = −(b0y y²/2 + Byy y³/6)/M − Byx x³/(6μ)

satisfies Navier's equations (by direct substitution); gravity, linear acceleration and spin are of this form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import Material
from ..mesh.half_plane import HalfPlane


@dataclass(frozen=True, eq=False)
class Particular:
    """``origin`` (2,), ``force`` (2,) N/m³ there, ``gradient`` (2, 2) N/m⁴, ``uniform`` (3,) Pa added everywhere."""

    origin: np.ndarray
    force: np.ndarray
    gradient: np.ndarray
    uniform: np.ndarray
    material: Material

    @property
    def sizes(self) -> np.ndarray:
        """(6,) factors of the unit body forces."""
        return np.concatenate([self.force, self.gradient.ravel()])

    def stress(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) Pa, the uniform part included."""
        return self.stress_of_force(points) + self.uniform

    def stress_of_force(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) Pa, of the body force alone."""
        x, y = (np.asarray(points) - self.origin).T
        b, g = self.force, self.gradient
        nu = self.material.effective_poissons_ratio
        ratio = nu / (1 - nu)
        fx = b[0] * x + 0.5 * g[0, 0] * x * x
        fy = b[1] * y + 0.5 * g[1, 1] * y * y
        return np.column_stack([-fx - ratio * fy, -fy - ratio * fx, -0.5 * (g[0, 1] * y * y + g[1, 0] * x * x)])

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m, of the body force and the uniform stress (no rotation, zero at the origin)."""
        x, y = (np.asarray(points) - self.origin).T
        b, g = self.force, self.gradient
        mu, nu = self.material.shear_modulus, self.material.effective_poissons_ratio
        m = 2 * mu * (1 - nu) / (1 - 2 * nu)
        strain = self.material.compliance() @ self.uniform
        ux = -(b[0] * x**2 / 2 + g[0, 0] * x**3 / 6) / m - g[0, 1] * y**3 / (6 * mu)
        uy = -(b[1] * y**2 / 2 + g[1, 1] * y**3 / 6) / m - g[1, 0] * x**3 / (6 * mu)
        return np.column_stack([ux + strain[0] * x + 0.5 * strain[2] * y, uy + strain[1] * y + 0.5 * strain[2] * x])


@dataclass(frozen=True, eq=False)
class DepthDependentStress:
    """Stress that is linear in depth below a free surface, in equilibrium with a body force ``force`` (2,) N/m³.
    ``slopes`` (3,) Pa/m: derivatives, along the outward normal, of the stress along the surface, normal to it, and of
    shear; ``uniform`` (3,) Pa added everywhere.

    Equilibrium determines the last two slopes. The first depends on the history of the rock and is arbitrary, since a
    strain that is linear in one direction is compatible (it bends the plane)."""

    half_plane: HalfPlane
    force: np.ndarray
    slopes: np.ndarray
    uniform: np.ndarray
    material: Material

    @classmethod
    def of(
        cls, half_plane: HalfPlane, force: np.ndarray, k0: float | None, uniform: np.ndarray, material: Material
    ) -> DepthDependentStress:
        """The stress for a uniform ``force``, with ``k0`` the ratio of the stress along the surface to that normal to
        it; None: ν/(1−ν), laterally confined rock."""
        nu = material.effective_poissons_ratio
        along, out = half_plane.turned(force)
        slopes = np.array([-out * (nu / (1 - nu) if k0 is None else k0), -out, -along])
        return cls(half_plane, force, slopes, uniform, material)

    @property
    def gradient(self) -> np.ndarray:
        """(2, 2) gradient of the force: zero."""
        return np.zeros((2, 2))

    @property
    def sizes(self) -> np.ndarray:
        """(3,) factors of the unit slopes."""
        return self.slopes

    def stress(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) Pa, the uniform part included."""
        return self.stress_of_force(points) + self.uniform

    def stress_of_force(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) Pa, of the body force alone."""
        return self.half_plane.stress_of(self.half_plane.frame(points)[:, 1:] * self.slopes)

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m, of both (no rotation, zero at the point that defines the surface)."""
        x, y = self.half_plane.frame(points).T
        a, b, g = self.material.compliance() @ self.slopes
        bent = np.column_stack([a * x * y + 0.5 * g * y * y, 0.5 * (b * y * y - a * x * x)])
        strain = self.material.compliance() @ self.uniform
        x, y = (points - np.asarray(self.half_plane.point)).T
        even = np.column_stack([strain[0] * x + 0.5 * strain[2] * y, strain[1] * y + 0.5 * strain[2] * x])
        return bent @ self.half_plane.turn + even


def edge_densities(edges: np.ndarray, particular: Particular | DepthDependentStress) -> np.ndarray:
    """(m, 2, 3) monomials of −σ_p n (n outward, the uniform part included) along every edge (m, 2, 2), local
    components."""
    a, b = edges[:, 0], edges[:, 1]
    d = b - a
    t = d / np.hypot(*d.T)[:, None]
    out = np.column_stack([t[:, 1], -t[:, 0]])
    values = []
    for x in (a, 0.5 * (a + b), b):
        s = particular.stress(x)
        f = -np.column_stack([s[:, 0] * out[:, 0] + s[:, 2] * out[:, 1], s[:, 2] * out[:, 0] + s[:, 1] * out[:, 1]])
        values.append(np.stack([np.sum(f * t, axis=1), -np.sum(f * out, axis=1)], axis=1))
    lo, mid, hi = values
    return np.stack([mid, 0.5 * (hi - lo), 0.5 * (hi + lo) - mid], axis=2)
