"""One pass at one load: the blocks move, their forces load the cracked ones, and the strain that cracks bring is the one
that the blocks assumed."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace

import numpy as np

from .. import dda
from ..dda import StepResult
from ..model import TIP, State
from .bodies import boundary_loads, threads_for, tip_rows
from .compliance import crack_response, passive
from .cracked_blocks import CrackedBlocks
from .settling import Settling
from .side_by_side import side_by_side

log = logging.getLogger(__name__)

#: A pass is repeated while the crack strain it assumed and the one it found differ by more than this part of the
#: block's strain.
COMPLIANCE_TOLERANCE = 1e-6

#: … in dynamics this one: what is left is corrected by the next of many steps, and far below what a toughness is known to.
DYNAMIC_TOLERANCE = 1e-4

#: Strains below this part of the largest one in a cracked block are not asked to agree better than that one's: a block in
#: free flight has hardly any.
STILL = 1e-3

#: Passes at one geometry; they agree after two to eight, or some more where faces of a block that is nearly cut through open and
#: close. A lag that is left is corrected by the next step.
COMPLIANCE_PASSES = 20

#: Larger lags than this are told of.
NO_ANSWER = 0.1


@dataclass(frozen=True, eq=False)
class Balance:
    """The step of the blocks, the solutions of the cracked ones (block → `ddm.Solution`), their TIP rows with the criterion's
    angle and K_eq, and how well the two solvers agree."""

    result: StepResult
    solutions: dict
    tips: np.ndarray
    statistics: dict[str, float] = field(default_factory=dict)


def balanced(now: CrackedBlocks, dt: float, load_time: float | None) -> Balance:
    """DDA step, boundary loads, DDM solves, until the crack strain that DDA assumed is the one DDM finds.

    ``load_time``: when the loads are those of that time, whatever step the blocks take; it then is the new time. Of ``now``
    the response, loads, solutions and statistics are renewed, nothing else. Raises `dda.NotConverged`.
    """
    settling = Settling()
    static = now.problem.dda.dynamic_factor == 0.0
    tolerance = COMPLIANCE_TOLERANCE if static else DYNAMIC_TOLERANCE
    result, iterations = None, 0
    for attempt in range(COMPLIANCE_PASSES):
        with now.timed("dda"):
            result = now.system.step(now.state, now.problem.loads, dt, now.response, load_time, result)
            # Passes that took steps of unlike lengths, and so in statics bore unlike loads, would never agree.
            dt = min(dt, result.dt)
            if load_time is not None and result.state.time != load_time:
                result = replace(result, state=replace(result.state, time=load_time))
        iterations += result.statistics["open_close_iterations"]
        now.acted = result.statistics
        if not now.bodies:
            return Balance(result, {}, np.empty(0, TIP))
        _solve_bodies(now, result)
        differences = _take_response(now, result.state, settling, tolerance)
        mismatch = float(differences.max())
        if mismatch < tolerance:
            break
    lost = np.array(list(now.solutions), int)[differences > NO_ANSWER]
    if len(lost):
        log.warning(
            "t = %g s: %s and the cracks in it find no common strain in %d passes (they differ by %.2g of it): it hangs by little",
            result.state.time, ", ".join(now.blocks.names[b] for b in lost[:3]), attempt + 1, mismatch,
        )  # fmt: skip
    imbalance = max(load.imbalance for load in now.loads.values())
    statistics = {
        "open_close_iterations": iterations,
        "compliance_passes": attempt + 1,
        "compliance_mismatch": mismatch,
        "traction_imbalance": imbalance,
    }
    tips = tip_rows(now.problem, now.blocks, now.solutions, now.nodes_of)
    return Balance(result, now.solutions, tips, statistics)


def _solve_bodies(now: CrackedBlocks, result: StepResult) -> None:
    """Every body under what the block solver's forces are on it."""
    with now.timed("tractions"):
        # Equilibrium holds on the geometry at the start of the step.
        now.loads = boundary_loads(now.problem, now.blocks, now.state, now.motion(now.state), result, now.bodies)
    now.solutions = now.solve(now.bodies, now.loads, now.solutions)
    now.solved_from = now.history


def _take_response(now: CrackedBlocks, state: State, settling: Settling, tolerance: float) -> np.ndarray:
    """Set what DDA should assume next, and say how far off the last assumption was in each cracked block (relative strain)."""
    solutions = now.solutions
    blocks = np.array(list(solutions), int)
    compliance, offset = now.response.compliance.copy(), now.response.offset.copy()
    with now.timed("compliance"):
        own = side_by_side(lambda of: _compliance(now, *of), list(solutions.items()), threads_for(now.bodies))
        now.compliances.update(zip(solutions, own))
        for b, solution in solutions.items():
            compliance[b], offset[b] = crack_response(
                now.compliances[b][2],
                solution.crack_strain,
                state.stress[b],
                float(state.rotation[b]),
            )
        stress = state.stress[blocks, :, None]
        found = offset[blocks] + (compliance[blocks] @ stress)[..., 0]
        residual = found - state.crack_strain[blocks]
        elastic = (now.system.compliance[blocks] @ stress)[..., 0]
        size = np.abs(elastic).max(axis=1) + np.abs(found).max(axis=1)
        size = np.maximum(size, STILL * size.max())
        if not size.any():
            differences = np.zeros(len(blocks))
        else:
            differences = np.abs(residual).max(axis=1) / size
            if differences.max() >= tolerance:
                offset[blocks] = settling.next(offset[blocks] - residual, residual, compliance[blocks], size)
    now.response = dda.CrackResponse(compliance, offset)
    return differences


def _compliance(now: CrackedBlocks, block: int, solution) -> tuple:
    """The geometry and the states of crack faces that S belongs to, and S in the block's own axes: it does not change
    with the load."""
    body = now.bodies[block]
    states = solution.closed.tobytes() if solution.memory is None else solution.face_states.key
    known = now.compliances.get(block)
    if now.problem.run.skip and known is not None and known[0] is body.crack_system and known[1] == states:
        body.work.compliances_kept += 1
        return known
    s = passive(body.compliance(solution))
    return body.crack_system, states, s
