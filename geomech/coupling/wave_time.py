"""In dynamics a tip feels its block's boundary only when waves have come from there.

The crack solver answers at once: forces on the block, its inertia as a body force, all of the block in equilibrium. Of a sudden
force that is wrong until waves have crossed the block: a block that falls on its base is decelerated as a whole, its
strain is not there yet, and the inertia of the strain to come puts the middle in *tension* (by half of the pressure on a bar pressed at both ends,
for a quarter of the time that a wave takes). Contacts that knock on their springs bring such spikes in every step. So a tip grows by the mean of K_eq over the time that a wave from the boundary takes to it, the form of the incubation-time
criterion (1/τ) ∫ K dt ≥ K_Ic over the last τ of Petrov & Morozov (1994), where steps are shorter than that.
"""

from __future__ import annotations

import numpy as np

from ..model import Blocks, Problem

_Key = tuple[int, int]


class WaveTime:
    """What has driven each tip, by its crack and end, for the time that waves take to it."""

    def __init__(self, problem: Problem) -> None:
        self._speed = np.array([m.pressure_wave_speed for m in problem.materials])
        #: (dt, K_eq) of the steps before, the last one first, as far as they count.
        self._past: dict[_Key, list[tuple[float, float]]] = {}

    def drive(self, tips: np.ndarray, blocks: Blocks, dt: float) -> np.ndarray:
        """(n_tips,) the lesser of K_eq in the present step of ``dt`` s and of its mean over the time of a wave, Pa √m."""
        driven = tips["k_eq"].copy()
        for row, time in self._longer(tips, blocks, dt):
            tip = tips[row]
            total, rest = float(tip["k_eq"]) * dt, time - dt
            for step, k_eq in self._past.get((int(tip["crack"]), int(tip["end"])), ()):
                total += k_eq * min(step, rest)
                rest -= step
                if rest <= 0:
                    break
            driven[row] = min(driven[row], total / time)
        return driven

    def end(self, tips: np.ndarray, blocks: Blocks, dt: float) -> None:
        """The step of ``dt`` s has ended with ``tips``."""
        past = {}
        for row, time in self._longer(tips, blocks, dt):
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

    def _longer(self, tips: np.ndarray, blocks: Blocks, dt: float) -> list[tuple[int, float]]:
        """Rows of ``tips`` to which waves take longer than ``dt``, and how long, s."""
        speed = self._speed[blocks.material[tips["block"]]]
        # No point of a block is farther from its outline than the radius of a disc of its area.
        far = np.sqrt(blocks.areas()[tips["block"]] / np.pi)
        found = []
        for row in np.flatnonzero(far > speed * dt).tolist():
            time = _from_outline(blocks, int(tips["block"][row]), tips["point"][row]) / float(speed[row])
            if time > dt:
                found.append((row, time))
        return found


def _from_outline(blocks: Blocks, block: int, point: np.ndarray) -> float:
    """m, distance of ``point`` (2,) from the boundary of ``block``, reference coordinates."""
    own = np.arange(blocks.vertex_start[block], blocks.vertex_start[block + 1])
    start = blocks.vertices[own]
    along = blocks.vertices[blocks.next_vertex[own]] - start
    arm = point - start
    place = np.clip(np.sum(arm * along, axis=1) / np.sum(along**2, axis=1), 0.0, 1.0)
    return float(np.hypot(*(arm - place[:, None] * along).T).min())
