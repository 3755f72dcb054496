"""Fields of point forces: Kelvin's inside the rock, a loaded wedge on its boundary."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...model import Material
from ..mesh.half_plane import HalfPlane


@dataclass(frozen=True, eq=False)
class KelvinLoad:
    """A force (2,) N/m at ``point`` (2,) of the infinite plane (Kelvin 1848; Crouch & Starfield 1983, §4.2).

    Logarithms in the displacement are of distances in units of ``unit`` (m). Within ``core`` m the force counts as
    distributed evenly to both sides: no stress.
    """

    point: np.ndarray
    force: np.ndarray
    material: Material
    unit: float = 1.0
    core: float = 0.0

    def stress(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) Pa."""
        rel = points - self.point
        r2 = np.sum(rel * rel, axis=1)
        if self.core:
            r2[r2 <= self.core**2] = np.inf
        nu = self.material.effective_poissons_ratio
        x, y = rel.T / r2
        nx, ny = rel.T / np.sqrt(r2)
        px, py = self.force
        along = nx * px + ny * py
        # σ_ij = −[(1−2ν)(P_i r_j + P_j r_i − δ_ij P·r) + 2 (P·r) r_i r_j/r²] / 4π(1−ν) r²
        a = -(1 - 2 * nu) / (4 * np.pi * (1 - nu))
        b = -2 / (4 * np.pi * (1 - nu)) * along
        dot = px * x + py * y
        return np.column_stack(
            [
                a * (2 * px * x - dot) + b * nx * x,
                a * (2 * py * y - dot) + b * ny * y,
                a * (px * y + py * x) + b * nx * y,
            ]
        )

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m."""
        rel = points - self.point
        r2 = np.maximum(np.sum(rel * rel, axis=1), self.core**2)[:, None]
        mu, nu = self.material.shear_modulus, self.material.effective_poissons_ratio
        along = (rel @ self.force)[:, None] / r2
        return (-(3 - 4 * nu) * 0.5 * np.log(r2 / self.unit**2) * self.force + along * rel) / (
            8 * np.pi * mu * (1 - nu)
        )


@dataclass(frozen=True, eq=False)
class MelanLoad(KelvinLoad):
    """The same below the free surface of ``half_plane`` (Melan 1932), by the potentials of `half_plane_images`. The
    origin of the displacement is arbitrary, as it grows logarithmically."""

    half_plane: HalfPlane = field(kw_only=True)

    def _image(self, points: np.ndarray) -> tuple[Any, ...]:
        """κ, strength q of the force, distance w from its image, height of the image times −2i, y, φ₁' at
        ``points``."""
        rock, nu = self.half_plane, self.material.effective_poissons_ratio
        z, t = (rock.frame(x) @ np.array([1.0, 1j]) for x in (points, self.point))
        kappa, q = 3 - 4 * nu, complex(*rock.turned(self.force)) / (8 * np.pi * (1 - nu))
        w, depth = z - np.conj(t), np.conj(t) - t
        return kappa, q, w, depth, z.imag, -np.conj(q) * depth / w**2 - kappa * q / w

    def stress(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) Pa."""
        kappa, q, w, depth, y, half = self._image(points)
        bent = 2 * np.conj(q) * depth / w**3 + kappa * q / w**2
        deviator, trace = -2j * y * bent - half + np.conj(q) / w, 2 * half.real
        own = np.column_stack([trace - deviator.real, trace + deviator.real, deviator.imag])
        return super().stress(points) + self.half_plane.stress_of(own)

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m."""
        kappa, q, w, depth, y, half = self._image(points)
        # The image is above all points, so that no cut of the logarithm lies between them.
        logs = np.log(1j * w / self.unit) - 0.5j * np.pi
        moved = kappa * np.conj(q) * (1 + depth / w) - kappa**2 * q * logs - 2j * y * np.conj(half) - q * np.conj(logs)
        own = np.column_stack([moved.real, moved.imag]) / (2 * self.material.shear_modulus)
        return super().displacement(points) + own @ self.half_plane.turn


@dataclass(frozen=True, eq=False)
class WedgeLoad:
    """A force (2,) N/m on the corner ``point`` (2,) of a wedge of half-angle ``half`` about ``axis`` (2,), a unit
    vector into the rock: stress is radial, σ_rr = (A cosθ + B sinθ)/r (Michell 1902; half = π/2 is Flamant 1892).

    θ runs from the axis; displacement is cut along θ = π, outside the rock.
    """

    point: np.ndarray
    force: np.ndarray
    axis: np.ndarray
    half: float
    material: Material

    def _polar(self, points: np.ndarray) -> tuple[np.ndarray, ...]:
        rel = points - self.point
        across = np.array([-self.axis[1], self.axis[0]])
        x, y = rel @ self.axis, rel @ across
        r = np.hypot(x, y)
        a = -(self.force @ self.axis) / (self.half + 0.5 * np.sin(2 * self.half))
        b = -(self.force @ across) / (self.half - 0.5 * np.sin(2 * self.half))
        return rel, r, np.arctan2(y, x), x / r, y / r, a, b

    def stress(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) Pa."""
        rel, r, _, c, s, a, b = self._polar(points)
        radial = (a * c + b * s) / r**3
        return np.column_stack([radial * rel[:, 0] ** 2, radial * rel[:, 1] ** 2, radial * rel[:, 0] * rel[:, 1]])

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m, from ε_rr = (1−ν)σ_rr/2μ and ε_θθ = −νσ_rr/2μ."""
        rel, r, theta, c, s, a, b = self._polar(points)
        mu, nu = self.material.shear_modulus, self.material.effective_poissons_ratio
        p, q, half = a * c + b * s, a * s - b * c, 0.5 * (1 - 2 * nu)
        radial = (1 - nu) * np.log(r) * p - half * (p - theta * q)
        turning = -((1 - nu) * np.log(r) + nu) * q + half * theta * p
        out = rel / r[:, None]
        return (radial[:, None] * out + turning[:, None] * np.column_stack([-out[:, 1], out[:, 0]])) / (2 * mu)
