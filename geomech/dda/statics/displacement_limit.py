"""Largest displacement of blocks on the way to an equilibrium of the structure as drawn.

A search for equilibrium moves blocks until forces balance. In an equilibrium of the structure as drawn, displacements
are limited to the compression of joints, the strain of blocks and the elongation of bolts. A block that slides or falls
until it lands is in equilibrium too, but as part of another structure. Blocks of size h = √area have therefore
collapsed, wherever they end, once a vertex has moved farther than

    h / 2000  +  five times the largest displacement without joint failure  +  the displacement that makes a bolt yield

plus twice the deflection of blocks of higher order and the displacement by the strain of cracks, and farther than any block that has not collapsed. The term for
bolts is at most h / 10, and zero for a bolt without yield force, whose load depends on the displacement allowed. Blocks
drawn apart from their supports first fall onto them; their displacement counts from there.
"""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np

from ...model import CONTACT, GROUND, OPEN, JointLaw, Loads, State
from ..kinematics.tolerances import LITTLE
from ..results import NotConverged, StepResult
from ..system import BlockSystem
from .sharp_toes import SHARP

log = logging.getLogger(__name__)

#: Displacement allowed in addition to elastic ones, relative to the block's size √area. Stable slopes, walls and arches
#: move by 1e-6 to 1e-5 of it on springs of 40 E'.
MOVED = 5e-4
#: Largest displacement of a bolted block, in units of the bolt's elongation: a block that moves at 70° to its bolt
#: stretches it by a third of its displacement. The second number is for blocks wedged in above the bolted one.
_STRETCHED, _WEDGED = 3.0, 10.0
#: Largest displacement allowed by bolts, relative to the block's size.
FARTHEST = 0.1
#: The strength of joints that do not fail, Pa.
_UNBREAKABLE = 1e15
#: Length of that static step, s: inertia is negligible.
_LONG = 1e4
#: Factor on displacements without joint failure, for joints that open and slide a little: voussoir beams sag twice as
#: much as bonded ones.
_OPENING = 5.0


class DisplacementLimit:
    """Displacement limit of the blocks of ``system`` from ``begin`` under ``loads`` of ``load_time`` s.

    ``reference`` (n_vertices, 2) m: positions from which displacements count; ``seated`` (n_blocks,): False for blocks
    without a chain of contacts to a support."""

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
        """(n_blocks,) bool: blocks held by something other than contacts."""
        system, blocks = self._system, self._system.blocks
        constrained = system.fixed.copy()
        if blocks.constrained is not None:
            constrained |= blocks.constrained.any(axis=1)
        for bolt in self._loads.bolts:
            constrained[bolt.block] |= bolt.other == GROUND
        constrained[[motion.block for motion in self._loads.block_motions]] = True
        constrained[[motion.block for motion in self._loads.point_motions]] = True
        return constrained

    def _seat(self, block: np.ndarray, other: np.ndarray) -> None:
        """Mark as seated all blocks that touch seated blocks, repeatedly."""
        bolts = [(bolt.block, bolt.other) for bolt in self._loads.bolts if bolt.other != GROUND]
        one = np.concatenate([block, np.array([a for a, _ in bolts], int)])
        two = np.concatenate([other, np.array([b for _, b in bolts], int)])
        while True:
            new = (self.seated[one] & ~self.seated[two]) | (self.seated[two] & ~self.seated[one])
            if not new.any():
                return
            self.seated[one[new]] = self.seated[two[new]] = True

    def follow(self, result: StepResult) -> None:
        """Restart the displacements of blocks not seated before the step ``result`` from their new positions."""
        if self.seated.all():
            return
        loose = np.repeat(~self.seated, np.diff(self._system.vertex_start))
        self.reference[loose] = result.state.vertices[loose]
        rows = result.contacts[result.contacts["state"] != OPEN]
        self._seat(rows["block"], rows["other"])

    def moved(self, vertices: np.ndarray) -> np.ndarray:
        """(n_blocks,) m: largest displacement of each block's vertices."""
        way = np.hypot(*(vertices - self.reference).T)
        return np.maximum.reduceat(way, self._system.vertex_start[:-1])

    def allowed(self, state: State) -> np.ndarray:
        """(n_blocks,) m: limit of each block in ``state``."""
        own = MOVED * self._size
        moved = self.moved(state.vertices)
        if not (moved > own)[~self._system.fixed].any():
            return own
        own = own + self.elastic + self.stretching(state, moved) + self.bending(state) + self.cracking(state)
        within = moved <= own
        return own + float(moved[within].max(initial=0.0))

    def farthest(self) -> np.ndarray:
        """(n_blocks,) m: upper bound of the limit in any state."""
        own = MOVED * self._size + self.elastic
        stretched = any(not math.isinf(bolt.yield_force) for bolt in self._loads.bolts)
        return own + FARTHEST * self._size if stretched else own

    def beyond(self, state: State) -> np.ndarray:
        """Indices of the blocks beyond their limit, the largest excess first."""
        moved, allowed = self.moved(state.vertices), self.allowed(state)
        share = np.where(self._system.fixed | ~self.seated, 0.0, moved / allowed)
        order = np.argsort(-share, kind="stable")
        return order[share[order] > 1.0]

    def stretching(self, state: State, moved: np.ndarray) -> np.ndarray:
        """(n_blocks,) m: part of the displacements ``moved`` (n_blocks,) that stretches a bolt elastically."""
        longest = np.zeros(len(moved))
        for bolt, row in zip(self._loads.bolts, state.bolts, strict=False):
            if not row["installed"] or row["broken"] or not bolt.stiffness > 0.0 or math.isinf(bolt.yield_force):
                continue
            elastic, yielded = abs(row["force"] - bolt.pretension) / bolt.stiffness, abs(row["plastic"])
            if elastic > 0.0:
                most = np.full(len(moved), _WEDGED * elastic)
                most[[b for b in (bolt.block, bolt.other) if b != GROUND]] = _STRETCHED * elastic
                longest = np.maximum(longest, np.minimum(most, moved * elastic / (elastic + yielded)))
        return np.minimum(longest, FARTHEST * self._size)

    def bending(self, state: State) -> float:
        """m: displacement due to the deflection of blocks of higher order: a beam sags by its deflection, blocks on it
        by up to twice that."""
        deflected = self._system.deflected
        return 0.0 if deflected is None else 2.0 * float(deflected.deflection_of(state)[0].max())

    def cracking(self, state: State) -> float:
        """m: displacement due to the strain of the cracks in blocks: that of a block's farthest vertex from its centre,
        and of blocks that rest on it by up to five times as much."""
        strain = np.abs(state.crack_strain).max(axis=1)
        return _OPENING * float((strain * self._size).max(initial=0.0))

    @property
    def elastic(self) -> float:
        """m: displacement due to strain, from the largest displacement of a vertex without joint failure; 0 if joints
        alone do not support the blocks."""
        if self._elastic is None:
            end = without_failure(self._system, self._begin, self._loads, self._time)
            way = 0.0 if end is None else float(np.hypot(*(end.vertices - self._begin.vertices).T).max())
            self._elastic = _OPENING * way
        return self._elastic


def without_failure(system: BlockSystem, begin: State, loads: Loads, load_time: float) -> State | None:
    """Static equilibrium of the blocks of ``system`` from ``begin`` with joints that cannot fail, under ``loads`` of
    ``load_time`` s; None if joints alone do not support the blocks."""
    laws = [
        JointLaw(
            law.name, law.friction_angle, _UNBREAKABLE, _UNBREAKABLE, normal_stiffness=law.normal_stiffness,
            shear_stiffness=law.shear_stiffness,
        )
        for law in system.joints
    ]  # fmt: skip
    begin = replace(begin, time=0.0, contacts=np.empty(0, CONTACT), velocity=np.zeros_like(begin.velocity))
    unbreakable = system.with_joints(laws)
    # With rounded toes, bonds would pull the gap at the toe closed.
    unbreakable.finder.toes = SHARP
    unbreakable.finder.bonds_fail = False
    try:
        result = unbreakable.step(begin, loads, _LONG, load_time=load_time, pseudo_inertia=True)
    except (NotConverged, ValueError) as failure:
        log.debug("no displacements without joint failure: %s", failure)
        return None
    return None if result.statistics["unbalanced_ratio"] > LITTLE else result.state
