"""Tasks of a tree that several threads claim, from inside compiled code: what a thread waits for is another's result,
never the interpreter.

Every thread claims the next task of one list, in which a task stands behind all it needs, and waits until these are
done; so whoever holds the first task that is not done can go on, and one thread alone does them all. What a task does
must not depend on who does it.
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

from ...compiled import part

#: Looks at what another thread is to finish, before this one sleeps for so many microseconds between them: where more
#: threads want to run than there are cores, the other may have none.
_LOOKS, _SLEEP = 2000, 50
#: Where a thread has done nothing for more than this part of the time, cores are busy with other things, and so many
#: times it does all tasks of that kind alone: to wait for others to get a core takes many times as long as the work. (Of
#: other kinds it does not: a product that has waited a millisecond would send the next factorisations to one core.)
_IDLE, _ALONE = 0.5, 20

_usleep = types.ExternalFunction("usleep", types.intc(types.uint32))


@intrinsic
def add_at_once(typingctx, array, index, value):
    """What ``array[index]`` (int64) was before ``value`` was added to it, as one operation that all threads see in the
    same order as what was written before and after it."""
    if not (isinstance(array, types.Array) and array.dtype == types.int64):
        return None

    def codegen(context, builder, signature, args):
        kind = signature.args[0]
        held = make_array(kind)(context, builder, args[0])
        place = cgutils.get_item_pointer(context, builder, kind, held, [args[1]], wraparound=False)
        return builder.atomic_rmw("add", place, args[2], "seq_cst")

    return types.int64(array, types.intp, types.int64), codegen


@part(nogil=True)
def await_value(array, index, value):
    """Wait until ``array[index]`` is ``value``."""
    looks = 0
    while add_at_once(array, index, 0) != value:
        looks += 1
        if looks > _LOOKS:
            _usleep(_SLEEP)


class Crew:
    """The ``number`` of threads that come to help the caller's."""

    def __init__(self, number: int) -> None:
        self.number = number
        self._pool = ThreadPoolExecutor(max(self.number, 1), thread_name_prefix="geomech-dda")
        self._alone: dict[Callable, int] = {}

    def share(self, work: Callable, *given) -> None:
        """Let ``work(*given)`` claim tasks on all cores until none are left; it returns to the caller when all are
        done. Threads that come when no task is left return at once: they are not waited for."""
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
def crew() -> Crew:
    """That of this process: one thread to each core beside the caller's."""
    return Crew(len(os.sched_getaffinity(0)) - 1)
