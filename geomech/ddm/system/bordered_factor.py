"""Matrix and factors of the crack unknowns while cracks grow: factored once, then bordered by the new unknowns.

Unknowns are kept in order of arrival (`growing_lu`). A body with grown cracks shares matrix and factors with its
predecessor, which stays valid, and computes only the rows and columns of new elements. Elements at tips are replaced in
the next increment: they form a last, temporary border of each body. Their rows are reused, since a tip element that becomes
an ordinary one gets other shape functions but keeps its collocation points. An element removed elsewhere stays in the
matrix, and an additional unknown replaces its equation by w = 0 (Woodbury's formula).

Elimination in order of arrival pivots only within each group. Compared with free pivoting it loses a factor ‖L‖ ‖U‖ /
‖S‖ in accuracy (Higham 2002, §13.2). S is factored again where that loss matters, and after much of it has been
removed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from ..kernels import shape_functions
from .dense_lu import Factor
from .growing_lu import Border, GrowingFactor, Known, loss
from .influence_matrix import ElementSet, unknowns_of

#: Fraction of removed elements above which S is factored again, as they still cost time.
REMOVED = 0.25
#: Several bodies may grow from one in different ways. Each keeps its own unknowns temporary up to this fraction of all;
#: beyond it the shared part is copied.
TEMPORARY = 0.15
#: Number of unknowns below which factoring takes less time than bordering.
SMALLEST_BORDERED = 200
#: Loss of accuracy, ‖L‖ ‖U‖ / ‖S‖ divided by the reciprocal condition, above which S is factored again: at this loss K
#: agrees with that of new factors to 1e-10.
LOSS = 5e6
#: Error text for a singular matrix.
SINGULAR = "cracks separate a part from the body"


class Bordered:
    """S of the crack ``elements``: the first ``n_permanent`` unknowns of the ``permanent`` matrix, followed by a ``temporary``
    border. ``at`` (n_places,): numbers of the elements in this order, −1 for a removed element and for the unknown that
    replaces its equation. Before any growth there is a `WholeMatrix` instead."""

    def __init__(
        self,
        elements: ElementSet,
        permanent: GrowingFactor,
        n_permanent: int,
        at: np.ndarray,
        temporary: Border,
        together: tuple[Border, int] | None = None,
    ):
        self.elements, self.permanent, self.n_permanent, self.at, self.temporary = (
            elements,
            permanent,
            n_permanent,
            at,
            temporary,
        )
        #: The last growth as one border, with the number of its unknowns that became permanent.
        self.together = together
        self.n = elements.n_unknowns
        #: L (transposed) and U of the temporary border, after its elimination.
        self.eliminated: tuple[np.ndarray, np.ndarray] | None = None

    @staticmethod
    def whole(elements: ElementSet, matrix: np.ndarray) -> WholeMatrix:
        """The ``matrix`` (n, n) of the ``elements`` before it grows."""
        return WholeMatrix(elements, matrix)

    is_whole = False

    @property
    def unfactored(self) -> bool:
        """Whether `factored` will have to factor a whole matrix."""
        return self.permanent.unfactored

    def grown(
        self,
        elements: ElementSet,
        was: np.ndarray,
        seen: np.ndarray,
        compute: Callable[[np.ndarray, np.ndarray], np.ndarray],
    ) -> Bordered | WholeMatrix:
        """S of the grown cracks' ``elements``. ``was`` (n,): their numbers here, −1 where new; ``seen`` (n,): numbers
        here of elements at the same place, whose rows are reused; ``compute(rows, columns)`` computes blocks between
        elements."""
        if np.array_equal(was, np.arange(self.elements.n)):
            return self
        out = self._changed(elements, was, seen, compute)
        if np.count_nonzero(out.at < 0) > 2 * REMOVED * elements.n:
            return Bordered.whole(elements, out.dense)
        return out

    def _changed(self, elements: ElementSet, was: np.ndarray, seen: np.ndarray, compute) -> Bordered:
        width = 2 * elements.per
        n_places = self.n_permanent // width
        now = np.full(self.elements.n + 1, -1)  # the last entry is for elements removed earlier
        now[was[was >= 0]] = np.flatnonzero(was >= 0)
        permanent, temporary = now[self.at[:n_places]], self.at[n_places:]
        given_up = np.flatnonzero((self.at[:n_places] >= 0) & (permanent < 0))
        settled = np.zeros(elements.n, bool)
        settled[permanent[permanent >= 0]] = True
        added, at_tip = np.flatnonzero(~settled), _at_tips(elements, settled)
        added = np.concatenate([added[~at_tip[added]], added[at_tip[added]]])
        n_inner = len(added) - int(at_tip[added].sum())
        # Places in the temporary border of unchanged elements (columns) and of elements with the same rows.
        place = np.full(self.elements.n + 1, -1)
        place[temporary] = np.arange(len(temporary))
        column, row = place[was[added]], place[seen[added]]
        border = self._border(elements, added, permanent, row, column, compute)
        names = [elements.keys[k] for k in added[:n_inner].tolist()]
        m = width * n_inner
        base, n = self.permanent, self.n_permanent
        inner, outer = _divided(border, m, self._known(row, column, width, 0, m), self._known(row, column, width, m))
        if given_up.size:
            names += [(place, "given up") for place in given_up.tolist()]
            extra = self._replaced_equations(given_up, n, m)
            inner, outer = _joined(inner, extra), _shifted(outer, len(extra.corner))
        n_new, together = len(inner.corner), None
        if n_new:
            if base.n > n and not base.continues_with(n, n_new, names):
                # Another body has already grown from this one in a different way.
                if width * len(added) < TEMPORARY * n and not given_up.size:
                    inner, outer = _divided(border, 0, None, self._known(row, column, width))
                    names, n_inner, n_new = [], 0, 0
                else:
                    base = base.part(n)
            if base.n == n and n_new:
                base.append(inner, names)
                if not given_up.size:
                    together = border._replace(known=self._known(row, column, width)), n_new
        at = np.concatenate([permanent, added[:n_inner], np.full(len(given_up), -1), added[n_inner:]])
        return Bordered(elements, base, n + n_new, at, outer, together)

    def _border(self, elements, added, permanent, row, column, compute) -> Border:
        """Border of the new elements ``came`` (k,) to those at the places ``permanent``. ``row`` and ``column`` (k,): places
        in the temporary border that their rows and columns are copied from, −1 where these are computed."""
        width = 2 * elements.per
        every, (old, fresh) = np.arange(elements.n), (np.flatnonzero(row >= 0), np.flatnonzero(row < 0))
        old_c, new_c = np.flatnonzero(column >= 0), np.flatnonzero(column < 0)
        gone, numbers, here = (
            np.flatnonzero(permanent < 0),
            unknowns_of(np.maximum(permanent, 0), width),
            unknowns_of(added, width),
        )
        k, n = width * len(added), width * len(permanent)
        down, right, corner = np.empty((n, k), order="F").T, np.empty((k, n)).T, np.empty((k, k), order="F")
        r_old, r_fresh, c_old, c_new = (unknowns_of(x, width) for x in (old, fresh, old_c, new_c))
        if len(old):
            from_r, from_c = unknowns_of(row[old], width), unknowns_of(column[old_c], width)
            down[r_old], right.T[c_old] = self.temporary.down[from_r], self.temporary.right.T[from_c]
            corner[np.ix_(r_old, c_old)] = self.temporary.corner[np.ix_(from_r, from_c)]
        if len(new_c):
            values = compute(every, added[new_c])
            # Column-major: transposed, copying runs along memory.
            right.T[c_new] = values.T[:, numbers]
            corner[:, c_new] = values[here]
        if len(fresh):
            values = compute(added[fresh], every)
            down[r_fresh] = values[:, numbers]
            corner[np.ix_(r_fresh, c_old)] = values[:, here[c_old]]
        if len(gone):
            away = unknowns_of(gone, width)
            down[:, away], right[away] = 0.0, 0.0
        scale = np.repeat(np.ldexp(1.0, np.frexp(elements.length[added])[1]), width)
        return Border(down, right, corner, scale, None)

    def _known(self, row: np.ndarray, column: np.ndarray, width: int, first: int = 0, end: int | None = None):
        """Factors that are already known of the elements at ``row`` and ``column`` of the eliminated temporary border, for
        the unknowns from ``first`` to ``end``."""
        if self.eliminated is None:
            return None
        row, column = (x[first // width : None if end is None else end // width] for x in (row, column))
        r, c = np.flatnonzero(row >= 0), np.flatnonzero(column >= 0)
        at = [unknowns_of(x, width) for x in (r, row[r], c, column[c])]
        lower, upper = self.eliminated
        return Known(at[0], at[1], lower, at[2], at[3], upper)

    def _replaced_equations(self, places: np.ndarray, n: int, n_between: int) -> Border:
        """Border of the unknowns that replace the equations of the elements at ``places`` by w = 0. They follow ``n`` +
        ``n_between`` others and are scaled to the size of jumps."""
        width = 2 * self.elements.per
        at = unknowns_of(places, width)
        k = len(at)
        down, right = np.zeros((k, n + n_between)), np.zeros((n + n_between, k))
        length = np.repeat(self.elements.length[self.at[places]], width)
        down[np.arange(k), at], right[at, np.arange(k)] = 1.0, np.ldexp(1.0, -np.frexp(length)[1])
        return Border(down, right, np.zeros((k, k)), np.ones(k), None)

    @cached_property
    def places(self) -> np.ndarray:
        """(n_unknowns,) places of the unknowns in order of arrival."""
        out, there = np.empty(self.elements.n, int), np.flatnonzero(self.at >= 0)
        out[self.at[there]] = there
        return unknowns_of(out, 2 * self.elements.per)

    @cached_property
    def dense(self) -> np.ndarray:
        """(n, n) S."""
        n, k = self.n_permanent, len(self.temporary.corner)
        out = np.empty((n + k, n + k), order="F")
        out[:n, :n], out[n:, :n], out[:n, n:], out[n:, n:] = self.permanent.matrix(n), *self.temporary[:3]
        return out.T[np.ix_(self.places, self.places)].T

    def entries(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """(len(rows), len(columns)) of S, column-major."""
        if "dense" in vars(self):
            return _entries(self.dense, rows, columns)
        n, permanent = self.n_permanent, self.permanent.matrix(self.n_permanent)
        r, c = self.places[rows], self.places[columns]
        out = np.empty((len(r), len(c)), order="F")
        up, down, left, right = r < n, r >= n, c < n, c >= n
        for at, across, part in (
            (up, left, permanent), (down, left, self.temporary.down), (up, right, self.temporary.right), (down, right, self.temporary.corner)
        ):  # fmt: skip
            i, j = r[at] - n * (at is down), c[across] - n * (across is right)
            out.T[np.ix_(across, at)] = _entries(part, i, j).T
        return out

    def __matmul__(self, w: np.ndarray) -> np.ndarray:
        """S ``w`` (n,) or (n, k)."""
        if "dense" in vars(self):
            return self.dense @ w
        n, x = self.n_permanent, np.zeros((self.n_permanent + len(self.temporary.corner), *w.shape[1:]))
        x[self.places] = w
        first, last = x[:n], x[n:]
        above = self.permanent.matrix(n) @ first + self.temporary.right @ last
        return np.concatenate([above, self.temporary.down @ first + self.temporary.corner @ last])[self.places]

    def factored(self) -> BorderedFactor:
        """Factors of S. Raises LinAlgError when it is singular."""
        return BorderedFactor(self)


class WholeMatrix:
    """The ``matrix`` (n, n) of crack ``elements`` before any growth; interface of `Bordered`."""

    is_whole = True

    def __init__(self, elements: ElementSet, matrix: np.ndarray):
        self.elements, self.dense, self.n = elements, matrix, elements.n_unknowns
        self._factor: Factor | None = None
        self._grown: Bordered | None = None

    @property
    def unfactored(self) -> bool:
        return self._factor is None

    def grown(self, elements: ElementSet, was: np.ndarray, seen: np.ndarray, compute) -> Bordered | WholeMatrix:
        """See `Bordered.grown`."""
        if np.array_equal(was, np.arange(self.elements.n)):
            return self
        if self._grown is None:
            known = self._factor if self._factor is not None and self._factor.columns else None
            permanent, n = GrowingFactor(self.dense, list(self.elements.keys), known), self.n
            none = Border(np.empty((0, n)), np.empty((n, 0)), np.empty((0, 0)), np.empty(0), None)
            self._grown = Bordered(self.elements, permanent, n, np.arange(self.elements.n), none)
        return self._grown.grown(elements, was, seen, compute)

    def release(self) -> bool:
        """Give up the factors, unless cracks have grown from here; returns whether they were given up."""
        if self._factor is None or self._grown is not None:
            return False
        self._factor = None
        return True

    def entries(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """See `Bordered.entries`."""
        return _entries(self.dense, rows, columns)

    def __matmul__(self, w: np.ndarray) -> np.ndarray:
        return self.dense @ w

    def factored(self) -> Factor:
        """See `Bordered.factored`."""
        if self._factor is None:
            self._factor = Factor(self.dense, SINGULAR)
        return self._factor


class BorderedFactor:
    """Factors of the `Bordered` matrix ``of``, with the interface of `Factor`. ``rcond``: smallest of the diagonal
    blocks; ``growth``: the loss of accuracy described at the top."""

    def __init__(self, of: Bordered):
        self.n, self._places, self._permanent, self._n_permanent = of.n, of.places, of.permanent, of.n_permanent
        permanent, n = of.permanent, of.n_permanent
        border, m = of.together or (None, 0)
        if border is not None and m and permanent.is_next(n - m, m):
            # Both in one solution: forty columns take hardly more time than twenty.
            self._lower, self._upper, t = permanent.eliminate_next(n - m, border, m, SINGULAR)
            self.rcond, self.growth = permanent.eliminate(n, SINGULAR)
        else:
            self.rcond, self.growth = permanent.eliminate(n, SINGULAR)
            self._lower, self._upper, t = permanent.eliminate_border(n, of.temporary)
        self._scale, self._t = of.temporary.scale, Factor(t, SINGULAR)
        self.rcond = min(self.rcond, self._t.rcond)
        self.growth = max(self.growth, loss(self._lower, self._upper, t))
        of.eliminated, of.together, of.temporary = (self._lower, self._upper), None, of.temporary._replace(known=None)

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution for ``right`` (n,) or (n, k), of the ``transposed`` system if asked."""
        n = self._n_permanent
        # Transposed, so that indexing runs along memory.
        x = np.zeros((*right.shape[1:], n + len(self._scale))).T
        x.T[..., self._places] = right.T
        off_diagonal, below = (self._lower, self._upper) if transposed else (self._upper, self._lower)
        scale = self._scale if right.ndim == 1 else self._scale[:, None]
        y = self._permanent.forward_substitution(n, x[:n], transposed)
        last = self._t.solve((x[n:] if transposed else x[n:] * scale) - below.T @ y, transposed)
        x[:n] = self._permanent.back_substitution(n, y - off_diagonal @ last, transposed)
        x[n:] = last * scale if transposed else last
        return x.T[..., self._places].T


def _entries(matrix: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """``matrix[rows, columns]``, column-major, indexed along memory."""
    if matrix.flags.f_contiguous or matrix.strides[0] < matrix.strides[1]:
        return matrix.T[np.ix_(columns, rows)].T
    return np.asfortranarray(matrix[np.ix_(rows, columns)])


def _at_tips(elements: ElementSet, settled: np.ndarray) -> np.ndarray:
    """(n,) bool: elements on segments that end at a tip and have no ``settled`` element. Growth may still bend these
    segments and regrade them."""
    source = elements.source
    ends, stands = np.zeros((2, int(source.max(initial=0)) + 1), bool)
    ends[source[elements.kind != shape_functions.ORDINARY]], stands[source[settled]] = True, True
    return (ends & ~stands)[source]


def _divided(border: Border, m: int, known: Known | None, known_after: Known | None) -> tuple[Border, Border]:
    """The ``border`` divided into its first ``m`` unknowns and the rest, with what is ``known`` of their factors."""
    down, right, corner, scale, _ = border
    return (
        Border(down[:m], right[:, :m], corner[:m, :m], scale[:m], known),
        Border(
            np.concatenate([down[m:], corner[m:, :m]], axis=1),
            np.concatenate([right[:, m:].T, corner[:m, m:].T], axis=1).T,
            corner[m:, m:],
            scale[m:],
            known_after,
        ),
    )


def _joined(border: Border, other: Border) -> Border:
    """One border of the unknowns of ``border`` and then those of ``other``."""
    n = border.down.shape[1]
    return Border(
        np.concatenate([border.down, other.down[:, :n]]),
        np.concatenate([border.right, other.right[:n]], axis=1),
        np.block([[border.corner, other.right[n:]], [other.down[:, n:], other.corner]]),
        np.concatenate([border.scale, other.scale]),
        border.known,
    )


def _shifted(border: Border, k: int) -> Border:
    """The ``border`` placed after ``k`` more unknowns, which it is not coupled to."""
    nothing = np.zeros((len(border.corner), k))
    return border._replace(
        down=np.concatenate([border.down, nothing], axis=1), right=np.concatenate([border.right, nothing.T])
    )
