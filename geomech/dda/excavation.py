"""Excavation during a run: the blocks removed at a given time, and the time of the next event."""

from __future__ import annotations

import numpy as np

from ..model import Blocks, Excavation, Loads
from ..model.blocks.polygon import winding_number

#: Times that differ by less than this, relative to their size, are equal.
_SAME = 1e-12


class Excavations:
    """The excavations of ``loads`` on given blocks."""

    def __init__(self, blocks: Blocks) -> None:
        self._blocks = blocks
        self._known: dict[tuple[Excavation, ...], np.ndarray] = {}

    def removed(self, loads: Loads, time: float) -> np.ndarray | None:
        """(n_blocks,) True for blocks that are removed in a step that begins at ``time``; None before the first
        excavation. The same array until the next excavation."""
        past = tuple(e for e in loads.excavations if e.time <= time + _SAME * abs(time))
        if not past:
            return None
        if past not in self._known:
            out = np.zeros(self._blocks.n_blocks, bool)
            for excavation in past:
                out[self._taken(excavation)] = True
            self._known[past] = out
        return self._known[past]

    def drained(self, loads: Loads, time: float) -> np.ndarray | None:
        """(n_blocks,) True for removed blocks whose space is drained; None before the first excavation."""
        if self.removed(loads, time) is None:
            return None
        out = np.zeros(self._blocks.n_blocks, bool)
        for excavation in loads.excavations:
            if excavation.drained and excavation.time <= time + _SAME * abs(time):
                out[self._taken(excavation)] = True
        return out

    def refuse(self, loads: Loads) -> None:
        """Raises ValueError for an excavation, present or future, that contains none of these blocks or a block that
        does not exist."""
        for excavation in loads.excavations:
            self._taken(excavation)

    def _taken(self, excavation: Excavation) -> list[int]:
        n = self._blocks.n_blocks
        for block in excavation.blocks:
            if not (isinstance(block, (int, np.integer)) and 0 <= block < n):
                raise ValueError(
                    f"the excavation at {excavation.time:g} s removes block {block!r}, but there are {n}, numbered from 0"
                )
        taken = list(excavation.blocks)
        if excavation.polygon is not None:
            loop = [np.asarray(excavation.polygon, dtype=float)]
            centres = [self._blocks.area_moments(b)[1] for b in range(n)]
            taken += [b for b, centre in enumerate(centres) if abs(winding_number(loop, centre)) > 0.5]
        if not taken:
            raise ValueError(f"no block's centre lies in the polygon of the excavation at {excavation.time:g} s")
        return taken


def until_next_event(loads: Loads, time: float, dt: float) -> float:
    """``dt``, or the time from ``time`` to the next excavation or bolt installation if that is shorter: a step does not
    pass such an event."""
    coming = [e.time for e in loads.excavations] + [b.installation for b in loads.bolts]
    left = [t - time for t in coming if t > time + _SAME * max(abs(time), abs(t))]
    return min([dt, *left])
