"""Rock without an end: the infinite plane or a half-plane, of which the one block of a problem is what is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .history import History


@dataclass(frozen=True, eq=False)
class Fluid:
    """Of a pressure, Pa, as a ``history`` (1,) that stands in all ``cracks``, in all ``holes``, or in both."""

    history: History
    cracks: bool = True
    holes: bool = False


@dataclass(frozen=True, eq=False)
class EndlessRock:
    """What the one block of a problem is a piece of, and what acts there; its outline bears and loads nothing.

    surface  a point (x, y) of the free surface and the unit direction out of the rock; None: the infinite plane
    remote   stresses (3,) Pa far away, tension positive, that add up
    fluids   pressures that add up
    """

    surface: tuple[tuple[float, float], tuple[float, float]] | None = None
    remote: tuple[History, ...] = ()
    fluids: tuple[Fluid, ...] = ()

    @property
    def histories(self) -> list[History]:
        """All functions of time that act."""
        return [*self.remote, *(fluid.history for fluid in self.fluids)]

    def stress_at(self, time: float) -> np.ndarray:
        """(3,) Pa far away."""
        return sum((history.at(time) for history in self.remote), np.zeros(3))

    def pressure_at(self, time: float, place: str) -> float:
        """Pa in all "cracks" or all "holes"."""
        return float(sum(fluid.history.at(time)[0] for fluid in self.fluids if getattr(fluid, place)))

    def load_at(self, time: float) -> float:
        """What leads, Pa: the largest pressure of a fluid where there is one, else of the stresses far away that change
        (of all where none does) the principal stress that is larger in size, positive in compression."""
        if self.fluids:
            return max(self.pressure_at(time, "cracks"), self.pressure_at(time, "holes"))
        changing = [history for history in self.remote if history.rate is not None or len(history.times) > 1]
        xx, yy, xy = sum((history.at(time) for history in changing or self.remote), np.zeros(3))
        mean, radius = 0.5 * (xx + yy), float(np.hypot(0.5 * (xx - yy), xy))
        return -(mean + radius) if mean > 0 else radius - mean
