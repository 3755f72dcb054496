"""The motion of first-order blocks, recovered from their vertices: it is affine, so the vertices tell all of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .blocks import Blocks


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
        owner, n = blocks.vertex_block, blocks.n_blocks
        count = np.bincount(owner, minlength=n)[:, None]

        def means(points: np.ndarray) -> np.ndarray:
            # About each block's first vertex, or digits are lost far from the origin.
            first = points[blocks.vertex_start[:-1]]
            own = points - first[owner]
            return first + np.column_stack([np.bincount(owner, own[:, k], n) for k in (0, 1)]) / count

        reference_centre, centre = means(blocks.vertices), means(vertices)
        before, moved = blocks.vertices - reference_centre[owner], vertices - centre[owner]

        def products(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return np.array([[np.bincount(owner, a[:, i] * b[:, j], n) for j in (0, 1)] for i in (0, 1)]).transpose(2, 0, 1)

        gradient = products(moved, before) @ np.linalg.inv(products(before, before))
        return cls(reference_centre, centre, gradient)

    def current(self, block: int, points: np.ndarray) -> np.ndarray:
        """Where the material points ``points`` (..., 2) of ``block``, in reference coordinates, are now."""
        return self.centre[block] + (np.asarray(points, dtype=float) - self.reference_centre[block]) @ self.gradient[block].T

    def reference(self, block: int, points: np.ndarray) -> np.ndarray:
        """Which material points, in reference coordinates, are now at ``points`` (..., 2)."""
        back = self._inverse[block]
        return self.reference_centre[block] + (np.asarray(points, dtype=float) - self.centre[block]) @ back.T

    @cached_property
    def _inverse(self) -> np.ndarray:
        return np.linalg.inv(self.gradient)
