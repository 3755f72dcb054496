"""Limits of the crack solver and of cracked blocks: maps over gap, kink, sliver, ligament, offset, order, increment,
friction, stiffness contrast, penalty and time step.

References are closed forms, or were computed with distributed dislocations or boundary collocation. Each cell requests
the solver's error estimate (`ddm.Solution.tip_errors`), as a careful user would: a warning there counts as reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from ... import ddm
from ...coupling import cycles
from ...ddm.fracture.sif_error_estimate import factors, largest
from ...model import (
    Blocks,
    Cracks,
    DdaSettings,
    DdmSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)
from ...reference.cracks import branched, crack_arrays, fracture, plates
from ...reference.specimens import two_cracks
from .stability_grid import Map
from .stability_scenes import GRAVITY, WEIGHT, Outcome, rectangle

ROCK = Material("rock", 17e9, 0.21, 2200.0)
MIXED = np.array([0.3e6, 1e6, 0.4e6])
PULL = np.array([0.0, 1e6, 0.0])


def maps(quick: bool) -> Iterator[Map]:
    """All maps of the crack solver; with ``quick`` every second value of each axis."""

    def some(*values: float) -> tuple[float, ...]:
        return values[::2] if quick else values

    off = "K off the reference, over the largest K"
    orders = some(0, 1, 2, 3, 4, 6, 8)
    yield Map(
        "gap of two cracks in a line", off, "gap / length", some(1, 1e-1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11),
        "order", orders, 1e-2, collinear,
    )  # fmt: skip
    yield Map("kink", off, "turn, °", some(5, 30, 60, 90, 120, 172), "kink / crack",
              some(1, 0.1, 1e-2, 1e-3, 1e-4, 1e-6), 1e-2, kink)  # fmt: skip
    yield Map("sliver below a surface", off, "depth / half-length", some(0.5, 0.2, 0.1, 1e-5),
              "order", some(1, 2, 3, 4), 1e-2, sliver)  # fmt: skip
    yield Map("edge crack and its ligament", off, "crack / width", some(1e-3, 1e-2, 0.1, 0.5, 0.9, 0.99, 0.999),
              "order", orders, 1e-2, edge_crack)  # fmt: skip
    yield Map("crack far from the origin", off, "offset, m", some(0, 1e3, 1e5, 1e7, 1e9), "half-length, m",
              some(1e-3, 1e-2, 1, 1e2, 1e3), 1e-3, far)  # fmt: skip
    yield Map("closed crack that rubs", off, "friction angle, °", some(0, 10, 30, 45, 80), "dip, °",
              some(1, 15, 30, 45, 60, 89), 1e-3, rubbing)  # fmt: skip
    yield Map("crack that grows straight on", "load at the last increment off K_Ic/√(πa)", "increment / half-length",
              some(1e-3, 1e-2, 0.1, 1, 10), "order", some(1, 2, 4, 6, 8), 1e-2, growing)  # fmt: skip
    contrasts = some(1e-4, 1e-2, 1, 1e2, 1e4)
    yield Map("cracked specimen between platens", off, "platen's stiffness", contrasts, "penalty / E'",
              some(0.1, 10, 1e4), 1e-2, specimen)  # fmt: skip
    yield Map("cracked specimen far from the origin", off, "offset, m", some(0, 1e4, 1e7), "order",
              some(2, 3, 4), 1e-2, partial(specimen, 1.0, 10.0))  # fmt: skip
    yield Map("cracked block in free fall", "K over that of its weight on a base; energy and momentum", "crack / side",
              some(0.01, 0.1, 0.5, 0.9), "dt, s", some(1e-5, 1e-4, 1e-3, 1e-2, 0.1), 1e-2, falling)  # fmt: skip


def _outcome(solution: ddm.Solution, exact: np.ndarray) -> Outcome:
    """``exact`` (n_tips, 2) K_I, K_II."""
    # Requested first: it issues the warning.
    _ = solution.tip_errors
    error = float(np.abs(factors(solution) - exact).max() / largest(exact))
    return Outcome(error, condition=solution.condition, residual=solution.residual)


def _in_plane(lines, stress: np.ndarray, order: int = 4, aperture: float = math.inf, **body) -> ddm.Solution:
    cracks = Cracks.from_polylines([np.array(line, dtype=float) for line in lines], aperture=aperture)
    return ddm.Body([], cracks, ROCK, DdmSettings(order=order), **body).solve(ddm.BodyLoad(remote_stress=stress))


def collinear(gap: float, order: float) -> Outcome:
    """K of two collinear cracks at this distance."""
    solution = _in_plane([[[-1 - gap / 2, 0], [-gap / 2, 0]], [[gap / 2, 0], [1 + gap / 2, 0]]], PULL, int(order))
    inner, outer = fracture.collinear_pair(PULL[1], gap / 2, 1 + gap / 2)
    return _outcome(solution, np.array([[outer, 0], [inner, 0], [inner, 0], [outer, 0]]))


def kink(degrees: float, length: float) -> Outcome:
    """K of a crack with a kink of this angle, degrees, and length."""
    angle = math.radians(degrees)
    solution = _in_plane([[[-2, 0], [0, 0], [2 * length * math.cos(angle), 2 * length * math.sin(angle)]]], MIXED)
    return _outcome(solution, branched.kinked(2.0, 2 * length, angle, MIXED))


def sliver(depth: float, order: float) -> Outcome:
    """K of a crack at this depth below a side."""
    far = 20.0
    block = rectangle(-far, -2 * far, far, 0)
    cracks = Cracks.from_polylines([np.array([[-1, -depth], [1, -depth]])], aperture=math.inf)
    body = ddm.Body([block], cracks, ROCK, DdmSettings(order=int(order)))
    solution = body.solve(ddm.BodyLoad(crack_pressure=1e6))
    return _outcome(solution, crack_arrays.near_surface(np.array([[-1.0, -depth], [1.0, -depth]]), 1e6))


def edge_crack(ratio: float, order: float) -> Outcome:
    """K of an edge crack of this length relative to a strip's width."""
    width, half = 1.0, 3.0
    block = rectangle(0, -half, width, half)
    cracks = Cracks.from_polylines([np.array([[0, 0], [ratio, 0]])], aperture=math.inf, surface=[(True, False)])
    solution = ddm.Body([block], cracks, ROCK, DdmSettings(order=int(order))).solve(_pulled(block, 1e6))
    k = plates.edge_crack_strip(ratio / width) * 1e6 * math.sqrt(math.pi * ratio)
    return _outcome(solution, np.array([[k, 0.0]]))


def _pulled(block: np.ndarray, stress: float) -> ddm.BodyLoad:
    a, b, c, d = block
    pull = np.array([0.0, stress])
    return ddm.BodyLoad(np.array([[a, b], [c, d]]), np.array([[-pull, -pull], [pull, pull]]))


def far(offset: float, half: float) -> Outcome:
    """K of a crack at this distance from the origin of coordinates, and of this half length."""
    angle = math.radians(30)
    way = half * np.array([math.cos(angle), math.sin(angle)])
    solution = _in_plane([np.array([-way, way]) + [offset, -offset]], MIXED)
    return _outcome(solution, np.tile(fracture.slanted(MIXED, angle, half), (2, 1)))


def rubbing(friction: float, dip: float) -> Outcome:
    """K of a closed crack with this friction and dip, degrees, in compression."""
    stress, angle = np.array([-0.2e6, -1e6, 0.0]), math.radians(dip)
    way = np.array([math.cos(angle), math.sin(angle)])
    law = JointLaw("faces", friction_angle=math.radians(friction))
    solution = _in_plane([[-way, way]], stress, aperture=0.0, face_laws=[law])
    exact = np.tile(fracture.closed(stress, angle, 1.0, math.tan(law.friction_angle)), (2, 1))
    # If friction holds the faces, K is zero: the scale is its value without friction.
    size = max(abs(fracture.closed(stress, angle, 1.0)[1]), 1e-3 * abs(stress[1]))
    error = float(np.abs(factors(solution) - exact).max()) / size
    return Outcome(error, condition=solution.condition, residual=solution.residual)


def growing(increment: float, order: float) -> Outcome:
    """The load at which a crack has grown by steps of this increment."""
    half, toughness = 1.0, 1e6
    rock = Material("rock", 17e9, 0.21, k_ic=toughness)
    cracks = Cracks.from_polylines([np.array([[-half, 0], [half, 0]])], aperture=math.inf)
    growth = GrowthSettings(increment=increment, min_increment=increment)
    *_, last = ddm.propagate(
        [], cracks, rock, ddm.BodyLoad(remote_stress=PULL), growth, settings=DdmSettings(order=int(order)),
        control="toughness", max_steps=6,
    )  # fmt: skip
    k = PULL[1] * math.sqrt(math.pi * (half + last.number * increment))
    _ = last.solution.tip_errors
    off_line = float(np.abs(last.cracks.nodes[:, 1]).max()) / (half + last.number * increment)
    error = max(abs(last.load_factor * k / toughness - 1), off_line)
    return Outcome(error, condition=last.solution.condition, residual=last.solution.residual)


def specimen(contrast: float, penalty: float, offset: float = 0.0, order: float = 4) -> Outcome:
    """The two-slot specimen of 60 × 120 mm between a fixed and a guided platen under 0.2 MPa."""
    w, h, out, thick = 0.03, 0.06, 0.035, 0.01
    top = np.array([[-out, h], [out, h], [out, h + thick], [w, h + thick], [-w, h + thick], [-out, h + thick]])
    polygons = [p + offset for p in (rectangle(-w, -h, w, h), top, rectangle(-out, -h - thick, out, -h))]
    constrained = np.zeros((3, 6), bool)
    constrained[1, [0, 2, 5]] = True
    names = [[["", "", "", ""]], [["", "", "", "load:top", "", ""]], [["", "", "", ""]]]
    platen = Material("platen", 17e9 * contrast, 0.21, 2200.0)
    stiffness = penalty * ROCK.plane_modulus
    problem = Problem(
        title="specimen",
        blocks=Blocks.from_polygons(
            polygons, material=[0, 1, 1], fixed=[False, False, True], constrained=constrained, edge_names=names
        ),
        cracks=Cracks.from_polylines([line + offset for line in two_cracks.crack_ends(0)], aperture=math.inf),
        materials=(ROCK, platen),
        joints=(JointLaw("smooth"),),
        loads=Loads(edge_tractions=(EdgeTraction("load:top", History.ramp([0.0, -0.2e6])),)),
        dda=DdaSettings(normal_penalty=stiffness, shear_penalty=stiffness),
        ddm=DdmSettings(order=int(order), elements_per_crack=2, elements_per_side=3),
        run=RunSettings(end_time=1.0),
        load_edge="load:top",
    )  # fmt: skip
    *_, last = cycles(problem)
    exact = 0.2e6 * np.column_stack([two_cracks.OPEN_SLOT_K_I[0], two_cracks.OPEN_SLOT_K_II[0]])
    found = np.column_stack([last.tips["k_i"], last.tips["k_ii"]])
    return Outcome(
        float(np.abs(found - exact).max() / largest(exact)),
        penetration=last.statistics["worst_penetration"] / w,
        residual=last.statistics["traction_imbalance"],
    )


def falling(crack: float, dt: float) -> Outcome:
    """A square with an inclined slot in free fall: weight and inertia cancel, so that it is free of stress."""
    side, height = 1.0, 1.0
    angle = math.radians(30)
    way = 0.5 * crack * np.array([math.cos(angle), math.sin(angle)])
    blocks = Blocks.from_polygons([rectangle(-side / 2, 0, side / 2, side), rectangle(-2, -height - 1, 2, -height)],
                                  fixed=[False, True])  # fmt: skip
    end = 0.9 * math.sqrt(2 * height / GRAVITY)
    problem = Problem(
        title="fall",
        blocks=blocks,
        cracks=Cracks.from_polylines([np.array([-way, way]) + [0, side / 2]], aperture=math.inf),
        materials=(ROCK,),
        joints=(JointLaw("joint", friction_angle=0.5),),
        loads=WEIGHT,
        dda=DdaSettings(time_step=dt, dynamic_factor=1.0, max_displacement_ratio=0.05),
        ddm=DdmSettings(order=2, elements_per_crack=2, elements_per_side=3),
        run=RunSettings(end_time=min(end, 20 * dt)),
    )
    k, last = 0.0, None
    for cycle in cycles(problem):
        if len(cycle.tips):
            k = max(k, float(np.hypot(cycle.tips["k_i"], cycle.tips["k_ii"]).max()))
        last = cycle
    seconds = last.state.time
    speed = float(last.state.velocity[0, 1]) / (-GRAVITY * seconds) - 1
    weight = ROCK.density * GRAVITY * side * math.sqrt(math.pi * 0.5 * crack)
    return Outcome(
        max(k / weight, abs(speed)),
        drift=abs(last.statistics["energy_residual"] / last.statistics["gravity_work"]),
        residual=last.statistics["traction_imbalance"],
    )
