"""Displacement and stress inside a block of higher order, for output files and pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...conventions import rotate_stress
from ...model import Motion, State
from .deflected_blocks import DeflectedBlocks, rotation_of


@dataclass(frozen=True, eq=False)
class BentBody:
    """A ``block`` of the ``deflected`` blocks.

    q       (m,) deflection since displacements count
    strained (m,) deflection beyond that at which the block bears its mean stress alone
    strain  (3,) mean strain, in the block's frame
    stress  (3,) mean stress, Pa, in the block's frame
    angle   rotation of that frame, rad
    """

    deflected: DeflectedBlocks
    block: int
    q: np.ndarray
    strained: np.ndarray
    strain: np.ndarray
    stress: np.ndarray
    angle: float

    def fields(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Stress (n, 3), Pa, and displacement (n, 2), m, without rigid motion, at undeformed ``points`` (n, 2).

        Both refer to the block's frame.
        """
        basis = self.deflected.basis
        m = len(self.q)
        bent = basis.strain(points, self.block)[..., :m] @ self.strained
        arm = points - basis.centroid[self.block]
        x, y, (ex, ey, gamma) = arm[:, 0], arm[:, 1], self.strain
        own = np.stack([ex * x + 0.5 * gamma * y, ey * y + 0.5 * gamma * x], axis=1)
        own += basis.displacement(points, self.block)[..., :m] @ self.q
        return self.stress + bent @ self.deflected.elastic[self.block].T, own

    def deflection(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m: displacement of undeformed ``points`` (n, 2) beyond that of the first-order block, in fixed
        axes."""
        moved = self.deflected.basis.displacement(points, self.block)[..., : len(self.q)] @ self.q
        return moved @ rotation_of(np.array(self.angle)).T


def bent_bodies(deflected: DeflectedBlocks | None, state: State, motion: Motion) -> dict[int, BentBody]:
    """{block: body} of all blocks of higher order in ``state`` with known affine ``motion``, without excavated ones."""
    if deflected is None:
        return {}
    known = deflected.at_rest() if state.deflection is None else state.deflection
    beyond, since = deflected.elastic_part(state), known[:, 0] - deflected.origin(state)[:, 1]
    out = {}
    bending = deflected.bending
    if state.removed is not None:
        bending = bending[~state.removed[bending]]
    for b in bending.tolist():
        angle = float(state.rotation[b])
        stretch = rotation_of(np.array(-angle)) @ motion.gradient[b] - np.eye(2)
        strain = np.array([stretch[0, 0], stretch[1, 1], stretch[0, 1] + stretch[1, 0]])
        stress = rotate_stress(state.stress[b], -angle)
        own = deflected.basis.of_block(b)
        out[b] = BentBody(deflected, b, since[own], beyond[own], strain, stress, angle)
    return out
