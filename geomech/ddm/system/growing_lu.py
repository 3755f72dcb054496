"""A matrix that grows at its end, piece by piece, and its LU factors, in arrays with room: what is there stays.

Of the matrix [[A, B], [C, D]] with A = Pᵀ L U,

    B' = L⁻¹ P B,    C' = C U⁻¹,    D − C' B' = P₂ᵀ L₂ U₂,

which are two triangular solutions and factors of something as small as D. Whoever holds the first n unknowns does not
see what came behind them: bodies that grow from one another share the arrays.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

import numpy as np

from .dense_lu import Factor

#: Room is made for so many times the unknowns, and so many more.
ROOM, MORE_ROOM = 1.5, 200


class Known(NamedTuple):
    """What is known of L and U before elimination: of the ``rows`` (numbers) the first columns of L, which are those
    ``as_rows`` of ``lower``, transposed, and of the ``columns`` the first rows of U, those ``as_columns`` of
    ``upper``."""

    rows: np.ndarray
    as_rows: np.ndarray
    lower: np.ndarray
    columns: np.ndarray
    as_columns: np.ndarray
    upper: np.ndarray


class Border(NamedTuple):
    """Unknowns behind n others: their rows ``down`` (k, n), columns ``right`` (n, k) and own block ``corner``, the
    ``scale`` (k,) that brings rows to one size, and what is ``known`` of their factors."""

    down: np.ndarray
    right: np.ndarray
    corner: np.ndarray
    scale: np.ndarray
    known: Known | None


class GrowingFactor:
    """``matrix`` (n, n) and what comes behind it; of what is named in ``names``, place by place. ``factor``: of the
    matrix, column-major, if it is known."""

    def __init__(self, matrix: np.ndarray, names: list[Hashable], factor: Factor | None = None):
        self.n, self.names, self._factor = len(matrix), names, factor
        self._room(len(matrix))
        #: The first matrix, and the borders that came behind it.
        self._first = matrix
        self._borders: list[Border] = []
        #: Ends of what came together, what was known of it, and of what is eliminated the worst reciprocal condition
        #: and loss of accuracy so far.
        self._ends = [self.n]
        self._known: list[Known | None] = [None]
        self._trust: list[tuple[float, float]] = []
        #: All of the matrix so far in one array, with room, and how many unknowns are in it; once asked for.
        self._whole, self._in_whole = np.empty((0, 0), order="F"), 0

    def _room(self, n: int) -> None:
        room = int(ROOM * n) + MORE_ROOM
        self.lu = np.empty((room, room), order="F")
        self.scale, self.order = np.empty(room), np.empty(room, int)

    def __getstate__(self) -> dict:
        """Without the room, which may hold anything."""
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
        """Put ``border`` behind all that is there."""
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

    def went_on(self, n: int, more: int, names: list[Hashable]) -> bool:
        """Whether what came behind the first ``n`` unknowns are ``more`` that are called ``names``."""
        at = len(self.names) * n // self.n
        return n + more in self._ends and self.names[at : at + len(names)] == names

    def part(self, n: int) -> GrowingFactor:
        """A copy of the first ``n`` unknowns, that may grow in another way."""
        at = self._ends.index(n) + 1
        out = GrowingFactor(self._first, self.names[: len(self.names) * n // self.n], self._factor)
        out.n, out._borders = n, self._borders[: at - 1]
        if n > len(out.lu):
            out._room(n)
        out._ends, out._known, out._trust = self._ends[:at], self._known[:at], self._trust[:at]
        out.lu[:n, :n], out.scale[:n], out.order[:n] = self.lu[:n, :n], self.scale[:n], self.order[:n]
        return out

    def matrix(self, n: int) -> np.ndarray:
        """(n, n), column-major, the first ``n`` unknowns' matrix: a view, not to be written to."""
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
        """Whether asking for factors makes those of the first matrix."""
        return not self._trust and self._factor is None

    def eliminate(self, n: int, what: str) -> tuple[float, float]:
        """Make the factors of the first ``n`` unknowns; the worst reciprocal condition of a diagonal block and the
        worst `loss` of accuracy. Raises LinAlgError with ``what`` when one is singular."""
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
                lower, upper, t = self.beside(first, self._borders[k - 1]._replace(known=self._known[k]))
                self._eliminated(first, lower, upper, t, Factor(t, what))
        return self._trust[upto]

    def _eliminated(self, first: int, lower: np.ndarray, upper: np.ndarray, t: np.ndarray, factor: Factor) -> None:
        """Keep the factors of the next unknowns, behind the ``first``."""
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
        """Whether all of the first ``n`` unknowns are eliminated and the next ``m``, that came together, are not."""
        k = len(self._trust)
        return 0 < k < len(self._ends) and self._ends[k - 1 : k + 1] == [n, n + m]

    def beside(self, n: int, border: Border) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of what stands behind the first ``n`` unknowns, all eliminated, L transposed (n, k), U (n, k) and what is
        left of its own block."""
        # Column-major all the way.
        rows = border.down.T * border.scale
        columns = np.take(border.right.T, self.order[:n], axis=1)
        columns *= self.scale[self.order[:n]]
        known = border.known
        if known is None:
            lower, upper = self._below(0, n, rows), self._above(0, n, columns.T)
        else:
            lower = self._beyond(n, rows, known.rows, known.lower, known.as_rows, self._below)
            upper = self._beyond(n, columns.T, known.columns, known.upper, known.as_columns, self._above)
        t = np.array(border.corner * border.scale[:, None], order="F")
        t -= (upper.T @ lower).T
        return lower, upper, t

    def _beyond(self, n: int, given: np.ndarray, names, before, which, solve) -> np.ndarray:
        """``solve`` with ``given`` (n, k), where of the columns ``names`` the first rows are ``before[:, which]``."""
        if not len(names):
            return solve(0, n, given)
        m, fresh, before = len(before), np.ones(given.shape[1], bool), before.T[which].T
        fresh[names] = False
        out = np.empty(given.shape, order="F")
        out.T[fresh] = solve(0, n, given.T[fresh].T).T
        out[:m, names] = before
        if m < n:
            across = self.lu[:m, m:n].T if solve == self._below else self.lu[m:n, :m]
            out[m:, names] = solve(m, n, given[m:, names] - across @ before)
        return out

    def eliminate_with(self, n: int, border: Border, m: int, what: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same for all but the first ``m`` of the ``border``, which stand behind the first ``n`` unknowns already
        and are eliminated on the way."""
        lower, upper, t = self.beside(n, border)
        first = np.array(t[:m, :m], order="F")
        self._eliminated(n, lower[:, :m], upper[:, :m], first, Factor(first, what))
        end = n + m
        across = t[:m, m:] * self.scale[n:end, None] / border.scale[:m, None]
        beyond = self._above(n, end, across[self.order[n:end] - n]), self._below(n, end, t[m:, :m].T)
        out_lower, out_upper = np.empty((2, t.shape[0] - m, end))
        out_lower[:, :n], out_upper[:, :n] = lower.T[m:], upper.T[m:]
        out_upper[:, n:], out_lower[:, n:] = beyond[0].T, beyond[1].T
        return out_lower.T, out_upper.T, t[m:, m:] - beyond[1].T @ beyond[0]

    # -- triangles -----------------------------------------------------------------------------------------------

    def _below(self, first: int, end: int, x: np.ndarray) -> np.ndarray:
        """U⁻ᵀ ``x`` between two unknowns."""
        return self._triangle(first, end, x, lower=0, trans=1, unitdiag=0)

    def _above(self, first: int, end: int, x: np.ndarray) -> np.ndarray:
        """L⁻¹ ``x``."""
        return self._triangle(first, end, x, lower=1, trans=0, unitdiag=1)

    def _triangle(self, first: int, end: int, x: np.ndarray, **which) -> np.ndarray:
        from scipy.linalg.lapack import dtrtrs  # not kept: a compiled function cannot be stored in a checkpoint

        if not x.size:
            return x
        # Columns that lie together are taken as they are, with all that stands below.
        part = self.lu[first:end, first:end] if first else self.lu[:, :end]
        out = dtrtrs(part, np.asfortranarray(x if x.ndim > 1 else x[:, None]), **which, overwrite_b=True)[0]
        return out if x.ndim > 1 else out[:, 0]

    def forth(self, n: int, x: np.ndarray, transposed: bool) -> np.ndarray:
        """The first half of a solution with the first ``n`` unknowns: L⁻¹ P ``x`` (n,) or (n, k), or U⁻ᵀ ``x``."""
        if transposed:
            return self._below(0, n, x.copy(order="F"))
        scale = self.scale[:n] if x.ndim == 1 else self.scale[:n, None]
        return self._above(0, n, (x * scale)[self.order[:n]])

    def back(self, n: int, y: np.ndarray, transposed: bool) -> np.ndarray:
        """The second half: U⁻¹ ``y``, or Pᵀ L⁻ᵀ ``y``."""
        if not transposed:
            return self._triangle(0, n, y, lower=0, trans=0, unitdiag=0)
        out = np.empty(y.shape)
        out[self.order[:n]] = self._triangle(0, n, y, lower=1, trans=1, unitdiag=1)
        return out * (self.scale[:n] if y.ndim == 1 else self.scale[:n, None])


#: What has room.
_ARRAYS = ("lu", "scale", "order")


def loss(lower: np.ndarray, upper: np.ndarray, t: np.ndarray) -> float:
    """By how much elimination without pivoting magnifies round-off: ‖L‖ ‖U‖ over what is left, rows of one size (Higham
    2002, §13.2)."""
    rows = np.abs(lower).sum(axis=0).max(initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        columns = np.abs(upper).max(axis=0, initial=0.0) / np.abs(t).max(axis=0, initial=0.0)
    return max(1.0, rows * float(np.max(columns, initial=0.0)))
