"""The coupling cycle: DDA moves the blocks, their contact forces load the cracked blocks, and DDM grows the cracks.

A load step is a sequence of passes (`load_pass`). Each pass starts from the blocks at the beginning of the step, and
its cracks grow by one increment. The step ends with the first pass in which no tip grows, and its state starts the next
load step. Every pass is yielded as a `Cycle`.

- With stepping "events" (`event_stepping`), load steps end at changes of state. With control "toughness", every pass in
  which cracks grow is a load step of its own.
- When a crack cuts a block, the block is split in the configuration of that pass. In statics the next passes at the
  same load start from there (except for a block that was connected by a thin ligament only); in dynamics the next step
  does.
- In statics a load is held while tips run. After every ``max_passes`` passes the configuration is accepted and the next
  passes at this load start from it, up to `MOST_PASSES` passes in total.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .. import dda
from ..dda.excavation import until_next_event
from ..dda.linear_solver.blas_threads import alike, asked_for, blas_threads
from ..dda.step_control.overlap_energy import Overlap, OverlapWatch
from ..model import TIP, Cycle, Event, Problem, State
from .coupled_state import CrackedBlocks
from .cycle_record import event, record
from .growth.crack_growth import births, blocks_to_split, growth_of_tips, initiations, take_growth
from .growth.dynamic_tips import DynamicTips
from .growth.event_stepping import SETTLED, TOGETHER, EventSteps
from .growth.first_state_change import FirstChange
from .growth.last_ligaments import cut_last_ligament
from .growth.wave_arrival import LeftOut
from .load_pass import Balance, balanced, toughness
from .load_transfer.load_imbalance import LoadBalance
from .load_transfer.unbounded_rock import out_of_sight, solved_pass
from .monitoring.collapse import collapse_in_situ, lost, relax, unsupported
from .monitoring.energy_check import (
    BendingWatch,
    BudgetWatch,
    GrowthWatch,
    check_dissipation,
    check_supplied,
    warn_of_onset,
)
from .monitoring.free_motion import FreeMotion
from .monitoring.mechanism import Mechanism
from .monitoring.pass_agreement import AgreementWatch

if TYPE_CHECKING:
    from ..ddm.growth.tip_advance import Growth

log = logging.getLogger(__name__)

#: Most growth passes at one static load where ``max_passes`` is smaller. Increments far shorter than a block need tens.
MOST_PASSES = 200


def cycles(problem: Problem) -> Iterator[Cycle]:
    """Run ``problem`` and yield one `Cycle` per pass, from the initial state (number 0) to the end time.

    A static run also ends, with a ``collapse`` event, when a block moves out of reach. Raises
    `geomech.dda.NotConverged` when the block system finds no consistent contact states even at the smallest step, and
    ValueError for a dynamic run with stepping "events".
    """
    return Coupling(problem).cycles()


@dataclass(frozen=True)
class UnderWay:
    """A load step in progress, between two of its passes.

    ``events`` of the last pass; ``pending`` events, from applying its growth; ``next_pass`` number of the next pass. In
    dynamics ``until`` is the time (s) at which the last pass ended, ``whole`` the length of the step (s), ``like`` the
    step that blocks made in it."""

    dt: float
    load_time: float | None
    events: tuple[Event, ...]
    pending: tuple[Event, ...]
    next_pass: int
    until: float | None = None
    whole: float = 0.0
    like: dda.StepResult | None = None


@dataclass
class _LoadStep:
    """The load step of the present pass: the fields of `UnderWay`, the number of the pass (``growth_pass``), the
    largest number of passes (``most``), and whether a stop event has occurred (``stops``)."""

    dt: float
    load_time: float | None
    until: float | None
    whole: float
    pending: tuple[Event, ...]
    growth_pass: int
    most: int
    stops: bool
    like: dda.StepResult | None = None


@dataclass(frozen=True, eq=False)
class _Grown:
    """Growth in a pass: ``growth`` (None: no tip grows), the ``events`` of the pass, the blocks that are ``cut``,
    whether the pass ``ends`` its load step, and whether the next passes start from its configuration (``rests``)."""

    growth: Growth | None
    events: tuple[Event, ...]
    cut: Sequence[int]
    ends: bool
    rests: bool


class _EnergyBalance(NamedTuple):
    """Energy ``budget`` after a pass, and the ``statistics`` of the pass."""

    budget: dda.EnergyBudget
    statistics: dict[str, float]


class Coupling:
    """The load steps of one coupled problem, with its present state (``now``) and the length of the next step.

    ``between`` is called between any two passes, when the whole state of the run is in this object and none of it in
    local variables of the generators. A checkpoint stored there continues with `load_steps`.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        with blas_threads(asked_for()):
            self.now = CrackedBlocks(problem)
        self.length = dda.StepLength(problem.dda)
        self.static = problem.dda.dynamic_factor == 0.0
        if self.endless and (not self.static or problem.dda.equilibrium):
            raise ValueError('unbounded rock is for static runs only: dynamic_factor = 0 and equilibrium ""')
        self.events: EventSteps | None = None
        if problem.run.stepping == "events":
            if not self.static or problem.dda.equilibrium == "loads":
                raise ValueError(
                    'stepping "events" is for static runs that do not relax at every load: dynamic_factor = 0 and '
                    'equilibrium "" or "start"'
                )
            self.events = EventSteps(problem)
        #: Changes of state of contacts and crack faces, reported at the end of the step in which they occur.
        self.changes = FirstChange(problem.run.events or ()) if self.events is None else self.events.changes
        self.follows = problem.run.control == "toughness"
        if self.follows and self.events is None:
            raise ValueError('control "toughness" needs stepping "events"')
        #: Events from applying the growth that ended the last load step (control "toughness").
        self._brought: tuple[Event, ...] = ()
        self.tips = None if self.static else DynamicTips(problem)
        self.range, self.balance, self.mechanism = dda.ElasticRange(), LoadBalance(), Mechanism()
        self.drift = FreeMotion()
        self.energy, self.bending, self.overlaps = BudgetWatch(), BendingWatch(), OverlapWatch()
        self.unstable, self.agreement = GrowthWatch(), AgreementWatch()
        self.under_way: UnderWay | None = None
        #: Time at which the present load step began, s.
        self.began = self.now.state.time
        self.between: Callable[[], None] = _go_on

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "between"}

    def __setstate__(self, stored: dict[str, Any]) -> None:
        vars(self).update(stored, between=_go_on)

    def take_run(self, problem: Problem) -> None:
        """Take title, end time and stop events from ``problem``, and continue with the rest unchanged."""
        self.problem, self.now.problem = (
            replace(each, title=problem.title, run=problem.run) for each in (self.problem, self.now.problem)
        )

    @property
    def endless(self) -> bool:
        """Whether the rock is unbounded."""
        return self.problem.endless is not None

    @property
    def enough(self) -> float:
        """Fraction of the toughness at which a tip grows: 1, less the tolerance to which event loads are found."""
        return 1.0 if self.events is None else 1.0 - SETTLED

    @property
    def together(self) -> float:
        """Fraction of the toughness at which a tip grows together with another tip."""
        return 1.0 if self.events is None else 1.0 - TOGETHER

    @property
    def stops_next(self) -> bool:
        """Whether the next pass is the last one, because a stop event has occurred."""
        events = () if self.under_way is None else self.under_way.events + self.under_way.pending
        return self._stops(events + self._brought)

    @property
    def ends_next(self) -> bool:
        """Whether the end time of the run cuts, or may cut, the next load step. A longer run would take another
        step."""
        if self.under_way is not None:
            return False
        time, end = self.now.state.time, self.problem.run.end_time
        if self.events is not None:
            return self.events.may_pass(self.now, end)
        return end - time < self.length.dt

    def cycles(self) -> Iterator[Cycle]:
        """All cycles from the initial state to the end, the same to the last bit in any process."""
        return alike(self._from_the_start())

    def load_steps(self) -> Iterator[Cycle]:
        """The remaining cycles of a run that was stored between two passes."""
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
        # Rounding of the summed time must not add an empty last step.
        end = self.problem.run.end_time - 1e-9 * self.problem.dda.time_step
        while self.under_way is not None or self.now.state.time < end:
            self._look_ahead()
            self.between()
            stopped = yield from self._load_step()
            if stopped:
                break
        else:
            self.mechanism.warn_at_the_end(self.now.state.time)
        if not self.endless:
            broken, newmark = self.now.crack_energy.toughness, self.problem.dda.newmark
            check_dissipation(self.now.budget, self.now.state.time, self.static, broken, newmark)
            if not self.static:
                cracks = self.now.crack_energy
                supplied = cracks.fracture + cracks.parting
                check_supplied(supplied, self.now.budget, self.now.state.time, self.bending.bend)
            if not self.problem.dda.equilibrium:
                dda.warn_of_toes_at_rest(self.now.system, self.now.state, self.problem.loads)

    def _look_ahead(self) -> None:
        """Solve what tells whether the end of the run cuts the next load step (`ends_next`), if it does not begin with
        an excavation."""
        now = self.now
        if self.events is None or self.under_way is not None or self.stops_next:
            return
        if now.system.removed(self.problem.loads, now.state.time) is now.removed:
            self.events.look(now)

    def _load_step(self):
        """All passes at one load. Returns True when a stop event has occurred."""
        now, step = self.now, self._begin()
        if step.growth_pass == 0 and self.static and self.problem.dda.equilibrium == "loads":
            step.load_time = now.state.time + until_next_event(now.problem.loads, now.state.time, step.dt)
            collapse = relax(now, step.load_time)
            if collapse:
                now.number += 1
                now.state = replace(now.state, time=step.load_time)
                yield self._still(collapse)
                return True
        for growth_pass in range(step.growth_pass, step.most + 1):
            step.growth_pass = growth_pass
            now.number += 1
            # A piece that cracks have cut out of unbounded rock is not supported by anything.
            found = None if self.endless and not now.bodies else self._solved(step)
            if found is None:
                yield self._still(step.pending, growth_pass)
                return True
            grown = self._grown(step, found)
            energies = self._energy_balance(step, found, grown)
            yield record(
                now, found.result.state, found.tips, found.solutions, grown.events, growth_pass, energies.statistics,
                found.left_out,
            )  # fmt: skip
            if grown.ends:
                self._end(step, found, grown, energies)
                return step.stops
            if grown.rests:
                now.take_step(found.result.state, energies.budget)
            step.pending = take_growth(now, grown.growth, found.result.state, found.solutions)
            self.under_way = UnderWay(
                step.dt, step.load_time, grown.events, step.pending, growth_pass + 1, step.until, step.whole, step.like
            )
            self.between()
        raise AssertionError("unreachable: the last pass takes no growth")

    def _begin(self) -> _LoadStep:
        """The next load step, or the one in progress, at its next pass."""
        now, growing = self.now, self.problem.growth
        begun, self.under_way = self.under_way, None
        if begun is None:
            now.load_step += 1
            self.began = now.state.time
            dt = min(self.length.dt, self.problem.run.end_time - now.state.time)
            begun, self._brought = UnderWay(dt, None, (), self._brought + self._excavated(), 0), ()
        most = max(growing.max_passes, MOST_PASSES) if self.static and growing.max_passes else growing.max_passes
        stops = self._stops(begun.events)
        return _LoadStep(
            begun.dt, begun.load_time, begun.until, begun.whole, begun.pending, begun.next_pass, most, stops, begun.like
        )

    def _solved(self, step: _LoadStep) -> Balance | None:
        """Solve the pass. Returns None where the run has ended and its blocks find no equilibrium afterwards."""
        now = self.now
        try:
            if self.events is not None and step.growth_pass == 0:
                found = self.events.first_pass(now, self.problem.run.end_time)
                step.dt = found.result.dt
            else:
                found = (
                    solved_pass(now, step.dt, step.load_time)
                    if step.until is None
                    else self._until(step.until, step.like)
                )
        except dda.NotConverged as failure:
            if not (step.stops or self._stops(step.pending)):
                cut = None if self.events is not None else cut_last_ligament(now, failure)
                if cut is None:
                    raise
                step.pending, step.like = step.pending + cut, None
                return self._solved(step)
            # The stop event is reported even if the parts find no equilibrium after it.
            log.warning("cycle %d shows the blocks at the last equilibrium: %s", now.number, failure)
            now.state = now.state if step.load_time is None else replace(now.state, time=step.load_time)
            return None
        result = found.result
        if not self.endless:
            strain = self.range.check(now.motion(result.state), now.blocks, result.state.time)
            if now.bodies:
                self.balance.check(now.loads, now.blocks, strain, result.state.time)
        if self.static:
            self.agreement.check([now.blocks.names[b] for b in now.bodies], found.mismatch, result.state.time)
            # All passes of a static step have the same load, also when one of them takes a shorter step.
            step.load_time = result.state.time
        else:
            step.like = result
            if step.until is None:
                step.until, step.whole = result.state.time, result.dt
        return found

    def _grown(self, step: _LoadStep, found: Balance) -> _Grown:
        """Growth and events of the pass ``found``. Sets ``step.stops``."""
        now, state, growing = self.now, found.result.state, self.problem.growth
        events = step.pending + self.changes.events(now, found)
        step.stops = step.stops or self._stops(events)
        # With control "toughness" nothing grows before the load at which a tip reaches its toughness.
        driven = not self.follows or (self.events is not None and self.events.reached)
        may_grow = step.growth_pass < step.most and driven
        growth = None
        if may_grow and not step.stops:
            longest = self._longest(step, found.tips)
            growth = growth_of_tips(now, found.tips, self.enough, self.together, longest)
        if growth is not None and self.endless:
            gone = out_of_sight(now, growth, state)
            growth, events, step.stops = None if gone else growth, events + gone, step.stops or bool(gone)
        if growth is None and may_grow and not step.stops and growing.initiation:
            growth, born = births(now, found.solutions, state, self.enough)
            events += born
        if growth is None and self.static and not step.stops:
            # Only when growth has ended: a block on a thin ligament moves excessively until it is cut off.
            collapse = lost(now, state)
            ended = collapse or unsupported(now, found.result, self.mechanism)
            self.drift.check(now, found.result)
            events, step.stops = events + ended, bool(collapse) or self._stops(ended)
        if growth is not None:
            if self.static and not self.endless:
                self.mechanism.warn_of_growth(found.result)
            if self.events is None and step.growth_pass == 0:
                self._began_to_grow(found)
            found.tips["grown"] = growth.grown
            if self.tips is not None:
                self.tips.record_growth(found.tips)
            events += initiations(now, found.tips, state)
            step.stops = self._stops(events)
        # Blocks are split in the configuration of the pass, in equilibrium with the tractions on their crack faces.
        cut = () if self.endless else blocks_to_split(now, growth, state)
        parts = len(cut) > 0
        ends = growth is None or self.follows or (parts and not self.static)
        many = step.most > growing.max_passes and (step.growth_pass + 1) % growing.max_passes == 0
        return _Grown(growth, events, cut, ends, rests=parts or (not ends and many))

    def _began_to_grow(self, found: Balance) -> None:
        """Take note of how far above their toughness cracks begin to grow in the first pass of a step, ``found``."""
        now, result = self.now, found.result
        drive = float(np.max(found.tips["k_eq"] / toughness(now, found.tips), initial=0.0))
        if self.static:
            self.unstable.begins(drive)
        elif not now.crack_energy.toughness:
            warn_of_onset(drive, result.dt, result.state.time, self.problem.run.end_time)

    def _energy_balance(self, step: _LoadStep, found: Balance, grown: _Grown) -> _EnergyBalance:
        """The energy budget after the pass, checked, and the statistics of the pass."""
        now, result, cracks = self.now, found.result, self.now.crack_energy
        budget = self._budget_after(result, self.static and step.growth_pass > 0)
        statistics = {**result.statistics, **budget.statistics(), **found.statistics}
        advanced = result.state.time - self.began
        if abs(advanced - result.dt) > 1e-9 * result.dt:
            # An event step shorter than the inertia step, or one that goes back; the last part of a dynamic pass.
            statistics["dt"] = advanced
        if (now.bodies or cracks.under_way) and not self.endless:
            cracks.passed(found.tips, now.blocks, now.problem.materials, *self._strain_solutions())
            if grown.ends or grown.rests:
                self._count_at_cracks(result.state, budget, grown.cut)
            statistics |= cracks.statistics()
        statistics["budget_residual"] = budget.left_over(cracks.residual, cracks.uneven)
        self.energy.check(statistics["budget_residual"], result.state.time)
        if grown.ends and not self.static:
            bend = now.bodies.keys() <= now.by_mean_stress.fields.keys()
            self.bending.check(cracks.toughness, cracks.fracture + cracks.parting, result.state.time, bend)
        overlap = None if result.overlap is None else Overlap(*result.overlap)
        self.overlaps.check(budget, overlap, now.blocks.names, result.state.time)
        if grown.ends or len(grown.cut):
            self.unstable.check(budget, result.state.time)
        if self.static:
            statistics["remaining_motion"] = self.mechanism.remaining
        if self.tips is not None and (len(found.tips) or found.left_out):
            statistics["fastest_tip"] = self.tips.speed.fastest(step.whole)
        return _EnergyBalance(budget, statistics)

    def _end(self, step: _LoadStep, found: Balance, grown: _Grown, energies: _EnergyBalance) -> None:
        """Accept the step in the state of its last pass."""
        now, result = self.now, found.result
        if step.growth_pass == step.most and not step.stops and self._grow_on(step, found.tips):
            log.warning(
                "cycle %d: tips still grow after %d passes at one load; continuing with the next load",
                now.number,
                step.growth_pass,
            )
        self.under_way = None
        self.length.after(result, step.dt)
        if self.tips is not None:
            self.tips.end(found.tips, now.blocks, step.whole, now.loads, self._left_out(found))
        now.take_step(result.state, energies.budget)
        for body in now.bodies.values():
            body.end_step()
        if grown.growth is not None:
            if self.events is not None:
                self.events.grown()
            self._brought = take_growth(now, grown.growth, result.state, found.solutions)
        elif self.events is not None:
            self.events.after(now, found)

    def _left_out(self, found: Balance) -> dict[int, LeftOut]:
        """block → its tips, of the bodies that were left out of the pass ``found``."""
        now = self.now
        return {
            block: LeftOut(now.problem, now.blocks, block, body, now.loads[block], now.nodes_of[block])
            for block, body in found.left_out.items()
        }

    def _longest(self, step: _LoadStep, tips: np.ndarray) -> np.ndarray | float:
        """Largest growth of each tip in the step, m; infinite in statics."""
        return (
            np.inf
            if self.tips is None
            else self.tips.remaining_growth(tips, self.now.blocks, step.whole, self.now.loads)
        )

    def _grow_on(self, step: _LoadStep, tips: np.ndarray) -> bool:
        """Whether any tip still exceeds its toughness after the last pass and has growth left in the step."""
        longest = self._longest(step, tips)
        return bool(np.any((tips["k_eq"] >= self.enough * toughness(self.now, tips)) & (longest > 0)))

    def _until(self, until: float, like: dda.StepResult | None) -> Balance:
        """A pass of a dynamic step of which an earlier pass ended at the time ``until``, s, after the step ``like``.

        Its tips have grown over that whole time. Where the blocks now need shorter steps, as many are taken as lead to
        ``until``, and all but the last are accepted."""
        now = self.now
        while True:
            found = balanced(now, until - now.state.time, None, like)
            result, like = found.result, None
            if until - result.state.time <= 1e-9 * result.dt:
                return replace(found, result=replace(result, state=replace(result.state, time=until)))
            self.range.check(now.motion(result.state), now.blocks, result.state.time)
            budget = self._budget_after(result, False)
            now.crack_energy.passed(found.tips, now.blocks, now.problem.materials, *self._strain_solutions())
            self._count_at_cracks(result.state, budget)
            now.take_step(result.state, budget)

    def _budget_after(self, result: dda.StepResult, growing: bool) -> dda.EnergyBudget:
        """The energy budget with the step ``result``; ``growing``: cracks grow at constant load."""
        now = self.now
        # Excavated rock takes its stored energy with it.
        dug = result.state.removed is not now.state.removed
        return (now.budget.cut() if dug else now.budget).after(result.energy, result.state.time, growing=growing)

    def _count_at_cracks(self, state: State, budget: dda.EnergyBudget, cut: Sequence[int] = ()) -> None:
        """Add to the crack energy balance a step to ``state`` with the block ``budget`` after it; ``cut`` are the
        blocks that split."""
        now = self.now
        now.crack_energy.after(
            now.state, state, now.blocks, now.strain_solutions(), now.by_mean_stress, now.set_free(budget, state), cut
        )

    def _strain_solutions(self) -> tuple:
        """The solutions that gave the crack strains, and the blocks with mean-stress response."""
        return self.now.strain_solutions(), self.now.by_mean_stress

    def _excavated(self) -> tuple[Event, ...]:
        """Remove the blocks that are excavated at the present time; one event for each."""
        now = self.now
        gone = now.take_out()
        now.crack_energy.take_out(gone)
        return tuple(
            event(now, "excavation", now.state, now.blocks.area_moments(b)[1], f"{now.blocks.names[b]} is excavated")
            for b in gone
        )

    def _still(self, events: tuple[Event, ...], growth_pass: int = 0) -> Cycle:
        """The record of a cycle in which blocks have not moved."""
        return record(self.now, self.now.state, np.empty(0, TIP), {}, events, growth_pass, {})

    def _stops(self, events: tuple[Event, ...]) -> bool:
        return any(event.kind in self.problem.ends_at for event in events)


def _go_on() -> None:
    """Default of `Coupling.between`: do nothing."""
