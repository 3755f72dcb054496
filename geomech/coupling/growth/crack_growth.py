"""Growth at one load: which tips grow, where cracks start, what they meet, and which blocks they cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ... import dda
from ...dda.higher_order.deflected_blocks import DeflectedBlocks
from ...model import Event, State
from ..coupled_state import CrackedBlocks
from ..cycle_record import event
from ..load_pass import Balance, toughness
from ..load_transfer.elastic_bodies import tip_rows
from ..load_transfer.unbounded_rock import loads_of, take_endless
from ..splitting.block_splitting import divided, on_edges, split_blocks
from ..splitting.contact_initialisation import contacts_after, holds_together
from ..splitting.part_deflection import PartStress, inherited_deflection
from ..splitting.part_initial_stress import initialise_moving_parts, initialise_parts_at_rest
from ..splitting.part_mean_stress import rotated_mean_stress


def growth_of_tips(
    now: CrackedBlocks,
    tips: np.ndarray,
    enough: float = 1.0,
    together: float = 1.0,
    longest: np.ndarray | float = np.inf,
):
    """Grow all ``tips`` with K_eq of at least ``enough`` times their toughness, and with them those that reach
    ``together`` times theirs. Returns the new network (`ddm.growth.tip_advance.Growth`), or None if no tip grows.
    ``longest`` (n_tips,) m: largest increment of each tip, 0 for none. Sets the growth angles."""
    k_ic = toughness(now, tips)
    from ...ddm.growth.path_correction import corrected
    from ...ddm.growth.tie_tolerance import reached
    from ...ddm.growth.tip_advance import advance

    if not np.any(reached(tips["k_eq"], enough * k_ic) & (np.asarray(longest) > 0)):
        return None
    k_ic = together * k_ic

    trial = now.bodies

    def grow():
        with now.timed("growth"):
            return advance(now.cracks, now.limits, tips, now.problem.growth, k_ic, now.number, longest)

    def look_ahead(cracks):
        nonlocal trial
        trial, nodes_of = now.bodies_of(cracks, trial)
        loads = now.loads if now.problem.endless is None else loads_of(now, cracks, trial)
        # Bodies that were left out of the pass and have not grown have no new ends.
        concerned = {b: of for b, of in trial.items() if b in now.solutions or of is not now.bodies.get(b)}
        ahead = now.solve(concerned, loads, now.solutions)
        return tip_rows(now.problem, now.blocks, ahead, nodes_of)

    growth = corrected(tips, grow, look_ahead, now.number, now.problem.growth.correct, now.chords)
    if growth is not None:
        now.bodies = trial  # the corrected step reuses most of their matrices
        _stay_in_cells(now, growth)
    return growth


def _stay_in_cells(now: CrackedBlocks, growth) -> None:
    """Raise `dda.NotConverged` where a crack has reached the face to another cell of its rock, which would close it."""
    edges = now.bonds.ravel()
    for join in growth.joins if len(edges) else ():
        found = on_edges(np.array(join.point), now.blocks, edges)
        if join.other_crack < 0 and len(found):
            cell = now.blocks.names[int(now.blocks.vertex_block[found[0]])]
            x, y = join.point
            raise dda.NotConverged(
                f"t = {now.state.time:g} s: {now.cracks.names[join.crack]} has grown through its cell and would leave it at "
                f"({x:.6g}, {y:.6g}), next to {cell!r}; cracks cannot cross faces between cells: give its zone a larger "
                "`crack_margin_m`, as wide as the crack may grow"
            )


def drive(now: CrackedBlocks, found: Balance) -> float:
    """Largest K_eq/K_Ic of all tips, or largest stress over strength where cracks may start: growth begins at 1."""
    most = float(np.max(found.tips["k_eq"] / toughness(now, found.tips), initial=0.0))
    if now.problem.growth.initiation:
        from .crack_initiation import first_new_cracks

        with now.timed("growth"):
            born, _ = first_new_cracks(now.blocks, now.problem.materials, found.solutions, now.problem.growth)
        most = max([most, *(birth.overstress for birth in born[:1])])
    return most


def births(now: CrackedBlocks, solutions: dict, state: State, enough: float = 1.0):
    """New cracks and their events, where no tip grows and intact rock reaches ``enough`` times its strength."""
    from .crack_initiation import initiate_in_blocks

    with now.timed("growth"):
        growth, born = initiate_in_blocks(
            now.cracks, now.blocks, now.limits, now.problem.materials, solutions, now.problem.growth, now.number, enough
        )
    names = growth.cracks.names[now.cracks.n_cracks :] if growth is not None else ()
    return growth, tuple(
        event(now, "birth", state, birth.start, f"{name} starts in {birth.kind} ({birth.place})")
        for name, birth in zip(names, born)
    )


def initiations(now: CrackedBlocks, tips: np.ndarray, state: State) -> tuple[Event, ...]:
    """An event for every tip that grows for the first time; wing cracks inherit the crack, and the end by position."""
    events = []
    first = {int(s): k for k, s in reversed(list(enumerate(now.cracks.segments.ravel())))}
    for tip in tips[tips["grown"] > 0]:
        segment = first[int(tip["node"])] // 2
        if now.cracks.birth_cycle[segment] == 0:
            events.append(
                event(now, "initiation", state, tip["point"], f"{now.cracks.names[tip['crack']]} starts to grow")
            )
    return tuple(events)


def blocks_to_split(now: CrackedBlocks, growth, state: State) -> list[int]:
    """The blocks that ``growth`` (None: no growth) cuts in two and whose parts can start from ``state``, the end of the
    pass."""
    if growth is None or not growth.joins:
        return []
    with now.timed("growth"):
        cut = divided(now.blocks, growth.cracks)
    together = len(cut) and (now.problem.dda.dynamic_factor != 0.0 or holds_together(state, cut))
    return cut.tolist() if together else []


def take_growth(now: CrackedBlocks, growth, state: State, solutions: dict) -> tuple[Event, ...]:
    """Make ``growth`` the present geometry and split the blocks it cuts. Returns its events, at ``state``, the end of
    the pass with these ``solutions``. Blocks that are in that state inherit the forces on their crack faces."""
    names = now.cracks.names
    events = []
    for join in growth.joins:
        other = f" {names[join.other_crack]}" if join.other_crack >= 0 else " the surface"
        events.append(event(now, join.kind, state, join.point, f"{names[join.crack]} meets{other}"))
    split = None
    if now.problem.endless is not None:
        return tuple(events) + take_endless(now, growth.cracks, state)
    if growth.joins:
        with now.timed("growth"):
            split = split_blocks(now.blocks, now.state, growth.cracks, _mean_stress(now.state, solutions))
    if split is None:
        now.take_cracks(growth.cracks)
        return tuple(events)
    cut = now.blocks if now.state.order is None else replace(now.blocks, order=np.asarray(now.state.order))
    for b in np.flatnonzero(np.bincount(split.parent, minlength=now.blocks.n_blocks) > 1).tolist():
        n_parts = int((split.parent == b).sum())
        centre = now.blocks.loops(b)[0].mean(axis=0)
        events.append(event(now, "split", state, centre, f"{now.blocks.names[b]} is cut into {n_parts} blocks"))
    loads, stands, begun = now.loads, now.state is state, now.state
    stored = {block: of.crack_energy for block, of in now.strain_solutions().items()}
    deflected, stresses = now.system.deflected, dict[int, PartStress]()
    now.take_split(split)
    if deflected is not None:
        system = now.system
        system.follow(now.state)
        # (None where all parts are of first order.)
        parts = system.deflected or DeflectedBlocks(
            now.blocks, system.fixed, system.stiffness, np.ones(now.blocks.n_blocks)
        )
        now.state, stresses = inherited_deflection(split, begun, deflected, parts, solutions, system.compliance)
        split = replace(split, state=now.state)
    if now.problem.dda.dynamic_factor != 0.0:
        initialise_moving_parts(now, split, cut, begun, stored, stresses)
    else:
        initialise_parts_at_rest(now, stresses)
    split = replace(split, state=now.state)
    with now.timed("growth"):
        now.state = contacts_after(
            now.system, split, cut, solutions if stands else {}, loads, now.problem.loads, begun.contacts
        )
    return tuple(events)


def _mean_stress(state: State, solutions: dict):
    """block → (polygon → mean stress in it, current axes), from the last solutions."""

    def of_block(block: int):
        solution = solutions[block]
        return lambda loops: rotated_mean_stress(solution, loops, float(state.rotation[block]))

    return {b: of_block(b) for b in solutions}
