"""Solution of a sequence of 6×6-block systems, each with only the work that its difference from the last one needs.

Where springs have changed since the last factorisation, only the fronts of their blocks and those above are eliminated
again; where blocks have hardly moved, none. Reused or single-precision factors precondition conjugate residuals
(`conjugate_residuals`), which reduce the residual to round-off.

Chosen by measurement, on the last equations of walls of 990 and 10 010 bricks under sudden weight (one core,
factorisation and substitution, ms): these factors 7.2 + 0.4 and 194 + 7, in single precision 4.2 + 0.2 and 102 + 3.6;
PARDISO of MKL 2026 11 to 19 + 6 and 245 to 478 + 61; an incomplete factorisation with GMRES 234 and 5400; smoothed
aggregation (pyamg 5, six fields an aggregate) and block Jacobi do not reach 1e-10 in 500 iterations.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ...compiled import UNCOUNTED, kept
from ..counters import Work
from .conjugate_residuals import Directions
from .multifrontal import Factors
from .nested_dissection import KEPT, Tree
from .task_pool import SHARE, THREADED, add_at_once, await_value, thread_team

_jit = kept(fastmath=False, error_model="numpy", nogil=True)

#: Largest residual, relative to the largest force in the right-hand side (at rest it is 3e-8 of the largest force in
#: the system, from the rounding of coordinates times stiff springs), …
RESIDUAL = 1e-12
#: … or relative to the largest Σ|A||x| of a row: round-off.
ROUND_OFF = 2e-15
#: Residuals above this are hardly ever round-off.
COARSE = 1e-6
#: Largest number of refinements of a solution.
REFINEMENTS = 3
#: A 6×6 diagonal block counts as changed when an entry differs by more than this fraction of the largest diagonal one:
#: the error from stiff springs stays below the inertia that balances them (measured: 1e-3 takes twice the time at dt =
#: 1 ms).
CHANGED = 1e-6
#: Largest number of solutions in a cycle of conjugate residuals.
TRIES = 16
#: If a cycle with single-precision factors reduces the residual by this factor, another follows, up to this number:
#: cheaper than double factors up to 54 solutions (a slope of 107 720 blocks, 2.5 ms: eight decades in the first
#: sixteen).
FALLS, CYCLES = 1e-3, 4
#: Fraction of changed blocks from which the next matrix is expected to change as much.
MOSTLY = 0.9
#: Where fronts cannot be eliminated one by one, factors are reused if no more than this many blocks differ: with 100
#: 000 bricks they cost 27 substitutions, and ten scattered contacts cost 7 to 19 more conjugate residuals; most of
#: these.
FEW, TRIES_OF_FEW = 30, 24
#: Number of free blocks from which factors are in single precision: half the memory, and three quarters of the time on
#: walls of 10 000 bricks, although a solution takes two substitutions more; equally fast for 1 000.
SINGLE = 4000
#: Number of free blocks from which the factors of rough solutions are in single precision. With fewer it saves some tenths
#: of a millisecond each (0.12 ms with 80 blocks, 0.6 ms with 200), and kernels for single precision take a tenth of the
#: first run's compiling.
SINGLE_ROUGH = 150


@kept(fastmath={"reassoc", "contract", "nsz"}, error_model="numpy", nogil=True, **UNCOUNTED)
def _multiply_rows(first, last, data, pointer, columns, x, out):
    """A x for the rows of 6×6 blocks from ``first`` to before ``last``. (Written out, since only whole sums of six
    become vector instructions: four times as fast as loops.)"""
    for i in range(first, last):
        s0 = s1 = s2 = s3 = s4 = s5 = 0.0
        for k in range(pointer[i], pointer[i + 1]):
            b, at = data[36 * k : 36 * k + 36], 6 * columns[k]
            v0, v1, v2, v3, v4, v5 = x[at], x[at + 1], x[at + 2], x[at + 3], x[at + 4], x[at + 5]
            s0 += b[0] * v0 + b[1] * v1 + b[2] * v2 + b[3] * v3 + b[4] * v4 + b[5] * v5
            s1 += b[6] * v0 + b[7] * v1 + b[8] * v2 + b[9] * v3 + b[10] * v4 + b[11] * v5
            s2 += b[12] * v0 + b[13] * v1 + b[14] * v2 + b[15] * v3 + b[16] * v4 + b[17] * v5
            s3 += b[18] * v0 + b[19] * v1 + b[20] * v2 + b[21] * v3 + b[22] * v4 + b[23] * v5
            s4 += b[24] * v0 + b[25] * v1 + b[26] * v2 + b[27] * v3 + b[28] * v4 + b[29] * v5
            s5 += b[30] * v0 + b[31] * v1 + b[32] * v2 + b[33] * v3 + b[34] * v4 + b[35] * v5
        result = out[6 * i : 6 * i + 6]
        result[0], result[1], result[2], result[3], result[4], result[5] = s0, s1, s2, s3, s4, s5


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _multiply_shared(claimed, done, share, data, pointer, columns, x, out):
    """The rows of ``share`` blocks at a time, shared with other threads; ``claimed`` and ``done`` (1,) as for the
    elimination of fronts."""
    n = len(pointer) - 1
    shares = (n + share - 1) // share
    while True:
        q = add_at_once(claimed, 0, 1)
        if q >= shares:
            break
        _multiply_rows(q * share, min(n, (q + 1) * share), data, pointer, columns, x, out)
        add_at_once(done, 0, 1)
    await_value(done, 0, shares)


def multiply(data: np.ndarray, pointer: np.ndarray, columns: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A x for 6×6 blocks stored row by row; large systems on all cores, with the same result bit for bit."""
    out = np.empty(6 * (len(pointer) - 1))
    given = data, pointer, columns, x, out
    if len(pointer) <= THREADED:
        _multiply_rows(0, len(pointer) - 1, *given)
    else:
        thread_team().share(_multiply_shared, np.zeros(1, np.int64), np.zeros(1, np.int64), SHARE, *given)
    return out


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def largest_terms(data, pointer, columns, x):
    """The largest Σ|A||x| of a row."""
    size = 0.0
    for i in range(len(pointer) - 1):
        for a in range(6):
            absolute = 0.0
            for k in range(pointer[i], pointer[i + 1]):
                for c in range(6):
                    absolute += abs(data[36 * k + 6 * a + c] * x[6 * columns[k] + c])
            size = max(size, absolute)
    return size


@_jit
def _changed(data, diagonal, factored, tolerance):
    """(n,) bool: diagonal blocks of ``data`` that differ from those ``factored`` (n, 36) by more than the
    ``tolerance``, relative to the largest entry of their diagonal."""
    n = len(diagonal)
    out = np.zeros(n, np.bool_)
    for b in range(n):
        here, size = data[36 * diagonal[b] : 36 * diagonal[b] + 36], 0.0
        for k in range(0, 36, 7):
            size = max(size, abs(here[k]))
        for k in range(36):
            # (A NaN counts as changed.)
            if not abs(here[k] - factored[b, k]) <= tolerance * size:
                out[b] = True
                break
    return out


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _take(data, diagonal, changed, factored):
    """Copy the ``changed`` diagonal blocks of ``data`` to ``factored`` (n, 36)."""
    for b in range(len(diagonal)):
        if changed[b]:
            given, taken = data[36 * diagonal[b] : 36 * diagonal[b] + 36], factored[b]
            for k in range(36):
                taken[k] = given[k]


class BlockSolver:
    """Solves A x = b for one pattern of 6×6 blocks and matrices that change from time to time.

    ``points`` (n, 2) m: positions of the blocks; ``rows`` and ``columns`` (n_entries,) of the matrix blocks, both
    triangles and the diagonal, sorted by row, then column. The order of elimination is internal, or that of a ``tree``
    planned for the same pattern. ``single``: number of blocks from which factors are in single precision, else `SINGLE`. ``counts``:
    operations of this solver; ``work``: counters shared with other solvers.
    ``single_only``: a matrix that single-precision factors cannot solve is given up, not factored in double.
    """

    def __init__(
        self, points: np.ndarray, rows: np.ndarray, columns: np.ndarray, tree: Tree | None = None,
        single: int | None = None,
    ):  # fmt: skip
        self.n, self._single_from = len(points), SINGLE if single is None else single
        self.keys = rows * self.n + columns
        self.pointer, self.columns = np.searchsorted(rows, np.arange(self.n + 1)), columns
        self._diagonal = np.flatnonzero(rows == columns)
        self._pattern = points, rows, columns
        self._factors = Factors(points, rows, columns, np.float32 if self.n >= self._single_from else np.float64, tree)
        self._factored = np.empty((self.n, 36))
        self._has_factors = False
        self._rough: Factors | None = None
        self._alternate: BlockSolver | None = None
        self._rough_serves, self.single_only = True, False
        self._make_room_for_directions()
        #: Largest entry of the residual of the last solution.
        self.left = 0.0
        #: (6n,) the residual, where it is known.
        self.rest: np.ndarray | None = None
        self._product: Callable[[np.ndarray], np.ndarray] | None = None
        #: ``shares``: number of factorisations, partial ones counted by their share.
        self.work = Work()
        self.counts = {"factorisations": 0, "shares": 0.0, "substitutions": 0}

    @property
    def points(self) -> np.ndarray:
        """(n, 2) m: positions of the blocks."""
        return self._pattern[0]

    @property
    def in_parts(self) -> bool:
        """Whether a matrix with few changed blocks is refactored for a fraction of the cost."""
        return self._factors.tree.kept

    @property
    def alternate(self) -> BlockSolver:
        """A second solver of the same pattern, for matrices of another kind that alternate with this one's, so that
        each is refactored in part. This solver itself where partial factorisation is not available, or for so many
        blocks that two would take too much memory: two of 50 000 take 3 GB, and without the second one steps that stop
        blocks take 4 % longer."""
        if not self.in_parts or 2 * self._factors.tree.own_room_size > KEPT:
            return self
        if self._alternate is None:
            self._alternate = BlockSolver(*self._pattern, self._factors.tree, self._single_from)
            self._alternate.work, self._alternate.counts = self.work, self.counts
        return self._alternate

    def _make_room_for_directions(self) -> None:
        """Directions of coarse solutions, kept until the next matrix. For so many blocks that these use other factors,
        both share the idle memory of the factorisation: for 100 000 blocks they would take 400 MB."""
        size, most, many = 6 * self.n, max(TRIES, TRIES_OF_FEW), self.n >= SINGLE
        idle = self._factors.idle_room
        self._directions = Directions(size, most, room=idle if many and len(idle) >= 2 * most * size else None)
        self._shown = Directions(size, TRIES, self._directions if many else None)

    def holds(self, keys: np.ndarray) -> bool:
        """Whether the pattern has the blocks ``keys`` = row · n + column."""
        return bool((self.keys[self.entry(keys) % len(self.keys)] == keys).all())

    def entry(self, keys: np.ndarray) -> np.ndarray:
        """The number of each of the matrix blocks ``keys``."""
        return np.searchsorted(self.keys, keys)

    def solve(
        self, data: np.ndarray, right: np.ndarray, within: float = RESIDUAL, force: float = 0.0,
        near: np.ndarray | None = None, rest: np.ndarray | None = None,
        product: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        """x (6n,) for the blocks ``data`` (36 n_entries,), each row by row. The residual is below ``within`` times
        ``right`` (or a larger ``force`` that others balance in it), or is round-off. ``near`` (6n,): a known
        approximation of x; ``rest`` (6n,): its residual, if it is known: that of x is then not computed again but
        carried along. ``product``: function that multiplies with the matrix, if there is a faster one. Raises
        numpy.linalg.LinAlgError."""
        self.rest, self._product = None, product
        largest = float(np.abs(right).max(initial=0.0))
        target = within * max(force, largest)
        if largest > 0.0:
            within = target / largest
        if self._factors.single:
            try:
                x = self._solved(data, right, within, target, (near, rest))
            except np.linalg.LinAlgError:
                x = None
            if x is not None:
                return x
            # Not solvable in single precision, as for many contact states that are far from the right ones.
            self._go_on_in_double()
        x = self._solved(data, right, within, target, (near, rest))
        assert x is not None  # in double precision there is always an answer, or an error
        return x

    def _go_on_in_double(self) -> None:
        """Continue with double-precision factors; raises numpy.linalg.LinAlgError if these are not wanted."""
        if self.single_only:
            raise np.linalg.LinAlgError("the block system is beyond single precision")
        self._hold(np.float64)

    def _hold(self, dtype: type) -> None:
        """Switch the precision of the factors; existing ones are freed first: for 100 000 blocks both would take 4.4
        GB."""
        tree, self._has_factors = self._factors.tree, False
        del self._factors, self._directions, self._shown
        self._factors = Factors(*self._pattern, dtype, tree)
        self._make_room_for_directions()

    def rough_solution(self, data: np.ndarray) -> Callable[..., np.ndarray]:
        """A function ``solution(right, within)`` that returns x (6n,) with a residual of at most ``within`` times
        ``right``.

        It uses factors of its own, in single precision unless blocks are few (half the time of double ones, where their digits
        suffice), or those of `solve` in their place for very many blocks. Search directions are kept for the next right-hand side.
        Raises numpy.linalg.LinAlgError."""

        def exactly(right: np.ndarray, within: float) -> np.ndarray:
            return self.solve(data, right, within)

        factors = self._rough_factors()
        if factors is None:
            return exactly
        try:
            if factors is self._factors:
                self._bring(data, 0, rough=True)
            else:
                factors.factor(data)
                self._count(1.0)
        except np.linalg.LinAlgError:
            self._rough_serves = self.single_only
            return exactly

        self._shown.forget()
        # Those of `solve` are not referenced here, or they would be kept in memory with later double ones.
        own = None if factors is self._factors else factors

        def solution(right: np.ndarray, within: float) -> np.ndarray:
            if self._rough_serves:
                x, rest, known = np.zeros(len(right)), right.copy(), self._shown
                target = within * float(np.abs(right).max(initial=0.0))
                if self._follow(data, x, rest, known.project(x, rest), target, own or self._factors, known, TRIES):
                    return x
                self._rough_serves = self.single_only
                del known
            if self._factors.single:
                self._go_on_in_double()
            return self.solve(data, right, within)

        return solution

    def corrections(self, data: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """A function that returns, for one right-hand side after the other, an approximate solution x (6n,) by one
        substitution with the factors of `rough_solution`; for iterations that correct its error. Raises
        numpy.linalg.LinAlgError."""
        factors = self._rough_factors()
        if factors is None:
            self.factor(data)
            return self.substitute
        if factors is self._factors:
            self._bring(data, 0, rough=True)
            return self.substitute
        factors.factor(data)
        self._count(1.0)
        return lambda right: self.substitute(right, factors)

    def _rough_factors(self) -> Factors | None:
        """Factors in their own memory, in single precision unless blocks are few, or, for many blocks, in place of those of
        `solve`; None if they do not suffice."""
        if not self._rough_serves:
            return None
        if self.n >= SINGLE:
            if not self._factors.single:
                self._hold(np.float32)
            return self._factors
        if self._rough is None:
            dtype = np.float32 if self.n >= SINGLE_ROUGH else np.float64
            self._rough = Factors(*self._pattern, dtype, self._factors.tree, again=False)
        return self._rough

    def _solved(
        self, data: np.ndarray, right: np.ndarray, within: float, target: float,
        near: tuple[np.ndarray | None, np.ndarray | None],
    ) -> np.ndarray | None:  # fmt: skip
        """`solve` with the present factors, to residuals of ``target``; None if single precision does not suffice."""
        if self._has_factors:
            fresh = self._bring(data, 0 if self._factors.tree.kept else FEW)
            tries = TRIES if fresh or self.in_parts else TRIES_OF_FEW
            found = self._iterate(data, right, within, target, self._factors, near, tries, fresh)
            # New single-precision factors of this matrix would be no better.
            if found is not None or (fresh and self._factors.single):
                return found
        self.factor(data)
        if self._factors.single:
            return self._iterate(data, right, within, target, self._factors, near)
        x, at_roundoff, self.rest = self.substitute(right), False, None
        for _ in range(REFINEMENTS):
            rest = right - self.multiply(data, x)
            self.left = largest = float(np.abs(rest).max())
            if largest > target and not at_roundoff:
                target, at_roundoff = max(target, self._round_off(data, x)), True
            if not largest > target:
                break
            x += self.substitute(rest)
        return x

    def _round_off(self, data: np.ndarray, x: np.ndarray) -> float:
        """The largest entry of a residual that is round-off."""
        return ROUND_OFF * largest_terms(data, self.pointer, self.columns, x)

    def _bring(self, data: np.ndarray, few: int, rough: bool = False) -> bool:
        """Refactor the changed part of the matrix ``data`` if more than ``few`` blocks have changed; returns whether
        that was done. Matrices of ``rough`` solutions mostly change everywhere."""
        changed = _changed(data, self._diagonal, self._factored, CHANGED) if self._has_factors else None
        number = self.n if changed is None else np.count_nonzero(changed)
        if number <= few:
            self.work.factorisations_kept += 1
            return False
        self.factor(data, changed, bool(not rough or changed is None or number < MOSTLY * self.n))
        return True

    def _count(self, share: float) -> None:
        self.counts["factorisations"] += 1
        self.counts["shares"] += share

    def factor(self, data: np.ndarray, changed: np.ndarray | None = None, again: bool = True) -> None:
        """Factor the matrix of ``data``, of which only the diagonal blocks ``changed`` (n,) may differ; ``again``: see
        `Factors.factor`. Raises numpy.linalg.LinAlgError when it is singular."""
        self._has_factors, began = False, time.perf_counter()
        if self.n >= SINGLE:
            # Those directions may be in the memory of the factorisation.
            self._directions.forget()
            self._shown.forget()
        share = self._factors.factor(data, changed, again)
        _take(data, self._diagonal, np.ones(self.n, np.bool_) if changed is None else changed, self._factored)
        self._has_factors = True
        self._count(share)
        self.work.factorisation_s += (time.perf_counter() - began) if self.work.factorisations else 0.0
        self.work.factorisations += 1

    def substitute(self, right: np.ndarray, factors: Factors | None = None) -> np.ndarray:
        """The solution of the factored system for ``right`` (6n,)."""
        self.counts["substitutions"] += 1
        return (factors or self._factors).substitute(right)

    def multiply(self, data: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The product with the matrix of ``data``."""
        if self._product is not None:
            return self._product(x)
        return multiply(data, self.pointer, self.columns, x)

    def _iterate(
        self, data: np.ndarray, right: np.ndarray, within: float, target: float, factors: Factors,
        near: tuple[np.ndarray | None, np.ndarray | None], tries: int = TRIES, fresh: bool = True,
    ) -> np.ndarray | None:  # fmt: skip
        """x (6n,) with a residual of ``target``, by ``factors`` of nearly the same matrix, starting from ``near`` and its
        residual if given; None if it takes more than ``tries`` solutions with them, or, for ``fresh`` single-precision factors of
        this matrix, more than `CYCLES` times that."""
        known, at_roundoff = self._directions, False
        known.forget()
        x = self.substitute(right, factors) if near[0] is None else near[0].copy()
        carried = near[1] is not None
        for cycle in range(CYCLES):
            rest = near[1].copy() if near[1] is not None and not cycle else right - self.multiply(data, x)
            largest = float(np.abs(rest).max(initial=0.0))
            # The round-off is computed only where it may decide, and once; a coarse solution need not know it.
            if largest > target and not at_roundoff and (cycle or (within <= COARSE and not carried)):
                target, at_roundoff = max(target, self._round_off(data, x)), True
            self.left, self.rest = largest, rest
            if largest <= target:
                return x
            enough = self._follow(data, x, rest, largest, target, factors, known, tries)
            if enough and carried:
                self.left = float(np.abs(rest).max())
                return x
            if not (enough or (fresh and factors.single and np.abs(rest).max() <= FALLS * largest)):
                return None
        return None

    def _follow(
        self, data: np.ndarray, x: np.ndarray, rest: np.ndarray, largest: float, target: float, factors: Factors,
        known: Directions, tries: int,
    ) -> bool:  # fmt: skip
        """Reduce ``rest`` (6n,), the residual of ``x`` (6n,), until its ``largest`` entry is below ``target``, both in
        place, by directions in addition to the ``known`` ones; False if that takes more than ``tries``."""
        for _ in range(tries):
            if largest <= target or not np.isfinite(largest):
                break
            direction = self.substitute(rest, factors)
            largest = known.add(direction, self.multiply(data, direction), x, rest)
        return largest <= target
