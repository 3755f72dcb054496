"""Unbounded rock: an infinite plane or half-plane under remote stress and fluid pressure; its one block is a window on
it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .blocks.polygon import distance_to_edges
from .cracks.crack_arrays import Cracks
from .loads.history import History

#: A crack ends on a hole when its end is nearer than this, in units of the hole's size.
_MOUTH = 1e-6


@dataclass(frozen=True, eq=False)
class Fluid:
    """A fluid pressure in cracks, in holes, or in both.

    history    pressure, Pa, one column
    cracks     True: it fills cracks, all of them or those of ``names``
    holes      True: it fills all holes
    names      names of the cracks that it fills; empty: all
    connected  True: it also fills cracks that are, or become, connected with those or with a hole that it fills
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
        """(n_segments,) bool, True where the fluid stands.

        ``group`` (n_segments,): number of the connected network; ``at_hole`` (n_segments,) bool: ends on a hole."""
        if self.in_all_cracks:
            return np.ones(cracks.n_segments, bool)
        own = np.isin(np.array(cracks.names, dtype=object), self.names if self.cracks else ())[cracks.crack]
        if self.connected:
            own = np.isin(group, np.concatenate([group[own], group[at_hole] if self.holes else []]))
        return own


@dataclass(frozen=True, eq=False)
class EndlessRock:
    """Unbounded rock and its loads. The outline of the problem's one block carries no traction and bounds nothing.

    surface  a point (x, y) on the free surface, m, and its unit outward normal; None: infinite plane
    remote   histories of remote stress (3,), Pa, tension positive; their sum acts
    fluids   fluid pressures; they add up where several stand
    """

    surface: tuple[tuple[float, float], tuple[float, float]] | None = None
    remote: tuple[History, ...] = ()
    fluids: tuple[Fluid, ...] = ()

    @property
    def histories(self) -> list[History]:
        """All functions of time among the loads."""
        return [*self.remote, *(fluid.history for fluid in self.fluids)]

    def stress_at(self, time: float) -> np.ndarray:
        """(3,) remote stress at ``time`` s, Pa."""
        return sum((history.at(time) for history in self.remote), np.zeros(3))

    def hole_pressure_at(self, time: float) -> float:
        """Pressure in all holes at ``time`` s, Pa."""
        return float(sum(fluid.history.at(time)[0] for fluid in self.fluids if fluid.holes))

    def crack_pressure_at(self, time: float, cracks: Cracks, holes: Sequence[np.ndarray]) -> np.ndarray | float:
        """Pressure in ``cracks`` at ``time`` s, Pa: a number, or (n_segments,) where it differs between cracks.

        ``holes``: outlines (n, 2), m."""
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
        """The leading load at ``time`` s, Pa.

        The largest fluid pressure, where there are fluids. Otherwise the principal remote stress of largest size,
        positive in compression, of the remote stresses that vary (of all where none varies)."""
        if self.fluids:
            everywhere = sum(fluid.history.at(time)[0] for fluid in self.fluids if fluid.in_all_cracks)
            named = [fluid.history.at(time)[0] for fluid in self.fluids if fluid.cracks and fluid.names]
            return float(max(everywhere + max(named, default=0.0), self.hole_pressure_at(time)))
        changing = [history for history in self.remote if history.rate is not None or len(history.times) > 1]
        xx, yy, xy = sum((history.at(time) for history in changing or self.remote), np.zeros(3))
        mean, radius = 0.5 * (xx + yy), float(np.hypot(0.5 * (xx - yy), xy))
        return -(mean + radius) if mean > 0 else radius - mean


def connected_cracks(cracks: Cracks) -> np.ndarray:
    """(n_segments,) int: number of the connected network that each segment belongs to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(cracks.nodes)
    links = coo_array((np.ones(cracks.n_segments, bool), tuple(cracks.segments.T)), shape=(n, n))
    return connected_components(links, directed=False)[1][cracks.segments[:, 0]]


def _open_into(cracks: Cracks, holes: Sequence[np.ndarray]) -> np.ndarray:
    """(n_segments,) bool: True for segments that end on one of the ``holes``."""
    mouth = np.zeros(len(cracks.nodes), bool)
    for node in np.flatnonzero(cracks.surface).tolist():
        mouth[node] = any(
            distance_to_edges(cracks.nodes[node], hole, np.roll(hole, -1, axis=0))
            <= _MOUTH * np.ptp(hole, axis=0).max()
            for hole in holes
        )
    return mouth[cracks.segments].any(axis=1)
