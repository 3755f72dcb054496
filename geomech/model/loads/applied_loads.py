"""Applied loads as functions of time: tractions on edges, point loads, water, viscous boundaries, excavations."""

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
    """A factor that varies linearly along the line from ``start`` to ``end`` (reference coordinates, m) and beyond.

    It is ``factors[0]`` at ``start``, ``factors[1]`` at ``end``, and constant across the line."""

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
        """(...,) the factor at ``points`` (..., 2), m."""
        start, along = np.asarray(self.start, dtype=float), np.subtract(self.end, self.start).astype(float)
        share = (points - start) @ along / (along @ along)
        return self.factors[0] + share * (self.factors[1] - self.factors[0])


@dataclass(frozen=True, eq=False)
class EdgeTraction:
    """A traction on every edge called ``edge_name``: x and y components, Pa, per unit of *reference* length.

    Its direction is fixed; its total force does not change as the block deforms. With ``follower`` it rotates with the
    block, as a jack does. ``profile`` multiplies it along the edges; any linear distribution is the sum of two such
    tractions.
    """

    edge_name: str
    history: History
    follower: bool = False
    profile: LinearProfile | None = None

    def __post_init__(self) -> None:
        _refuse_columns(f"the traction on edges named {self.edge_name!r}", self.history)


@dataclass(frozen=True, eq=False)
class PointLoad:
    """A force on ``block`` at the material point ``at`` (reference coordinates, m), N per metre of thickness.

    With ``follower`` it rotates with the block."""

    block: int
    at: tuple[float, float]
    history: History
    follower: bool = False

    def __post_init__(self) -> None:
        refuse_point(f"the point load on block {self.block}", self.at)
        _refuse_columns(f"the point load on block {self.block}", self.history)


@dataclass(frozen=True, eq=False)
class WaterTable:
    """A water table: pressure in joints and on outer faces of blocks below a line, p = γw · depth.

    points       (n, 2) m, x ascending: the piezometric line, level beyond its ends
    unit_weight  γw, N/m³
    level        history of the rise of the whole line, m
    dry          names of edges that no water reaches (lined or drained)
    ground       (n, 2) m, the rock's surface from left to right: the table does not rise above it. None: water above
                 the ground is ponded and presses on it
    share        history of the share of γw that acts: where gravity grows, water becomes heavier with it. None: 1

    The pressure acts on both faces of a joint: contact forces are effective forces, and a submerged block is buoyant.
    Blocks have their saturated density; their stress is the total stress.
    """

    points: np.ndarray
    unit_weight: float = 9810.0
    level: History | None = None
    dry: tuple[str, ...] = ()
    ground: np.ndarray | None = None
    share: History | None = None

    def __post_init__(self) -> None:
        points = np.asarray(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 2 or not len(points) or not np.isfinite(points).all():
            raise ValueError(f"a water table needs finite points (n, 2), got an array of shape {points.shape}")
        if (np.diff(points[:, 0]) <= 0).any():
            at = int(np.argmax(np.diff(points[:, 0]) <= 0))
            raise ValueError(
                f"the x of the points of a water table must increase: {points[at + 1, 0]:g} m follows {points[at, 0]:g} m"
            )
        if not (np.isfinite(self.unit_weight) and self.unit_weight > 0):
            raise ValueError(f"the unit weight of water must be positive, got {self.unit_weight!r} N/m³")
        if self.level is not None:
            _refuse_columns("the level of a water table", self.level, 1)
        if self.share is not None:
            _refuse_columns("the share of the weight of water", self.share, 1)

    def unit_weight_at(self, time: float) -> float:
        """N/m³: the part of γw that acts at ``time`` s."""
        return self.unit_weight * (1.0 if self.share is None else float(self.share.at(time)[0]))

    def line_at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Points (x ascending, y) of the table at ``time`` s, m."""
        x, y = np.asarray(self.points, dtype=float).T
        line = x, y + (0.0 if self.level is None else float(self.level.at(time)[0]))
        return line if self.ground is None else below_ground(line, self._lowest)

    def pressure_at(self, points: np.ndarray, time: float) -> np.ndarray:
        """(n,) Pa: pressure of the water at ``points`` (n, 2) m at ``time`` s; 0 above the table."""
        return self.unit_weight_at(time) * np.maximum(np.interp(points[:, 0], *self.line_at(time)) - points[:, 1], 0.0)

    @cached_property
    def _lowest(self) -> tuple[np.ndarray, np.ndarray]:
        return lowest_over(np.asarray(self.ground, dtype=float))


@dataclass(frozen=True, eq=False)
class ViscousBoundary:
    """Edges called ``edge_name`` that absorb waves as unbounded rock would, in dynamic steps.

    ``incoming``: history (2,) of the particle velocity of a plane wave that enters at normal incidence, m/s.
    """

    edge_name: str
    incoming: History | None = None

    def __post_init__(self) -> None:
        if self.incoming is not None:
            _refuse_columns(f"the wave that enters through edges named {self.edge_name!r}", self.incoming)


@dataclass(frozen=True, eq=False)
class Excavation:
    """Excavation of ``blocks``, and of those whose reference centroid lies in ``polygon`` (n, 2) m, at ``time`` s.

    Their contacts, loads and bolts are removed. With ``drained`` no water presses on the faces that lay against them.
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
    """All loads on the blocks. ``gravity``: history (2,) of its acceleration, m/s², the scene's ramp included."""

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
