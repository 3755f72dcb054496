"""A matrix that grows by appended borders, and its LU factors, in arrays with spare capacity.

The matrix [[A, B], [C, D]] with A = Pᵀ L U has

    B' = L⁻¹ P B,    C' = C U⁻¹,    D − C' B' = P₂ᵀ L₂ U₂,

so that a border takes two triangular solutions and factors of the size of D. The first n unknowns do not depend on
later ones: bodies that grow from one another share the arrays.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

import numpy as np

from .dense_lu import Factor

#: Capacity allocated: ROOM times the unknowns needed plus MORE_ROOM.
ROOM, MORE_ROOM = 1.5, 200


class Known(NamedTuple):
    """Parts of L and U that are known before elimination. For the ``rows`` (numbers): the first columns of L, which are
    the columns ``as_rows`` of ``lower``, transposed. For the ``columns``: the first rows of U, which are the columns
    ``as_columns`` of ``upper``."""

    rows: np.ndarray
    as_rows: np.ndarray
    lower: np.ndarray
    columns: np.ndarray
    as_columns: np.ndarray
    upper: np.ndarray


class Border(NamedTuple):
    """k unknowns that follow n others: their rows ``down`` (k, n), columns ``right`` (n, k) and diagonal block
    ``corner`` (k, k), the ``scale`` (k,) that makes rows equal in size, and what is ``known`` of their factors."""

    down: np.ndarray
    right: np.ndarray
    corner: np.ndarray
    scale: np.ndarray
    known: Known | None


class GrowingFactor:
    """A ``matrix`` (n, n) with the borders appended to it, and its factors. ``names``: an identifier of each element,
    in order. ``factor``: of the matrix, column-major, if known."""

    def __init__(self, matrix: np.ndarray, names: list[Hashable], factor: Factor | None = None):
        self.n, self.names, self._factor = len(matrix), names, factor
        self._room(len(matrix))
        #: The first matrix and the borders appended to it.
        self._first = matrix
        self._borders: list[Border] = []
        #: For each group (the matrix or a border): number of unknowns up to its end, factors known in advance and, once
        #: eliminated, the worst reciprocal condition and loss of accuracy so far.
        self._ends = [self.n]
        self._known: list[Known | None] = [None]
        self._trust: list[tuple[float, float]] = []
        #: The assembled matrix, with spare capacity, and the number of unknowns in it; made on demand.
        self._whole, self._in_whole = np.empty((0, 0), order="F"), 0

    def _room(self, n: int) -> None:
        room = int(ROOM * n) + MORE_ROOM
        self.lu = np.empty((room, room), order="F")
        self.scale, self.order = np.empty(room), np.empty(room, int)

    def __getstate__(self) -> dict:
        """Without the uninitialised capacity."""
        n = self.n
        arrays = {name: getattr(self, name)[(slice(n),) * getattr(self, name).ndim].copy() for name in _ARRAYS}
        none = {"_whole": np.empty((0, 0), order="F"), "_in_whole": 0}
        return vars(self) | arrays | none | {"room": len(self.lu)}

    def __setstate__(self, state: dict) -> None:
        vars(self).update(state)
        room = vars(self).pop("room")
        for name in _ARRAYS:
            short = state[name]
            setattr(self, name, np.empty((room,) * short.ndim, short.dtype, order="F"))
            getattr(self, name)[(slice(self.n),) * short.ndim] = short

    def append(self, border: Border, names: list[Hashable]) -> None:
        """Append the unknowns of ``border``, whose elements are called ``names``."""
        n, end = self.n, self.n + len(border.corner)
        if end > len(self.lu):
            before = self.lu, self.scale, self.order
            self._room(end)
            for old, new in zip(before, (self.lu, self.scale, self.order)):
                new[(slice(n),) * old.ndim] = old[(slice(n),) * old.ndim]
        self._borders.append(border._replace(known=None))
        self.scale[n:end] = border.scale
        self.n, self.names = end, self.names + names
        self._ends.append(end)
        self._known.append(border.known)

    def continues_with(self, n: int, more: int, names: list[Hashable]) -> bool:
        """Whether the first ``n`` unknowns are already followed by ``more``, of the elements ``names``."""
        at = len(self.names) * n // self.n
        return n + more in self._ends and self.names[at : at + len(names)] == names

    def part(self, n: int) -> GrowingFactor:
        """A copy of the first ``n`` unknowns, which can grow in another way."""
        at = self._ends.index(n) + 1
        out = GrowingFactor(self._first, self.names[: len(self.names) * n // self.n], self._factor)
        out.n, out._borders = n, self._borders[: at - 1]
        if n > len(out.lu):
            out._room(n)
        out._ends, out._known, out._trust = self._ends[:at], self._known[:at], self._trust[:at]
        out.lu[:n, :n], out.scale[:n], out.order[:n] = self.lu[:n, :n], self.scale[:n], self.order[:n]
        return out

    def matrix(self, n: int) -> np.ndarray:
        """(n, n) matrix of the first ``n`` unknowns, column-major: a view that must not be written to."""
        if n > len(self._whole):
            room = int(ROOM * n) + MORE_ROOM
            self._whole, self._in_whole = np.empty((room, room), order="F"), 0
        out, first = self._whole, len(self._first)
        if not self._in_whole:
            out[:first, :first] = self._first
        for border in self._borders[: self._ends.index(n)]:
            end = first + len(border.corner)
            if end > self._in_whole:
                out[first:end, :first], out[:first, first:end] = border.down, border.right
                out[first:end, first:end] = border.corner
            first = end
        self._in_whole = max(self._in_whole, n)
        return out[:n, :n]

    # -- elimination ---------------------------------------------------------------------------------------------

    @property
    def unfactored(self) -> bool:
        """Whether the first matrix has not been factored yet."""
        return not self._trust and self._factor is None

    def eliminate(self, n: int, what: str) -> tuple[float, float]:
        """Factor the first ``n`` unknowns; returns the smallest reciprocal condition of a diagonal block and the
        largest `loss` of accuracy. Raises LinAlgError with the text ``what`` when a block is singular."""
        upto = self._ends.index(n)
        for k in range(len(self._trust), upto + 1):
            first, end = self._ends[k - 1] if k else 0, self._ends[k]
            here = slice(first, end)
            if not k:
                factor = self._factor or Factor(np.array(self._first, order="F"), what)
                self.lu[here, here], self.order[here] = factor.lu, factor.rows
                self.scale[here], self._factor = factor.scale, None
                self._trust.append((factor.rcond, 1.0))
            else:
                lower, upper, t = self.eliminate_border(first, self._borders[k - 1]._replace(known=self._known[k]))
                self._eliminated(first, lower, upper, t, Factor(t, what))
        return self._trust[upto]

    def _eliminated(self, first: int, lower: np.ndarray, upper: np.ndarray, t: np.ndarray, factor: Factor) -> None:
        """Store the factors of the group that follows the ``first`` unknowns."""
        here, k = slice(first, first + factor.n), len(self._trust)
        self.lu[here, :first] = (lower * factor.scale).T[factor.rows]
        self.lu[:first, here] = upper
        self.lu[here, here] = factor.lu
        self.order[here] = first + factor.rows
        self.scale[here] *= factor.scale
        rcond, worst = self._trust[-1]
        self._trust.append((min(rcond, factor.rcond), max(worst, loss(lower, upper, t))))
        self._known[k] = None

    def is_next(self, n: int, m: int) -> bool:
        """Whether the first ``n`` unknowns are eliminated and the next group, of ``m``, is not."""
        k = len(self._trust)
        return 0 < k < len(self._ends) and self._ends[k - 1 : k + 1] == [n, n + m]

    def eliminate_border(self, n: int, border: Border) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Eliminate the first ``n`` unknowns, all factored, from a border of k: its part of L, transposed (n, k), its
        part of U (n, k) and its Schur complement (k, k)."""
        # Column-major all the way.
        rows = border.down.T * border.scale
        columns = np.take(border.right.T, self.order[:n], axis=1)
        columns *= self.scale[self.order[:n]]
        known = border.known
        if known is None:
            lower, upper = self._solve_upper_transposed(0, n, rows), self._solve_lower(0, n, columns.T)
        else:
            lower = self._solve_partly_known(
                n, rows, known.rows, known.lower, known.as_rows, self._solve_upper_transposed
            )
            upper = self._solve_partly_known(
                n, columns.T, known.columns, known.upper, known.as_columns, self._solve_lower
            )
        t = np.array(border.corner * border.scale[:, None], order="F")
        t -= (upper.T @ lower).T
        return lower, upper, t

    def _solve_partly_known(self, n: int, given: np.ndarray, names, before, which, solve) -> np.ndarray:
        """``solve`` with ``given`` (n, k), where the first rows of the columns ``names`` are known: ``before[:,
        which]``."""
        if not len(names):
            return solve(0, n, given)
        m, fresh, before = len(before), np.ones(given.shape[1], bool), before.T[which].T
        fresh[names] = False
        out = np.empty(given.shape, order="F")
        out.T[fresh] = solve(0, n, given.T[fresh].T).T
        out[:m, names] = before
        if m < n:
            across = self.lu[:m, m:n].T if solve == self._solve_upper_transposed else self.lu[m:n, :m]
            out[m:, names] = solve(m, n, given[m:, names] - across @ before)
        return out

    def eliminate_next(self, n: int, border: Border, m: int, what: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `eliminate_border`, for all but the first ``m`` unknowns of the ``border``. Those are already in the
        matrix, after the first ``n``, and are factored here."""
        lower, upper, t = self.eliminate_border(n, border)
        first = np.array(t[:m, :m], order="F")
        self._eliminated(n, lower[:, :m], upper[:, :m], first, Factor(first, what))
        end = n + m
        across = t[:m, m:] * self.scale[n:end, None] / border.scale[:m, None]
        beyond = (
            self._solve_lower(n, end, across[self.order[n:end] - n]),
            self._solve_upper_transposed(n, end, t[m:, :m].T),
        )
        out_lower, out_upper = np.empty((2, t.shape[0] - m, end))
        out_lower[:, :n], out_upper[:, :n] = lower.T[m:], upper.T[m:]
        out_upper[:, n:], out_lower[:, n:] = beyond[0].T, beyond[1].T
        return out_lower.T, out_upper.T, t[m:, m:] - beyond[1].T @ beyond[0]

    # -- triangular solutions ------------------------------------------------------------------------------------

    def _solve_upper_transposed(self, first: int, end: int, x: np.ndarray) -> np.ndarray:
        """U⁻ᵀ ``x`` with the diagonal block of the unknowns from ``first`` to ``end``."""
        return self._solve_triangular(first, end, x, lower=0, trans=1, unitdiag=0)

    def _solve_lower(self, first: int, end: int, x: np.ndarray) -> np.ndarray:
        """L⁻¹ ``x`` with that block."""
        return self._solve_triangular(first, end, x, lower=1, trans=0, unitdiag=1)

    def _solve_triangular(self, first: int, end: int, x: np.ndarray, **which) -> np.ndarray:
        from scipy.linalg.lapack import dtrtrs  # not kept: a compiled function cannot be stored in a checkpoint

        if not x.size:
            return x
        # Whole columns, contiguous in memory, avoid a copy.
        part = self.lu[first:end, first:end] if first else self.lu[:, :end]
        out = dtrtrs(part, np.asfortranarray(x if x.ndim > 1 else x[:, None]), **which, overwrite_b=True)[0]
        return out if x.ndim > 1 else out[:, 0]

    def forward_substitution(self, n: int, x: np.ndarray, transposed: bool) -> np.ndarray:
        """Forward substitution with the first ``n`` unknowns: L⁻¹ P ``x`` (n,) or (n, k); U⁻ᵀ ``x`` if
        ``transposed``."""
        if transposed:
            return self._solve_upper_transposed(0, n, x.copy(order="F"))
        scale = self.scale[:n] if x.ndim == 1 else self.scale[:n, None]
        return self._solve_lower(0, n, (x * scale)[self.order[:n]])

    def back_substitution(self, n: int, y: np.ndarray, transposed: bool) -> np.ndarray:
        """Back substitution: U⁻¹ ``y``; Pᵀ L⁻ᵀ ``y`` if ``transposed``."""
        if not transposed:
            return self._solve_triangular(0, n, y, lower=0, trans=0, unitdiag=0)
        out = np.empty(y.shape)
        out[self.order[:n]] = self._solve_triangular(0, n, y, lower=1, trans=1, unitdiag=1)
        return out * (self.scale[:n] if y.ndim == 1 else self.scale[:n, None])


#: The arrays with spare capacity.
_ARRAYS = ("lu", "scale", "order")


def loss(lower: np.ndarray, upper: np.ndarray, t: np.ndarray) -> float:
    """Factor by which elimination without pivoting magnifies round-off: ‖L‖ ‖U‖ over the Schur complement ``t``, rows
    equal in size (Higham 2002, §13.2)."""
    rows = np.abs(lower).sum(axis=0).max(initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        columns = np.abs(upper).max(axis=0, initial=0.0) / np.abs(t).max(axis=0, initial=0.0)
    return max(1.0, rows * float(np.max(columns, initial=0.0)))
