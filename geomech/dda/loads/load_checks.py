"""Checks of loads before a step: blocks and edges exist, points lie in their blocks, and no load is without effect."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...model import GROUND, BaseMotion, Blocks, Loads, ViscousBoundary
from ...model.blocks.polygon import distance_to_edges, winding_number
from ..kinematics.tolerances import LITTLE
from .bolts import labels

#: A point belongs to a block when its distance outside is at most `LITTLE` of the block's size, or this part of the whole
#: drawing's size: scenes accept points up to 1e-6 of it outside.
_OF_DRAWING = 2e-6


class LoadChecks:
    """Checks every load on given blocks once."""

    def __init__(self, blocks: Blocks) -> None:
        self._blocks = blocks
        self._seen: tuple = ()
        self._checked: set[tuple[int, tuple[float, ...]]] = set()
        self._reach = _OF_DRAWING * float(np.ptp(blocks.vertices, axis=0).max()) if blocks.n_vertices else 0.0

    def refuse(self, loads: Loads) -> None:
        """Check ``loads``.

        Raises ValueError that names the load: its block does not exist or does not contain its point, base shaking has
        no fixed block, or a viscous boundary has no edge of a moving block."""
        seen = (
            loads.point_loads, loads.point_motions, loads.block_motions, loads.bolts, loads.base,
            loads.viscous_boundaries,
        )  # fmt: skip
        if len(seen) == len(self._seen) and all(a is b for a, b in zip(seen, self._seen)):
            return
        for what, block in self._on_blocks(loads):
            self._name(what, block)
        for what, block, at in self._at_points(loads):
            key = block, tuple(at)
            if key not in self._checked:
                self._refuse_outside(what, block, np.asarray(at, dtype=float))
                self._checked.add(key)
        if loads.base is not None and loads.base.frame == "ground":
            self._refuse_unshaken(loads.base)
        for boundary in loads.viscous_boundaries:
            self._refuse_idle(boundary)
        self._seen = seen

    @staticmethod
    def _on_blocks(loads: Loads) -> Iterator[tuple[str, int]]:
        for motion in loads.block_motions:
            yield "the motion of a block", motion.block
        for block in () if loads.base is None or loads.base.blocks is None else loads.base.blocks:
            yield "the motion of the base", block

    @staticmethod
    def _at_points(loads: Loads) -> Iterator[tuple[str, int, tuple[float, float]]]:
        for k, load in enumerate(loads.point_loads):
            yield f"point load {k + 1}", load.block, load.at
        for k, motion in enumerate(loads.point_motions):
            yield f"the motion of point {k + 1}", motion.block, motion.at
        for label, bolt in zip(labels(loads.bolts), loads.bolts):
            yield f"bolt {label!r}", bolt.block, bolt.start
            if bolt.other != GROUND:
                yield f"bolt {label!r}", bolt.other, bolt.end

    def _name(self, what: str, block: int) -> str:
        n = self._blocks.n_blocks
        if not (isinstance(block, (int, np.integer)) and 0 <= block < n):
            raise ValueError(f"{what} names block {block!r}, but there are {n}, numbered from 0")
        return self._blocks.names[block]

    def _refuse_outside(self, what: str, block: int, at: np.ndarray) -> None:
        name, loops = self._name(what, block), self._blocks.loops(block)
        if abs(winding_number(loops, at)) > 0.5:
            return
        away = min(distance_to_edges(at, loop, np.roll(loop, -1, axis=0)) for loop in loops)
        if away > max(LITTLE * float(np.ptp(loops[0], axis=0).max()), self._reach):
            raise ValueError(
                f"{what} acts on {name!r} at ({at[0]:g}, {at[1]:g}), which lies {away:.3g} m outside of it: points are "
                "given in the coordinates in which the blocks were drawn"
            )

    def _refuse_unshaken(self, base: BaseMotion) -> None:
        """Raise ValueError for a base motion of blocks that are not fixed: it would have no effect on them."""
        if not self._blocks.fixed.any():
            raise ValueError(
                "ground motion is given, but no block is fixed that would follow it: fix the blocks on which others rest"
            )
        for block in base.blocks or ():
            if not self._blocks.fixed[block]:
                raise ValueError(
                    f"the motion of the base names {self._name('it', block)!r}, which is not fixed: fix it, or give it "
                    "a motion of its own"
                )

    def _refuse_idle(self, boundary: ViscousBoundary) -> None:
        what = f"a viscous boundary is on edges named {boundary.edge_name!r}"
        edges = self._blocks.edges_that_exist(boundary.edge_name, what)
        if self._blocks.fixed[self._blocks.vertex_block[edges]].all():
            raise ValueError(f"{what}, but the blocks that have them are fixed, where it has no effect")
