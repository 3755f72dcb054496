"""Run time against error of the stress intensity factor, by element order and kind of nodes.

A Griffith crack in four elements: the error of K_I is against the closed form, the time is assembly and solve of a
fresh body, median of repeated runs in this process after one warm-up.
"""

from __future__ import annotations

import statistics
import time

import numpy as np

ORDERS = (0, 1, 2, 3, 4, 5, 6, 8, 10)


def measure(quick: bool = False) -> str:
    """The table, one row an order; ``quick`` takes fewer repetitions."""
    from ..ddm import Body, BodyLoad
    from ..model import Cracks, DdmSettings, Material

    rock = Material("rock", 17e9, 0.21)
    half = 1.0
    crack = Cracks.from_polylines([np.array([[-half, 0.0], [half, 0.0]])], aperture=np.inf)
    exact = 1e6 * np.sqrt(np.pi * half)
    load = BodyLoad(remote_stress=np.array([0.0, 1e6, 0.0]))
    lines = [
        "Griffith crack, four elements: relative error of K_I, and time of assembly and solve",
        "  p    equal nodes   Gauss nodes   Chebyshev nodes   time, Chebyshev",
    ]
    for order in ORDERS:
        errors, seconds = {}, []
        for nodes in ("equal", "gauss", "chebyshev"):
            settings = DdmSettings(order=order, nodes=nodes)
            for repeat in range(4 if quick else 20):
                start = time.perf_counter()
                solution = Body([], crack, rock, settings).solve(load)
                if nodes == "chebyshev" and repeat:
                    seconds.append(time.perf_counter() - start)
            errors[nodes] = abs(solution.tips["k_i"][0] / exact - 1)
        lines.append(
            f"  {order:<4d} {errors['equal']:11.1e}   {errors['gauss']:11.1e}   {errors['chebyshev']:15.1e}"
            f"   {1e3 * statistics.median(seconds):9.2f} ms"
        )
    return "\n".join(lines)
