"""Rows by crack elements, kept while cracks grow: new ones are put beside the old, nothing is copied."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .influence import unknowns_of

#: Rows of elements that are gone are left out when there are so many times as many rows as are in use.
CARRIED = 1.3
#: Blocks are joined while the last but one has less than so many times the rows of the last.
ALIKE = 2.0


class KeptRows:
    """A matrix (n, m) of ``width`` rows an element: ``blocks`` of rows in the order in which they came, and ``at``
    (n_elements,) where the elements are in that order."""

    def __init__(self, blocks: tuple[np.ndarray, ...], at: np.ndarray, width: int):
        self.blocks, self.at, self._width = blocks, at, width
        self._total = sum(len(block) for block in blocks)
        self._in_order = len(at) * width == self._total and bool((at == np.arange(len(at))).all())
        self._places = unknowns_of(at, width)

    @classmethod
    def whole(cls, matrix: np.ndarray, width: int) -> KeptRows:
        return cls((matrix,), np.arange(len(matrix) // width), width)

    def grown(self, was: np.ndarray, compute: Callable[[np.ndarray], np.ndarray]) -> KeptRows:
        """The matrix of elements whose numbers were ``was`` (n_elements,), −1 where new; ``compute(elements)`` makes
        rows."""
        new, kept = np.flatnonzero(was < 0), np.flatnonzero(was >= 0)
        at = np.empty(len(was), int)
        at[kept], at[new] = self.at[was[kept]], self._total // self._width + np.arange(len(new))
        blocks = [*self.blocks, compute(new)] if len(new) else list(self.blocks)
        while len(blocks) > 2 and len(blocks[-2]) < ALIKE * len(blocks[-1]):
            blocks[-2:] = [np.concatenate(blocks[-2:])]
        out = KeptRows(tuple(blocks), at, self._width)
        return out if out._total < CARRIED * len(out._places) else KeptRows.whole(out.dense, self._width)

    def of(self, elements: np.ndarray) -> np.ndarray:
        """(k, m) rows of ``elements``."""
        places = unknowns_of(self.at[elements], self._width)
        out, first = np.empty((len(places), self.blocks[0].shape[1])), 0
        for block in self.blocks:
            here = np.flatnonzero((places >= first) & (places < first + len(block)))
            out[here] = block[places[here] - first]
            first += len(block)
        return out

    @property
    def dense(self) -> np.ndarray:
        if self._in_order and len(self.blocks) == 1:
            return self.blocks[0]
        return np.concatenate(self.blocks)[self._places]

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """(n,) or (n, k), the matrix times ``x`` (m,) or (m, k)."""
        if len(self.blocks) == 1:
            out = self.blocks[0] @ x
        else:
            out, first = np.empty((self._total, *x.shape[1:])), 0
            for block in self.blocks:
                np.matmul(block, x, out=out[first : first + len(block)])
                first += len(block)
        return out if self._in_order else out[self._places]

    @property
    def T(self) -> TransposedRows:
        return TransposedRows(self)

    def transposed_times(self, x: np.ndarray) -> np.ndarray:
        """(m,) or (m, k), the transposed matrix times ``x`` (n,) or (n, k)."""
        if not self._in_order:
            given, x = x, np.zeros((self._total, *x.shape[1:]))
            x[self._places] = given
        out, first = np.zeros((self.blocks[0].shape[1], *x.shape[1:])), 0
        for block in self.blocks:
            out += block.T @ x[first : first + len(block)]
            first += len(block)
        return out


class TransposedRows:
    """The transposed (m, n) of ``rows``."""

    def __init__(self, rows: KeptRows):
        self.rows = rows

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        return self.rows.transposed_times(x)
