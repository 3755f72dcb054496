"""Many runs of one scene: sweeps over uncertain parameters and random joint networks, and the probability of failure.

``geomech.sweep(scene, vary=…, runs=…)`` is `execution.sweep`; the command ``geomech sweep`` does the same.

    variables       lists, ranges and distributions
    sampling        the table of runs
    plan            scene, variables and measure, checked before any run
    measures        one run and its columns of the table
    engine, cluster runs in processes of this machine, or on a cluster by dask.distributed
    execution       from the plan to the table; continuing a sweep
    results         journal and tables
    statistics      probability of failure and its interval, sensitivities
    rare_failures   subset simulation, importance sampling
    expressions     arithmetic permitted in scenes and on the command line
"""

from __future__ import annotations

import sys
import types
from importlib import import_module
from typing import Any

# Resolved on first use: workers need little of it.
_PUBLIC = {
    "Sweep": "execution",
    "read_sweep": "execution",
    "sweep": "execution",
    "Plan": "plan",
    "plan_of": "plan",
    "importance_sampling": "rare_failures",
    "subset_simulation": "rare_failures",
    "wilson": "statistics",
}

__all__ = list(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


class _Called(types.ModuleType):
    """The package, which is called as its main function."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return import_module(f"{__name__}.execution").sweep(*arguments, **options)


sys.modules[__name__].__class__ = _Called
