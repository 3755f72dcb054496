"""Elastic bodies of cracked blocks: made from blocks and cracks, loaded with contact forces, and solved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from ...ddm.counters import Work
from ...ddm.crack_contact.face_laws import Released
from ...model import AUTO_ORDER, TIP, Blocks, Cracks, Motion, Problem, State
from ...model.blocks.polygon import joined_loops
from ..parallel_map import parallel_map, return_free_memory
from . import boundary_tractions
from .boundary_tractions import BoundaryForces, BoundaryLoad
from .inertia_forces import BlockInertia
from .polynomial_traction import between_cells, without_faces

if TYPE_CHECKING:
    from ...ddm import Body


#: Number of bodies from which each new one gives up large matrices that only growth and fields inside it need. (Factors of
#: the sides of 48 blocks of a trace map took 1.1 GB, and cracks grew in a few.)
MANY = 8

#: Bytes that many bodies together keep for further growth: those of ten blocks with 2 000 unknowns on their sides, or of one
#: with 6 000.
FOR_GROWTH = 3.2e8


#: A side lies on a base if it is off by less than this part of its length.
ON_BASE = 1e-2


def elastic_bodies(
    problem: Problem, blocks: Blocks, cracks: Cracks, kept: dict, works: list[Work], removed: np.ndarray | None = None
) -> tuple[dict[int, Body], dict[int, np.ndarray]]:
    """Bodies (block →) of all moving blocks with ``cracks``, or in which cracks may start, and their nodes in the whole
    network (block →). Fixed blocks have none, since the forces that fix them are unknown; nor have those ``removed``
    (n_blocks,).

    ``kept``: earlier bodies of the same blocks, reused as far as they have not changed; new ones are made in parallel.
    ``works``: counters of the bodies; those of bodies without a predecessor are appended.
    """
    every = problem.growth.initiation or problem.endless is not None
    cracked = np.arange(blocks.n_blocks) if every else np.unique(cracks.block)
    rigid = np.array([m.rigid for m in problem.materials], bool)
    if problem.endless is None:
        cracked = cracked[~(blocks.fixed | rigid[blocks.material])[cracked]]
    if removed is not None:
        cracked = cracked[~removed[cracked]]
    if not len(cracked):
        return {}, {}
    from ... import ddm

    bodies: dict[int, Body | None] = {}
    nodes_of, to_make = {}, []
    segments_of = _rows_of(cracks.block, cracked)
    for b, segments in zip(cracked.tolist(), segments_of):
        nodes_of[b] = np.unique(cracks.segments[segments])
        own, material, old = cracks.take(segments), problem.materials[blocks.material[b]], kept.get(b)
        if old is None:
            works.append(Work())
        work = works[-1] if old is None else old.work
        if not problem.run.skip:
            old = None
        bodies[b] = None if old is None else old.reusable_for(_loops(problem, blocks, b), own, material)
        if bodies[b] is not None:
            work.bodies_kept += 1
            continue
        to_make.append((b, own, material, old, work))

    straight = keep_straight(problem, blocks)
    has_bases = may_have_bases(problem, blocks)
    # The first load needs more of few bodies, as growth at once; of many it is growth in few.
    lean = len(cracked) >= MANY

    spare = FOR_GROWTH - sum(body.for_growth for body in bodies.values() if body is not None)
    counting = Lock()

    def made(of: tuple) -> Body:
        nonlocal spare
        body = assembled(of)
        if of[3] is not None:
            of[3].retire()
            with counting:
                enough = body.for_growth <= spare
                spare -= body.for_growth if enough else 0
            if not enough:
                body.stop_growing()
        elif lean:
            body.release()
        return body

    def assembled(of: tuple) -> Body:
        b, own, material, old, work = of
        own_loops, reuse, laws = _loops(problem, blocks, b), ddm.Reuse(old, work), problem.face_laws
        if problem.endless is None:
            finer = wide_on_base(blocks, b, straight) if has_bases[b] else 1.0
            # (A square is as wide as deep, whatever round-off says.)
            per_side = math.ceil(finer * problem.ddm.elements_per_side - ON_BASE)
            settings = replace(problem.ddm, elements_per_side=per_side)
            return ddm.Body(own_loops, own, material, settings, reuse, face_laws=laws)
        surface = problem.endless.surface
        outline = [] if surface is None else ddm.HalfPlane(*surface)
        return ddm.Body(outline, own, material, problem.ddm, reuse, holes=own_loops, face_laws=laws)

    # The largest first, while the others take no memory yet.
    largest_first = sorted(to_make, key=lambda of: -sum(map(len, _loops(problem, blocks, of[0]))) - of[1].n_segments)
    made_of = dict(zip([of[0] for of in largest_first], parallel_map(made, largest_first)))
    bodies.update({of[0]: made_of[of[0]] for of in to_make})
    if lean and to_make:
        return_free_memory()
    return bodies, nodes_of


def _loops(problem: Problem, blocks: Blocks, block: int) -> list[np.ndarray]:
    """Loops that bound the rock of ``block``; of unbounded rock its openings. The loop around a splinter that reaches
    to the surface is part of the outline."""
    return joined_loops(blocks.loops(block) if problem.endless is None else blocks.loops(block)[1:])


def _rows_of(number: np.ndarray, wanted: np.ndarray) -> list[np.ndarray]:
    """Rows of each of the ``wanted`` numbers, in order, by one sort."""
    order = np.argsort(number, kind="stable")
    first, last = (np.searchsorted(number[order], wanted, side) for side in ("left", "right"))
    return [order[a:b] for a, b in zip(first.tolist(), last.tolist())]


def may_have_bases(problem: Problem, blocks: Blocks) -> np.ndarray:
    """(n_blocks,) bool: whether the pressure of a block on its bases is computed. In motion the cracks of blocks of higher order are
    loaded by the stress of their blocks."""
    own = np.full(blocks.n_blocks, problem.run.boundary_stress in ("auto", "bases"))
    if blocks.order is None or problem.dda.dynamic_factor == 0.0:
        return own
    # (Blocks whose order is found as the run goes are of first order at first.)
    return own & np.isin(blocks.order, (1, AUTO_ORDER))


def keep_straight(problem: Problem, blocks: Blocks) -> np.ndarray:
    """(n_blocks,) bool: fixed, guided and rigid blocks, whose sides stay straight."""
    rigid = np.array([material.rigid for material in problem.materials], bool)
    straight = blocks.fixed | rigid[blocks.material]
    return straight if blocks.constrained is None else straight | blocks.constrained.any(axis=1)


def wide_on_base(blocks: Blocks, block: int, straight: np.ndarray) -> float:
    """Factor by which elements are shorter on the sides of a ``block`` which lies, with a side that is longer than the block is
    deep, on one of the blocks that keep ``straight`` (n_blocks,): √area over the depth, area / length.

    Pressure there varies over a length of the depth, and the area of contact ends within the side: elements in proportion to √area leave
    K of a slot in a slab three and five times as wide as deep off by 2e-3, in proportion to the depth by 8e-4. Between two platens
    elements stay as they are."""
    edges = np.flatnonzero(straight[blocks.vertex_block] & (blocks.vertex_block != block))
    starts, ends = blocks.vertices[edges], blocks.vertices[blocks.next_vertex[edges]]
    longest, ways = 0.0, []
    for start in np.flatnonzero(blocks.vertex_block == block).tolist() if len(edges) else ():
        side = blocks.sides.get(start, [start])
        a, b = blocks.vertices[side[0]], blocks.vertices[side[-1]]
        length = float(np.hypot(*(b - a)))
        if length == 0.0:
            continue  # not the first edge of its side
        along, across = (b - a) / length, np.array([a[1] - b[1], b[0] - a[0]]) / length
        near = np.maximum(*(np.abs((p - a) @ across) for p in (starts, ends))) < ON_BASE * length
        from_, to = ((p[near] - a) @ along for p in (starts, ends))
        if (
            np.minimum(np.maximum(from_, to), length) - np.maximum(np.minimum(from_, to), 0.0) > ON_BASE * length
        ).any():
            longest = max(longest, length)
            ways.append(along)
    if any(way @ other < boundary_tractions.PARALLEL - 1.0 for way in ways for other in ways):
        return 1.0
    return max(1.0, longest / math.sqrt(blocks.area_moments(block)[0]))


def boundary_loads(
    problem: Problem, blocks: Blocks, state: State, motion: Motion, result, bodies: dict
) -> dict[int, BoundaryLoad]:
    """Loads (block →) of all ``bodies`` from the step ``result`` that began at ``state``. ``motion`` leads to the
    vertices of the result, where its forces are in equilibrium."""
    forces, numbers = result.forces, np.array(list(bodies), int)
    straight = keep_straight(problem, blocks)
    density = np.array([material.density for material in problem.materials])
    contacts, edges = contacts_of_loaded_pairs(result.contacts, blocks.n_blocks), forces.edges
    route, bent = problem.run.boundary_stress, np.zeros(blocks.n_blocks, bool)
    order = blocks.order if result.state.order is None else result.state.order
    if order is not None and route in ("auto", "contacts", "bases"):
        bent[numbers] = np.asarray(order)[numbers] > 1
    # In motion the cracks of blocks that bend are loaded by the stress of their blocks: pressure on bases is not asked for.
    still = problem.dda.dynamic_factor == 0.0
    bent_route = "bases" if still else "contacts"
    if still and bent.any():
        contacts, along = without_faces(blocks, result.vertices, contacts, result.state.face_points, bent, straight)
        edges = np.concatenate([edges, along])
    if forces.bonds is not None:
        cracked = np.isin(np.arange(blocks.n_blocks), numbers)
        edges = np.concatenate([edges, between_cells(blocks, result.vertices, forces.bonds, cracked)])
    acting = BoundaryForces(
        result.vertices,
        motion,
        contacts,
        edges,
        forces.points,
        route,
        [joint.tensile_strength for joint in problem.joints],
        straight,
        [joint.normal_stiffness for joint in problem.joints],
    )
    inertia = BlockInertia(
        rotation=state.rotation[numbers] + result.turn[numbers],
        density=density[blocks.material[numbers]],
        spin=problem.dda.dynamic_factor * state.velocity[numbers, 2],
        gravity=forces.inertia.gravity,
        acceleration=result.acceleration[numbers],
        reaction=None if forces.reaction is None else forces.reaction[numbers],
        overstress=None if forces.overstress is None else forces.overstress[numbers],
    )
    if not bent.any():
        return dict(zip(bodies, boundary_tractions.boundary_loads(numbers, blocks, acting, inertia)))
    loads: dict[int, BoundaryLoad] = {}
    for rows, way in ((np.flatnonzero(~bent[numbers]), route), (np.flatnonzero(bent[numbers]), bent_route)):
        if not len(rows):
            continue
        own = inertia.only(rows)
        found = boundary_tractions.boundary_loads(numbers[rows], blocks, replace(acting, route=way), own)
        loads |= dict(zip(numbers[rows].tolist(), found))
    return {block: loads[block] for block in bodies}


def contacts_of_loaded_pairs(contacts: np.ndarray, n_blocks: int) -> np.ndarray:
    """CONTACT rows of all pairs of blocks with a loaded contact, the open ones included: they show where a face
    ends."""
    pair = np.minimum(contacts["block"], contacts["other"]) * n_blocks + np.maximum(
        contacts["block"], contacts["other"]
    )
    acts = (contacts["normal_force"] != 0) | (contacts["shear_force"] != 0)
    return contacts[np.isin(pair, pair[acts])]


def solve_bodies(
    bodies: dict,
    loads: dict[int, BoundaryLoad],
    warm: dict,
    history: dict,
    names: Sequence[str],
    solved_from: dict | None = None,
    skip: bool = True,
    forgets: bool = False,
) -> dict:
    """Solutions (block →) of ``bodies`` under ``loads``, in parallel.

    ``warm``: earlier solutions, whose face states are the first guess; ``history``: slip and damage of frictional faces
    at the start of the load step; ``solved_from``: the history with which ``warm`` were solved. With ``skip``, an
    earlier solution of the same geometry, load and history is returned as it is. ``forgets``: bodies give up what they
    keep for similar loads. Raises what `ddm.Body.solve` raises, with the name of the block (of ``names``) in front."""
    from ... import ddm

    solved_from = {} if solved_from is None else solved_from

    def solved(b: int):
        body, known, load = bodies[b], warm.get(b), loads[b]
        asked = {name: getattr(load, name) for name in _ASKED}
        same = skip and known is not None and _same_question(body, known, asked)
        if same and history.get(b) is solved_from.get(b):
            body.work.solutions_kept += 1
            return known
        try:
            if load.bases:
                from ...ddm.loads.rigid_bases import Base, on_bases

                bases = [Base(*base) for base in load.bases]
                return on_bases(body, ddm.BodyLoad(**asked), bases, known, history.get(b))
            found = body.solve(ddm.BodyLoad(**asked), warm=known, history=history.get(b))
            if forgets:
                body.forget_states()
            return found
        except (ValueError, ddm.NotConverged) as failure:
            # (Subclasses, as `ddm.OutOfEquilibrium`, carry more than a message.)
            if type(failure) not in (ValueError, ddm.NotConverged):
                raise
            named = type(failure)(f"{names[b]}: {failure}")
            if isinstance(named, ddm.NotConverged):
                named.block = b
            raise named from failure
        except ddm.TargetMissed as failure:
            raise ddm.TargetMissed(failure.solution, failure.target, f"{names[b]}: ") from failure

    solutions = dict(zip(bodies, parallel_map(solved, list(bodies), threads_for(bodies))))
    if len(bodies) >= MANY and any(body.lean for body in bodies.values()):
        # (Of few, it is less than what the next solutions ask for: taking it from the system again takes 2 s per GB.)
        return_free_memory()
    if any(body.requested.target_error is not None for body in bodies.values()):
        # Solutions that meet the target error may belong to refined bodies.
        bodies.update((b, solution.body) for b, solution in solutions.items())
    return solutions


#: Unknowns from which a body is solved on a thread of its own. A smaller one takes about a millisecond, most of it in
#: the interpreter, where threads wait for each other (400 unknowns: a quarter slower on two cores).
LARGE = 1000


def threads_for(bodies: dict[int, Body]) -> int | None:
    """Number of threads for solving ``bodies``; None: all."""
    large = sum(body.boundary.n_unknowns + body.faces.n_unknowns >= LARGE for body in bodies.values())
    return None if large > 1 else 1


#: The fields of a `BoundaryLoad` that define the load.
_ASKED = tuple(
    each.name for each in fields(BoundaryLoad) if each.name not in ("imbalance", "bases", "single", "of_single")
)


def _same_question(body: Body, known, asked: dict[str, np.ndarray | None]) -> bool:
    """Whether ``known`` is the solution of ``body`` under the load ``asked``."""
    return known.body is body and all(
        (of is None) == (before is None) and (of is None or np.array_equal(of, before))
        for of, before in ((asked[name], getattr(known.load, name)) for name in _ASKED)
    )


def inherited(history: dict, parent: np.ndarray, cracks: Cracks) -> dict:
    """child → memory of the faces of its ``cracks`` (`ddm.FaceMemory`), from ``history`` of the ``parent``
    (n_children,). Children keep the reference coordinates of their parent, and so its memory. The friction work so far
    is assigned to one of the children, so that sums over blocks count it once."""
    found, assigned = {}, set()
    for child in np.unique(cracks.block).tolist():
        block = int(parent[child])
        if block in history:
            found[child] = (
                replace(history[block], work=0.0, released=Released()) if block in assigned else history[block]
            )
            assigned.add(block)
    return found


def tip_rows(problem: Problem, blocks: Blocks, solutions: dict, nodes_of: dict[int, np.ndarray]) -> np.ndarray:
    """TIP rows of all solved bodies with kink angle and K_eq; nodes numbered in the whole network."""
    if problem.growth.trial_kink <= 0 or not solutions:
        return tips_with_criterion(problem, blocks, {b: of.tips for b, of in solutions.items()}, nodes_of)
    from ...ddm.fracture.f_criterion import apply_criterion

    tips = _joined_tips({b: of.tips for b, of in solutions.items()}, nodes_of)
    angle, k_eq = zip(
        *(apply_criterion(of, problem.growth, problem.materials[blocks.material[b]]) for b, of in solutions.items())
    )
    tips["angle"], tips["k_eq"] = np.concatenate(angle), np.concatenate(k_eq)
    return tips


def tips_with_criterion(
    problem: Problem, blocks: Blocks, tips_of: dict[int, np.ndarray], nodes_of: dict[int, np.ndarray]
) -> np.ndarray:
    """``tips_of`` bodies (block → TIP rows with K_I and K_II) as one table, with kink angle and K_eq by these; nodes
    numbered in the whole network."""
    if not tips_of:
        return np.empty(0, TIP)
    from ...ddm.fracture.f_criterion import apply_criterion_to_rows

    tips = _joined_tips(tips_of, nodes_of)
    rock = blocks.material[tips["block"]]
    for m in np.unique(rock).tolist():
        own = rock == m
        tips["angle"][own], tips["k_eq"][own] = apply_criterion_to_rows(tips[own], problem.growth, problem.materials[m])
    return tips


def _joined_tips(tips_of: dict[int, np.ndarray], nodes_of: dict[int, np.ndarray]) -> np.ndarray:
    rows = []
    for b, own in tips_of.items():
        tips = own.copy()
        tips["node"] = nodes_of[b][tips["node"]]
        rows.append(tips)
    return rows[0] if len(rows) == 1 else np.concatenate(rows)
