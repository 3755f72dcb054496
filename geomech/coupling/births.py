"""Cracks that are born in the blocks: where the whole rock of one of them has reached its strength."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..model import Blocks, Cracks, GrowthSettings, Material


def bear_in_blocks(
    cracks: Cracks,
    blocks: Blocks,
    materials: Sequence[Material],
    solutions: dict,
    settings: GrowthSettings,
    cycle: int,
):
    """``cracks`` with those that are born in the most overstressed block, as a `Growth`, and the births; (None, ()) when no
    block (keys of ``solutions``) is strained to its strength. One block at a time: the others then carry other loads."""
    from ..ddm.growth import Growth
    from ..ddm.initiation import bear, births

    best, where = [], -1
    for b, solution in solutions.items():
        found = births(solution, materials[blocks.material[b]], settings, b)
        if found and found[0].overstress >= 1 and (not best or found[0].overstress > best[0].overstress):
            best, where = found, b
    if not best:
        return None, ()
    # The body's segments are those of its block, in order.
    of_block = np.flatnonzero(cracks.block == where)
    best = [replace(birth, segment=int(of_block[birth.segment])) if birth.segment >= 0 else birth for birth in best]
    grown = np.zeros(sum(len(solution.tips) for solution in solutions.values()))
    return Growth(bear(cracks, blocks.loops, best, cycle, where), grown, ()), best
