"""The coupling cycle: blocks move, their contact forces load the cracked ones, cracks grow and soften them, again.

At each load the cycle is repeated from the same start of the step until no tip grows; every pass is yielded as a
`Cycle`. The state that leaves the last pass starts the next load step. Where the load follows the cracks
(`event_stepping`), each pass in which they grow is a load step of its own. Blocks part where a pass has left them: in
statics the passes that follow at the same load begin there (unless the block hung by a thread), in dynamics the next
step does.

At rest a load waits for tips that run: after ``max_passes`` passes the step is taken as it stands, and those that follow at
the same load begin there, for `MOST_PASSES` in all.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import dda
from ..dda.excavation import until_next_event
from ..dda.linear_solver.blas_threads import alike, asked_for, blas_threads
from ..dda.step_control.overlap_energy import Overlap, OverlapWatch
from ..model import TIP, Cycle, Event, Problem, State
from .coupled_state import CrackedBlocks
from .cycle_record import event, record
from .growth.crack_growth import births, growth_of_tips, initiations, part_here, take_growth
from .growth.dynamic_tips import TipsInTime
from .growth.event_stepping import SETTLED, TOGETHER, EventSteps
from .growth.first_state_change import FirstChange
from .load_pass import Balance, balanced, toughness
from .load_transfer.load_imbalance import LoadBalance
from .load_transfer.unbounded_rock import out_of_sight, solved_pass
from .monitoring.collapse import collapse_in_situ, lost, relax, unheld
from .monitoring.energy_check import BendingWatch, BudgetWatch, GrowthWatch
from .monitoring.mechanism import Mechanism

log = logging.getLogger(__name__)

#: Growth passes for which a static load waits, where fewer are asked for: increments far shorter than blocks take tens.
MOST_PASSES = 200


def cycles(problem: Problem) -> Iterator[Cycle]:
    """Run ``problem``, one `Cycle` a coupling cycle, from the initial state (number 0) to the scene's end.

    A static run also ends when a block goes out of reach, with a ``collapse`` event. Raises `geomech.dda.NotConverged`
    when the block system finds no consistent contact state even at the smallest step, and ValueError where a dynamic
    run is to step from event to event.
    """
    return Coupling(problem).cycles()


@dataclass(frozen=True)
class UnderWay:
    """A load step of which a pass has grown cracks: what its next pass, number ``next_pass``, goes on with. ``told``
    are the events of the pass before, ``pending`` those that taking the growth has brought; ``until``, in dynamics, the
    time at which the pass before has ended, ``whole`` s after the step began."""

    dt: float
    load_time: float | None
    told: tuple[Event, ...]
    pending: tuple[Event, ...]
    next_pass: int
    until: float | None = None
    whole: float = 0.0


class Coupling:
    """The load steps of one coupled problem: what there is ``now``, and how long the next step is to be.

    ``between`` is called between any two passes, when all that the run goes on with is here, and nothing of it in the
    generators' own variables: what is stored then goes on with `load_steps`.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        with blas_threads(asked_for()):
            self.now = CrackedBlocks(problem)
        self.length = dda.StepLength(problem.dda)
        self.static = problem.dda.dynamic_factor == 0.0
        if problem.endless is not None and (not self.static or problem.dda.equilibrium):
            raise ValueError('rock without an end is for static runs: dynamic_factor = 0 and equilibrium ""')
        self.events: EventSteps | None = None
        if problem.run.stepping == "events":
            if not self.static or problem.dda.equilibrium == "loads":
                raise ValueError(
                    'stepping "events" is for static runs that do not relax at every load: dynamic_factor = 0 and '
                    'equilibrium "" or "start"'
                )
            self.events = EventSteps(problem)
        #: What contacts and faces do; by other steps told where it is asked for, at the end of the step it happens in.
        self.changes = FirstChange(problem.run.events or ()) if self.events is None else self.events.changes
        self.follows = problem.run.control == "toughness"
        if self.follows and self.events is None:
            raise ValueError('control "toughness" needs stepping "events"')
        #: What the growth that ended the last load step brought, where the load follows the cracks.
        self._brought: tuple[Event, ...] = ()
        self.tips = None if self.static else TipsInTime(problem)
        self.range, self.balance, self.mechanism = dda.ElasticRange(), LoadBalance(), Mechanism()
        self.energy, self.bending, self.overlaps = BudgetWatch(), BendingWatch(), OverlapWatch()
        self.unstable = GrowthWatch()
        self.under_way: UnderWay | None = None
        #: s, when the present load step began.
        self.began = self.now.state.time
        self.between: Callable[[], None] = _go_on

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "between"}

    def __setstate__(self, stored: dict[str, Any]) -> None:
        vars(self).update(stored, between=_go_on)

    def take_run(self, problem: Problem) -> None:
        """Go on with the title and the end, and what else may stop the run, that ``problem`` has."""
        self.problem, self.now.problem = (
            replace(each, title=problem.title, run=problem.run) for each in (self.problem, self.now.problem)
        )

    @property
    def stops_next(self) -> bool:
        """Whether the next pass is the last one, because of what has happened."""
        told = () if self.under_way is None else self.under_way.told + self.under_way.pending
        return self._stops(told + self._brought)

    def cycles(self) -> Iterator[Cycle]:
        """From the initial state to the end; the same to the bit in whatever process and beside whatever else."""
        return alike(self._from_the_start())

    def load_steps(self) -> Iterator[Cycle]:
        """The cycles from between two passes to the end."""
        return alike(self._load_steps())

    def _from_the_start(self) -> Iterator[Cycle]:
        now = self.now
        collapse = collapse_in_situ(now)
        if not collapse and self.problem.dda.equilibrium:
            collapse = relax(now, now.state.time)
        if self.problem.velocity is not None:
            velocity = now.state.velocity.copy()
            velocity[:, :2] = self.problem.velocity
            now.state = replace(now.state, velocity=velocity)
        yield self._still(collapse)
        if not collapse:
            yield from self._load_steps()

    def _load_steps(self) -> Iterator[Cycle]:
        # Rounding of the summed steps must not add a last, empty one.
        end = self.problem.run.end_time - 1e-9 * self.problem.dda.time_step
        while self.under_way is not None or self.now.state.time < end:
            self.between()
            stopped = yield from self._load_step()
            if stopped:
                return

    def _load_step(self):
        """All passes at one load. Returns True when a stop event happened."""
        now, growing, endless = self.now, self.problem.growth, self.problem.endless is not None
        static = self.static
        # Near enough to the toughness to grow, and to grow with another.
        enough, together = (1.0, 1.0) if self.events is None else (1.0 - SETTLED, 1.0 - TOGETHER)
        begun, self.under_way = self.under_way, None
        if begun is None:
            now.load_step += 1
            self.began = now.state.time
            dt = min(self.length.dt, self.problem.run.end_time - now.state.time)
            begun, self._brought = UnderWay(dt, None, (), self._brought + self._excavated(), 0), ()
        dt, load_time, pending, stops = begun.dt, begun.load_time, begun.pending, self._stops(begun.told)
        until, whole = begun.until, begun.whole
        if begun.next_pass == 0 and static and self.problem.dda.equilibrium == "loads":
            load_time = now.state.time + until_next_event(now.problem.loads, now.state.time, dt)
            collapse = relax(now, load_time)
            if collapse:
                now.number += 1
                now.state = replace(now.state, time=load_time)
                yield self._still(collapse)
                return True
        most = max(growing.max_passes, MOST_PASSES) if static and growing.max_passes else growing.max_passes
        for growth_pass in range(begun.next_pass, most + 1):
            now.number += 1
            if endless and not now.bodies:
                # Cracks have cut a piece off, which nothing holds.
                yield self._still(pending, growth_pass)
                return True
            try:
                if self.events is not None and growth_pass == 0:
                    found = self.events.first_pass(now, self.problem.run.end_time)
                    dt = found.result.dt
                else:
                    found = solved_pass(now, dt, load_time) if until is None else self._until(until)
            except dda.NotConverged as failure:
                if not (stops or self._stops(pending)):
                    raise
                # What ended the run has happened; that its pieces find no rest does not undo it.
                log.warning("cycle %d shows the blocks before they moved on: %s", now.number, failure)
                now.state = now.state if load_time is None else replace(now.state, time=load_time)
                yield self._still(pending, growth_pass)
                return True
            result, solutions = found.result, found.solutions
            if not endless:
                strain = self.range.check(now.motion(result.state), now.blocks, result.state.time)
                if now.bodies:
                    self.balance.check(now.loads, now.blocks, strain, result.state.time)
            if static:
                # The passes of a step share its load, also when one of them has to take a shorter step.
                load_time = result.state.time
            elif until is None:
                until, whole = result.state.time, result.dt
            tips = found.tips
            may_grow = growth_pass < most
            if self.follows and not self.events.reached:
                may_grow = False  # on the way to a lower load
            events = pending + self.changes.events(now, found)
            stops = stops or self._stops(events)
            growth = None
            if may_grow and not stops:
                longest = np.inf if self.tips is None else self.tips.may_go(tips, now.blocks, whole, now.loads)
                growth = growth_of_tips(now, tips, enough, together, longest)
            if growth is not None and endless:
                gone = out_of_sight(now, growth, result.state)
                growth, events, stops = None if gone else growth, events + gone, stops or bool(gone)
            if growth is None and may_grow and not stops and growing.initiation:
                growth, born = births(now, solutions, result.state, enough)
                events += born
            if growth is None and static and not stops:
                # Not before growth has ended: a block that hangs by a thread is strained beyond measure until it parts.
                collapse = lost(now, result.state)
                told = collapse or unheld(now, result, self.mechanism)
                events, stops = events + told, bool(collapse) or self._stops(told)
            if growth is not None:
                tips["grown"] = growth.grown
                if self.tips is not None:
                    self.tips.went(tips)
                events += initiations(now, tips, result.state)
                stops = self._stops(events)
            # Blocks part where the pass has left them, in equilibrium with what their faces bear.
            cut = () if endless else part_here(now, growth, result.state)
            parts = len(cut) > 0
            ends = growth is None or self.follows or (parts and not static)
            rests = parts or (not ends and most > growing.max_passes and (growth_pass + 1) % growing.max_passes == 0)
            # What is dug out takes what it stores along.
            dug = result.state.removed is not now.state.removed
            budget = (now.budget.cut() if dug else now.budget).after(
                result.energy, result.state.time, growing=static and growth_pass > 0
            )
            statistics = {**result.statistics, **budget.statistics(), **found.statistics}
            gone_by = result.state.time - self.began
            if abs(gone_by - result.dt) > 1e-9 * result.dt:
                # Of an event step that is shorter than its inertia asks for, or goes back; of the last part of a pass.
                statistics["dt"] = gone_by
            if (now.bodies or now.crack_energy.under_way) and not endless:
                now.crack_energy.passed(tips, now.blocks, now.problem.materials, *self._felt())
                if ends or rests:
                    self._count_at_cracks(result.state, budget, cut)
                statistics |= now.crack_energy.statistics()
            statistics["budget_residual"] = budget.left_over(now.crack_energy.residual, now.crack_energy.uneven)
            self.energy.check(statistics["budget_residual"], result.state.time)
            cracks = now.crack_energy
            if ends and not static:
                self.bending.check(cracks.toughness, cracks.fracture + cracks.parting, result.state.time)
            overlap = None if result.overlap is None else Overlap(*result.overlap)
            self.overlaps.check(budget, overlap, now.blocks.names, result.state.time)
            if ends or parts:
                self.unstable.check(budget, result.state.time)
            if self.tips is not None and (len(tips) or found.left_out):
                statistics["fastest_tip"] = self.tips.speed.fastest(whole)
            yield record(now, result.state, tips, solutions, events, growth_pass, statistics, found.left_out)
            if ends:
                if growth_pass == most and not stops and self._grow_on(tips, enough, whole):
                    log.warning(
                        "cycle %d: tips still grow after %d passes at one load; going on to the next load",
                        now.number,
                        growth_pass,
                    )
                self.under_way = None
                self.length.after(result, dt)
                if self.tips is not None:
                    self.tips.end(tips, now.blocks, whole, now.loads)
                now.take_step(result.state, budget)
                if growth is not None:
                    if self.events is not None:
                        self.events.grown()
                    self._brought = take_growth(now, growth, result.state, solutions)
                elif self.events is not None:
                    self.events.after(now, found)
                return stops
            if rests:
                now.take_step(result.state, budget)
            pending = take_growth(now, growth, result.state, solutions)
            self.under_way = UnderWay(dt, load_time, events, pending, growth_pass + 1, until, whole)
            self.between()
        raise AssertionError("unreachable: the last pass takes no growth")

    def _grow_on(self, tips: np.ndarray, enough: float, whole: float) -> bool:
        """Whether any of ``tips`` after the last pass of a load step has ``enough`` of its toughness, and may go on."""
        now = self.now
        longest = np.inf if self.tips is None else self.tips.may_go(tips, now.blocks, whole, now.loads)
        return bool(np.any((tips["k_eq"] >= enough * toughness(now, tips)) & (longest > 0)))

    def _until(self, until: float) -> Balance:
        """A pass of a dynamic step of which another has ended at the time ``until``. Its tips have grown for all of
        that time: where the blocks now need shorter steps, it takes as many as lead there, and all but the last are
        gone on from."""
        now = self.now
        while True:
            found = balanced(now, until - now.state.time, None)
            result = found.result
            if until - result.state.time <= 1e-9 * result.dt:
                return replace(found, result=replace(result, state=replace(result.state, time=until)))
            self.range.check(now.motion(result.state), now.blocks, result.state.time)
            budget = now.budget.after(result.energy, result.state.time)
            now.crack_energy.passed(found.tips, now.blocks, now.problem.materials, *self._felt())
            self._count_at_cracks(result.state, budget)
            now.take_step(result.state, budget)

    def _count_at_cracks(self, state: State, budget: dda.EnergyBudget, cut: Sequence[int] = ()) -> None:
        """A step has been taken to ``state``, after which the blocks have this ``budget``, and in which some are
        ``cut``."""
        now = self.now
        # (What was dug out without a block that parts is its own.)
        set_free = now.budget.split - budget.split if now.budget.is_cut else 0.0
        now.crack_energy.after(now.state, state, now.blocks, now.felt(), now.by_mean_stress, set_free, cut)

    def _felt(self) -> tuple:
        """What the blocks feel of their cracks, and whether they began the step under stress."""
        return self.now.felt(), self.now.by_mean_stress, bool(self.now.state.stress.any())

    def _excavated(self) -> tuple[Event, ...]:
        """Take out the blocks whose time has come; an event for each."""
        now = self.now
        return tuple(
            event(now, "excavation", now.state, now.blocks.area_moments(b)[1], f"{now.blocks.names[b]} is taken out")
            for b in now.take_out()
        )

    def _still(self, events: tuple[Event, ...], growth_pass: int = 0) -> Cycle:
        """The record of blocks that have not been moved."""
        return record(self.now, self.now.state, np.empty(0, TIP), {}, events, growth_pass, {})

    def _stops(self, events: tuple[Event, ...]) -> bool:
        return any(event.kind in self.problem.ends_at for event in events)


def _go_on() -> None:
    """Nobody wants anything between two passes."""
