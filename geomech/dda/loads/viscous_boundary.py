"""Viscous boundaries: dashpots with the rock's wave impedance along edges, t = −ρ (c_p n⊗n + c_s s⊗s) v.

A plane wave of particle velocity v puts the traction −ρ (c_p n⊗n + c_s s⊗s) v on an edge. Dashpots of that strength
absorb it at normal incidence without reflection, and almost so up to 60° from it (Lysmer & Kuhlemeyer 1969). An
incoming wave of particle velocity w is applied as twice its stress, 2ρ (c_p n⊗n + c_s s⊗s) w: one half drives the wave,
one half the dashpots (Joyner & Chen 1975). The velocity is the mean of the step, d/dt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...model import Blocks, ViscousBoundary
from ..kinematics.midpoint_configuration import MidpointConfiguration
from .force_records import EDGE_FORCE

#: Two Gauss points: exact for the square of a linear displacement.
_GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)


@dataclass(frozen=True, eq=False)
class ViscousEdges:
    """Dashpots on edges of moving blocks: traction = ``drag`` (2 ``incoming`` − velocity).

    ``edge``, ``block`` (n,); ``ends`` (n, 2, 2) m; ``drag`` (n, 2, 2) Pa s/m; ``incoming`` (n, 2) m/s."""

    edge: np.ndarray
    block: np.ndarray
    ends: np.ndarray
    drag: np.ndarray
    incoming: np.ndarray

    @classmethod
    def of(
        cls,
        boundaries: Sequence[ViscousBoundary],
        blocks: Blocks,
        vertices: np.ndarray,
        time: float,
        density: np.ndarray,
        stiffness: np.ndarray,
        fixed: np.ndarray,
    ) -> ViscousEdges:
        """Dashpots of ``boundaries`` at ``time`` s on the current ``vertices``, without edges of ``fixed`` (n_blocks,)
        blocks; ``density`` (n_blocks,) kg/m³, ``stiffness`` (n_blocks, 3, 3) Pa."""
        edges, waves = [], []
        for boundary in boundaries:
            named = blocks.edges_named(boundary.edge_name)
            named = named[~fixed[blocks.vertex_block[named]]]
            wave = np.zeros(2) if boundary.incoming is None else boundary.incoming.at(time)
            edges.append(named)
            waves.append(np.tile(wave, (len(named), 1)))
        edge, incoming = np.concatenate(edges), np.concatenate(waves)
        block = blocks.vertex_block[edge]
        ends = np.stack([vertices[edge], vertices[blocks.next_vertex[edge]]], axis=1)
        along = ends[:, 1] - ends[:, 0]
        s = along / np.hypot(along[:, 0], along[:, 1])[:, None]
        n = np.stack([s[:, 1], -s[:, 0]], axis=1)
        rho = density[block]
        push, shear = np.sqrt(rho * stiffness[block, 0, 0]), np.sqrt(rho * stiffness[block, 2, 2])
        drag = (
            push[:, None, None] * n[:, :, None] * n[:, None, :] + shear[:, None, None] * s[:, :, None] * s[:, None, :]
        )
        return cls(edge, block, ends, drag, incoming)

    def assemble(
        self, matrix: np.ndarray, right: np.ndarray, order: np.ndarray, midpoint: MidpointConfiguration, dt: float
    ) -> None:
        """Add the dashpots to the blocks' own ``matrix`` (n, 6, 6) and ``right`` (n, 6), scaled as in `assembly`;
        ``midpoint`` is the configuration on which they act."""
        along = self.ends[:, 1] - self.ends[:, 0]
        half = 0.5 * np.hypot(along[:, 0], along[:, 1])
        scale = np.ones((len(self.edge), 6))
        scale[:, 2:] /= np.sqrt(midpoint.moments[self.block, :1])
        rows = order[self.block]
        for at in _GAUSS:
            t = midpoint.displacement(self.ends[:, 0] + at * along, self.block) * scale[:, None, :]
            weighed = half[:, None, None] * np.einsum("nji,njk->nik", t, self.drag)
            np.add.at(matrix, rows, weighed @ t / dt)
            np.add.at(right, rows, 2.0 * np.einsum("nij,nj->ni", weighed, self.incoming))

    def rows(self, increment: np.ndarray, midpoint: MidpointConfiguration, dt: float) -> np.ndarray:
        """EDGE_FORCE rows of the dashpots' tractions in a step of ``dt`` s with the displacement ``increment``
        (n_blocks, 6)."""
        out = np.zeros(len(self.edge), EDGE_FORCE)
        out["block"], out["edge"] = self.block, self.edge
        out["start"], out["end"] = self.ends[:, 0], self.ends[:, 1]
        t = midpoint.displacement(self.ends, np.stack([self.block, self.block], axis=1))
        velocity = np.einsum("neij,nj->nei", t, increment[self.block]) / dt
        out["traction"] = np.einsum("nij,nej->nei", self.drag, 2.0 * self.incoming[:, None] - velocity)
        along = self.ends[:, 1] - self.ends[:, 0]
        out["force"] = 0.5 * np.hypot(along[:, 0], along[:, 1])[:, None] * out["traction"].sum(axis=1)
        return out
