"""Displacement discontinuity method: cracks in an elastic body.

    body = ddm.Body(loops, cracks, material)        # loops [] for the infinite plane; holes=, supports=
    body = ddm.Body(ddm.HalfPlane((0, 0)), cracks, material)        # below a free surface
    sol = body.solve(ddm.BodyLoad(remote_stress=[0, 1e6, 0]))
    sol.tips["k_i"], sol.faces.opening, sol.stress(points), sol.displacement(points)

    sol = ddm.solve_to(loops, cracks, material, load, target_error=1e-6)    # the mesh follows from the error
    sol.tip_errors                                                          # how far to trust each K

`criteria` give the growth direction of a tip, `tip_advance` extends the crack, and `propagate` repeats both:

    for step in ddm.propagate(loops, cracks, material, load, control="toughness"):
        step.load_factor, step.cracks, step.tips, step.solution
"""

from importlib import import_module

# Resolved on first use: `criteria` and `tip_advance` need no compiled kernel.
_PUBLIC = {
    "Body": ".body",
    "BodyLoad": ".loads.body_loads",
    "HalfPlane": ".mesh.half_plane",
    "OutOfEquilibrium": ".loads.body_loads",
    "Pressure": ".loads.body_loads",
    "Reuse": ".body",
    "Support": ".loads.supports",
    "LoadHistory": ".loads.body_loads",
    "NotConverged": ".crack_contact.frictionless_contact",
    "Solution": ".solution",
    "Work": ".counters",
    "propagate": ".propagation",
    "TargetMissed": ".fracture.target_error",
    "solve_to": ".accurate_solution",
}
_MODULES = {"criteria": ".fracture.criteria", "initiation": ".growth.initiation", "shapes": ".kernels.shape_functions"}

__all__ = [
    "Body",
    "BodyLoad",
    "HalfPlane",
    "LoadHistory",
    "NotConverged",
    "OutOfEquilibrium",
    "Pressure",
    "Reuse",
    "Solution",
    "Support",
    "TargetMissed",
    "Work",
    "criteria",
    "initiation",
    "propagate",
    "shapes",
    "solve_to",
]


def __getattr__(name: str):
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name], __name__), name)
    if name in _MODULES:
        return import_module(_MODULES[name], __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
