"""Number of BLAS threads of NumPy and SciPy.

The number of threads changes the order of sums and so their round-off. After a few steps, events of blocks and cracks
depend on the last digits, so the number is kept constant.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TypeVar

_Item = TypeVar("_Item")


@cache
def limits() -> tuple[Callable[[int], int], ...]:
    """Functions, one per library, that set its number of threads and return the previous number; empty if there is
    none."""
    found = []
    for package in ("numpy", "scipy"):
        found_at = importlib.util.find_spec(package)
        if found_at is None or found_at.origin is None:
            continue
        site = Path(found_at.origin).resolve().parent.parent
        for library in sorted(site.glob(f"{package}.libs/*openblas*")):
            try:
                found.append(ctypes.CDLL(str(library)).openblas_set_num_threads_local)
            except (OSError, AttributeError):
                continue
    return tuple(found)


@contextmanager
def blas_threads(number: int) -> Iterator[None]:
    """Use ``number`` threads within the context. (Distributed small products take forty times as long on a busy
    machine.)"""
    before = [(limit, limit(number)) for limit in limits()]
    try:
        yield
    finally:
        for limit, of_before in before:
            limit(of_before)


def asked_for() -> int:
    """The number of threads set in the environment; by default one, whatever the machine has."""
    try:
        return max(int(os.environ.get("OPENBLAS_NUM_THREADS", "1")), 1)
    except ValueError:
        return 1


def alike(items: Iterator[_Item]) -> Iterator[_Item]:
    """The ``items``, each computed with the number of threads of `asked_for`; between items the previous number is
    restored."""
    while True:
        with blas_threads(asked_for()):
            try:
                item = next(items)
            except StopIteration:
                return
        yield item
