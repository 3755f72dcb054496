"""geomech: simulation of the failure of jointed, cracked rock masses.

Blocks slide and rotate along joints (discontinuous deformation analysis, `geomech.dda`), cracks grow through the rock
bridges between them (displacement discontinuity method, `geomech.ddm`), and `geomech.coupling` couples the two;
each solver can also be used alone::

    import geomech

    scene = geomech.load_scene("slope/scene.toml", {"joints.beds.friction_angle_deg": 28.0})
    summary = geomech.run(scene, out="outputs/slope")       # runs to the end, writes the run folder
    results = geomech.open_run("outputs/slope")              # histories as DataFrames, series as PyVista meshes
    results.history.plot(x="time", y="kinetic_energy")
    print(geomech.safety_report(scene).text())               # factor of safety by strength reduction
    found = geomech.sweep("slope/scene.toml", {"joints.beds.friction_angle_deg": "normal(28, 3)"}, runs=200)
    print(found.probability)                                 # of failure, with its interval
    for cycle in geomech.cycles(scene):                      # cycle by cycle, nothing written
        print(cycle.number, cycle.state.time, len(cycle.tips))
"""

import os
import sys
from importlib import import_module

from .kernel_folder import kernel_place as _kernel_place

__version__ = "0.1.0"

# Numba reads this once, when it is imported.
if "numba" not in sys.modules:
    os.environ["NUMBA_CACHE_DIR"] = _kernel_place().folder

# Resolved on first use, so that `import geomech` costs nothing that is not asked for. ``__init__.pyi`` says the same to
# type checkers and editors.
_PUBLIC = {
    "load_scene": "geomech.scene",
    "SceneError": "geomech.scene",
    "cycles": "geomech.pipeline",
    "run": "geomech.pipeline",
    "resume": "geomech.resumption",
    "open_run": "geomech.report.results",
    "factor_of_safety": "geomech.pipeline",
    "safety_report": "geomech.pipeline",
}
# `sweep` is called like a function, too.
_MODULES = ("conventions", "coupling", "dda", "ddm", "model", "sweep")

__all__ = ["__version__", *_PUBLIC, *_MODULES]


def __getattr__(name: str):
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    if name in _MODULES:
        return import_module(f"geomech.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
