"""In dynamics a tip feels its block's boundary only when waves have come from there.

The crack solver answers at once: forces on the block, its inertia as a body force, all of the block in equilibrium. Of
a sudden force that is wrong until waves have crossed the block: a block that falls on its base is decelerated as a
whole, its strain is not there yet, and the inertia of the strain to come puts the middle in *tension* (by half of the
pressure on a bar pressed at both ends, for a quarter of the time that a wave takes). Contacts that knock on their
springs bring such spikes in every step. So a tip grows by the mean of K_eq over the time that a wave from the boundary
takes to it, the form of the incubation-time criterion (1/τ) ∫ K dt ≥ K_Ic over the last τ of Petrov & Morozov (1994),
where steps are shorter than that.
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


class WaveTime:
    """What has driven each tip, by its crack and end, for the time that waves take to it."""

    def __init__(self, problem: Problem) -> None:
        self._speed = np.array([m.pressure_wave_speed for m in problem.materials])
        #: (dt, K_eq) of the steps before, the last one first, as far as they count.
        self._past: dict[_Key, list[tuple[float, float]]] = {}

    def drive(
        self, tips: np.ndarray, blocks: Blocks, dt: float, loads: Mapping[int, BoundaryLoad] = _NONE
    ) -> np.ndarray:
        """(n_tips,) the lesser of K_eq in the present step of ``dt`` s and of its mean over the time of a wave, Pa √m,
        from what is loaded of its block's boundary (block → `BoundaryLoad`), or any of it where nothing is."""
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
        """The step of ``dt`` s has ended with ``tips``."""
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
        """Rows of ``tips`` to which waves take longer than ``dt``, and how long, s."""
        speed = self._speed[blocks.material[tips["block"]]]
        size = np.array([np.ptp(blocks.loops(b)[0], axis=0).max() for b in np.unique(tips["block"]).tolist()])
        if not len(tips) or not (np.sqrt(2.0) * size.max() > speed.min() * dt):
            return []
        found = []
        for row in range(len(tips)):
            block = int(tips["block"][row])
            load = loads.get(block)
            lines = load.segments if load is not None and len(load.segments) else _outline(blocks, block)
            time = distance_to_edges(tips["point"][row], lines[:, 0], lines[:, 1]) / float(speed[row])
            if time > dt:
                found.append((row, time))
        return found


def _outline(blocks: Blocks, block: int) -> np.ndarray:
    """(n, 2, 2) m, all edges of ``block``, reference coordinates."""
    own = np.arange(blocks.vertex_start[block], blocks.vertex_start[block + 1])
    return np.stack([blocks.vertices[own], blocks.vertices[blocks.next_vertex[own]]], axis=1)
