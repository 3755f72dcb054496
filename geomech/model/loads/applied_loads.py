"""Loads as functions of time, named after the edges and blocks they act on."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..joints.bolt import Bolt
from ..numbers import refuse_point
from .ground import below_ground, lowest_over
from .history import History, refuse_no_history
from .prescribed_motion import BaseMotion, BlockMotion, PointMotion


def _refuse_columns(what: str, history: History, wanted: int = 2) -> None:
    refuse_no_history(what, history)
    columns = np.shape(history.values)[1]
    if columns != wanted:
        columns_wanted = "two columns, x and y" if wanted == 2 else "one column"
        raise ValueError(f"{what} needs a history of {columns_wanted}, got {columns}")


@dataclass(frozen=True, eq=False)
class LinearProfile:
    """A factor that runs linearly from ``factors[0]`` at ``start`` to ``factors[1]`` at ``end`` (reference coordinates,
    m), and on beyond them; across the line between them it is constant."""

    start: tuple[float, float]
    end: tuple[float, float]
    factors: tuple[float, float]

    def __post_init__(self) -> None:
        values = np.array([*self.start, *self.end, *self.factors], dtype=float)
        if not np.isfinite(values).all():
            raise ValueError(f"a linear profile is not finite: {self}")
        if self.start[0] == self.end[0] and self.start[1] == self.end[1]:
            raise ValueError(f"a linear profile needs two different points, got {self.start} twice")

    def at(self, points: np.ndarray) -> np.ndarray:
        """(...,) the factor at ``points`` (..., 2)."""
        start, along = np.asarray(self.start, dtype=float), np.subtract(self.end, self.start).astype(float)
        share = (points - start) @ along / (along @ along)
        return self.factors[0] + share * (self.factors[1] - self.factors[0])


@dataclass(frozen=True, eq=False)
class EdgeTraction:
    """A traction (N/m², x and y components, per unit of *reference* length) on every edge called ``edge_name``.

    It keeps its direction and, because it is counted per reference length, its total force as the block deforms. With
    ``follower`` it turns with the block instead, as the pressure of a fluid or a jack that stands on it. ``profile``
    multiplies it along the edges; any linear distribution is the sum of two such tractions.
    """

    edge_name: str
    history: History
    follower: bool = False
    profile: LinearProfile | None = None

    def __post_init__(self) -> None:
        _refuse_columns(f"the traction on edges named {self.edge_name!r}", self.history)


@dataclass(frozen=True, eq=False)
class PointLoad:
    """A force (N per metre of thickness) on ``block`` at the material point ``at`` (reference coordinates); with
    ``follower`` it turns with the block."""

    block: int
    at: tuple[float, float]
    history: History
    follower: bool = False

    def __post_init__(self) -> None:
        refuse_point(f"the point load on block {self.block}", self.at)
        _refuse_columns(f"the point load on block {self.block}", self.history)


@dataclass(frozen=True, eq=False)
class WaterTable:
    """Water that stands in all joints, cracks between blocks and on all outer faces below a line.

    ``points`` (n, 2) m, x ascending: the line, level beyond its ends; under it the pressure is ``unit_weight`` (N/m³)
    times the depth below it, above it there is none. ``level`` (m) raises the whole line with time. An inclined line is
    a piezometric one: the pressure on a joint under it is what that line says. The pressure acts on both faces of a
    joint, so that contact forces are effective ones and a submerged block is lifted by the weight of the water it
    displaces. ``dry`` names edges that no water reaches (lined or drained).

    Where the line stands above the rock, water is ponded there and presses on it. With ``ground`` (n, 2) m, the rock's
    surface from left to right, the table is never above it: it follows the ground in front of a slope, and nothing
    presses on the ground itself.

    Blocks carry their own (saturated) density; their stress is the total one.
    """

    points: np.ndarray
    unit_weight: float = 9810.0
    level: History | None = None
    dry: tuple[str, ...] = ()
    ground: np.ndarray | None = None

    def __post_init__(self) -> None:
        points = np.asarray(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 2 or not len(points) or not np.isfinite(points).all():
            raise ValueError(f"a water table needs finite points (n, 2), got an array of shape {points.shape}")
        if (np.diff(points[:, 0]) <= 0).any():
            at = int(np.argmax(np.diff(points[:, 0]) <= 0))
            raise ValueError(
                f"the points of a water table must ascend in x: {points[at + 1, 0]:g} m follows {points[at, 0]:g} m"
            )
        if not (np.isfinite(self.unit_weight) and self.unit_weight > 0):
            raise ValueError(f"the unit weight of water must be positive, got {self.unit_weight!r} N/m³")
        if self.level is not None:
            _refuse_columns("the level of a water table", self.level, 1)

    def line_at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """(x ascending, y) of the table's points at ``time``, m."""
        x, y = np.asarray(self.points, dtype=float).T
        line = x, y + (0.0 if self.level is None else float(self.level.at(time)[0]))
        return line if self.ground is None else below_ground(line, self._lowest)

    @cached_property
    def _lowest(self) -> tuple[np.ndarray, np.ndarray]:
        return lowest_over(np.asarray(self.ground, dtype=float))


@dataclass(frozen=True, eq=False)
class ViscousBoundary:
    """Edges called ``edge_name`` absorb the waves that reach them, as rock that goes on for ever would (dynamic steps
    only).

    ``incoming`` (2,) m/s: particle velocity, as a history, of a plane wave that enters through them, straight on.
    """

    edge_name: str
    incoming: History | None = None

    def __post_init__(self) -> None:
        if self.incoming is not None:
            _refuse_columns(f"the wave that enters through edges named {self.edge_name!r}", self.incoming)


@dataclass(frozen=True, eq=False)
class Excavation:
    """At ``time`` (s) ``blocks`` are taken out, and those whose reference centroid lies in ``polygon`` (n, 2).

    Their contacts vanish, loads and bolts on them go, and the run goes on. With ``drained`` no water presses any more
    on what lay against them.
    """

    time: float
    blocks: tuple[int, ...] = ()
    polygon: np.ndarray | None = None
    drained: bool = True

    def __post_init__(self) -> None:
        if not np.isfinite(self.time):
            raise ValueError(f"an excavation needs a time, got {self.time!r} s")
        if self.polygon is not None and (np.ndim(self.polygon) != 2 or len(self.polygon) < 3):
            raise ValueError("the polygon of an excavation needs at least three points (x, y)")
        if self.polygon is not None and not np.isfinite(np.asarray(self.polygon, dtype=float)).all():
            raise ValueError("the polygon of an excavation has a point that is not finite")
        if self.polygon is None and not self.blocks:
            raise ValueError(f"the excavation at {self.time:g} s names no blocks and has no polygon")


@dataclass(frozen=True, eq=False)
class Loads:
    """Everything that acts on the blocks. ``gravity`` (2,) m/s² as a history; the scene's ramp is part of it."""

    gravity: History = field(default_factory=lambda: History.constant([0.0, 0.0]))
    edge_tractions: tuple[EdgeTraction, ...] = ()
    point_loads: tuple[PointLoad, ...] = ()
    water: WaterTable | None = None
    viscous_boundaries: tuple[ViscousBoundary, ...] = ()
    base: BaseMotion | None = None
    block_motions: tuple[BlockMotion, ...] = ()
    point_motions: tuple[PointMotion, ...] = ()
    bolts: tuple[Bolt, ...] = ()
    excavations: tuple[Excavation, ...] = ()

    def __post_init__(self) -> None:
        _refuse_columns("gravity", self.gravity)
