"""Probabilities of failure of planar slopes with random strengths: exact for normal strengths, and published for the
Sau Mau Ping slope.

Lengths m, angles rad, forces N per metre of thickness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from .rock_slopes import plane_failure_factor

#: Hoek, E. (2007), Practical rock engineering, chapter "Factor of safety and probability of failure": the Sau Mau Ping
#: slope, Hong Kong, by Monte Carlo with Latin hypercube samples; probability of failure, mean and standard deviation.
#: Neither original was at hand when these figures were entered. A million samples of `PlanarSlope` give 0.065 and
#: 1.342 ± 0.234, and its first-order reliability index is 1.556, so that they are at least those of this problem.
HOEK_PROBABILITY, HOEK_MEAN, HOEK_DEVIATION = 0.064, 1.34, 0.23
#: Low, B. K. (2007), Reliability analysis of rock slopes involving correlated nonnormals, Int. J. Rock Mech. Min. Sci.
#: 44, 922-935: the same slope by the first-order reliability method, independent variables.
LOW_BETA, LOW_PROBABILITY = 1.556, 0.060


@dataclass(frozen=True)
class PlanarSlope:
    """A slope of this ``height`` with a face at the angle ``face`` and a plane at ``dip`` through its toe. A vertical
    tension crack behind the crest is ``crack`` deep and filled to ``water`` above its tip; ``shaking`` g acts
    horizontally."""

    height: float = 60.0
    face: float = math.radians(50.0)
    dip: float = math.radians(35.0)
    crack: float = 14.0
    water: float = 0.0
    shaking: float = 0.0
    density: float = 2600.0
    gravity: float = 9.81

    @property
    def length(self) -> float:
        """Length of the plane, from the toe to the crack."""
        return (self.height - self.crack) / math.sin(self.dip)

    @property
    def weight(self) -> float:
        area = 0.5 * self.height**2 * (
            (1.0 - (self.crack / self.height) ** 2) / math.tan(self.dip) - 1.0 / math.tan(self.face)
        )  # fmt: skip
        return self.density * self.gravity * area

    @property
    def driving(self) -> float:
        """Force along the plane: weight, shaking and water in the crack."""
        thrust = self._thrust + self.shaking * self.weight
        return self.weight * math.sin(self.dip) + thrust * math.cos(self.dip)

    @property
    def pressing(self) -> float:
        """Force normal to the plane, minus the water pressure in it."""
        thrust = self._thrust + self.shaking * self.weight
        return self.weight * math.cos(self.dip) - self._uplift - thrust * math.sin(self.dip)

    @property
    def _thrust(self) -> float:
        return 0.5 * 1000.0 * self.gravity * self.water**2

    @property
    def _uplift(self) -> float:
        return 0.5 * 1000.0 * self.gravity * self.water * self.length

    def factor(self, cohesion: float, friction_angle: float) -> float:
        """Hoek & Bray (1981), chapter 7, shaking as a part of the weight that acts horizontally."""
        thrust = self._thrust + self.shaking * self.weight
        return plane_failure_factor(self.weight, self.dip, self.length, cohesion, friction_angle, self._uplift, thrust)

    def probability(
        self, cohesion: tuple[float, float], tangent: tuple[float, float], correlation: float = 0.0
    ) -> float:
        """The exact probability of a factor below 1 if cohesion and tan φ are normally distributed, (mean, standard
        deviation) each: Φ(−β), with β the mean of c A + N tan φ − S over its standard deviation, since this is normally
        distributed as well."""
        a, b = self.length * cohesion[1], self.pressing * tangent[1]
        mean = self.length * cohesion[0] + self.pressing * tangent[0] - self.driving
        beta = mean / math.sqrt(a * a + b * b + 2.0 * correlation * a * b)
        return 0.5 * math.erfc(beta / math.sqrt(2.0))
