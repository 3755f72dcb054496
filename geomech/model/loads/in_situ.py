"""In-situ stress of the rock before the run, linear in the coordinates."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class InSituStress:
    """σ(x) = ``stress`` + ``gradient`` · (x − ``about``), components (xx, yy, xy), tension positive.

    ``stress`` (3,) Pa, ``gradient`` (3, 2) Pa/m, ``about`` (2,) m. Raises ValueError for arrays of other shapes or
    values that are not finite.
    """

    stress: np.ndarray
    gradient: np.ndarray = field(default_factory=lambda: np.zeros((3, 2)))
    about: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name, shape in (("stress", (3,)), ("gradient", (3, 2)), ("about", (2,))):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"in-situ {name} must be {shape} finite numbers, got {getattr(self, name)!r}")

    @classmethod
    def geostatic(cls, surface: float, unit_weight: float, k0: float, *, surcharge: float = 0.0) -> InSituStress:
        """Geostatic stress: σ_v = −(``surcharge`` + ``unit_weight`` · depth), σ_h = ``k0`` σ_v, no shear.

        Depth is below the level ``surface`` (m); ``unit_weight`` ρg N/m³, ``surcharge`` Pa."""
        if not k0 >= 0:
            raise ValueError(f"the ratio K0 of horizontal to vertical stress must not be negative, got {k0!r}")
        share = np.array([k0, 1.0, 0.0])
        gradient = np.zeros((3, 2))
        gradient[:, 1] = unit_weight * share
        return cls(-surcharge * share, gradient, (0.0, surface))

    def at(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) stress at ``points`` (..., 2), Pa. A geostatic field is tensile above its surface: it is not cut
        off there."""
        return (
            np.asarray(self.stress, dtype=float)
            + (points - np.asarray(self.about, dtype=float)) @ np.asarray(self.gradient, dtype=float).T
        )
