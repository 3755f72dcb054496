"""The time functions of all loads of a run, and their values at a given time."""

from __future__ import annotations

import numpy as np

from ..model import History, Loads


def histories(loads: Loads) -> list[History]:
    """All time functions of ``loads``."""
    found = [loads.gravity]
    for group in (loads.edge_tractions, loads.point_loads, loads.block_motions, loads.point_motions):
        found += [each.history for each in group]
    if loads.water is not None:
        found += [history for history in (loads.water.level, loads.water.share) if history is not None]
    if loads.base is not None:
        found.append(loads.base.acceleration)
    return found


def loads_at(loads: Loads, time: float) -> np.ndarray:
    """(n,) values of all time functions at ``time`` s, one after the other."""
    return np.concatenate([np.ravel(history.at(time)) for history in histories(loads)])
