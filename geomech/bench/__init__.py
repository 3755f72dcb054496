"""Benchmarks: what a run costs and how right it is, in one table a topic."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .figures import Measured

#: Topic → module with ``measure(quick: bool) -> Measured``: the table that is printed, and its figures.
TOPICS = {
    "accuracy": "geomech.bench.accuracy",
    "boundary": "geomech.bench.boundary_stress",
    "coupling": "geomech.bench.coupling_cost",
    "dda": "geomech.bench.block_cost",
    "ddm": "geomech.bench.work_precision",
    "debris": "geomech.bench.debris",
    "geometry": "geomech.bench.cutting_cost",
    "kernels": "geomech.bench.kernels",
    "many": "geomech.bench.many_cracks",
    "motion": "geomech.bench.motion_cost",
    "output": "geomech.bench.output_cost",
    "safety": "geomech.bench.slope_factors",
    "schemes": "geomech.bench.block_schemes",
    "skips": "geomech.bench.skips",
    "sliding": "geomech.bench.sliding_slopes",
    "slopes": "geomech.bench.fuzzed_slopes",
    "stability": "geomech.bench.stability",
    "startup": "geomech.bench.startup",
    "steps": "geomech.bench.load_steps",
}


def topic(name: str) -> Callable[[bool], Measured]:
    """The measuring function of a topic, imported only now."""
    return import_module(TOPICS[name]).measure
