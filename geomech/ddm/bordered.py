"""The crack unknowns' matrix while cracks grow: factored once, then bordered with what is new.

Let B be the elements of which S was factored last, N those that came since and G those of B that are gone. With λ for the
equations of G, which are given up for w_G = 0,

    S_BB w_B + S_BN w_N + I_BG λ = r_B,     S_NB w_B + S_NN w_N = r_N,     w_G = 0.

Eliminating w_B leaves a small matrix T = K − Z R for (w_N, λ), R = (S_BN, I_BG) and Z = (S_NB; I_GB) S_BB⁻¹: a row of Z is
made once and outlasts growth (block elimination; its part for G is Woodbury's formula). Rows, not columns: a tip's element
that becomes an ordinary one has other shape functions and the same collocation points. Elements that come and go between two
increments cost no more than that. A border that has grown wide becomes, with its base, the base of another one.

Block elimination does not pivot between B and the border and loses ‖Z‖ ‖R‖ / ‖T‖ in accuracy over an elimination that
does (Higham 2002, §13.2). S is factored anew where that would be felt, and after some borders upon borders.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .factor import Factor
from .influence import ElementSet, copy_blocks

#: A border as wide as this part of its base, and this many unknowns, becomes part of the base of another one; what is done
#: over and over with a border (copies, T) then stays small.
WIDEST, WIDE = 0.25, 80
#: Borders upon borders, at which all is factored anew: every one takes its share of a solution's time.
DEEPEST = 3
#: Fewer unknowns are factored in less time than a border takes.
SMALLEST = 200
#: Loss of accuracy, ‖Z‖ ‖R‖ / ‖T‖ over the reciprocal condition of T, from which all is factored anew: K then still
#: agrees with that of factors made anew to 1e-10.
LOSS = 1e5
#: What it means when there are no factors.
SINGULAR = "cracks cut a part of the body off"


class Base:
    """``matrix`` (n, n) between crack ``elements``, which may be bordered itself, and its factors, made when first asked
    for."""

    def __init__(self, elements: ElementSet, matrix: np.ndarray | Bordered):
        self.elements, self.matrix = elements, matrix
        self.depth: int = matrix.depth if isinstance(matrix, Bordered) else 0

    @cached_property
    def factor(self) -> Factor | BorderedFactor:
        return self.matrix.factored() if isinstance(self.matrix, Bordered) else Factor(self.matrix, SINGULAR)

    @property
    def unfactored(self) -> bool:
        """Whether asking for factors will make some of a whole matrix."""
        if isinstance(self.matrix, Bordered):
            return self.matrix.base.unfactored
        return "factor" not in vars(self)

    @cached_property
    def dense(self) -> np.ndarray:
        return self.matrix.dense if isinstance(self.matrix, Bordered) else self.matrix


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

    @classmethod
    def none(cls, elements: ElementSet) -> Border:
        n = elements.n_unknowns
        return cls(np.arange(elements.n), np.empty(0, int), np.empty((n, 0)), np.empty((0, n)), np.empty((0, 0)))


class Bordered:
    """S between crack ``elements``, as a ``base`` and a ``border`` (None: it is the base's own matrix)."""

    def __init__(self, elements: ElementSet, base: Base, border: Border | None = None):
        self.elements, self.base, self.border = elements, base, border
        self.n = elements.n_unknowns
        self.depth = base.depth + (border is not None)
        self._known: Eliminated | None = None

    def grown(
        self,
        elements: ElementSet,
        was: np.ndarray,
        seen: np.ndarray,
        compute: Callable[[np.ndarray, np.ndarray], np.ndarray],
    ) -> Bordered:
        """S between ``elements``, of which ``was`` (n,) are the numbers here, −1 where new, and ``seen`` (n,) those of
        elements in their place, whose rows are theirs; ``compute(rows, columns)`` makes blocks of it between elements."""
        kept = was >= 0
        if kept.all() and np.array_equal(was, np.arange(self.elements.n)):
            return self
        if not self._wide:
            return self._changed(elements, was, seen, compute)
        if self.depth == DEEPEST:
            inner, now = Bordered(self.elements, Base(self.elements, self.dense)), was
        else:
            staying = self.elements.take(was[kept])
            base = Base(staying, self._changed(staying, was[kept], was[kept], compute))
            inner, now = Bordered(staying, base), np.where(kept, np.cumsum(kept) - 1, -1)
        return inner._changed(elements, now, now, compute)

    @property
    def _wide(self) -> bool:
        if self.border is None:
            return False
        border, width = self.border, 2 * self.elements.per
        unknowns = width * (len(border.added) + int((border.at < 0).sum()))
        return unknowns > max(WIDEST * self.base.elements.n_unknowns, WIDE)

    def _changed(self, elements: ElementSet, was: np.ndarray, seen: np.ndarray, compute) -> Bordered:
        """As `grown`, on the same base."""
        border = Border.none(self.elements) if self.border is None else self.border
        now = np.full(self.elements.n, -1)
        now[was[was >= 0]] = np.flatnonzero(was >= 0)
        at = np.where(border.at >= 0, now[border.at], -1)
        survives = now[border.added] >= 0
        # Of elements that came before in another kind the rows are in the border: these first.
        place = np.full(self.elements.n + 1, -1)
        place[border.added] = np.arange(len(border.added))
        new = np.flatnonzero(was < 0)
        moved, fresh = new[place[seen[new]] >= 0], new[place[seen[new]] < 0]
        rows = np.concatenate([np.flatnonzero(survives), place[seen[moved]]])
        added = np.concatenate([now[border.added[survives]], moved, fresh])
        columns, rows = (_spread(x, 2 * elements.per) for x in (np.flatnonzero(survives), rows))
        old, k, n, n_base = len(columns), len(rows), elements.per * 2 * len(added), self.base.elements.n_unknowns
        right, down, corner = np.empty((n_base, n), order="F"), np.empty((n, n_base)), np.empty((n, n), order="F")
        right[:, :old], down[:k] = border.right[:, columns], border.down[rows]
        corner[:k, :old] = border.corner[rows[:, None], columns]
        if len(new):
            stays, every = at >= 0, np.arange(elements.n)
            places, numbers = (_spread(x, 2 * elements.per) for x in (np.flatnonzero(stays), at[stays]))
            here = elements.unknowns(added)
            values = compute(every, added[survives.sum() :])
            right[:, old:] = 0.0
            right[places, old:], corner[:, old:] = values[numbers], values[here]
            if len(fresh):
                values = compute(fresh, every)
                down[k:] = 0.0
                down[k:, places], corner[k:, :old] = values[:, numbers], values[:, here[:old]]
        out = Bordered(elements, self.base, Border(at, added, right, down, corner))
        if self._known is not None:
            out._known = self._known.taken(rows, columns)
        return out

    @cached_property
    def dense(self) -> np.ndarray:
        """(n, n) S, column-major."""
        border = self.border
        if border is None:
            return self.base.dense
        in_base, in_border = np.full(self.elements.n, -1), np.full(self.elements.n, -1)
        kept = border.at >= 0
        in_base[border.at[kept]] = np.flatnonzero(kept)
        in_border[border.added] = np.arange(len(border.added))
        out, width = np.empty((self.n, self.n), order="F"), 2 * self.elements.per
        copy_blocks(self.base.dense, out, in_base, in_base, width, width)
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
        known = Eliminated.nothing(self.base) if self._known is None else self._known
        self._known = known.extended(self.base, self.border)
        return BorderedFactor(self, self._known)


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Z and Z R so far: ``z`` (k, n_base) for the first of the added rows and ``zr`` (k, l) from the first of the added
    unknowns; ``gone`` (g,) unknowns of the base, their ``lost`` (g, n_base) rows of S_BB⁻¹ and ``lost_r`` (g, l)."""

    z: np.ndarray
    zr: np.ndarray
    gone: np.ndarray
    lost: np.ndarray
    lost_r: np.ndarray

    @classmethod
    def nothing(cls, base: Base) -> Eliminated:
        n = base.elements.n_unknowns
        return cls(np.empty((0, n)), np.empty((0, 0)), np.empty(0, int), np.empty((0, n)), np.empty((0, 0)))

    def taken(self, rows: np.ndarray, columns: np.ndarray) -> Eliminated:
        """Of the added ``rows`` and ``columns`` those that are known, up to the first that is not: nothing may have been solved
        since they came."""
        k, n = self.zr.shape
        rows = rows[: int(np.argmax(rows >= k))] if (rows >= k).any() else rows
        columns = columns[columns < n]
        z, zr = self.z[rows], self.zr[rows[:, None], columns]
        return Eliminated(z, zr, self.gone, self.lost, self.lost_r[:, columns])

    def extended(self, base: Base, border: Border) -> Eliminated:
        """All that ``border`` has."""
        factor, (k, n), size = base.factor, self.zr.shape, len(border.down)
        new = base.elements.unknowns(np.flatnonzero(border.at < 0))
        new = new[~np.isin(new, self.gone)] if len(new) > len(self.gone) else new[:0]
        # Rows of Z and of the inverse in one go: with a transposed factor.
        right = np.zeros((base.elements.n_unknowns, size - k + len(new)), order="F")
        right[:, : size - k] = border.down[k:].T
        right[new, size - k + np.arange(len(new))] = 1.0
        rows = factor.solve(right, transposed=True).T if right.size else right.T
        z, gone = np.concatenate([self.z, rows[: size - k]]), np.concatenate([self.gone, new])
        lost = np.concatenate([self.lost, rows[size - k :]])
        zr, lost_r = np.empty((size, size), order="F"), np.empty((len(gone), size), order="F")
        zr[:k, :n], lost_r[: len(self.gone), :n] = self.zr, self.lost_r
        zr[:k, n:], zr[k:] = z[:k] @ border.right[:, n:], z[k:] @ border.right
        lost_r[: len(self.gone), n:] = self.lost @ border.right[:, n:]
        lost_r[len(self.gone) :] = rows[size - k :] @ border.right
        return Eliminated(z, zr, gone, lost, lost_r)


class BorderedFactor:
    """Factors of the `Bordered` matrix ``of``; see `Factor`. ``rcond`` is the worst one of T and those of
    the base, ``growth`` the loss of accuracy, as the module has it."""

    def __init__(self, of: Bordered, done: Eliminated):
        border, elements, self._base = of.border, of.base.elements, of.base.factor
        self.n, (self._inner, self._places, self._outer) = of.n, of._places
        self._right, self._done = border.right, done
        length = np.repeat(elements.length, 2 * elements.per)
        # Tractions of the size of the equations that are given up, so that λ is of the size of jumps.
        self._given_up = np.ldexp(1.0, -np.frexp(length[done.gone])[1])
        m, n = len(done.z), len(done.z) + len(done.gone)
        t = np.empty((n, n), order="F")
        t[:m, :m], t[m:, :m] = border.corner - done.zr, -done.lost_r
        t[:m, m:], t[m:, m:] = -done.z[:, done.gone] * self._given_up, -done.lost[:, done.gone] * self._given_up
        self._t = Factor(t, SINGULAR)
        self.rcond = min(self._base.rcond, self._t.rcond)
        # Tractions go with one over an element's length; without that all are of one size.
        own = np.repeat(of.elements.length[border.added], 2 * elements.per)
        size = (length @ np.abs(border.right)) / (own @ np.abs(t[:m, :m]))
        across = (own @ np.abs(done.z) + np.abs(done.lost).sum(axis=0)) / length
        self.growth = float(size.max(initial=1.0) * across.max(initial=1.0)) * getattr(self._base, "growth", 1.0)

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution for ``right`` (n,) or (n, k), of the ``transposed`` system if asked."""
        shape, n_added = right.shape[1:], len(self._outer)
        # Transposed, gathering goes along memory.
        on_base = np.zeros((*shape, self._base.n)).T
        on_base.T[..., self._places] = right.T[..., self._inner]
        out, rest = np.empty((*shape, self.n)).T, np.empty((*shape, self._t.n)).T
        rest.T[..., :n_added] = right.T[..., self._outer]
        done, given_up = self._done, self._given_up.reshape(-1, *[1] * len(shape))
        if transposed:
            first = self._base.solve(on_base, transposed=True)
            rest[:n_added] -= self._right.T @ first
            rest[n_added:] = -given_up * first[done.gone]
            w = self._t.solve(rest, transposed=True)
            first -= done.z.T @ w[:n_added] + done.lost.T @ w[n_added:]
        else:
            rest[:n_added] -= done.z @ on_base
            rest[n_added:] = -(done.lost @ on_base)
            w = self._t.solve(rest)
            on_base -= self._right @ w[:n_added]
            on_base[done.gone] -= given_up * w[n_added:]
            first = self._base.solve(on_base)
        out.T[..., self._inner], out.T[..., self._outer] = first.T[..., self._places], w.T[..., :n_added]
        return out


def _spread(elements: np.ndarray, width: int) -> np.ndarray:
    """Indices of the unknowns of ``elements``."""
    return (elements[:, None] * width + np.arange(width)).ravel()
