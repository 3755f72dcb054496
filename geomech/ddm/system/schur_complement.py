"""Solutions of the crack equations, S w = right, with some unknowns prescribed: used by contact, compliance and
adjoints.

S = A_CC − A_CΓ A_ΓΓ⁻¹ A_ΓC is the Schur complement for slip and opening (`body`). It is factored once for all contact
states: prescribing k unknowns takes a k × k system in columns of S⁻¹. If cracks cut off a part that only closed faces
support, S is singular, and the equations of the free unknowns are factored instead. So they are where many faces of many
unknowns are closed: columns of S⁻¹ for them would take as much memory as S, and each state the factors of k unknowns;
factors of other states give those of the next (`updated_factor`).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..counters import Work
from .bordered_factor import LOSS, SINGULAR, Bordered, BorderedFactor, WholeMatrix
from .closed_face_factor import ClosedFaceFactor
from .contact_rows import Rows
from .dense_lu import Factor
from .updated_factor import BaseOf, ContactBase, UpdatedFactor

#: Reciprocal condition of S below which its inverse is not used for contact.
_SAFE = 1e-11
#: Number of unknowns from which factors of other contact states are reused: the factors of S if less than the fraction
#: MOST_PRESCRIBED of the unknowns is prescribed, otherwise those of other states (`updated_factor`).
WORTHWHILE, MOST_PRESCRIBED = 400, 0.05
#: Number of factorisations kept, each of one set of free unknowns.
_KEPT = 8
#: Number of states whose factors are kept for other states: more than one, as slipping faces and faces that stick
#: during unloading have little in common.
_BASES = 3


AnyFactor = Factor | BorderedFactor | ClosedFaceFactor | UpdatedFactor


class CrackSystem:
    """Solves with S = ``matrix``; factors and columns of S⁻¹ are computed on first use and kept. ``before``: the system
    before the last growth, whose factors are reused; ``was`` (n_elements,): element numbers there, −1 where new."""

    def __init__(
        self,
        matrix: Bordered | WholeMatrix,
        work: Work | None = None,
        before: CrackSystem | None = None,
        was: np.ndarray | None = None,
    ):
        self.matrix: Bordered | WholeMatrix = matrix
        self._work = Work() if work is None else work
        self.n = matrix.n
        grown = [] if before is None or was is None else [base.grown(matrix, was) for base in before.bases]
        #: Factors that contact states are based on, most recently used last.
        self.bases: list[BaseOf] = [base for base in grown if base is not None]
        self._factors: dict[bytes, tuple[np.ndarray, Factor]] = {}
        self._column_at = np.full(self.n, -1)
        self._columns = np.empty((self.n, 0))
        self._prescribed_factor: tuple[bytes, np.ndarray, Factor] | None = None
        self._shut: tuple[bytes, np.ndarray, AnyFactor] | None = None

    def opened(self, right: np.ndarray) -> np.ndarray:
        """S⁻¹ ``right``; zeros if there is no `open_factor`."""
        if self.open_factor is None:
            return np.zeros_like(right)
        self._work.back_substitutions += 1 if right.ndim == 1 else right.shape[1]
        return self.open_factor.solve(np.asfortranarray(right))

    def constrained(
        self, right: np.ndarray, closed: np.ndarray, fixed: np.ndarray, opened: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Jumps w (n,) or (n, k) with w = ``fixed`` where ``closed`` and S w = ``right`` elsewhere, and the reaction
        right − S w in the closed rows. ``opened``: S⁻¹ right, if known.

        Raises LinAlgError when cracks cut off a part that closed faces do not support.
        """
        at = np.flatnonzero(closed)
        if self.by_free_unknowns and len(at) >= MOST_PRESCRIBED * self.n:
            return self._with_free(right, closed, fixed)
        reaction = np.zeros_like(right)
        if self.open_factor is not None:
            w = self.opened(right) if opened is None else opened.copy()
            if len(at):
                columns, factor = self._prescribed_columns(at)
                reaction[at] = factor.solve(w[at] - fixed[at])
                w -= columns @ reaction[at]
                w[at] = fixed[at]
            return w, reaction
        free, factor = self._free_factor(closed)
        w = np.zeros_like(right)
        w[at] = fixed[at]
        w[free] = factor.solve((right - self.matrix @ w)[free])
        self._work.back_substitutions += 1 if right.ndim == 1 else right.shape[1]
        reaction[at] = (right - self.matrix @ w)[at]
        return w, reaction

    @property
    def by_free_unknowns(self) -> bool:
        """Whether solutions with many closed faces do without S⁻¹ times the load."""
        return self.n >= WORTHWHILE

    def _with_free(self, right: np.ndarray, closed: np.ndarray, fixed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `constrained`, by the equations of the unknowns that are free."""
        free, factor = self._held(closed)
        w = np.zeros_like(right, order="F")
        w[closed] = fixed[closed]
        known = right - self.matrix @ w if fixed[closed].any() else right
        w[free] = factor.solve(np.asfortranarray(known[free]))
        self._work.back_substitutions += 1 if right.ndim == 1 else right.shape[1]
        reaction = np.zeros_like(right)
        reaction[closed] = (right - self.matrix @ w)[closed]
        return w, reaction

    def _held(self, closed: np.ndarray) -> tuple[np.ndarray, AnyFactor]:
        """`changed` with the unknowns ``closed`` (n,) bool prescribed; that of the last ones is kept, and factors of open
        faces, if they have not grown, are given up for them."""
        key = closed.tobytes()
        if self._shut is None or self._shut[0] != key:
            none = np.zeros(self.n)
            self._shut = key, *self.changed(Rows(closed, none, none, self.matrix.elements.per))
            self.release_open()
        return self._shut[1:]

    def release_open(self) -> None:
        """Give up factors of open faces, if they have not grown, and columns of their inverse."""
        if isinstance(self.matrix, WholeMatrix) and self.matrix.release():
            vars(self).pop("open_factor", None)
            self._column_at[:] = -1
            self._columns = np.empty((self.n, 0))
            self._prescribed_factor = None

    def retire(self) -> None:
        """Give up the factors of contact states."""
        self.bases, self._factors, self._shut, self._prescribed_factor = [], {}, None, None
        self._column_at[:] = -1
        self._columns = np.empty((self.n, 0))
        self.release_open()

    def changed(self, rows: Rows) -> tuple[np.ndarray, AnyFactor]:
        """Indices of the unknowns that ``rows`` leave free, and factors of their equations."""
        free, moving = np.flatnonzero(~rows.prescribed), np.flatnonzero(rows.mixed)
        if len(free) == self.n and not len(moving) and not rows.spring.any() and self.open_factor is not None:
            return free, self.open_factor
        lasting = self.n >= WORTHWHILE and not rows.spring.any()
        if lasting and self.n - len(free) < MOST_PRESCRIBED * self.n and self.open_factor is not None:
            return free, ClosedFaceFactor(rows, self.open_factor, self, SINGULAR)
        updated = self._updated(rows) if lasting else None
        if updated is not None:
            return free, updated
        matrix = self.matrix.entries(free, free)
        if len(moving):
            at = np.full(self.n, -1)
            at[free] = np.arange(len(free))
            matrix[at[moving]] += rows.mixed[moving, None] * self.matrix.entries(moving + rows.per, free)
        diagonal = np.arange(len(free))
        matrix[diagonal, diagonal] -= rows.spring[free]
        factor = Factor(matrix, SINGULAR, in_place=True)
        self._work.crack_factorisations += 1
        if lasting:
            at = np.full(self.n, -1)
            at[free] = np.arange(len(free))
            self.bases = self.bases[-(_BASES - 1) :]
            self.bases.append(BaseOf(ContactBase(factor, rows.mixed[free]), self.matrix, at, rows.per))
        return free, factor

    def _updated(self, rows: Rows) -> UpdatedFactor | None:
        """Factors updated from those of the most similar state; None if none is similar enough."""
        borders = [base.border(rows) for base in self.bases]
        if not borders:
            return None
        nearest = min(range(len(borders)), key=lambda k: borders[k].n)
        updated = self.bases[nearest].changed(rows, borders[nearest], SINGULAR)
        if updated is not None:
            self.bases.append(self.bases.pop(nearest))
        return updated

    def rcond(self, closed: np.ndarray) -> float:
        """Reciprocal condition of the matrix that is factored when the unknowns ``closed`` (n,) bool are prescribed."""
        if self.by_free_unknowns and np.count_nonzero(closed) >= MOST_PRESCRIBED * self.n:
            return self._held(closed)[1].rcond
        return (self.open_factor or self._free_factor(closed)[1]).rcond

    @cached_property
    def open_factor(self) -> Factor | BorderedFactor | None:
        """Factors of S with all faces open; None if a part of the body is supported by closed faces alone."""
        if isinstance(self.matrix, Bordered):
            try:
                self._work.crack_borderings += 1
                self._work.crack_factorisations += self.matrix.unfactored
                factor = self.matrix.factored()
                if factor.growth < LOSS * factor.rcond:
                    return factor
            except np.linalg.LinAlgError:
                pass
            # Whether S is singular can only be decided with pivoting in the whole matrix.
            self.matrix = Bordered.whole(self.matrix.elements, self.matrix.dense)
        try:
            self._work.crack_factorisations += 1
            whole = self.matrix.factored()
        except np.linalg.LinAlgError:
            return None
        return whole if whole.rcond > _SAFE else None

    def _free_factor(self, closed: np.ndarray) -> tuple[np.ndarray, Factor]:
        """Free unknowns (indices) and factors of S restricted to them."""
        key = np.packbits(closed).tobytes()
        if key not in self._factors:
            if len(self._factors) >= _KEPT:
                self._factors.pop(next(iter(self._factors)))
            free = np.flatnonzero(~closed)
            whole = self.matrix.dense
            matrix = whole if len(free) == len(closed) else whole[np.ix_(free, free)]
            self._factors[key] = free, Factor(matrix, SINGULAR)
            self._work.crack_factorisations += 1
        return self._factors[key]

    def inverse_columns(self, unknowns: np.ndarray) -> np.ndarray:
        """(n, len(unknowns)) columns of S⁻¹, kept for later loads."""
        missing = unknowns[self._column_at[unknowns] < 0]
        if len(missing):
            # Whole elements: several columns take hardly more time than one, and the others will be needed.
            width = 2 * self.matrix.elements.per
            missing = (np.unique(missing // width)[:, None] * width + np.arange(width)).ravel()
            missing = missing[self._column_at[missing] < 0]
            right = np.zeros((self.n, len(missing)), order="F")
            right[missing, np.arange(len(missing))] = 1.0
            self._column_at[missing] = self._columns.shape[1] + np.arange(len(missing))
            self._columns = np.hstack([self._columns, self.opened(right)])
        return self._columns[:, self._column_at[unknowns]]

    def _prescribed_columns(self, at: np.ndarray) -> tuple[np.ndarray, Factor]:
        """Columns ``at`` of S⁻¹ and the factors of their rows ``at``; the last ones are kept, as faces often stay
        closed."""
        key = at.tobytes()
        if self._prescribed_factor is None or self._prescribed_factor[0] != key:
            columns = self.inverse_columns(at)
            factor = Factor(columns[at], "closed faces leave a part of the body unsupported")
            self._prescribed_factor = key, columns, factor
        return self._prescribed_factor[1:]
