"""Delayed loading of tips in dynamics: forces on the boundary reach a tip with the pressure wave.

The crack solver is quasi-static: the forces on a block, its inertia as a body force, and the whole block are in
equilibrium at once. After a sudden force this is wrong until waves have crossed the block. A block that falls on its
base is decelerated as a whole before its strain has developed, and the inertia of that future strain puts its centre in
*tension* (half of the pressure on a bar pressed at both ends, for a quarter of the travel time). Contacts that vibrate
on their springs cause such peaks in every step. Where steps are shorter than the travel time τ from the loaded
boundary, a tip therefore grows by the mean of K_eq over τ, the incubation-time criterion of Petrov & Morozov (1994):

    (1/τ) ∫ K dt ≥ K_Ic over the last τ.

Blocks whose cracks could not grow in a step were not solved in it (`growth_screening`). If one of their tips reaches
its toughness within τ, they are solved for that step after all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from ...model import Blocks, Problem
from ...model.blocks.polygon import distance_to_edges
from ..load_transfer.boundary_tractions import BoundaryLoad
from ..load_transfer.elastic_bodies import solve_bodies, tip_rows

if TYPE_CHECKING:
    from ...ddm import Body

_NONE: Mapping[int, BoundaryLoad] = MappingProxyType({})
_Key = tuple[int, int]


@dataclass(eq=False)
class LeftOut:
    """The tips of a ``block`` (numbered in ``blocks``) in a step in which its ``body`` was not solved under its
    ``load``: it is when they are asked for. ``nodes``: its nodes in the whole network."""

    problem: Problem
    blocks: Blocks
    block: int
    body: Body
    load: BoundaryLoad
    nodes: np.ndarray
    _k_eq: dict[_Key, float] = field(default_factory=dict)

    @property
    def keys(self) -> list[_Key]:
        """Crack and end of each tip."""
        return _keys(self.body.tip_elements[0])

    def k_eq(self, key: _Key) -> float:
        """K_eq of the tip ``key``, Pa √m."""
        if not self._k_eq:
            solved = solve_bodies({self.block: self.body}, {self.block: self.load}, {}, {}, self.blocks.names)
            tips = tip_rows(self.problem, self.blocks, solved, {self.block: self.nodes})
            self._k_eq = dict(zip(_keys(tips), tips["k_eq"].tolist()))
        return self._k_eq[key]


#: Fraction of the largest traction on a block below which a part of its boundary counts as not loaded: what balancing
#: the loads leaves there is round-off.
UNLOADED = 1e-6


class WaveTime:
    """K_eq of each tip, by crack and end, over the travel time of waves to it."""

    def __init__(self, problem: Problem) -> None:
        self._speed = np.array([m.pressure_wave_speed for m in problem.materials])
        #: (dt, K_eq) of the last steps, the latest first, as far back as they count.
        self._past: dict[_Key, list[tuple[float, float | LeftOut]]] = {}

    def drive(
        self, tips: np.ndarray, blocks: Blocks, dt: float, loads: Mapping[int, BoundaryLoad] = _NONE
    ) -> np.ndarray:
        """(n_tips,) the lesser of K_eq in the present step of ``dt`` s and its mean over the travel time from the
        loaded boundary of the block (block → `BoundaryLoad`), or from any of it without load, Pa √m."""
        driven = tips["k_eq"].copy()
        for row, time in self._longer(tips, blocks, dt, loads):
            tip = tips[row]
            total, rest = float(tip["k_eq"]) * dt, time - dt
            key = (int(tip["crack"]), int(tip["end"]))
            for step, k_eq in self._past.get(key, ()):
                total += (k_eq.k_eq(key) if isinstance(k_eq, LeftOut) else k_eq) * min(step, rest)
                rest -= step
                if rest <= 0:
                    break
            driven[row] = min(driven[row], total / time)
        return driven

    def end(
        self,
        tips: np.ndarray,
        blocks: Blocks,
        dt: float,
        loads: Mapping[int, BoundaryLoad] = _NONE,
        left_out: Mapping[int, LeftOut] = MappingProxyType({}),
    ) -> None:
        """The step of ``dt`` s ends with ``tips``, and those of blocks ``left_out`` (block →)."""
        past: dict[_Key, list[tuple[float, float | LeftOut]]] = {}
        for row, time in self._longer(tips, blocks, dt, loads):
            key = (int(tips["crack"][row]), int(tips["end"][row]))
            past[key] = self._last(key, (dt, float(tips["k_eq"][row])), time)
        for block, of in left_out.items():
            # No way in the block is longer.
            time = np.sqrt(2.0) * float(np.ptp(blocks.loops(block)[0], axis=0).max())
            time /= float(self._speed[blocks.material[block]])
            if time > dt:
                past |= {key: self._last(key, (dt, of), time) for key in of.keys}
        self._past = past

    def _last(self, key: _Key, now: tuple[float, float | LeftOut], time: float) -> list[tuple[float, float | LeftOut]]:
        """The step ``now`` and those before it that reach back ``time`` s."""
        kept, length = [now], now[0]
        for step in self._past.get(key, ()):
            if length >= time:
                break
            kept.append(step)
            length += step[0]
        return kept

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


def _keys(tips: np.ndarray) -> list[_Key]:
    return list(zip(tips["crack"].tolist(), tips["end"].tolist()))
