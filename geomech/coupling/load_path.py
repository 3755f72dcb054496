"""All that drives a run as functions of time, and where they have it at a time."""

from __future__ import annotations

import numpy as np

from ..model import History, Loads


def histories(loads: Loads) -> list[History]:
    """All functions of time that act."""
    timed = [*loads.edge_tractions, *loads.point_loads, *loads.block_motions, *loads.point_motions]
    found = [loads.gravity, *(each.history for each in timed)]
    if loads.water is not None and loads.water.level is not None:
        found.append(loads.water.level)
    if loads.base is not None:
        found.append(loads.base.acceleration)
    return found


def loads_at(loads: Loads, time: float) -> np.ndarray:
    """(n,) the values of all of them at ``time``, s, one after the other."""
    return np.concatenate([np.ravel(history.at(time)) for history in histories(loads)])
