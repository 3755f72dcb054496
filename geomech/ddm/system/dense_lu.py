"""LU factors of dense matrices, row- or column-major, without an extra copy."""

from __future__ import annotations

from functools import cached_property

import numpy as np

#: Columns whose absolute values are summed at a time where the factors take the memory of a large matrix.
_AT_ONCE = 256


class Factor:
    """LU of a square ``matrix``, with its rows scaled to equal size. ``in_place``: a column-major matrix is replaced by
    its factors, which take its memory; otherwise it is left unchanged. Raises LinAlgError, with the text ``what``, when
    it is singular.

    Tractions on an element are proportional to one over its length: without scaling, elements of very different lengths
    would look singular. The scales are powers of two and therefore add no round-off.
    """

    def __init__(self, matrix: np.ndarray, what: str, in_place: bool = False):
        from scipy.linalg import lapack

        self.n = len(matrix)
        if self.n == 0:
            self.rcond, self.scale = 1.0, np.empty(0)
            return
        in_place = in_place and matrix.flags.f_contiguous
        size = _row_sums(matrix) if in_place else np.abs(matrix).sum(axis=1)
        if not np.isfinite(size).all():
            raise np.linalg.LinAlgError(f"{what} (not finite)")
        self.scale = np.ldexp(1.0, -np.frexp(size)[1])
        # LAPACK is column-major: a row-major matrix is the transpose in the same memory, which is factored instead.
        scaled = np.multiply(matrix, self.scale[:, None], out=matrix if in_place else None)
        self._transposed = 0 if scaled.flags.f_contiguous else 1
        self._lu, self._pivots, info = lapack.dgetrf(scaled.T if self._transposed else scaled, overwrite_a=True)
        norm = (size * self.scale).max()
        self.rcond = lapack.dgecon(self._lu, norm, norm="1" if self._transposed else "I")[0] if info == 0 else 0.0
        if not self.rcond > 1e-15:
            raise np.linalg.LinAlgError(f"{what} (reciprocal condition {self.rcond:.1e})")

    @property
    def columns(self) -> bool:
        """Whether the matrix itself is factored, not its transpose."""
        return self.n == 0 or not self._transposed

    @property
    def lu(self) -> np.ndarray:
        """(n, n) L and U of the matrix whose rows are multiplied by ``scale`` (n,) and then ordered by `rows`."""
        return self._lu if self.n else np.empty((0, 0))

    @property
    def rows(self) -> np.ndarray:
        """(n,) row numbers in pivot order."""
        order = list(range(self.n))
        for k, pivot in enumerate(self._pivots.tolist() if self.n else ()):
            order[k], order[pivot] = order[pivot], order[k]
        return np.array(order, dtype=int)

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution for ``right`` (n,) or (n, k), of the ``transposed`` system if asked."""
        if self.n == 0 or right.size == 0:
            return np.zeros_like(right)
        from scipy.linalg.lapack import dgetrs  # imported here: a checkpoint cannot store a compiled function

        scale = self.scale if right.ndim == 1 else self.scale[:, None]
        # SciPy counts the pivots from 1 in their own memory for as long as LAPACK works, without the interpreter's lock:
        # threads that share them (a run and its interior fields) would get wrong solutions without a word.
        pivots = self._pivots.copy()
        if transposed:
            return scale * dgetrs(self._lu, pivots, right, trans=1 - self._transposed)[0]
        return dgetrs(self._lu, pivots, right * scale, trans=self._transposed, overwrite_b=True)[0]

    @cached_property
    def inverse(self) -> np.ndarray:
        """(n, n) inverse, for many solutions of a few columns each: a product takes half the time of two triangular
        solutions."""
        return self.solve(np.eye(self.n, order="F"))


def _row_sums(matrix: np.ndarray) -> np.ndarray:
    """(n,) sums of the absolute values of each row of a column-major ``matrix`` (n, n), without a copy of it."""
    out = np.zeros(len(matrix))
    for first in range(0, matrix.shape[1], _AT_ONCE):
        out += np.abs(matrix[:, first : first + _AT_ONCE]).sum(axis=1)
    return out
