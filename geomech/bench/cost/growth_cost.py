"""Cost of a growth increment: rows and columns of new elements compared with a new body, 40 increments in a row."""

from __future__ import annotations

import math
import statistics
from dataclasses import replace

import numpy as np

from ...model import Cracks, DdmSettings
from ..accuracy.crack_problems import ROCK, factors, specimen
from ..figures import stopwatch


def measure(increments: int = 40) -> dict:
    """Growth of both outer tips of the two slots along wings of 0.5 mm increments that turn to the load.

    Medians over the increments and sums, s; the largest difference of a K between both ways, relative to the largest K;
    and the number of complete factorisations of the crack equations.
    """
    from ...ddm import Body, Reuse

    problem = specimen()
    networks = [_grown(problem.cracks, k) for k in range(increments + 1)]
    settings = DdmSettings()
    incremental, fresh, difference, elements = [], [], 0.0, 0
    body = Body([problem.outline], networks[0], ROCK, settings)
    body.solve(problem.load)
    for cracks in networks[1:]:
        spent_on = stopwatch()
        body = Body([problem.outline], cracks, ROCK, settings, reuse=Reuse(body, body.work))
        k = factors(body.solve(problem.load))
        incremental.append(spent_on())
        spent_on = stopwatch()
        alone = Body([problem.outline], cracks, ROCK, settings)
        k_alone = factors(alone.solve(problem.load))
        fresh.append(spent_on())
        difference = max(difference, float(np.abs(k - k_alone).max() / np.abs(k_alone).max()))
        elements = alone.counts["elements"]
    return {
        "increments": increments,
        "elements_at_the_end": elements,
        "incremental_s": statistics.median(incremental),
        "fresh_s": statistics.median(fresh),
        "all_incremental_s": sum(incremental),
        "all_fresh_s": sum(fresh),
        "difference": difference,
        "factorisations": body.work.crack_factorisations,
    }


def _grown(cracks: Cracks, increments: int, length: float = 0.5e-3) -> Cracks:
    """The two slots with a wing of ``increments`` increments at either outer tip: it starts at 80° and turns
    upright."""
    if not increments:
        return cracks
    nodes, segments, source = list(cracks.nodes), list(map(tuple, cracks.segments)), list(range(cracks.n_segments))
    birth = list(cracks.birth_cycle)
    for segment, tip, up in ((0, 1, 1.0), (1, 2, -1.0)):
        at = tip
        for k in range(increments):
            heading = math.radians(90 + 35 * math.exp(-k / 8))
            nodes.append(nodes[at] + up * length * np.array([math.cos(heading), math.sin(heading)]))
            segments.append((at, len(nodes) - 1))
            source.append(segment)
            birth.append(k + 1)
            at = len(nodes) - 1
    grown = len(nodes) - len(cracks.nodes)
    return replace(
        cracks,
        nodes=np.array(nodes),
        segments=np.array(segments),
        birth_cycle=np.array(birth),
        surface=np.concatenate([cracks.surface, np.zeros(grown, bool)]),
        **{name: getattr(cracks, name)[source] for name in ("crack", "block", "aperture", "law")},
    )
