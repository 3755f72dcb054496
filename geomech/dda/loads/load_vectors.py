"""Load vectors: generalised forces ∫ Tᵀ t ds + Σ Tᵀ F of tractions and point loads, and body forces ρ (g − a)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ...model import Blocks, EdgeTraction, LinearProfile, Loads, WaterTable
from ..kinematics.displacement_matrix import material_weights
from .force_records import EDGE_FORCE, POINT_FORCE, BondTractions
from .water_pressure import pressed_edges, wet_pieces


@dataclass(frozen=True, eq=False)
class Inertia:
    """Weight and inertia as a body force.

    density       (n_blocks,)    kg/m³
    gravity       (2,)           m/s²
    acceleration  (n_blocks, 6)  of the unknowns
    spin          (n_blocks,)    angular velocity ω of the centrifugal force ρω²x, rad/s
    fixed         (n_blocks,)    bool
    """

    density: np.ndarray
    gravity: np.ndarray
    acceleration: np.ndarray
    spin: np.ndarray
    fixed: np.ndarray

    def body_forces(self) -> tuple[np.ndarray, np.ndarray]:
        """Weight minus inertia as a linear field: (n_blocks, 2) at the centroid, N/m³; gradient (n_blocks, 2, 2),
        N/m⁴."""
        rho, a = self.density, np.where(self.fixed[:, None], 0.0, self.acceleration)
        gradient = np.empty((len(rho), 2, 2))
        centrifugal = np.where(self.fixed, 0.0, self.spin) ** 2
        gradient[:, 0, 0] = rho * (centrifugal - a[:, 3])
        gradient[:, 1, 1] = rho * (centrifugal - a[:, 4])
        gradient[:, 0, 1] = rho * (a[:, 2] - 0.5 * a[:, 5])
        gradient[:, 1, 0] = -rho * (a[:, 2] + 0.5 * a[:, 5])
        return rho[:, None] * (self.gravity - a[:, :2]), gradient


@dataclass(frozen=True, eq=False)
class AppliedForces:
    """All forces on the blocks in one step except contact forces, on the geometry of the equilibrium equations.

    points                POINT_FORCE rows
    edges                 EDGE_FORCE rows
    centroid              (n_blocks, 2)     m
    area                  (n_blocks,)       m²
    body_force            (n_blocks, 2)     ρ(g − a) at the centroid, N/m³
    body_force_gradient   (n_blocks, 2, 2)  ∂b/∂x of inertia, centrifugal force included:
                                            b(x) = body_force + body_force_gradient (x − centroid)
    reaction              (n_blocks, 6)     N, N m about the centroid: generalised forces that impose prescribed
                                            motion on moving blocks; None: none is prescribed
    overstress            (n_blocks, 3)     Pa, current axes: stress that the forces balance minus the stress at the end
                                            of the step (`TimeScheme.overstress`); None at rest
    bonds                 tractions between glued cells; None without any
    """

    points: np.ndarray
    edges: np.ndarray
    centroid: np.ndarray
    area: np.ndarray
    inertia: Inertia
    reaction: np.ndarray | None = None
    overstress: np.ndarray | None = None
    bonds: BondTractions | None = None

    @cached_property
    def _body_forces(self) -> tuple[np.ndarray, np.ndarray]:
        return self.inertia.body_forces()

    @property
    def body_force(self) -> np.ndarray:
        return self._body_forces[0]

    @property
    def body_force_gradient(self) -> np.ndarray:
        return self._body_forces[1]


class LoadMap:
    """Positions of loads on given blocks: edges by name, material points as weights of their block's vertices."""

    def __init__(self, blocks: Blocks) -> None:
        self.blocks = blocks
        self._edges: dict[tuple[str, LinearProfile | None], tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self._points: dict[tuple[int, tuple[float, float]], np.ndarray] = {}
        self._wet: tuple[WaterTable, tuple[np.ndarray, np.ndarray]] | None = None
        self._removed: np.ndarray | None = None
        self._drained: np.ndarray | None = None

    def take_out(self, removed: np.ndarray | None, drained: np.ndarray | None) -> None:
        """Remove the loads on the blocks ``removed`` (n_blocks,) bool, and water from faces that lay against
        ``drained`` (n_blocks,) ones."""
        self._removed, self._drained, self._wet = removed, drained, None

    def edges(self, load: EdgeTraction) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Edges (n,) that ``load`` acts on, reference length times profile at their two ends (n, 2), m, and EDGE_FORCE
        rows that have block and edge only. Raises ValueError when no edge has the load's name."""
        name, key = load.edge_name, (load.edge_name, load.profile)
        if key not in self._edges:
            edges = self.blocks.edges_that_exist(name, f"a traction acts on edges named {name!r}")
            ends = np.stack([self.blocks.vertices[edges], self.blocks.vertices[self.blocks.next_vertex[edges]]], axis=1)
            along = ends[:, 1] - ends[:, 0]
            factor = np.ones((len(edges), 2)) if load.profile is None else load.profile.at(ends)
            rows = np.zeros(len(edges), EDGE_FORCE)
            rows["block"], rows["edge"] = self.blocks.vertex_block[edges], edges
            self._edges[key] = edges, np.hypot(along[:, 0], along[:, 1])[:, None] * factor, rows
        return self._edges[key]

    def point(self, block: int, at: tuple[float, float], vertices: np.ndarray) -> np.ndarray:
        """(2,) current position of the material point ``at`` (reference coordinates) of ``block``, m."""
        first, last = self.blocks.vertex_start[block], self.blocks.vertex_start[block + 1]
        key = (block, (at[0], at[1]))
        if key not in self._points:
            self._points[key] = material_weights(self.blocks.vertices[first:last], np.asarray(at, dtype=float))
        return self._points[key] @ vertices[first:last]

    def rows(
        self, loads: Loads, time: float, vertices: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """POINT_FORCE and EDGE_FORCE rows of ``loads`` at ``time`` s.

        ``vertices`` (n_vertices, 2) current coordinates, m; ``rotation`` (n_blocks,) of the blocks, rad."""
        points = np.zeros(len(loads.point_loads), POINT_FORCE)
        for row, load in zip(points, loads.point_loads, strict=True):
            force = load.history.at(time)
            row["block"], row["at"] = load.block, load.at
            row["force"] = _turned(force, rotation[load.block]) if load.follower else force
            row["point"] = self.point(load.block, load.at, vertices)
        pieces = []
        for traction in loads.edge_tractions:
            on, length, rows = self.edges(traction)
            piece = rows.copy()
            piece["start"], piece["end"] = vertices[on], vertices[self.blocks.next_vertex[on]]
            value = traction.history.at(time)
            value = _turned(value, rotation[piece["block"]]) if traction.follower else value[None]
            total = length[:, :, None] * value[:, None, :]
            along = piece["end"] - piece["start"]
            piece["traction"] = total / np.hypot(along[:, 0], along[:, 1])[:, None, None]
            piece["force"] = 0.5 * (total[:, 0] + total[:, 1])
            pieces.append(piece)
        if loads.water is not None:
            wet = self._wet_edges(loads.water)
            pieces.append(
                pressed_edges(loads.water, time, wet, self.blocks.vertex_block, vertices, self.blocks.next_vertex)
            )
        edges = np.concatenate(pieces) if pieces else np.empty(0, EDGE_FORCE)
        if self._removed is not None:
            points, edges = points[~self._removed[points["block"]]], edges[~self._removed[edges["block"]]]
        return points, edges

    def _wet_edges(self, water: WaterTable) -> tuple[np.ndarray, np.ndarray]:
        """Pieces of edges of moving blocks that water can reach."""
        if self._wet is None or self._wet[0] is not water:
            known = self.blocks.edge_names
            for name in water.dry:
                if name not in known:
                    raise ValueError(f"the water table leaves edges named {name!r} dry, but no edge has that name")
            dry = np.isin(self.blocks.edge_name, [known.index(name) for name in water.dry])
            out = self.blocks.fixed if self._removed is None else self.blocks.fixed | self._removed
            edges = np.flatnonzero(~dry & ~out[self.blocks.vertex_block])
            self._wet = water, wet_pieces(self.blocks, edges, self._drained, water.ground)
        return self._wet[1]


def _turned(vector: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(..., 2) ``vector`` (2,) rotated by ``angle`` (...) rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]], axis=-1)


def generalised(points: np.ndarray, edges: np.ndarray, centroid: np.ndarray) -> np.ndarray:
    """(n_blocks, 6) generalised forces ∫ Tᵀ t ds + Σ Tᵀ F of EDGE_FORCE and POINT_FORCE rows about ``centroid``
    (n_blocks, 2); N and N m."""
    out = np.zeros((len(centroid), 6))
    if len(points) or len(edges):
        # Contiguous, as fields of records are not: one compilation does for all.
        fields = [points[name] for name in ("block", "point", "force")]
        fields += [edges[name] for name in ("block", "start", "end", "traction")]
        _gather(out, centroid, *(np.ascontiguousarray(field) for field in fields))
    return out


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _add(row, x, y, fx, fy):
    row[0] += fx
    row[1] += fy
    row[2] += x * fy - y * fx
    row[3] += x * fx
    row[4] += y * fy
    row[5] += 0.5 * (y * fx + x * fy)


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _gather(out, centroid, point_block, point, force, edge_block, start, end, traction):
    """Add generalised forces about ``centroid`` (n_blocks, 2) of point forces and linear tractions to ``out``
    (n_blocks, 6).

    A linear traction has the ∫ t and ∫ x ⊗ t of the forces L (2t₀ + t₁)/6 and L (t₀ + 2t₁)/6 at its ends."""
    for i in range(len(point_block)):
        b = point_block[i]
        _add(out[b], point[i, 0] - centroid[b, 0], point[i, 1] - centroid[b, 1], force[i, 0], force[i, 1])
    for i in range(len(edge_block)):
        b = edge_block[i]
        dx, dy = end[i, 0] - start[i, 0], end[i, 1] - start[i, 1]
        sixth = np.sqrt(dx * dx + dy * dy) / 6.0
        for side in range(2):
            fx = sixth * (traction[i, side, 0] * 2.0 + traction[i, 1 - side, 0])
            fy = sixth * (traction[i, side, 1] * 2.0 + traction[i, 1 - side, 1])
            at = start if side == 0 else end
            _add(out[b], at[i, 0] - centroid[b, 0], at[i, 1] - centroid[b, 1], fx, fy)
