"""Shorter increments where cracks come near each other.

A load at which cracks join is a maximum on the way of all tips together. Tips that stand ahead of where a load would
bring them, by up to an increment, relieve or drive the others there: the maximum is then off by the first order of the
increment, however exactly the tip that passes it is followed. So all tips of a block, the far ones too, take at least
so many increments to what is left to the nearest other crack.
"""

from __future__ import annotations

import numpy as np

from ...model import Cracks, GrowthSettings


def longest_advance(cracks: Cracks, tips: np.ndarray, settings: GrowthSettings) -> np.ndarray:
    """(n_tips,) m: how far each of ``tips`` (TIP rows) may go, the distance from the nearest tip in its block to
    another crack over ``settings.approach_steps``; never less than the shortest increment, nor more than the
    longest."""
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
