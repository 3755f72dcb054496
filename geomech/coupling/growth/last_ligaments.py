"""Cuts the last ligament of a crack whose faces find no contact states in a step of any length, so that the run goes on.

Blades of rock thinner than the elements beside a tip may leave the contact of crack faces without a solution. A ligament
shorter than a growth increment is what the tip would pass in its next step: the tip is joined to the side or the crack ahead
of it, as by growth. What energy the ligament would have taken is not known.
"""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ... import dda, ddm
from ...model import Event
from ..coupled_state import CrackedBlocks
from .crack_growth import take_growth

log = logging.getLogger(__name__)


class _Ligament(NamedTuple):
    """Rock of this ``length``, m, ahead of the tip with number ``tip`` in its body; ``angle``, rad, from the tip's direction to
    its other side."""

    length: float
    tip: int
    angle: float


def cut_last_ligament(now: CrackedBlocks, failure: dda.NotConverged) -> tuple[Event, ...] | None:
    """Join the tip with the shortest ligament in the block whose faces found no states, by the ``failure`` of a step, to what
    is ahead of it, and warn. Returns the events of that; None where the failure has another cause, or no ligament is shorter
    than an increment. Cracks that may not grow, unbounded rock and zones of cells stay as they are."""
    from ...ddm.growth.tip_advance import advance

    cause, problem = failure.__cause__, now.problem
    if not isinstance(cause, ddm.NotConverged) or cause.block is None:
        return None
    tough = problem.materials[now.blocks.material[cause.block]].k_ic
    if not (problem.growth.max_passes and math.isfinite(tough)) or problem.endless is not None or now.bonds.size:
        return None
    tips = now.bodies[cause.block].tip_elements[0].copy()
    tips["node"] = now.nodes_of[cause.block][tips["node"]]
    for ligament in _ligaments(now, cause.block):
        # Just past the other side, by the shortest step that growth knows.
        length = 1.01 * ligament.length
        settings = replace(problem.growth, increment=length, min_increment=length, approach_steps=0.0, join_length=None)
        tips["k_eq"], tips["angle"] = 0.0, 0.0
        tips["k_eq"][ligament.tip], tips["angle"][ligament.tip] = 1.0, ligament.angle
        growth = advance(now.cracks, now.limits, tips, settings, np.ones(len(tips)), now.number)
        if not growth.joins:
            continue
        x, y = tips["point"][ligament.tip]
        log.warning(
            "t = %g s: %s. No shorter step helps: the last %.2g m of rock ahead of the tip of %s at (%.6g, %.6g), less than "
            "an increment, are cut through, whatever energy that takes",
            now.state.time, cause, ligament.length, now.cracks.names[tips["crack"][ligament.tip]], x, y,
        )  # fmt: skip
        now.crack_energy.joined()
        first, *others = take_growth(now, growth, now.state, {})
        note = f", the last {ligament.length:.2g} m cut through as its faces found no contact states"
        return replace(first, detail=first.detail + note), *others
    return None


def _ligaments(now: CrackedBlocks, block: int) -> list[_Ligament]:
    """Ligaments of ``block`` shorter than an increment, between tips and sides or other cracks ahead, the shortest first."""
    from ...ddm.growth.crack_network import nearest_on

    body = now.bodies[block]
    cracks, found = body.cracks, []
    ends = cracks.nodes[cracks.segments]
    for k, tip in enumerate(body.tip_elements[0]):
        point, (dx, dy) = tuple(tip["point"].tolist()), tip["direction"].tolist()
        others = np.concatenate([body.mesh.edges, ends[cracks.crack != tip["crack"]]])
        for a, b in others.tolist():
            length, at = nearest_on(point, tuple(a), tuple(b))
            ahead = at[0] - point[0], at[1] - point[1]
            along, across = dx * ahead[0] + dy * ahead[1], dx * ahead[1] - dy * ahead[0]
            if 0.0 < length < now.problem.growth.increment and along > 0.0:
                found.append(_Ligament(length, k, math.atan2(across, along)))
    return sorted(found)
