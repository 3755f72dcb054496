"""Benchmarks: what a run costs and how right it is, in one table a topic."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

#: Topic → module with ``measure(quick: bool) -> str``, the printed table.
TOPICS = {
    "accuracy": "geomech.bench.accuracy",
    "boundary": "geomech.bench.boundary_stress",
    "coupling": "geomech.bench.coupling_cost",
    "dda": "geomech.bench.block_cost",
    "ddm": "geomech.bench.work_precision",
    "kernels": "geomech.bench.kernels",
    "many": "geomech.bench.many_cracks",
    "stability": "geomech.bench.stability",
    "startup": "geomech.bench.startup",
}


def topic(name: str) -> Callable[[bool], str]:
    """The measuring function of a topic, imported only now."""
    return import_module(TOPICS[name]).measure
