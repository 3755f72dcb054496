"""Stress of a block of higher order at its cracks, and the strain and deflection that cracks under it add to the block.

The elastic displacement of such a block is a polynomial (`dda.higher_order.deflection_basis`), and so is its stress,
σ(X) = Σ_k Σ_k s_k(X), with the generalised stress Σ of `dda.higher_order.crack_softening`. By Betti's theorem cracks
with the jumps [u] add the generalised strain

    A e_c,k = ∫ [u]·s_k n ds,

the strain on which Σ does the work that the stress does at the cracks. Under the block's own stress alone they are those
of a body with a free outline whose crack faces are loaded by −σ n; its jumps have the potential W(Σ), so that e_c = ∂W/∂Σ
and S = ∂e_c/∂Σ is symmetric. No body force is needed, whatever the order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...dda.higher_order.deflected_blocks import DeflectedBlocks
from ...dda.higher_order.deflection_basis import DeflectionBasis
from ...ddm.loads.body_loads import IntactField
from ...model import State

if TYPE_CHECKING:
    from ...ddm import Body, Solution


@dataclass(eq=False)
class BlockStressField:
    """The fields s_k of a ``block`` among ``blocks``, with m unknowns of deflection; ``rock`` (3 + m, 3 + m) is its
    compliance without cracks, 1/Pa."""

    blocks: DeflectedBlocks
    block: int
    rock: np.ndarray
    _at_faces: tuple[object, np.ndarray] | None = field(default=None, repr=False)

    @classmethod
    def of(cls, blocks: DeflectedBlocks, block: int, compliance: np.ndarray) -> BlockStressField:
        """Of rock whose mean strain has this ``compliance`` (3, 3), 1/Pa."""
        return cls(blocks, block, blocks.generalised_compliance(block, compliance))

    @property
    def basis(self) -> DeflectionBasis:
        return self.blocks.basis

    @property
    def width(self) -> int:
        """3 + m."""
        return len(self.rock)

    @property
    def size(self) -> float:
        """√A, m."""
        return float(np.sqrt(self.basis.area[self.block]))

    def units(self, points: np.ndarray) -> np.ndarray:
        """(n, 3, 3 + m) s_k at ``points`` (n, 2) of the undeformed block."""
        strain = self.basis.strain(points, self.block)[..., : self.width - 3]
        bent = self.size * (self.blocks.elastic[self.block] @ strain) @ self.rock[3:, 3:]
        return np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), bent], axis=2)

    def traction(self, body: Body) -> np.ndarray:
        """(n_crack_unknowns, 3 + m) traction of each s_k on the closed cracks of ``body``."""
        from ...ddm.loads.unit_load_cache import on_elements

        if self._at_faces is None or self._at_faces[0] is not body.faces:
            units = self.units(body.faces.nodes.reshape(-1, 2))
            columns = [on_elements(body.faces, units[:, :, k]) for k in range(self.width)]
            self._at_faces = body.faces, np.column_stack(columns)
        return self._at_faces[1]

    def crack_strain(self, body: Body, jumps: np.ndarray) -> np.ndarray:
        """(3 + m, …) e_c of ``jumps`` (n_crack_unknowns, …), times 2μ, of ``body``."""
        c = body.faces
        share = np.broadcast_to(c.quadrature[:, None], (c.n, 2, c.per)).ravel()
        weighted = self.traction(body) * share[:, None]
        return weighted.T @ jumps / (self.basis.area[self.block] * 2 * body.material.shear_modulus)

    def compliance_of(self, body: Body, solution: Solution | None = None) -> np.ndarray:
        """(3 + m, 3 + m) S, 1/Pa, with the face states of ``solution`` (all open if None)."""
        if not body.faces.n:
            return np.zeros((self.width, self.width))
        response = self.crack_strain(body, body.jumps_under(self.traction(body), solution))
        return 0.5 * (response + response.T)

    def stress_of(self, state: State) -> np.ndarray:
        """(3 + m,) Pa, Σ of the block in ``state``; mean stress on current axes."""
        own, m = self.basis.of_block(self.block), self.width - 3
        bent = self.blocks.elastic_part(state)[own] / self.size
        return np.concatenate([state.stress[self.block], self.blocks.stiffness[self.block, :m, :m] @ bent])

    def crack_strain_of(self, state: State) -> np.ndarray:
        """(3 + m,) e_c that the block in ``state`` has from its cracks; mean strain on current axes."""
        opened, own = state.crack_deflection, self.basis.of_block(self.block)
        bent = np.zeros(self.width - 3) if opened is None else opened[own] / self.size
        return np.concatenate([state.crack_strain[self.block], bent])

    def work_on_cracks(self, before: State, state: State) -> float:
        """J/m that the stress of deflection does on the cracks between two states."""
        stress = 0.5 * (self.stress_of(before) + self.stress_of(state))
        change = self.crack_strain_of(state) - self.crack_strain_of(before)
        return float(self.basis.area[self.block] * (stress[3:] @ change[3:]))

    def widened(self, stress: np.ndarray, below: BlockStressField | None) -> np.ndarray:
        """(3 + m,) Pa: the same field as that of the ``stress`` (w,) of the block when it had the lower order of ``below``,
        None: order 1."""
        out, m = np.zeros(self.width), self.width - 3
        out[:3] = stress[:3]
        if below is not None:
            bent = below.rock[3:, 3:] @ stress[3:]
            out[3:] = self.blocks.stiffness[self.block, :m, : len(bent)] @ bent
        return out

    def under(self, stress: np.ndarray) -> PolynomialField:
        """The field of the generalised ``stress`` (3 + m,), Pa."""
        return PolynomialField(self, np.asarray(stress, dtype=float))

    def __getstate__(self) -> dict:
        return vars(self) | {"_at_faces": None}


@dataclass(frozen=True, eq=False)
class PolynomialField(IntactField):
    """The field ``of`` a block with the generalised stress ``sizes`` (3 + m,), Pa."""

    of: BlockStressField
    sizes: np.ndarray

    def stress(self, points: np.ndarray) -> np.ndarray:
        return self.of.units(np.asarray(points)) @ self.sizes

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m, without mean rotation, and without displacement of the centroid."""
        own, basis = self.of, self.of.basis
        arm, (xx, yy, shear) = points - basis.centroid[own.block], own.rock[:3, :3] @ self.sizes[:3]
        x, y = arm.T
        even = np.column_stack([xx * x + 0.5 * shear * y, yy * y + 0.5 * shear * x])
        bent = basis.displacement(points, own.block)[..., : own.width - 3]
        return even + bent @ (own.size * own.rock[3:, 3:] @ self.sizes[3:])

    def scaled(self, factor: float) -> PolynomialField:
        return PolynomialField(self.of, factor * self.sizes)

    def with_added(self, other: IntactField) -> PolynomialField:
        if not (isinstance(other, PolynomialField) and other.of.block == self.of.block):
            raise ValueError("only stress fields of the same block can be added")
        # (The block may have been raised between the two.)
        low, high = sorted((self, other), key=lambda one: one.of.width)
        same = low.of.width == high.of.width
        return PolynomialField(high.of, high.sizes + (low.sizes if same else high.of.widened(low.sizes, low.of)))
