"""One pass at one load: the blocks move, their forces load the cracked ones, and the strain that cracks bring is the
one that the blocks assumed."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field, replace

import numpy as np

from .. import dda
from ..dda import StepResult
from ..model import TIP, Motion, State
from .coupled_state import CrackedBlocks
from .crack_compliance.added_compliance import crack_responses, passive, stress_rotations, times
from .crack_compliance.load_extrapolation import Answer
from .crack_compliance.quasi_newton import Settling
from .load_path import loads_at
from .load_transfer.elastic_bodies import boundary_loads, threads_for, tip_rows
from .parallel_map import parallel_map

#: A pass is repeated while the crack strain it assumed and the one it found differ by more than this part of the
#: block's strain.
COMPLIANCE_TOLERANCE = 1e-6

#: … in dynamics this one: what is left is corrected by the next of many steps, and far below what a toughness is known
#: to.
DYNAMIC_TOLERANCE = 1e-4

#: Strains below this part of the largest one in a cracked block are not asked to agree better than that one's: a block
#: in free flight has hardly any.
STILL = 1e-3

#: Passes at one geometry; they agree after one or two, three where cracks have grown, some more where contacts and faces
#: open and close. A lag that is left is corrected by the next step.
COMPLIANCE_PASSES = 20

#: At rest there are up to so many while they come together, each two of them to less than half: what is left is as large
#: as rounding is blown up to on the way, and cracks that grow go by it.
COMING_TOGETHER = 40

#: At rest, after so many of them blocks whose forces and strain have chased each other in the last half of them take
#: their mean stress alone. (Which do in the very last one, rounding may decide.)
PATIENCE = 10

#: A strain that was assumed so well, relative, is not what has cut a step short.
CERTAIN = 1e-2

#: Larger lags than this are no state: a shorter step is tried, in which inertia leaves strain less to do, so many times
#: by half.
NO_ANSWER = 0.1
SHORTER = 4


@dataclass(frozen=True, eq=False)
class Balance:
    """The step of the blocks, the solutions of the cracked ones (block → `ddm.Solution`), their TIP rows with the
    criterion's angle and K_eq, and how well the two solvers agree. ``left_out``: bodies (block →) that cannot grow and
    have not been solved."""

    result: StepResult
    solutions: dict
    tips: np.ndarray
    statistics: dict[str, float] = field(default_factory=dict)
    left_out: dict = field(default_factory=dict)


def balanced(now: CrackedBlocks, dt: float, load_time: float | None) -> Balance:
    """DDA step, boundary loads, DDM solves, until the crack strain that DDA assumed is the one DDM finds.

    ``load_time``: when the loads are those of that time, whatever step the blocks take; it then is the new time. Of
    ``now`` the response, loads, solutions and statistics are renewed, nothing else. Raises `dda.NotConverged`, also
    where blocks and cracks agree at no step.
    """
    begun, static = now.response, now.system.scheme.static
    # At rest no block takes its mean stress for its softness (`by_mean_stress`), but where there is no answer without it.
    for soft_ones_hang in (False, True) if static else (True,) * (1 + SHORTER):
        now.response = begun
        found, differences = _passes(now, dt, load_time, soft_ones_hang)
        lost = np.flatnonzero(differences > NO_ANSWER)
        if not len(lost):
            return found
        dt = dt if static else 0.5 * found.result.dt
    blocks = [now.blocks.names[b] for b in np.array(list(now.bodies), int)[lost]]
    raise dda.NotConverged(
        f"t = {found.result.state.time:g} s: {', '.join(blocks[:3])} and the cracks in it find no common strain in "
        f"{COMPLIANCE_PASSES} passes (they differ by {differences.max():.2g} of it): try a shorter time step, or finer "
        "elements in [ddm]"
    )


@dataclass
class _Chase:
    """Blocks whose forces and strain chase each other in the passes of a step of which ``asked`` s were asked for: those
    that have (``blocks``) since it was last tried as long as that (``tried_whole``), and in the last passes (``lately``);
    ``doubt`` is by how much the strain that was assumed was off where a pass has cut the step short."""

    static: bool
    asked: float
    blocks: set[int] = field(default_factory=set)
    lately: set[int] = field(default_factory=set)
    tried_whole: bool = False
    doubt: float = 0.0

    def agreed(self, now: CrackedBlocks, dt: float) -> tuple[bool, set[int]]:
        """Whether a pass of ``dt`` s in which blocks and cracks agree is the last one; if not, which blocks are to take
        their mean stress alone, and the step is to be tried as long as it was asked for."""
        # In a step that has been cut short by a chase blocks agree as their inertia holds them: that is no rest.
        give_way = _softest(now, self.blocks) if self.static and dt != self.asked and self.tried_whole else set()
        if not self.static or dt == self.asked or ((self.tried_whole or self.doubt < CERTAIN) and not give_way):
            return True, set()
        # What cut a static step short may have been a strain that the first passes assumed.
        self.tried_whole, self.blocks = True, set()
        return False, give_way

    def goes_on(self, now: CrackedBlocks, attempt: int, differences: np.ndarray) -> set[int]:
        """Which blocks are to take their mean stress alone after the pass number ``attempt``, in which they differ from
        their cracks by ``differences`` (n_cracked,)."""
        chasing = set(np.array(list(now.bodies), int)[differences > NO_ANSWER].tolist())
        self.blocks |= chasing
        self.lately = self.lately | chasing if attempt >= PATIENCE // 2 else set()
        return _softest(now, self.lately) if attempt + 1 == PATIENCE else set()


def _passes(now: CrackedBlocks, dt: float, load_time: float | None, soft_ones_hang: bool) -> tuple[Balance, np.ndarray]:
    """Passes of a step of at most ``dt`` s, and by how much every cracked block still differs from its cracks (relative
    strain)."""
    static, settling = now.system.scheme.static, now.settling
    if static:
        settling.begin(tuple(now.bodies))
    else:
        settling.forget()  # what contacts did a step ago, in motion they need not do again
    tolerance = COMPLIANCE_TOLERANCE if static else DYNAMIC_TOLERANCE
    response = _expected(now, now.state.time + dt if load_time is None else load_time) if static else now.response
    result, iterations, chase = None, 0, _Chase(static, dt)
    left: list[float] = []
    for attempt in range(COMING_TOGETHER if static else COMPLIANCE_PASSES):
        result = _step(now, dt, load_time, response, result)
        # Passes that took steps of unlike lengths, and so in statics bore unlike loads, would never agree.
        cut, dt = result.dt < dt, min(dt, result.dt)
        iterations += result.statistics["open_close_iterations"]
        now.acted = result.statistics
        if not now.bodies:
            now.solutions, now.loads = {}, {}
            return Balance(result, {}, np.empty(0, TIP)), np.zeros(0)
        if not static:
            now.by_mean_stress.take_all(now.bodies)
        elif soft_ones_hang:
            now.by_mean_stress.find(now.bodies, now.system.compliance, result.contacts)
        # What answers to its mean stress needs no forces before there is an answer.
        solved = not all(block in now.by_mean_stress for block in now.bodies)
        if solved:
            _solve_bodies(now, result)
        response, differences, answer = _take_response(now, result.state, settling, tolerance)
        left.append(float(differences.max()))
        chase.doubt = max(chase.doubt, left[-1]) if cut else chase.doubt
        if left[-1] < tolerance:
            if static:
                _remember(now, answer)
            done, give_way = chase.agreed(now, dt)
            if done:
                break
            dt = chase.asked
        else:
            give_way = chase.goes_on(now, attempt, differences)
        if attempt + 1 >= COMPLIANCE_PASSES and not left[-1] < 0.5 * left[-3]:
            break
        for block in sorted(give_way):
            now.by_mean_stress.add(block)
        if give_way:
            # What has cut the step short may have been the chase.
            dt = chase.asked
            settling.forget()
    left_out = {} if solved else _solve_what_may_grow(now, result)
    statistics = {
        "open_close_iterations": iterations,
        "compliance_passes": attempt + 1,
        "compliance_mismatch": left[-1],
        "traction_imbalance": max(load.imbalance for load in now.loads.values()),
    }
    return _with_tips(now, result, statistics, left_out), differences


def _step(
    now: CrackedBlocks, dt: float, load_time: float | None, response: dda.CrackResponse, before: StepResult | None
) -> StepResult:
    """A step of the blocks, which assume this ``response`` of their cracks; ``before``: that of the pass before."""
    with now.timed("dda"):
        result = now.system.step(now.state, now.problem.loads, dt, response, load_time, before)
        if load_time is not None and result.state.time != load_time:
            result = replace(result, state=replace(result.state, time=load_time))
    return result


def _with_tips(now: CrackedBlocks, result: StepResult, statistics: dict[str, float], left_out: dict) -> Balance:
    """What the last pass has come to, with the tips of its cracks; bodies that were ``left_out`` are solved as well where
    something grows."""
    tips = _judged(now)
    if left_out and (tips["k_eq"] >= toughness(now, tips)).any():
        # Where something grows all of it is looked at: the step is taken again with what has grown.
        _solve(now, now.bodies)
        left_out, tips = {}, _judged(now)
    for body in left_out.values():
        body.work.solutions_left_out += 1
    if not now.system.scheme.static:
        now.growth_screening.solved(now, tips, toughness(now, tips))
    return Balance(result, now.solutions, tips, statistics, left_out)


def _softest(now: CrackedBlocks, chasing: set[int]) -> set[int]:
    """The soft one of the ``chasing`` blocks, without those that it drags along; where there are more, all soft blocks: they
    drag each other along, and after a few passes rounding decides which of them do."""

    def soft(block: int) -> bool:
        return now.by_mean_stress.soft(block, now.bodies[block], now.system.compliance[block])

    found = {block for block in chasing if soft(block)}
    return {block for block in now.bodies if soft(block)} if len(found) > 1 else found or chasing


def toughness(now: CrackedBlocks, tips: np.ndarray) -> np.ndarray:
    """(n_tips,) K_Ic of the rock that each tip stands in, Pa √m."""
    k_ic = np.array([material.k_ic for material in now.problem.materials])
    return k_ic[now.blocks.material[tips["block"]]]


def _judged(now: CrackedBlocks) -> np.ndarray:
    return tip_rows(now.problem, now.blocks, now.solutions, now.nodes_of)


def _systems(now: CrackedBlocks) -> tuple:
    return tuple(body.crack_system for body in now.bodies.values())


def _expected(now: CrackedBlocks, time: float) -> dda.CrackResponse:
    """What the first static pass at the loads of ``time`` should assume: what the answers at other loads foretell. What
    cracks that have grown answer to the last forces, by which the blocks were strained as before, is a pass already."""
    if not now.bodies:
        return now.response
    blocks = tuple(now.bodies)
    numbers = np.array(blocks)
    known, beyond, s = now.extrapolation.at(loads_at(now.problem.loads, time), blocks, _systems(now))
    last, grown = now.extrapolation.last(blocks), np.zeros_like(beyond)
    if last is not None:
        for b, solution in _answers_to_the_last_forces(now, numbers[~known].tolist()).items():
            k = blocks.index(b)
            known[k], s[k] = True, now.compliances[b][2]
            beyond[k] = last.strain[k] - s[k] @ last.stress[k]
            grown[k] = solution.crack_strain - last.strain[k]
    response = dda.CrackResponse(now.response.compliance.copy(), now.response.offset.copy())
    own, began = numbers[known], now.state.rotation[numbers]
    response.compliance[own], response.offset[own] = crack_responses(
        s[known], beyond[known], np.zeros_like(beyond[known]), began[known]
    )
    if grown.any():
        grown = times(stress_rotations(-began).transpose(0, 2, 1), grown)
        size = _strained(now.system.compliance[numbers], last.stress, last.strain + grown)
        if known.all():
            offset, s = response.offset[numbers], response.compliance[numbers]
            response.offset[numbers] = now.settling.next(offset, grown, s, size)
        else:
            response.offset[numbers] += grown
    return response


def _strained(elastic: np.ndarray, stress: np.ndarray, strain: np.ndarray) -> np.ndarray:
    """(n,) how much blocks of ``elastic`` compliance (n, 3, 3) are strained by ``stress`` (n, 3) and by the ``strain``
    (n, 3) of their cracks."""
    size = np.abs(times(elastic, stress)).max(axis=1) + np.abs(strain).max(axis=1)
    return np.maximum(size, STILL * size.max())


def _answers_to_the_last_forces(now: CrackedBlocks, grown: list[int]) -> dict:
    """Of the ``grown`` blocks those of which that can be told: block → solution under the forces of the last pass. Sets
    their compliances."""
    asked = {b: now.bodies[b] for b in grown if b in now.loads and b not in now.by_mean_stress}
    if not asked:
        return {}
    from .. import ddm

    try:
        told = now.solve(asked, now.loads, now.solutions)
    except ddm.NotConverged:
        # Faces may find a state under the forces of the next pass.
        return {}
    # Whoever watches has those of the last pass still in hand.
    now.solutions = now.solutions | told
    now.solved_from = now.solved_from | {b: now.history[b] for b in told if b in now.history}
    with now.timed("compliance"):
        now.compliances |= {b: _compliance(now, b, solution) for b, solution in told.items()}
    return told


def _remember(now: CrackedBlocks, answer: Answer) -> None:
    """Passes agree on ``answer``. Before the first one, where nothing acted, there was none, and the faces of cracks
    had their first states."""
    blocks, state = tuple(now.bodies), now.state
    before = loads_at(now.problem.loads, state.time)
    if now.extrapolation.last(blocks) is None and not (before.any() or state.stress.any() or state.crack_strain.any()):
        nothing = np.zeros_like(answer.strain)
        now.extrapolation.take(blocks, replace(answer, loads=before, strain=nothing, stress=nothing))
    now.extrapolation.take(blocks, answer)


def _solve_bodies(now: CrackedBlocks, result: StepResult) -> None:
    """Every body under what the block solver's forces are on it."""
    _take_loads(now, result)
    _solve(now, now.bodies)


def _solve_what_may_grow(now: CrackedBlocks, result: StepResult) -> dict:
    """The same, but for bodies whose cracks cannot grow; returned are these (block →)."""
    _take_loads(now, result)
    with now.timed("ddm solve"):
        # What tips that grow release is counted by all that they did before and after.
        idle = set() if now.crack_energy.grows else now.growth_screening.among(now, result.dt)
    _solve(now, {block: body for block, body in now.bodies.items() if block not in idle})
    return {block: body for block, body in now.bodies.items() if block in idle}


def _take_loads(now: CrackedBlocks, result: StepResult) -> None:
    with now.timed("tractions"):
        # Equilibrium holds where the forces of the step act.
        still = result.vertices is now.state.vertices
        motion = now.motion(now.state) if still else Motion.of(now.blocks, result.vertices)
        now.loads = boundary_loads(now.problem, now.blocks, now.state, motion, result, now.bodies)


def _solve(now: CrackedBlocks, bodies: dict) -> None:
    now.solutions = now.solve(bodies, now.loads, now.solutions)
    now.solved_from = now.history
    for block, load in now.loads.items():
        if load.bases:
            now.loads[block] = replace(load, tractions=now.solutions[block].load.tractions)


def _take_response(
    now: CrackedBlocks, state: State, settling: Settling, tolerance: float
) -> tuple[dda.CrackResponse, np.ndarray, Answer]:
    """What the next pass should assume, how far off the last assumption was in each cracked block (relative strain),
    and what was found. Sets what the next step should begin with."""
    blocks = np.array(list(now.bodies), int)
    with now.timed("ddm solve"):
        answers = _answers(now, state)
    with now.timed("compliance"):
        own = parallel_map(lambda of: _compliance(now, *of), list(answers.items()), threads_for(now.bodies))
        now.compliances.update(zip(answers, own))
        again, after = (dda.CrackResponse(now.response.compliance.copy(), now.response.offset.copy()) for _ in range(2))
        known = np.array([now.compliances[b][2] for b in answers])
        strain = np.array([answer.crack_strain for answer in answers.values()])
        hang = [k for k, b in enumerate(answers) if b in now.by_mean_stress]
        if hang:
            limits = (
                now.by_mean_stress.limit(b, now.bodies[b], now.system.compliance[b]) for b in blocks[hang].tolist()
            )
            limit = np.array(list(limits))
            turned = limit.transpose(0, 2, 1)
            known[hang], strain[hang] = turned @ known[hang] @ limit, times(turned, strain[hang])
        # Blocks assume what they do in the axes in which a step begins, and carry it along as they turn.
        began, ends = now.state.rotation[blocks], state.rotation[blocks]
        stress = times(stress_rotations(began - ends), state.stress[blocks])
        assumed = times(stress_rotations(ends - began).transpose(0, 2, 1), state.crack_strain[blocks])
        again.compliance[blocks], again.offset[blocks] = crack_responses(known, strain, stress, began)
        after.compliance[blocks], after.offset[blocks] = crack_responses(known, strain, state.stress[blocks], ends)
        found = again.offset[blocks] + times(again.compliance[blocks], stress)
        residual = found - assumed
        size = _strained(now.system.compliance[blocks], stress, found)
        if not size.any():
            differences = np.zeros(len(blocks))
        else:
            differences = np.abs(residual).max(axis=1) / size
            if differences.max() >= tolerance:
                before = again.offset[blocks] - residual
                again.offset[blocks] = settling.next(before, residual, again.compliance[blocks], size)
    now.response = after
    own_stress = times(stress_rotations(-state.rotation[blocks]), state.stress[blocks])
    return again, differences, Answer(loads_at(now.problem.loads, state.time), _systems(now), strain, own_stress, known)


def _answers(now: CrackedBlocks, state: State) -> dict:
    """block → the solution whose crack strain the block is to take."""

    def answer(block: int):
        if block not in now.by_mean_stress:
            return now.solutions[block]
        body, began = now.bodies[block], now.history.get(block)
        return now.by_mean_stress.answer(
            block, body, state.stress[block], float(state.rotation[block]), now.system.compliance[block], began,
            now.problem.run.skip,
        )  # fmt: skip

    return {block: answer(block) for block in now.bodies}


def _compliance(now: CrackedBlocks, block: int, solution) -> tuple:
    """The geometry and the states of crack faces that S belongs to, and S in the block's own axes: it does not change
    with the load."""
    body = now.bodies[block]
    states = solution.closed.tobytes() if solution.memory is None else solution.face_states.key
    known = now.compliances.get(block)
    if now.problem.run.skip and known is not None and known[0] is body.crack_system and known[1] == states:
        body.work.compliances_kept += 1
        return known
    known_before = any(each.compliances for each in now.works)
    with now.each("compliances") if known_before else nullcontext():
        s = passive(body.compliance(solution))
    body.work.compliances += 1
    return body.crack_system, states, s
