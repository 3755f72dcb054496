"""First line of a specimen's run that reached the end of its loads before any of its stop events."""

from __future__ import annotations

import math
from collections.abc import Container

from geomech.model import Cycle, Problem

from .units import stress_text

#: Rock in a press is linear elastic up to strains of some thousandths; loads with larger strains are reported.
ELASTIC = 5e-3


def unreached(problem: Problem, last: Cycle | None, happened: Container[str]) -> str:
    """First line for a run of cracked rock under a leading load that ended with its time; "" for other runs.

    ``last`` is the last cycle; none of the events that were to stop the run has ``happened``.
    """
    stops = problem.run.stop_at
    if last is None or not problem.cracks.n_cracks or not stops or any(kind in happened for kind in stops):
        return ""
    if all(math.isinf(material.k_ic) for material in problem.materials) and not problem.growth.initiation:
        return ""  # nothing grows: no strength was asked for
    if not math.isfinite(last.load) or last.load == 0.0 or last.state.time < problem.run.end_time * (1 - 1e-9):
        return ""
    strain = f" and a strain of {100 * abs(last.strain):.2g} %" if math.isfinite(last.strain) else ""
    text = f"no {' or '.join(stops)} until the last load, {stress_text(last.load, 3)}{strain}: the largest load is no strength"
    if math.isfinite(last.strain) and abs(last.strain) > ELASTIC:
        text += ", and rock is not elastic at such strains"
    return text
