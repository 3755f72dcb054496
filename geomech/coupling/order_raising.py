"""Automatic order of blocks with cracks: when it is raised, and with what the block goes on.

After a pass the work that higher orders would take up is estimated with the cracks
(`geomech.dda.higher_order.order_choice`): their jumps [u] give it the deflection of `block_stress_field` with that order,
and S softens it. If a block is raised, the pass is repeated from the start of the step.

In motion a block whose cracks are about to grow has at least order `GROWS`: below, the forces on a block load its tips,
but do no work on bending, from which the energy of growth would have to come.

- Displacement, velocity and stress are kept, since the polynomials of order p are the first of those of a higher order.
- In motion the present opening of the cracks deflects the block from its shape at that time (`with_stress`): elastic and
  kinetic energy are those of before, and no force appears. In statics there is no history to keep: the block is
  deflected by all of the opening, as if it had had the order from the beginning.
- S and the strain of the cracks are those of the new order, under the stress of the block.
"""

from __future__ import annotations

import numpy as np

from ..dda import CrackResponse
from ..dda.higher_order.deflected_blocks import DeflectedBlocks
from ..dda.higher_order.order_choice import CracksInBlock
from ..model import State
from .coupled_state import CrackedBlocks
from .crack_compliance.added_compliance import passive, stress_rotation
from .crack_compliance.block_stress_field import BlockStressField
from .splitting.part_deflection import with_stress
from .splitting.part_initial_stress import crack_response_under

#: Order of a moving block from which its cracks may grow.
GROWS = 3


def raises_orders(now: CrackedBlocks, begun: CrackResponse, growing: np.ndarray) -> bool:
    """Whether the last pass must be repeated because it needs higher orders, which ``now`` then has. ``begun``: the crack
    response at the start of the step; ``growing``: blocks with tips that have reached their toughness."""
    choice, present = now.system.order_choice, now.system.order_of(now.state)
    order = now.system.orders_after(lambda trial: cracks_above(now, trial), _new(now, present))
    order = present if order is None else order
    if choice is not None and len(growing) and not now.system.scheme.static:
        bends = np.zeros(len(order), bool)
        bends[growing] = choice.found[growing]
        order = np.where(bends, np.maximum(order, GROWS), order)
    if (order == present).all():
        return False
    take_orders(now, order, begun)
    return True


def _new(now: CrackedBlocks, order: np.ndarray) -> bool:
    """Whether cracks have grown, or the ``order`` (n_blocks,) of blocks has been raised, since the last estimate."""
    before, now.estimated = now.estimated, (now.cracks.nodes, order)
    return before is None or not all(np.array_equal(a, b) for a, b in zip(before, now.estimated))


def take_orders(now: CrackedBlocks, order: np.ndarray, begun: CrackResponse, state: State | None = None) -> None:
    """Continue with blocks of these ``order`` (n_blocks,), raised from those of ``now``, whose cracks respond as
    ``begun``; in the present state, or a ``state`` with the new orders, in which cracks have not been considered yet."""
    moving, fields = state is None and not now.system.scheme.static, dict(now.by_mean_stress.fields)
    raised = now.take_orders(order, begun, state)
    for block in sorted(raised & set(now.bodies)):
        stress = now.stress_of(now.state, np.array([block]))[0, : now.by_mean_stress.fields[block].width]
        if moving:
            _keep_shape(now, block, stress)
        crack_response_under(now, block, stress)
        now.crack_energy.raised(block, fields.get(block), now.by_mean_stress.fields[block])


def _keep_shape(now: CrackedBlocks, block: int, stress: np.ndarray) -> None:
    """Let the opening of the cracks of a moving ``block`` at the start of the step, before they grew in it, deflect the
    block from its present shape, with its ``stress`` (3 + m,), Pa."""
    field, began = now.by_mean_stress.fields[block], now.crack_energy.at_start(block)
    opened = np.zeros(field.width)
    if began is not None:
        opened = field.crack_strain(began.body, began.jumps)
    opened[:3] = now.state.crack_strain[block]
    now.state = with_stress(now.state, field.blocks, block, field.rock, stress, opened)


def cracks_above(now: CrackedBlocks, trial: DeflectedBlocks) -> dict[int, CracksInBlock]:
    """block → its cracks in the last pass, for the blocks of higher order among the ``trial`` blocks."""
    return {
        block: _in_block(now, block, solution, trial)
        for block, solution in now.strain_solutions().items()
        if trial.order[block] > 1 and solution.jumps.size
    }


def _in_block(now: CrackedBlocks, block: int, solution, trial: DeflectedBlocks) -> CracksInBlock:
    field, body = now.fields_above.get(block), now.bodies[block]
    if field is None or field.blocks is not trial:
        field = now.fields_above[block] = BlockStressField.of(trial, block, now.system.compliance[block])
    above = field
    opened = above.size * above.crack_strain(body, solution.jumps)[3:]

    def tangent() -> np.ndarray:
        states = solution.closed.tobytes() if solution.memory is None else solution.face_states.key
        known = now.softness_above.get(block)
        if known is None or known[0] is not body.crack_system or known[1] != states or known[2] is not above:
            softness = passive(above.compliance_of(body, solution), above.rock)
            known = now.softness_above[block] = body.crack_system, states, above, softness
        back = stress_rotation(-float(now.state.rotation[block]), above.width)
        return np.linalg.inv(above.rock + back.T @ known[3] @ back)

    return CracksInBlock(opened, float(solution.crack_energy), _softer(now, block), tangent)


def _softer(now: CrackedBlocks, block: int) -> float:
    """Largest compliance of the cracks of ``block`` in the last pass under uniform stress, over that of the rock."""
    known = now.compliances.get(block)
    if known is None:
        return 0.0
    rock = np.linalg.inv(np.linalg.cholesky(now.system.compliance[block]))
    return max(0.0, float(np.linalg.eigvalsh(rock @ known[2][:3, :3] @ rock.T)[-1]))
