"""Displacement discontinuity method: cracks in an elastic body.

    body = ddm.Body(loops, cracks, material)        # loops [] for the infinite plane; holes=, supports=
    body = ddm.Body([], cracks, material, half_plane=ddm.HalfPlane((0, 0)))     # below a free surface
    sol = body.solve(ddm.BodyLoad(remote_stress=[0, 1e6, 0]))
    sol.tips["k_i"], sol.faces.opening, sol.stress(points), sol.displacement(points)

    sol = ddm.solve_to(loops, cracks, material, load, target_error=1e-6)    # the mesh follows from the error
    sol.tip_errors                                                          # how far to trust each K

`criteria` say where a tip goes, `growth` takes it there, and `propagate` does both again and again:

    for step in ddm.propagate(loops, cracks, material, load, control="toughness"):
        step.load_factor, step.cracks, step.tips, step.solution
"""

from importlib import import_module

# Resolved on first use: `criteria` and `growth` need no compiled kernel.
_PUBLIC = {
    "Body": ".body",
    "BodyLoad": ".loads",
    "HalfPlane": ".half_plane",
    "OutOfEquilibrium": ".loads",
    "Pressure": ".loads",
    "Support": ".supports",
    "LoadHistory": ".loads",
    "NotConverged": ".faces",
    "Solution": ".solution",
    "Work": ".work",
    "propagate": ".propagation",
    "TargetMissed": ".automatic",
    "solve_to": ".automatic",
}
_MODULES = ("criteria", "growth", "initiation", "shapes")

__all__ = [
    "Body",
    "BodyLoad",
    "HalfPlane",
    "LoadHistory",
    "NotConverged",
    "OutOfEquilibrium",
    "Pressure",
    "Solution",
    "Support",
    "TargetMissed",
    "Work",
    "criteria",
    "growth",
    "initiation",
    "propagate",
    "shapes",
    "solve_to",
]


def __getattr__(name: str):
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name], __name__), name)
    if name in _MODULES:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
