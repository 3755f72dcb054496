"""Crack initiation in blocks: where intact rock has reached its strength."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...model import Blocks, Cracks, GrowthSettings, Material


def first_new_cracks(
    blocks: Blocks, materials: Sequence[Material], solutions: dict, settings: GrowthSettings
) -> tuple[Sequence, int]:
    """The candidate cracks (`ddm.growth.initiation.NewCrack`) of the most overstressed block (keys of ``solutions``),
    whether or not it has reached its strength, and the number of that block; ((), −1) if no material has a strength."""
    from ...ddm.growth.initiation import new_cracks
    from ...ddm.growth.tie_tolerance import reached

    found = {b: new_cracks(solution, materials[blocks.material[b]], settings, b) for b, solution in solutions.items()}
    most = max((of[0].overstress for of in found.values() if of), default=0.0)
    # Among equally overstressed blocks, the first one.
    where = next((b for b, of in found.items() if of and reached(of[0].overstress, most)), -1)
    return found.get(where, ()), where


def initiate_in_blocks(
    cracks: Cracks,
    blocks: Blocks,
    limits: Callable[[int], list[np.ndarray]],
    materials: Sequence[Material],
    solutions: dict,
    settings: GrowthSettings,
    cycle: int,
    enough: float = 1.0,
):
    """``cracks`` with those that start in the most overstressed block, as a `Growth`, and the new cracks; (None, ()) if
    no block reaches ``enough`` times its strength. ``limits(block)``: loops around its rock. Only one block at a time,
    since new cracks change the loads of the others."""
    from ...ddm.growth.initiation import add_new_cracks
    from ...ddm.growth.tie_tolerance import reached
    from ...ddm.growth.tip_advance import Growth

    best, where = first_new_cracks(blocks, materials, solutions, settings)
    if not best or not reached(best[0].overstress, enough):
        return None, ()
    # Segments of a body are those of its block, in the same order.
    of_block = np.flatnonzero(cracks.block == where)
    best = [replace(birth, segment=int(of_block[birth.segment])) if birth.segment >= 0 else birth for birth in best]
    grown = np.zeros(sum(len(solution.tips) for solution in solutions.values()))
    return Growth(add_new_cracks(cracks, limits, best, cycle, where), grown, ()), best
