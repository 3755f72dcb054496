"""LU factors of the dense matrices, row- or column-major without a copy more."""

from __future__ import annotations

from functools import cached_property

import numpy as np


class Factor:
    """LU of a square ``matrix`` (left as it is), its rows brought to one size. Raises LinAlgError, with
    ``what``, when it is singular.

    Tractions on an element go with one over its length: unscaled, elements of very different lengths would look
    singular. Scales are powers of two, so that no bit of the solution depends on them.
    """

    def __init__(self, matrix: np.ndarray, what: str):
        from scipy.linalg import lapack

        self.n = len(matrix)
        if self.n == 0:
            self.rcond, self.scale = 1.0, np.empty(0)
            return
        size = np.abs(matrix).sum(axis=1)
        if not np.isfinite(size).all():
            raise np.linalg.LinAlgError(f"{what} (not finite)")
        self.scale = np.ldexp(1.0, -np.frexp(size)[1])
        # LAPACK is column-major: of a row-major matrix factor the transpose, which is the same memory, and solve the
        # transposed system.
        scaled = matrix * self.scale[:, None]
        self._transposed = 0 if scaled.flags.f_contiguous else 1
        self._lu, self._pivots, info = lapack.dgetrf(scaled.T if self._transposed else scaled, overwrite_a=True)
        norm = (size * self.scale).max()
        self.rcond = lapack.dgecon(self._lu, norm, norm="1" if self._transposed else "I")[0] if info == 0 else 0.0
        if not self.rcond > 1e-15:
            raise np.linalg.LinAlgError(f"{what} (reciprocal condition {self.rcond:.1e})")

    @property
    def columns(self) -> bool:
        """Whether it is the matrix that is factored, not what is transposed to it."""
        return self.n == 0 or not self._transposed

    @property
    def lu(self) -> np.ndarray:
        """(n, n) L and U, of the matrix whose rows are multiplied by ``scale`` (n,) and then taken as `rows` says."""
        return self._lu if self.n else np.empty((0, 0))

    @property
    def rows(self) -> np.ndarray:
        """(n,) numbers of the rows in the order of their pivots."""
        order = list(range(self.n))
        for k, pivot in enumerate(self._pivots.tolist() if self.n else ()):
            order[k], order[pivot] = order[pivot], order[k]
        return np.array(order, dtype=int)

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution for ``right`` (n,) or (n, k), of the ``transposed`` system if asked."""
        if self.n == 0 or right.size == 0:
            return np.zeros_like(right)
        from scipy.linalg.lapack import dgetrs  # not kept: a compiled function cannot be stored in a checkpoint

        scale = self.scale if right.ndim == 1 else self.scale[:, None]
        if transposed:
            return scale * dgetrs(self._lu, self._pivots, right, trans=1 - self._transposed)[0]
        return dgetrs(self._lu, self._pivots, right * scale, trans=self._transposed, overwrite_b=True)[0]

    @cached_property
    def inverse(self) -> np.ndarray:
        """(n, n) for what is solved for again and again, a few columns at a time: products take half the time of
        solutions with thin triangles."""
        return self.solve(np.eye(self.n, order="F"))
