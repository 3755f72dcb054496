"""Hundreds of cracks, and an outline of thousands of elements: iterative compared with direct solution.

Cracks of lengths 1 to 6 in the infinite plane, each in a cell of its own, under one load that opens them; processor
time of one or more threads, matrices and solution together, with a new body. The outline is that of a square with one
crack: time to make it, and the first and another load.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from ..figures import Measured

#: The numbers of cracks are the squares of these; networks beyond ``FACTORED`` cracks per side are not factored
#: (minutes, many gigabytes).
FOLDER = Path("outputs/bench_many")
SIDES, FACTORED = (5, 7, 11, 16, 23, 36), 16
#: Elements per side of the square that is solved iteratively.
ON_A_SIDE = 500


def measure(quick: bool = False) -> Measured:
    """The table; writes ``many.png`` to `FOLDER`. ``quick`` leaves out everything longer than a second."""
    from ...ddm import Body, BodyLoad
    from ...model import Cracks, DdmSettings, Material
    from ...reference.cracks.crack_arrays import cracks_in_cells
    from ...render.benchmarks.bars import draw_bars

    rock = Material("rock", 10e9, 0.25)
    load = BodyLoad(remote_stress=np.array([0.2e6, 1e6, 0.3e6]))

    def solved(cracks: Cracks, solver: str):
        start = time.process_time()
        solution = Body([], cracks, rock, DdmSettings(solver=solver)).solve(load)
        tips = solution.tips
        return solution, np.stack([tips["k_i"], tips["k_ii"]]), time.process_time() - start

    errors, times = {}, {}
    lines = [
        "many cracks in the infinite plane: processor time of matrices and solution",
        "  cracks  unknowns   iterated   products   factored   largest difference of K",
    ]
    for side in SIDES[: -2 if quick else None]:
        cracks = Cracks.from_polylines(cracks_in_cells(side), aperture=np.inf)
        solution, k, seconds = solved(cracks, "compressed")
        body = solution.body
        times[f"{cracks.n_cracks} cracks, iterated"] = seconds
        row = f"  {cracks.n_cracks:6d}  {body.faces.n_unknowns:8d} {seconds:8.2f} s {body.crack_system.products:10d}"
        if side <= (7 if quick else FACTORED):
            _, exact, longer = solved(cracks, "dense")
            error = errors[f"{cracks.n_cracks} cracks, iterated against factored"] = (
                np.abs(k - exact).max() / np.abs(exact).max()
            )
            times[f"{cracks.n_cracks} cracks, factored"] = longer
            row += f" {longer:8.2f} s   {error:.1e}"
        lines.append(row)
    if not quick:
        lines += ["", _outline(times, errors)]
    ways = {
        way: {name.removesuffix(f", {way}"): spent for name, spent in times.items() if name.endswith(f", {way}")}
        for way in ("iterated", "factored")
    }
    title = "Many cracks: matrices and solution"
    if not quick:
        draw_bars(ways, FOLDER / "many.png", "seconds of processor", title)
    return Measured.of("\n".join(lines), errors=errors, times=times)


def _outline(times: dict[str, float], errors: dict[str, float]) -> str:
    from ...ddm import Body, BodyLoad
    from ...model import Cracks, DdmSettings, Material
    from ..accuracy.crack_problems import rectangle

    rock, crack = Material("rock", 10e9, 0.25), [np.array([[-0.3, -0.1], [0.3, 0.2]])]
    cracks = Cracks.from_polylines(crack, aperture=np.inf)
    loads = [BodyLoad(remote_stress=np.array(stress)) for stress in ([0.2e6, 1e6, 0.3e6], [1e6, 0.1e6, 0.3e6])]
    start = time.process_time()
    body = Body([rectangle(1, 1)], cracks, rock, DdmSettings(elements_per_side=ON_A_SIDE))
    spent = [time.process_time() - start]
    for load in loads:
        start = time.process_time()
        solution = body.solve(load)
        spent.append(time.process_time() - start)
    few = Body([rectangle(1, 1)], cracks, rock).solve(loads[-1]).tips["k_i"]
    k, n = solution.tips["k_i"], body.boundary.n_unknowns
    errors["outline, iterated, against few elements"] = error = np.abs(k - few).max() / np.abs(few).max()
    names = ("made", "first load", "another")
    times |= {f"outline of {n} unknowns: {name}": s for name, s in zip(names, spent)}
    times_text = ", ".join(f"{name} {s:.1f} s" for name, s in zip(names, spent))
    return f"an outline of {n} unknowns, iterated: {times_text}; K within {error:.0e} of that with few elements"
