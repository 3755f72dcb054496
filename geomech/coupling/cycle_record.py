"""Records of cycles and events: leading load, axial strain, and all crack faces in one table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..dda.higher_order.bent_body import bent_bodies
from ..dda.step_control.step_limits import shortened
from ..ddm.counters import Work
from ..model import WEIGHT, Blocks, CrackFaces, Cracks, Cycle, Event, Motion, Problem, Skip, State
from .crack_compliance.growth_screening import LastSolution
from .load_transfer.elastic_bodies import MANY, solve_bodies, tips_with_criterion

if TYPE_CHECKING:
    from ..ddm import Body
    from .coupled_state import CrackedBlocks

#: Number of cycles after which bodies left out of all passes since are solved for `Cycle.latest_tips`; as often as interior
#: fields are written while nothing grows.
RENEWED = 50


def record(
    now: CrackedBlocks, state: State, tips: np.ndarray, solutions: dict, events: tuple[Event, ...], growth_pass: int,
    statistics: dict[str, float], left_out: Mapping[int, Body] = MappingProxyType({}),
) -> Cycle:  # fmt: skip
    """The record of a pass that ended at ``state`` (or of blocks at rest there). Bodies ``left_out`` of the pass are
    solved when their results are used."""
    motion = now.motion(state)
    endless = now.problem.endless
    if endless is not None:
        state = replace(state, stress=np.broadcast_to(endless.stress_at(state.time), state.stress.shape).copy())
    work = vars(Work.total(now.works)) if now.works else {}
    bent = bent_bodies(now.system.deflected, state, motion)

    def moved(block: int, point: tuple[float, float]) -> np.ndarray:
        affine = motion.current(block, np.asarray(point)) - np.asarray(point)
        return affine + bent[block].deflection(np.array([point], float))[0] if block in bent else affine

    cycle = _LazyCycle(
        number=now.number,
        load_step=now.load_step,
        growth_pass=growth_pass,
        load=leading_load(now.problem, now.blocks, state.time, now.acted),
        strain=axial_strain(now.gauge, motion),
        blocks=now.blocks,
        state=state,
        cracks=now.cracks,
        tips=tips,
        bodies=solutions,
        bent=bent,
        events=tuple(events),
        monitors={name: moved(b, point) for name, (b, point) in now.monitors.items()},
        statistics=statistics,
        seconds=dict(now.timed.seconds),
        work=work,
        skips=skips(now, work),
        shortened=shortened(now.block_work),
        sparing=len(now.bodies) >= MANY and not now.system.scheme.static,
    )
    vars(cycle)["motion"] = motion  # already known
    del vars(cycle)["faces"]  # computed on first use
    if left_out:
        del vars(cycle)["tips"], vars(cycle)["bodies"]
        vars(cycle)["_rest"] = _LeftOut(now, solutions, tips, dict(left_out), cycle.sparing)
    return cycle


class _LazyCycle(Cycle):
    """A cycle that joins crack faces and solves bodies left out on demand."""

    _rest: _LeftOut

    @cached_property
    def faces(self) -> CrackFaces | None:
        return joined_faces(self.cracks, self.bodies)

    @cached_property
    def bodies(self) -> dict[int, Any]:
        return self._rest.bodies(self.number)

    @property
    def has_fields(self) -> bool:
        return "_rest" in vars(self) or super().has_fields

    @cached_property
    def tips(self) -> np.ndarray:
        return self._rest.tips(self.bodies)

    @property
    def _all_solved(self) -> bool:
        known = vars(self)
        return "_rest" not in known or "bodies" in known or not self.sparing

    @cached_property
    def _latest(self) -> dict[int, LastSolution]:
        return self._rest.latest(self.number)

    @cached_property
    def _latest_rows(self) -> tuple[np.ndarray, np.ndarray]:
        if self._all_solved:
            return self.tips, np.full(len(self.tips), self.number)
        tips = self._rest.latest_tips(self._latest)
        return tips, np.array([self._latest[block].number for block in tips["block"].tolist()], int)

    @property
    def latest_tips(self) -> np.ndarray:
        return self._latest_rows[0]

    @property
    def solved_in(self) -> np.ndarray:
        return self._latest_rows[1]

    @cached_property
    def latest_faces(self) -> CrackFaces | None:
        if self._all_solved:
            return self.faces
        return joined_faces(self.cracks, {block: last.solution for block, last in self._latest.items()})


class _LeftOut:
    """Solves bodies left out of a pass as they would have been solved in it, from a copy of the data in ``now``, which
    will change. ``sparing`` as of the cycle."""

    def __init__(
        self, now: CrackedBlocks, solutions: dict, tips: np.ndarray, left_out: dict[int, Body], sparing: bool
    ) -> None:
        self._screening, self._solutions, self._left_out = now.growth_screening, solutions, left_out
        self._tips = tips
        self._problem, self._blocks, self._nodes_of = now.problem, now.blocks, now.nodes_of
        self._order, self._loads = list(now.bodies), {block: now.loads[block] for block in left_out}
        self._last = {block: now.growth_screening.last(block) for block in left_out}
        self._history = {block: now.history[block] for block in left_out if block in now.history}
        self._solved: dict[int, Any] = {}
        self._sparing = sparing

    def bodies(self, number: int) -> dict[int, Any]:
        """block → solution of all bodies at cycle ``number``, in their order."""
        if not self._sparing:
            self._screening.asked += 1
        self._solve(self._left_out, number)
        found = self._solved | self._solutions
        return {block: found[block] for block in self._order}

    def _solve(self, bodies: dict[int, Body], number: int) -> None:
        """Solve ``bodies``, which were left out of cycle ``number``, where they are not yet solved."""
        bodies = {block: body for block, body in bodies.items() if block not in self._solved}
        if not bodies:
            return
        before = {block: self._last[block].solution for block in bodies}
        found = solve_bodies(bodies, self._loads, before, self._history, self._blocks.names, forgets=self._sparing)
        self._solved |= found
        for block, solution in found.items():
            if self._sparing:
                bodies[block].forget_loads()
            bodies[block].work.solutions_left_out -= 1
            last = self._last[block]
            if last.number < number:  # not if later cycles have asked before
                last.solution, last.number = solution, number

    def tips(self, solutions: dict[int, Any]) -> np.ndarray:
        """TIP rows of all bodies; those of the pass have what its tips have grown."""
        return self._all_tips({block: solutions[block].tips for block in self._left_out})

    def _all_tips(self, left_out: dict[int, np.ndarray]) -> np.ndarray:
        rows = tips_with_criterion(self._problem, self._blocks, left_out, self._nodes_of)
        known = np.concatenate([self._tips, rows])
        return np.concatenate([known[known["block"] == block] for block in self._order])

    def latest(self, number: int) -> dict[int, LastSolution]:
        """block → last solution of all bodies at cycle ``number``. Bodies left out for `RENEWED` cycles are solved."""
        self._solve({b: of for b, of in self._left_out.items() if number - self._last[b].number >= RENEWED}, number)
        # (A copy: the entries are renewed when later cycles ask.)
        found = {block: replace(last) for block, last in self._last.items()}
        found |= {block: LastSolution(solution, number) for block, solution in self._solutions.items()}
        return {block: found[block] for block in self._order}

    def latest_tips(self, latest: dict[int, LastSolution]) -> np.ndarray:
        """TIP rows of all bodies by their ``latest`` solutions."""
        rows = {}
        for block, body in self._left_out.items():
            # Cracks may have got other numbers since.
            rows[block] = body.tip_elements[0].copy()
            for name in ("k_i", "k_ii"):
                rows[block][name] = latest[block].solution.tips[name]
        return self._all_tips(rows)


def skips(now: CrackedBlocks, work: dict[str, int]) -> dict[str, Skip]:
    """Operations skipped so far because nothing had changed, by kind; kinds without any are left out. The mean time of
    an operation excludes the first one, which loads kernels."""
    blocks, seconds = now.block_work, now.timed.seconds
    found = {
        "pair searches": Skip(blocks.pair_searches_kept, blocks.pair_searches - 1, blocks.pair_search_s),
        "contact searches": Skip(blocks.lone_searches),
        "factorisations": Skip(blocks.factorisations_kept, blocks.factorisations - 1, blocks.factorisation_s),
    }
    if work:
        found |= {
            "bodies": Skip(work["bodies_kept"], work["bodies"], seconds.get("ddm assembly", 0.0)),
            "solutions": Skip(work["solutions_kept"], work["solutions"], seconds.get("ddm solve", 0.0)),
            "left-out solutions": Skip(work["solutions_left_out"], work["solutions"], seconds.get("ddm solve", 0.0)),
            "scaled solutions": Skip(work["solutions_scaled"], work["solutions"], seconds.get("ddm solve", 0.0)),
            "compliances": Skip(
                work["compliances_kept"], work["compliances"] - 1, now.each.seconds.get("compliances", 0.0)
            ),
        }
    return {name: skip for name, skip in found.items() if skip.kept}


def event(now: CrackedBlocks, kind: str, state: State, point, detail: str) -> Event:
    """An event at ``state`` in the present cycle, at ``point`` (reference coordinates)."""
    load = leading_load(now.problem, now.blocks, state.time, now.acted)
    return Event(kind, now.number, state.time, load, (float(point[0]), float(point[1])), detail)


def leading_load(problem: Problem, blocks: Blocks, now: float, acted: Mapping[str, float]) -> float:
    """The load that a run is plotted against, Pa, positive in compression; 0 if there is none.

    On a leading edge: the normal traction, plus, if the block of that edge has a prescribed motion, the force of that
    motion over the edge's length (from the statistics ``acted`` of the step). In unbounded rock: its leading load. If
    the weight leads (`WEIGHT`): ρ g h of a column of the heaviest moving rock as high as the scene."""
    if problem.endless is not None:
        return problem.endless.load_at(now)
    name = problem.load_edge
    edges = blocks.edges_named(name) if name else np.zeros(0, int)
    if not len(edges):
        return _weight_of_a_column(problem, now) if name == WEIGHT else 0.0
    outward = blocks.outward_normals[edges[0]]
    tractions = sum(
        -float(load.history.at(now) @ outward) for load in problem.loads.edge_tractions if load.edge_name == name
    )
    moved = {motion.block for motion in problem.loads.block_motions} & set(blocks.vertex_block[edges].tolist())
    force = np.array([[acted.get(f"reaction_{axis}:{blocks.names[b]}", 0.0) for axis in "xy"] for b in sorted(moved)])
    if not len(force):
        return tractions
    ends = blocks.vertices[blocks.next_vertex[edges]] - blocks.vertices[edges]
    return tractions - float(force.sum(axis=0) @ outward) / float(np.hypot(*ends.T).sum())


def _weight_of_a_column(problem: Problem, now: float) -> float:
    # From the problem's blocks, not the present ones: split and fallen blocks must not change the scale of the load.
    blocks = problem.blocks
    moving = blocks.material[~blocks.fixed]
    density = max((problem.materials[m].density for m in np.unique(moving).tolist()), default=0.0)
    height = float(np.ptp(blocks.vertices[~blocks.fixed[blocks.vertex_block], 1])) if len(moving) else 0.0
    return density * height * math.hypot(*problem.loads.gravity.at(now).tolist())


def axial_strain(gauge, motion: Motion) -> float:
    """Shortening of the ``gauge`` (two pairs of block and material point) over its length; nan without one."""
    if gauge is None:
        return float("nan")
    (a, p), (b, q) = gauge
    return 1 - math.dist(motion.current(b, q), motion.current(a, p)) / math.dist(q, p)


def joined_faces(cracks: Cracks, solutions: dict) -> CrackFaces | None:
    """The faces of all solved bodies (block → solution), with segments numbered in the whole network."""
    if not solutions:
        return None
    faces = [
        replace(solution.faces, segment=np.flatnonzero(cracks.block == b)[solution.faces.segment])
        for b, solution in solutions.items()
    ]
    if len(faces) == 1:
        return faces[0]
    return CrackFaces(**{f.name: np.concatenate([getattr(each, f.name) for each in faces]) for f in fields(CrackFaces)})
