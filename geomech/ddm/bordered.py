"""The crack unknowns' matrix while cracks grow: factored once, then bordered with what is new.

Let B be the elements of which S was factored last, N those that came since and G those of B that are gone. With λ for the
equations of G, which are given up for w_G = 0,

    S_BB w_B + S_BN w_N + I_BG λ = r_B,     S_NB w_B + S_NN w_N = r_N,     w_G = 0.

Eliminating w_B leaves a small matrix T = K − D X for (w_N, λ), X = S_BB⁻¹ (S_BN, I_BG): a column of X is made once and
outlasts growth (block elimination; its part for G is Woodbury's formula). Elements that come and go between two
increments cost no more than their columns.

Block elimination does not pivot between B and the border and loses ‖D‖ ‖X‖ / ‖T‖ in accuracy over an elimination that
does (Higham 2002, §13.2). S is factored anew where that would be felt, and where the border has grown as dear as that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from . import shapes
from .factor import Factor
from .influence import ElementSet, copy_blocks

#: Columns of the border, as a part of those of the base, from which all is factored anew: the sum is least about there.
WIDEST = 0.25
#: Fewer unknowns are factored in less time than a border takes.
SMALLEST = 200
#: Loss of accuracy, ‖D‖ ‖X‖ / ‖T‖ over the reciprocal condition of T, from which all is factored anew: K then still
#: agrees with that of factors made anew to 1e-10.
LOSS = 1e5
#: What it means when there are no factors.
SINGULAR = "cracks cut a part of the body off"


class Base:
    """``matrix`` (n, n) between crack ``elements`` and its factors, made when first asked for."""

    def __init__(self, elements: ElementSet, matrix: np.ndarray):
        self.elements, self.matrix = elements, matrix

    @cached_property
    def factor(self) -> Factor:
        return Factor(self.matrix, SINGULAR)


@dataclass(frozen=True, eq=False)
class Border:
    """What has changed since a base was factored.

    at       (n_base_elements,) number that each of the base's elements has now, −1: gone
    added    (b,) numbers of the elements that came since
    right    (n_base, m) traction on the base's elements from those, ``down`` (m, n_base) on those from the base's,
             ``corner`` (m, m) on those from their own; entries of gone elements have no meaning
    """

    at: np.ndarray
    added: np.ndarray
    right: np.ndarray
    down: np.ndarray
    corner: np.ndarray


class Bordered:
    """S between crack ``elements``, as a ``base`` and a ``border`` (None: it is the base's own matrix)."""

    def __init__(self, elements: ElementSet, base: Base, border: Border | None = None):
        self.elements, self.base, self.border = elements, base, border
        self.n = elements.n_unknowns
        # Columns of X for what was added, and for elements gone from the base: their numbers and columns.
        self._for_added: np.ndarray | None = None
        self._for_gone = np.empty(0, int), np.empty((base.elements.n_unknowns, 0))

    def grown(
        self, elements: ElementSet, was: np.ndarray, compute: Callable[[np.ndarray, np.ndarray], np.ndarray]
    ) -> Bordered:
        """S between ``elements``, of which ``was`` (n,) are the numbers here, −1 where new; ``compute(rows, columns)``
        makes blocks of it between elements."""
        every, new = np.arange(elements.n), np.flatnonzero(was < 0)
        if not len(new) and elements.n == self.elements.n and np.array_equal(was, every):
            return self
        border = self._start() if self.border is None else self.border
        now = np.full(self.elements.n, -1)
        now[was[was >= 0]] = np.flatnonzero(was >= 0)
        at = np.where(border.at >= 0, now[border.at], -1)
        survives = now[border.added] >= 0
        added = np.concatenate([now[border.added[survives]], new])
        stays = np.flatnonzero(np.repeat(survives, 2 * elements.per))
        old, n, n_base = len(stays), elements.per * 2 * len(added), self.base.elements.n_unknowns
        columns, rows = compute(every, new), compute(new, every)
        places, numbers = self.base.elements.unknowns(np.flatnonzero(at >= 0)), elements.unknowns(at[at >= 0])
        here = elements.unknowns(added)
        right, down, corner = np.zeros((n_base, n), order="F"), np.zeros((n, n_base)), np.empty((n, n), order="F")
        right[:, :old], down[:old], corner[:old, :old] = (
            border.right[:, stays],
            border.down[stays],
            border.corner[np.ix_(stays, stays)],
        )
        right[places, old:], down[old:, places] = columns[numbers], rows[:, numbers]
        corner[:, old:], corner[old:, :old] = columns[here], rows[:, here[:old]]
        out = Bordered(elements, self.base, Border(at, added, right, down, corner))
        if self._for_added is not None:
            # Nothing may have been solved since the last of them came.
            out._for_added = self._for_added[:, stays[stays < self._for_added.shape[1]]]
        out._for_gone = self._for_gone
        return out

    def _start(self) -> Border:
        n = self.n
        return Border(
            np.arange(self.elements.n), np.empty(0, int), np.empty((n, 0)), np.empty((0, n)), np.empty((0, 0))
        )

    @property
    def worn(self) -> bool:
        """Whether factors of all would by now have cost less."""
        if self.border is None:
            return False
        n, width = self.base.elements.n_unknowns, 2 * self.elements.per
        return width * (len(self.border.added) + int((self.border.at < 0).sum())) > WIDEST * n

    def whole(self) -> Bordered:
        """The same without border."""
        return Bordered(self.elements, Base(self.elements, self.dense))

    def renewed(self) -> Bordered:
        """The same with a border of nothing but fresh tips, which go with the next increment."""
        border, added = self.border, self.border.added
        fresh = np.zeros(self.elements.n, bool)
        fresh[added] = self.elements.kind[added] != shapes.ORDINARY
        if not fresh.any():
            return self.whole()
        kept, added = np.flatnonzero(~fresh), np.flatnonzero(fresh)
        order = np.concatenate([kept, added])
        sorted_, width = np.empty((self.n, self.n), order="F"), 2 * self.elements.per
        copy_blocks(self.dense, sorted_, order, order, width, width)
        m = width * len(kept)
        base = Base(self.elements.take(kept), np.asfortranarray(sorted_[:m, :m]))
        border = Border(kept, added, sorted_[:m, m:], np.ascontiguousarray(sorted_[m:, :m]), sorted_[m:, m:])
        return Bordered(self.elements, base, border)

    @cached_property
    def dense(self) -> np.ndarray:
        """(n, n) S, column-major."""
        border = self.border
        if border is None:
            return self.base.matrix
        in_base, in_border = np.full(self.elements.n, -1), np.full(self.elements.n, -1)
        kept = border.at >= 0
        in_base[border.at[kept]] = np.flatnonzero(kept)
        in_border[border.added] = np.arange(len(border.added))
        out, width = np.empty((self.n, self.n), order="F"), 2 * self.elements.per
        copy_blocks(self.base.matrix, out, in_base, in_base, width, width)
        copy_blocks(border.right, out, in_base, in_border, width, width)
        copy_blocks(border.down, out, in_border, in_base, width, width)
        copy_blocks(border.corner, out, in_border, in_border, width, width)
        return out

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unknowns that are the base's, their places in it, and unknowns that were added."""
        at = self.border.at
        return (
            self.elements.unknowns(at[at >= 0]),
            self.base.elements.unknowns(np.flatnonzero(at >= 0)),
            self.elements.unknowns(self.border.added),
        )

    def __matmul__(self, w: np.ndarray) -> np.ndarray:
        """S ``w`` (n,) or (n, k)."""
        if self.border is None:
            return self.base.matrix @ w
        inner, places, outer = self._places
        on_base, on_added = np.zeros((self.base.elements.n_unknowns, *w.shape[1:])), w[outer]
        on_base[places] = w[inner]
        out = np.empty_like(w)
        out[inner] = (self.base.matrix @ on_base + self.border.right @ on_added)[places]
        out[outer] = self.border.down @ on_base + self.border.corner @ on_added
        return out

    def factored(self) -> Factor | BorderedFactor:
        """Factors of S. Raises LinAlgError when it is singular."""
        if self.border is None:
            return self.base.factor
        border, base = self.border, self.base
        if self._for_added is None:
            self._for_added = base.factor.solve(np.asfortranarray(border.right))
        known = self._for_added.shape[1]
        if known < border.right.shape[1]:
            more = base.factor.solve(np.asfortranarray(border.right[:, known:]))
            self._for_added = np.concatenate([self._for_added, more], axis=1)
        numbers, columns = self._for_gone
        gone = np.setdiff1d(base.elements.unknowns(np.flatnonzero(border.at < 0)), numbers)
        if len(gone):
            unit = np.zeros((base.elements.n_unknowns, len(gone)), order="F")
            # Tractions of the size of the equations that are given up, so that λ is of the size of jumps.
            unit[gone, np.arange(len(gone))] = np.ldexp(1.0, np.frexp(base.matrix[gone, gone])[1])
            columns = np.concatenate([columns, base.factor.solve(unit)], axis=1)
            self._for_gone = np.concatenate([numbers, gone]), columns
        return BorderedFactor(self, self._for_added, *self._for_gone)


class BorderedFactor:
    """Factors of the `Bordered` matrix ``of``; see `Factor`.

    ``x`` (n_base, m) is S_BB⁻¹ S_BN, ``gone`` (g,) the base's unknowns that are no more and ``for_gone`` (n_base, g) their part
    of X. ``rcond`` is the worse one of the base's and T's, ``loss`` that of accuracy, as the module has it.
    """

    def __init__(self, of: Bordered, x: np.ndarray, gone: np.ndarray, for_gone: np.ndarray):
        border, self._base = of.border, of.base.factor
        self.n, (self._inner, self._places, self._outer) = of.n, of._places
        self._down, self._gone = border.down, gone
        self._x = np.concatenate([x, for_gone], axis=1) if len(gone) else x
        n_added, n = len(self._outer), len(self._outer) + len(gone)
        t = np.empty((n, n), order="F")
        t[:n_added], t[n_added:] = -(border.down @ self._x), -self._x[gone]
        t[:n_added, :n_added] += border.corner
        self._t = Factor(t, SINGULAR)
        self.rcond = min(self._base.rcond, self._t.rcond)
        size = np.abs(border.down).sum(axis=1) / np.abs(t[:n_added]).sum(axis=1)
        across = np.abs(self._x).sum(axis=1)
        self.loss = float(size.max(initial=1.0) * across.max(initial=1.0)) / self._t.rcond

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution for ``right`` (n,) or (n, k), of the ``transposed`` system if asked."""
        shape, n_added = right.shape[1:], len(self._outer)
        on_base = np.zeros((self._base.n, *shape), order="F")
        on_base[self._places] = right[self._inner]
        out, rest = np.empty_like(right), np.zeros((self._t.n, *shape), order="F")
        rest[:n_added] = right[self._outer]
        if transposed:
            w = self._t.solve(rest - self._x.T @ on_base, transposed=True)
            on_base -= self._down.T @ w[:n_added]
            on_base[self._gone] -= w[n_added:]
            first = self._base.solve(on_base, transposed=True)
        else:
            first = self._base.solve(on_base)
            rest[:n_added] -= self._down @ first
            rest[n_added:] = -first[self._gone]
            w = self._t.solve(rest)
            first -= self._x @ w
        out[self._inner], out[self._outer] = first[self._places], w[:n_added]
        return out
