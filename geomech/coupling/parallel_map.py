"""Parallel work on blocks, which are independent of each other under given loads."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

#: Number of processors that this process may use.
THREADS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
_pools: dict[int, ThreadPoolExecutor] = {}


def parallel_map(work: Callable[[_Item], _Result], items: Sequence[_Item], threads: int | None = None) -> list[_Result]:
    """``work(item)`` of all ``items``, in their order, on ``threads`` threads (default `THREADS`).

    Each item is processed by one thread, so that results do not depend on the number of threads; ``work`` must not
    modify shared data. If several items raise, the exception of the first item is raised after all have ended. After an
    interrupt only those that have begun are worked on.
    """
    threads = min(THREADS if threads is None else threads, len(items))
    if threads < 2:
        return [work(item) for item in items]
    if threads not in _pools:
        _pools[threads] = ThreadPoolExecutor(threads, thread_name_prefix="geomech-blocks")
    running = [_pools[threads].submit(work, item) for item in items]
    try:
        wait(running)
    except BaseException:
        for each in running:
            each.cancel()
        raise
    return [each.result() for each in running]


def return_free_memory() -> None:
    """Return memory that all threads have freed to the system, where the C library can (glibc). Threads allocate from
    regions of their own, whose gaps between the large matrices of many blocks add up to a third of the memory in use."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)
