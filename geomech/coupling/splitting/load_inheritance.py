"""Transfers the loads of split blocks to their parts, and loads to a new reference configuration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...model import GROUND, Loads


def on_children(loads: Loads, parent: np.ndarray, child: Callable[[int, tuple[float, float]], int]) -> Loads:
    """``loads`` with the numbers of the blocks after a split.

    ``parent`` (n_blocks,): each block's number before the split; ``child(block, point)``: the part of ``block`` that
    contains a point. Point loads go to the part with their point; what moves or excavates a whole block applies to all
    its parts.
    """

    def parts(block: int) -> list[int]:
        return np.flatnonzero(parent == block).tolist()

    base = loads.base
    if base is not None and base.blocks is not None:
        base = replace(base, blocks=tuple(part for b in base.blocks for part in parts(b)))
    return replace(
        loads,
        point_loads=tuple(replace(p, block=child(p.block, p.at)) for p in loads.point_loads),
        point_motions=tuple(replace(p, block=child(p.block, p.at)) for p in loads.point_motions),
        block_motions=tuple(replace(m, block=part) for m in loads.block_motions for part in parts(m.block)),
        bolts=tuple(
            replace(
                b,
                block=child(b.block, b.start),
                other=GROUND if b.other == GROUND else child(b.other, b.end),
            )
            for b in loads.bolts
        ),
        excavations=tuple(
            replace(e, blocks=tuple(part for b in e.blocks for part in parts(b))) for e in loads.excavations
        ),
        base=base,
    )


def on_moved(loads: Loads, moved: Callable[[int, tuple[float, float]], tuple[float, float]]) -> Loads:
    """``loads`` with their material points at ``moved(block, point)``, in a new reference configuration."""
    return replace(
        loads,
        point_loads=tuple(replace(p, at=moved(p.block, p.at)) for p in loads.point_loads),
        point_motions=tuple(replace(p, at=moved(p.block, p.at)) for p in loads.point_motions),
        bolts=tuple(
            replace(
                b,
                start=moved(b.block, b.start),
                end=b.end if b.other == GROUND else moved(b.other, b.end),
            )
            for b in loads.bolts
        ),
    )
