"""Matrix rows of crack elements that are kept while cracks grow: new rows are appended without copying the old; or as a
product of two thin matrices while they do not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..kernels.shape_functions import ORDINARY
from .influence_matrix import ElementSet, unknowns_of

#: Ratio of stored to used rows above which the rows of removed elements are dropped.
CARRIED = 1.3
#: Capacity allocated, relative to the rows needed.
ROOM = 1.5


#: Relative error (Frobenius norm, up to a factor of about √columns) of `LowRankRows`, well below that of the mesh; number of
#: random combinations that are added at a time; and part of the numbers of the rows above which the product is not worth it.
EXACT, COMBINED, WORTH = 1e-10, 64, 0.7


class _GrowingRows:
    """Rows with spare capacity. Several matrices share the first rows, which never change."""

    def __init__(self, rows: np.ndarray):
        self.n, self.rows = len(rows), rows

    def __getstate__(self) -> np.ndarray:
        """Without the uninitialised capacity. The memory order is kept: the last bits of products depend on it."""
        return self.rows if self.n == len(self.rows) else self.rows[: self.n].copy(order="K")

    def __setstate__(self, rows: np.ndarray) -> None:
        self.n, self.rows = len(rows), rows

    def extended(self, n: int, more: np.ndarray) -> _GrowingRows:
        """The first ``n`` rows, extended by ``more``."""
        if self.n == n and n + len(more) <= len(self.rows):
            self.rows[n : n + len(more)] = more
            self.n = n + len(more)
            return self
        out = _GrowingRows(np.empty((int(ROOM * (n + len(more))), more.shape[1])))
        out.n = n + len(more)
        out.rows[:n], out.rows[n : out.n] = self.rows[:n], more
        return out


class KeptRows:
    """A matrix (n, m) of the rows of ``elements``: the first ``n_permanent`` rows of ``permanent``, then the ``temporary`` rows of
    tip elements, which are replaced when the tip advances. ``at`` (n_elements,): positions of the elements in this
    order."""

    def __init__(self, permanent: _GrowingRows, n_permanent: int, temporary: np.ndarray, at: np.ndarray, width: int):
        self._permanent, self._n, self._temporary, self.at, self._width = permanent, n_permanent, temporary, at, width
        self._total = n_permanent + len(temporary)
        self._in_order = len(at) * width == self._total and bool((at == np.arange(len(at))).all())
        self._places = unknowns_of(at, width)

    @classmethod
    def whole(cls, matrix: np.ndarray, elements: ElementSet) -> KeptRows:
        n, width = elements.n, 2 * elements.per
        return cls(_GrowingRows(matrix), n * width, np.empty((0, matrix.shape[1])), np.arange(n), width)

    def grown(self, elements: ElementSet, was: np.ndarray, compute: Callable[[np.ndarray], np.ndarray]) -> KeptRows:
        """The matrix of ``elements`` whose old numbers are ``was`` (n,), −1 where new; ``compute(elements)`` computes
        rows."""
        width, n = self._width, self._n // self._width
        at = np.append(self.at, -1)[was]  # the last entry is for −1
        new = np.flatnonzero(at < 0)
        # Other rows are old temporary ones or are computed.
        come = np.flatnonzero((at < 0) | (at >= n))
        stay = elements.kind[come] == ORDINARY
        come = np.concatenate([come[stay], come[~stay]])
        k, m = width * int(stay.sum()), self._temporary.shape[1]
        blocks = np.empty((len(come), width, m))
        old = at[come] >= 0
        blocks[old] = self._temporary.reshape(len(self._temporary) // width, width, m)[at[come[old]] - n]
        if len(new):
            blocks[~old] = compute(come[~old]).reshape(len(new), width, m)
        at[come] = n + np.arange(len(come))
        rows = blocks.reshape(width * len(come), m)
        permanent = self._permanent.extended(self._n, rows[:k]) if k else self._permanent
        out = KeptRows(permanent, self._n + k, rows[k:], at, width)
        return out if out._total < CARRIED * len(out._places) else KeptRows.whole(out.dense, elements)

    @property
    def width(self) -> int:
        """Unknowns of an element."""
        return self._width

    def of(self, elements: np.ndarray) -> np.ndarray:
        """(k, m) rows of ``elements``."""
        places = unknowns_of(self.at[elements], self._width)
        out, temporary = np.empty((len(places), self._temporary.shape[1])), places >= self._n
        out[temporary], out[~temporary] = (
            self._temporary[places[temporary] - self._n],
            self._permanent.rows[places[~temporary]],
        )
        return out

    @property
    def dense(self) -> np.ndarray:
        if self._in_order and not len(self._temporary):
            return self._permanent.rows[: self._n]
        return np.concatenate([self._permanent.rows[: self._n], self._temporary])[self._places]

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """(n,) or (n, k), column-major, the matrix times ``x`` (m,) or (m, k)."""
        # Writing the product column-major takes half the time.
        out = np.empty((self._total, *x.shape[1:]), order="F")
        np.matmul(self._permanent.rows[: self._n], x, out=out[: self._n])
        if len(self._temporary):
            np.matmul(self._temporary, x, out=out[self._n :])
        return out if self._in_order else out.T[..., self._places].T

    @property
    def T(self) -> TransposedRows:
        return TransposedRows(self)

    def transposed_times(self, x: np.ndarray) -> np.ndarray:
        """(m,) or (m, k), the transpose times ``x`` (n,) or (n, k)."""
        if not self._in_order:
            given, x = x, np.zeros((self._total, *x.shape[1:]))
            x[self._places] = given
        return self._permanent.rows[: self._n].T @ x[: self._n] + self._temporary.T @ x[self._n :]


class LowRankRows:
    """A matrix (n, m) of the rows of elements with ``width`` unknowns each as the product of ``left`` (n, r) and ``right``
    (r, m); interface of `KeptRows`.

    How a boundary acts on cracks is smooth but near their mouths: of a block with 3500 unknowns on its sides and 2150 on its
    cracks r is 450. The columns of ``left`` span those of random combinations (Halko, Martinsson & Tropp 2011, alg. 4.2)."""

    def __init__(self, left: np.ndarray, right: np.ndarray, width: int):
        self._left, self._right, self._width = left, right, width

    @classmethod
    def of_rows(cls, rows: KeptRows) -> LowRankRows | None:
        """``rows`` as a product, where it has fewer numbers; otherwise None."""
        matrix = rows.dense
        n, m = matrix.shape
        random, left, first = np.random.default_rng(0), np.empty((n, 0), order="F"), 0.0
        while (left.shape[1] + COMBINED) * (n + m) < WORTH * n * m:
            more = matrix @ random.normal(size=(m, COMBINED))
            first = first or float(np.linalg.norm(more, axis=0).max())
            more -= left @ (left.T @ more)
            if np.linalg.norm(more, axis=0).max() <= EXACT * first:
                return cls(left, left.T @ matrix, rows.width)
            # Twice, as small differences are not orthogonal to what has been taken away.
            for _ in range(2):
                more = np.linalg.qr(more)[0]
                more -= left @ (left.T @ more)
            left = np.concatenate([left, np.linalg.qr(more)[0]], axis=1)
        return None

    def grown(self, elements: ElementSet, was: np.ndarray, compute: Callable[[np.ndarray], np.ndarray]) -> KeptRows:
        """See `KeptRows.grown`."""
        return KeptRows(
            _GrowingRows(self.dense), len(self._left), np.empty((0, self._right.shape[1])),
            np.arange(len(self._left) // self._width), self._width,
        ).grown(elements, was, compute)  # fmt: skip

    def of(self, elements: np.ndarray) -> np.ndarray:
        """(k, m) rows of ``elements``."""
        return self._left[unknowns_of(elements, self._width)] @ self._right

    @property
    def dense(self) -> np.ndarray:
        return self._left @ self._right

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """(n,) or (n, k), the matrix times ``x`` (m,) or (m, k)."""
        return self._left @ (self._right @ x)

    @property
    def T(self) -> TransposedRows:
        return TransposedRows(self)

    def transposed_times(self, x: np.ndarray) -> np.ndarray:
        """(m,) or (m, k), the transpose times ``x`` (n,) or (n, k)."""
        return self._right.T @ (self._left.T @ x)


class TransposedRows:
    """The transpose (m, n) of ``rows``."""

    def __init__(self, rows: KeptRows | LowRankRows):
        self.rows = rows

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        return self.rows.transposed_times(x)
