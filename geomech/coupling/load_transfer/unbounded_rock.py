"""Passes of unbounded rock: no block loads it, so that a pass is one solution of the crack solver.

A block represents the rock as a window: it is fixed in DDA, and it is no boundary for the cracks. Load steps, events,
growth, checkpoints and monitoring are those of every other scene.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...model import Cracks, Event, State
from ...model.blocks.polygon import distance_to_edges, winding_number
from ..coupled_state import CrackedBlocks
from ..cycle_record import event
from ..load_pass import Balance, balanced
from ..splitting.block_splitting import divided
from ..splitting.planar_graph import ON_EDGE
from .boundary_tractions import BoundaryLoad
from .elastic_bodies import tip_rows


def solved_pass(now: CrackedBlocks, dt: float, load_time: float | None) -> Balance:
    """A pass at one load, of blocks (`balanced`) or of unbounded rock, whichever the problem has."""
    return (balanced if now.problem.endless is None else _endless_pass)(now, dt, load_time)


def _endless_pass(now: CrackedBlocks, dt: float, load_time: float | None) -> Balance:
    """A pass of at most ``dt`` s, or at the loads of ``load_time``. Updates loads and solutions of ``now``."""
    with now.timed("dda"):
        result = now.system.step(now.state, now.problem.loads, dt, now.response, load_time, None)
        if load_time is not None and result.state.time != load_time:
            result = replace(result, state=replace(result.state, time=load_time))
    now.acted = result.statistics
    now.load_time = result.state.time
    now.loads = loads_of(now, now.cracks, now.bodies)
    now.solutions = now.solve(now.bodies, now.loads, now.solutions)
    now.solved_from = now.history
    tips = tip_rows(now.problem, now.blocks, now.solutions, now.nodes_of)
    return Balance(result, now.solutions, tips, {})


def loads_of(now: CrackedBlocks, cracks: Cracks, bodies: dict) -> dict[int, BoundaryLoad]:
    """Loads (block →) at the time of the last pass, with these ``cracks``."""
    endless, time = now.problem.endless, now.load_time
    assert endless is not None
    load = BoundaryLoad(
        np.empty((0, 2, 2)), np.empty((0, 2, 2)), np.zeros(2), np.zeros((2, 2)), np.zeros(2), 0.0,
        remote_stress=endless.stress_at(time),
        crack_pressure=endless.crack_pressure_at(time, cracks, now.blocks.loops(0)[1:]),
        hole_pressure=endless.hole_pressure_at(time),
    )  # fmt: skip
    return dict.fromkeys(bodies, load)


def take_endless(now: CrackedBlocks, cracks: Cracks, state: State) -> tuple[Event, ...]:
    """Accept ``cracks``; an event for the piece they have cut out, if any."""
    if not len(divided(now.blocks, cracks)):
        now.take_cracks(cracks)
        return ()
    now.cracks, now.bodies = cracks, {}
    at = cracks.nodes[cracks.segments[cracks.birth_cycle == cracks.birth_cycle.max()]].mean(axis=(0, 1))
    return (event(now, "split", state, at, "cracks have cut off an unsupported piece"),)


def out_of_sight(now: CrackedBlocks, growth, state: State) -> tuple[Event, ...]:
    """An event if ``growth`` leaves the window, outside which nothing is drawn and intersections are not detected."""
    outline = now.blocks.loops(0)[0]
    for node in growth.cracks.nodes:
        if winding_number([outline], node) > 0.25:
            continue
        away = distance_to_edges(node, outline, np.roll(outline, -1, axis=0))
        if away > ON_EDGE * np.ptp(outline, axis=0).max():
            return (event(now, "out of sight", state, node, "a crack grows out of the rock in the drawing"),)
    return ()
