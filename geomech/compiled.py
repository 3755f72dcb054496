"""Kernels that are kept between runs, and compiled anew when anything that they call has changed, in whatever file.

Numba keeps compiled code with a digest of the one file that a kernel stands in. What the kernel calls is part of its
code, so that after an upgrade in which only that has changed the old code would be taken.
"""

from __future__ import annotations

import functools
import hashlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType

import numpy as np
from numba import config, njit
from numba.core.caching import UserProvidedCacheLocator
from numba.core.dispatcher import Dispatcher


def kept(**options) -> Callable:
    """``njit(cache=True, **options)`` whose compiled code goes with the sources of all that the kernel calls within its
    package."""

    def compiled(function: Callable) -> Dispatcher:
        # Only while this one is declared: other packages' kernels are theirs. Where nothing can be written Numba has
        # its own ways.
        before = getattr(config, "CACHE_LOCATOR_CLASSES", "")
        places = f"{__name__}.WithCalled,InTreeCacheLocator,UserWideCacheLocator,IPythonCacheLocator"
        config.CACHE_LOCATOR_CLASSES = places
        try:
            return njit(cache=True, **options)(function)
        finally:
            config.CACHE_LOCATOR_CLASSES = before

    return compiled


class WithCalled(UserProvidedCacheLocator):
    """The user's folder of kernels; a kernel's stamp is of its own file, of those that it calls into, and of the
    constants that it takes from anywhere."""

    def __init__(self, function: Callable, file: str) -> None:
        super().__init__(function, file)
        self._function, self._file = function, file

    def get_source_stamp(self) -> str:
        files, constants = compiled_in(self._function)
        parts = [_digest(Path(file)) for file in sorted({self._file, *files})]
        return hashlib.sha256(b"".join(parts) + repr(sorted(constants.items())).encode()).hexdigest()


def compiled_in(function: Callable) -> tuple[set[str], dict[str, object]]:
    """What ``function``'s compiled code is made of: the files of its package in which what it calls is defined, and so
    on down, and the numbers and arrays that it and they take by name (module.name → value, or an array's bytes)."""
    package, files, constants, seen, rest = function.__module__.partition(".")[0], set(), {}, set(), [function]
    while rest:
        this = rest.pop()
        if this in seen:
            continue
        seen.add(this)
        for name in _names(this.__code__):
            value = this.__globals__.get(name)
            value = value.py_func if isinstance(value, Dispatcher) else value
            module = getattr(value, "__module__", None) or ""
            if isinstance(value, (bool, int, float, complex, str, tuple)):
                constants[f"{this.__module__}.{name}"] = value
            elif isinstance(value, np.ndarray):
                constants[f"{this.__module__}.{name}"] = value.tobytes()
            elif module.partition(".")[0] == package:
                files.add(sys.modules[module].__file__)
                if hasattr(value, "__code__"):
                    rest.append(value)
    return files, constants


@functools.cache
def _digest(file: Path) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest()


def _names(code: CodeType) -> Iterator[str]:
    """Global names that ``code`` uses, its inner functions' too."""
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)
