"""Blocks in motion whose cracks cannot grow in a pass are not solved for, until somebody asks what is in them.

In motion a block answers to its mean stress (`mean_stress_response`); the forces on it drive its tips, and no more. Where a
bound of K under forces of their size (`ddm.fracture.sif_bound`) is below the toughness, the pass goes on without the solution, and
gives the same blocks. The bound is found when a block has stood for a while with tips far from their toughness, or it
would cost more than it spares; and where what is left out is asked for after most passes, as by a table of all tips,
nothing is left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from ...ddm import Body, BodyLoad
    from ...ddm.fracture.sif_bound import TipBound
    from ...model import Blocks, Problem

#: Solutions of a body after which its bound is found, which takes about as long as twenty of them; …
STOOD = 5
#: … where K_eq was no more than this part of the toughness: bounds are several times larger than K.
FAR = 0.1
#: Of the toughness, what a bound has to stay below.
BELOW = 1.0 - 1e-6


class CoupledBlocks(Protocol):
    """What of a coupled run is looked at: its blocks, and by block their elastic bodies, loads and solutions."""

    problem: Problem
    blocks: Blocks
    bodies: dict[int, Body]
    loads: dict[int, BodyLoad]
    solutions: dict[int, Any]


@dataclass(eq=False)
class _Known:
    """Of a body with this ``crack_system``: how often it was ``solved``, the ``bound`` and what of K_eq a unit of K comes
    to at most; ``never``: it cannot be bounded."""

    crack_system: object
    solved: int = 0
    bound: TipBound | None = None
    per_factor: float = 0.0
    never: bool = False


@dataclass(eq=False)
class GrowthScreening:
    """``passes`` in which something was left out, and after how many of them it was ``asked`` for."""

    passes: int = 0
    asked: int = 0
    _known: dict[int, _Known] = field(default_factory=dict)

    def among(self, now: CoupledBlocks, dt: float) -> set[int]:
        """The blocks that need not be solved for under the present loads, in a step of ``dt`` s."""
        problem = now.problem
        if not _may_leave_out(problem) or 2 * self.asked > self.passes:
            return set()
        found = {block for block in now.bodies if self._cannot(now, block, dt)}
        self.passes += bool(found)
        return found

    def solved(self, now: CoupledBlocks, tips: np.ndarray, toughness: np.ndarray) -> None:
        """Blocks have been solved for, and have these ``tips``, TIP rows, of this ``toughness`` (n_tips,)."""
        if not _may_leave_out(now.problem):
            return
        near = set(tips["block"][tips["k_eq"] > FAR * toughness].tolist())
        for block in now.solutions:
            body = now.bodies[block]
            known = self._known.get(block)
            if known is None or known.crack_system is not body.crack_system:
                known = self._known[block] = _Known(body.crack_system)
            known.solved = 0 if block in near else known.solved + 1
            if known.solved == STOOD and known.bound is None and not known.never:
                self._bound(now, block, known)

    def renumber(self, parent: np.ndarray | None, whole: np.ndarray) -> None:
        """Blocks are new ones: of those that are their ``parent`` (n_blocks,), ``whole`` (k,) numbers, what is known
        stays."""
        known = self._known
        self._known = {child: known[parent[child]] for child in whole.tolist() if parent[child] in known}

    def _bound(self, now: CoupledBlocks, block: int, known: _Known) -> None:
        from ...ddm.fracture.sif_bound import TipBound, is_bounded, most_per_factor

        body = now.bodies[block]
        known.never = not is_bounded(body)
        if not known.never:
            known.bound = TipBound(body)
            known.per_factor = most_per_factor(now.problem.growth.criterion, body.material)

    def _cannot(self, now: CoupledBlocks, block: int, dt: float) -> bool:
        known, body, load = self._known.get(block), now.bodies[block], now.loads[block]
        if known is None or known.bound is None or known.crack_system is not body.crack_system:
            return False
        if load.points is not None or load.bases:
            return False
        # What drives tips to which waves take longer than a step is the mean of what was (`wave_arrival`).
        size = float(np.ptp(now.blocks.loops(block)[0], axis=0).max())
        if np.sqrt(2.0) * size > body.material.pressure_wave_speed * dt:
            return False
        k = known.bound.at_most(load)
        return bool((known.per_factor * k < BELOW * body.material.k_ic).all())


def _may_leave_out(problem: Problem) -> bool:
    """Whether nothing but growth from tips is asked of solutions: no births of cracks, trial kinks or events of faces."""
    growth = problem.growth
    moves = problem.dda.dynamic_factor != 0.0
    return moves and problem.run.skip and not (growth.initiation or growth.trial_kink or problem.run.events)
