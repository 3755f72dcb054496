"""Viscous boundaries on blocks of higher order: dashpots at Gauss points of their edges, on all unknowns.

The dashpots of `viscous_boundary`, t = D (2 w − v) with v = (T Δd + R P Δq)/dt, are integrated along an edge with p + 1
points, exactly: C = Σ ℓ wᵢ Bᵢᵀ D Bᵢ / dt, with the rows Bᵢ of the displacement at the points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..higher_order.deflected_blocks import DeflectedBlocks
from ..kinematics.midpoint_configuration import MidpointConfiguration
from ..kinematics.polygon_quadrature import gauss_points
from .force_records import POINT_FORCE
from .viscous_boundary import ViscousEdges


@dataclass(frozen=True, eq=False)
class BendingDashpots:
    """Dashpots at points (n,) of edges of blocks of higher order.

    block     (n,)
    at        (n, 2)     undeformed, m
    point     (n, 2)     where they act, m
    rows      (n, 2, w)  displacement per unit of the solver's unknowns of the block, of deflection from the seventh on
    drag      (n, 2, 2)  Pa s, times the length of the point
    incoming  (n, 2)     m/s
    """

    block: np.ndarray
    at: np.ndarray
    point: np.ndarray
    rows: np.ndarray
    drag: np.ndarray
    incoming: np.ndarray

    @classmethod
    def of(
        cls, edges: ViscousEdges, blocks: DeflectedBlocks, midpoint: MidpointConfiguration, angle: np.ndarray
    ) -> BendingDashpots | None:
        """Dashpots on ``edges`` of ``blocks``, rotated by ``angle`` (n_blocks,) where forces act; None without edges."""
        if not len(edges.edge):
            return None
        place, weight = gauss_points(int(blocks.order[edges.block].max()) + 1)
        start, along = edges.ends[:, 0], edges.ends[:, 1] - edges.ends[:, 0]
        point = (start[:, None] + place[:, None] * along[:, None]).reshape(-1, 2)
        block = np.repeat(edges.block, len(place))
        length = (np.hypot(along[:, 0], along[:, 1])[:, None] * weight).ravel()
        at = blocks.material_points(midpoint.vertices, point, block)
        bent = blocks.directions(at, block, angle)
        rows = np.zeros((len(block), 2, 6 + bent.shape[2]))
        rows[..., :6] = midpoint.displacement(point, block)
        rows[..., 2:6] /= np.sqrt(midpoint.moments[block, 0])[:, None, None]
        rows[..., 6:] = bent
        drag = length[:, None, None] * np.repeat(edges.drag, len(place), axis=0)
        return cls(block, at, point, rows, drag, np.repeat(edges.incoming, len(place), axis=0))

    def equations(self, dt: float) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """block → matrix (w, w) and right side (w,) of its dashpots in a step of ``dt`` s."""
        weighed = np.einsum("nai,nab->nib", self.rows, self.drag)
        out = {}
        for b in np.unique(self.block).tolist():
            own = self.block == b
            matrix = np.einsum("nib,nbj->ij", weighed[own], self.rows[own]) / dt
            out[b] = matrix, 2.0 * np.einsum("nib,nb->i", weighed[own], self.incoming[own])
        return out

    def point_rows(self, unknowns: np.ndarray, dt: float) -> np.ndarray:
        """POINT_FORCE rows of the dashpots in a step of ``dt`` s with these ``unknowns`` (n_blocks, w) of the solver."""
        velocity = np.einsum("nai,ni->na", self.rows, unknowns[self.block]) / dt
        out = np.zeros(len(self.block), POINT_FORCE)
        out["block"], out["at"], out["point"] = self.block, self.at, self.point
        out["force"] = np.einsum("nab,nb->na", self.drag, 2.0 * self.incoming - velocity)
        return out

    def deflecting_work(self, forces: np.ndarray, change: np.ndarray) -> float:
        """Work, J/m, of the POINT_FORCE rows ``forces`` on the increments ``change`` (n_blocks, m) of deflection."""
        return float(np.einsum("na,naj,nj->", forces["force"], self.rows[..., 6:], change[self.block], optimize=True))
