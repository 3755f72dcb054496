"""Isotropic linear elastic rock with fracture toughnesses: constants and derived quantities."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic rock, its fracture toughnesses, and the strength of the intact rock.

    youngs_modulus    Pa; of a ``rigid`` material it sets only the stiffness of contact springs
    poissons_ratio    in (−1, ½)
    density           kg/m³
    k_ic              mode I toughness, Pa √m; infinite: cracks do not grow
    k_iic             toughness against growth in shear, Pa √m; used by the F-criterion alone
    plane             "strain" or "stress"
    rigid             True: blocks do not strain and have three unknowns instead of six
    tensile_strength  Pa, of intact rock, for crack initiation; infinite: no tensile failure
    cohesion          Pa, of intact rock (Mohr–Coulomb), for crack initiation; infinite: no shear failure
    friction_angle    rad, of intact rock

    Raises ValueError that names the material for constants that no elastic solid has.
    """

    name: str
    youngs_modulus: float
    poissons_ratio: float
    density: float = 0.0
    k_ic: float = math.inf
    plane: str = "strain"
    k_iic: float = math.inf
    tensile_strength: float = math.inf
    cohesion: float = math.inf
    friction_angle: float = 0.0
    rigid: bool = False

    def __post_init__(self) -> None:
        def refuse(what: str) -> None:
            raise ValueError(f"material {self.name!r}: {what}")

        if not (math.isfinite(self.youngs_modulus) and self.youngs_modulus > 0):
            refuse(f"Young's modulus must be positive and finite, got {self.youngs_modulus!r} Pa")
        if not -1.0 < self.poissons_ratio < 0.5:
            refuse(f"Poisson's ratio must lie between -1 and 0.5, got {self.poissons_ratio!r}")
        if not (math.isfinite(self.density) and self.density >= 0):
            refuse(f"density must not be negative, got {self.density!r} kg/m³")
        if not self.k_ic > 0:
            refuse(f"fracture toughness must be positive, got {self.k_ic!r} Pa √m")
        if not self.k_iic > 0:
            refuse(f"fracture toughness in mode II must be positive, got {self.k_iic!r} Pa √m")
        if math.isinf(self.k_ic) and math.isfinite(self.k_iic):
            refuse("a mode II toughness requires a mode I toughness")
        if not self.tensile_strength > 0:
            refuse(f"tensile strength must be positive, got {self.tensile_strength!r} Pa")
        if not self.cohesion > 0:
            refuse(f"cohesion of intact rock must be positive, got {self.cohesion!r} Pa")
        if not 0 <= self.friction_angle < math.pi / 2:
            refuse(f"friction angle must be from 0 to below π/2, got {self.friction_angle!r} rad")
        if self.plane not in ("strain", "stress"):
            refuse(f'plane must be "strain" or "stress", got {self.plane!r}')

    @property
    def shear_modulus(self) -> float:
        return self.youngs_modulus / (2 * (1 + self.poissons_ratio))

    @property
    def effective_poissons_ratio(self) -> float:
        """ν for plane-strain formulas: ν itself in plane strain, ν/(1+ν) in plane stress."""
        nu = self.poissons_ratio
        return nu if self.plane == "strain" else nu / (1 + nu)

    @property
    def plane_modulus(self) -> float:
        """E' = E/(1−ν²) in plane strain, E in plane stress: G = (K_I² + K_II²)/E'."""
        return 2 * self.shear_modulus / (1 - self.effective_poissons_ratio)

    @property
    def pressure_wave_speed(self) -> float:
        """Speed of P-waves c_p = √((λ + 2μ)/ρ), m/s; in plane stress λ is that of a plate. Infinite for density 0."""
        return math.sqrt(self.stiffness()[0, 0] / self.density) if self.density else math.inf

    @property
    def rayleigh_speed(self) -> float:
        """Speed of Rayleigh waves c_R = c_s (0.87 + 1.12 ν)/(1 + ν), m/s (Viktorov 1967); infinite for density 0.

        The error is at most 0.5 % for ν ≥ 0."""
        if not self.density:
            return math.inf
        nu = self.effective_poissons_ratio
        return math.sqrt(self.shear_modulus / self.density) * (0.87 + 1.12 * nu) / (1 + nu)

    def stiffness(self) -> np.ndarray:
        """C (3, 3) with σ = C ε, components (xx, yy, xy), engineering shear strain."""
        mu, nu = self.shear_modulus, self.effective_poissons_ratio
        lam = 2 * mu * nu / (1 - 2 * nu)
        return np.array([[lam + 2 * mu, lam, 0.0], [lam, lam + 2 * mu, 0.0], [0.0, 0.0, mu]])

    def compliance(self) -> np.ndarray:
        """C⁻¹ (3, 3)."""
        mu, nu = self.shear_modulus, self.effective_poissons_ratio
        return np.array([[1 - nu, -nu, 0.0], [-nu, 1 - nu, 0.0], [0.0, 0.0, 2.0]]) / (2 * mu)

    def out_of_plane_stress(self, stress: np.ndarray) -> np.ndarray:
        """σzz (...,) Pa from in-plane ``stress`` (..., 3) Pa: ν(σxx + σyy) in plane strain, 0 in plane stress."""
        stress = np.asarray(stress, dtype=float)
        nu = self.poissons_ratio if self.plane == "strain" else 0.0
        return nu * (stress[..., 0] + stress[..., 1])
