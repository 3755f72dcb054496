"""LU factors of the dense matrices, without the copies that a row-major matrix would cost."""

from __future__ import annotations

import numpy as np


class Factor:
    """LU of a square row-major ``matrix`` (left as it is). Raises LinAlgError, with ``what``, when it is singular."""

    def __init__(self, matrix: np.ndarray, what: str):
        from scipy.linalg import lapack

        self._solve = lapack.dgetrs
        self.n = len(matrix)
        if self.n == 0:
            self.rcond = 1.0
            return
        # LAPACK is column-major: factor the transpose, which is the same memory, and solve the transposed system.
        transposed = np.ascontiguousarray(matrix).T
        self._lu, self._pivots, info = lapack.dgetrf(transposed)
        norm = np.abs(matrix).sum(axis=1).max()
        self.rcond = lapack.dgecon(self._lu, norm, norm="1")[0] if info == 0 else 0.0
        if not self.rcond > 1e-15:
            raise np.linalg.LinAlgError(f"{what} (reciprocal condition {self.rcond:.1e})")

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solution for ``right`` (n,) or (n, k)."""
        if self.n == 0 or right.size == 0:
            return np.zeros_like(right)
        return self._solve(self._lu, self._pivots, right, trans=1)[0]
