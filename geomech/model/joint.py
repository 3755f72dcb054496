"""Joints: what holds two block faces together."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class JointLaw:
    """Coulomb joint: ``friction_angle`` rad, ``cohesion`` and ``tensile_strength`` Pa (times a contact's tributary
    length), ``normal_stiffness`` and ``shear_stiffness`` Pa/m or None for the solver's penalty springs."""

    name: str
    friction_angle: float = 0.0
    cohesion: float = 0.0
    tensile_strength: float = 0.0
    normal_stiffness: float | None = None
    shear_stiffness: float | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.friction_angle < math.pi / 2:
            raise ValueError(
                f"joint {self.name!r}: friction angle must lie in [0°, 90°), got {math.degrees(self.friction_angle):g}°"
            )
        for what in ("cohesion", "tensile_strength"):
            value = getattr(self, what)
            if not value >= 0:
                raise ValueError(f"joint {self.name!r}: {what} must not be negative, got {value!r} Pa")
        for what in ("normal_stiffness", "shear_stiffness"):
            value = getattr(self, what)
            if value is not None and not value > 0:
                raise ValueError(f"joint {self.name!r}: {what} must be positive, got {value!r} Pa/m")

    @property
    def friction(self) -> float:
        """tan φ."""
        return math.tan(self.friction_angle)
