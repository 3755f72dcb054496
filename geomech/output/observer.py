"""Observers of a run: objects that are called at its start, after every cycle and at its end."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Protocol, cast, runtime_checkable

from geomech.model import Cycle, Problem

_log = logging.getLogger(__name__)


@runtime_checkable
class Observer(Protocol):
    """A run calls `on_start` once, `on_cycle` for every cycle in order, and `on_end` once, also after a failure.

    An observer whose files a resumed run continues has two further methods: ``memory()`` returns what it needs for that
    (plain data, see `geomech.plain_data`), and ``on_resume(problem, folder, memory)``, called instead of `on_start`,
    restores its files to their state at that time. Observers without these methods are started as in a new run. One that
    works in the background may have ``on_interrupt()``, called before the ``memory()`` of a run that is interrupted: it
    stops that work, and what is not done goes into the memory.

    Methods that an observer does not define do nothing.

    ``summary`` is one mapping that all observers share: the driver of the cycles enters what it knows (``end``, the
    reason; ``wall_s``), and each observer may add to it. ``error`` is the exception that ended the run, if any.
    """

    def on_start(self, problem: Problem, folder: Path) -> None:
        return None

    def on_cycle(self, cycle: Cycle) -> None:
        return None

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        return None


class Resumed(Observer, Protocol):
    """An observer that can be resumed."""

    def memory(self) -> Any: ...

    def on_resume(self, problem: Problem, folder: Path, memory: Any) -> None: ...


class Group:
    """Several observers as one. Ends every one that was started, even if another fails in its `on_end`; the first such
    failure is raised after all have ended."""

    def __init__(self, observers: Iterable[Observer]) -> None:
        self.observers = list(observers)
        self._started: list[Observer] = []

    def on_start(self, problem: Problem, folder: Path) -> None:
        for observer in self.observers:
            observer.on_start(problem, folder)
            self._started.append(observer)

    def on_resume(self, problem: Problem, folder: Path, memories: list[tuple[str, Any]]) -> None:
        """Continue with the ``memories`` of another such group, each given to the first observer of its own kind."""
        left = list(memories)
        for observer in self.observers:
            found = next((each for each in left if each[0] == _kind(observer)), None)
            if found is None:
                observer.on_start(problem, folder)
            else:
                left.remove(found)
                cast(Resumed, observer).on_resume(problem, folder, found[1])
            self._started.append(observer)

    def on_interrupt(self) -> None:
        for observer in self.observers:
            if hasattr(observer, "on_interrupt"):
                observer.on_interrupt()

    def memories(self) -> list[tuple[str, Any]]:
        """(kind, memory) of every observer that can be resumed."""
        return [
            (_kind(observer), cast(Resumed, observer).memory())
            for observer in self.observers
            if hasattr(observer, "memory")
        ]

    def on_cycle(self, cycle: Cycle) -> None:
        for observer in self.observers:
            observer.on_cycle(cycle)

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        first: Exception | None = None
        for observer in self._started:
            try:
                observer.on_end(summary, error)
            except Exception as failure:
                _log.exception("%s failed at the end of the run", type(observer).__name__)
                first = first or failure
        self._started = []
        if first is not None and error is None:
            raise first


def _kind(observer: Any) -> str:
    return f"{type(observer).__module__}.{type(observer).__qualname__}"
