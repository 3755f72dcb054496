"""The crack unknowns' matrix while cracks grow: factored once, then bordered with what is new.

Unknowns are kept in the order in which they came, in panels: the first is the matrix that was factored as a whole,
every other one what has come since between two bodies. With C and B the rows and columns of a panel against all before
it and D its own block, elimination panel by panel,

    L = C U⁻¹,    U_B = B − L' B,    T = D − L U_B

(block LU; L', U what panels before have), touches nothing that is there. So a body that grows shares all factors of the
one before, which stays what it was, and pays for rows and columns of new elements alone. Elements at tips are replaced
in the next increment: they are a last, loose panel, that is dropped. Their rows outlast them, as a tip's element that
becomes an ordinary one has other shape functions and the same collocation points. An element that goes from another
panel stays, with its equation given up for w = 0 by one more unknown in it (Woodbury's formula). Neighbouring panels of
like size become one.

Elimination in the order of arrival pivots inside panels only and loses ‖L‖ ‖U‖ / ‖S‖ in accuracy over one that pivots
freely (Higham 2002, §13.2). S is factored anew where that would be felt, and when much of it is gone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import NamedTuple

import numpy as np

from . import shapes
from .factor import Factor
from .influence import ElementSet, copy_blocks, unknowns_of

#: All is factored anew when more than this part of the elements is gone: they take their share of time.
GONE = 0.25
#: All is factored anew as well when there are so many times the unknowns of the first panel.
MOST = 2.0
#: Panels are joined while the last but one is less than so many times as large as the last: there are few of them, and
#: no unknown is joined often.
ALIKE = 2.0
#: Fewer unknowns are factored in less time than panels take.
SMALLEST = 200
#: Loss of accuracy, ‖L‖ ‖U‖ / ‖S‖ over the reciprocal condition, from which all is factored anew: K then still
#: agrees with that of factors made anew to 1e-10.
LOSS = 5e6
#: What it means when there are no factors.
SINGULAR = "cracks cut a part of the body off"


class Known(NamedTuple):
    """Of a panel's ``rows`` (numbers) the first columns of L, ``lower``; of its ``columns`` the first rows of U,
    ``upper``."""

    rows: np.ndarray
    columns: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


class Piece(NamedTuple):
    """Of S what unknowns that came together, n of them after others, have with these and among themselves: rows
    ``down`` (n, first), columns ``right`` (first, n) and own block ``corner`` (n, n)."""

    down: np.ndarray
    right: np.ndarray
    corner: np.ndarray

    @property
    def first(self) -> int:
        return self.down.shape[1]

    def joined(self, other: Piece) -> Piece:
        """This piece and the ``other``, which follows, as one."""
        m = self.first
        return Piece(
            np.concatenate([self.down, other.down[:, :m]]),
            np.concatenate([self.right.T, other.right[:m].T]).T,
            np.block([[self.corner, other.right[m:]], [other.down[:, m:], other.corner]]),
        )


@dataclass(eq=False)
class Panel:
    """Unknowns that are eliminated together: their ``pieces`` of S, the ``weight`` (n,) that brings tractions on a row
    to the size of jumps, and what is ``known`` before elimination; then their ``lower`` (n, first) of L, ``upper``
    (first, n) of U, ``t`` (n, n) and its ``factor``."""

    pieces: tuple[Piece, ...]
    weight: np.ndarray
    known: Known | None = None
    lower: np.ndarray | None = None
    upper: np.ndarray | None = None
    t: np.ndarray | None = None
    factor: Factor | None = None
    _columns_size: float | None = None

    @property
    def n(self) -> int:
        return len(self.weight)

    @property
    def first(self) -> int:
        return self.pieces[0].first

    @property
    def here(self) -> slice:
        return slice(self.first, self.first + self.n)

    def eliminate(self, before: Sequence[Panel]) -> None:
        """Work out L, U and T from those of the panels ``before``, once. Raises LinAlgError when T is singular."""
        if self.factor is not None:
            return
        if self.t is None:
            down, right, corner = reduce(Piece.joined, self.pieces)
            nothing = np.zeros(0, int)
            rows, columns, lower, upper = self.known or (nothing, nothing, np.empty((0, 0)), np.empty((0, 0)))
            fresh = _others(self.n, rows)
            self.lower = np.empty(down.shape)
            self.lower[rows] = _lower(before, down[rows], lower)
            self.lower[fresh] = _lower(before, down[fresh])
            fresh = _others(self.n, columns)
            self.upper = np.empty(right.shape, order="F")
            self.upper[:, columns] = _upper(before, right[:, columns], upper)
            self.upper[:, fresh] = _upper(before, right[:, fresh])
            self.t = corner - self.lower @ self.upper
        self.known, self.factor = None, Factor(self.t, SINGULAR)

    @cached_property
    def rows_size(self) -> np.ndarray:
        """(first,) weighted column sums of its rows of L."""
        return self.weight @ np.abs(self.lower)

    def columns_size(self, weight: np.ndarray) -> float:
        """The largest of the column sums of U over those of T, with the ``weight`` (first,) of the rows before."""
        if self._columns_size is None:
            self._columns_size = float((weight @ np.abs(self.upper) / (self.weight @ np.abs(self.t))).max())
        return self._columns_size

    def joined(self, other: Panel) -> Panel:
        """This panel and the ``other``, which follows, as one."""
        m = self.first
        out = Panel(self.pieces + other.pieces, np.concatenate([self.weight, other.weight]))
        if self.t is not None and other.t is not None:
            across, below = other.upper[m:], other.lower[:, m:]
            out.lower = np.concatenate([self.lower, other.lower[:, :m]])
            out.upper = np.concatenate([self.upper.T, other.upper[:m].T]).T
            out.t = np.block([[self.t, across], [below @ self.t, other.t + below @ across]])
        return out


def _lower(before: Sequence[Panel], rows: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
    """L of the ``rows`` (k, n), of which the first columns may be ``known``."""
    out, done = np.empty(rows.shape), 0
    if known is not None and len(rows):
        done = known.shape[1]
        out[:, :done] = known
    for panel in before if len(rows) else ():
        if panel.first >= done:
            part = rows[:, panel.here] - out[:, : panel.first] @ panel.upper
            out[:, panel.here] = panel.factor.solve(part.T, transposed=True).T
    return out


def _upper(before: Sequence[Panel], columns: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
    """U of the ``columns`` (n, k), of which the first rows may be ``known``."""
    out, done = np.array(columns, order="F"), 1
    if known is not None and columns.shape[1]:
        done = len(known)
        out[:done] = known
    for panel in before if columns.shape[1] else ():
        if panel.first >= done:
            out[panel.here] -= panel.lower @ out[: panel.first]
    return out


class Bordered:
    """S between crack ``elements``, as ``panels``, of which the last may be ``loose``. ``at`` (n_places,) are the
    numbers of the elements in the order of the panels, −1 for one that is gone and for the giving up of its
    equation."""

    def __init__(self, elements: ElementSet, panels: tuple[Panel, ...], at: np.ndarray, loose: bool):
        self.elements, self.panels, self.at, self.loose = elements, panels, at, loose
        self.n = elements.n_unknowns

    @classmethod
    def whole(cls, elements: ElementSet, matrix: np.ndarray) -> Bordered:
        """The ``matrix`` (n, n) of the ``elements`` as one panel."""
        n, weight = elements.n_unknowns, np.repeat(elements.length, 2 * elements.per)
        nothing = np.empty((n, 0))
        panel = Panel((Piece(nothing, nothing.T, matrix),), weight, lower=nothing, upper=nothing.T, t=matrix)
        return cls(elements, (panel,), np.arange(elements.n), False)

    @property
    def is_whole(self) -> bool:
        return len(self.panels) == 1

    @property
    def unfactored(self) -> bool:
        """Whether asking for factors will make those of a whole matrix."""
        return self.panels[0].factor is None

    def grown(
        self,
        elements: ElementSet,
        was: np.ndarray,
        seen: np.ndarray,
        compute: Callable[[np.ndarray, np.ndarray], np.ndarray],
    ) -> Bordered:
        """S between ``elements``, of which ``was`` (n,) are the numbers here, −1 where new, and ``seen`` (n,) those of
        elements in their place, whose rows are theirs; ``compute(rows, columns)`` makes blocks of it between
        elements."""
        if np.array_equal(was, np.arange(self.elements.n)):
            return self
        out = self._joined()._changed(elements, was, seen, compute)
        if out.n > MOST * out.panels[0].n or np.count_nonzero(out.at < 0) > 2 * GONE * elements.n:
            return Bordered.whole(elements, out.dense)
        return out

    def _joined(self) -> Bordered:
        """The same in fewer panels."""
        firm = list(self.panels[: len(self.panels) - self.loose])
        last = self.panels[-1]
        while len(firm) > 2 and firm[-2].n < ALIKE * firm[-1].n:
            a, b = firm[-2:]
            if self.loose and last.factor is not None:
                # What follows two panels has other L and U than what follows one.
                lower, upper = last.lower.copy(), last.upper.copy(order="F")
                lower[:, a.here] -= lower[:, b.here] @ b.lower[:, a.here]
                upper[b.here] += b.lower[:, a.here] @ upper[a.here]
                last = replace(last, lower=lower, upper=upper)
            elif self.loose:
                last = Panel(last.pieces, last.weight)
            firm[-2:] = [a.joined(b)]
        panels = (*firm, last) if self.loose else tuple(firm)
        return self if len(panels) == len(self.panels) else Bordered(self.elements, panels, self.at, self.loose)

    def _changed(self, elements: ElementSet, was: np.ndarray, seen: np.ndarray, compute) -> Bordered:
        """As `grown`, after the same firm panels."""
        firm = self.panels[: len(self.panels) - self.loose]
        last = self.panels[-1] if self.loose else None
        width = 2 * elements.per
        n_before = (firm[-1].first + firm[-1].n) // width
        now = np.full(self.elements.n + 1, -1)  # its end stands for what had gone before
        now[was[was >= 0]] = np.flatnonzero(was >= 0)
        before, loose = now[self.at[:n_before]], self.at[n_before:]
        given_up = np.flatnonzero((self.at[:n_before] >= 0) & (before < 0))
        stay = np.flatnonzero(now[loose] >= 0)
        place = np.full(self.elements.n + 1, -1)
        place[loose] = np.arange(len(loose))
        # New segments that end at a tip come last: they are tried, bent, and graded as they turn.
        source, settled = elements.source, np.zeros(elements.n, bool)
        settled[before[before >= 0]] = True
        ends, stands = np.zeros((2, int(source.max(initial=0)) + 1), bool)
        ends[source[elements.kind != shapes.ORDINARY]], stands[source[settled]] = True, True
        at_tip = (ends & ~stands)[source]
        new = np.flatnonzero(was < 0)
        came, column = np.concatenate([new, now[loose[stay]]]), np.concatenate([np.full(len(new), -1), stay])
        order = np.argsort(at_tip[came], kind="stable")
        came, column, n_inner = came[order], column[order], int((~at_tip[came]).sum())
        row = np.where(column >= 0, column, place[seen[came]])
        # Rows of elements that were at a tip in another kind are known, and columns of those that stay.
        old, fresh, old_c, new_c = (np.flatnonzero(x) for x in (row >= 0, row < 0, column >= 0, column < 0))
        every, present = np.arange(elements.n), np.flatnonzero(before >= 0)
        r_old, r_fresh, c_old, c_new = (unknowns_of(x, width) for x in (old, fresh, old_c, new_c))
        from_r, from_c = unknowns_of(row[old], width), unknowns_of(column[old_c], width)
        here, places, numbers = (
            unknowns_of(came, width),
            unknowns_of(present, width),
            unknowns_of(before[present], width),
        )
        n, n_first = width * len(came), width * n_before
        down, right, corner = np.zeros((n, n_first)), np.zeros((n_first, n), order="F"), np.empty((n, n))
        if len(old):
            (piece,) = last.pieces
            down[r_old], right[:, c_old] = piece.down[from_r], piece.right[:, from_c]
            corner[np.ix_(r_old, c_old)] = piece.corner[np.ix_(from_r, from_c)]
        if len(new_c):
            values = compute(every, came[new_c])
            # Both are column-major: transposed, copying goes along memory.
            right.T[np.ix_(c_new, places)] = values.T[:, numbers]
            corner[:, c_new] = values[here]
        if len(fresh):
            values = compute(came[fresh], every)
            down[np.ix_(r_fresh, places)] = values[:, numbers]
            corner[np.ix_(r_fresh, c_old)] = values[:, here[c_old]]
        weight = np.repeat(elements.length[came], width)
        panels, m, g = list(firm), width * n_inner, width * len(given_up)

        def add(piece: Piece, first: int, end: int) -> None:
            known = None
            if last is not None and last.factor is not None:
                known = _known(last, r_old, from_r, c_old, from_c, first, end)
            panels.append(Panel((piece,), weight[first:end], known))

        if m:
            add(Piece(down[:m], right[:, :m], corner[:m, :m]), 0, m)
        if g:
            panels.append(self._giving_up(given_up, n_first, m))
        if m < n:
            nothing = np.zeros((n - m, g))
            below = np.concatenate([down[m:], corner[m:, :m], nothing], axis=1)
            beside = np.concatenate([right[:, m:].T, corner[:m, m:].T, nothing], axis=1).T
            add(Piece(below, beside, corner[m:, m:]), m, n)
        at = np.concatenate([before, came[:n_inner], np.full(len(given_up), -1), came[n_inner:]])
        return Bordered(elements, tuple(panels), at, m < n)

    def _giving_up(self, places: np.ndarray, n_first: int, n_between: int) -> Panel:
        """The panel of the unknowns that stand for the equations of the elements at ``places``, and of w = 0 there,
        after ``n_between`` others; with tractions of the size of the equations, so that these unknowns are of the size
        of jumps."""
        width = 2 * self.elements.per
        at = unknowns_of(places, width)
        n = len(at)
        down, right = np.zeros((n, n_first + n_between)), np.zeros((n, n_first + n_between)).T
        length = np.repeat(self.elements.length[self.at[places]], width)
        down[np.arange(n), at], right[at, np.arange(n)] = 1.0, np.ldexp(1.0, -np.frexp(length)[1])
        return Panel((Piece(down, right, np.zeros((n, n))),), np.ones(n))

    @property
    def _pieces(self) -> list[Piece]:
        return [piece for panel in self.panels for piece in panel.pieces]

    @cached_property
    def _place(self) -> np.ndarray:
        """(n_elements,) where the elements are in the order of the panels."""
        out = np.empty(self.elements.n, int)
        there = np.flatnonzero(self.at >= 0)
        out[self.at[there]] = there
        return out

    @cached_property
    def places(self) -> np.ndarray:
        """(n_unknowns,) where the unknowns are in the order of the panels."""
        return unknowns_of(self._place, 2 * self.elements.per)

    @cached_property
    def dense(self) -> np.ndarray:
        """(n, n) S."""
        if self.is_whole:
            return self._pieces[0].corner
        out, width = np.empty((self.n, self.n), order="F"), 2 * self.elements.per
        for piece in self._pieces:
            first, n = piece.first // width, len(piece.corner) // width
            own = np.where((self._place >= first) & (self._place < first + n), self._place - first, -1)
            before = np.where(self._place < first, self._place, -1)
            copy_blocks(piece.corner, out, own, own, width, width)
            copy_blocks(piece.down, out, own, before, width, width)
            copy_blocks(piece.right, out, before, own, width, width)
        return out

    def __matmul__(self, w: np.ndarray) -> np.ndarray:
        """S ``w`` (n,) or (n, k)."""
        if self.is_whole:
            return self._pieces[0].corner @ w
        x = np.zeros((width_of(self.panels), *w.shape[1:]))
        x[self.places] = w
        out = np.zeros_like(x)
        for piece in self._pieces:
            here, before = slice(piece.first, piece.first + len(piece.corner)), slice(piece.first)
            out[here] = piece.corner @ x[here] + piece.down @ x[before]
            out[before] += piece.right @ x[here]
        return out[self.places]

    def factored(self) -> Factor | BorderedFactor:
        """Factors of S. Raises LinAlgError when it is singular."""
        for k, panel in enumerate(self.panels):
            panel.eliminate(self.panels[:k])
        return self.panels[0].factor if self.is_whole else BorderedFactor(self)


class BorderedFactor:
    """Factors of the `Bordered` matrix ``of``; see `Factor`. ``rcond`` is the worst one of the T, ``growth`` the loss
    of accuracy, as the module has it."""

    def __init__(self, of: Bordered):
        self.n, self._places, self._panels = of.n, of.places, of.panels
        self.rcond = min(panel.factor.rcond for panel in of.panels)
        # Tractions go with one over an element's length; without that all are of one size.
        weight = np.concatenate([panel.weight for panel in of.panels])
        across, size = np.zeros(len(weight)), 1.0
        for panel in of.panels[1:]:
            across[: panel.first] += panel.rows_size
            size = max(size, panel.columns_size(weight[: panel.first]))
        self.growth = size * max(1.0, float((across / weight).max()))

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution for ``right`` (n,) or (n, k), of the ``transposed`` system if asked."""
        # Transposed, gathering goes along memory.
        x = np.zeros((*right.shape[1:], width_of(self._panels))).T
        x.T[..., self._places] = right.T
        if transposed:
            for panel in self._panels:
                if panel.first:
                    x[panel.here] -= panel.upper.T @ x[: panel.first]
                x[panel.here] = panel.factor.solve(x[panel.here], transposed=True)
            for panel in self._panels[:0:-1]:
                x[: panel.first] -= panel.lower.T @ x[panel.here]
        else:
            for panel in self._panels[1:]:
                x[panel.here] -= panel.lower @ x[: panel.first]
            for panel in self._panels[::-1]:
                x[panel.here] = panel.factor.solve(x[panel.here])
                if panel.first:
                    x[: panel.first] -= panel.upper @ x[panel.here]
        return x.T[..., self._places].T


def _others(n: int, of: np.ndarray) -> np.ndarray:
    """The numbers below ``n`` that are not among ``of``."""
    rest = np.ones(n, bool)
    rest[of] = False
    return np.flatnonzero(rest)


def _known(last: Panel, rows, from_rows, columns, from_columns, first: int, end: int) -> Known:
    """What ``last`` has of ``rows`` and ``columns`` between ``first`` and ``end``, under other numbers there."""
    r, c = ((x >= first) & (x < end) for x in (rows, columns))
    return Known(rows[r] - first, columns[c] - first, last.lower[from_rows[r]], last.upper[:, from_columns[c]])


def width_of(panels: Sequence[Panel]) -> int:
    """How many unknowns the ``panels`` have."""
    return panels[-1].first + panels[-1].n
