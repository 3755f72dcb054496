"""Skips the solution of moving blocks whose cracks cannot grow, until its results are used.

In motion a block responds to its mean stress (`mean_stress_response`), so that the full solution only gives the loading
of its tips. Where an upper bound of K under the present forces (`ddm.fracture.sif_bound`) is below the toughness, the
pass continues without that solution, with the same blocks. The bound is computed after several solutions with tips far
from their toughness; otherwise it would cost more than it saves. If skipped solutions are requested after most passes,
for example by a table of all tips, nothing is skipped. (With many cracked blocks such tables have the last solutions, see
`cycle_record`.)

On a rigid base the pressure is known from the solution alone. The bound of open cracks holds for any pressure without
tension; bounds of changes take the last pressure times a linear function, with the present force and moment
(`base_pressure`).

Faces with friction keep the slip of their last solution meanwhile (`CrackedBlocks.history`), and their bound adds up all
changes of the loads since then (`sif_change_bound`). As the next solution depends on how many steps lie between, this is
done with many cracked blocks only.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..load_transfer.base_pressure import with_earlier_pressure

if TYPE_CHECKING:
    from ...ddm import Body
    from ...ddm.fracture.sif_bound import TipBound
    from ...ddm.fracture.sif_change_bound import ChangeBound
    from ...model import Blocks, Problem

#: Number of solutions of a body before its bound is computed, which takes about as long as twenty solutions …
STOOD = 5
#: … and largest K_eq/K_Ic at which it is: bounds are several times K, or of the order of K as long as loads change.
FAR, FAR_AT_REST = 0.1, 0.5
#: Number of solutions after which it is computed in any case: as many as it costs.
STOOD_ANYWHERE = 20
#: Fraction of the toughness that the bound must not reach.
BELOW = 1.0 - 1e-6
#: The same for what loads may have changed since the last solution of faces with friction. The next solution takes the
#: path of the loads since then in one step: on a trace map K at this fraction is within 2e-3 of the toughness (bounds of
#: changes are ten times the changes and more).
OF_PATH = 0.5
#: Number of passes in a row after which a body that is left out gives up what it keeps for loads that recur: on a trace map
#: a sixth of the memory of all bodies. Computing it again takes as long as two solutions.
IDLE = 10


class CoupledBlocks(Protocol):
    """The part of a coupled run that is used: blocks, and by block their bodies, loads (`BoundaryLoad`) and solutions."""

    problem: Problem
    number: int
    blocks: Blocks
    bodies: dict[int, Body]
    loads: dict[int, Any]
    solutions: dict[int, Any]


@dataclass(eq=False)
class LastSolution:
    """The last ``solution`` of a body, of cycle ``number``."""

    solution: Any
    number: int


@dataclass(eq=False)
class _Known:
    """Data of the body with this ``crack_system``: its ``last`` solution and the ``load`` of that; number of its solutions,
    the last ones ``far`` from toughness and ``all``, and of passes without one since (``idle``); the ``bound``;
    ``per_factor``: largest K_eq per unit K; ``never``: no bound exists."""

    crack_system: object
    last: LastSolution
    load: Any
    far: int = 0
    all: int = 0
    idle: int = 0
    bound: TipBound | ChangeBound | None = None
    per_factor: np.ndarray | float = 0.0
    never: bool = False


@dataclass(eq=False)
class GrowthScreening:
    """Selects the blocks to skip. ``passes``: number of passes in which solutions were skipped; ``asked``: in how many
    of them a skipped solution was requested later."""

    passes: int = 0
    asked: int = 0
    _known: dict[int, _Known] = field(default_factory=dict)

    def among(self, now: CoupledBlocks) -> set[int]:
        """Blocks that need no solution under the present loads."""
        problem = now.problem
        # What is known of cracks before they grew keeps their matrices.
        self._known = {
            block: known
            for block, known in self._known.items()
            if block in now.bodies and known.crack_system is now.bodies[block].crack_system
        }
        if not _may_leave_out(problem) or 2 * self.asked > self.passes:
            return set()
        found = {block for block in now.bodies if self._cannot(now, block)}
        self.passes += bool(found)
        for block in sorted(found):
            self._known[block].idle += 1
            if self._known[block].idle == IDLE:
                now.bodies[block].forget_loads()
        return found

    def solved(self, now: CoupledBlocks, tips: np.ndarray, toughness: np.ndarray) -> None:
        """Take note of new solutions with these ``tips`` (TIP rows) and their ``toughness`` (n_tips,)."""
        if not _may_leave_out(now.problem):
            return
        from ...ddm.fracture.sif_change_bound import ChangeBound

        near, nearer = (set(tips["block"][tips["k_eq"] > f * toughness].tolist()) for f in (FAR, FAR_AT_REST))
        for block, solution in now.solutions.items():
            body, load = now.bodies[block], now.loads[block]
            known = self._known.get(block)
            if known is None or known.crack_system is not body.crack_system:
                known = self._known[block] = _Known(body.crack_system, LastSolution(solution, now.number), load)
            known.last, known.load = LastSolution(solution, now.number), load
            known.far = 0 if block in (nearer if _can_close(body) else near) else known.far + 1
            known.all += 1
            known.idle = 0
            enough = known.far >= STOOD or known.all >= STOOD_ANYWHERE
            if enough and known.bound is None and not known.never:
                self._bound(now, block, known)
            # A solution that meets a target error may be that of a finer body.
            same = solution.body.crack_system is known.crack_system
            if isinstance(known.bound, ChangeBound) and load.points is None and same:
                known.bound.refer(load, solution)

    def last(self, block: int) -> LastSolution:
        """The last solution of a ``block`` that is left out."""
        return self._known[block].last

    def renumber(self, parent: np.ndarray | None, whole: np.ndarray) -> None:
        """Renumber the blocks: of ``whole`` (k,) new numbers, the data of their ``parent`` (n_blocks,) are kept."""
        known = self._known
        # Without parents nothing is kept.
        kept = [] if parent is None else [(child, parent[child]) for child in whole.tolist()]
        self._known = {child: known[was] for child, was in kept if was in known}

    def _bound(self, now: CoupledBlocks, block: int, known: _Known) -> None:
        from ...ddm.fracture.sif_bound import TipBound, is_bounded, largest_k_eq_per_k
        from ...ddm.fracture.sif_change_bound import ChangeBound, changes_are_bounded

        body = now.bodies[block]
        known.per_factor = largest_k_eq_per_k(now.problem.growth.criterion, body.material)
        if is_bounded(body):
            known.bound = TipBound(body)
        elif changes_are_bounded(body) and (body.in_number or not body.rough):
            with suppress(np.linalg.LinAlgError):
                known.bound = ChangeBound(body)
        known.never = known.bound is None

    def _cannot(self, now: CoupledBlocks, block: int) -> bool:
        from ...ddm.fracture.sif_change_bound import ChangeBound

        known, body = self._known.get(block), now.bodies[block]
        load: Any = now.loads[block]
        if known is None or known.bound is None or known.crack_system is not body.crack_system:
            return False
        if load is not None and load.bases and isinstance(known.bound, ChangeBound):
            load = with_earlier_pressure(load, known.load)
        if load is None or load.points is not None:
            return False
        k_ic = body.material.k_ic
        if body.rough and isinstance(known.bound, ChangeBound):
            change = known.bound.change(load)
            if not (known.per_factor * change < OF_PATH * k_ic).all():
                return False
            k = known.bound.last_k + change
        else:
            k = known.bound.at_most(load)
        return bool((known.per_factor * k < BELOW * k_ic).all())


def _can_close(body: Body) -> bool:
    return bool(body.closing[1].any())


def _may_leave_out(problem: Problem) -> bool:
    """Whether only tip growth depends on the solutions: no crack initiation, trial kinks or events of crack faces."""
    growth = problem.growth
    moves = problem.dda.dynamic_factor != 0.0
    return moves and problem.run.skip and not (growth.initiation or growth.trial_kink or problem.run.events)
