"""Newton steps of the central path on all contacts: persistent arrays, and the work on them, divided among threads if
there are many contacts.

Each chunk of contacts or blocks is processed independently, and sums are taken chunk by chunk, so that results are
bitwise independent of the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ....compiled import UNCOUNTED, kept
from ...linear_solver.assembly import sides_of
from ...linear_solver.task_pool import SHARE, THREADED, add_at_once, await_value, thread_team
from .contact_terms import (
    Between,
    Changes,
    Linearised,
    PathSprings,
    Variables,
    balance,
    change,
    go,
    linearise,
    nearer,
    products,
    pull,
    second_order,
    undecided,
)

#: Tasks.
_LINEARISE, _PREDICT, _CORRECT, _CENTRE, _CHANGE, _GO = range(6)
#: Contacts per task.
_CONTACTS = 4 * SHARE
#: Factor within which products are brought to their target; factor below which force and gap of a contact, in units of
#: its stiffness, differ if it is undecided.
_SPREAD, _CLEAR = 10.0, 3.0
_NONE = np.empty(0)


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _work(
    chunks, task, target, parts, between, springs, sides, variables, linearised, blocks, step, tried
):  # fmt: skip
    """Carry out the ``task`` together with other threads: first for contacts, with sums ``parts`` (n_shares,), then for
    blocks. ``chunks``: claimed (1,) and finished (2,) as for the elimination of fronts, and the numbers of contacts and of
    blocks per chunk; ``target``: ε in units, and the step length; ``sides`` as from `assembly.sides_of`; ``blocks``:
    forces on blocks, given and found, and unknowns. ``step`` (goals, `Changes`) is the present one, ``tried`` the new one.
    """
    claimed, finished, share, share_blocks = chunks
    epsilon, far = target
    kn, _, _, _, _, unit = springs
    _, _, vectors, _ = between
    start, side = sides
    numbers, _, _, pulled = linearised
    given, out, unknowns = blocks
    goals, (_, changed, _) = step
    better, further = tried
    n, n_blocks = len(kn), len(start) - 1
    shares = (n + share - 1) // share
    whole = shares + (0 if task >= _CHANGE else (n_blocks + share_blocks - 1) // share_blocks)
    while True:
        q = add_at_once(claimed, 0, 1)
        if q >= whole:
            break
        if q < shares:
            first, last = q * share, min(n, (q + 1) * share)
            if task == _LINEARISE:
                parts[q] = linearise(first, last, variables, springs, linearised)
            elif task == _CHANGE:
                parts[q] = change(first, last, unknowns, between, springs, linearised, better, further)
            elif task == _GO:
                go(first, last, far, further, variables)
                parts[q] = undecided(first, last, variables, springs, _CLEAR)
            else:
                if task == _PREDICT:
                    for c in range(first, last):
                        for k in range(better.shape[1]):
                            better[c, k] = 0.0
                elif task == _CORRECT:
                    second_order(first, last, epsilon, unit, changed, better)
                else:
                    nearer(first, last, epsilon, unit, far, _SPREAD, numbers, changed, goals, better)
                pull(first, last, better, linearised)
        else:
            # The forces on blocks need those of all contacts.
            await_value(finished, 0, shares)
            first, last = (q - shares) * share_blocks, min(n_blocks, (q - shares + 1) * share_blocks)
            balance(first, last, start, side, vectors, pulled, 0, 2, given, out)
        add_at_once(finished, 0 if q < shares else 1, 1)
    await_value(finished, 0, shares)
    await_value(finished, 1, whole - shares)


class _Step:
    """Arrays of one step: ``goals`` (n, 3) J of its products, ``motion`` (n, 2) m of contacts, changes of the numbers
    (``changed`` (n, 6)) and of S (``sheared`` (n,)), its largest length ``far``, and its ``unknowns``."""

    def __init__(self, n: int) -> None:
        self.goals, self.motion = np.empty((n, 3)), np.empty((n, 2))
        self.changed, self.sheared = np.empty((n, 6)), np.empty(n)
        #: As kernels take them.
        self.changes = tuple(Changes(self.motion, self.changed, self.sheared))
        self.far, self.unknowns = 0.0, np.empty(0)


class PathSteps:
    """Steps of contacts between blocks whose unknowns have the numbers ``block`` and ``other`` (n,), −1 for those
    without, of ``n_blocks``, with ``vectors`` (n, 2, 12) as from `assembly.contact_vectors` and ``lift`` (n,).

    ``numbers`` (n, 6), ``laws`` (n, 4): see `contact_terms`. ``step``: present step; ``tried``: last one computed.
    """

    def __init__(
        self, n_blocks: int, block: np.ndarray, other: np.ndarray, vectors: np.ndarray, lift: np.ndarray
    ) -> None:
        n, each = len(block), np.arange(n_blocks)
        self._fixed = tuple(Between(block, other, vectors, lift))
        self._sides = tuple(sides_of(n_blocks, np.append(each, -1), block, other))
        self._parts = np.empty((n + _CONTACTS - 1) // _CONTACTS)
        self.numbers, self.laws = np.empty((n, 6)), np.empty((n, 4))
        self._missed, self._pulled = np.empty((n, 2)), np.empty((n, 3))
        #: (6 n_blocks,) N: unbalanced forces on blocks, and the right-hand side of a step.
        self.residual, self._side = np.empty(6 * n_blocks), np.empty(6 * n_blocks)
        self.step, self.tried = _Step(n), _Step(n)

    def linearise(self, at_hand: Variables, springs: PathSprings, given: np.ndarray) -> float:
        """Prepare steps from ``at_hand``: N, w, slip, S, gap and motion along the edge of contacts (n,) with
        ``springs`` kn, ks, μ, base, rough and unit; ``given`` (6 n_blocks,) N: forces on blocks without contact forces.
        Returns the sum of the products."""
        self._at_hand, self._springs = tuple(at_hand), tuple(springs)
        self._do(_LINEARISE, given=given, out=self.residual)
        return float(self._parts.sum())

    def predict(self, solve: Callable[[np.ndarray], np.ndarray]) -> float:
        """Compute the predictor (all products zero) with ``solve``; returns its largest length."""
        return self._made(solve, _PREDICT)

    def correct(self, solve: Callable[[np.ndarray], np.ndarray], epsilon: float) -> float:
        """Compute the step with all products equal to ``epsilon`` units, including second-order terms of the present
        step."""
        return self._made(solve, _CORRECT, epsilon)

    def centre(self, solve: Callable[[np.ndarray], np.ndarray], epsilon: float, wanted: float) -> float:
        """Compute the present step with corrections of products that would be far from ``epsilon`` at the length
        ``wanted``."""
        return self._made(solve, _CENTRE, epsilon, wanted)

    def accept(self) -> None:
        """Make the step tried the present one."""
        self.step, self.tried = self.tried, self.step

    def products(self) -> float:
        """Sum of the products at the end of the present step."""
        *_, rough, unit = self._springs
        return products(self.numbers, self.step.changed, self.step.far, rough, unit)

    def go(self, far: float) -> int:
        """Update the variables by the present step with length ``far``, in place; returns the number of undecided
        contacts."""
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
        chunks = np.zeros(1, np.int64), np.zeros(2, np.int64), _CONTACTS, SHARE
        linearised = tuple(Linearised(self.numbers, self._missed, self.laws, self._pulled))
        work = (
            chunks, task, (epsilon, far), self._parts, self._fixed, self._springs, self._sides, self._at_hand, linearised,
            (given, out, tried.unknowns), (step.goals, step.changes), (tried.goals, tried.changes),
        )  # fmt: skip
        if len(self.residual) < 6 * THREADED:
            _work(*work)
        else:
            thread_team().share(_work, *work)
