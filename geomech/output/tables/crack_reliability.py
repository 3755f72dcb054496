"""Reliability of the crack solver's last results: residual and condition of its equations, and the error of K."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from geomech.model import Cycle

#: Number of bodies up to which all are looked at: their K are solved for on a finer mesh, which doubles their cost.
ESTIMATED = 10
#: Of more bodies, the number of those with the hardest driven tips: their boundaries are assembled and factored once more
#: (ten of the 49 bodies of a trace map took a quarter of the time of a whole second of motion).
OF_MANY = 3
#: Unknowns up to which they are, where there are more bodies. A finer mesh has twice as many: of 4 000, it took half a GB
#: and a tenth of the time of a second of motion, for the summary alone.
ESTIMATED_UP_TO = 2500
#: Smaller residuals are round-off, whose last digits depend on the location of arrays in memory.
ROUND_OFF = 1e-12
_log = logging.getLogger(__name__)


def _three_digits(number: float) -> float:
    """Further digits of an estimate have no meaning, and a resumed run must report the same."""
    return float(f"{number:.2e}")


def crack_trust(cycle: Cycle) -> dict[str, Any]:
    """Worst values over the cracked blocks of ``cycle``; of more than `ESTIMATED`, over the `OF_MANY` with the hardest driven
    tips among those of up to `ESTIMATED_UP_TO` unknowns (if there are none, among all).

    ``residual`` of equilibrium relative to the largest traction (at least `ROUND_OFF`), ``condition`` of the equations,
    and the estimated error of K relative to the largest K of its block, with that block (not of larger ones of many).
    """
    drive = {b: float(cycle.tips["k_eq"][cycle.tips["block"] == b].max(initial=0.0)) for b in cycle.bodies}
    few = len(drive) <= ESTIMATED
    asked = [b for b, body in cycle.bodies.items() if few or body.body.n_unknowns <= ESTIMATED_UP_TO]
    looked_at = sorted(asked or drive, key=lambda b: (-drive[b], b))[: ESTIMATED if few else OF_MANY]
    summary: dict[str, Any] = {
        "residual": _three_digits(max(ROUND_OFF, *(float(cycle.bodies[b].residual) for b in looked_at))),
        "condition": _three_digits(max(float(cycle.bodies[b].condition) for b in looked_at)),
    }
    for block in looked_at if asked else ():
        body = cycle.bodies[block]
        largest = float(np.hypot(body.tips["k_i"], body.tips["k_ii"]).max(initial=0.0))
        if largest == 0.0:
            continue
        try:
            error = float(body.tip_errors.max()) / largest
        except (ValueError, RuntimeError, ArithmeticError, np.linalg.LinAlgError) as failure:
            _log.info("no error estimate for K in %s: %s", cycle.blocks.names[block], failure)
            continue
        if error > summary.get("k_error", -1.0):
            summary["k_error"], summary["k_error_block"] = error, cycle.blocks.names[block]
    if "k_error" in summary:
        summary["k_error"] = _three_digits(summary["k_error"])
    return summary
