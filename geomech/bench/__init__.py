"""Benchmarks of cost and accuracy, one table per topic."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .figures import Measured

#: Topic → module with ``measure(quick: bool) -> Measured``: the printed table and its figures.
TOPICS = {
    "accuracy": "geomech.bench.accuracy.published_values",
    "boundary": "geomech.bench.accuracy.boundary_stress",
    "contact-solver": "geomech.bench.robustness.contact_solver",
    "coupling": "geomech.bench.cost.coupling_cost",
    "dda": "geomech.bench.cost.block_cost",
    "ddm": "geomech.bench.accuracy.work_precision",
    "debris": "geomech.bench.robustness.debris",
    "geometry": "geomech.bench.cost.cutting_cost",
    "kernels": "geomech.bench.cost.kernel_cost",
    "many": "geomech.bench.cost.many_cracks",
    "motion": "geomech.bench.cost.motion_cost",
    "order": "geomech.bench.accuracy.bending_precision",
    "output": "geomech.bench.cost.output_cost",
    "safety": "geomech.bench.safety.slope_factors",
    "schemes": "geomech.bench.accuracy.block_schemes",
    "skips": "geomech.bench.skips",
    "sliding": "geomech.bench.slopes.sliding_slopes",
    "slopes": "geomech.bench.slopes.fuzzed_slopes",
    "stability": "geomech.bench.robustness.stability",
    "startup": "geomech.bench.cost.startup",
    "steps": "geomech.bench.accuracy.load_steps",
    "sweep": "geomech.bench.sweep_cost",
}


def topic(name: str, function: str = "measure") -> Callable[..., Measured]:
    """The measuring ``function`` of a topic, imported on demand."""
    return getattr(import_module(TOPICS[name]), function)
