"""How far blocks may move on their way to an equilibrium: beyond, what they come to rest on was not there to begin with.

A search for equilibrium moves blocks until forces balance. Where they balance at once, joints give by what they are
pressed, blocks by what they are strained, and bolts by what they are stretched: that much moves in an equilibrium of the
structure that was drawn. A block that slides or falls until it lands balances too, but as another structure. Blocks of
the size h = √area have therefore collapsed, wherever they end, once a vertex has moved farther than

    h / 2000  +  five times the largest displacement were no joint to fail  +  what stretches a bolt to its yield force

and twice what blocks of higher order deflect (what stretches a bolt counts h / 10 at most, and nothing for a bolt that
never yields: what it may take is a matter of how far blocks may move), and than any other block that has not. Blocks
that were drawn apart from all that holds them first fall on it: their way counts from there.
"""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np

from ...model import CONTACT, GROUND, OPEN, JointLaw, Loads, State
from ..results import NotConverged, StepResult
from ..system import BlockSystem
from .sharp_toes import SHARP

log = logging.getLogger(__name__)

#: What blocks may move beside what elasticity explains, in parts of their size √area. Slopes, walls and arches that
#: stand move by 1e-6 to 1e-5 of it on springs of 40 E'.
MOVED = 5e-4
#: A block may move this many times as far as a bolt that holds it is stretched, at most: what moves at 70° to a bolt
#: stretches it by a third of its way; what is wedged in above the block that it holds moves farther than this.
_STRETCHED, _WEDGED = 3.0, 10.0
#: No bolt lets a block move by more than this part of its size.
_FARTHEST = 0.1
#: The strength of joints that do not fail, Pa.
_UNBREAKABLE = 1e15
#: With what is left out of balance below this part of forces, joints that do not fail have borne the loads.
_BALANCED = 1e-3
#: Such a step is so long, s: it leaves inertia no part.
_LONG = 1e4
#: Where joints open and slide a little, blocks move so many times as far as where no joint fails: beams of voussoirs sag
#: twice as much as glued ones.
_OPENING = 5.0


class DisplacementLimit:
    """How far the blocks of a ``system`` may move from ``begin`` under ``loads`` of ``load_time`` s.

    ``reference`` (n_vertices, 2) m: where the way of each vertex counts from; ``seated`` (n_blocks,) False for blocks
    that nothing touches which is held."""

    def __init__(self, system: BlockSystem, begin: State, loads: Loads, load_time: float) -> None:
        self._system, self._loads, self._time = system, loads, load_time
        self._begin = begin
        self._size = np.sqrt(system.blocks.areas())
        self._elastic: float | None = None
        self.reference = begin.vertices.copy()
        self.seated = self._constrained()
        near = system.contacts_near(begin)
        touches = near.gap_before <= MOVED * np.minimum(self._size[near.block], self._size[near.other])
        self._seat(near.block[touches], near.other[touches])

    def _constrained(self) -> np.ndarray:
        """(n_blocks,) what is held by anything but contacts."""
        system, blocks = self._system, self._system.blocks
        constrained = system.fixed.copy()
        if blocks.constrained is not None:
            constrained |= blocks.constrained.any(axis=1)
        for bolt in self._loads.bolts:
            constrained[bolt.block] |= bolt.other == GROUND
        for motion in (*self._loads.block_motions, *self._loads.point_motions):
            constrained[motion.block] = True
        return constrained

    def _seat(self, block: np.ndarray, other: np.ndarray) -> None:
        """Seat what touches seated blocks, one after the other."""
        bolts = [(bolt.block, bolt.other) for bolt in self._loads.bolts if bolt.other != GROUND]
        one = np.concatenate([block, np.array([a for a, _ in bolts], int)])
        two = np.concatenate([other, np.array([b for _, b in bolts], int)])
        while True:
            new = (self.seated[one] & ~self.seated[two]) | (self.seated[two] & ~self.seated[one])
            if not new.any():
                return
            self.seated[one[new]] = self.seated[two[new]] = True

    def follow(self, result: StepResult) -> None:
        """Count the way of blocks that are not yet seated from where ``result`` has brought them."""
        if self.seated.all():
            return
        loose = np.repeat(~self.seated, np.diff(self._system.vertex_start))
        self.reference[loose] = result.state.vertices[loose]
        rows = result.contacts[result.contacts["state"] != OPEN]
        self._seat(rows["block"], rows["other"])

    def moved(self, vertices: np.ndarray) -> np.ndarray:
        """(n_blocks,) m by which the farthest vertex of each block has moved."""
        way = np.hypot(*(vertices - self.reference).T)
        return np.maximum.reduceat(way, self._system.vertex_start[:-1])

    def allowed(self, state: State) -> np.ndarray:
        """(n_blocks,) m that each block may move, with ``state`` what it is."""
        own = MOVED * self._size
        moved = self.moved(state.vertices)
        if not (moved > own)[~self._system.fixed].any():
            return own
        own = own + self.elastic + self.stretching(state, moved) + self.bending(state)
        within = moved <= own
        return own + float(moved[within].max(initial=0.0))

    def farthest(self) -> np.ndarray:
        """(n_blocks,) m that no block may move more than, whatever else happens."""
        own = MOVED * self._size + self.elastic
        stretched = any(not math.isinf(bolt.yield_force) for bolt in self._loads.bolts)
        return own + _FARTHEST * self._size if stretched else own

    def beyond(self, state: State) -> np.ndarray:
        """Indices of the blocks that have moved farther than they may, the one that has most so first."""
        moved, allowed = self.moved(state.vertices), self.allowed(state)
        share = np.where(self._system.fixed | ~self.seated, 0.0, moved / allowed)
        order = np.argsort(-share, kind="stable")
        return order[share[order] > 1.0]

    def stretching(self, state: State, moved: np.ndarray) -> np.ndarray:
        """(n_blocks,) m: how much of the way that blocks have ``moved`` (n_blocks,) has stretched a bolt elastically."""
        longest = np.zeros(len(moved))
        for bolt, row in zip(self._loads.bolts, state.bolts, strict=False):
            if not row["installed"] or row["broken"] or not bolt.stiffness > 0.0 or math.isinf(bolt.yield_force):
                continue
            elastic, yielded = abs(row["force"] - bolt.pretension) / bolt.stiffness, abs(row["plastic"])
            if elastic > 0.0:
                most = np.full(len(moved), _WEDGED * elastic)
                most[[b for b in (bolt.block, bolt.other) if b != GROUND]] = _STRETCHED * elastic
                longest = np.maximum(longest, np.minimum(most, moved * elastic / (elastic + yielded)))
        return np.minimum(longest, _FARTHEST * self._size)

    def bending(self, state: State) -> float:
        """m: what deflections of blocks of higher order explain: a beam goes down by as much as it bends, and what lies on
        it by twice that."""
        deflected = self._system.deflected
        return 0.0 if deflected is None else 2.0 * float(deflected.deflection_of(state)[0].max())

    @property
    def elastic(self) -> float:
        """m: what strains explain at most, from the largest displacement of a vertex were no joint to fail; 0 where
        joints alone do not hold the blocks."""
        if self._elastic is None:
            end = without_failure(self._system, self._begin, self._loads, self._time)
            way = 0.0 if end is None else float(np.hypot(*(end.vertices - self._begin.vertices).T).max())
            self._elastic = _OPENING * way
        return self._elastic


def without_failure(system: BlockSystem, begin: State, loads: Loads, load_time: float) -> State | None:
    """The static equilibrium of the blocks of ``system`` from ``begin`` were no joint to fail, under ``loads`` of
    ``load_time`` s; None where joints alone do not hold the blocks."""
    laws = [
        JointLaw(
            law.name, law.friction_angle, _UNBREAKABLE, _UNBREAKABLE, normal_stiffness=law.normal_stiffness,
            shear_stiffness=law.shear_stiffness,
        )
        for law in system.joints
    ]  # fmt: skip
    begin = replace(begin, time=0.0, contacts=np.empty(0, CONTACT), velocity=np.zeros_like(begin.velocity))
    unbreakable = system.with_joints(laws)
    # Bonds would draw together what stands off.
    unbreakable.finder.toes = SHARP
    try:
        result = unbreakable.step(begin, loads, _LONG, load_time=load_time, pseudo_inertia=True)
    except (NotConverged, ValueError) as failure:
        log.debug("what elasticity explains is not known: %s", failure)
        return None
    return None if result.statistics["unbalanced_ratio"] > _BALANCED else result.state
