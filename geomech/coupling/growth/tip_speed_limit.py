"""Largest growth of tips in a dynamic step: a fraction of the Rayleigh wave speed.

Running cracks are bounded by the Rayleigh wave speed c_R in tension (Freund 1990); measured speeds in rock and glass
stay below about half of it (Ravi-Chandar & Knauss 1984). The loading of a tip varies with the waves in its block:
without a limit a step of a millisecond would give a crack the length that only seconds of the same load could, and a
short pulse would grow it by more than its duration allows.
"""

from __future__ import annotations

import numpy as np

from ...ddm.growth.tie_tolerance import reached
from ...model import Blocks, Problem


class TipSpeed:
    """Growth that remains for each tip, by crack and end, in the present step.

    The limit is ``problem.growth.speed_limit`` times c_R times the step length. A tip above its toughness whose limit
    is less than the shortest increment keeps it for the next step: it grows when it could have covered the distance.
    Without density there is no limit.
    """

    def __init__(self, problem: Problem) -> None:
        self._speed = np.array([problem.growth.speed_limit * m.rayleigh_speed for m in problem.materials])
        self._shortest = problem.growth.min_increment
        self._kept: dict[tuple[int, int], float] = {}
        self._gone: dict[tuple[int, int], float] = {}

    def left(self, tips: np.ndarray, blocks: Blocks, dt: float) -> np.ndarray:
        """(n_tips,) m, remaining growth of ``tips`` in a step of ``dt`` s; 0 if less than the shortest increment."""
        way = self._speed[blocks.material[tips["block"]]] * dt
        if not np.isfinite(way).any():
            return way
        way = way + self._of(self._kept, tips) - self._of(self._gone, tips)
        return np.where(reached(way, self._shortest), way, 0.0)

    def record_growth(self, tips: np.ndarray) -> None:
        """Record the growth (``grown``) of ``tips`` in a pass of the present step."""
        for key, grown in zip(_keys(tips), tips["grown"].tolist()):
            if grown > 0:
                self._gone[key] = self._gone.get(key, 0.0) + grown

    def fastest(self, dt: float) -> float:
        """Largest tip speed in the present step of ``dt`` s, m/s."""
        return max(self._gone.values(), default=0.0) / dt

    def end(self, tips: np.ndarray, blocks: Blocks, dt: float, driven: np.ndarray) -> None:
        """The step of ``dt`` s ends with ``tips``, some of which are still above their toughness: ``driven``
        (n_tips,)."""
        way = self._speed[blocks.material[tips["block"]]] * dt + self._of(self._kept, tips) - self._of(self._gone, tips)
        waits = driven & np.isfinite(way)
        # Growth that an unloaded tip did not use is not carried over.
        self._kept = {
            key: min(left, self._shortest) for key, left, wants in zip(_keys(tips), way.tolist(), waits) if wants
        }
        self._gone = {}

    def _of(self, known: dict[tuple[int, int], float], tips: np.ndarray) -> np.ndarray:
        return np.array([known.get(key, 0.0) for key in _keys(tips)]) if known else np.zeros(len(tips))


def _keys(tips: np.ndarray) -> list[tuple[int, int]]:
    return list(zip(tips["crack"].tolist(), tips["end"].tolist()))
