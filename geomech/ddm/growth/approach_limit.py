"""Shorter increments where cracks approach each other.

The load at which cracks coalesce is a maximum along the paths of all tips together. Tips that are ahead of their place
at that load, by up to an increment, unload or load the others: the error of the maximum is of first order in the
increment, however exactly the coalescing tip is followed. Therefore all tips of a block, distant ones included, divide
the remaining distance to the nearest other crack into at least a given number of increments.
"""

from __future__ import annotations

import numpy as np

from ...model import Cracks, GrowthSettings


def longest_advance(cracks: Cracks, tips: np.ndarray, settings: GrowthSettings) -> np.ndarray:
    """(n_tips,) m: largest increment of each of ``tips`` (TIP rows): the distance between the nearest tip in its block
    and another crack over ``settings.approach_steps``, between the shortest and the longest increment."""
    out = np.full(len(tips), settings.increment)
    if not settings.approach_steps:
        return out
    for block in np.unique(tips["block"]).tolist():
        rows, segments = np.flatnonzero(tips["block"] == block), np.flatnonzero(cracks.block == block)
        start, end = cracks.nodes[cracks.segments[segments]].swapaxes(0, 1)
        other = tips["crack"][rows, None] != cracks.crack[segments]
        nearest = np.where(other, _distances(tips["point"][rows], start, end), np.inf).min(initial=np.inf)
        out[rows] = np.clip(nearest / settings.approach_steps, settings.min_increment, settings.increment)
    return out


def _distances(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(n, m) from ``points`` (n, 2) to the segments from ``start`` to ``end`` (m, 2)."""
    along, away = end - start, points[:, None] - start
    share = np.clip((away * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(away - share[..., None] * along, axis=2)
