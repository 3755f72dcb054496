"""How far tips may run in a step of a dynamic run: no faster than a part of the speed of Rayleigh's wave.

A crack that is driven harder than its toughness asks for runs, and what drives it comes and goes with the waves in its
block. A step that let it grow until it arrests would give it, in a millisecond, the length that seconds of the same
load would; and a push of one step's length would grow what it never had the time to. The wave's speed bounds that of a
crack in tension (Freund 1990); those measured in rock and glass stay below about half of it (Ravi-Chandar & Knauss
1984).
"""

from __future__ import annotations

import numpy as np

from ...ddm.growth.tie_tolerance import reached
from ...model import Blocks, Problem


class TipSpeed:
    """The way that each tip, by its crack and end, still has in the present step.

    ``problem.growth.speed_limit`` times c_R times the step. Of a tip that is driven but has too little way for the
    shortest increment, that much is kept for the next step: it grows when it could have got there. Rock without mass
    has no limit.
    """

    def __init__(self, problem: Problem) -> None:
        self._speed = np.array([problem.growth.speed_limit * m.rayleigh_speed for m in problem.materials])
        self._shortest = problem.growth.min_increment
        self._kept: dict[tuple[int, int], float] = {}
        self._gone: dict[tuple[int, int], float] = {}

    def left(self, tips: np.ndarray, blocks: Blocks, dt: float) -> np.ndarray:
        """(n_tips,) m that ``tips`` may still go in a step of ``dt`` s; 0 for less than the shortest increment."""
        way = self._speed[blocks.material[tips["block"]]] * dt
        if not np.isfinite(way).any():
            return way
        way = way + self._of(self._kept, tips) - self._of(self._gone, tips)
        return np.where(reached(way, self._shortest), way, 0.0)

    def went(self, tips: np.ndarray) -> None:
        """``tips`` have ``grown`` in a pass of the present step."""
        for key, grown in zip(_keys(tips), tips["grown"].tolist()):
            if grown > 0:
                self._gone[key] = self._gone.get(key, 0.0) + grown

    def fastest(self, dt: float) -> float:
        """m/s, of all tips in the present step of ``dt`` s."""
        return max(self._gone.values(), default=0.0) / dt

    def end(self, tips: np.ndarray, blocks: Blocks, dt: float, driven: np.ndarray) -> None:
        """The step of ``dt`` s has ended with ``tips``, of which some are still ``driven`` (n_tips,)."""
        way = self._speed[blocks.material[tips["block"]]] * dt + self._of(self._kept, tips) - self._of(self._gone, tips)
        waits = driven & np.isfinite(way)
        # What a tip could have gone and did not, since nothing drove it, is no head start.
        self._kept = {
            key: min(left, self._shortest) for key, left, wants in zip(_keys(tips), way.tolist(), waits) if wants
        }
        self._gone = {}

    def _of(self, known: dict[tuple[int, int], float], tips: np.ndarray) -> np.ndarray:
        return np.array([known.get(key, 0.0) for key in _keys(tips)]) if known else np.zeros(len(tips))


def _keys(tips: np.ndarray) -> list[tuple[int, int]]:
    return list(zip(tips["crack"].tolist(), tips["end"].tolist()))
