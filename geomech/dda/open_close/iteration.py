"""Open–close iterations: contact states that agree with the motion they produce.

A set of states makes the step linear; its solution is checked against them (`coulomb_return`). Every contact that fails
is switched and the step solved again: Newton's method, which ends in two or three iterations where few contacts change.
Bonds, lost for good, break only when all else is right.

Where the number of wrong contacts does not fall by half from one iteration to the next, or a combination of states
returns, the `CentralPath` proposes states to go on from, unless contacts are few. If it is blocked, `RoundedLaws` do
(for more blocks than a dense matrix holds; in statics, where a shorter step helps little, `ConvexRounds` before them),
and if they fail too, rounds of `LaggedFriction`, slowly and surely. If these end without, the sliding contacts
stick again and only the worst contact of each block is switched, and if a combination still returns, only the first
(the least-index rule, which cannot cycle where the problem has one solution; Murty 1974). Laws that are curved are
lines within an iteration, and the iteration goes on until lines and laws agree on the forces.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain

import numpy as np

from ...model import OPEN, SLIP, STICK
from ..contact_detection.contact_finder import ContactSet
from ..joint_laws.nonlinear_laws import CurvedJoints
from ..joint_laws.penalty_springs import Springs
from ..linear_solver import assembly
from .block_patches import settled_in_patch
from .equations import Answer, Equations, States, Unsettled
from .interior_point.central_path import CentralPath
from .lagged_friction import LaggedFriction
from .settled_states import Settled
from .smoothed_newton import RoundedLaws
from .successive_convex import ConvexRounds

log = logging.getLogger(__name__)

#: Which of the contacts that are wrong are switched: all, those of each block that are half as wrong as its worst, its
#: worst, the first.
_ALL, _SOME, _WORST, _FIRST = 0, 1, 2, 3
#: Switching all goes on while the number of wrong contacts falls to this part of the fewest so far, …
_FEWER = 0.55
#: … or for so many iterations although it does not, more where no more than this part of the contacts is wrong (on a
#: slope that slides, an iteration takes a fifth of one of the path, of which forty may lead nowhere; not where blocks
#: are so many that both factor all of the matrix). More of the contacts of `MANY` blocks, whose path may be in vain.
#: (One brick that slides on a wall of 10 000 shakes a fiftieth to a twentieth of them loose: a step of 10 ms takes seven
#: iterations then, where the path stopped, and its half took 24.)
_TRIES, _TRIES_OF_FEW, _FEW_OF_ALL, _FEW_OF_MANY = 1, 4, 0.02, 0.05
#: If no more than this many contacts are still wrong then, only some are switched, while that helps or for so many
#: iterations.
_LITTLE, _MORE = 12, 5
#: Before that, where no more than so many are wrong, the states of those that were in the last iterations (these and so
#: many more) are sought together, so many times.
_SOUGHT, _LATELY, _TOGETHER = 40, 3, 12
#: It takes two solutions for each contact and one for each set of them: so many in all, as many as twenty iterations of
#: the path. (A wall under sudden weight has a dozen of sets at once, and takes 27 iterations without.)
_SOLUTIONS = 60
#: Where switching does not end and no more than this part of the contacts is wrong, the blocks about them are settled
#: by themselves, so often in a step; where their number does not fall to this part.
_FEW_IN_PATCHES, _PATCHES, _FALLS = 0.1, 6, 0.9
#: States that return, and are wrong at no more contacts than this, by no more than this part of the largest force on
#: either of their blocks, stand: the friction of a pebble beside a block of a hundred tons.
_SLIVERS, _NOTHING = 8, 1e-4
#: Where there are so few contacts the worst are switched first of all, which takes three iterations where the path
#: takes fifteen; it is asked after so many iterations.
_FEW, _CAUTIOUS = 40, 12
#: The central path proposes states when no more than this part of the contacts are undecided, nor more than so many or
#: so small a part (a wall of 10 000 bricks takes half the iterations that it takes without this second bound), and no
#: more than this part of the forces on blocks is out of balance. At its end, where ε is round-off, the first of these
#: suffices: a wall of 100 000 bricks leaves twenty that hardly touch.
_DECIDED, _LEFT, _LEFT_PART, _BALANCED = 0.006, 12, 2e-4, 1e-3
#: … and ε is below this: where it still is large, contacts of blocks that fly apart are decided as well.
_CENTRED = 1.0
#: A path of many blocks that has used up its iterations goes on while ε falls to this part within so many of them, up
#: to so many times as far: what would follow takes hundreds.
_AHEAD, _LOOKED, _LONGER = 0.2, 5, 3
#: One with ε below this is followed so many further whatever it took: states that hang by a hair come right at its very
#: end. (In a static step of a wall of 10 000 bricks 800 of them still do at 1e-7, four at 1e-12, none at 1e-13.)
_NEAR_ITS_END, _TO_ITS_END = 1e-6, 12
#: From so many free blocks on, a step in motion is cut as soon as few contacts stop its path, which has then come to
#: where no states are near that fit, somewhere in so large a system: half the step goes through. (A slope of 20 000
#: blocks under sudden weight, 10 ms: stopped after 33 iterations and, followed further, nowhere after 126 s of processor
#: time; its half takes 43. Six steps of one of 4 000: 18 s, 98 s where paths are followed further.) Nor are states
#: switched at all where more than `_FEW_OF_ALL` are wrong, nor any solved for that are beyond factors in single
#: precision, as those far from the right ones are: double ones of 100 000 blocks take 20 s and 1.6 GB more. (A slope of
#: so many, 5 ms: the states at the end of its path left no residual below a twentieth in sixteen directions; factored in
#: double, they led nowhere either.)
MANY = 3_000
#: Rounds of lagged friction take so many times the iterations otherwise allowed, and propose states when normal forces
#: change by less than the first part of the largest, then whenever they do by so much less, until they stay the same.
#: Those of convex problems, twice as long, do so where they change less: as long as some of the friction lags, states are
#: nearly always wrong.
_PATIENCE, _CHANGE, _CLOSER, _SAME = 4, 2e-2, 0.2, 1e-7
_CONVEX_CHANGE, _NEARER = 5e-3, 0.5
#: Iterations to go from such states to the end.
_FINISH = 8
#: Bonds of many contacts that are given back have this part of the iterations to settle: few do where loads come by and
#: by, hundreds where the weight of a glued slope is put on at once.
_BACK = 2


def hurries(patient: bool, statics: bool, n: int) -> bool:
    """Whether a step of ``n`` free blocks is cut at the first sign that it does not settle, see `MANY`; arguments as for
    `settle`."""
    return not (patient or statics) and n >= MANY


def _negligible(answer: Answer, found: ContactSet, number: int) -> bool:
    """Whether all contacts that are wrong, ``number`` of them, are so by next to nothing beside what others of their
    blocks bear: of a sliver between blocks that bear a slope no set of states may fit."""
    if number > _SLIVERS:
        return False
    largest = np.zeros(int(max(found.block.max(), found.other.max())) + 1)
    for blocks in (found.block, found.other):
        np.maximum.at(largest, blocks, np.abs(answer.forces[:, 0]))
    wrong = np.flatnonzero(answer.violation > 0)
    bears = np.maximum(largest[found.block[wrong]], largest[found.other[wrong]])
    return bool((answer.violation[wrong] <= _NOTHING * bears).all())


def _worst_of_their_blocks(
    violation: np.ndarray, block: np.ndarray, other: np.ndarray, order: np.ndarray, share: float
) -> np.ndarray:
    """(n,) True for contacts at least ``share`` times as violated as any other contact of either of their free
    blocks."""
    worst = np.zeros(len(order))
    np.maximum.at(worst, block, violation)
    np.maximum.at(worst, other, violation)
    worst[order < 0] = 0.0
    return violation >= share * np.maximum(worst[block], worst[other])


def _proposed(
    path: CentralPath, bonded: np.ndarray, offered: set[bytes], budget: int, patient: bool, hurried: bool = False
) -> tuple[States | None, int]:
    """States that the ``path`` proposes once nearly all contacts are decided, none of those ``offered`` already, or
    None if it ends or takes more than ``budget`` iterations; and the iterations spent. Unless ``patient`` a path that
    is blocked has ended, and one that gets ahead, or is near its end, may take more. If ``hurried``, one that has been
    stopped anywhere has ended. Raises `Unsettled`."""
    epsilons = []
    if not patient and path.epsilon < _NEAR_ITS_END:
        budget = max(budget, _TO_ITS_END)
    for spent in range(1, (1 if patient else _LONGER) * max(budget, 0) + 1):
        try:
            undecided = path.advance()
        except np.linalg.LinAlgError as error:
            raise Unsettled(str(error)) from error
        epsilons.append(path.epsilon)
        few = _DECIDED * len(bonded)
        if not path.arrived:
            if path.ended or (path.blocked and not patient) or (hurried and path.stopped):
                return None, spent
            few = min(few, max(_LEFT, _LEFT_PART * len(bonded)))
        # Where no load comes to in so short a time, contacts neither bear nor part: round-off decides.
        if (
            (undecided <= max(2, few) or (hurried and path.arrived))
            and path.missed < _BALANCED
            and path.epsilon < _CENTRED
        ):
            states = States(*path.states(), bonded)
            if states.key not in offered:
                offered.add(states.key)
                return states, spent
        if path.ended or (spent >= budget and epsilons[-1] > _AHEAD * max(epsilons[-_LOOKED - 1 :])):
            return None, spent
    return None, len(epsilons)


def _by_rounds(
    rounds: LaggedFriction | ConvexRounds, least: float, closer: float, bonded: np.ndarray, offered: set[bytes],
    budget: int,
) -> Iterator[tuple[States | None, int]]:  # fmt: skip
    """States that ``rounds`` propose once their normal forces change by less than ``least``, then whenever they do
    ``closer`` times as little, and the solutions spent since the last; at most ``budget`` in all, None at the end.
    Raises `Unsettled`."""
    told, bound = 0, least
    try:
        for change in rounds.rounds():
            if change < bound:
                states = States(*rounds.decided(), bonded)
                if states.key not in offered:
                    offered.add(states.key)
                    bound = closer * change
                    yield states, rounds.solutions - told
                    told = rounds.solutions
            if rounds.solutions > budget or change < _SAME:
                break
    except np.linalg.LinAlgError as error:
        raise Unsettled(str(error)) from error
    yield None, rounds.solutions - told


def _by_stages(laws: RoundedLaws, bonded: np.ndarray, offered: set[bytes]) -> Iterator[tuple[States | None, int]]:
    """As `_by_rounds`, by the stages of laws rounded off."""
    told = 0
    try:
        for state, direction in laws.stages():
            states = States(state, direction, bonded)
            if states.key not in offered:
                offered.add(states.key)
                yield states, laws.solutions - told
                told = laws.solutions
    except np.linalg.LinAlgError as error:
        raise Unsettled(str(error)) from error
    yield None, laws.solutions - told


def _slower(
    equations: Equations, answer: Answer, path: CentralPath, bonded: np.ndarray, offered: set[bytes], budget: int
) -> Iterator[tuple[States, int]]:
    """States that laws rounded off propose, from where the ``path`` was blocked, then rounds of lagged friction, and
    the solutions spent since the last (in statics, where the first hardly ever do, those of convex problems before;
    rounds know nothing of lift). Where the matrix is dense a hundred solutions cost little, and blocks that topple one
    by one go the surer way at once. Raises `Unsettled`."""
    of, lift = equations, equations.springs.lift.any()
    step = of.pattern, of.matrix, of.right, of.found, of.vectors, answer.springs, answer.gap, bonded

    def by_laws():
        return _by_stages(RoundedLaws(*step, path.unknowns, float(np.sqrt(path.epsilon))), bonded, offered)

    def by_convex_rounds():
        return _by_rounds(ConvexRounds(*step, of.found.normal), _CONVEX_CHANGE, _NEARER, bonded, offered, 2 * budget)

    def by_lagged_friction():
        return _by_rounds(LaggedFriction(*step), _CHANGE, _CLOSER, bonded, offered, budget)

    large = of.pattern.solver is not None
    ways = [
        *([by_convex_rounds] if large and of.statics and not lift else []),
        *([by_laws] if large else []),
        *([by_lagged_friction] if not lift else []),
    ]
    told = 0
    for states, spent in chain.from_iterable(way() for way in ways):
        told += spent
        if states is not None:
            yield states, told
            told = 0


def settle(
    pattern: assembly.Pattern,
    matrix: np.ndarray,
    right: np.ndarray,
    found: ContactSet,
    vectors: np.ndarray,
    springs: Springs,
    gap: np.ndarray,
    slack: np.ndarray,
    max_iterations: int,
    curved: CurvedJoints | None = None,
    statics: bool = False,
    patient: bool = True,
    patches: bool = True,
    expected: np.ndarray | None = None,
) -> Settled:
    """Iterate from the states of ``found`` to consistent ones, of a step in motion or in ``statics``; ``matrix``
    (n, 6, 6) and ``right`` (n, 6) are the blocks' own part, ``springs`` and ``gap`` those of this step (dashpots
    included), ``slack`` (n_contacts,) m the gaps that decide nothing. ``curved`` joints bend them from iteration to
    iteration. An iteration is a solution of the step's equations, those along the central path included. ``expected`` (6 n,) is the motion that velocities alone would make, None where
    there are none. Unless ``patient``, systems too large for a dense matrix are not asked for by laws and rounds that
    take hundreds: a shorter step takes less, of `MANY` in motion at the first sign. ``patches``: few contacts that stay
    wrong are settled by themselves (`patches`).

    Bonds break where all else is right, and those first that a load growing from the step's start breaks first. Where
    there are many contacts this takes long: those that open lose their bonds at once then, all that are overloaded by
    half as much as the worst go together, and what is closed in the end gets its bond back (`_given_back`).

    Raises `Unsettled` when ``max_iterations`` do not suffice.
    """
    equations = Equations(pattern, matrix, right, found, vectors, springs, gap, slack, curved, statics, expected)
    effort = _Effort(max_iterations, patient, patches, in_order=len(found) <= _FEW)
    settled = _settled(equations, effort)
    return settled if effort.in_order else _given_back(equations, effort, settled)


@dataclass(frozen=True)
class _Effort:
    """What the states may take: arguments as for `settle`; bonds break ``in_order``, or many at once."""

    max_iterations: int
    patient: bool
    patches: bool
    in_order: bool


def _given_back(equations: Equations, effort: _Effort, settled: Settled) -> Settled:
    """The step ``settled`` with the bonds that it has taken from contacts which are closed in the end; as it is where
    that does not settle soon."""
    found = equations.found
    began = found.bonded if found.tried is None else found.tried[2]
    effort = replace(effort, max_iterations=effort.max_iterations // _BACK, patient=False, in_order=True)
    iterations = settled.iterations
    back = np.zeros(len(found), bool)
    while True:
        lost = (began > 0) & (settled.bonded == 0) & (settled.state != OPEN) & ~back
        if not lost.any():
            return replace(settled, iterations=iterations)
        back |= lost
        tried = (
            np.where(lost, STICK, settled.state), np.where(lost, 0.0, settled.direction),
            np.where(lost, began, settled.bonded),
        )  # fmt: skip
        try:
            settled = _settled(replace(equations, found=replace(found, tried=tried)), effort)
        except Unsettled as failure:
            log.debug("%d bonds that gave way on the way to the states are not given back: %s", lost.sum(), failure)
            return replace(settled, iterations=iterations + effort.max_iterations)
        iterations += settled.iterations


def _settled(equations: Equations, effort: _Effort) -> Settled:
    """As `settle`, in one go."""
    pattern, found, springs = equations.pattern, equations.found, equations.springs
    statics, max_iterations, in_order = equations.statics, effort.max_iterations, effort.in_order
    patient, patches = effort.patient, effort.patches
    states = States(*((found.state, found.direction, found.bonded) if found.tried is None else found.tried))
    normal_force, slip = found.normal, np.zeros(len(found))
    seen: set[bytes] = set()
    offered: set[bytes] = set()
    path: CentralPath | None = None
    slower: Iterator[tuple[States, int]] | None = None
    caution, fewest, tries = _ALL, np.inf, 0
    few, small = len(found) <= _FEW, pattern.solver is None
    cheap = small or pattern.solver.in_parts
    hurried = hurries(patient, statics, pattern.n)
    iteration, most = 0, max_iterations
    # Contacts (n,) that were wrong in the last iterations, when few were, and how often they were sought together.
    lately, joint, left = [], 0, _SOLUTIONS
    best, patched, proposed = None, 0, False
    # What closes sticking, is pulled open by its own shear and closes again can only slide: neither of the two states
    # fits.
    closed, sheared = np.zeros(len(found), np.int64), np.zeros(len(found))
    while True:
        iteration += 1
        answer = equations.answer(states, normal_force, slip)
        normal_force, slip = answer.forces[:, 0], answer.slip
        sheared = np.where(states.state == STICK, answer.forces[:, 1], sheared)
        wrong = answer.violation > 0
        if not wrong.any() and (answer.missed is None or not answer.missed.any()):
            return equations.settled(states, answer, iteration)
        if iteration >= max_iterations:
            break
        if not wrong.any():
            continue
        number = int(wrong.sum())
        if not in_order:
            answer = replace(answer, called=answer.called.without_open_bonds())
        bonds = wrong & (states.bonded != answer.called.bonded)
        if bonds.sum() == number:
            # None breaks before all else is right, and those that give way first break first.
            if in_order:
                wrong = equations.first_bonds(states, answer, bonds)
            else:
                wrong = bonds & _worst_of_their_blocks(answer.violation, found.block, found.other, pattern.order, 0.5)
            states, caution, fewest, tries = states.switched(wrong, answer.called), _ALL, np.inf, 0
            # What was tried knew of bonds that are gone, and what is left has time of its own: there are fewer bonds
            # each time.
            slower, max_iterations = None, max(max_iterations, iteration + (most if few or not in_order else _FINISH))
            continue
        wrong &= ~bonds
        closing = wrong & (states.state == OPEN) & (answer.called.state == STICK)
        called = answer.called.sliding(closing & (closed > 0), sheared)
        closed += closing
        returned = states.key in seen
        seen.add(states.key)
        if returned and _negligible(answer, found, number):
            return equations.settled(states, answer, iteration)
        tries = 0 if number <= _FEWER * fewest else tries + 1
        fewest = min(fewest, number)
        most_tries = -1 if hurried else _TRIES
        if not few and number <= (_FEW_OF_MANY if hurried and cheap else _FEW_OF_ALL) * len(found):
            most_tries = _TRIES_OF_FEW if cheap else _TRIES
        stuck = caution == _ALL and (returned or tries > most_tries)
        if few or caution != _ALL or number > _SOUGHT:
            lately, joint = [], 0
        else:
            lately = [*lately[-_LATELY:], wrong]
            loose = np.any(lately, axis=0) & (states.bonded == 0)
            if (stuck or joint) and joint < _TOGETHER and loose.any():
                joint += 1
                proposal, spent = equations.together(loose, states.switched(wrong & ~loose, called), answer, left)
                left -= spent
                if proposal is not None and proposal.key not in seen:
                    states = proposal
                    continue
                joint = _TOGETHER
        # What a path leaves is what it could not decide: small blocks between large ones, mostly.
        if not proposed and (best is None or number < _FALLS * best[0]):
            best = number, states, answer, wrong
        elif (
            patched < _PATCHES
            and patches
            and not small
            and (number if proposed else best[0]) <= _FEW_IN_PATCHES * len(found)
        ):
            patched += 1
            if proposed:
                best = number, states, answer, wrong
            proposal, spent = settled_in_patch(
                equations, best[3] | wrong, *best[1:3],
                partial(settle, max_iterations=most, statics=statics, patient=False, patches=False),
            )  # fmt: skip
            iteration, best, proposed = iteration + round(spent), None, False
            if proposal is not None and proposal.key not in seen:
                states, fewest, tries = proposal, np.inf, 0
                continue
        tired = caution == _SOME and (returned or tries > _MORE)
        if few and path is None:
            tired = iteration > _CAUTIOUS or (caution == _FIRST and returned)
        if stuck and not few and number <= _LITTLE:
            caution, tries = _SOME, 0
            seen.clear()
        elif tired or (stuck and not (few and path is None)):
            proposal = None
            if slower is None:
                bonded = states.without_open_bonds().bonded
                if path is None or not np.array_equal(path.bonded, bonded):
                    path = CentralPath(
                        pattern, equations.matrix, equations.right, found, equations.vectors, answer.springs,
                        answer.gap, bonded, normal_force, equations.room, equations.expected,
                    )  # fmt: skip
                # The last sixth of the iterations is kept for the careful ways.
                budget = (5 * max_iterations) // 6 - iteration
                proposal, spent = _proposed(path, states.bonded, offered, budget, small, hurried)
                iteration += spent
                if spent > budget:
                    max_iterations += spent - max(budget, 0) + _FINISH
            seen.clear()
            if proposal is None and hurried:
                break
            if proposal is None and (patient or small):
                if slower is None:
                    budget = _PATIENCE * max_iterations
                    slower = _slower(equations, answer, path, states.bonded, offered, budget)
                proposal, spent = next(slower, (None, 0))
                # What it takes is its own affair: without it the step would be cut, and cut again.
                iteration, max_iterations = iteration + spent, max_iterations + spent + _FINISH
            if proposal is not None:
                states, caution, fewest, tries, best, proposed = proposal, _ALL, np.inf, 0, None, True
                continue
            stuck = True
        if stuck and caution != _SOME or tired:
            caution = _WORST
            seen.clear()
            # A body held by sliding contacts alone has nothing but its inertia against the least imbalance: begin again
            # from sticking, and let only the contact that is worst off slide.
            rough = (springs.friction > 0) & (states.state == SLIP)
            states = States(np.where(rough, STICK, states.state), states.direction, states.bonded)
            continue
        if caution == _FIRST and returned:
            break
        if caution == _WORST and returned:
            caution = _FIRST
            seen.clear()
        if caution in (_SOME, _WORST):
            share = 0.5 if caution == _SOME else 1.0
            wrong &= _worst_of_their_blocks(answer.violation, found.block, found.other, pattern.order, share)
        elif caution == _FIRST:
            wrong[int(wrong.argmax()) + 1 :] = False
        states = states.switched(wrong, called)
    worst = int((answer.violation if answer.violation.any() else answer.missed).argmax())
    name = ("open", "sticking", "sliding")
    raise Unsettled(
        f"contact states did not settle in {iteration} open-close iterations; a contact that was "
        f"{name[states.state[worst]]} still disagrees with its motion",
        worst,
    )
