"""Equilibrium of blocks under in-situ stress: stress and contact forces that are consistent before the run starts.

A first-order block carries the mean of a linear stress field, its value at the centroid. The contact forces are found
by relaxation: blocks with the stress, and contacts without force, relax; the contacts close by the penalty penetration,
and the blocks lose the corresponding stress. The lost stress is added again and the blocks relax again, by a smaller
amount, and so on. The positions reached become the reference configuration, from which displacements count.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from ...model import Blocks, InSituStress, Loads, State
from ..system import BlockSystem
from .pseudo_time_equilibrium import Equilibrium, equilibrium

log = logging.getLogger(__name__)

#: Largest number of corrections of the stress. Each reduces the error by the ratio of contact to total compliance, a
#: fortieth or less with penalty springs.
_PASSES = 12


class NoInSituEquilibrium(RuntimeError):
    """The blocks do not come to rest under their stress and loads. The message names the blocks that move; ``found``:
    where the search ended."""

    def __init__(self, message: str, found: Equilibrium | None = None) -> None:
        super().__init__(message)
        self.found = found


@dataclass(frozen=True, eq=False)
class InSituState:
    """Blocks at rest under in-situ stress.

    blocks      with the positions at rest as their reference
    state       at time 0, without velocity and displacement, with stress and contact forces
    settled     m, the largest displacement from the blocks as drawn
    deviation   largest difference between a free block's stress and the in-situ stress, relative to the largest in-situ
                stress: the part that is inconsistent with supports and weights
    """

    blocks: Blocks
    state: State
    settled: float
    deviation: float


def in_situ_state(
    system: BlockSystem, stress: InSituStress, loads: Loads, *, tolerance: float = 1e-9, stress_tolerance: float = 1e-8
) -> InSituState:
    """The blocks of ``system`` at rest under ``stress`` and the ``loads`` of time 0 (gravity, tractions, water …).

    ``tolerance`` of the unbalanced force as in `equilibrium`; the stress is corrected until its relative change is
    below ``stress_tolerance``. If ``stress`` is inconsistent with weight and supports, the blocks end with a consistent
    stress, and ``deviation`` gives the difference; consistent components (such as horizontal stress between walls) are
    kept. Raises `NoInSituEquilibrium` when the blocks do not come to rest, and ValueError for blocks of higher order.
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
