"""Cracks in blocks of higher order: how their opening and slip soften a block's mean strain and deflection together.

With the generalised strain e = (ε, q/√A) of a block, the mean strain and the deflection (`deflection_basis`), and the
stress Σ that does the work A Σ·δe on it, intact rock has Σ = D e with D = diag(C, K). Cracks add the strain

    e_c(Σ) = offset + S Σ,   so that   Σ₁ = (D⁻¹ + S)⁻¹ (Δe + D⁻¹ Σ₀ + e_c₀ − offset)

at the end of a step that strains the block by Δe: the equation of first-order blocks (`newmark.assemble_blocks`) with
more components. S is symmetric, and couples mean strain and deflection. Strains are on the axes at the start of the
step, deflection is in the block's frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import State
from ..results import CrackedOutline, CrackResponse
from .deflected_blocks import DeflectedBlocks


@dataclass(frozen=True, eq=False)
class SoftenedBlock:
    """One ``block`` with cracks in a step, with m unknowns of deflection.

    size      √A, m
    softness  (3 + m, 3 + m) S, 1/Pa
    offset    (3 + m,) crack strain without stress
    begun     (3 + m,) Σ₀, Pa
    still     (3 + m,) Σ₁ of a step that does not strain the block, Pa
    tangent   (3 + m, 3 + m) (D⁻¹ + S)⁻¹, Pa
    outline   displacement of its faces to other cells besides, None without any
    """

    block: int
    size: float
    softness: np.ndarray
    offset: np.ndarray
    begun: np.ndarray
    still: np.ndarray
    tangent: np.ndarray
    outline: CrackedOutline | None = None

    @property
    def shared(self) -> np.ndarray:
        """(3, m) mean stress per unit of deflection, Pa/m."""
        return self.tangent[:3, 3:] / self.size

    def crack_strain(self, strain: np.ndarray, change: np.ndarray) -> np.ndarray:
        """(3 + m,) strain of the cracks after the ``strain`` (3,) of the step and the ``change`` (m,) of deflection, m."""
        stress = self.still + self.tangent @ np.concatenate([strain, change / self.size])
        return self.offset + self.softness @ stress


def softened_blocks(
    crack: CrackResponse | None, state: State, blocks: DeflectedBlocks, compliance: np.ndarray, strained: np.ndarray,
    absent: np.ndarray,
) -> list[SoftenedBlock]:  # fmt: skip
    """Blocks of higher order that have cracks, in a step from ``state`` with this response of ``crack``.

    ``compliance`` (n_blocks, 3, 3) of the rock, 1/Pa; ``strained`` (k,) m: elastic part of the deflections; ``absent``
    (n_blocks,): fixed or excavated."""
    if crack is None or crack.compliance.shape[1] == 3:
        return []
    out, opened = [], blocks.at_rest()[:, 0] if state.crack_deflection is None else state.crack_deflection
    for b in blocks.bending.tolist():
        own = blocks.basis.of_block(b)
        n = 3 + own.stop - own.start
        softness, offset = crack.compliance[b, :n, :n], crack.offset[b, :n]
        if len(offset) < n:
            # The block has been raised since the response of its cracks was found.
            more = (0, n - len(offset))
            softness, offset = np.pad(softness, more), np.pad(offset, more)
        size = float(np.sqrt(blocks.basis.area[b]))
        known = np.concatenate([state.crack_strain[b], opened[own] / size])
        if absent[b] or not (softness.any() or offset.any() or known.any()):
            continue
        elastic = blocks.generalised_compliance(b, compliance[b])
        strain = np.concatenate([compliance[b] @ state.stress[b], strained[own] / size])
        begun = np.concatenate([state.stress[b], blocks.stiffness[b, : n - 3, : n - 3] @ strained[own] / size])
        tangent = np.linalg.inv(elastic + softness)
        still = tangent @ (strain + known - offset)
        out.append(SoftenedBlock(b, size, softness, offset, begun, still, tangent, crack.outlines.get(b)))
    return out
