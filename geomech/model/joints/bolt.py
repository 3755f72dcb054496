"""Bolts and anchors between two material points of blocks, and their history variables."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blocks.block_arrays import Blocks
from ..blocks.polygon import winding_number
from ..numbers import POSITIVE, Number, as_text, refuse_numbers, refuse_point

#: Block number of an anchor's far end that is fixed in the ground.
GROUND = -1

#: History variables of bolts, one row per bolt.
BOLT = np.dtype(
    [
        ("installed", np.bool_),
        ("broken", np.bool_),
        ("length", np.float64),  # at installation, m
        ("plastic", np.float64),  # elongation by yielding, m
        ("slid", np.float64),  # plastic displacement of the dowel, m
        ("force", np.float64),  # N/m, positive in tension
        ("shear_force", np.float64),  # N/m of the dowel, on the second block along the bolt's axis turned by +90°
    ]
)


@dataclass(frozen=True)
class Bolt:
    """A bolt between the material points ``start`` of ``block`` and ``end`` of ``other`` (GROUND, −1: a point at rest).

    stiffness        EA/L, N/m per metre of thickness (a row of bolts at spacing s: EA/(L s))
    pretension       N/m, force at ``installation`` (s); before, the bolt does not act
    yield_force      N/m; beyond, it yields (perfectly plastic) and keeps the plastic elongation
    breaking_strain  elongation over length at which it breaks
    shear_stiffness  N/m, dowel action: resistance across its axis, up to ``shear_strength`` N/m (perfectly plastic)
    compression      True: it carries compression to −yield_force (a grouted bar); False: it goes slack

    Raises ValueError that names the bolt for a stiffness or strength that is not positive, a pretension beyond the
    yield force, and coincident ends.
    """

    block: int
    start: tuple[float, float]
    other: int
    end: tuple[float, float]
    stiffness: float
    pretension: float = 0.0
    yield_force: float = math.inf
    breaking_strain: float = math.inf
    shear_stiffness: float = 0.0
    shear_strength: float = math.inf
    installation: float = 0.0
    compression: bool = False
    name: str = "bolt"

    def __post_init__(self) -> None:
        subject = f"bolt {self.name!r}"
        refuse_numbers(self, _NUMBERS, subject)
        refuse_point(f"{subject}: its start", self.start)
        refuse_point(f"{subject}: its end", self.end)
        if self.pretension > self.yield_force:
            raise ValueError(
                f"bolt {self.name!r}: its pretension, {self.pretension:g} N/m, exceeds its yield force, "
                f"{self.yield_force:g} N/m"
            )
        if not math.dist(self.start, self.end) > 0:
            raise ValueError(
                f"bolt {self.name!r}: both ends are at the same point, ({self.start[0]:g}, {self.start[1]:g})"
            )
        if self.block == self.other:
            raise ValueError(f"bolt {self.name!r}: both ends are in the same block, where it has no effect")


#: Admissible numbers of `Bolt`.
_NUMBERS = {
    "stiffness": Number(closed=False, unit="N/m"),
    "yield_force": Number(closed=False, unit="N/m", infinite=True),
    "breaking_strain": Number(closed=False, infinite=True),
    "shear_strength": Number(closed=False, unit="N/m", infinite=True),
    "pretension": Number(unit="N/m"),
    "shear_stiffness": Number(unit="N/m"),
    "installation": Number(unit="s"),
}


class CrossesNoJoint(ValueError):
    """A grouted bar lies in one block, crosses no joint, and has no effect."""


def grouted_bolt(
    blocks: Blocks,
    start: tuple[float, float],
    end: tuple[float, float],
    *,
    axial_stiffness: float,
    active_length: float,
    name: str = "bolt",
    **properties: float | bool,
) -> tuple[Bolt, ...]:
    """A fully grouted bar from ``start`` to ``end`` (m) as short bolts, one at each joint that it crosses.

    A bar grouted all along is strained where joints open or slide, over a short *active length* (a few diameters to
    half a metre; local reinforcement, Lorig 1985). Each crossing becomes a `Bolt` of stiffness ``axial_stiffness`` (EA,
    N per metre of thickness) over ``active_length`` (m), its ends half that length inside the two blocks (less in a
    thinner block). Faces of cells that cannot part are no joints. ``properties`` as for `Bolt`; ``compression`` is True by default.

    Raises CrossesNoJoint where the bar crosses no joint, and ValueError that names the bar for a stiffness or length
    that is not positive.
    """
    for what, value, unit in (("axial_stiffness", axial_stiffness, "N"), ("active_length", active_length, "m")):
        if not POSITIVE.holds(value):
            raise ValueError(f"bolt {name!r}: {what} must be positive and finite, got {as_text(value)} {unit}")
    refuse_point(f"bolt {name!r}: its start", start)
    refuse_point(f"bolt {name!r}: its end", end)
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(np.hypot(*(b - a)))
    pieces = _pieces(blocks, a, b)
    along = (b - a) / length
    bolts: list[Bolt] = []
    whole = _inseparable(blocks)
    options: dict[str, Any] = {"compression": True, **properties}
    for (one, s0, s1), (two, s2, s3) in itertools.pairwise(pieces):
        if (min(one, two), max(one, two)) in whole:
            continue
        before, after = min(active_length / 2, s1 - s0), min(active_length / 2, s3 - s2)
        points = (a + (s1 - before) * along).tolist(), (a + (s2 + after) * along).tolist()
        bolts.append(
            Bolt(
                one,
                tuple(points[0]),
                two,
                tuple(points[1]),
                stiffness=axial_stiffness / (before + after),
                name=f"{name}/{len(bolts) + 1}",
                **options,
            )
        )
    if not bolts:
        raise CrossesNoJoint(f"bolt {name!r} crosses no joint on its way from {tuple(start)} to {tuple(end)}")
    return tuple(bolts)


def _inseparable(blocks: Blocks) -> set[tuple[int, int]]:
    """Pairs of cells of one rock whose common faces cannot part: those without a joint's name."""
    if blocks.glued is None:
        return set()
    edges = np.asarray(blocks.glued, np.int64).reshape(-1, 2)
    edges = edges[(blocks.edge_name[edges] == 0).any(axis=1)]
    return {(a, b) for a, b in np.sort(blocks.vertex_block[edges], axis=1).tolist()}


def _pieces(blocks: Blocks, a: np.ndarray, b: np.ndarray) -> list[tuple[int, float, float]]:
    """Blocks along the line from ``a`` to ``b``, in order, each with the distances from ``a`` where the line enters
    and leaves it, m."""
    along = b - a
    length = float(np.hypot(*along))
    p, q = blocks.vertices, blocks.vertices[blocks.next_vertex]
    edge = q - p
    turn = along[0] * edge[:, 1] - along[1] * edge[:, 0]
    crossing = np.abs(turn) > 1e-12 * length * np.hypot(edge[:, 0], edge[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        s = ((p - a)[:, 0] * edge[:, 1] - (p - a)[:, 1] * edge[:, 0]) / turn
        r = ((p - a)[:, 0] * along[1] - (p - a)[:, 1] * along[0]) / turn
    hit = crossing & (s > 0) & (s < 1) & (r >= 0) & (r <= 1)
    marks = np.unique(np.concatenate([[0.0, 1.0], s[hit]]))
    marks = marks[np.append(True, np.diff(marks) > 1e-9)]
    pieces: list[tuple[int, float, float]] = []
    for s0, s1 in zip(marks[:-1].tolist(), marks[1:].tolist()):
        midpoint = a + 0.5 * (s0 + s1) * along
        for block in _near(blocks, midpoint):
            if abs(winding_number(blocks.loops(block), midpoint)) > 0.5:
                if pieces and pieces[-1][0] == block:
                    pieces[-1] = (block, pieces[-1][1], s1 * length)
                else:
                    pieces.append((block, s0 * length, s1 * length))
                break
    return pieces


def _near(blocks: Blocks, point: np.ndarray) -> Sequence[int]:
    """Blocks whose bounding box contains ``point``."""
    first = blocks.vertex_start[:-1]
    low, high = np.minimum.reduceat(blocks.vertices, first), np.maximum.reduceat(blocks.vertices, first)
    return np.flatnonzero(((low <= point) & (point <= high)).all(axis=1)).tolist()
