"""Delayed loading of tips in dynamics: forces on the boundary reach a tip with the pressure wave.

The crack solver is quasi-static: the forces on a block, its inertia as a body force, and the whole block are in
equilibrium at once. After a sudden force this is wrong until waves have crossed the block. A block that falls on its
base is decelerated as a whole before its strain has developed, and the inertia of that future strain puts its centre in
*tension* (half of the pressure on a bar pressed at both ends, for a quarter of the travel time). Contacts that vibrate
on their springs cause such peaks in every step. Where steps are shorter than the travel time τ from the loaded
boundary, a tip therefore grows by the mean of K_eq over τ, the incubation-time criterion of Petrov & Morozov (1994):

    (1/τ) ∫ K dt ≥ K_Ic over the last τ.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ...model import Blocks, Problem
from ...model.blocks.polygon import distance_to_edges
from ..load_transfer.boundary_tractions import BoundaryLoad

_NONE: Mapping[int, BoundaryLoad] = MappingProxyType({})
_Key = tuple[int, int]

#: Fraction of the largest traction on a block below which a part of its boundary counts as not loaded: what balancing
#: the loads leaves there is round-off.
UNLOADED = 1e-6


class WaveTime:
    """K_eq of each tip, by crack and end, over the travel time of waves to it."""

    def __init__(self, problem: Problem) -> None:
        self._speed = np.array([m.pressure_wave_speed for m in problem.materials])
        #: (dt, K_eq) of the last steps, the latest first, as far back as they count.
        self._past: dict[_Key, list[tuple[float, float]]] = {}

    def drive(
        self, tips: np.ndarray, blocks: Blocks, dt: float, loads: Mapping[int, BoundaryLoad] = _NONE
    ) -> np.ndarray:
        """(n_tips,) the lesser of K_eq in the present step of ``dt`` s and its mean over the travel time from the
        loaded boundary of the block (block → `BoundaryLoad`), or from any of it without load, Pa √m."""
        driven = tips["k_eq"].copy()
        for row, time in self._longer(tips, blocks, dt, loads):
            tip = tips[row]
            total, rest = float(tip["k_eq"]) * dt, time - dt
            for step, k_eq in self._past.get((int(tip["crack"]), int(tip["end"])), ()):
                total += k_eq * min(step, rest)
                rest -= step
                if rest <= 0:
                    break
            driven[row] = min(driven[row], total / time)
        return driven

    def end(self, tips: np.ndarray, blocks: Blocks, dt: float, loads: Mapping[int, BoundaryLoad] = _NONE) -> None:
        """The step of ``dt`` s ends with ``tips``."""
        past = {}
        for row, time in self._longer(tips, blocks, dt, loads):
            tip = tips[row]
            key = (int(tip["crack"]), int(tip["end"]))
            kept, length = [(dt, float(tip["k_eq"]))], dt
            for step in self._past.get(key, ()):
                if length >= time:
                    break
                kept.append(step)
                length += step[0]
            past[key] = kept
        self._past = past

    def _longer(
        self, tips: np.ndarray, blocks: Blocks, dt: float, loads: Mapping[int, BoundaryLoad]
    ) -> list[tuple[int, float]]:
        """Rows of ``tips`` to which waves travel for longer than ``dt``, and the travel times, s."""
        speed = self._speed[blocks.material[tips["block"]]]
        size = np.array([np.ptp(blocks.loops(b)[0], axis=0).max() for b in np.unique(tips["block"]).tolist()])
        if not len(tips) or not (np.sqrt(2.0) * size.max() > speed.min() * dt):
            return []
        found = []
        for row in range(len(tips)):
            block = int(tips["block"][row])
            lines = _loaded(loads.get(block))
            if not len(lines):
                lines = _outline(blocks, block)
            time = distance_to_edges(tips["point"][row], lines[:, 0], lines[:, 1]) / float(speed[row])
            if time > dt:
                found.append((row, time))
        return found


def _loaded(load: BoundaryLoad | None) -> np.ndarray:
    """(n, 2, 2) m, the parts of the boundary that carry ``load``, reference coordinates."""
    if load is None or not len(load.segments):
        return np.empty((0, 2, 2))
    size = np.abs(load.tractions).reshape(len(load.segments), -1).max(axis=1)
    return load.segments[size > UNLOADED * size.max()]


def _outline(blocks: Blocks, block: int) -> np.ndarray:
    """(n, 2, 2) m, all edges of ``block``, reference coordinates."""
    own = np.arange(blocks.vertex_start[block], blocks.vertex_start[block + 1])
    return np.stack([blocks.vertices[own], blocks.vertices[blocks.next_vertex[own]]], axis=1)
