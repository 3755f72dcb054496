"""Blocks under in-situ stress and at rest: stress and contact forces that fit one another before anything moves.

A first-order block carries the mean of a linear stress field, its value at the centroid, and the contact forces that go
with it are found by statics: from blocks that have the stress and contacts that have no force yet the blocks relax,
closing their contacts by what the penalty lets in and losing as much of their stress; given it back, they relax again,
by that part of that part, and so on. The positions that are reached become the reference: displacements count from
there.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from ...model import Blocks, InSituStress, Loads, State
from ..system import BlockSystem
from .pseudo_time_equilibrium import Equilibrium, equilibrium

log = logging.getLogger(__name__)

#: The stress is given back at most so often. What is missing after each falls by the share that contacts have of the
#: compliance, a fortieth and less with penalty springs.
_PASSES = 12


class NoInSituEquilibrium(RuntimeError):
    """The blocks do not come to rest under their stress and loads: the message says which move, ``found`` where the
    search ended."""

    def __init__(self, message: str, found: Equilibrium | None = None) -> None:
        super().__init__(message)
        self.found = found


@dataclass(frozen=True, eq=False)
class InSituState:
    """Blocks at rest under in-situ stress.

    blocks      with the positions at rest as their reference
    state       at time 0, without velocity and displacement, with stress and contact forces
    settled     m, the largest displacement from the blocks as drawn
    deviation   largest difference of a free block's stress from the in-situ one, over the largest in-situ stress: what
                the supports and weights do not let the blocks keep
    """

    blocks: Blocks
    state: State
    settled: float
    deviation: float


def in_situ_state(
    system: BlockSystem, stress: InSituStress, loads: Loads, *, tolerance: float = 1e-9, stress_tolerance: float = 1e-8
) -> InSituState:
    """The blocks of ``system`` at rest under ``stress`` and the ``loads`` of time 0 (gravity, tractions, water …).

    ``tolerance`` of the unbalanced force as in `equilibrium`; the stress is given back until that changes it by less
    than ``stress_tolerance`` of itself. Where weight and supports ask for another stress than ``stress``, that one is
    what the blocks end with, and ``deviation`` says by how much; the part that nothing contradicts (as the horizontal
    one between walls) stays. Raises `NoInSituEquilibrium` when the blocks do not come to rest, and ValueError for blocks
    of higher order.
    """
    blocks = system.blocks
    if system.deflected is not None or system.order_choice is not None:
        raise ValueError("in-situ stress is not supported in blocks of an order above 1 yet")
    centres = np.array([blocks.area_moments(b)[1] for b in range(blocks.n_blocks)])
    given = stress.at(centres)
    given[blocks.fixed] = 0.0
    size = float(np.abs(given).max(initial=0.0))
    state, before = State.at_rest(blocks), None
    for _ in range(_PASSES):
        found: Equilibrium = equilibrium(system, replace(state, stress=given.copy()), loads, tolerance=tolerance)
        if not found.converged:
            raise NoInSituEquilibrium(f"the blocks do not come to rest under the in-situ stress: {found.reason}", found)
        state = found.state
        if before is None or np.abs(state.stress - before).max() > stress_tolerance * max(size, 1e-300):
            before = state.stress
        else:
            break
    moved = float(np.hypot(*(state.vertices - blocks.vertices).T).max())
    off = float(np.abs(state.stress - given)[~blocks.fixed].max(initial=0.0)) / size if size else 0.0
    log.info("in-situ stress: blocks as drawn settle by %.3g m, stress is off by %.2g of the largest", moved, off)
    rest = replace(state, time=0.0, rotation=np.zeros(blocks.n_blocks), imposed=np.empty(0))
    return InSituState(blocks.with_vertices(state.vertices), rest, moved, off)
