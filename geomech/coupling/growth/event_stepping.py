"""Load steps that end where something happens: at the time, and so at the load, at which the most driven tip has just
K_eq = K_Ic, or whole rock its strength, or a contact or a crack face changes its state (`first_state_change`), instead of at
the end of the fixed step in which that comes about.

While nothing changes state K is nearly linear in the load, so secants find that time in two or three solutions, all of
them steps from the same start. On the way there steps are as long as blocks may move in one. Loads at which tips start,
join and cut through then do not depend on the time step.

With control "toughness" the load follows the cracks: every increment of growth is made at the load at which the most
driven tip has K_eq = K_Ic, whether that is higher than the last one (stable growth) or lower (growth that would run
away under a dead load). Time is then no more than what the loads are functions of, and goes back where the load does.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from ...dda.excavation import until_next_event
from ...model import Problem
from ..coupled_state import CrackedBlocks
from ..load_pass import Balance
from ..load_path import histories
from ..load_transfer.unbounded_rock import solved_pass
from .crack_growth import drive
from .first_state_change import FOUND, FirstChange
from .root_finding import Crossing

#: An event is found when the drive, K_eq/K_Ic, is off one by less than this.
SETTLED = 1e-6
#: Tips driven within this part of their toughness grow with the one that has reached it: images of one another by
#: symmetry differ by the rounding of their paths, which must not part them.
TOGETHER = 1e-3
#: Forces are in equilibrium on the geometry at the start of a step. A step to an event that would move blocks by more
#: than the first (in units of half the diagonal, as ``max_displacement_ratio``) goes the second part of the way, and the
#: next one the rest: K at the event is then off by no more than the former, times what K depends on the shape of the
#: blocks.
NEAR, APPROACH = 1e-5, 0.98
#: The same where crack faces have friction, of which a step leaves more than that: steps to events go all the way, and on the
#: way to none no farther.
NEAR_ROUGH = 1e-3
#: A load that falls while faces with friction hold K is sought in parts of the last one.
FURTHER_BACK = 0.75
#: Steps on the way are to move blocks by this part of what a step may.
USE = 0.8
#: Solutions that one search may take, and those without the event between two of them.
MOST, OPEN = 40, 5
#: Two times nearer than this part of themselves are one. An event between them is a jump of the drive (faces that close
#: or begin to slip), and tips grow at the later one, beyond it.
JUMP = 1e-6


class EventSteps:
    """The first pass of every load step of a static run: how far it goes, from what the last ones have shown."""

    def __init__(self, problem: Problem) -> None:
        run, timed = problem.run, histories(problem.loads)
        if problem.endless is not None:
            timed += problem.endless.histories
        self.time_step, self.follows = problem.dda.time_step, run.control == "toughness"
        self._corners = np.unique(np.concatenate([np.asarray(h.times, dtype=float) for h in timed]))
        # Between the corners of piecewise linear histories a step may take any length; within a sinusoid it may not.
        swings = any(h.wave is not None for h in timed)
        self._longest = run.longest_step or (self.time_step if swings else math.inf)
        #: Drive of the cracks as they are, at the start of the step, and its growth per second; None: not known yet.
        self._drive: float | None = 0.0
        self._rate = 0.0
        #: Displacement ratio per second in the last step; None before there is one.
        self._pace: float | None = None
        #: Whether crack faces have friction.
        self._rough = False
        #: Whether the last first pass ended at an event.
        self.reached = False
        #: What contacts and faces do on the way.
        self.changes = FirstChange(("contacts", "faces") if run.events is None else run.events)

    def first_pass(self, now: CrackedBlocks, end: float) -> Balance:
        """The blocks moved to the next event, or towards it as far as one step goes, at most to the time ``end``; with
        control "toughness" back to it where it lies behind. ``reached`` then says whether they are there. Raises
        `dda.NotConverged`."""
        start = now.state.time
        self._rough = any(body.rough for body in now.bodies.values())
        search = Crossing(self._rate)
        if self._drive is None:
            found, excess = self._at(now, start, 0.0)
            search.slope *= 1 + excess
        else:
            found, excess = None, self._drive - 1
        search.add(start, excess)
        if found is None or abs(excess) > SETTLED:
            way = self._back if self.follows and excess > 0 else self._ahead
            found, excess = way(now, search, end)
        else:
            self.reached = True
        self._drive, self._rate = 1 + excess, search.slope
        return found

    def after(self, now: CrackedBlocks, found: Balance) -> None:
        """The load step has ended with a pass at the load of the first one, in which nothing grew."""
        before, self._drive = self._drive, drive(now, found)
        # Where loads are proportional to time, and in most other cases nearly, the rate changes as the drive does.
        self._rate *= self._drive / before if before else 1.0
        self.changes.after(now, found)

    def grown(self) -> None:
        """The cracks have grown at the end of the load step."""
        self._drive = None
        self.changes.grown()

    def _ahead(self, now: CrackedBlocks, search: Crossing, end: float) -> tuple[Balance, float]:
        start = now.state.time
        limit = self._limit(now, start, end)
        event = search.next
        if event <= start:
            # Tips that growth has not brought to rest.
            event = limit = min(limit, start + self.time_step)
        whole = event <= limit and not self._far(event - start)
        aim = event if whole else min(start + APPROACH * (event - start), limit)
        if self._rough and self._pace:
            # While faces stick nothing tells how far the event is.
            aim = min(aim, start + NEAR_ROUGH / self._pace)
        if self.changes.expected is not None:
            aim = min(aim, max(self.changes.expected * (1 + FOUND), start + FOUND * limit))
            self.changes.expected = None
        for k in range(MOST):
            found, excess = self._at(now, aim, limit - start, free=k == 0)
            at = found.result.state.time
            search.add(at, excess)
            self.reached = abs(excess) <= SETTLED or (excess > 0 and search.width <= JUMP * abs(at))
            goes_on = whole and (search.enclosed or (at < limit and k < OPEN)) and not self.changes.reached
            if self.reached or (excess < 0 and not goes_on):
                break
            if search.next <= start:
                # Driven from the start on, by tips that growth has not brought to rest: the load does not go back for
                # them.
                self.reached = True
                break
            aim = min(search.next, limit)
            whole = whole or not self._far(aim - start)
            if not whole:
                # It lies within a long step.
                aim = start + APPROACH * (aim - start)
        else:
            self.reached = excess > 0
        return found, excess

    def _back(self, now: CrackedBlocks, search: Crossing, end: float) -> tuple[Balance, float]:
        """Down to the load at which tips are driven no further; where none is low enough, to no load."""
        start = now.state.time
        # Faces with friction slip on as the crack grows, under a load that falls. Were the way back made in two steps, they
        # would stick in the second, in which nothing grows, and keep K where it is however far the load falls.
        rough = self._rough
        limit = max(0.0, start - self._most(now))
        whole = rough or (search.next >= limit and not self._far(start - search.next))
        aim = search.next if whole else max(start - APPROACH * (start - search.next), limit)
        for _ in range(MOST):
            found, excess = self._at(now, aim, start - limit, look=not rough)
            at = found.result.state.time
            search.add(at, excess)
            self.reached = abs(excess) <= SETTLED or (excess > 0 and (at == 0.0 or search.width <= JUMP * at))
            goes_on = whole and (search.enclosed or at > limit) and not self.changes.reached
            if self.reached or (excess > 0 and not goes_on):
                break
            aim = max(search.next, limit)
            if rough and not search.enclosed:
                # The drive hardly changes while faces stick: nothing tells how far back the event is.
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
        """A pass at the loads of ``time`` from the start of the step, or, where there is a ``look`` at that, at those at
        which something changes its state on the way there, and how far the drive then is above one. ``most`` is how long
        the step may be, s; a ``free`` one may be cut short by how far blocks may move."""
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
        # The length of a static step is no more than its inertia: short ones would hold the blocks back.
        found = solved_pass(now, max(abs(way), self.time_step), None if free and way >= self.time_step else time)
        way = found.result.state.time - now.state.time
        if way != 0:
            self._pace = found.result.statistics["max_displacement_ratio"] / abs(way)
        return found

    def _towards(self, start: float, event: float) -> float:
        """How far a step from ``start`` may go to be right at the ``event``: there, or most of the way."""
        return start + APPROACH * (event - start) if self._far(abs(event - start)) else event

    def _far(self, way: float) -> bool:
        return self._pace is None or self._pace * way > (NEAR_ROUGH if self._rough else NEAR)

    def may_pass(self, now: CrackedBlocks, end: float) -> bool:
        """Whether the next first pass would go beyond the time ``end`` s but for it, as far as can be said before: no
        tip is
        expected to be driven before."""
        start = now.state.time
        if self._limit(now, start, math.inf) <= end:
            return False
        return self._drive is None or self._rate <= 0.0 or start + (1.0 - self._drive) / self._rate > end

    def _limit(self, now: CrackedBlocks, start: float, end: float) -> float:
        """The latest time to which a step from ``start`` may go, s."""
        stage = until_next_event(now.problem.loads, start, end - start)
        corner = self._corners[np.searchsorted(self._corners, start * (1 + 1e-12), side="right") :]
        return min(start + min(stage, self._most(now)), *corner[:1].tolist(), end)

    def _most(self, now: CrackedBlocks) -> float:
        """The longest step, s, by how fast blocks have moved in the last one."""
        if not self._pace:
            return min(self._longest, math.inf if self._pace == 0 else self.time_step)
        return min(self._longest, max(self.time_step, USE * now.system.settings.max_displacement_ratio / self._pace))
