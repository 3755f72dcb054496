"""Solutions of one 6×6-block system after another, each with no more work than its difference from the last asks for.

Where springs have changed since the last factorisation, only the fronts of their blocks and those above are eliminated
again; where blocks have hardly moved, none. What is kept so, or factored in single precision, preconditions conjugate
residuals (`conjugate_residuals`), which bring them down to round-off.

Chosen by measurement, on the last equations of walls of 990 and 10 010 bricks under sudden weight (CPU of one core for
a factorisation and a substitution, ms): these factors 7.2 + 0.4 and 194 + 7, in single precision 4.2 + 0.2 and 102 + 3.6;
PARDISO of MKL 2026 11 to 19 + 6 and 245 to 478 + 61; an incomplete factorisation with GMRES 234 and 5400; smoothed
aggregation (pyamg 5, six fields an aggregate) and block Jacobi do not come to 1e-10 in 500 iterations.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ...compiled import kept
from ..counters import Work
from .conjugate_residuals import Directions
from .multifrontal import Factors
from .nested_dissection import KEPT, Tree
from .task_pool import add_at_once, await_value, crew

_jit = kept(fastmath=False, error_model="numpy", nogil=True)

#: The largest residual of a solution, relative to the largest force in the right-hand side (blocks at rest leave 3e-8 of
#: it, the rounding of coordinates times stiff springs), …
RESIDUAL = 1e-12
#: … or to the largest Σ|A||x| of a row, below which it is round-off.
ROUND_OFF = 2e-15
#: Residuals that are larger are hardly ever round-off.
COARSE = 1e-6
#: Refinements of a solution at most.
REFINEMENTS = 3
#: A 6×6 diagonal block has changed when one of its entries has by more than this part of the largest diagonal one: what stiff
#: springs lose so stays below the inertia that holds a block against them (measured: 1e-3 takes twice the time at dt =
#: 1 ms).
CHANGED = 1e-6
#: Solutions in a cycle of conjugate residuals at most.
TRIES = 16
#: Where these bring a residual of single factors down to this part, others follow, so many times in all: they take less
#: than factors in double, as long as 54 solutions (a slope of 107 720 blocks, 2.5 ms: eight decades in the first sixteen).
FALLS, CYCLES = 1e-3, 4
#: Where so many have changed, it is taken that as many will have the next time.
MOSTLY = 0.9
#: Where fronts cannot be eliminated one by one, factors that differ in so few blocks are not made anew: of 100 000
#: bricks they take as long as 27 substitutions, and where ten scattered contacts differ conjugate residuals take 7 to 19 more, of
#: which this many are tried.
FEW, TRIES_OF_FEW = 30, 24
#: Free blocks from which factors are in single precision: half the memory, and on walls of 10 000 bricks three quarters
#: of the time although a solution takes two substitutions more; of 1 000 as quick.
SINGLE = 4000
#: Blocks from which products are formed on all cores, the rows of so many at a time.
SHARED, SHARE = 4000, 512


@kept(fastmath={"reassoc", "contract", "nsz"}, error_model="numpy", nogil=True)
def _multiply_rows(first, last, data, pointer, columns, x, out):
    """A x for the rows of 6×6 blocks from ``first`` to before ``last``. (Written out, for only whole sums of six become
    vector instructions: four times as fast as loops.)"""
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
        mine = out[6 * i : 6 * i + 6]
        mine[0], mine[1], mine[2], mine[3], mine[4], mine[5] = s0, s1, s2, s3, s4, s5


@kept(fastmath=False, error_model="numpy", nogil=True)
def _multiply_shared(claimed, told, share, data, pointer, columns, x, out):
    """The rows of ``share`` blocks at a time, by turns with other threads; ``claimed`` and ``told`` (1,) as for the
    elimination of fronts."""
    n = len(pointer) - 1
    shares = (n + share - 1) // share
    while True:
        q = add_at_once(claimed, 0, 1)
        if q >= shares:
            break
        _multiply_rows(q * share, min(n, (q + 1) * share), data, pointer, columns, x, out)
        add_at_once(told, 0, 1)
    await_value(told, 0, shares)


def multiply(data: np.ndarray, pointer: np.ndarray, columns: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A x for 6×6 blocks stored row by row; from many on by all cores, to the same bit."""
    out = np.empty(6 * (len(pointer) - 1))
    given = data, pointer, columns, x, out
    if len(pointer) <= SHARED:
        _multiply_rows(0, len(pointer) - 1, *given)
    else:
        crew().share(_multiply_shared, np.zeros(1, np.int64), np.zeros(1, np.int64), SHARE, *given)
    return out


@_jit
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
    """(n,) whether a diagonal block of ``data`` differs from the one ``factored`` (n, 36) by more than this part of the
    largest entry on its diagonal."""
    n = len(diagonal)
    out = np.zeros(n, np.bool_)
    for b in range(n):
        here, size = data[36 * diagonal[b] : 36 * diagonal[b] + 36], 0.0
        for k in range(0, 36, 7):
            size = max(size, abs(here[k]))
        for k in range(36):
            # Not a number has changed.
            if not abs(here[k] - factored[b, k]) <= tolerance * size:
                out[b] = True
                break
    return out


@_jit
def _take(data, diagonal, changed, factored):
    """Copy the ``changed`` diagonal blocks of ``data`` to ``factored`` (n, 36)."""
    for b in range(len(diagonal)):
        if changed[b]:
            given, taken = data[36 * diagonal[b] : 36 * diagonal[b] + 36], factored[b]
            for k in range(36):
                taken[k] = given[k]


class BlockSolver:
    """Solves A x = b for one pattern of 6×6 blocks and matrices that change from time to time.

    ``points`` (n, 2) m, where the blocks lie; ``rows`` and ``columns`` (n_entries,) of the matrix's blocks, both
    triangles and the diagonal, sorted by row then column. The order of elimination is internal, or that of a ``tree``
    already planned for the same pattern. ``counts`` tells what was done; ``work`` counts it beside that of other solvers.
    ``single_only``: a matrix beyond factors in single precision is given up, not factored in double.
    """

    def __init__(self, points: np.ndarray, rows: np.ndarray, columns: np.ndarray, tree: Tree | None = None):
        self.n = len(points)
        self.keys = rows * self.n + columns
        self.pointer, self.columns = np.searchsorted(rows, np.arange(self.n + 1)), columns
        self._diagonal = np.flatnonzero(rows == columns)
        self._pattern = points, rows, columns
        self._factors = Factors(points, rows, columns, np.float32 if self.n >= SINGLE else np.float64, tree)
        self._factored = np.empty((self.n, 36))
        self._has_factors = False
        self._rough: Factors | None = None
        self._beside: BlockSolver | None = None
        self._rough_serves, self.single_only = True, False
        self._make_room_for_directions()
        #: The largest entry of the last solution's residual.
        self.left = 0.0
        #: ``shares``: factorisations, one that was done in part as that part.
        self.work = Work()
        self.counts = {"factorisations": 0, "shares": 0.0, "substitutions": 0}

    @property
    def points(self) -> np.ndarray:
        """(n, 2) m: where the blocks lie."""
        return self._pattern[0]

    @property
    def in_parts(self) -> bool:
        """Whether a matrix that differs in some blocks from the last is factored for a part of the price."""
        return self._factors.tree.kept

    @property
    def beside(self) -> BlockSolver:
        """A solver of the same pattern for matrices of another kind, that come by turns with this one's: the factors of
        each are made anew in part. This one where that is not done, or is of too many blocks to be done twice: two of
        50 000 would take 3 GB, and without a second one steps that stop blocks take 4 % longer."""
        if not self.in_parts or 2 * self._factors.tree.own_room_size > KEPT:
            return self
        if self._beside is None:
            self._beside = BlockSolver(*self._pattern, self._factors.tree)
            self._beside.work, self._beside.counts = self.work, self.counts
        return self._beside

    def _make_room_for_directions(self) -> None:
        """Those of rough solutions serve until the next matrix, whatever is solved between, but of so many blocks that
        this takes other factors, too. Then both share a room, that in which the factors are made where it is idle: of
        100 000 blocks they would be 400 MB."""
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
        near: np.ndarray | None = None,
    ) -> np.ndarray:  # fmt: skip
        """x (6n,) for the blocks ``data`` (36 n_entries,), each row by row, with a residual ``within`` that part of
        ``right``, or of a larger ``force`` that others balance in it, or of round-off. ``near`` (6n,) may be known to
        lie near x. Raises numpy.linalg.LinAlgError."""
        largest = float(np.abs(right).max(initial=0.0))
        target = within * max(force, largest)
        if largest > 0.0:
            within = target / largest
        if self._factors.single:
            try:
                x = self._solved(data, right, within, target, near)
            except np.linalg.LinAlgError:
                x = None
            if x is not None:
                return x
            # Beyond single precision, as many sets of states are that are far from the right ones.
            self._go_on_in_double()
        return self._solved(data, right, within, target, near)

    def _go_on_in_double(self) -> None:
        """Raises numpy.linalg.LinAlgError if that is not wanted."""
        if self.single_only:
            raise np.linalg.LinAlgError("the block system is beyond single precision")
        self._hold(np.float64)

    def _hold(self, dtype: type) -> None:
        """Go on with factors of this precision; those at hand make room first: of 100 000 blocks both would take 4.4
        GB."""
        tree, self._has_factors = self._factors.tree, False
        del self._factors, self._directions, self._shown
        self._factors = Factors(*self._pattern, dtype, tree)
        self._make_room_for_directions()

    def rough_solution(self, data: np.ndarray) -> Callable[..., np.ndarray]:
        """What gives x (6n,) for one right side after the other, ``solution(right, within)``, with a residual ``within``
        that part of it, from factors in single precision (half the time of double ones, where that is all the digits
        asked for), which leave those of `solve` alone, unless they are of so many blocks that single ones take their
        place. What one right side has shown of the matrix serves the next. Raises numpy.linalg.LinAlgError."""

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
        # Those of `solve` are left to it: whoever kept them here would keep them beside double ones that follow.
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
        """What gives, for one right side after the other, nearly the solution x (6n,) by one substitution, with the factors
        of `rough_solution`: for iterations that correct themselves. Raises numpy.linalg.LinAlgError."""
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
        """Factors in single precision, with room of their own or, of many blocks, in the place of those of `solve`;
        None where they do not serve."""
        if not self._rough_serves:
            return None
        if self.n >= SINGLE:
            if not self._factors.single:
                self._hold(np.float32)
            return self._factors
        if self._rough is None:
            self._rough = Factors(*self._pattern, np.float32, self._factors.tree, again=False)
        return self._rough

    def _solved(
        self, data: np.ndarray, right: np.ndarray, within: float, target: float, near: np.ndarray | None
    ) -> np.ndarray | None:
        """`solve` with the factors as they are, to residuals of ``target``; None where single precision does not
        do."""
        if self._has_factors:
            fresh = self._bring(data, 0 if self._factors.tree.kept else FEW)
            tries = TRIES if fresh or self.in_parts else TRIES_OF_FEW
            found = self._iterate(data, right, within, target, self._factors, near, tries, fresh)
            # Single precision knows no more of this matrix than that, in full or in part.
            if found is not None or (fresh and self._factors.single):
                return found
        self.factor(data)
        if self._factors.single:
            return self._iterate(data, right, within, target, self._factors, near)
        x, told = self.substitute(right), False
        for _ in range(REFINEMENTS):
            rest = right - self.multiply(data, x)
            self.left = largest = float(np.abs(rest).max())
            if largest > target and not told:
                target, told = max(target, self._round_off(data, x)), True
            if not largest > target:
                break
            x += self.substitute(rest)
        return x

    def _round_off(self, data: np.ndarray, x: np.ndarray) -> float:
        """The largest entry of a residual that is round-off."""
        return ROUND_OFF * largest_terms(data, self.pointer, self.columns, x)

    def _bring(self, data: np.ndarray, few: int, rough: bool = False) -> bool:
        """Factor what has changed in the matrix of ``data`` where more than ``few`` blocks have; whether any was. Of
        ``rough`` solutions' matrices mostly all has, and will have in the next one."""
        changed = _changed(data, self._diagonal, self._factored, CHANGED) if self._has_factors else None
        number = self.n if changed is None else np.count_nonzero(changed)
        if number <= few:
            self.work.factorisations_kept += 1
            return False
        self.factor(data, changed, not rough or changed is None or number < MOSTLY * self.n)
        return True

    def _count(self, share: float) -> None:
        self.counts["factorisations"] += 1
        self.counts["shares"] += share

    def factor(self, data: np.ndarray, changed: np.ndarray | None = None, again: bool = True) -> None:
        """Factor the matrix of ``data``, which may be known to have ``changed`` (n,) in these diagonal blocks only;
        ``again``: see `Factors.factor`. Raises numpy.linalg.LinAlgError when it is singular."""
        self._has_factors, began = False, time.perf_counter()
        if self.n >= SINGLE:
            # Where their room is that of the factorisation.
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
        return multiply(data, self.pointer, self.columns, x)

    def _iterate(
        self, data: np.ndarray, right: np.ndarray, within: float, target: float, factors: Factors,
        near: np.ndarray | None = None, tries: int = TRIES, fresh: bool = True,
    ) -> np.ndarray | None:  # fmt: skip
        """x (6n,) with a residual of ``target``, from ``factors`` that are nearly those of the matrix, and from ``near``
        on if that is known; None when it takes more than so many ``tries``, solutions with them, and where they are
        ``fresh`` single ones of this matrix more `CYCLES` of these."""
        known, told = self._directions, False
        known.forget()
        x = self.substitute(right, factors) if near is None else near.copy()
        for cycle in range(CYCLES):
            rest = right - self.multiply(data, x)
            largest = float(np.abs(rest).max(initial=0.0))
            # Round-off is asked for only where it may decide, once: the first x of a coarse solution need not know it.
            if largest > target and not told and (cycle or within <= COARSE):
                target, told = max(target, self._round_off(data, x)), True
            self.left = largest
            if largest <= target:
                return x
            enough = self._follow(data, x, rest, largest, target, factors, known, tries)
            if not (enough or (fresh and factors.single and np.abs(rest).max() <= FALLS * largest)):
                return None
        return None

    def _follow(
        self, data: np.ndarray, x: np.ndarray, rest: np.ndarray, largest: float, target: float, factors: Factors,
        known: Directions, tries: int,
    ) -> bool:  # fmt: skip
        """Bring ``rest`` (6n,), the residual of ``x`` (6n,), and its ``largest`` entry down to ``target``, both in
        place, by further ``known`` directions; False if that takes more than so many ``tries``."""
        for _ in range(tries):
            if largest <= target or not np.isfinite(largest):
                break
            direction = self.substitute(rest, factors)
            largest = known.add(direction, self.multiply(data, direction), x, rest)
        return largest <= target
