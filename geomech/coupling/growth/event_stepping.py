"""Event stepping: load steps that end at events instead of after a fixed time.

An event is the load at which the most highly loaded tip has K_eq = K_Ic, intact rock reaches its strength, or a contact
or crack face changes its state (`first_state_change`). Between changes of state K is nearly linear in the load, so that
a secant search finds the time of the event in two or three solutions, all from the same start. The loads at which
cracks start, coalesce and cut through then do not depend on the time step.

With control "toughness" the load follows the cracks: every increment of growth is made at the load at which the most
highly loaded tip has K_eq = K_Ic, whether that load is higher than the last one (stable growth) or lower (growth that
would be unstable under constant load). Time is then only the parameter of the load functions, and decreases where the
load does.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from ... import dda
from ...dda.excavation import until_next_event
from ...model import Problem
from ..coupled_state import CrackedBlocks
from ..load_pass import Balance
from ..load_path import histories
from ..load_transfer.unbounded_rock import solved_pass
from .crack_growth import drive
from .first_state_change import FOUND, FirstChange
from .root_finding import Crossing

#: Tolerance of an event: |K_eq/K_Ic − 1|.
SETTLED = 1e-6
#: Tips within this fraction of their toughness grow with the one that has reached it: symmetric tips differ by rounding
#: and must not be separated by it.
TOGETHER = 1e-3
#: Forces are in equilibrium in the configuration at the start of a step. A step to an event that would move blocks by
#: more than NEAR (in units of half the diagonal, as ``max_displacement_ratio``) covers the fraction APPROACH of the
#: way, and the next step the rest: the error of K at the event is then at most NEAR times the sensitivity of K to the
#: block shape.
NEAR, APPROACH = 1e-5, 0.98
#: The same for frictional crack faces, whose state depends on the load path by more than that: steps to events go all
#: the way, and other steps no farther than this.
NEAR_ROUGH = 1e-3
#: With frictional faces, a falling load is searched in steps of this factor.
FURTHER_BACK = 0.75
#: Steps between events aim at this fraction of the allowed displacement.
USE = 0.8
#: Most times the way of a step whose end has no state is halved.
NEARER = 6
#: Most solutions of one search, and most of them before the event is enclosed.
MOST, OPEN = 40, 5
#: Relative difference below which two times are the same, of times beyond the fraction SOON of a time step. An event
#: between two such times is a jump of K (faces that close or start to slip, or loads that act from the beginning); tips
#: grow at the later one.
JUMP, SOON = 1e-6, 1e-3


class EventSteps:
    """The first pass of every load step of a static run, with its length predicted from the last steps."""

    def __init__(self, problem: Problem) -> None:
        run, timed = problem.run, histories(problem.loads)
        if problem.endless is not None:
            timed += problem.endless.histories
        self.time_step, self.follows = problem.dda.time_step, run.control == "toughness"
        self._corners = np.unique(np.concatenate([np.asarray(h.times, dtype=float) for h in timed]))
        # Between the corners of piecewise linear histories a step may have any length; within a sinusoid it may not.
        swings = any(h.wave is not None for h in timed)
        self._longest = run.longest_step or (self.time_step if swings else math.inf)
        #: Largest K_eq/K_Ic at the start of the step, and its rate, 1/s; None: not known yet.
        self._drive: float | None = 0.0
        self._rate = 0.0
        #: The pass at the loads of the step's start, with K_eq/K_Ic − 1 there, where growth has changed K since.
        self._at_start: tuple[Balance, float] | None = None
        #: Displacement ratio per second in the last step; None before the first.
        self._pace: float | None = None
        #: Whether crack faces have friction.
        self._rough = False
        #: Whether the last first pass ended at an event.
        self.reached = False
        #: Changes of state of contacts and crack faces.
        self.changes = FirstChange(("contacts", "faces") if run.events is None else run.events)

    def look(self, now: CrackedBlocks) -> None:
        """Solve the pass at the loads of the next step's start, if growth has changed K there: only then is it known
        whether the step goes back or ahead. Raises `dda.NotConverged`."""
        self._rough = any(body.rough for body in now.bodies.values())
        if self._drive is not None:
            return
        self._at_start = self._at(now, now.state.time, 0.0)
        self._drive = 1 + self._at_start[1]
        self._rate *= self._drive

    def first_pass(self, now: CrackedBlocks, end: float) -> Balance:
        """Move the blocks to the next event, or towards it as far as one step may go, at most to the time ``end``; with
        control "toughness" back to it where it is at a lower load. ``reached`` then says whether the event was reached.
        Raises `dda.NotConverged`."""
        start = now.state.time
        self.look(now)
        assert self._drive is not None
        found, excess = (None, self._drive - 1) if self._at_start is None else self._at_start
        self._at_start = None
        search = Crossing(self._rate)
        search.add(start, excess)
        if found is None or abs(excess) > SETTLED:
            back = self.follows and excess > 0
            found, excess = self._back(now, search) if back else self._ahead(now, search, end)
        else:
            self.reached = True
        self._drive, self._rate = 1 + excess, search.slope
        return found

    def after(self, now: CrackedBlocks, found: Balance) -> None:
        """The load step has ended with the pass ``found``, at the load of its first pass and without growth."""
        before, self._drive = self._drive, drive(now, found)
        # Where loads are proportional to time, and nearly so in most other cases, the rate is proportional to K.
        self._rate *= self._drive / before if before else 1.0
        self.changes.after(now, found)

    def grown(self) -> None:
        """The load step has ended with growth."""
        self._drive = None
        self.changes.grown()

    def _ahead(self, now: CrackedBlocks, search: Crossing, end: float) -> tuple[Balance, float]:
        start = now.state.time
        limit = self._limit(now, start, end)
        event = search.next
        if event <= start:
            # Tips still exceed their toughness after the last growth.
            event = limit = min(limit, start + self.time_step)
        whole = event <= limit and not self._far(event - start)
        aim = event if whole else min(start + APPROACH * (event - start), limit)
        if self._rough and self._pace:
            # While faces stick, the rate does not predict the event.
            aim = min(aim, start + NEAR_ROUGH / self._pace)
        if self.changes.expected is not None:
            aim = min(aim, max(self.changes.expected * (1 + FOUND), start + FOUND * limit))
            self.changes.expected = None
        found, excess, nearer = self._first(now, aim, limit - start)
        whole = whole and not nearer
        for k in range(MOST):
            if k:
                found, excess = self._at(now, aim, limit - start)
            at = found.result.state.time
            search.add(at, excess)
            same = JUMP * max(abs(at), SOON * self.time_step)
            self.reached = abs(excess) <= SETTLED or (excess > 0 and search.width <= same)
            searches_on = whole and (search.enclosed or (at < limit and k < OPEN)) and not self.changes.reached
            if self.reached or (excess < 0 and not searches_on):
                break
            if search.next <= start:
                # Tips exceed their toughness from the start of the step, after the last growth; the load is not reduced
                # for them.
                self.reached = True
                break
            aim = min(search.next, limit)
            whole = whole or not self._far(aim - start)
            if not whole:
                # The event is within a long step.
                aim = start + APPROACH * (aim - start)
        else:
            self.reached = excess > 0
        return found, excess

    def _first(self, now: CrackedBlocks, aim: float, most: float) -> tuple[Balance, float, bool]:
        """A pass at the loads of the time ``aim`` as in `_at`, or where blocks and cracks find no state there, as far
        beyond the breaking of much cement, nearer by halves; and whether it is nearer. Raises `dda.NotConverged`."""
        start = now.state.time
        for nearer in range(NEARER + 1):
            try:
                return *self._at(now, start + 0.5**nearer * (aim - start), most, free=True), nearer > 0
            except dda.NotConverged:
                if nearer == NEARER:
                    raise
        raise AssertionError("unreachable: the last pass returns or raises")

    def _back(self, now: CrackedBlocks, search: Crossing) -> tuple[Balance, float]:
        """Reduce the load to that at which K_eq = K_Ic for the most highly loaded tip; to zero if K_eq stays above."""
        start = now.state.time
        # Frictional faces continue to slip as the crack grows under a falling load. If the way back were divided into
        # two steps, they would stick in the second, without growth, and keep K constant however far the load falls.
        rough = self._rough
        limit = max(0.0, start - self._most(now))
        whole = rough or (search.next >= limit and not self._far(start - search.next))
        aim = search.next if whole else max(start - APPROACH * (start - search.next), limit)
        for _ in range(MOST):
            found, excess = self._at(now, aim, start - limit, look=not rough)
            at = found.result.state.time
            search.add(at, excess)
            self.reached = abs(excess) <= SETTLED or (excess > 0 and (at == 0.0 or search.width <= JUMP * at))
            searches_on = whole and (search.enclosed or at > limit) and not self.changes.reached
            if self.reached or (excess > 0 and not searches_on):
                break
            aim = max(search.next, limit)
            if rough and not search.enclosed:
                # K hardly changes while faces stick, so that the rate does not predict the event.
                aim = max(aim, FURTHER_BACK * at)
            whole = whole or not self._far(start - aim)
            if not whole:
                aim = start - APPROACH * (start - aim)
        else:
            self.reached = True
        return found, excess

    def _at(
        self, now: CrackedBlocks, time: float, most: float, free: bool = False, look: bool = True
    ) -> tuple[Balance, float]:
        """A pass at the loads of ``time`` from the start of the step, and K_eq/K_Ic − 1 there. With ``look``, the pass
        is that of the first change of state on the way, if there is one. ``most`` s: longest step; a ``free`` step may
        be cut by the displacement limit."""
        found = self._solve(now, time, free)
        if look:
            found = self.changes.first(
                now, found, partial(self._solve, now), partial(self._towards, now.state.time), most
            )
        else:
            self.changes.reached = False
        return found, drive(now, found) - 1

    def _solve(self, now: CrackedBlocks, time: float, free: bool = False) -> Balance:
        way = time - now.state.time
        # The length of a static step only sets its inertia; short steps would hold the blocks back.
        found = solved_pass(now, max(abs(way), self.time_step), None if free and way >= self.time_step else time)
        way = found.result.state.time - now.state.time
        if way != 0:
            self._pace = found.result.statistics["max_displacement_ratio"] / abs(way)
        return found

    def _towards(self, start: float, event: float) -> float:
        """How far a step from ``start`` may go to arrive exactly at the ``event``: there, or most of the way."""
        return start + APPROACH * (event - start) if self._far(abs(event - start)) else event

    def _far(self, way: float) -> bool:
        return self._pace is None or self._pace * way > (NEAR_ROUGH if self._rough else NEAR)

    def may_pass(self, now: CrackedBlocks, end: float) -> bool:
        """Whether the next first pass would go beyond the time ``end`` s if that did not limit it, as far as
        predictable: no tip is expected to reach its toughness before."""
        start = now.state.time
        if self._limit(now, start, math.inf) <= end:
            return False
        if self._drive is None:
            return True
        if self._drive > 1.0:
            # Back to the load at which it grows; or ahead by one time step.
            return not self.follows and start + self.time_step > end
        return self._rate <= 0.0 or start + (1.0 - self._drive) / self._rate > end

    def _limit(self, now: CrackedBlocks, start: float, end: float) -> float:
        """The latest time to which a step from ``start`` may go, s."""
        stage = until_next_event(now.problem.loads, start, end - start)
        corner = self._corners[np.searchsorted(self._corners, start * (1 + 1e-12), side="right") :]
        return min(start + min(stage, self._most(now)), *corner[:1].tolist(), end)

    def _most(self, now: CrackedBlocks) -> float:
        """The longest step, s, from the speed of the blocks in the last one."""
        if not self._pace:
            return min(self._longest, math.inf if self._pace == 0 else self.time_step)
        return min(self._longest, max(self.time_step, USE * now.system.settings.max_displacement_ratio / self._pace))
