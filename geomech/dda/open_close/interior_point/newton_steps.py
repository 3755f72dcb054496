"""Newton's steps of the central path on all contacts: arrays that serve from iteration to iteration, and the work on
them, shared between threads where contacts are many.

What is done for a share of contacts or blocks is its own, and sums are those of shares: what comes out is the same to
the bit however many threads do it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ....compiled import kept
from ...linear_solver.assembly import sides_of
from ...linear_solver.task_pool import add_at_once, await_value, crew
from .contact_terms import balance, change, go, linearise, nearer, products, pull, second_order, undecided

#: What is to be done.
_LINEARISE, _PREDICT, _CORRECT, _CENTRE, _CHANGE, _GO = range(6)
#: Blocks from which it is done on all cores; contacts, and blocks, of a share.
THREADED, SHARE, SHARE_BLOCKS = 4000, 2048, 512
#: Products are brought to within this factor of their target, contacts are undecided while their force and their gap, in
#: units of their stiffness, differ by less than this factor.
_SPREAD, _CLEAR = 10.0, 3.0
_NONE = np.empty(0)


@kept(fastmath=False, error_model="numpy", nogil=True)
def _work(
    claimed, told, share, share_blocks, task, epsilon, far, parts, mine, theirs, vectors, lift, kn, ks, mu, base, rough,
    unit, start, side, normal, width, slip, shear, gap, along, numbers, missed, laws, pulled, given, out,
    unknowns, goals, changed, better, motion, further, sheared,
):  # fmt: skip
    """Do the ``task`` by turns with other threads: first for contacts, whose sums are ``parts`` (n_shares,), then for
    blocks, so many to a ``share``; ``claimed`` (1,) and ``told`` (2,) as for the elimination of
    fronts. ``epsilon`` and ``far``: the target in
    units, and the length of a step, of the task; ``goals`` and ``changed`` are those of the step at hand, ``better``
    and ``further`` of the one that is made."""
    n, blocks = len(kn), len(start) - 1
    shares = (n + share - 1) // share
    whole = shares + (0 if task >= _CHANGE else (blocks + share_blocks - 1) // share_blocks)
    while True:
        q = add_at_once(claimed, 0, 1)
        if q >= whole:
            break
        if q < shares:
            first, last = q * share, min(n, (q + 1) * share)
            if task == _LINEARISE:
                parts[q] = linearise(
                    first, last, normal, width, slip, shear, gap, along, kn, ks, mu, base, rough, unit, numbers,
                    missed, laws, pulled,
                )  # fmt: skip
            elif task == _CHANGE:
                parts[q] = change(
                    first, last, unknowns, mine, theirs, vectors, lift, better, numbers, missed, pulled, laws, kn, mu,
                    rough, motion, further, sheared,
                )  # fmt: skip
            elif task == _GO:
                go(first, last, far, motion, further, sheared, normal, width, slip, shear, gap, along)
                parts[q] = undecided(first, last, normal, width, slip, shear, kn, ks, mu, base, rough, _CLEAR)
            else:
                if task == _PREDICT:
                    for c in range(first, last):
                        for k in range(better.shape[1]):
                            better[c, k] = 0.0
                elif task == _CORRECT:
                    second_order(first, last, epsilon, unit, changed, better)
                else:
                    nearer(first, last, epsilon, unit, far, _SPREAD, numbers, changed, goals, better)
                pull(first, last, better, numbers, missed, laws, pulled)
        else:
            # The forces on a block are known when those of all contacts are.
            await_value(told, 0, shares)
            first, last = (q - shares) * share_blocks, min(blocks, (q - shares + 1) * share_blocks)
            balance(first, last, start, side, vectors, pulled, 0, 2, given, out)
        add_at_once(told, 0 if q < shares else 1, 1)
    await_value(told, 0, shares)
    await_value(told, 1, whole - shares)


class _Step:
    """Room for one step: the ``goals`` (n, 3) J of its products, the ``motion`` (n, 2) m of contacts, how the numbers
    have ``changed`` (n, 6) and S has ``sheared`` (n,), how ``far`` it may be taken, and its ``unknowns``."""

    def __init__(self, n: int) -> None:
        self.goals, self.motion = np.empty((n, 3)), np.empty((n, 2))
        self.changed, self.sheared = np.empty((n, 6)), np.empty(n)
        self.far, self.unknowns = 0.0, np.empty(0)


class PathSteps:
    """Steps of contacts between blocks whose unknowns have the numbers ``mine`` and ``theirs`` (n,), −1 for those
    without, of ``n_blocks``, with ``vectors`` (n, 2, 12) as from `assembly.contact_vectors` and ``lift`` (n,).

    ``numbers`` (n, 6), ``laws`` (n, 4): see `contact_terms`. ``step`` is the step at hand, ``tried`` the last one made.
    """

    def __init__(
        self, n_blocks: int, mine: np.ndarray, theirs: np.ndarray, vectors: np.ndarray, lift: np.ndarray
    ) -> None:
        n, each = len(mine), np.arange(n_blocks)
        self._fixed = mine, theirs, vectors, lift
        self._sides = sides_of(n_blocks, np.append(each, -1), mine, theirs)
        self._parts = np.empty((n + SHARE - 1) // SHARE)
        self.numbers, self.laws = np.empty((n, 6)), np.empty((n, 4))
        self._missed, self._pulled = np.empty((n, 2)), np.empty((n, 3))
        #: (6 n_blocks,) N that blocks are out of balance by, and the right side of a step.
        self.residual, self._side = np.empty(6 * n_blocks), np.empty(6 * n_blocks)
        self.step, self.tried = _Step(n), _Step(n)

    def linearise(self, at_hand: tuple[np.ndarray, ...], springs: tuple[np.ndarray, ...], given: np.ndarray) -> float:
        """Make ready for steps from N, w, slip, S, gap and motion along the edge ``at_hand`` on, contacts (n,) with
        ``springs`` kn, ks, μ, base, rough and unit; ``given`` (6 n_blocks,) N are the forces on blocks without
        those of contacts. The sum of the products."""
        self._at_hand, self._springs = at_hand, springs
        self._do(_LINEARISE, given=given, out=self.residual)
        return float(self._parts.sum())

    def predict(self, solve: Callable[[np.ndarray], np.ndarray]) -> float:
        """Make the step, solved by ``solve``, that has all products vanish; how far it may be taken."""
        return self._made(solve, _PREDICT)

    def correct(self, solve: Callable[[np.ndarray], np.ndarray], epsilon: float) -> float:
        """The step that makes all products ``epsilon`` units, after what the present one makes of second order."""
        return self._made(solve, _CORRECT, epsilon)

    def centre(self, solve: Callable[[np.ndarray], np.ndarray], epsilon: float, wanted: float) -> float:
        """The present step corrected by what it would leave far from ``epsilon``, taken as far as ``wanted``."""
        return self._made(solve, _CENTRE, epsilon, wanted)

    def accept(self) -> None:
        """The step that was tried is the one to take."""
        self.step, self.tried = self.tried, self.step

    def products(self) -> float:
        """Their sum where the present step ends."""
        *_, rough, unit = self._springs
        return products(self.numbers, self.step.changed, self.step.far, rough, unit)

    def go(self, far: float) -> int:
        """Take what is at hand so ``far`` along the present step, in place; how many contacts are undecided there."""
        self.accept()
        self._do(_GO, far=far)
        return int(self._parts.sum())

    def _made(self, solve: Callable, task: int, epsilon: float = 0.0, far: float = 0.0) -> float:
        self._do(task, epsilon, far, self.residual, self._side)
        self.tried.unknowns = solve(self._side)
        self._do(_CHANGE)
        self.tried.far = float(self._parts.min(initial=1.0))
        return self.tried.far

    def _do(
        self,
        task: int,
        epsilon: float = 0.0,
        far: float = 0.0,
        given: np.ndarray = _NONE,
        out: np.ndarray = _NONE,
    ) -> None:
        step, tried = self.step, self.tried
        work = (
            np.zeros(1, np.int64), np.zeros(2, np.int64), SHARE, SHARE_BLOCKS, task, epsilon, far, self._parts,
            *self._fixed, *self._springs, *self._sides, *self._at_hand, self.numbers, self._missed, self.laws,
            self._pulled, given, out, tried.unknowns, step.goals, step.changed, tried.goals, tried.motion,
            tried.changed, tried.sheared,
        )  # fmt: skip
        if len(self.residual) < 6 * THREADED:
            _work(*work)
        else:
            crew().share(_work, *work)
