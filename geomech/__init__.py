"""geomech: how a jointed, cracked rock mass comes apart.

Blocks slide and rotate along joints (discontinuous deformation analysis, `geomech.dda`), cracks grow through the rock
bridges between them (displacement discontinuity method, `geomech.ddm`), and `geomech.coupling` lets each drive the
other. `load_scene`, `cycles`, `run`, `resume`, `factor_of_safety`, `safety_report` and `sweep` are the whole pipeline; each
solver also stands alone.
"""

import os
import sys
from importlib import import_module

from .kernel_folder import kernel_place as _kernel_place

__version__ = "0.1.0"

# Numba reads this once, when it is imported.
if "numba" not in sys.modules:
    os.environ["NUMBA_CACHE_DIR"] = _kernel_place().folder

# Resolved on first use, so that `import geomech` costs nothing that is not asked for.
_PUBLIC = {
    "load_scene": "geomech.scene",
    "cycles": "geomech.pipeline",
    "run": "geomech.pipeline",
    "resume": "geomech.resumption",
    "factor_of_safety": "geomech.pipeline",
    "safety_report": "geomech.pipeline",
}
# Packages that are called like a function.
_CALLED = ("sweep",)

__all__ = ["__version__", *_PUBLIC, *_CALLED]


def __getattr__(name: str):
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    if name in _CALLED:
        return import_module(f"geomech.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
