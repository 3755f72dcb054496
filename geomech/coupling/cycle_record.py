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
from .load_transfer.elastic_bodies import solve_bodies, tip_rows

if TYPE_CHECKING:
    from ..ddm import Body
    from .coupled_state import CrackedBlocks


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
    )
    vars(cycle)["motion"] = motion  # already known
    del vars(cycle)["faces"]  # computed on first use
    if left_out:
        del vars(cycle)["tips"], vars(cycle)["bodies"]
        vars(cycle)["_rest"] = _LeftOut(now, solutions, tips, dict(left_out))
    return cycle


class _LazyCycle(Cycle):
    """A cycle that joins crack faces and solves bodies left out on demand."""

    _rest: _LeftOut

    @cached_property
    def faces(self) -> CrackFaces | None:
        return joined_faces(self.cracks, self.bodies)

    @cached_property
    def bodies(self) -> dict[int, Any]:
        return self._rest.bodies()

    @cached_property
    def tips(self) -> np.ndarray:
        return self._rest.tips(self.bodies)


class _LeftOut:
    """Solves bodies left out of a pass as they would have been solved in it, from a copy of the data in ``now``, which
    will change."""

    def __init__(self, now: CrackedBlocks, solutions: dict, tips: np.ndarray, left_out: dict[int, Body]) -> None:
        self._screening, self._solutions, self._left_out = now.growth_screening, solutions, left_out
        self._tips = tips
        self._problem, self._blocks, self._nodes_of = now.problem, now.blocks, now.nodes_of
        self._order, self._loads = list(now.bodies), {block: now.loads[block] for block in left_out}

    def bodies(self) -> dict[int, Any]:
        """block → solution of all bodies, in their order."""
        self._screening.asked += 1
        found = solve_bodies(self._left_out, self._loads, {}, {}, names=self._blocks.names)
        for body in self._left_out.values():
            body.work.solutions_left_out -= 1
        found |= self._solutions
        return {block: found[block] for block in self._order}

    def tips(self, solutions: dict[int, Any]) -> np.ndarray:
        """TIP rows of all bodies; those of the pass have what its tips have grown."""
        left_out = {block: solutions[block] for block in self._left_out}
        known = np.concatenate([self._tips, tip_rows(self._problem, self._blocks, left_out, self._nodes_of)])
        return np.concatenate([known[known["block"] == block] for block in self._order])


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
