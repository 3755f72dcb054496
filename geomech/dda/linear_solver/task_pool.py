"""Tasks of a tree shared by several threads in compiled code, which wait for each other's results without the
interpreter.

Every thread claims the next task of one list, in which a task stands after all those it needs, and waits until these
are done. The thread with the first unfinished task can therefore always continue, and one thread alone completes them
all. The result of a task must not depend on the thread.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from ...compiled import UNCOUNTED, part

#: Number of blocks from which rows, products and iterations are shared by all cores, and number of blocks per task.
THREADED, SHARE = 4000, 512
#: Number of checks for another thread's result before this one sleeps for this many microseconds between them: with
#: more threads than cores the other one may not be running.
_LOOKS, _SLEEP = 2000, 50
#: If a thread has been idle for more than this fraction of the time, the cores are busy with other work, and it then
#: does all tasks of that kind alone for this number of times: waiting for a core takes many times as long as the work.
#: (Other kinds are not affected: one product that waited a millisecond would put the next factorisations on one core.)
_IDLE, _ALONE = 0.5, 20

_usleep = types.ExternalFunction("usleep", types.intc(types.uint32))


@intrinsic
def add_at_once(typingctx, array, index, value):
    """Add ``value`` to ``array[index]`` (int64) and return its previous value, as one atomic, sequentially consistent
    operation."""
    if not (isinstance(array, types.Array) and array.dtype == types.int64):
        return None

    def codegen(context, builder, signature, args):
        kind = signature.args[0]
        array_struct = make_array(kind)(context, builder, args[0])
        place = cgutils.get_item_pointer(context, builder, kind, array_struct, [args[1]], wraparound=False)
        return builder.atomic_rmw("add", place, args[2], "seq_cst")

    return types.int64(array, types.intp, types.int64), codegen


@part(nogil=True, **UNCOUNTED)
def await_value(array, index, value):
    """Wait until ``array[index]`` is ``value``."""
    looks = 0
    while add_at_once(array, index, 0) != value:
        looks += 1
        if looks > _LOOKS:
            _usleep(_SLEEP)


class ThreadTeam:
    """The ``number`` of threads that help the caller's thread."""

    def __init__(self, number: int) -> None:
        self.number = number
        self._pool = ThreadPoolExecutor(max(self.number, 1), thread_name_prefix="geomech-dda")
        self._alone: dict[Callable, int] = {}

    def share(self, work: Callable, *given) -> None:
        """Let ``work(*given)`` claim tasks on all cores until none are left; returns when all are done. Threads that
        start when no task is left return at once and are not waited for."""
        alone = self._alone.get(work, 0)
        if alone or not self.number:
            self._alone[work] = max(alone - 1, 0)
            work(*given)
            return
        began, busy = time.perf_counter(), time.thread_time()
        coming = [self._pool.submit(work, *given) for _ in range(self.number)]
        try:
            work(*given)
        finally:
            for thread in coming:
                thread.cancel()
        took, worked = time.perf_counter() - began, time.thread_time() - busy
        if took - worked > _IDLE * took:
            self._alone[work] = _ALONE


@cache
def thread_team() -> ThreadTeam:
    """The thread team of this process: one thread per core in addition to the caller's."""
    return ThreadTeam(len(os.sched_getaffinity(0)) - 1)
