"""Prescribed motion of blocks, of material points, and of the base."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..numbers import refuse_point
from .history import History, refuse_no_history

#: The six unknowns of a block, in order.
UNKNOWNS = ("u0", "v0", "r0", "ex", "ey", "gxy")

#: Kinds of histories: the displacement itself, or its rate.
Kind = Literal["displacement", "velocity"]


def _known_kind(kind: str, what: str) -> None:
    if kind not in ("displacement", "velocity"):
        raise ValueError(f'{what} is given as "displacement" or "velocity", not {kind!r}')


class _Prescribed:
    """Values that follow a ``history``: the values themselves, or their rates if ``kind`` is "velocity"."""

    history: History
    kind: Kind

    def total(self, time: float) -> np.ndarray:
        """(k,) prescribed values at ``time`` s."""
        return self.history.at(time) if self.kind == "displacement" else self.history.integral(time)

    def rate(self, start: float, end: float) -> np.ndarray:
        """(k,) prescribed rates at ``end`` s; of a displacement history, their mean from ``start`` to ``end``."""
        h = self.history
        if self.kind == "velocity":
            return h.at(end)
        return (h.at(end) - h.at(start)) / (end - start) if end > start else np.zeros_like(h.values[0])


@dataclass(frozen=True, eq=False)
class BlockMotion(_Prescribed):
    """Prescribed motion of some unknowns of ``block``: u0, v0 (m) of its centroid, r0 (rad), strains ex, ey, gxy.

    ``history`` has a column for each of ``unknowns``: their values since time 0, or their rates. The other unknowns of
    a moving block follow the equations of motion, those of a fixed block stay zero. The motion is imposed exactly.
    """

    block: int
    history: History
    unknowns: tuple[str, ...] = ("u0", "v0", "r0")
    kind: Kind = "displacement"

    def __post_init__(self) -> None:
        _known_kind(self.kind, "the motion of a block")
        refuse_no_history(f"the motion of block {self.block}", self.history)
        if not self.unknowns or len(set(self.unknowns)) < len(self.unknowns) or set(self.unknowns) - set(UNKNOWNS):
            raise ValueError(
                f"the imposed unknowns must be different ones of {', '.join(UNKNOWNS)}, got {self.unknowns}"
            )
        if np.shape(self.history.values)[1] != len(self.unknowns):
            raise ValueError(
                f"{len(self.unknowns)} unknowns of block {self.block} are imposed, but its history has "
                f"{np.shape(self.history.values)[1]} columns"
            )


@dataclass(frozen=True, eq=False)
class PointMotion(_Prescribed):
    """Prescribed motion of the material point ``at`` (reference coordinates, m) of ``block``.

    ``history``: its displacement since time 0 (m), or its velocity (m/s): two columns, x and y, or one along
    ``direction``; across that the point is free. Imposed exactly, or by a spring of ``stiffness`` (N/m per metre of
    thickness).
    """

    block: int
    at: tuple[float, float]
    history: History
    direction: tuple[float, float] | None = None
    kind: Kind = "displacement"
    stiffness: float | None = None

    def __post_init__(self) -> None:
        _known_kind(self.kind, "the motion of a point")
        refuse_point(f"the motion of a point of block {self.block}", self.at)
        refuse_no_history(f"the motion of a point of block {self.block}", self.history)
        columns = np.shape(self.history.values)[1]
        if columns != (2 if self.direction is None else 1):
            wanted = "two columns, x and y" if self.direction is None else "one column, along its direction"
            raise ValueError(f"the motion of a point of block {self.block} needs {wanted}, its history has {columns}")
        if self.direction is not None and not 0 < math.hypot(*self.direction) < math.inf:
            raise ValueError(f"the motion of a point of block {self.block} has no direction: {self.direction}")
        if self.stiffness is not None and not (math.isfinite(self.stiffness) and self.stiffness > 0):
            raise ValueError(f"the stiffness of a prescribed point motion must be positive, got {self.stiffness!r} N/m")

    @property
    def axes(self) -> np.ndarray:
        """(k, 2) unit vectors along which the motion is prescribed."""
        if self.direction is None:
            return np.eye(2)
        return np.array([self.direction], dtype=float) / math.hypot(*self.direction)


@dataclass(frozen=True, eq=False)
class BaseMotion:
    """Base shaking by the ground's ``acceleration``: history of x and y components, m/s².

    ``frame`` "ground": the fixed blocks (all, or those in ``blocks``) follow the record from rest at time 0, in the
    frame of the ground at rest. "base": in the frame of the moving base, the fixed blocks rest and the body force −ρ a
    acts on every block; over a step it is the record's mean, so that velocities are exact. Both describe the same
    motion when all fixed blocks shake together.
    """

    acceleration: History
    frame: Literal["ground", "base"] = "ground"
    blocks: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        if self.frame not in ("ground", "base"):
            raise ValueError(f'the frame of a base motion must be "ground" or "base", got {self.frame!r}')
        refuse_no_history("the acceleration of the base", self.acceleration)
        if np.shape(self.acceleration.values)[1] != 2:
            raise ValueError("the acceleration of the base needs two columns, x and y")
        if self.frame == "base" and self.blocks is not None:
            raise ValueError('in the frame "base" all fixed blocks move together: name no blocks')

    def total(self, time: float) -> np.ndarray:
        """(2,) displacement of the base at ``time`` s, m."""
        return self.acceleration.double_integral(time)
