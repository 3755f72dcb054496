"""Cracks that are born in the blocks: where the whole rock of one of them has reached its strength."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...model import Blocks, Cracks, GrowthSettings, Material


def born_first(
    blocks: Blocks, materials: Sequence[Material], solutions: dict, settings: GrowthSettings
) -> tuple[Sequence, int]:
    """The births (`ddm.growth.initiation.Birth`) of the most overstressed block (keys of ``solutions``), whether or not it has
    reached its strength, and that block; ((), −1) when none has a strength to exceed."""
    from ...ddm.growth.initiation import births
    from ...ddm.growth.tie_tolerance import reached

    found = {b: births(solution, materials[blocks.material[b]], settings, b) for b, solution in solutions.items()}
    most = max((of[0].overstress for of in found.values() if of), default=0.0)
    # Of blocks that are alike the first.
    where = next((b for b, of in found.items() if of and reached(of[0].overstress, most)), -1)
    return found.get(where, ()), where


def bear_in_blocks(
    cracks: Cracks,
    blocks: Blocks,
    limits: Callable[[int], list[np.ndarray]],
    materials: Sequence[Material],
    solutions: dict,
    settings: GrowthSettings,
    cycle: int,
    enough: float = 1.0,
):
    """``cracks`` with those that are born in the most overstressed block, as a `Growth`, and the births; (None, ())
    when no block is strained to ``enough`` times its strength; ``limits(block)``: loops about its rock. One block at a
    time: the others then carry other loads."""
    from ...ddm.growth.initiation import bear
    from ...ddm.growth.tie_tolerance import reached
    from ...ddm.growth.tip_advance import Growth

    best, where = born_first(blocks, materials, solutions, settings)
    if not best or not reached(best[0].overstress, enough):
        return None, ()
    # The body's segments are those of its block, in order.
    of_block = np.flatnonzero(cracks.block == where)
    best = [replace(birth, segment=int(of_block[birth.segment])) if birth.segment >= 0 else birth for birth in best]
    grown = np.zeros(sum(len(solution.tips) for solution in solutions.values()))
    return Growth(bear(cracks, limits, best, cycle, where), grown, ()), best
