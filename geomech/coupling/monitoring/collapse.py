"""Collapse of a static run: no equilibrium found, blocks that slide without bound, or a block out of reach."""

from __future__ import annotations

import logging

import numpy as np

from ... import dda
from ...model import Event, State
from ..coupled_state import CrackedBlocks
from ..cycle_record import event
from ..load_pass import at_rest
from .mechanism import Mechanism, loads_are_steady

log = logging.getLogger(__name__)


def relax(now: CrackedBlocks, load_time: float) -> tuple[Event, ...]:
    """Bring the blocks to equilibrium under the loads of ``load_time``; a collapse event if there is none."""
    begun = now.state
    found = at_rest(now, load_time)
    if load_time != begun.time:
        _account(now, begun, found, load_time)
    if not found.collapsed:
        if not found.converged:
            log.warning("t = %g s: %s; continuing from there", load_time, found.reason)
        elif load_time == begun.time:
            dda.warn_of_toes(now.system, begun, found.state, now.problem.loads, load_time, now.response)
        return ()
    return _fallen(now, found, "", load_time)


def _account(now: CrackedBlocks, begun: State, found: dda.Equilibrium, load_time: float) -> None:
    """Add the energies of the steps from the state ``begun`` to the equilibrium ``found``."""
    excavated = found.state.removed is not begun.removed
    budget = now.budget.at_rest(found.energies, load_time, excavated=excavated)
    if found.energies and now.bodies:
        end, now.state = now.state, begun
        set_free, now.state = now.set_free(budget, end), end
        now.crack_energy.worked_on(begun, sum(energy.crack_work for energy in found.energies), set_free)
    now.budget = budget


def collapse_in_situ(now: CrackedBlocks) -> tuple[Event, ...]:
    """A collapse event if the blocks are unsupported under the in-situ stress."""
    if now.collapsed is None:
        return ()
    return _fallen(now, now.collapsed, "under the in-situ stress there is ", now.state.time)


def _fallen(now: CrackedBlocks, found: dda.Equilibrium, where: str, time: float) -> tuple[Event, ...]:
    detail = where + found.reason
    log.warning("t = %g s: %s; the run ends", time, detail)
    first = int(now.blocks.vertex_start[found.moving[0]])
    return (event(now, "collapse", now.state, now.blocks.vertices[first], detail),)


def lost(now: CrackedBlocks, state: State) -> tuple[Event, ...]:
    """A collapse event if a block has moved farther than the extent of the blocks: in statics nothing will stop it, and
    steps would become ever shorter."""
    moved = np.hypot(*(state.vertices - now.blocks.vertices).T)
    farthest = int(np.argmax(moved))
    if not moved[farthest] > np.hypot(*np.ptp(now.blocks.vertices, axis=0)):
        return ()
    name = now.blocks.names[now.blocks.vertex_block[farthest]]
    detail = f"nothing holds {name}: it has moved {moved[farthest]:.3g} m"
    log.warning("t = %g s: %s; the run ends", state.time, detail)
    return (event(now, "collapse", state, now.blocks.vertices[farthest], detail),)


def unsupported(now: CrackedBlocks, result: dda.StepResult, mechanism: Mechanism) -> tuple[Event, ...]:
    """A mechanism event if blocks of a static run keep accelerating after the load step of ``result``."""
    time = result.state.time
    found = mechanism.check(result, now.blocks, loads_are_steady(now.problem.loads, time - result.dt, time))
    if found is None:
        return ()
    block, detail = found
    reported = event(now, "mechanism", result.state, now.blocks.vertices[int(now.blocks.vertex_start[block])], detail)
    if now.problem.run.stepping == "events":
        log.warning(
            "cycle %d, t = %g s: %s; the run ends, as there is no equilibrium beyond this load. To follow the motion, "
            'set dda.dynamic_factor = 1 and stepping "fixed"',
            now.number, result.state.time, detail,
        )  # fmt: skip
        return (reported,)
    load = f" and a load of {reported.load / 1e3:.4g} kPa" if reported.load else ""
    log.warning(
        "cycle %d, t = %g s%s: %s. Their further displacements have no meaning in a static run: follow the motion with "
        "dda.dynamic_factor = 1, find the factor of safety with `geomech safety`, or end the run here with "
        'run.stop_at = ["mechanism"]',
        now.number, result.state.time, load, detail,
    )  # fmt: skip
    return (reported,)
