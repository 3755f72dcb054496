"""Bolts in a time step: axial springs and dowels between two blocks that yield, go slack and break.

T = P + k (l − l₀ − lₚ) along the axis from the first to the second end (P pretension, l₀ length at installation, lₚ
plastic elongation), within its limits; across the axis a dowel, and the geometric stiffness T/l of a taut bolt. States
are found within the step: a bolt that would exceed its limit gets the limit force, and the step is solved again.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...conventions import normal_of
from ...model import BOLT, GROUND, Bolt
from ..kinematics.midpoint_configuration import MidpointConfiguration
from ..open_close.equations import Unsettled
from .force_records import POINT_FORCE
from .prescribed_motion import Pairs

log = logging.getLogger(__name__)

#: A force is at a limit when it differs by less than this part of it.
_AT_LIMIT = 1e-9
#: Elongations below this part of a bolt's length are round-off.
_ROUND_OFF = 1e-14
#: Changes of bolt states in a step before the step is shortened.
ROUNDS = 25
#: States along the axis (and, but for SLACK, across it).
_ELASTIC, _YIELDS, _CRUSHED, _SLACK = 0, 1, -1, 2


def check_bolts(bolts: Sequence[Bolt], fixed: np.ndarray) -> None:
    """Raise ValueError that names a bolt without an end in a moving block."""
    for bolt in bolts:
        if fixed[bolt.block] and (bolt.other == GROUND or fixed[bolt.other]):
            raise ValueError(f"bolt {bolt.name!r} has no effect: both its ends are in fixed blocks")


def labels(bolts: Sequence[Bolt]) -> list[str]:
    """One name per bolt, with its number where several share a name."""
    names = [bolt.name for bolt in bolts]
    return [name if names.count(name) == 1 else f"{name}[{k}]" for k, name in enumerate(names)]


@dataclass(eq=False)
class BoltSet:
    """The bolts that act in a step, with their axes at its start; arrays (n,).

    number        rows in the loads' bolts
    ends          (n, 2, 2)  m, on the midpoint configuration
    length        m
    trial, dowel  N, forces at zero motion: axial (positive in tension), across
    geometric     N/m, geometric stiffness T/l of a taut bolt
    axial, across states
    """

    bolts: tuple[Bolt, ...]
    number: np.ndarray
    pairs: Pairs
    ends: np.ndarray
    length: np.ndarray
    trial: np.ndarray
    dowel: np.ndarray
    stiffness: np.ndarray
    shear_stiffness: np.ndarray
    least: np.ndarray
    most: np.ndarray
    strength: np.ndarray
    slack: np.ndarray
    geometric: np.ndarray
    axial: np.ndarray
    across: np.ndarray

    @classmethod
    def of(
        cls,
        bolts: tuple[Bolt, ...],
        memory: np.ndarray,
        time: float,
        point_at,
        order: np.ndarray,
        midpoint: MidpointConfiguration,
        removed: np.ndarray | None,
    ) -> tuple[BoltSet | None, np.ndarray]:
        """The bolts that act at ``time`` s (None: none), and all BOLT rows, newly installed bolts included.

        ``point_at(block, at)``: current position of a material point at the start of the step, m."""
        memory = memory.copy() if len(memory) == len(bolts) else np.zeros(len(bolts), BOLT)
        ends = np.zeros((len(bolts), 2, 2))
        for k, bolt in enumerate(bolts):
            if removed is not None and (removed[bolt.block] or (bolt.other != GROUND and removed[bolt.other])):
                memory[k]["broken"], memory[k]["force"], memory[k]["shear_force"] = True, 0.0, 0.0
                continue
            ends[k, 0] = point_at(bolt.block, bolt.start)
            ends[k, 1] = bolt.end if bolt.other == GROUND else point_at(bolt.other, bolt.end)
            if not memory[k]["installed"] and time >= bolt.installation * (1 - 1e-12):
                memory[k]["installed"], memory[k]["length"] = True, math.dist(*ends[k])
        number = np.flatnonzero(memory["installed"] & ~memory["broken"])
        if not len(number):
            return None, memory
        own, ends, rows = [bolts[k] for k in number], ends[number], memory[number]

        def column(name: str) -> np.ndarray:
            return np.array([getattr(bolt, name) for bolt in own], dtype=float)

        along = ends[:, 1] - ends[:, 0]
        length = np.hypot(along[:, 0], along[:, 1])
        axis = along / length[:, None]
        axes = np.stack([axis, normal_of(axis)], axis=1)
        block, other = np.array([b.block for b in own]), np.array([b.other for b in own])
        vectors = np.zeros((len(own), 2, 12))
        for k in range(len(own)):
            for side, (b, sign) in enumerate(((block[k], -1.0), (other[k], 1.0))):
                if b == GROUND:
                    continue
                ends[k, side] = midpoint.points(ends[k, None, side], np.array([b]))[0]
                if order[b] >= 0:
                    h = np.sqrt(midpoint.moments[b, 0])
                    t = axes[k] @ midpoint.displacement(ends[k, side], b) / [1.0, 1.0, h, h, h, h]
                    vectors[k, :, 6 * side : 6 * side + 6] = sign * t
        # A ground end has no unknowns: its half of the vectors is zero, and its block number may be the bolt's own
        # block.
        pairs = Pairs(block, other, vectors, ends, axes, -1.0, np.zeros((len(own), 2)))
        stiffness = column("stiffness")
        trial = column("pretension") + stiffness * (length - rows["length"] - rows["plastic"])
        compression = np.array([bolt.compression for bolt in own])
        most = column("yield_force")
        bolt_set = cls(
            bolts=bolts, number=number, pairs=pairs, ends=ends, length=length, trial=trial,
            dowel=rows["shear_force"].copy(),
            stiffness=stiffness, shear_stiffness=column("shear_stiffness"), least=np.where(compression, -most, 0.0), most=most,
            strength=column("shear_strength"), slack=~compression,
            geometric=np.clip(trial, 0.0, most) / length, axial=np.zeros(len(own), int), across=np.zeros(len(own), int),
        )  # fmt: skip
        bolt_set.take_states(np.zeros((len(own), 2)))
        return bolt_set, memory

    def take_states(self, motion: np.ndarray) -> bool:
        """Set the states consistent with ``motion`` (n, 2) along and across, m; True if they were consistent
        already."""
        force = self.trial + self.stiffness * motion[:, 0]
        slip = self.dowel - self.shear_stiffness * motion[:, 1]
        axial = np.where(force > self.most * (1 + _AT_LIMIT), _YIELDS, _ELASTIC)
        low = np.where(self.slack, _SLACK, _CRUSHED)
        # A slack bolt and one without force differ by more than round-off of the length.
        slack = np.where(self.slack, _ROUND_OFF * self.stiffness * self.length, _AT_LIMIT * np.abs(self.least))
        axial = np.where(force < self.least - slack, low, axial)
        across = np.where(np.abs(slip) > self.strength * (1 + _AT_LIMIT), np.sign(slip).astype(int), 0)
        same = bool((axial == self.axial).all() and (across == self.across).all())
        self.axial, self.across = axial, across
        return same

    def springs(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness (n, 2), N/m, and force at zero motion (n, 2), N, along and across, in the present states.

        Forces act on the second block; with the pairs' vectors they give generalised forces. Along the axis: −T.
        """
        elastic = self.axial == _ELASTIC
        k = np.where(elastic, self.stiffness, 0.0)
        limit = np.select([self.axial == _YIELDS, self.axial == _CRUSHED], [self.most, self.least], 0.0)
        sticks = self.across == 0
        ks = np.where(sticks, self.shear_stiffness, 0.0) + self.geometric
        dowel = np.where(sticks, self.dowel, self.across * np.where(sticks, 0.0, self.strength))
        return np.stack([k, ks], axis=1), np.stack([-np.where(elastic, self.trial, limit), dowel], axis=1)

    def forces(self, motion: np.ndarray) -> np.ndarray:
        """(n, 2) forces on the second block after ``motion`` (n, 2) m, N."""
        k, at_rest = self.springs()
        return at_rest - k * motion

    def let_elastic(self) -> None:
        """Take all bolts as elastic; `beyond` tells what they exceed."""
        self.axial, self.across = np.zeros_like(self.axial), np.zeros_like(self.across)

    def beyond(self, unknowns: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `ForceLimits.beyond`, of bolts that are all elastic: (2 n,) first blocks, then second ones."""
        at, owners = self.pairs, np.concatenate([self.pairs.block, self.pairs.other])
        rows = np.where(owners >= 0, order[owners], -1)
        own = np.where((rows >= 0)[:, None], unknowns.reshape(-1, 6)[rows], 0.0).reshape(2, -1, 1, 6)
        vectors = at.vectors.reshape(-1, 2, 2, 6)
        motion = at.shift + (vectors * own.transpose(1, 2, 0, 3)).sum(axis=(2, 3))
        force = self.trial + self.stiffness * motion[:, 0]
        dowel = self.dowel - self.shear_stiffness * motion[:, 1]
        # Forces act on the second block, along the axis −T.
        lost = np.stack(
            [force - np.clip(force, self.least, self.most), np.clip(dowel, -self.strength, self.strength) - dowel]
        )
        if not lost.any():
            return rows[:0], own[0, :0, 0]
        push = np.einsum("kn,nka->na", lost, at.vectors)
        return rows, np.concatenate([push[:, :6], push[:, 6:]])

    def motion(self, unknowns: np.ndarray, order: np.ndarray) -> np.ndarray:
        """(n, 2) elongation and relative motion across the axis, m, from the solver's ``unknowns`` (n_free, 6)."""
        out = self.pairs.shift.copy()
        for side, owner in enumerate((self.pairs.block, self.pairs.other)):
            row = np.where(owner >= 0, order[owner], -1)
            free = row >= 0
            part = self.pairs.vectors[free, :, 6 * side : 6 * side + 6]
            out[free] += np.einsum("nka,na->nk", part, unknowns[row[free]])
        return out

    def stiffen_turning(self, matrix: np.ndarray, order: np.ndarray, moments: np.ndarray) -> None:
        """Add the geometric stiffness of taut bolts against rotation to ``matrix`` (n_free, 6, 6), in place.

        The force F at the arm a from the centroid has the moment a × F − ϑ a·F after a rotation ϑ. Without this term a
        hanging block would swing with growing amplitude."""
        tension = np.clip(self.trial, 0.0, self.most)
        for side, owner in enumerate((self.pairs.block, self.pairs.other)):
            pull = (1.0, -1.0)[side] * tension[:, None] * self.pairs.axes[:, 0]
            arm = self.ends[:, side] - moments[owner, 1:3]
            row = np.where(owner >= 0, order[owner], -1)
            turning = np.maximum(np.sum(arm * pull, axis=1), 0.0) / moments[owner, 0]
            np.add.at(matrix[:, 2, 2], row[row >= 0], turning[row >= 0])

    def assemble(
        self, matrix: np.ndarray, right: np.ndarray, order: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """``matrix`` (n_free, 6, 6) and ``right`` (n_free, 6) with the bolts' contributions, and their off-diagonal
        blocks (n, 6, 6) between first and second block."""
        matrix, right = matrix.copy(), right.copy()
        k, at_rest = self.springs()
        push = at_rest - k * self.pairs.shift
        stiff = np.einsum("nk,nka,nkb->nab", k, self.pairs.vectors, self.pairs.vectors)
        load = np.einsum("nk,nka->na", push, self.pairs.vectors)
        for side, owner in enumerate((self.pairs.block, self.pairs.other)):
            row, part = np.where(owner >= 0, order[owner], -1), slice(6 * side, 6 * side + 6)
            free = row >= 0
            np.add.at(matrix, row[free], stiff[free, part, part])
            np.add.at(right, row[free], load[free, part])
        return matrix, right, stiff[:, :6, 6:]

    def remember(self, memory: np.ndarray, motion: np.ndarray, point_at) -> None:
        """Update the BOLT rows ``memory`` for the finished step; ``point_at(block, at)``: positions after it, m."""
        forces = self.forces(motion)
        for row, k in enumerate(self.number):
            bolt, kept = self.bolts[k], memory[k]
            tension = -forces[row, 0]
            if self.axial[row] in (_YIELDS, _CRUSHED):
                kept["plastic"] += (self.trial[row] + bolt.stiffness * motion[row, 0] - tension) / bolt.stiffness
            # The tension rotates with the bolt; the dowel's history does not.
            dowel = self.dowel[row] - bolt.shear_stiffness * motion[row, 1]
            if self.across[row]:
                limit = self.across[row] * bolt.shear_strength
                kept["slid"] += abs(dowel - limit) / bolt.shear_stiffness
                dowel = limit
            kept["force"], kept["shear_force"] = tension, dowel
            end = bolt.end if bolt.other == GROUND else point_at(bolt.other, bolt.end)
            strain = math.dist(point_at(bolt.block, bolt.start), end) / kept["length"] - 1.0
            if strain > bolt.breaking_strain:
                log.warning("bolt %r breaks at a strain of %.3g", bolt.name, strain)
                kept["broken"] = True

    def point_rows(self, forces: np.ndarray) -> np.ndarray:
        """POINT_FORCE rows of both ends of every bolt, without ends in the ground, under ``forces`` (n, 2) N."""
        rows = np.zeros(2 * len(self.number), POINT_FORCE)
        on_second = np.einsum("nk,nkd->nd", forces, self.pairs.axes)
        own = [self.bolts[k] for k in self.number]
        for side, sign in ((0, -1.0), (1, 1.0)):
            part = rows[side::2]
            part["block"] = [(bolt.block, bolt.other)[side] for bolt in own]
            part["at"] = [(bolt.start, bolt.end)[side] for bolt in own]
            part["point"], part["force"] = self.ends[:, side], sign * on_second
        return rows[rows["block"] != GROUND]

    def unsettled(self) -> Unsettled:
        """Message that bolt states are inconsistent with the motion, so that the step is shortened."""
        return Unsettled(f"the states of bolts {[self.bolts[k].name for k in self.number]} did not settle")
