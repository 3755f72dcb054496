"""Rock without an end: the infinite plane or a half-plane, of which the one block of a problem is what is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .blocks.polygon import distance_to_edges
from .cracks.crack_arrays import Cracks
from .loads.history import History

#: A crack opens into a hole that its end is this near to, in units of the hole's size.
_MOUTH = 1e-6


@dataclass(frozen=True, eq=False)
class Fluid:
    """Of a pressure, Pa, as a ``history`` (1,) that stands in all ``cracks``, in all ``holes``, or in both.

    Of the cracks it stands in those called ``names`` alone where such are given; ``connected``: also in the cracks that
    are connected with them, or open into a hole that it fills, now or later.
    """

    history: History
    cracks: bool = True
    holes: bool = False
    names: tuple[str, ...] = ()
    connected: bool = False

    @property
    def in_all_cracks(self) -> bool:
        return self.cracks and not self.names

    def wets(self, cracks: Cracks, group: np.ndarray, at_hole: np.ndarray) -> np.ndarray:
        """(n_segments,) where it stands; ``group`` and ``at_hole`` as of `EndlessRock.crack_pressure_at`."""
        if self.in_all_cracks:
            return np.ones(cracks.n_segments, bool)
        own = np.isin(np.array(cracks.names, dtype=object), self.names if self.cracks else ())[cracks.crack]
        if self.connected:
            own = np.isin(group, np.concatenate([group[own], group[at_hole] if self.holes else []]))
        return own


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

    def hole_pressure_at(self, time: float) -> float:
        """Pa in all holes."""
        return float(sum(fluid.history.at(time)[0] for fluid in self.fluids if fluid.holes))

    def crack_pressure_at(self, time: float, cracks: Cracks, holes: Sequence[np.ndarray]) -> np.ndarray | float:
        """Pa in all ``cracks``, or (n_segments,) where it is not the same in each; ``holes`` (n, 2) are outlines."""
        everywhere = sum(fluid.history.at(time)[0] for fluid in self.fluids if fluid.in_all_cracks)
        some = [fluid for fluid in self.fluids if not fluid.in_all_cracks and (fluid.cracks or fluid.connected)]
        if not some:
            return float(everywhere)
        group, at_hole = connected_cracks(cracks), _open_into(cracks, holes)
        pressure = np.full(cracks.n_segments, float(everywhere))
        for fluid in some:
            pressure[fluid.wets(cracks, group, at_hole)] += fluid.history.at(time)[0]
        return pressure

    def load_at(self, time: float) -> float:
        """What leads, Pa: the largest pressure of a fluid where there is one, else of the stresses far away that change
        (of all where none does) the principal stress that is larger in size, positive in compression."""
        if self.fluids:
            everywhere = sum(fluid.history.at(time)[0] for fluid in self.fluids if fluid.in_all_cracks)
            named = [fluid.history.at(time)[0] for fluid in self.fluids if fluid.cracks and fluid.names]
            return float(max(everywhere + max(named, default=0.0), self.hole_pressure_at(time)))
        changing = [history for history in self.remote if history.rate is not None or len(history.times) > 1]
        xx, yy, xy = sum((history.at(time) for history in changing or self.remote), np.zeros(3))
        mean, radius = 0.5 * (xx + yy), float(np.hypot(0.5 * (xx - yy), xy))
        return -(mean + radius) if mean > 0 else radius - mean


def connected_cracks(cracks: Cracks) -> np.ndarray:
    """(n_segments,) the same number for all segments that hang together."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(cracks.nodes)
    links = coo_array((np.ones(cracks.n_segments, bool), tuple(cracks.segments.T)), shape=(n, n))
    return connected_components(links, directed=False)[1][cracks.segments[:, 0]]


def _open_into(cracks: Cracks, holes: Sequence[np.ndarray]) -> np.ndarray:
    """(n_segments,) True for those that end on one of the ``holes``."""
    mouth = np.zeros(len(cracks.nodes), bool)
    for node in np.flatnonzero(cracks.surface).tolist():
        mouth[node] = any(
            distance_to_edges(cracks.nodes[node], hole, np.roll(hole, -1, axis=0))
            <= _MOUTH * np.ptp(hole, axis=0).max()
            for hole in holes
        )
    return mouth[cracks.segments].any(axis=1)
