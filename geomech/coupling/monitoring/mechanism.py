"""Detects mechanisms in static runs: blocks whose unbalanced force is carried by the inertia of the steps alone.

A static step, which carries no velocity over, solves (2M/dt² + K) d = F. In blocks that come to rest the inertia part
2M d/dt² fades from step to step and K d remains. In blocks that slide or rotate without bound it stays the same in
every step; their displacements depend on the step length and are no response to the load. Where it fades by the factor
q a step under steady loads, the displacement that is left is d q/(1 − q).
"""

from __future__ import annotations

import logging
import math
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from ... import dda
from ...model import RESTS, Blocks, Bolt, Excavation, History

log = logging.getLogger(__name__)

#: Unbalanced force, relative to the forces on a block, below which the block counts as supported while loads change …
SUPPORTED = 1e-2
#: … and under steady loads.
BALANCED = 1e-6
#: Above the first, it must have decreased by the first fraction over the second number of load steps: slowly rising
#: loads on elastic rock leave less than that limit.
FADES, STEPS = 0.1, 5
#: A block in free flight (unbalanced by nearly its weight) may still land: it is reported when it has moved this
#: fraction of its size. Under steady loads, blocks that have more than this left to move are a mechanism: a tower of
#: 100 m that sinks into its joints for hundreds of steps has a twentieth of it.
FLYING, MOVED = 0.99, 0.05
#: Number of blocks that are named.
NAMED = 4


class Mechanism:
    """Watches the load steps of a static run; reports a mechanism once, and again if blocks have been at rest in
    between.

    remaining  displacement that is left until the blocks rest, relative to the largest so far; inf: they do not fade
    lost       begin and end, s, of the load step in which balance was lost; None while there is balance
    """

    def __init__(self) -> None:
        self.ratios: list[float] = []
        self.ways: list[float] = []
        self.steady = 0
        self.remaining = 0.0
        self.fastest = ""
        self.lost: tuple[float, float] | None = None
        self.reported = self.grew_unsupported = False

    def check(self, result: dda.StepResult, blocks: Blocks, steady: bool = True) -> tuple[int, str] | None:
        """After the load step of ``result``: the fastest block and a message, if blocks have been unbalanced for
        `STEPS` load steps and the unbalanced force does not fade; otherwise None. ``steady``: the step changed no load."""
        ratio = float(result.statistics["unbalanced_ratio"])
        self.steady = self.steady + 1 if steady else 0
        self.remaining = 0.0
        if not ratio > (BALANCED if steady else SUPPORTED):
            self.ratios, self.ways, self.lost, self.reported = [], [], None, False
            return None
        end = result.state.time
        self.lost = begin, end = self.lost or (end - result.dt, end)
        self.ratios = [*self.ratios[-STEPS:], ratio]
        self.ways = [*self.ways[-STEPS:], float(np.hypot(*(result.state.vertices - blocks.vertices).T).max())]
        speed = np.hypot(*result.state.velocity[:, :2].T)
        speed[np.asarray(blocks.fixed, bool)] = 0.0
        first = int(np.argmax(speed))
        self.fastest = blocks.names[first]
        left = self._left(result, blocks)
        self.remaining = left / self.ways[-1] if self.ways[-1] > 0 else 0.0
        if self.reported or len(self.ratios) <= STEPS:
            return None
        if self.steady >= STEPS:
            lasts = left > MOVED * float(np.sqrt(blocks.areas()[first]))
        else:
            lasts = ratio > SUPPORTED and ratio >= (1.0 - FADES) * self.ratios[0]
        if not lasts or self._stretches(result, blocks, first):
            return None
        if ratio > FLYING and not _has_moved(first, result, blocks):
            return None
        self.reported = True
        moving = np.flatnonzero(speed > 0.1 * speed.max())
        moving = moving[np.argsort(-speed[moving], kind="stable")]
        named = ", ".join(blocks.names[b] for b in moving[:NAMED].tolist())
        others = len(moving) - NAMED
        return first, (
            f"nothing holds {named}{f' and {others} more' if others > 0 else ''}: {100 * ratio:.2g} % of the forces on "
            f"a block are left over, step after step, since the step from t = {begin:.4g} to {end:.4g} s"
        )

    def warn_of_growth(self, result: dda.StepResult) -> None:
        """Warn, once, that cracks grow in a static pass whose blocks are out of balance."""
        ratio = float(result.statistics["unbalanced_ratio"])
        if self.grew_unsupported or not ratio > SUPPORTED:
            return
        self.grew_unsupported = True
        log.warning(
            "t = %g s: cracks grow in a static step that balances %.2g %% of the forces on a block by inertia only "
            "(unbalanced_ratio in history.csv). Their K is that of blocks which do not rest on each other yet, and depends "
            'on the length of the step: set dda.equilibrium = "start" or "loads", or take longer steps',
            result.state.time, 100 * ratio,
        )  # fmt: skip

    def _left(self, result: dda.StepResult, blocks: Blocks) -> float:
        """Displacement, m, until the blocks rest, extrapolated over the last steps under steady loads."""
        over = min(len(self.ratios) - 1, self.steady - 1)
        if over < 1:
            return 0.0
        way = result.statistics["max_displacement_ratio"] * 0.5 * float(np.hypot(*np.ptp(blocks.vertices, axis=0)))
        fades = (self.ratios[-1] / self.ratios[-1 - over]) ** (1.0 / over)
        return way * fades / (1.0 - fades) if fades < 1.0 else math.inf

    def warn_at_the_end(self, time: float) -> None:
        """Warn if the last load step of a run, which ends at ``time`` s, has left blocks out of balance that no mechanism
        has been reported of."""
        if self.reported or not self.ratios:
            return
        known = self.steady >= 2 and len(self.ratios) >= 2
        if self.remaining <= RESTS if known else self.ratios[-1] <= SUPPORTED:
            return
        left = ""
        if known:
            part = "more than all" if self.remaining > 1.0 else f"about {100 * self.remaining:.2g} %"
            left = f", and {self.fastest} has {part} of its present displacement still to go"
        log.warning(
            "t = %g s: the static run ends out of balance: %.2g %% of the forces on a block are balanced by inertia only "
            "(unbalanced_ratio in history.csv)%s. Where blocks are then depends on the length of steps, and bolts, joints "
            'or other blocks may not bear yet what they will: set dda.equilibrium = "loads", or take longer or more steps',
            time, 100 * self.ratios[-1], left,
        )  # fmt: skip

    def _stretches(self, result: dda.StepResult, blocks: Blocks, block: int) -> bool:
        """Whether a bolt that is being stretched will stop the ``block``: its force, extrapolated along the present
        motion, balances the rest before the block has moved `MOVED` of its size."""
        bolts = result.state.bolts
        if not (bolts["installed"] & ~bolts["broken"]).any():
            return False
        gained, way = self.ratios[0] - self.ratios[-1], self.ways[-1] - self.ways[0]
        return gained > 0 and way * self.ratios[-1] <= gained * MOVED * float(np.sqrt(blocks.areas()[block]))


def loads_are_steady(loads: Any, begin: float, end: float) -> bool:
    """Whether nothing in ``loads``, a record or several, changes from ``begin`` to ``end`` s."""
    if isinstance(loads, History):
        return loads.is_steady(begin, end)
    if isinstance(loads, (tuple, list)):
        return all(loads_are_steady(each, begin, end) for each in loads)
    if isinstance(loads, Excavation) or (isinstance(loads, Bolt) and loads.installation > begin):
        return not begin <= (loads.time if isinstance(loads, Excavation) else loads.installation) <= end
    if is_dataclass(loads):
        return all(loads_are_steady(getattr(loads, field.name), begin, end) for field in fields(loads))
    return True


def _has_moved(block: int, result: dda.StepResult, blocks: Blocks) -> bool:
    own = slice(blocks.vertex_start[block], blocks.vertex_start[block + 1])
    way = np.hypot(*(result.state.vertices[own] - blocks.vertices[own]).T)
    return bool(way.min() > MOVED * np.sqrt(blocks.areas()[block]))
