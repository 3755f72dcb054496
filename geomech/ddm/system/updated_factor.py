"""Equations of crack faces in contact, solved with the factors of another contact state or of cracks before growth.

Let A₀ be the equations of the free unknowns in one contact state on one geometry, factored once. In another state, or
after growth, a few unknowns and equations differ. With the unknowns x of A₀ and additional ones y,

    [[A₀, B], [C, D]] (x, y) = (f, g),      T = D − C Z,   Z = A₀⁻¹ B,
    T y = g − C A₀⁻¹ f,                      x = A₀⁻¹ f − Z y                    (block elimination; Golub & Van Loan §3.2),

where y holds (1) the unknowns that A₀ lacks (their columns are in B, their rows in C); (2) one multiplier for each
unknown of A₀ that is now constrained or removed (unit column: its equation is given up; unit row: x = 0); (3) one
multiplier for each equation that changes because a node slides in another direction (unit column, the new row). Columns
of Z are kept for other states and loads and, for elements that remain, other geometries. A new state then takes a
factorisation of the size of y and a few solutions with A₀, instead of a factorisation of all unknowns.
"""

from __future__ import annotations

import numpy as np

from .bordered_factor import Bordered, WholeMatrix
from .contact_rows import Rows
from .dense_lu import Factor
from .influence_matrix import unknowns_of

#: A new base is factored when the border would have more unknowns than FEW and than the fraction MOST_NEW of the base.
MOST_NEW, FEW = 0.2, 40
#: Reciprocal condition of T below which the whole matrix is factored again.
TRUSTED = 1e-11


class ContactBase:
    """The ``factor`` of A₀ (n_base equations) with the columns of its inverse that have been used. ``mixed`` (n_base,):
    factor by which a node's normal equation is added to its tangential one (friction)."""

    def __init__(self, factor: Factor, mixed: np.ndarray):
        self.factor, self.mixed, self.n = factor, mixed, factor.n
        self._units = _Columns(self.n)

    def units(self, at: np.ndarray) -> np.ndarray:
        """(n_base, k) columns ``at`` (k,) of the inverse."""

        def make(missing):
            right = np.zeros((self.n, len(missing)), order="F")
            right[missing, np.arange(len(missing))] = 1.0
            return self.factor.solve(right)

        return self._units.of(at, make)


class BaseOf:
    """A ``base`` with the numbering of the crack system ``matrix``: ``at`` (n,) is each unknown's place in the base, −1
    where it has none; ``per`` nodes per element."""

    def __init__(self, base: ContactBase, matrix: Bordered | WholeMatrix, at: np.ndarray, per: int):
        self.base, self.matrix, self.at, self.per = base, matrix, at, per
        self._new_columns = _Columns(base.n)

    def grown(self, matrix: Bordered | WholeMatrix, was: np.ndarray) -> BaseOf | None:
        """The same base for the ``matrix`` of grown cracks; ``was`` (n_elements,): previous numbers of its elements, −1
        where new. None if too few remain."""
        width = 2 * self.per
        old, new = unknowns_of(was[was >= 0], width), unknowns_of(np.flatnonzero(was >= 0), width)
        at = np.full(matrix.n, -1)
        at[new] = self.at[old]
        if self.base.n - np.count_nonzero(at >= 0) > most_changed(self.base.n):
            return None
        out = BaseOf(self.base, matrix, at, self.per)
        out._new_columns = self._new_columns.renumbered(old, new)
        return out

    def border(self, rows: Rows) -> Border:
        """The differences between the equations that ``rows`` (without springs) leave and those of the base."""
        return Border(self, rows)

    def changed(self, rows: Rows, border: Border, what: str) -> UpdatedFactor | None:
        """Factors of the equations with this ``border``; None if it is too large or too badly conditioned."""
        if border.n > most_changed(self.base.n):
            return None
        try:
            factor = UpdatedFactor(self, border, rows, what)
        except np.linalg.LinAlgError:
            return None
        return factor if factor.trusted else None

    def new_columns(self, unknowns: np.ndarray) -> np.ndarray:
        """(n_base, k) A₀⁻¹ times the columns of ``unknowns`` (k,) that the base lacks."""

        def make(missing):
            there = np.flatnonzero(self.at >= 0)
            place = self.at[there]
            right = np.zeros((self.base.n, len(missing)), order="F")
            right[place] = self.matrix.entries(there, missing)
            mixed = self.base.mixed[place]
            slides = np.flatnonzero(mixed)
            right[place[slides]] += mixed[slides, None] * self.matrix.entries(there[slides] + self.per, missing)
            return self.base.factor.solve(right)

        return self._new_columns.of(unknowns, make)


class Border:
    """Differences from the base: ``new`` unknowns (numbers in the crack system); places ``removed`` in the base whose
    unknown is now constrained or does not exist any more; unknowns ``changed`` whose equation differs."""

    def __init__(self, of: BaseOf, rows: Rows):
        free = ~rows.prescribed
        known = free & (of.at >= 0)
        self.free, self.kept = np.flatnonzero(free), np.flatnonzero(known)
        self.places = of.at[self.kept]
        self.new = np.flatnonzero(free & (of.at < 0))
        stays = np.zeros(of.base.n, bool)
        stays[self.places] = True
        self.removed = np.flatnonzero(~stays)
        self.changed = self.kept[rows.mixed[self.kept] != of.base.mixed[self.places]]
        self.n = len(self.new) + len(self.removed) + len(self.changed)


class UpdatedFactor:
    """Solves the equations of the free unknowns that ``rows`` leave, with the interface of `Factor`."""

    def __init__(self, of: BaseOf, border: Border, rows: Rows, what: str):
        base, matrix = of.base, of.matrix
        self._base, self._border = base.factor, border
        self._changed = of.at[border.changed]
        new, own = border.new, np.concatenate([border.new, border.changed])
        self._z = np.concatenate(
            [of.new_columns(new), base.units(border.removed), base.units(self._changed)], axis=1
        )  # (n_base, n_border)
        # Rows of new and changed equations, for kept and new unknowns.
        every = np.concatenate([border.kept, new])
        values = matrix.entries(own, every)
        slides = np.flatnonzero(rows.mixed[own])
        if len(slides):
            across = own[slides] + of.per
            values[slides] += rows.mixed[own[slides], None] * matrix.entries(across, every)
        self._down = np.zeros((len(own), base.n))
        self._down[:, border.places] = values[:, : len(border.kept)]
        a = len(new)
        of_new, _, of_changed = self._parts
        t = -self._times(self._z)
        t[of_new, :a] += values[:a, len(border.kept) :]
        t[of_changed, :a] += values[a:, len(border.kept) :]
        size = np.abs(t).max(axis=0, initial=0.0)
        self._scale = np.ldexp(1.0, -np.frexp(np.where(size > 0, size, 1.0))[1])
        self._small = Factor(t * self._scale, what)
        self.n, self.rcond = len(border.free), min(base.factor.rcond, self._small.rcond)
        self._new_at = np.searchsorted(border.free, new)
        self._kept_at = np.searchsorted(border.free, border.kept)
        self._changed_at = np.searchsorted(border.free, border.changed)

    @property
    def trusted(self) -> bool:
        """Whether T is conditioned well enough."""
        return self._small.rcond > TRUSTED

    @property
    def _parts(self) -> tuple[slice, slice, slice]:
        """Rows of the border of new unknowns, removed unknowns and changed equations."""
        a, g = len(self._border.new), len(self._border.removed)
        return slice(a), slice(a, a + g), slice(a + g, self._border.n)

    def _times(self, x: np.ndarray) -> np.ndarray:
        """C ``x``, (n_border, k) for (n_base, k)."""
        of, a = self._down @ x, self._parts[0].stop
        return np.concatenate([of[:a], x[self._border.removed], of[a:]])

    def _times_transposed(self, y: np.ndarray) -> np.ndarray:
        """Cᵀ ``y``."""
        new, removed, changed = self._parts
        out = self._down.T @ np.concatenate([y[new], y[changed]])
        out[self._border.removed] += y[removed]
        return out

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution (n_free,) or (n_free, k) for ``right``, of the ``transposed`` system if asked."""
        flat = right.ndim == 1
        right = right[:, None] if flat else right
        f = np.zeros((self._base.n, right.shape[1]), order="F")
        g = np.zeros((self._border.n, right.shape[1]), order="F")
        new, _, changed = self._parts
        f[self._border.places], g[new] = right[self._kept_at], right[self._new_at]
        scale = self._scale[:, None]
        out = np.empty_like(right)
        if not transposed:
            f[self._changed], g[changed] = 0.0, right[self._changed_at]
            x = self._base.solve(f)
            y = scale * self._small.solve(g - self._times(x))
            x -= self._z @ y
        else:
            y = self._small.solve(scale * (g - self._z.T @ f), transposed=True)
            x = self._base.solve(f - self._times_transposed(y), transposed=True)
        out[self._kept_at], out[self._new_at] = x[self._border.places], y[new]
        if transposed:
            out[self._changed_at] = y[changed]
        return out[:, 0] if flat else out


class _Columns:
    """A cache of columns (n,), each with a number, computed on first use."""

    def __init__(self, n: int):
        self.n, self._values = n, np.empty((n, 0), order="F")
        self._at: dict[int, int] = {}

    def of(self, numbers: np.ndarray, make) -> np.ndarray:
        """(n, k) columns ``numbers`` (k,); ``make(missing)`` computes the missing ones."""
        missing = np.array([k for k in numbers.tolist() if k not in self._at], dtype=int)
        if len(missing):
            first, end = len(self._at), len(self._at) + len(missing)
            if end > self._values.shape[1]:
                room = np.empty((self.n, 2 * end), order="F")
                room[:, :first] = self._values[:, :first]
                self._values = room
            self._values[:, first:end] = make(missing)
            self._at.update(zip(missing.tolist(), range(first, end)))
        return self._values[:, [self._at[k] for k in numbers.tolist()]]

    def renumbered(self, old: np.ndarray, new: np.ndarray) -> _Columns:
        """A cache of the columns ``old`` (k,) alone, under the numbers ``new`` (k,)."""
        out, names = _Columns(self.n), dict(zip(old.tolist(), new.tolist()))
        kept = [(names[k], at) for k, at in self._at.items() if k in names]
        out._at = {k: j for j, (k, _) in enumerate(kept)}
        out._values = np.asfortranarray(self._values[:, [at for _, at in kept]])
        return out

    def __getstate__(self) -> dict:
        """Without the uninitialised capacity."""
        return vars(self) | {"_values": self._values[:, : len(self._at)].copy(order="F")}


def most_changed(n: int) -> float:
    """Largest border of a base with ``n`` unknowns."""
    return max(FEW, MOST_NEW * n)
