"""A specimen's run that came to the end of its loads before anything that it was to stop at: what it says first."""

from __future__ import annotations

import math
from collections.abc import Container

from geomech.model import Cycle, Problem

from .units import stress_text

#: Rock under a press is linear elastic up to strains of some thousandths; loads that strain it by more are reported.
ELASTIC = 5e-3


def unreached(problem: Problem, last: Cycle | None, happened: Container[str]) -> str:
    """What to say first of a run of cracked rock under a leading load that has ended with its time, with ``last`` its last
    cycle, while none of the events that were to stop it has ``happened``; "" of others."""
    stops = problem.run.stop_at
    if last is None or not problem.cracks.n_cracks or not stops or any(kind in happened for kind in stops):
        return ""
    if not math.isfinite(last.load) or last.load == 0.0 or last.state.time < problem.run.end_time * (1 - 1e-9):
        return ""
    strain = f" and a strain of {100 * abs(last.strain):.2g} %" if math.isfinite(last.strain) else ""
    text = f"no {' or '.join(stops)} until the last load, {stress_text(last.load, 3)}{strain}: the largest load is no strength"
    if math.isfinite(last.strain) and abs(last.strain) > ELASTIC:
        text += ", and rock is not elastic at such strains"
    return text
