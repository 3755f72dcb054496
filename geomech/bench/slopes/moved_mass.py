"""Moving mass of a slope, and the work of gravity on it.

The displacement u of a block is that of its centroid; free blocks with |u| > u₀ move. Their fraction of the mass of all
free blocks, and the work Σ m g·u of gravity on them, do not depend on time stepping or on the location of the scene, if
the run is right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...dda import block_moments
from ...model import Blocks, Problem, State

#: m: free blocks with a larger displacement move …
MOVES = 1e-3
#: … or with more than this part of free fall, if a run is too short for that.
OF_FALL = 0.1


@dataclass(frozen=True, eq=False)
class BlockDisplacements:
    """Free blocks.

    mass, area     (n,) kg/m, m²
    centre         (n, 2) m, initial centroids, in the coordinates of the scene
    displacement   (n, 2) m, of the centroids
    gravity        (2,) m/s²
    """

    mass: np.ndarray
    area: np.ndarray
    centre: np.ndarray
    displacement: np.ndarray
    gravity: np.ndarray

    @classmethod
    def of(cls, problem: Problem, blocks: Blocks, state: State) -> BlockDisplacements:
        """``blocks`` with the reference positions, ``state`` with the current ones, in a run of ``problem``."""
        before = block_moments(np.ascontiguousarray(blocks.vertices), blocks.next_vertex, blocks.vertex_start)
        now = block_moments(np.ascontiguousarray(state.vertices), blocks.next_vertex, blocks.vertex_start)
        free = ~np.asarray(blocks.fixed, bool)
        density = np.array([material.density for material in problem.materials])[blocks.material]
        return cls(
            (density * before[:, 0])[free], before[free, 0], before[free, 1:3] + problem.origin, (now - before)[free, 1:3],
            np.asarray(problem.loads.gravity.at(state.time), dtype=float),
        )  # fmt: skip

    def moves(self, threshold: float) -> np.ndarray:
        """(n,) whether a block's displacement exceeds ``threshold``, m."""
        return np.hypot(*self.displacement.T) > threshold

    def share(self, threshold: float) -> float:
        """Fraction of the mass that moves."""
        return float(self.mass[self.moves(threshold)].sum() / self.mass.sum())

    def work(self, threshold: float) -> float:
        """Work of gravity on the moving blocks, J/m."""
        moves = self.moves(threshold)
        return float(self.mass[moves] @ (self.displacement[moves] @ self.gravity))

    def weight(self) -> float:
        """Weight of all free blocks, N/m."""
        return float(self.mass.sum() * np.hypot(*self.gravity))


def moving_from(problem: Problem) -> float:
    """Displacement (m) above which blocks move in a run of ``problem``: `MOVES`, or less in short dynamic ones."""
    if problem.dda.dynamic_factor == 0.0:
        return MOVES
    end = problem.run.end_time
    return min(MOVES, OF_FALL * 0.5 * float(np.hypot(*problem.loads.gravity.at(end))) * end**2)
