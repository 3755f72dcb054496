"""Stress of a block of higher order at its cracks, and the strain and deflection that cracks under it add to the block.

The elastic displacement of such a block is a polynomial (`dda.higher_order.deflection_basis`), and so is its stress,
σ(X) = Σ_k Σ_k s_k(X), with the generalised stress Σ of `dda.higher_order.crack_softening`. By Betti's theorem cracks
with the jumps [u] add the generalised strain

    A e_c,k = ∫ [u]·s_k n ds,

the strain on which Σ does the work that the stress does at the cracks. Under the block's own stress alone they are those
of a body with a free outline whose crack faces are loaded by −σ n; its jumps have the potential W(Σ), so that e_c = ∂W/∂Σ
and S = ∂e_c/∂Σ is symmetric. No body force is needed, whatever the order.

The walls of holes are free of traction, but those of the polynomials are not. The field of a block with holes is that of
the same forces on the block without them, H Σ (`_across_holes`), and the body whose cracks open has walls loaded by −σ n as
well: s_k n above is the traction of both on closed cracks, and jumps still have a potential. For a uniform stress, H is
1 − (area of the holes)/(area of the outline), as in blocks of first order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...dda.higher_order.deflected_blocks import DeflectedBlocks
from ...dda.higher_order.deflection_basis import DeflectionBasis
from ...dda.kinematics.polygon_quadrature import polygon_points
from ...ddm.loads.body_loads import BodyLoad, IntactField
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
    #: (3 + m, 3 + m) H of a block with holes, None without.
    over_holes: np.ndarray | None = None
    _at_faces: tuple[object, np.ndarray] | None = field(default=None, repr=False)

    @classmethod
    def of(cls, blocks: DeflectedBlocks, block: int, compliance: np.ndarray) -> BlockStressField:
        """Of rock whose mean strain has this ``compliance`` (3, 3), 1/Pa."""
        rock = blocks.generalised_compliance(block, compliance)
        return cls(blocks, block, rock, _across_holes(blocks, block, rock))

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
        units = np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), bent], axis=2)
        return units if self.over_holes is None else units @ self.over_holes

    def traction(self, body: Body) -> np.ndarray:
        """(n_crack_unknowns, 3 + m) traction of each s_k on the closed cracks of ``body``, whose holes are free."""
        from ...ddm.loads.unit_load_cache import on_elements

        if self._at_faces is None or self._at_faces[0] is not body.faces:
            if self.over_holes is None:
                units = self.units(body.faces.nodes.reshape(-1, 2))
                columns = [on_elements(body.faces, units[:, :, k]) for k in range(self.width)]
            else:
                fields = (BodyLoad(intact=self.under(unit)) for unit in np.eye(self.width))
                columns = [body.closed_traction(load) for load in fields]
            self._at_faces = body.faces, np.column_stack(columns)
        return self._at_faces[1]

    def displacement_of(self, points: np.ndarray) -> np.ndarray:
        """(n, 2, 3 + m) m, displacement of unit generalised strains at ``points`` (n, 2), without mean rotation, and without
        displacement of the centroid."""
        x, y = (points - self.basis.centroid[self.block]).T
        none = np.zeros_like(x)
        even = np.stack([np.stack([x, none, 0.5 * y], axis=1), np.stack([none, y, 0.5 * x], axis=1)], axis=1)
        bent = self.basis.displacement(points, self.block)[..., : self.width - 3]
        return np.concatenate([even, self.size * bent], axis=2)

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


def _across_holes(blocks: DeflectedBlocks, block: int, rock: np.ndarray) -> np.ndarray | None:
    """(3 + m, 3 + m) H: the generalised stress whose field, continued across the holes, has the work of Σ on all strains;
    None without holes. ``rock`` (3 + m, 3 + m) is D⁻¹.

    With the strains E of unit generalised strains, ∫ Eᵀ C E dA over the block and its holes is A (D + D_h), and H =
    D (D + D_h)⁻¹."""
    arrays, basis = blocks.blocks, blocks.basis
    first, last = arrays.block_loop[block], arrays.block_loop[block + 1]
    if last - first == 1:
        return None
    wall = np.arange(arrays.loop_start[first + 1], arrays.loop_start[last])
    start, end = arrays.vertices[wall], arrays.vertices[arrays.next_vertex[wall]]
    points, weights = polygon_points(start, end, basis.centroid[block], 2 * int(basis.order[block]) - 2)
    size, m = float(np.sqrt(basis.area[block])), len(rock) - 3
    bent = size * basis.strain(points, block)[..., :m]
    strain = np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), bent], axis=2)
    # (Holes are clockwise: their weights are negative.)
    inside = np.einsum("n,nai,ab,nbj->ij", -weights, strain, blocks.elastic[block], strain, optimize=True)
    return np.linalg.inv(np.eye(len(rock)) + inside @ rock / basis.area[block])


@dataclass(frozen=True, eq=False)
class PolynomialField(IntactField):
    """The field ``of`` a block with the generalised stress ``sizes`` (3 + m,), Pa."""

    of: BlockStressField
    sizes: np.ndarray

    def stress(self, points: np.ndarray) -> np.ndarray:
        return self.of.units(np.asarray(points)) @ self.sizes

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m, without mean rotation, and without displacement of the centroid."""
        own = self.of
        sizes = self.sizes if own.over_holes is None else own.over_holes @ self.sizes
        return own.displacement_of(points) @ (own.rock @ sizes)

    def scaled(self, factor: float) -> PolynomialField:
        return PolynomialField(self.of, factor * self.sizes)

    def with_added(self, other: IntactField) -> PolynomialField:
        if not (isinstance(other, PolynomialField) and other.of.block == self.of.block):
            raise ValueError("only stress fields of the same block can be added")
        # (The block may have been raised between the two.)
        low, high = sorted((self, other), key=lambda one: one.of.width)
        same = low.of.width == high.of.width
        return PolynomialField(high.of, high.sizes + (low.sizes if same else high.of.widened(low.sizes, low.of)))
