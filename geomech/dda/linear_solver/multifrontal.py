"""Multifrontal elimination of 6×6-block systems on all cores (Duff & Reid 1983).

Subtrees of the nested dissection are independent and are eliminated by several threads (`task_pool`), each exactly as
one thread would (`front_elimination`), so that the result is the same to the last bit. Pivots are chosen within a panel
only: the diagonal of a block system contains inertia and springs. The digits that this, or single precision, loses are
recovered by refinement.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...compiled import UNCOUNTED, kept
from .blas_threads import blas_threads
from .front_elimination import eliminate, places, working_space
from .nested_dissection import Tree, plan
from .task_pool import THREADED, add_at_once, await_value, thread_team
from .triangular_solve import backward, forward

_jit = kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)

#: Number of blocks from which they are factored on all cores; solutions are substituted on all from `THREADED`.
_THREADED_FACTORS = 500


@kept(fastmath=False, error_model="numpy", nogil=True)
def _eliminate_shared(work, touched, fronts, matrix, stored, memory):
    """Claim tasks until none are left, and wait until all are done; for the other arguments see `eliminate`. ``work``:
    claimed (1,); awaited (k,), number of contributions each task still waits for; done (2,), number of finished and of
    failed tasks; tasks (k, 2); and the task above each (k,)."""
    claimed, awaited, done, tasks, above = work
    space = None
    while True:
        q = add_at_once(claimed, 0, 1)
        if q >= len(tasks):
            break
        if space is None:
            space = working_space(fronts[0], fronts[1], memory[1])
        await_value(awaited, q, 0)
        if not eliminate(tasks[q, 0], tasks[q, 1], touched, fronts, matrix, stored, memory, space):
            add_at_once(done, 1, 1)
        if above[q] >= 0:
            add_at_once(awaited, above[q], -1)
        add_at_once(done, 0, 1)
    await_value(done, 0, len(tasks))


@_jit
def _take(right, order, size, out):
    """``out`` ← ``right`` / ``size``, block by block in this ``order``."""
    for k in range(len(order)):
        for a in range(6):
            out[6 * k + a] = right[6 * order[k] + a] / size


@_jit
def _give(out, order, size, x):
    """``x`` ← ``out`` ``size``, back from this ``order``."""
    for k in range(len(order)):
        for a in range(6):
            x[6 * order[k] + a] = out[6 * k + a] * size


@_jit
def _mark_above(touched, parent):
    """Mark all ancestors of marked fronts."""
    for f in range(len(parent)):
        if touched[f] and parent[f] >= 0:
            touched[parent[f]] = True


@kept(fastmath=False, error_model="numpy", nogil=True)
def _substitute_shared(work, out, fronts, boundary, stored, factors, passed):
    """As `_eliminate_shared`: forward through the tasks in their order, then backward in reverse order, each after its
    parent. ``stored``: ``at`` and ``back`` of factors."""
    claimed, awaited, done, tasks, above = work
    pivots, reach, position, child, sibling = fronts
    at, back = stored
    k = len(tasks)
    while True:
        q = add_at_once(claimed, 0, 1)
        if q >= 2 * k:
            break
        if q < k:
            await_value(awaited, q, 0)
            forward(tasks[q, 0], tasks[q, 1], out, pivots, reach, position, at, child, sibling, factors, passed)
            # −1: forward pass of this task done.
            add_at_once(awaited, q, -1)
            if above[q] >= 0:
                add_at_once(awaited, above[q], -1)
        else:
            q = 2 * k - 1 - q
            if above[q] >= 0:
                await_value(awaited, above[q], -2)
            else:
                await_value(awaited, q, -1)
            backward(tasks[q, 0], tasks[q, 1], out, pivots, reach, boundary, back, factors)
            # −2: backward pass done.
            add_at_once(awaited, q, -1)
        add_at_once(done, 0, 1)
    await_value(done, 0, 2 * k)


class Factors:
    """The factors of one pattern of 6×6 blocks, in ``dtype`` float64 or float32.

    ``points`` (n, 2) m: positions of the blocks; ``rows`` and ``columns`` (n_entries,) of the matrix blocks, both
    triangles and the diagonal, sorted by row, then column. The order of elimination is internal, or that of a ``tree``
    planned for the same pattern. ``again``: whether fronts may be eliminated again one by one.
    """

    def __init__(
        self,
        points: np.ndarray,
        rows: np.ndarray,
        columns: np.ndarray,
        dtype: type = np.float64,
        tree: Tree | None = None,
        again: bool = True,
    ):
        self.tree: Tree = plan(points, rows, columns) if tree is None else tree
        parent = self.tree.parent
        self._child, self._sibling = np.full(len(parent), -1), np.full(len(parent), -1)
        for f in range(len(parent) - 1, -1, -1):
            if parent[f] >= 0:
                self._sibling[f] = self._child[parent[f]]
                self._child[parent[f]] = f
        self._order = np.argsort(self.tree.rank)
        self._front = np.searchsorted(self.tree.pivots, self.tree.rank, side="right") - 1
        above = self.tree.above
        self._awaited = np.bincount(above[above >= 0], minlength=len(above))
        self._at, self._back, size = places(np.diff(self.tree.pivots), np.diff(self.tree.reach))
        self._factors: np.ndarray = np.empty(size, dtype)
        # Whether partial refactorisation is possible, and now: every S is still in place.
        again = again and self.tree.kept
        self._room: np.ndarray = np.empty(self.tree.own_room_size if again else self.tree.stack_size, dtype)
        self._again, self._left = again, False
        self._passed = np.empty(6 * self.tree.reach[-1], dtype)
        self._units: np.ndarray = np.array([1.0, 0.0], dtype)

    @property
    def _fronts(self) -> tuple[np.ndarray, ...]:
        """As `eliminate` takes them."""
        return self.tree.pivots, self.tree.reach, self.tree.position, self._child, self._sibling

    @property
    def single(self) -> bool:
        """Whether the factors are in single precision."""
        return self._factors.dtype == np.float32

    @property
    def idle_room(self) -> np.ndarray:
        """(…,) float64 memory that holds nothing between factorisations, for temporary use by others."""
        return self._room[: 0 if self._again else len(self._room) // 2 * 2].view(np.float64)

    def factor(self, data: np.ndarray, changed: np.ndarray | None = None, again: bool = True) -> float:
        """Factor the matrix of the blocks ``data`` (36 n_entries,), each row by row; returns the share of the work
        done.

        Where only rows and columns of the blocks ``changed`` (n,) differ from the last factored matrix, only their
        fronts and those above are eliminated again, unless ``again`` was False. Raises numpy.linalg.LinAlgError when
        the matrix is singular.
        """
        t = self.tree
        touched = np.ones(len(t.parent), np.bool_)
        if changed is not None and self._left:
            touched[:] = False
            touched[self._front[changed]] = True
            _mark_above(touched, t.parent)
        self._left = self._again and (again or not touched.all())
        with blas_threads(1):
            done = self._shared(
                _eliminate_shared, _THREADED_FACTORS, touched, self._fronts, (data, t.entries, t.entry, t.row, t.column),
                (t.own_room if self._left else t.stack, self._at, self._back),
                (self._room, self._factors, self._units),
            )  # fmt: skip
        if done[1]:
            raise np.linalg.LinAlgError("the block system is singular")
        return float(np.diff(t.at)[touched].sum() / max(1, t.at[-1]))

    def substitute(self, right: np.ndarray) -> np.ndarray:
        """The solution of the factored system for ``right`` (6n,)."""
        t = self.tree
        # Single precision spans 38 decades; the right-hand side is scaled to their centre.
        size = float(np.abs(right).max(initial=0.0)) or 1.0
        out, x = np.empty(len(right), self._factors.dtype), np.empty(len(right))
        _take(right, self._order, size, out)
        self._shared(
            _substitute_shared, THREADED, out, self._fronts, t.boundary, (self._at, self._back),
            self._factors, self._passed,
        )  # fmt: skip
        _give(out, self._order, size, x)
        return x

    def _shared(self, work: Callable, least: int, *given) -> np.ndarray:
        """Do the ``work`` of all tasks, on all cores from ``least`` blocks on; returns numbers of finished and failed
        tasks."""
        t = self.tree
        done = np.zeros(2, np.int64)
        task = np.zeros(1, np.int64), self._awaited.copy(), done, t.tasks, t.above
        if len(t.rank) < least:
            work(task, *given)
        else:
            thread_team().share(work, task, *given)
        return done
