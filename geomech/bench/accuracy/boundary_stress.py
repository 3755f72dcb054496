"""Transfer of contact forces to the cracks: K of the two-crack specimen between platens by each route, compared with
the crack solver alone.

The crack solver alone has the exact tractions, a uniform stress on the specimen's ends. Coupled runs apply contact
forces: distributed over faces ("contacts"), at the corners where the springs are ("springs"), or by Kelvin's solution
there ("kelvin-springs": Khanizadeh Bahabadi et al. 2023, eqs. 2-4). In addition, the crack solver alone with the field
of the four corner forces in the infinite plane, which is what those equations give literally: without a block. Errors
are the largest of the four tips, relative to the largest |K| of that mode. Run time against error: the same runs with
elements of several orders; only with the tractions of whole faces does the error decrease.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from ...model import Cycle, DdmSettings, Problem
from ...output.tables.summary import write_json
from ...reference.specimens.two_cracks import PHI_DEG
from ..figures import Measured, Point, stopwatch

#: Folder of the numbers, in the working folder.
FOLDER = Path("outputs/bench_boundary")
SPECIMEN = Path("pipelines/two_cracks/scene.toml")
#: Routes of a coupled run, and the field of its forces without a block.
ROUTES, NO_BLOCK = ("contacts", "springs", "kelvin-springs"), "Kelvin's field alone"
#: Axial stresses, Pa: at negligible strain, and near the stress at which the cracks grow, which is reached in these
#: steps.
STRESSES, STEP = (0.2e6, 40e6), 2e6


def specimen(phi_deg: int, boundary_stress: str = "contacts", rate: float = STRESSES[0], end: float = 1.0) -> Problem:
    """The specimen of the study with its elements, and a toughness that prevents growth."""
    from ...scene import load_scene

    overrides = [
        f"run.boundary_stress={boundary_stress}",
        f"loads.tractions.0.rate_pa_per_s=[0.0, {-rate}]",
        f"run.end_time_s={end}",
        "materials.rock.k_ic_pa_sqrt_m=1e12",
    ]
    return load_scene(SPECIMEN, overrides, f"phi_{phi_deg}").problem()


def factors(tips: np.ndarray) -> np.ndarray:
    """(2, n) K_I and K_II of ``tips``."""
    return np.stack([tips["k_i"], tips["k_ii"]])


def exact(problem: Problem, stress: float) -> np.ndarray:
    """K of the crack solver alone under ``stress`` (Pa, compression) on the specimen's ends."""
    from ...ddm import Body, BodyLoad

    block = int(problem.cracks.block[0])
    outline = problem.blocks.loops(block)[0]
    ends = np.array([[np.roll(outline, -k, axis=0)[i] for i in (0, 1)] for k in range(len(outline))])
    low, high = outline[:, 1].min(), outline[:, 1].max()
    sides = {k: (0.0, stress) for k, edge in enumerate(ends) if (edge[:, 1] == low).all()}
    sides |= {k: (0.0, -stress) for k, edge in enumerate(ends) if (edge[:, 1] == high).all()}
    material = problem.materials[problem.blocks.material[block]]
    return factors(Body([outline], problem.cracks, material, problem.ddm).solve(BodyLoad(sides=sides)).tips)


def without_block(problem: Problem, cycle: Cycle) -> np.ndarray:
    """K of the cracks in the infinite plane under the point forces of ``cycle``'s block (a run with springs)."""
    from ...ddm import Body, BodyLoad

    block = int(problem.cracks.block[0])
    load = cycle.bodies[block].load
    material = problem.materials[problem.blocks.material[block]]
    body = Body([], problem.cracks, material, problem.ddm)
    return factors(body.solve(BodyLoad(points=load.points, forces=load.forces)).tips)


def errors(phi_deg: int, stress: float) -> dict[str, list[float]]:
    """Route → largest relative error of K_I and of K_II at ``stress``."""
    from ...coupling import cycles

    rate, end = (stress, 1.0) if stress <= STEP else (STEP, stress / STEP)
    problem = specimen(phi_deg)
    reference = exact(problem, stress)
    size = np.abs(reference).max(axis=1)
    out = {}
    for route in ROUTES:
        last = deque(cycles(specimen(phi_deg, route, rate, end)), maxlen=1).pop()
        if not np.isclose(last.load, stress, rtol=1e-9):
            raise AssertionError(f"the run ended at {last.load:g} Pa, not at {stress:g}")
        out[route] = (np.abs(factors(last.tips) - reference).max(axis=1) / size).tolist()
    out[NO_BLOCK] = (np.abs(without_block(problem, last) - reference).max(axis=1) / size).tolist()
    return out


def quick_errors() -> dict[str, float]:
    """Errors of the routes in a quick `measure`, by name."""
    phi, stress = PHI_DEG[0], STRESSES[0]
    return {
        _named(route, phi, stress, mode): error
        for route, pair in errors(phi, stress).items()
        for mode, error in zip(("k_i", "k_ii"), pair)
    }


def _named(route: str, phi_deg: int, stress: float, mode: str) -> str:
    return f"{route}, φ = {phi_deg}, {stress / 1e6:g} MPa: {mode}"


def by_order(phi_deg: int, orders: Sequence[int] = (2, 3, 4, 6)) -> list[Point]:
    """Time and error of the first load by every route, relative to order 10, with elements of these ``orders``.

    The block's boundary has three times the elements of the study, so that the order determines the error.
    """
    from ...coupling import cycles

    problem = specimen(phi_deg)
    fine = replace(problem, ddm=_finer(problem.ddm, order=10))
    reference = exact(fine, STRESSES[0])
    size = np.abs(reference).max(axis=1)
    out = []
    for route in ROUTES:
        for order in orders:
            given = specimen(phi_deg, route)
            given = replace(given, ddm=_finer(given.ddm, order=order))
            times = []
            for _ in range(2):
                spent_on = stopwatch()
                *_, last = cycles(given)
                times.append(spent_on())
            error = float((np.abs(factors(last.tips) - reference).max(axis=1) / size).max())
            out.append(Point(f"specimen between platens, φ = {phi_deg}°", route, order, error, min(times)))
    return out


def _finer(settings: DdmSettings, order: int) -> DdmSettings:
    return replace(settings, order=order, elements_per_side=3 * settings.elements_per_side)


def paper_elements(phi_deg: int) -> list[float]:
    """Largest error of K_I and of K_II with four quadratic elements with equidistant nodes per crack, and exact
    tractions."""
    problem = specimen(phi_deg)
    fine = replace(problem, ddm=replace(problem.ddm, order=8, nodes="chebyshev", elements_per_side=12))
    coarse = replace(problem, ddm=replace(problem.ddm, order=2, nodes="equal", elements_per_crack=4))
    reference = exact(fine, 1.0)
    return (np.abs(exact(coarse, 1.0) - reference).max(axis=1) / np.abs(reference).max(axis=1)).tolist()


def measure(quick: bool = False) -> Measured:
    """The table; writes ``boundary.json`` and ``work_precision.png`` to `FOLDER`. ``quick``: φ = 0 at the small stress
    only."""
    from ...render.benchmarks.work_precision import draw

    angles, stresses = (PHI_DEG[:1], STRESSES[:1]) if quick else (PHI_DEG, STRESSES)
    rows = [
        {"phi_deg": phi, "stress_pa": stress, "route": route, "error_k_i": k_i, "error_k_ii": k_ii}
        for stress in stresses
        for phi in angles
        for route, (k_i, k_ii) in errors(phi, stress).items()
    ]
    elements = [dict(zip(("phi_deg", "error_k_i", "error_k_ii"), (phi, *paper_elements(phi)))) for phi in angles]
    points = by_order(PHI_DEG[0], (2, 4, 6) if quick else (2, 3, 4, 6, 8))
    FOLDER.mkdir(parents=True, exist_ok=True)
    record = {
        "routes": rows, "quadratic_elements": elements, "time and error by order": [asdict(p) for p in points],
        "quick": quick,
    }  # fmt: skip
    if not quick:
        draw(
            points, ROUTES, FOLDER / "work_precision.png", (1, 2), lambda p: f"p = {p.size}",
            ("largest error of a stress intensity factor, better to the right", "a load step, bodies set up again, ms"), None,
        )  # fmt: skip
    write_json(FOLDER / "boundary.json", record)
    lines = [
        "How contact forces reach the cracks: errors of K against the crack solver alone under the exact tractions",
        f"{'stress MPa':>10}{'φ':>5}  {'route':<22}{'K_I':>10}{'K_II':>10}",
    ]
    lines += [
        f"{row['stress_pa'] / 1e6:10g}{row['phi_deg']:5d}  "
        f"{row['route']:<22}{row['error_k_i']:10.1e}{row['error_k_ii']:10.1e}"
        for row in rows
    ]
    lines.append("Quadratic elements with equal nodes, four to a crack, exact tractions, against order 8")
    lines += [
        f"{'':>10}{row['phi_deg']:5d}  {'':<22}{row['error_k_i']:10.1e}{row['error_k_ii']:10.1e}" for row in elements
    ]
    lines.append("Time of a load step and error of K by the elements' order")
    lines += [f"  {p.method:<18}p = {p.size}   {p.error:8.1e}   {1e3 * p.seconds:8.1f} ms" for p in points]
    named = {f"{p.method}, order {p.size}": p.error for p in points}
    named |= {
        _named(row["route"], row["phi_deg"], row["stress_pa"], mode): row[f"error_{mode}"]
        for row in rows
        for mode in ("k_i", "k_ii")
    }
    times = {f"{p.method}, order {p.size}": p.seconds for p in points}
    return Measured.of("\n".join(lines), errors=named, times=times)
