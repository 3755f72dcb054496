"""Limits of a time step: its length, the search distance of contacts, and whether a corner crossed an outline.

Three limits shorten a step: no vertex moves by more than ``max_displacement_ratio`` of half the domain's diagonal, the
resolution that the user asks for; no two blocks in or near contact move or rotate relative to each other by more than
the contact geometry of the step is valid for (`relative_motion`); and no vertex enters or passes through a block
(`continuous_collision`). `Work.shortened` counts the blocks that shortened steps, by reason.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...model import OPEN, DdaSettings, Shortened
from ..contact_detection.contact_finder import ContactFinder
from ..contact_detection.neighbour_search import boxes
from ..counters import Work
from ..kinematics.midpoint_configuration import affine_motion
from ..kinematics.simplex_integration import fastest_vertex
from ..kinematics.tolerances import LITTLE, NOTABLE
from .continuous_collision import INTO, THROUGH, Allowed, Paths, crossings
from .relative_motion import AIM, Windows

if TYPE_CHECKING:
    from ..interfaces import AttemptedStep
    from ..results import StepResult

log = logging.getLogger(__name__)

#: Where a vertex crossed an outline, contacts are searched for within this many times the blocks' motion.
_WIDER = 1.5


#: Reasons why steps are shortened, and the remedy.
DISPLACEMENT, APPROACH, CROSSING, UNSETTLED = "displacement", "relative motion", "crossing", "contact states"
WAY_OUT = {
    DISPLACEMENT: "raise dda.max_displacement_ratio if motion need not be followed so finely",
    APPROACH: "small blocks that move fast past others shorten steps: merge them (geometry.smallest_block_m2)",
    CROSSING: "blocks thinner than a step's motion require shorter steps: merge slivers (geometry.smallest_block_m2), or "
    "shorten dda.time_step_s",
    UNSETTLED: "shorten dda.time_step_s, or merge small blocks (geometry.smallest_block_m2)",
}


@dataclass(frozen=True, eq=False)
class Used:
    """Motion of a step relative to the limits.

    share           largest ratio of motion to its limit
    reason, why, blocks   in words, by kind, and the blocks concerned
    moved           relative motion of the pairs in contact
    """

    share: float
    reason: str
    moved: Windows
    why: str
    blocks: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Crossed:
    """Crossings of outlines in a step.

    reason   in words
    pairs, motion   (k, 2) blocks concerned and (k,) their relative motion, m
    through  whether a vertex passed through a block
    blocks   the worst two
    """

    reason: str
    pairs: np.ndarray
    motion: np.ndarray
    through: bool
    blocks: tuple[int, int]


class StepLimits:
    """Step limits of one system; ``half_diagonal`` (m) is that of the domain."""

    def __init__(
        self, finder: ContactFinder, settings: DdaSettings, half_diagonal: float, vertex_start: np.ndarray,
        next_vertex: np.ndarray, work: Work,
    ) -> None:  # fmt: skip
        self._finder, self._size, self._start, self._next = finder, finder.widths, vertex_start, next_vertex
        self.displacement = settings.max_displacement_ratio * half_diagonal
        self._work = work
        self._warned_of: set[tuple[int, int]] = set()
        #: False where blocks are followed only to see how far they go.
        self.warns = True

    def predicted(
        self, vertices: np.ndarray, carried: np.ndarray, moments: np.ndarray, dt: float, gravity: np.ndarray
    ) -> float:
        """``dt``, shortened where the velocity ``carried`` (n_blocks, 6) alone would exceed the limits."""
        if not carried.any():
            return dt
        g = float(np.hypot(*gravity))
        speed, may = float(fastest_vertex(carried, vertices, self._start, moments)), AIM * self.displacement
        # Root of speed t + g t²/2 = limit, in the form that is accurate for small g.
        longest = 2.0 * may / (speed + np.sqrt(speed * speed + 2.0 * g * may))
        shorter = min(dt, longest)
        pair = None
        if len(self._size) > 1:
            affine = affine_motion(shorter * carried)
            turn, centroid = shorter * carried[:, 2], np.ascontiguousarray(moments[:, 1:3])
            shorter, pair = self._finder.approach.longest(vertices, affine, turn, centroid, shorter, g)
        if pair is not None:
            self.shortens(APPROACH, *pair)
        elif shorter < dt:
            self.shortens(DISPLACEMENT, int(np.argmax(np.abs(carried[:, :2]).max(axis=1))))
        return shorter

    def windows(
        self, vertices: np.ndarray, carried: np.ndarray, moments: np.ndarray, dt: float, gravity: np.ndarray,
        lift: float = 0.0,
    ) -> Windows:  # fmt: skip
        """Search distances of contacts in a step of ``dt``; ``lift`` (m) is the largest distance at which a contact
        presses.

        Without velocity no motion is expected.
        """
        fall = float(np.hypot(*gravity)) * dt * dt if carried.any() else 0.0
        return self._finder.approach.windows(
            vertices, affine_motion(dt * carried), np.ascontiguousarray(moments[:, 1:3]), fall, lift
        )

    def used(self, attempt: AttemptedStep, result: StepResult) -> Used:
        """Motion of a step relative to the limits."""
        affine = affine_motion(attempt.increment)
        closed = result.contacts[result.contacts["state"] != OPEN]
        n = len(self._size)
        keys = np.unique(
            np.minimum(closed["block"], closed["other"]) * n + np.maximum(closed["block"], closed["other"])
        )
        pairs = np.stack([keys // n, keys % n], axis=1)
        shares = self._finder.approach.shares(
            pairs, attempt.vertices, affine, attempt.increment[:, 2], np.ascontiguousarray(attempt.moments[:, 1:3])
        )
        moved = Windows(pairs, shares[:, 0])
        of_all = attempt.largest / self.displacement
        worst = int(np.argmax(shares[:, 1])) if len(pairs) else -1
        if worst >= 0 and shares[worst, 1] > of_all:
            a, b = pairs[worst].tolist()
            reason = (
                f"{self._named(a)} and {self._named(b)} move {shares[worst, 0]:.3g} m and turn "
                f"{abs(attempt.increment[a, 2] - attempt.increment[b, 2]):.3g} rad against each other, "
                f"{shares[worst, 1]:.3g} times the limit for their contacts"
            )
            return Used(float(shares[worst, 1]), reason, moved, APPROACH, (a, b))
        block = int(np.argmax(np.abs(attempt.increment[:, :2]).max(axis=1)))
        reason = (
            f"a vertex of {self._named(block)} moves {attempt.largest:.3g} m, the limit is {self.displacement:.3g} m"
        )
        return Used(float(of_all), reason, moved, DISPLACEMENT, (block,))

    def crossed(self, attempt: AttemptedStep, result: StepResult) -> Crossed | None:
        """Crossings of block outlines in a step at places without a contact; None for none."""
        if len(self._size) < 2:
            return None
        before, after = attempt.path(result.state.vertices)
        one, two = boxes(before, self._start[:-1]), boxes(after, self._start[:-1])
        box = np.concatenate([np.minimum(one[:, :2], two[:, :2]), np.maximum(one[:, 2:], two[:, 2:])], axis=1)
        pairs = self._finder.near_boxes(box)
        rows = result.contacts
        pressed = self._pressed(rows, len(before))
        paths, allow = (
            Paths(before, after, self._next, self._start),
            Allowed(pressed, self._size, self._finder.rounding),
        )
        pair, vertex, edge, kind, depth = crossings(paths, pairs, box, allow)
        if len(pair):
            real = self._finder.may_touch(vertex, edge)
            shallow = (kind == INTO) & (depth <= LITTLE * self._size[pairs[pair]].min(axis=1))
            if shallow.any():
                real &= ~(shallow & _glued(pairs[pair], rows[rows["bonded"] > 0]))
            pair, vertex, kind, depth = pair[real], vertex[real], kind[real], depth[real]
        if not len(pair):
            return None
        concerned = pairs[np.unique(pair)]
        affine, centroid = affine_motion(attempt.increment), np.ascontiguousarray(attempt.moments[:, 1:3])
        motion = self._finder.approach.shares(concerned, before, affine, attempt.increment[:, 2], centroid)[:, 0]
        worst = int(np.argmax(kind * depth.max() + depth))
        a, b = pairs[pair[worst]].tolist()
        if int(np.searchsorted(self._start, vertex[worst], side="right")) - 1 != a:
            a, b = b, a
        x, y = after[vertex[worst]]
        how = "goes through" if kind[worst] == THROUGH else f"goes {depth[worst]:.3g} m into"
        reason = f"a corner of {self._named(a)} {how} {self._named(b)} near x = {x:.6g}, y = {y:.6g} m"
        return Crossed(reason, concerned, _WIDER * motion, bool((kind == THROUGH).any()), (a, b))

    def _pressed(self, rows: np.ndarray, n_vertices: int) -> np.ndarray:
        """(n_vertices,) m: deepest penetration of CONTACT ``rows`` at each vertex, or at an edge that ends there.

        Nodes inside the faces of joints with a stiffness have no contacts: they get the deepest value of their block.
        """
        # Faces that must come nearer than the geometry shows to meet overlap by that amount.
        deep = np.maximum(0.0, -rows["lift"])
        deep = np.where(rows["state"] != OPEN, np.maximum(deep, -(rows["gap"] + rows["lift"])), deep)
        out = np.zeros(n_vertices)
        if self._finder.has_face_nodes:
            of_block = np.zeros(len(self._size))
            for name in ("block", "other"):
                np.maximum.at(of_block, rows[name], deep)
            out = np.repeat(of_block, np.diff(self._start))
        else:
            for vertices in (rows["vertex"], rows["edge"], self._next[rows["edge"]]):
                np.maximum.at(out, vertices, deep)
        if self._finder.at_corners:
            # Sides that bend deviate from the straight lines between their corners.
            sag, both = self._finder.sag, np.zeros(len(self._size))
            for one, two in ((rows["block"], rows["other"]), (rows["other"], rows["block"])):
                np.maximum.at(both, one, sag[one] + sag[two])
            out += np.repeat(both, np.diff(self._start))
        return out

    def pressed_apart(self, attempt: AttemptedStep, result: StepResult) -> Crossed | None:
        """Blocks pushed apart that had not penetrated each other; None for none.

        These are contacts that close in a step with a vertex that was behind their edge at its start, if that creates
        more than `LITTLE` of the present energy, and was not drawn so. A shorter step searches contacts within a
        shorter distance, and finds them where they first touch.
        """
        energy = result.energy
        if energy.overlap <= LITTLE * max(energy.stored, energy.before) or not len(attempt.state.contacts):
            return None
        if result.overlap is None:
            return None
        _, a, b, deep, x, y = result.overlap
        reason = (
            f"{self._named(a)} and {self._named(b)} overlap by {deep:.3g} m near x = {x:.6g}, y = {y:.6g} m where they "
            "first touch"
        )
        return Crossed(reason, np.zeros((0, 2), np.int64), np.zeros(0), False, (a, b))

    def warn_of_penetration(self, result: StepResult) -> None:
        """Log a warning, once for two blocks, where a corner penetrates beyond the middle of the block that it presses
        on: springs then no longer know from which side it came."""
        rows = result.contacts
        least = np.minimum(self._size[rows["block"]], self._size[rows["other"]])
        rows = rows[(rows["state"] != OPEN) & (-(rows["gap"] + rows["lift"]) > NOTABLE * least)]
        if not (len(rows) and self.warns):
            return
        vertices = np.ascontiguousarray(result.state.vertices)
        vertex, edge = (np.ascontiguousarray(rows[name]) for name in ("vertex", "edge"))
        for k in np.flatnonzero(self._finder.past_midpoint(vertices, vertex, edge)).tolist():
            pair = int(rows["block"][k]), int(rows["other"][k])
            if pair in self._warned_of:
                continue
            self._warned_of.add(pair)
            x, y = vertices[vertex[k]]
            log.warning(
                "t = %g s: a corner of %s penetrates %.3g m into %s near x = %.6g, y = %.6g m, beyond the middle of that "
                "block: contacts are too soft for this speed (dda.normal_penalty_pa)",
                result.state.time, self._named(pair[0]), -rows["gap"][k], self._named(pair[1]), x, y,
            )  # fmt: skip

    def shortens(self, why: str, *blocks: int) -> None:
        """Count a step shortened by one block or two; the 1st, 10th, 100th … is logged."""
        names = tuple(self._finder.names[b] for b in blocks[:2])
        one, two = (*names, "", "")[:2]
        key = why, one, two
        self._work.shortened[key] += 1
        count = self._work.shortened[key]
        if count > 1 and math.log10(count).is_integer():
            involved = " and ".join(map(repr, names)) or "no single block"
            log.info("%s: %s shortened a step for the %s time; %s", why, involved, _ordinal(count), WAY_OUT[why])

    def _named(self, block: int) -> str:
        return repr(self._finder.names[block])


def _glued(pairs: np.ndarray, bonded: np.ndarray) -> np.ndarray:
    """(k,) bool: the blocks of each of ``pairs`` (k, 2) are bonded to each other, or both to a third, by the CONTACT
    rows ``bonded``."""
    joined: dict[int, set[int]] = {}
    for a, b in zip(bonded["block"].tolist(), bonded["other"].tolist(), strict=True):
        joined.setdefault(a, {a}).add(b)
        joined.setdefault(b, {b}).add(a)
    nothing: set[int] = set()
    return np.array([bool(joined.get(a, nothing) & joined.get(b, nothing)) for a, b in pairs.tolist()], bool)


def shortened(work: Work, most: int = 5) -> tuple[Shortened, ...]:
    """The ``most`` frequent reasons for which steps were shortened, each with its blocks."""
    return tuple(
        Shortened(why, tuple(name for name in blocks if name), count, WAY_OUT[why])
        for (why, *blocks), count in work.shortened.most_common(most)
    )


def _ordinal(count: int) -> str:
    return {10: "tenth", 100: "hundredth", 1000: "thousandth"}.get(count, f"{count}th")
