"""The elastic bodies of cracked blocks: made from blocks and cracks, loaded with the block solver's forces, solved."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..model import TIP, Blocks, Cracks, Motion, Problem, State
from .tractions import BoundaryLoad, boundary_load

if TYPE_CHECKING:
    from ..ddm import Body, Work


def elastic_bodies(
    problem: Problem, blocks: Blocks, cracks: Cracks, kept: dict, work: Work, removed: np.ndarray | None = None
) -> tuple[dict[int, Body], dict[int, np.ndarray]]:
    """block → body of every moving block that holds ``cracks`` (or may come to), and block → its nodes in the whole network.
    What keeps a fixed block in place, and so what strains it, is not known; what is ``removed`` (n_blocks,) is not there.

    ``kept``: earlier bodies of the same blocks, of which whatever has not changed is reused; ``work`` counts what was done.
    """
    cracked = np.arange(blocks.n_blocks) if problem.growth.initiation else np.unique(cracks.block)
    rigid = np.array([m.rigid for m in problem.materials], bool)
    cracked = cracked[~(blocks.fixed | rigid[blocks.material])[cracked]]
    if removed is not None:
        cracked = cracked[~removed[cracked]]
    if not len(cracked):
        return {}, {}
    from .. import ddm

    bodies, nodes_of = {}, {}
    for b in cracked.tolist():
        segments = np.flatnonzero(cracks.block == b)
        nodes_of[b] = np.unique(cracks.segments[segments])
        bodies[b] = ddm.Body(
            blocks.loops(b),
            cracks.take(segments),
            problem.materials[blocks.material[b]],
            problem.ddm,
            previous=kept.get(b),
            face_laws=problem.face_laws,
            work=work,
        )
    return bodies, nodes_of


def boundary_loads(
    problem: Problem, blocks: Blocks, state: State, motion: Motion, result, bodies: dict
) -> dict[int, BoundaryLoad]:
    """block → load of every one of ``bodies``, from the step ``result`` that began at ``state`` with ``motion``: on that
    geometry the forces are in equilibrium."""
    forces = result.forces
    return {
        b: boundary_load(
            b,
            blocks,
            state.vertices,
            motion,
            float(state.rotation[b]),
            result.contacts,
            forces.edges[forces.edges["block"] == b],
            forces.points[forces.points["block"] == b],
            problem.materials[blocks.material[b]].density,
            forces.inertia.gravity,
            result.acceleration[b],
            problem.dda.dynamic_factor * float(state.velocity[b, 2]),
            None if forces.reaction is None else forces.reaction[b],
        )
        for b in bodies
    }


def solve_bodies(bodies: dict, loads: dict[int, BoundaryLoad], warm: dict, history: dict) -> dict:
    """block → solution of its body; ``warm``: earlier solutions, whose face states are the first guess; ``history``: what
    crack faces with friction remember of the load step before."""
    from .. import ddm

    return {
        b: body.solve(
            ddm.BodyLoad(
                segments=loads[b].segments,
                tractions=loads[b].tractions,
                body_force=loads[b].body_force,
                body_force_gradient=loads[b].body_force_gradient,
                about=loads[b].about,
                points=loads[b].points,
                forces=loads[b].forces,
            ),
            warm=warm.get(b),
            history=history.get(b),
        )
        for b, body in bodies.items()
    }


def inherited(history: dict, parent: np.ndarray, cracks: Cracks) -> dict:
    """child → what the faces of its ``cracks`` remember (`ddm.FaceMemory`), from that of the parents, ``parent``
    (n_children,). Children keep their parent's reference coordinates, and so its memory; the work done by friction so
    far goes on with one of them, or a sum over blocks would count it twice."""
    found, told = {}, set()
    for child in np.unique(cracks.block).tolist():
        block = int(parent[child])
        if block in history:
            found[child] = replace(history[block], work=0.0) if block in told else history[block]
            told.add(block)
    return found


def tip_rows(problem: Problem, blocks: Blocks, solutions: dict, nodes_of: dict[int, np.ndarray]) -> np.ndarray:
    """TIP rows of all solved bodies with the criterion's angle and K_eq, nodes counted in the whole network."""
    if not solutions:
        return np.empty(0, TIP)
    from ..ddm.trial_kinks import judged

    rows = []
    for b, solution in solutions.items():
        tips = solution.tips.copy()
        tips["node"] = nodes_of[b][tips["node"]]
        tips["angle"], tips["k_eq"] = judged(solution, problem.growth, problem.materials[blocks.material[b]])
        rows.append(tips)
    return rows[0] if len(rows) == 1 else np.concatenate(rows)
