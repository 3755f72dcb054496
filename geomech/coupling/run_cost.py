"""Processor time of a whole run, estimated before it: cycles times the time of a cycle.

A step of blocks takes a time proportional to their number. In motion most cracked blocks respond to their mean stress, and
those whose cracks grow are set up again, some times in the run; in statics every cycle solves all of them, in several passes,
and sets up those that grow (`crack_cost`). How many iterations the contacts need, and where cracks grow, is known only
afterwards.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..model import Problem, counted, duration_text
from .crack_cost import CrackCost, crack_cost

#: Seconds to start a run, of every cycle with its output, of a step of each moving block, and of a cycle of each cracked
#: one in motion and in statics. Fitted by eye to the scenes of `tests/coupling/test_run_cost.py`, four more of `geometry/`
#: and `pipelines/`, and a section of a trace map (207 blocks, 48 of them cracked, one second of motion), on one thread.
START, CYCLE, BLOCK, CRACKED, AT_REST = 2.0, 8e-3, 3.5e-4, 4e-3, 0.05
#: Parts of the time to set up all cracked blocks: of all growth in motion, and of each cycle in statics.
GROWTH, STATIC = 2.0, 5.0
#: Measured times of these scenes are within a factor of two of the estimate; contacts that chatter, and cracks that grow
#: everywhere, take longer.
WITHIN = 4.0


class RunCost(NamedTuple):
    """Number of ``cycles`` (0: unknown, steps end at events), and seconds of processor time ``once`` and ``each``
    cycle."""

    cycles: int
    once: float
    each: float

    @property
    def seconds(self) -> float:
        """Of the whole run."""
        return self.once + self.cycles * self.each


def run_cost(problem: Problem, cracks: CrackCost | None = None) -> RunCost:
    """Cost of a run of ``problem`` to its end time; ``cracks``: its `crack_cost`, if known. Raises ValueError if rock is
    too thin for elements."""
    moves = problem.dda.dynamic_factor != 0.0
    once, each = START, CYCLE + BLOCK * int((~problem.blocks.fixed).sum())
    if problem.cracks.n_cracks and problem.endless is None:
        cracks = crack_cost(problem) if cracks is None else cracks
        once += cracks.seconds * (1.0 + (GROWTH if moves else 0.0))
        each += CRACKED * len(cracks.blocks) if moves else AT_REST * len(cracks.blocks) + STATIC * cracks.seconds
    fixed = problem.run.stepping == "fixed"
    return RunCost(math.ceil(problem.run.end_time / problem.dda.time_step - 1e-9) if fixed else 0, once, each)


def run_line(problem: Problem, cracks: CrackCost | None = None) -> str:
    """One line that states the `run_cost`."""
    cost = run_cost(problem, cracks)
    if not cost.cycles:
        return f"about {duration_text(cost.once)} of processor time and {duration_text(cost.each)} a cycle, within a factor of {WITHIN:g}"
    return (
        f"about {duration_text(cost.seconds)} of processor time to the end, within a factor of {WITHIN:g}: "
        f"{counted(cost.cycles, 'cycle')} of {duration_text(cost.each)}, {duration_text(cost.once)} besides"
    )
