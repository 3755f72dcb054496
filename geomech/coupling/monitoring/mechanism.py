"""Detects mechanisms in static runs: blocks whose unbalanced force is carried by the inertia of the steps alone.

A static step, which carries no velocity over, solves (2M/dt² + K) d = F. In blocks that come to rest the inertia part
2M d/dt² fades from step to step and K d remains. In blocks that slide or rotate without bound it stays the same in
every step; their displacements depend on the step length and are no response to the load.
"""

from __future__ import annotations

import logging

import numpy as np

from ... import dda
from ...model import Blocks

log = logging.getLogger(__name__)

#: Unbalanced force, relative to the forces on a block, below which the block counts as supported.
SUPPORTED = 1e-2
#: Above that, it must have decreased by the first fraction over the second number of load steps. Slowly rising loads on
#: elastic rock leave less than the limit above, and settling blocks fade faster: a column of 100 m, in steps of 10 ms,
#: by a third.
FADES, STEPS = 0.1, 5
#: A block in free flight (unbalanced by nearly its weight) may still land: it is reported when it has moved this
#: fraction of its size.
FLYING, MOVED = 0.99, 0.05
#: Number of blocks that are named.
NAMED = 4


class Mechanism:
    """Watches the load steps of a static run; reports a mechanism once, and again if blocks have been at rest in
    between."""

    def __init__(self) -> None:
        self.ratios: list[float] = []
        self.ways: list[float] = []
        self.reported = False

    def check(self, result: dda.StepResult, blocks: Blocks) -> tuple[int, str] | None:
        """After the load step of ``result``: the fastest block and a message, if blocks have been unbalanced for
        `STEPS` load steps and the unbalanced force does not fade; otherwise None."""
        ratio = float(result.statistics["unbalanced_ratio"])
        if not ratio > SUPPORTED:
            self.ratios, self.ways, self.reported = [], [], False
            return None
        self.ratios = [*self.ratios[-STEPS:], ratio]
        self.ways = [*self.ways[-STEPS:], float(np.hypot(*(result.state.vertices - blocks.vertices).T).max())]
        if self.reported or len(self.ratios) <= STEPS or ratio < (1.0 - FADES) * self.ratios[0]:
            return None
        speed = np.hypot(*result.state.velocity[:, :2].T)
        speed[np.asarray(blocks.fixed, bool)] = 0.0
        if self._stretches(result, blocks, int(np.argmax(speed))):
            return None
        if ratio > FLYING and not _has_moved(int(np.argmax(speed)), result, blocks):
            return None
        self.reported = True
        moving = np.flatnonzero(speed > 0.1 * speed.max())
        moving = moving[np.argsort(-speed[moving], kind="stable")]
        named = ", ".join(blocks.names[b] if blocks.names else f"block {b}" for b in moving[:NAMED].tolist())
        others = len(moving) - NAMED
        return int(moving[0]), (
            f"nothing holds {named}{f' and {others} more' if others > 0 else ''}: {100 * ratio:.2g} % of the forces on "
            "a block are left over, step after step"
        )

    def warn_at_the_end(self, time: float) -> None:
        """Warn if the last load step of a run, which ends at ``time`` s, has left blocks out of balance that no mechanism
        has been reported of."""
        if self.reported or not self.ratios:
            return
        log.warning(
            "t = %g s: the static run ends out of balance: %.2g %% of the forces on a block are balanced by "
            "inertia only (unbalanced_ratio in history.csv). The block has not reached the position in which bolts, joints or "
            'other blocks support it: set dda.equilibrium = "loads", or take longer steps',
            time, 100 * self.ratios[-1],
        )  # fmt: skip

    def _stretches(self, result: dda.StepResult, blocks: Blocks, block: int) -> bool:
        """Whether a bolt that is being stretched will stop the ``block``: its force, extrapolated along the present
        motion, balances the rest before the block has moved `MOVED` of its size."""
        bolts = result.state.bolts
        if not (bolts["installed"] & ~bolts["broken"]).any():
            return False
        gained, way = self.ratios[0] - self.ratios[-1], self.ways[-1] - self.ways[0]
        return gained > 0 and way * self.ratios[-1] <= gained * MOVED * float(np.sqrt(blocks.areas()[block]))


def _has_moved(block: int, result: dda.StepResult, blocks: Blocks) -> bool:
    own = slice(blocks.vertex_start[block], blocks.vertex_start[block + 1])
    way = np.hypot(*(result.state.vertices[own] - blocks.vertices[own]).T)
    return bool(way.min() > MOVED * np.sqrt(blocks.areas()[block]))
