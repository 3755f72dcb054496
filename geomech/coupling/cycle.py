"""The coupling cycle: blocks move, their contact forces load the cracked ones, cracks grow and soften them, again.

At each load the cycle is repeated from the same start of the step until no tip grows; every pass is yielded as a
`Cycle`. The state that leaves the last pass starts the next load step.
"""

from __future__ import annotations

import logging
import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from .. import dda
from ..dda.excavation import until_next_event
from ..ddm.work import Work
from ..model import TIP, Blocks, Cracks, Cycle, Event, Motion, Problem, State
from ..model.polygon import winding_number
from .bodies import boundary_loads, elastic_bodies, inherited, solve_bodies, threads_for, tip_rows
from .compliance import crack_response
from .inherited_loads import on_children, on_moved
from .mean_stress import rotated_mean_stress
from .record import axial_strain, joined_faces, leading_load
from .side_by_side import side_by_side
from .splitting import split_blocks
from .tractions import BoundaryLoad

log = logging.getLogger(__name__)

#: A pass is repeated while the crack strain it assumed and the one it found differ by more than this part of the
#: block's elastic strain.
COMPLIANCE_TOLERANCE = 1e-6

#: … but not more often than this at one geometry: a lag of one step is corrected by the next.
COMPLIANCE_PASSES = 4


def cycles(problem: Problem) -> Iterator[Cycle]:
    """Run ``problem``, one `Cycle` a coupling cycle, from the initial state (number 0) to the scene's end.

    A static run also ends when a block goes out of reach, with a ``collapse`` event. Raises `geomech.dda.NotConverged`
    when the block system finds no consistent contact state even at the smallest step.
    """
    return Coupling(problem).cycles()


class Coupling:
    """The running state of one coupled problem: blocks and cracks as they are now, and the solvers' kept work."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.blocks: Blocks = problem.blocks
        self.cracks: Cracks = problem.cracks
        self.state = State.at_rest(problem.blocks)
        self.gauge = problem.gauge
        self.monitors = dict(problem.monitors)
        self.seconds: dict[str, float] = {}
        self.works: list[Work] = []
        self.number = 0
        self.load_step = 0
        self.known_motion: tuple[State, Motion] | None = None
        self.bodies: dict[int, object] = {}
        self.solutions: dict[int, object] = {}
        self.loads: dict[int, BoundaryLoad] = {}
        self.compliances: dict[int, tuple] = {}
        # What crack faces with friction remember of the load step before: its passes all begin there.
        self.history: dict[int, object] = {}
        self.solved_from: dict[int, object] = {}
        self.budget = dda.EnergyBudget()
        self.length = dda.StepLength(problem.dda)
        self.removed: np.ndarray | None = None
        self._take_blocks()
        if problem.in_situ is not None:
            self._settle_in_situ()

    # -- the generator -------------------------------------------------------------------------------------------

    def cycles(self) -> Iterator[Cycle]:
        settings = self.problem.run
        collapse = self._relax(self.state.time) if self.problem.dda.equilibrium else ()
        yield self._record(self.state, np.empty(0, TIP), {}, collapse, 0, {})
        if collapse:
            return
        # Rounding of the summed steps must not add a last, empty one.
        end = settings.end_time - 1e-9 * self.problem.dda.time_step
        while self.state.time < end:
            self.load_step += 1
            stopped = yield from self._load_step()
            if stopped:
                return

    def _load_step(self):
        """All passes at one load. Returns True when a stop event happened."""
        dt = min(self.length.dt, self.problem.run.end_time - self.state.time)
        pending: tuple[Event, ...] = self._excavated()
        stops, load_time = False, None
        static = self.problem.dda.dynamic_factor == 0.0
        if static and self.problem.dda.equilibrium == "loads":
            load_time = self.state.time + until_next_event(self.problem.loads, self.state.time, dt)
            collapse = self._relax(load_time)
            if collapse:
                self.number += 1
                self.state = replace(self.state, time=load_time)
                yield self._record(self.state, np.empty(0, TIP), {}, collapse, 0, {})
                return True
        for growth_pass in range(self.problem.growth.max_passes + 1):
            self.number += 1
            try:
                result, solutions, mismatch = self._equilibrium(dt, load_time)
            except dda.NotConverged as failure:
                if not (stops or self._stops(pending)):
                    raise
                # What ended the run has happened; that its pieces find no rest does not undo it.
                log.warning("cycle %d shows the blocks before they moved on: %s", self.number, failure)
                self.state = self.state if load_time is None else replace(self.state, time=load_time)
                yield self._record(self.state, np.empty(0, TIP), {}, pending, growth_pass, {})
                return True
            if static:
                # The passes of a step share its load, also when one of them has to take a shorter step.
                load_time = result.state.time
            tips = tip_rows(self.problem, self.blocks, solutions, self.nodes_of)
            may_grow = growth_pass < self.problem.growth.max_passes
            events, stops = pending, stops or self._stops(pending)
            growth = self._growth(tips) if may_grow and not stops else None
            if growth is None and may_grow and not stops and self.problem.growth.initiation:
                growth, born = self._births(solutions, result.state)
                events += born
            if growth is None and static and not stops:
                # Not before growth has ended: a block that hangs by a thread is strained beyond measure until it parts.
                lost = self._lost(result.state)
                events, stops = events + lost, bool(lost)
            if growth is not None:
                tips["grown"] = growth.grown
                events += self._initiations(tips, result.state)
                stops = self._stops(events)
            # What is dug out takes what it stores along.
            dug = result.state.removed is not self.state.removed
            budget = (self.budget.cut() if dug else self.budget).after(result.energy, result.state.time)
            statistics = {**result.statistics, **budget.statistics(), **mismatch}
            yield self._record(result.state, tips, solutions, events, growth_pass, statistics)
            if growth is None:
                if not may_grow:
                    log.warning(
                        "cycle %d: tips still grow after %d passes at one load; going on to the next load",
                        self.number,
                        growth_pass,
                    )
                self.length.after(result, dt, self.system.allowed_ratio)
                self.state, self.budget = result.state, budget
                self.history = {b: s.memory for b, s in solutions.items() if s.memory is not None}
                return stops
            pending = self._take_growth(growth, result, solutions)
        raise AssertionError("unreachable: the last pass takes no growth")

    def _relax(self, load_time: float) -> tuple[Event, ...]:
        """Bring the blocks to rest under the loads of ``load_time``; a collapse when there is no equilibrium."""
        settings = self.problem.dda
        with self._timed("dda"):
            found = dda.equilibrium(
                self.system, self.state, self.problem.loads, load_time=load_time, crack=self.response,
                tolerance=settings.unbalanced_tolerance,
            )  # fmt: skip
        # The budget is one of the steps that are recorded.
        self.state, self.budget = found.state, self.budget.cut()
        if not found.collapsed:
            if not found.converged:
                log.warning("t = %g s: %s; going on from there", load_time, found.reason)
            return ()
        log.warning("t = %g s: %s; the run ends", load_time, found.reason)
        first = int(self.blocks.vertex_start[found.moving[0]])
        return (self._event("collapse", self.state, self.blocks.vertices[first], found.reason),)

    def _settle_in_situ(self) -> None:
        """Begin with the blocks at rest under the in-situ stress; where they are then is the reference. Cracks are as if cut
        into them then: they open and slide from the first step on."""
        with self._timed("dda"):
            found = dda.in_situ_state(self.system, self.problem.in_situ, self.problem.loads)
        motion = Motion.of(self.blocks, found.state.vertices)

        def moved(block: int, point) -> tuple[float, float]:
            return tuple(motion.current(block, np.asarray(point, dtype=float)).tolist())

        nodes = self.cracks.nodes.copy()
        for block in np.unique(self.cracks.block).tolist():
            own = np.unique(self.cracks.segments[self.cracks.block == block])
            nodes[own] = motion.current(block, nodes[own])
        self.cracks = replace(self.cracks, nodes=nodes)
        self.problem = replace(self.problem, loads=on_moved(self.problem.loads, moved))
        if self.gauge is not None:
            self.gauge = tuple((b, moved(b, p)) for b, p in self.gauge)
        self.monitors = {name: (b, moved(b, p)) for name, (b, p) in self.monitors.items()}
        self.blocks, self.state = found.blocks, found.state
        self._take_blocks()

    def _excavated(self) -> tuple[Event, ...]:
        """Leave out the elastic bodies of blocks that are taken out at the present time; an event for each."""
        removed = self.system.removed(self.problem.loads, self.state.time)
        if removed is self.removed:
            return ()
        new = removed if self.removed is None else removed & ~self.removed
        self.removed = removed
        self._take_bodies()
        return tuple(
            self._event(
                "excavation", self.state, self.blocks.area_moments(b)[1], f"{self.blocks.names[b]} is taken out"
            )
            for b in np.flatnonzero(new).tolist()
        )

    def _lost(self, state: State) -> tuple[Event, ...]:
        """A collapse, when a block has gone farther than the blocks reach: in statics nothing will hold it any more, and
        ever shorter steps would follow it for ever."""
        moved = np.hypot(*(state.vertices - self.blocks.vertices).T)
        farthest = int(np.argmax(moved))
        if not moved[farthest] > np.hypot(*np.ptp(self.blocks.vertices, axis=0)):
            return ()
        name = self.blocks.names[self.blocks.vertex_block[farthest]]
        detail = f"nothing holds {name}: it has moved {moved[farthest]:.3g} m"
        log.warning("t = %g s: %s; the run ends", state.time, detail)
        return (self._event("collapse", state, self.blocks.vertices[farthest], detail),)

    # -- one pass ------------------------------------------------------------------------------------------------

    def _equilibrium(self, dt: float, load_time: float | None):
        """DDA step, boundary loads, DDM solves, until the crack strain that DDA assumed is the one DDM finds.

        ``load_time``: when the loads are those of that time, whatever step the blocks take; it then is the new time.
        """
        for attempt in range(COMPLIANCE_PASSES):
            with self._timed("dda"):
                result = self.system.step(self.state, self.problem.loads, dt, self.response, load_time)
                if load_time is not None and result.state.time != load_time:
                    result = replace(result, state=replace(result.state, time=load_time))
            if not self.bodies:
                return result, {}, {}
            solutions = self._solve_bodies(result)
            mismatch = self._take_response(result.state, solutions)
            if mismatch < COMPLIANCE_TOLERANCE:
                break
        imbalance = max(load.imbalance for load in self.loads.values())
        return (
            result,
            solutions,
            {
                "compliance_passes": attempt + 1,
                "compliance_mismatch": mismatch,
                "traction_imbalance": imbalance,
            },
        )

    def _solve_bodies(self, result) -> dict:
        """Every body under what the block solver's forces are on it; keeps loads and solutions."""
        with self._timed("tractions"):
            # Equilibrium holds on the geometry at the start of the step.
            loads = boundary_loads(self.problem, self.blocks, self.state, self._motion(self.state), result, self.bodies)
        self.loads = loads
        self.solutions = self._solve(self.bodies, loads, self.solutions)
        self.solved_from = self.history
        return self.solutions

    def _solve(self, bodies: dict, loads: dict[int, BoundaryLoad], warm: dict) -> dict:
        with self._timed("ddm solve"):
            return solve_bodies(bodies, loads, warm, self.history, self.solved_from)

    def _take_response(self, state: State, solutions: dict) -> float:
        """Set what DDA should assume next, and say how far off the last assumption was (relative strain)."""
        worst = 0.0
        compliance, offset = self.response.compliance.copy(), self.response.offset.copy()
        with self._timed("compliance"):
            own = side_by_side(lambda of: self._compliance(*of), list(solutions.items()), threads_for(self.bodies))
            self.compliances.update(zip(solutions, own))
            for b, solution in solutions.items():
                s, e = crack_response(
                    self.compliances[b][2],
                    solution.crack_strain,
                    state.stress[b],
                    float(state.rotation[b]),
                )
                found, assumed = e + s @ state.stress[b], state.crack_strain[b]
                elastic = self.system.compliance[b] @ state.stress[b]
                size = np.abs(elastic).max() + np.abs(found).max()
                if size > 0:
                    worst = max(worst, float(np.abs(found - assumed).max() / size))
                compliance[b], offset[b] = s, e
        self.response = dda.CrackResponse(compliance, offset)
        return worst

    def _compliance(self, block: int, solution) -> tuple:
        """The geometry and the states of crack faces that S belongs to, and S in the block's own axes: it does not change
        with the load."""
        body = self.bodies[block]
        states = solution.closed.tobytes() if solution.memory is None else solution.face_states.key
        known = self.compliances.get(block)
        if known is not None and known[0] is body.crack_system and known[1] == states:
            body.work.compliances_kept += 1
            return known
        s = body.compliance(solution)
        return body.crack_system, states, s

    # -- growth --------------------------------------------------------------------------------------------------

    def _growth(self, tips: np.ndarray):
        """The new network when some tip has reached its toughness, else None. Sets the angles that were followed."""
        k_ic = np.array([self.problem.materials[m].k_ic for m in self.blocks.material[tips["block"]]])
        if not np.any(tips["k_eq"] >= k_ic):
            return None
        from ..ddm.growth import advance
        from ..ddm.path import corrected

        trial = self.bodies

        def grow():
            with self._timed("growth"):
                return advance(self.cracks, self.blocks.loops, tips, self.problem.growth, k_ic, self.number)

        def look_ahead(cracks):
            nonlocal trial
            trial, nodes_of = self._bodies_of(cracks, trial)
            ahead = self._solve(trial, self.loads, self.solutions)
            return tip_rows(self.problem, self.blocks, ahead, nodes_of)

        growth = corrected(tips, grow, look_ahead, self.number, self.problem.growth.correct)
        if growth is not None:
            self.bodies = trial  # most of it is what the corrected step needs
        return growth

    def _births(self, solutions: dict, state: State):
        """New cracks, and their events, where no tip grows and whole rock is strained to its strength."""
        from .births import bear_in_blocks

        with self._timed("growth"):
            growth, births = bear_in_blocks(
                self.cracks, self.blocks, self.problem.materials, solutions, self.problem.growth, self.number
            )
        names = growth.cracks.names[self.cracks.n_cracks :] if growth is not None else ()
        return growth, tuple(
            self._event("birth", state, birth.start, f"{name} starts in {birth.kind} ({birth.place})")
            for name, birth in zip(names, births)
        )

    def _initiations(self, tips: np.ndarray, state: State) -> tuple[Event, ...]:
        """An event for every tip that grows for the first time; wings inherit their crack and end by position."""
        events = []
        first = {int(s): k for k, s in reversed(list(enumerate(self.cracks.segments.ravel())))}
        for tip in tips[tips["grown"] > 0]:
            segment = first[int(tip["node"])] // 2
            if self.cracks.birth_cycle[segment] == 0:
                events.append(
                    self._event("initiation", state, tip["point"], f"{self.cracks.names[tip['crack']]} starts to grow")
                )
        return tuple(events)

    def _take_growth(self, growth, result, solutions) -> tuple[Event, ...]:
        """Make ``growth`` the present geometry; split what it cut through. Returns the events it brought."""
        names = self.cracks.names
        events = []
        for join in growth.joins:
            other = f" {names[join.other_crack]}" if join.other_crack >= 0 else " the surface"
            events.append(self._event(join.kind, result.state, join.point, f"{names[join.crack]} meets{other}"))
        self.cracks = growth.cracks
        with self._timed("growth"):
            split = None
            if growth.joins:
                split = split_blocks(self.blocks, self.state, self.cracks, self._mean_stress(solutions))
        if split is None:
            self._take_bodies()
            return tuple(events)
        for b in np.flatnonzero(np.bincount(split.parent, minlength=self.blocks.n_blocks) > 1):
            parts = np.flatnonzero(split.parent == b)
            centre = self.blocks.loops(b)[0].mean(axis=0)
            events.append(
                self._event("split", result.state, centre, f"{self.blocks.names[b]} is cut into {len(parts)} blocks")
            )
        self._follow_split(split)
        return tuple(events)

    def _follow_split(self, split) -> None:
        """Blocks, state and cracks of the split; gauges and monitors go to the child that holds their point."""

        def child(block: int, point) -> int:
            parts = np.flatnonzero(split.parent == block)
            if len(parts) == 1:
                return int(parts[0])
            inside = [winding_number(split.blocks.loops(p), np.asarray(point, dtype=float)) for p in parts]
            return int(parts[int(np.argmax(np.abs(inside)))])

        if self.gauge is not None:
            self.gauge = tuple((child(b, p), p) for b, p in self.gauge)
        self.monitors = {name: (child(b, p), p) for name, (b, p) in self.monitors.items()}
        self.problem = replace(self.problem, loads=on_children(self.problem.loads, split.parent, child))
        if self.removed is not None:
            self.removed = self.removed[split.parent]
        self.history = inherited(self.history, split.parent, split.cracks)
        self.blocks, self.state, self.cracks = split.blocks, split.state, split.cracks
        self.budget = self.budget.cut()
        self._take_blocks(split.parent)

    def _mean_stress(self, solutions: dict):
        """block → (polygon → mean stress there, current axes), from the last solved elastic body."""

        def of_block(block: int):
            solution = solutions[block]
            return lambda loops: rotated_mean_stress(solution, loops, float(self.state.rotation[block]))

        return {b: of_block(b) for b in solutions}

    # -- geometry changed ----------------------------------------------------------------------------------------

    def _take_blocks(self, parent: np.ndarray | None = None) -> None:
        """New blocks: a new block system. Of blocks that are their ``parent`` (n_blocks,), whole, under another number what
        is known of their cracks is kept."""
        problem = self.problem
        self.system = dda.BlockSystem(
            self.blocks, problem.materials, problem.joints, joint_index=problem.joint_index, settings=problem.dda
        )
        n = self.blocks.n_blocks
        self.nodes_of = {}
        response = dda.CrackResponse(np.zeros((n, 3, 3)), np.zeros((n, 3)))
        whole = np.zeros(0, int) if parent is None else np.flatnonzero(np.bincount(parent)[parent] == 1)
        if len(whole):
            response.compliance[whole] = self.response.compliance[parent[whole]]
            response.offset[whole] = self.response.offset[parent[whole]]
        self.response = response
        self.bodies, self.solutions, self.compliances, self.solved_from = (
            {child: known[parent[child]] for child in whole.tolist() if parent[child] in known}
            for known in (self.bodies, self.solutions, self.compliances, self.solved_from)
        )
        self._take_bodies()

    def _take_bodies(self) -> None:
        """The elastic bodies of the present cracks, keeping what has not changed."""
        self.bodies, self.nodes_of = self._bodies_of(self.cracks, self.bodies)

    def _bodies_of(self, cracks: Cracks, kept: dict) -> tuple[dict, dict[int, np.ndarray]]:
        with self._timed("ddm assembly"):
            return elastic_bodies(self.problem, self.blocks, cracks, kept, self.works, self.removed)

    # -- records -------------------------------------------------------------------------------------------------

    def _record(self, state, tips, solutions, events, growth_pass, statistics) -> Cycle:
        motion = self._motion(state)
        cycle = Cycle(
            number=self.number,
            load_step=self.load_step,
            growth_pass=growth_pass,
            load=leading_load(self.problem, self.blocks, state.time),
            strain=axial_strain(self.gauge, motion),
            blocks=self.blocks,
            state=state,
            cracks=self.cracks,
            tips=tips,
            faces=joined_faces(self.cracks, solutions),
            bodies=solutions,
            events=tuple(events),
            monitors={name: motion.current(b, point) - np.asarray(point) for name, (b, point) in self.monitors.items()},
            statistics=statistics,
            seconds=dict(self.seconds),
            work=vars(Work.total(self.works)) if self.works else {},
        )
        vars(cycle)["motion"] = motion  # known here: the property need not find it again
        return cycle

    def _motion(self, state: State) -> Motion:
        """The blocks' motion in ``state``; the record of one step and the loads of the next ask for the same one."""
        if self.known_motion is None or self.known_motion[0] is not state:
            self.known_motion = state, Motion.of(self.blocks, state.vertices)
        return self.known_motion[1]

    def _event(self, kind: str, state: State, point, detail: str) -> Event:
        load = leading_load(self.problem, self.blocks, state.time)
        return Event(kind, self.number, state.time, load, (float(point[0]), float(point[1])), detail)

    def _stops(self, events: tuple[Event, ...]) -> bool:
        return any(event.kind in self.problem.run.stop_at for event in events)

    @contextmanager
    def _timed(self, phase: str):
        start = clock.perf_counter()
        try:
            yield
        finally:
            self.seconds[phase] = self.seconds.get(phase, 0.0) + clock.perf_counter() - start
