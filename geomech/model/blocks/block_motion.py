"""Affine motion of first-order blocks, x = c + G (X − C), recovered from their vertices by least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .block_arrays import Blocks


@dataclass(frozen=True, eq=False)
class Motion:
    """x = centre + gradient · (X − reference_centre), block by block.

    reference_centre (n_blocks, 2) and centre (n_blocks, 2): means of the vertices before and after; gradient
    (n_blocks, 2, 2).
    """

    reference_centre: np.ndarray
    centre: np.ndarray
    gradient: np.ndarray

    @classmethod
    def of(cls, blocks: Blocks, vertices: np.ndarray) -> Motion:
        """The motion that takes ``blocks.vertices`` to ``vertices`` (least squares, exact for an affine motion)."""
        reference_centre, fit = blocks.affine_fit
        centre = blocks.mean_vertices(vertices)
        moved = vertices - centre[blocks.vertex_block]
        gradient = np.add.reduceat(moved[:, :, None] * fit[:, None, :], blocks.vertex_start[:-1], axis=0)
        return cls(reference_centre, centre, gradient)

    def current(self, block: int, points: np.ndarray) -> np.ndarray:
        """Present position of the material points ``points`` (..., 2) of ``block``, given in reference coordinates."""
        return (
            self.centre[block]
            + (np.asarray(points, dtype=float) - self.reference_centre[block]) @ self.gradient[block].T
        )

    def reference(self, block: int, points: np.ndarray) -> np.ndarray:
        """Material points, in reference coordinates, that are now at ``points`` (..., 2)."""
        (a, b), (c, d) = self.gradient[block].tolist()
        back = np.array([[d, -c], [-b, a]]) / (a * d - b * c)  # transposed
        return self.reference_centre[block] + (np.asarray(points, dtype=float) - self.centre[block]) @ back
