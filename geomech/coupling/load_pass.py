"""One pass of the coupling at one load: fixed-point iteration between block motion and crack strain.

DDA steps the blocks with an assumed crack response ε_c(σ) = offset + S σ of every cracked block. The contact forces of
that step become tractions on the elastic bodies of the cracked blocks, DDM solves these, and their crack opening and
slip give a new response. The iteration ends when assumed and computed crack strain agree:

    |ε_c,found − ε_c,assumed| / (|C σ| + |ε_c|) < tolerance

Static iterations are accelerated by a quasi-Newton update of the offsets (`quasi_newton`) and start from an
extrapolation in the loads (`load_extrapolation`).
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .. import dda, ddm
from ..dda import StepResult
from ..dda.statics.displacement_limit import DisplacementLimit
from ..model import TIP, Motion, State
from .coupled_state import CrackedBlocks
from .crack_compliance.added_compliance import crack_responses, passive, stress_rotations, times
from .crack_compliance.line_search import Linearised, LineSearch
from .crack_compliance.load_extrapolation import Answer
from .crack_compliance.outline_motion import OutlineMotion
from .crack_compliance.quasi_newton import QuasiNewton, strain_size
from .load_path import loads_at
from .load_transfer.elastic_bodies import boundary_loads, threads_for, tip_rows
from .order_raising import raises_orders, take_orders
from .parallel_map import parallel_map

if TYPE_CHECKING:
    from ..ddm.crack_contact.face_laws import FaceMemory

log = logging.getLogger(__name__)

#: Relative tolerance of the crack strain in statics, of the block's strain.
COMPLIANCE_TOLERANCE = 1e-6

#: Relative tolerance in dynamics. The next step corrects the remaining difference, which is far below the accuracy of
#: any measured toughness.
DYNAMIC_TOLERANCE = 1e-4

#: Strain scale of a nearly unstrained block, as a fraction of the largest strain of a cracked block: a block in free
#: flight has hardly any strain to compare with.
STILL = 1e-3

#: Largest number of iterations of a pass. One or two suffice with unchanged contact states, three after growth, more
#: where contacts and crack faces open and close. The next step corrects the remaining difference.
COMPLIANCE_PASSES = 20

#: Largest number of iterations of a static pass as long as every two of them halve the mismatch.
MOST_CONVERGING = 40

#: Static iterations after which a block with oscillating forces and crack strain takes the mean-stress response
#: (`mean_stress_response`). The choice is made from the last half of them; in the last one alone rounding could decide.
PATIENCE = 10

#: Relative mismatch of the assumed crack strain below which it did not cause a cut of the time step.
AGREED = 1e-2

#: Mismatch above which the pass has failed. In dynamics half the time step is then tried, up to `HALVINGS` times: the
#: shorter the step, the more the inertia limits the strain.
FAILED = 0.1
HALVINGS = 4
#: Key of a warning that is given once.
_UNSETTLED = "crack faces without states"


@dataclass(frozen=True, eq=False)
class Balance:
    """Result of a pass: the step of the blocks (``result``), the DDM ``solutions`` (block → `ddm.Solution`), the TIP
    rows ``tips`` with kink angle and K_eq, and ``statistics``. ``left_out`` (block → body): bodies that were not solved
    because their cracks cannot grow. ``mismatch`` (n_cracked,): remaining relative mismatch of crack strain."""

    result: StepResult
    solutions: dict
    tips: np.ndarray
    statistics: dict[str, float] = field(default_factory=dict)
    left_out: dict = field(default_factory=dict)
    mismatch: np.ndarray = field(default_factory=lambda: np.zeros(0))


def balanced(now: CrackedBlocks, dt: float, load_time: float | None, like: StepResult | None = None) -> Balance:
    """Iterate DDA step, boundary tractions and DDM solutions of ``now`` until the crack strains agree.

    ``dt`` s is the longest step. ``load_time`` s: apply the loads of that time whatever step the blocks take, and make
    it the new time; None: the loads at the end of the step. ``like``: the step from the same state before the cracks grew,
    whose contact states are the first guess. Updates ``now.response``, ``loads``, ``solutions`` and
    statistics. Raises `dda.NotConverged`, also where blocks and cracks agree at no step length. Repeated with blocks of
    higher order where these are chosen automatically and needed (`order_raising`).
    """
    while True:
        begun = now.response
        found = _balanced(now, dt, load_time, like)
        grows = found.tips["k_eq"] >= toughness(now, found.tips)
        if not raises_orders(now, begun, found.tips["block"][grows]):
            return found
        like = None


def _balanced(now: CrackedBlocks, dt: float, load_time: float | None, like: StepResult | None) -> Balance:
    """`balanced` with blocks of the present orders."""
    static, asked = now.system.scheme.static, dt
    found, failure = None, None
    for halvings, ways in _attempts(static, load_time is None):
        if static and halvings and found is not None:
            break
        dt = 0.5**halvings * asked if static else dt
        try:
            found, differences = _attempted(now, dt, load_time, ways, like)
        except ddm.NotConverged as unsettled:
            failure, dt = unsettled, 0.5 * dt
            continue
        lost = np.flatnonzero(differences > FAILED)
        if not len(lost):
            if failure is not None:
                _tell_unsettled(now, found.result, failure)
            return replace(found, mismatch=differences)
        dt = 0.5 * found.result.dt
    if found is None:
        raise dda.NotConverged(f"in a step from t = {now.state.time:g} s: {failure}") from failure
    blocks = [now.blocks.names[b] for b in np.array(list(now.bodies), int)[lost]]
    raise dda.NotConverged(
        f"t = {found.result.state.time:g} s: {', '.join(blocks[:3])} and its cracks do not converge to a common strain "
        f"in {COMPLIANCE_PASSES} passes (relative difference {differences.max():.2g}): try a shorter time step, or "
        "finer elements in [ddm]"
    )


def _attempts(static: bool, free: bool) -> Iterator[tuple[int, _Ways]]:
    """Attempts at a step: how often it is halved, and how. In motion every attempt takes half of the last step.

    In statics the mean-stress response is used only where the iteration fails without it, and cement breaks in the passes
    only where both fail. Shorter load steps, if their length is ``free``, are for faces that find no states in any way."""
    if not static:
        yield from ((k, _Ways(soft_by_mean_stress=True)) for k in range(1 + HALVINGS))
        return
    for k in range(1 + HALVINGS if free else 1):
        yield from ((k, ways) for ways in _AT_REST)


def _attempted(
    now: CrackedBlocks, dt: float, load_time: float | None, ways: _Ways, like: StepResult | None
) -> tuple[Balance, np.ndarray]:
    """The result of `_passes`; without one, ``now`` begins the next attempt as this one. Raises `ddm.NotConverged`."""
    begun, memories = now.response, (now.history, now.by_mean_stress.memory)
    done = False
    try:
        found, differences = _passes(now, dt, load_time, ways, like)
        done = not (differences > FAILED).any()
        return found, differences
    finally:
        # Cement that has broken in the iteration is lost only once the step is accepted.
        now.history, now.by_mean_stress.memory = memories
        if not done:
            now.response = begun


def _tell_unsettled(now: CrackedBlocks, result: StepResult, failure: Exception) -> None:
    """Warn, once in a run, that crack faces have found no states in an earlier attempt at the step of ``result``."""
    level = logging.DEBUG if _UNSETTLED in now.system.warned else logging.WARNING
    now.system.warned.add(_UNSETTLED)
    log.log(
        level,
        "t = %g s: %s. The step is repeated, with a length of %.3g s, in which the faces have states; later repetitions "
        "are not reported",
        result.state.time, failure, result.dt,
    )  # fmt: skip


def at_rest(now: CrackedBlocks, load_time: float) -> dda.Equilibrium:
    """Bring the blocks to equilibrium under the loads of ``load_time``. In dynamics their cracks open and slide on the
    way, so that the first step begins without unbalanced crack strain; in statics the first step does this.

    The blocks are brought to equilibrium with one crack strain after another, until assumed and found ones agree. Each
    search begins at the equilibrium before, so that joints slide on only as far as the strains still change: searches that
    all begin with the blocks as drawn end at another equilibrium of their friction each time.

    Sets ``now.state`` and ``now.response``.
    """
    drawn, response = now.state, now.response
    begun, limits = drawn, None
    moving = not now.system.scheme.static and bool(now.bodies)
    system = now.system.in_statics() if moving else now.system
    now.quasi_newton.forget()
    for _ in range(COMPLIANCE_PASSES):
        if moving and limits is None:
            # Displacements count from the blocks as drawn.
            limits = dda.RelaxationLimits(limit=DisplacementLimit(system, drawn, now.problem.loads, load_time))
        before, now.system.raises_orders = now.system.order_of(begun), True
        with now.timed("dda"):
            found = dda.equilibrium(
                system, begun, now.problem.loads, load_time=load_time, crack=response,
                tolerance=now.problem.dda.unbalanced_tolerance, limits=limits,
            )  # fmt: skip
        now.system.raises_orders, order = False, found.state.order
        if order is not None and (order != before).any():
            take_orders(now, np.asarray(order), response, found.state)
            drawn, response, limits = now.system.with_orders(drawn, np.asarray(order)), now.response, None
        # The last of the steps to equilibrium begins in the axes of its end.
        now.state = begun = found.state
        if not moving or found.result is None or found.collapsed:
            return found
        now.by_mean_stress.take_all(now.bodies)
        response, differences, _ = _take_response(now, found.state, now.quasi_newton, DYNAMIC_TOLERANCE)
        if differences.max() < DYNAMIC_TOLERANCE:
            break
    else:
        log.warning(
            "t = %g s: blocks at rest and their cracks do not converge to a common strain in %d passes (relative "
            "difference %.2g); the first step releases the difference",
            load_time, COMPLIANCE_PASSES, differences.max(),
        )  # fmt: skip
    now.by_mean_stress.take_step()
    now.crack_energy.begin(now.strain_solutions(), now.by_mean_stress)
    return found


class _Ways(NamedTuple):
    """How a pass finds its state: whether soft blocks take the mean-stress response, and whether cement of oscillating
    blocks stays broken once it has broken in an iteration."""

    soft_by_mean_stress: bool = False
    cement_breaks: bool = False


_AT_REST = _Ways(), _Ways(soft_by_mean_stress=True), _Ways(True, True)


@dataclass
class _OscillatingBlocks:
    """Blocks whose forces and crack strain oscillate in the iteration, for a step of ``asked`` s.

    ``blocks``: since the full step was last tried (``tried_whole``); ``lately``: in the last iterations, with the face
    memory of the one in which most cement had broken (``broken``, block →); ``doubt``: largest mismatch of the assumed
    strain in an iteration that cut the step."""

    static: bool
    asked: float
    cement_breaks: bool
    blocks: set[int] = field(default_factory=set)
    recent: set[int] = field(default_factory=set)
    broken: dict[int, FaceMemory] = field(default_factory=dict)
    tried_whole: bool = False
    cut_mismatch: float = 0.0

    def agreed(self, now: CrackedBlocks, dt: float) -> tuple[bool, set[int]]:
        """Whether the iteration may end after strains have agreed in a step of ``dt`` s. If not, the full step is tried
        again; the returned blocks take the mean-stress response first."""
        # In a shortened static step blocks agree because inertia limits their motion; that is not equilibrium.
        give_way = _softest(now, self.blocks) if self.static and dt != self.asked and self.tried_whole else set()
        if not self.static or dt == self.asked or ((self.tried_whole or self.cut_mismatch < AGREED) and not give_way):
            return True, set()
        # A crack strain assumed in the first iterations may have caused the cut of a static step.
        self.tried_whole, self.blocks = True, set()
        return False, give_way

    def after_iteration(self, now: CrackedBlocks, attempt: int, differences: np.ndarray) -> tuple[set[int], bool]:
        """Blocks that take the mean-stress response after iteration ``attempt``, in which assumed and found crack
        strain differ by ``differences`` (n_cracked,); and whether any block responds differently from now on."""
        oscillating = set(np.array(list(now.bodies), int)[differences > FAILED].tolist())
        self.blocks |= oscillating
        if attempt < PATIENCE // 2:
            self.recent = set()
            return set(), False
        self.recent = self.recent | oscillating
        if self.cement_breaks:
            self._note_broken(now)
        if attempt + 1 != PATIENCE:
            return set(), False
        broke, softest = self.cement_breaks and self._break_cement(now), _softest(now, self.recent)
        return softest, broke or bool(softest)

    def _note_broken(self, now: CrackedBlocks) -> None:
        """Record the most broken cement of the oscillating blocks."""
        for block, solution in now.strain_solutions().items():
            memory, most = solution.memory, self.broken.get(block)
            if (
                block in self.recent
                and memory is not None
                and (most is None or memory.broken.sum() > most.broken.sum())
            ):
                self.broken[block] = memory

    def _break_cement(self, now: CrackedBlocks) -> bool:
        """Whether the oscillating blocks have cement that breaks while they are stiff, and would hold once they have
        given way: no state with intact cement is in equilibrium. It stays broken in the following iterations."""
        from ..ddm.crack_contact.face_laws import breaking_as

        own = now.by_mean_stress
        forces: dict[int, FaceMemory] = {}
        mean: dict[int, FaceMemory] = {}
        for block, memory in self.broken.items():
            began = now.history.get(block)
            breaks = breaking_as(own.memory.get(block, began) if block in own else began, memory)
            if breaks is not None:
                (mean if block in own else forces)[block] = breaks
        if forces or mean:
            now.history, own.memory = now.history | forces, own.memory | mean
        return bool(forces or mean)


def _passes(
    now: CrackedBlocks, dt: float, load_time: float | None, ways: _Ways, like: StepResult | None
) -> tuple[Balance, np.ndarray]:
    """The iterations of a step of at most ``dt`` s, with the contact states of ``like`` as first guess; returns the result
    and the remaining relative mismatch of crack strain (n_cracked,)."""
    static, quasi_newton = now.system.scheme.static, now.quasi_newton
    if static:
        quasi_newton.begin(tuple(now.bodies))
    else:
        quasi_newton.forget()  # in motion, contact changes of the last step need not recur
    tolerance = COMPLIANCE_TOLERANCE if static else DYNAMIC_TOLERANCE
    response = _expected(now, now.state.time + dt if load_time is None else load_time) if static else now.response
    result: StepResult | None = like
    search = None if static else LineSearch()
    iterations: float = 0
    oscillating = _OscillatingBlocks(static, dt, ways.cement_breaks)
    left: list[float] = []
    for attempt in range(MOST_CONVERGING if static else COMPLIANCE_PASSES):
        result = _step(now, dt, load_time, response, result)
        # Iterations of different step lengths, and so in statics of different loads, would never agree.
        cut, dt = result.dt < dt, min(dt, result.dt)
        iterations += result.statistics["open_close_iterations"]
        now.acted = result.statistics
        if not now.bodies:
            now.solutions, now.loads = {}, {}
            return Balance(result, {}, np.empty(0, TIP)), np.zeros(0)
        if not static:
            now.by_mean_stress.take_all(now.bodies)
        elif ways.soft_by_mean_stress:
            now.by_mean_stress.find(now.bodies, now.system.compliance, result.contacts)
        # A block with the mean-stress response needs no contact forces until the iteration has converged.
        solved = not all(block in now.by_mean_stress for block in now.bodies)
        if solved:
            _solve_bodies(now, result)
        if search is not None and cut:
            search.forget()
        response, differences, answer = _take_response(now, result.state, quasi_newton, tolerance, search)
        left.append(float(differences.max()))
        oscillating.cut_mismatch = max(oscillating.cut_mismatch, left[-1]) if cut else oscillating.cut_mismatch
        if left[-1] < tolerance:
            if static:
                _remember(now, answer)
            done, give_way = oscillating.agreed(now, dt)
            if done:
                break
            dt, changed = oscillating.asked, bool(give_way)
        else:
            give_way, changed = oscillating.after_iteration(now, attempt, differences)
        if attempt + 1 >= COMPLIANCE_PASSES and not left[-1] < 0.5 * left[-3]:
            break
        for block in sorted(give_way):
            now.by_mean_stress.give_way(block)
        if changed:
            # The oscillation may have caused the cut of the step.
            dt = oscillating.asked
            quasi_newton.forget()
    assert result is not None
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
    """A DDA step with this crack ``response``; ``before``: the step of the previous iteration."""
    with now.timed("dda"):
        result = now.system.step(now.state, now.problem.loads, dt, response, load_time, before)
        if load_time is not None and result.state.time != load_time:
            result = replace(result, state=replace(result.state, time=load_time))
    return result


def _with_tips(now: CrackedBlocks, result: StepResult, statistics: dict[str, float], left_out: dict) -> Balance:
    """The result of the last iteration, with the tips of all bodies but those ``left_out``."""
    tips = _tips_with_criterion(now)
    for body in left_out.values():
        body.work.solutions_left_out += 1
    if not now.system.scheme.static:
        now.growth_screening.solved(now, tips, toughness(now, tips))
    return Balance(result, now.solutions, tips, statistics, left_out)


def _softest(now: CrackedBlocks, oscillating: set[int]) -> set[int]:
    """The soft block among the oscillating ones (``oscillating``), which drives the others. Where several are soft, all
    soft blocks: they drive each other, and rounding would decide between them."""

    def soft(block: int) -> bool:
        return now.by_mean_stress.soft(block, now.bodies[block], now.elastic(block))

    found = {block for block in oscillating if soft(block)}
    return {block for block in now.bodies if soft(block)} if len(found) > 1 else found or oscillating


def toughness(now: CrackedBlocks, tips: np.ndarray) -> np.ndarray:
    """(n_tips,) fracture toughness K_Ic of the rock at each tip, Pa √m."""
    k_ic = np.array([material.k_ic for material in now.problem.materials])
    return k_ic[now.blocks.material[tips["block"]]]


def _tips_with_criterion(now: CrackedBlocks) -> np.ndarray:
    return tip_rows(now.problem, now.blocks, now.solutions, now.nodes_of)


def _systems(now: CrackedBlocks) -> tuple:
    return tuple(body.crack_system for body in now.bodies.values())


def _expected(now: CrackedBlocks, time: float) -> dda.CrackResponse:
    """Crack response to assume in the first static iteration at the loads of ``time``: extrapolated from earlier loads.
    For cracks that have grown since, the response is computed from the last boundary forces."""
    if not now.bodies:
        return now.response
    blocks = tuple(now.bodies)
    numbers = np.array(blocks)
    width = now.response.offset.shape[1]
    known, beyond, s = now.extrapolation.at(loads_at(now.problem.loads, time), blocks, _systems(now), width)
    last, grown = now.extrapolation.last(blocks), np.zeros_like(beyond)
    if last is not None:
        for b, solution in _solutions_under_last_forces(now, numbers[~known].tolist()).items():
            k = blocks.index(b)
            known[k], s[k] = True, _stacked([now.compliances[b][2]], width)[0]
            beyond[k] = last.strain[k] - s[k] @ last.stress[k]
            grown[k] = _stacked([solution.crack_strain], width)[0] - last.strain[k]
    response = now.response.copy()
    own, began = numbers[known], now.state.rotation[numbers]
    response.compliance[own], response.offset[own] = crack_responses(
        s[known], beyond[known], np.zeros_like(beyond[known]), began[known]
    )
    if last is not None and grown.any():
        grown = times(stress_rotations(-began, grown.shape[1]).transpose(0, 2, 1), grown)
        size = _strained(now.elastic_of(numbers), last.stress, last.strain + grown)
        if known.all():
            offset, s = response.offset[numbers], response.compliance[numbers]
            response.offset[numbers] = now.quasi_newton.next(offset, grown, s, size)
        else:
            response.offset[numbers] += grown
    return response


def _strained(elastic: np.ndarray, stress: np.ndarray, strain: np.ndarray) -> np.ndarray:
    """(n,) strain scale of blocks with ``elastic`` compliance (n, 3, 3) under ``stress`` (n, 3) with crack ``strain``
    (n, 3): |C σ| + |ε_c|."""
    size = strain_size(times(elastic, stress)) + strain_size(strain)
    return np.maximum(size, STILL * size.max())


def _solutions_under_last_forces(now: CrackedBlocks, grown: list[int]) -> dict:
    """Solutions (block →) of the ``grown`` blocks under the boundary forces of the last pass, where these are known.
    Sets their compliances."""
    asked = {b: now.bodies[b] for b in grown if b in now.loads and b not in now.by_mean_stress}
    if not asked:
        return {}
    try:
        solved = now.solve(asked, now.loads, now.solutions)
    except ddm.NotConverged:
        # Crack faces may still find consistent states under the forces of the next pass.
        return {}
        # (Observers keep their own reference to the solutions of the last pass.)
    now.solutions = now.solutions | solved
    now.solved_from = now.solved_from | {b: now.history[b] for b in solved if b in now.history}
    with now.timed("compliance"):
        now.compliances |= {b: _compliance(now, b, solution) for b, solution in solved.items()}
    return solved


def _remember(now: CrackedBlocks, answer: Answer) -> None:
    """Store a converged ``answer`` for the extrapolation. Before the first one the unloaded state is stored: no strain
    at no load, with the crack faces in their initial states."""
    blocks, state = tuple(now.bodies), now.state
    before = loads_at(now.problem.loads, state.time)
    if now.extrapolation.last(blocks) is None and not (before.any() or state.stress.any() or state.crack_strain.any()):
        nothing = np.zeros_like(answer.strain)
        now.extrapolation.take(blocks, replace(answer, loads=before, strain=nothing, stress=nothing))
    now.extrapolation.take(blocks, answer)


def _solve_bodies(now: CrackedBlocks, result: StepResult) -> None:
    """Solve all bodies under the boundary tractions of the step ``result``."""
    _take_loads(now, result)
    _solve(now, now.bodies)


def _solve_what_may_grow(now: CrackedBlocks, result: StepResult) -> dict:
    """Solve all bodies whose cracks may grow under the step ``result``; returns the others (block →)."""
    _take_loads(now, result)
    with now.timed("ddm solve"):
        # Bounds are of K under loads. Tips that the stress of their block loads are known from its solution.
        idle = now.growth_screening.among(now) - set(_loaded_by_stress(now))
    _solve(now, {block: body for block, body in now.bodies.items() if block not in idle})
    return {block: body for block, body in now.bodies.items() if block in idle}


def _take_loads(now: CrackedBlocks, result: StepResult) -> None:
    with now.timed("tractions"):
        # Forces are in equilibrium in the midpoint configuration, in which the step applies them.
        still = result.vertices is now.state.vertices
        motion = now.motion(now.state) if still else Motion.of(now.blocks, result.vertices)
        now.loads = boundary_loads(now.problem, now.blocks, now.state, motion, result, now.bodies)


def _loaded_by_stress(now: CrackedBlocks) -> dict:
    """Blocks of higher order in motion (block → its stress field): their stress loads the tips, as it does the strain of
    their cracks. It gives the energy that growth takes."""
    return {} if now.system.scheme.static else now.by_mean_stress.fields


def _solve(now: CrackedBlocks, bodies: dict) -> None:
    """Solve ``bodies`` (block →) under their loads, or the stress of their blocks (`_loaded_by_stress`)."""
    by_stress = _loaded_by_stress(now)
    own = {block: now.by_mean_stress.solutions[block] for block in bodies if block in by_stress}
    under_loads = {block: body for block, body in bodies.items() if block not in own}
    solved = now.solve(under_loads, now.loads, now.earlier | now.solutions) if under_loads else {}
    # Bodies that are left out keep the face states of their last solution as a first guess of the next.
    now.earlier = {b: of for b, of in (now.earlier | now.solutions).items() if b in now.bodies and b not in bodies}
    now.solutions = {block: own[block] if block in own else solved[block] for block in bodies}
    now.solved_from = {
        block: memory
        for of in (now.solved_from, now.history)
        for block, memory in of.items()
        if (block in bodies) == (of is now.history)
    }
    for block, load in now.loads.items():
        if load.bases and block in now.solutions:
            now.loads[block] = replace(load, tractions=now.solutions[block].load.tractions)


def _take_response(
    now: CrackedBlocks, state: State, quasi_newton: QuasiNewton, tolerance: float, search: LineSearch | None = None
) -> tuple[dda.CrackResponse, np.ndarray, Answer]:
    """The crack response for the next iteration, the relative mismatch of the assumed one (n_cracked,), and the strains
    found. Sets ``now.response``, with which the next step begins. ``search``: shortens the next steps of blocks that do not
    agree."""
    blocks = np.array(list(now.bodies), int)
    with now.timed("ddm solve"):
        answers = _answers(now, state)
    with now.timed("compliance"):
        own = parallel_map(lambda of: _compliance(now, *of), list(answers.items()), threads_for(now.bodies))
        now.compliances.update(zip(answers, own))
        again, after = now.response.copy(), now.response.copy()
        width = now.response.offset.shape[1]
        known, strain = _linearised(now, answers, width)
        # A response is given in the axes of the beginning of a step and rotates with its block.
        began, ends = now.state.rotation[blocks], state.rotation[blocks]
        borne = now.stress_of(state, blocks)
        stress = times(stress_rotations(began - ends, width), borne)
        carried = now.crack_strain_of(state, blocks)
        assumed = times(stress_rotations(ends - began, width).transpose(0, 2, 1), carried)
        again.compliance[blocks], again.offset[blocks] = crack_responses(known, strain, stress, began)
        after.compliance[blocks], after.offset[blocks] = crack_responses(known, strain, borne, ends)
        found = again.offset[blocks] + times(again.compliance[blocks], stress)
        residual = found - assumed
        size = _strained(now.elastic_of(blocks), stress, found)
        if not size.any():
            differences = np.zeros(len(blocks))
        else:
            differences = strain_size(residual) / size
            if differences.max() >= tolerance:
                before = again.offset[blocks] - residual
                again.offset[blocks] = quasi_newton.next(before, residual, again.compliance[blocks], size)
    for block in now.glued_cells.intersection(answers):
        again.outlines[block] = after.outlines[block] = _outline(now, block, answers[block])
    now.response = after
    own_stress = times(stress_rotations(-state.rotation[blocks], width), borne)
    if search is not None:
        own_assumed = times(stress_rotations(ends, width).transpose(0, 2, 1), carried)
        for k in np.flatnonzero(differences > FAILED).tolist():
            reached = Linearised(own_stress[k], strain[k], known[k], strain[k] - own_assumed[k])
            _shorten(now, state, search, int(blocks[k]), reached, own_assumed[k], again)
    return again, differences, Answer(loads_at(now.problem.loads, state.time), _systems(now), strain, own_stress, known)


def _linearised(now: CrackedBlocks, answers: dict, width: int) -> tuple[np.ndarray, np.ndarray]:
    """S (n, w, w) and crack strain (n, w) of the solutions ``answers`` (block →), in the blocks' own axes."""
    mean = now.by_mean_stress
    known = _stacked([now.compliances[b][2] for b in answers], width)
    strain = _stacked([mean.crack_strain(b, answer) for b, answer in answers.items()], width)
    hang = {k: b for k, b in enumerate(answers) if b in mean}
    if hang:
        limit = _stacked([mean.limit(b, now.bodies[b], now.elastic(b)) for b in hang.values()], width)
        turned, at = limit.transpose(0, 2, 1), list(hang)
        known[at], strain[at] = turned @ known[at] @ limit, times(turned, strain[at])
    return known, strain


def _shorten(
    now: CrackedBlocks, state: State, search: LineSearch, block: int, reached: Linearised, assumed: np.ndarray,
    again: dda.CrackResponse,
) -> None:  # fmt: skip
    """Linearise the cracks of ``block`` in the response ``again`` where ``search`` has them, instead of where the last step
    has ``reached``; ``assumed`` (w,): the crack strain of that step, in the block's own axes."""
    width = len(reached.stress)
    turn = stress_rotations(state.rotation[block : block + 1], width)

    def at(stress: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        with now.timed("ddm solve"):
            answers = {block: _answer(now, state, block, times(turn, stress[None])[0])}
        with now.timed("compliance"):
            now.compliances[block] = _compliance(now, block, answers[block])
            known, strain = _linearised(now, answers, width)
        return strain[0], known[0]

    to = search.next(block, reached, assumed, at)
    if to is not reached:
        began = now.state.rotation[block : block + 1]
        stress = times(stress_rotations(began, width), to.stress[None])
        again.compliance[[block]], again.offset[[block]] = crack_responses(
            to.compliance[None], to.strain[None], stress, began
        )
        if block in again.outlines:
            again.outlines[block] = _outline(now, block, now.by_mean_stress.solutions[block])


def _outline(now: CrackedBlocks, block: int, solution) -> OutlineMotion:
    """How the faces of a cracked cell to its neighbours move with the ``solution`` of its cracks."""
    mean = now.by_mean_stress
    body, (stress, limit) = now.bodies[block], mean.stress[block]
    return OutlineMotion.of(mean.fields[block], body, solution, stress, limit)


def _stacked(values: list[np.ndarray], width: int) -> np.ndarray:
    """(n, width, …) of n arrays (w, …) with w ≤ ``width``, padded with zeros."""
    if all(len(one) == width for one in values):
        return np.array(values)
    return np.array([np.pad(one, [(0, width - len(one))] * one.ndim) for one in values])


def _answers(now: CrackedBlocks, state: State) -> dict:
    """block → the solution whose crack strain the block is to take."""
    return {
        block: _answer(now, state, block, now.stress_of(state, np.array([block]))[0])
        if block in now.by_mean_stress
        else now.solutions[block]
        for block in now.bodies
    }


def _answer(now: CrackedBlocks, state: State, block: int, stress: np.ndarray):
    """The solution of ``block`` under its mean ``stress`` (w,), Pa, in current axes."""
    elastic = now.elastic(block)
    try:
        return now.by_mean_stress.answer(
            block, now.bodies[block], stress[: len(elastic)], float(state.rotation[block]), elastic,
            now.history.get(block), now.problem.run.skip,
        )  # fmt: skip
    except ddm.NotConverged as failure:
        failure.block = block
        raise


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
        s = passive(now.by_mean_stress.compliance(block, body, solution), now.elastic(block))
    body.work.compliances += 1
    return body.crack_system, states, s
