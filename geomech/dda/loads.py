"""What acts on the blocks besides contacts: gravity, edge tractions, point loads, inertia."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..model import Blocks, Loads
from .basis import material_weights

#: One row a point load: where it acts (current coordinates, m) and its force (N).
POINT_FORCE = np.dtype([("block", np.int64), ("point", np.float64, 2), ("force", np.float64, 2)])

#: One row a loaded edge: its ends (current coordinates, m), uniform traction per current length (Pa), total force (N).
EDGE_FORCE = np.dtype(
    [
        ("block", np.int64),
        ("edge", np.int64),
        ("start", np.float64, 2),
        ("end", np.float64, 2),
        ("traction", np.float64, 2),
        ("force", np.float64, 2),
    ]
)


@dataclass(frozen=True, eq=False)
class Inertia:
    """What makes weight and inertia a body force: ``density`` (n_blocks,), ``gravity`` (2,), ``acceleration`` (n_blocks, 6)
    of the unknowns, ``spin`` (n_blocks,) the angular velocity ω of the centrifugal ρω²x, ``fixed`` (n_blocks,)."""

    density: np.ndarray
    gravity: np.ndarray
    acceleration: np.ndarray
    spin: np.ndarray
    fixed: np.ndarray

    def body_forces(self) -> tuple[np.ndarray, np.ndarray]:
        """Weight minus inertia as a linear field: (n_blocks, 2) at the centroid and its gradient (n_blocks, 2, 2), N/m³,
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
    """All that acts on the blocks of one step besides contacts, on the geometry on which equilibrium was assembled.

    points                POINT_FORCE rows
    edges                 EDGE_FORCE rows; the force acts through the edge's middle
    centroid              (n_blocks, 2)     m
    area                  (n_blocks,)       m²
    body_force            (n_blocks, 2)     ρ(g − a) at the centroid, N/m³
    body_force_gradient   (n_blocks, 2, 2)  ∂b/∂x: the rest of −ρ times the block's acceleration field, centrifugal
                                            part included; b(x) = body_force + body_force_gradient (x − centroid)
    """

    points: np.ndarray
    edges: np.ndarray
    centroid: np.ndarray
    area: np.ndarray
    inertia: Inertia

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
    """Where the loads act on given blocks: edges by name, material points as weights of their block's vertices."""

    def __init__(self, blocks: Blocks) -> None:
        self.blocks = blocks
        self._edges: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self._points: dict[tuple[int, tuple[float, float]], np.ndarray] = {}

    def edges(self, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Edges called ``name``, their reference lengths, and EDGE_FORCE rows for them that know no more than block and
        edge. Raises ValueError when there are none."""
        if name not in self._edges:
            edges = self.blocks.edges_named(name)
            if len(edges) == 0:
                known = ", ".join(repr(n) for n in self.blocks.edge_names if n) or "none"
                raise ValueError(f"a traction acts on edges named {name!r}, but no edge has that name (names: {known})")
            along = self.blocks.vertices[self.blocks.next_vertex[edges]] - self.blocks.vertices[edges]
            rows = np.zeros(len(edges), EDGE_FORCE)
            rows["block"], rows["edge"] = self.blocks.vertex_block[edges], edges
            self._edges[name] = edges, np.hypot(along[:, 0], along[:, 1]), rows
        return self._edges[name]

    def point(self, block: int, at: tuple[float, float], vertices: np.ndarray) -> np.ndarray:
        """(2,) where the material point ``at`` (reference coordinates) of ``block`` is now."""
        first, last = self.blocks.vertex_start[block], self.blocks.vertex_start[block + 1]
        key = (block, tuple(at))
        if key not in self._points:
            self._points[key] = material_weights(self.blocks.vertices[first:last], np.asarray(at, dtype=float))
        return self._points[key] @ vertices[first:last]

    def rows(self, loads: Loads, time: float, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """POINT_FORCE and EDGE_FORCE rows of ``loads`` at ``time`` on the current ``vertices``."""
        points = np.zeros(len(loads.point_loads), POINT_FORCE)
        for row, load in zip(points, loads.point_loads, strict=True):
            row["block"], row["force"] = load.block, load.history.at(time)
            row["point"] = self.point(load.block, load.at, vertices)
        pieces = []
        for load in loads.edge_tractions:
            edges, length, rows = self.edges(load.edge_name)
            piece = rows.copy()
            piece["start"], piece["end"] = vertices[edges], vertices[self.blocks.next_vertex[edges]]
            piece["force"] = length[:, None] * load.history.at(time)
            along = piece["end"] - piece["start"]
            piece["traction"] = piece["force"] / np.hypot(along[:, 0], along[:, 1])[:, None]
            pieces.append(piece)
        return points, np.concatenate(pieces) if pieces else np.empty(0, EDGE_FORCE)


def generalised(points: np.ndarray, edges: np.ndarray, centroid: np.ndarray) -> np.ndarray:
    """(n_blocks, 6) Σ Tᵀ F of POINT_FORCE and EDGE_FORCE rows; N and N m."""
    out = np.zeros((len(centroid), 6))
    for block, at, force in (
        (points["block"], points["point"], points["force"]),
        (edges["block"], 0.5 * (edges["start"] + edges["end"]), edges["force"]),
    ):
        if len(block):
            x, y = (at - centroid[block]).T
            fx, fy = force.T
            np.add.at(out, block, np.stack([fx, fy, x * fy - y * fx, x * fx, y * fy, 0.5 * (y * fx + x * fy)], axis=1))
    return out
