"""Many runs of one scene: sweeps over what is not known, random joint networks, the probability of failure.

``geomech.sweep(scene, vary=…, runs=…)`` is `execution.sweep`; the command line's ``geomech sweep`` does the same.

    variables       lists, ranges and distributions
    sampling        the table of runs
    plan            scene, variables and measure, checked before anything runs
    measures        one run, and the columns it gives
    engine, cluster runs in processes of this machine, or on a cluster by dask.distributed
    execution       from the plan to the table; going on with a sweep
    results         journal and tables
    statistics      probability of failure and its interval, sensitivities
    rare_failures   subset simulation, importance sampling
    expressions     arithmetic that scenes and command lines may ask for
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
