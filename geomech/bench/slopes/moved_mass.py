"""The mass of a slope that moves, and what gravity has done on it.

The displacement u of a block is that of its centroid; those of free blocks with |u| > u₀ move. Their share of the
mass of all free blocks, and the work Σ m g·u of gravity on them, do not depend on how the run was stepped or where the
scene lies, if the run is right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...dda import block_moments
from ...model import Blocks, Problem, State

#: m: free blocks that have gone farther than this move …
MOVES = 1e-3
#: … or farther than this share of free fall, where a run is too short for that.
OF_FALL = 0.1


@dataclass(frozen=True, eq=False)
class BlockDisplacements:
    """Of the free blocks: ``mass`` (n,) kg/m, ``area`` (n,) m², ``centre`` (n, 2) m before and ``displacement`` (n, 2)
    m of the centroids; ``gravity`` (2,) m/s²."""

    mass: np.ndarray
    area: np.ndarray
    centre: np.ndarray
    displacement: np.ndarray
    gravity: np.ndarray

    @classmethod
    def of(cls, problem: Problem, blocks: Blocks, state: State) -> BlockDisplacements:
        """``blocks`` with the reference positions, ``state`` with the present ones, of a run of ``problem``."""
        before = block_moments(np.ascontiguousarray(blocks.vertices), blocks.next_vertex, blocks.vertex_start)
        now = block_moments(np.ascontiguousarray(state.vertices), blocks.next_vertex, blocks.vertex_start)
        free = ~np.asarray(blocks.fixed, bool)
        density = np.array([material.density for material in problem.materials])[blocks.material]
        return cls(
            (density * before[:, 0])[free], before[free, 0], before[free, 1:3], (now - before)[free, 1:3],
            np.asarray(problem.loads.gravity.at(state.time), dtype=float),
        )  # fmt: skip

    def moves(self, threshold: float) -> np.ndarray:
        """(n,) whether a block has gone farther than ``threshold``, m."""
        return np.hypot(*self.displacement.T) > threshold

    def share(self, threshold: float) -> float:
        """The part of the mass that moves."""
        return float(self.mass[self.moves(threshold)].sum() / self.mass.sum())

    def work(self, threshold: float) -> float:
        """Work of gravity on what moves, J/m."""
        moves = self.moves(threshold)
        return float(self.mass[moves] @ (self.displacement[moves] @ self.gravity))

    def weight(self) -> float:
        """Of all free blocks, N/m."""
        return float(self.mass.sum() * np.hypot(*self.gravity))


def moving_from(problem: Problem) -> float:
    """m, what goes farther than this in a run of ``problem`` moves: `MOVES`, or less in short dynamic ones."""
    if problem.dda.dynamic_factor == 0.0:
        return MOVES
    end = problem.run.end_time
    return min(MOVES, OF_FALL * 0.5 * float(np.hypot(*problem.loads.gravity.at(end))) * end**2)
