"""Loads as functions of time, named after the edges and blocks they act on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class History:
    """A piecewise linear function of time, held constant beyond its ends except where ``rate`` lets it run on.

    ``times`` (n,) s, ascending; ``values`` (n, k); ``rate`` (k,) per second after the last time.
    """

    times: np.ndarray
    values: np.ndarray
    rate: np.ndarray | None = None

    @classmethod
    def constant(cls, value) -> History:
        return cls(np.zeros(1), np.atleast_2d(np.asarray(value, dtype=float)))

    @classmethod
    def ramp(cls, rate, start: float = 0.0) -> History:
        """Zero until ``start``, then growing at ``rate`` per second for ever."""
        rate = np.atleast_1d(np.asarray(rate, dtype=float))
        return cls(np.array([start]), np.zeros((1, len(rate))), rate)

    def at(self, time: float) -> np.ndarray:
        """(k,) the value at ``time``."""
        if len(self.times) == 1:
            value = np.array(self.values[0], dtype=float)
        else:
            value = np.array([np.interp(time, self.times, column) for column in self.values.T])
        if self.rate is not None and time > self.times[-1]:
            value = value + self.rate * (time - self.times[-1])
        return value


@dataclass(frozen=True, eq=False)
class EdgeTraction:
    """A traction (N/m², x and y components, per unit of *reference* length) on every edge called ``edge_name``.

    It keeps its direction and, because it is counted per reference length, its total force as the block deforms.
    """

    edge_name: str
    history: History


@dataclass(frozen=True, eq=False)
class PointLoad:
    """A force (N per metre of thickness) on ``block`` at the material point ``at`` (reference coordinates)."""

    block: int
    at: tuple[float, float]
    history: History


@dataclass(frozen=True, eq=False)
class Loads:
    """Everything that acts on the blocks. ``gravity`` (2,) m/s² as a history; the scene's ramp is part of it."""

    gravity: History = field(default_factory=lambda: History.constant([0.0, 0.0]))
    edge_tractions: tuple[EdgeTraction, ...] = ()
    point_loads: tuple[PointLoad, ...] = ()
