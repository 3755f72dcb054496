"""Tip growth in dynamic runs: delayed by the arrival of waves (`wave_arrival`), limited in speed
(`tip_speed_limit`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...ddm.growth.tie_tolerance import reached
from ...model import Blocks, Problem
from ..load_transfer.boundary_tractions import BoundaryLoad
from .tip_speed_limit import TipSpeed
from .wave_arrival import LeftOut, WaveTime


class DynamicTips:
    """`TipSpeed` and `WaveTime` of the tips of ``problem``."""

    def __init__(self, problem: Problem) -> None:
        self.speed, self.waves = TipSpeed(problem), WaveTime(problem)
        self._k_ic = np.array([m.k_ic for m in problem.materials])

    def remaining_growth(
        self, tips: np.ndarray, blocks: Blocks, dt: float, loads: Mapping[int, BoundaryLoad]
    ) -> np.ndarray:
        """(n_tips,) m, remaining growth of ``tips`` in the present step of ``dt`` s."""
        return np.where(self._driven(tips, blocks, dt, loads), self.speed.left(tips, blocks, dt), 0.0)

    def record_growth(self, tips: np.ndarray) -> None:
        """Record the growth (``grown``) of ``tips`` in a pass of the present step."""
        self.speed.record_growth(tips)

    def end(
        self,
        tips: np.ndarray,
        blocks: Blocks,
        dt: float,
        loads: Mapping[int, BoundaryLoad],
        left_out: Mapping[int, LeftOut],
    ) -> None:
        """The step of ``dt`` s ends with ``tips``, and those of blocks ``left_out`` (block →)."""
        self.speed.end(tips, blocks, dt, self._driven(tips, blocks, dt, loads))
        self.waves.end(tips, blocks, dt, loads, left_out)

    def _driven(self, tips: np.ndarray, blocks: Blocks, dt: float, loads: Mapping[int, BoundaryLoad]) -> np.ndarray:
        k_ic = self._k_ic[blocks.material[tips["block"]]]
        # The drive is no more than K_eq of the step itself.
        at = np.flatnonzero(reached(tips["k_eq"], k_ic))
        out = np.zeros(len(tips), bool)
        if len(at):
            out[at] = reached(self.waves.drive(tips[at], blocks, dt, loads), k_ic[at])
        return out
